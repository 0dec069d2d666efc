//! `--method lindstrom-turk`, `melax` and `shortest-edge` from end to end.

use crate::sandbox::{CliSandbox, hills};

#[test]
fn each_method_reaches_its_count_and_is_named_in_the_report() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    for method in ["lindstrom-turk", "melax", "shortest-edge"] {
        let arguments = format!("simplify hills.ply -o low.ply --faces 100 --method {method} --json");
        let report = &sandbox.run(&arguments).with_status(0).objects()[0];
        assert_eq!((&report["method"], &report["reached"]), (&method.into(), &true.into()));
        assert!((99..=100).contains(&sandbox.faces("low.ply")), "{method}");
    }
}

#[test]
fn an_edge_length_is_a_target() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let run = |target: &str| {
        let arguments = format!("simplify hills.ply -o low.ply --method shortest-edge {target} --json");
        sandbox.run(&arguments).with_status(0).objects()[0].clone()
    };
    let report = run("--edge-length 5%");
    assert_eq!((&report["stopped_by"], &report["reached"]), (&"exhausted".into(), &true.into()));
    assert!(report["collapses"].as_u64().expect("a count") > 0);
    let fewer = report["output"]["faces"].as_u64().expect("a count");
    let counted = run(&format!("--edge-length 5% --faces {}", fewer + 50));
    assert_eq!(counted["stopped_by"], "faces");
    // Without a length, the method needs a count.
    sandbox.run("simplify hills.ply -o low.ply --method shortest-edge").with_status(2);
}

#[test]
fn options_that_a_method_does_not_have_are_named() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(6));
    for (arguments, option) in [
        ("--method melax --placement midpoint", "placement midpoint"),
        ("--method melax --fit on", "fit on"),
        ("--method lindstrom-turk --edge-length 1", "edge-length"),
    ] {
        let arguments = format!("simplify hills.ply -o low.ply --faces 20 {arguments}");
        let outcome = sandbox.run(&arguments);
        assert!(
            outcome.stderr.contains(option) && sandbox.names("").iter().all(|n| n != "low.ply"),
            "{}",
            outcome.stderr
        );
    }
}
