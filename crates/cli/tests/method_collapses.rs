//! `--method lindstrom-turk`, `melax` and `shortest-edge` from end to end.

use crate::desk::{CliSandbox, hills};

#[test]
fn each_method_reaches_its_count_and_names_itself() {
    let desk = CliSandbox::new();
    desk.put("hills.ply", &hills(20));
    for method in ["lindstrom-turk", "melax", "shortest-edge"] {
        let words = format!("simplify hills.ply -o low.ply --faces 100 --method {method} --json");
        let report = &desk.run(&words).with_status(0).objects()[0];
        assert_eq!((&report["method"], &report["reached"]), (&method.into(), &true.into()));
        assert!((99..=100).contains(&desk.faces("low.ply")), "{method}");
    }
}

#[test]
fn a_length_is_a_target_of_its_own() {
    let desk = CliSandbox::new();
    desk.put("hills.ply", &hills(20));
    let run = |target: &str| {
        let words = format!("simplify hills.ply -o low.ply --method shortest-edge {target} --json");
        desk.run(&words).with_status(0).objects()[0].clone()
    };
    let report = run("--edge-length 5%");
    assert_eq!((&report["stopped_by"], &report["reached"]), (&"exhausted".into(), &true.into()));
    assert!(report["collapses"].as_u64().expect("a count") > 0);
    let fewer = report["output"]["faces"].as_u64().expect("a count");
    let counted = run(&format!("--edge-length 5% --faces {}", fewer + 50));
    assert_eq!(counted["stopped_by"], "faces");
    // Without a length it needs a count.
    desk.run("simplify hills.ply -o low.ply --method shortest-edge").with_status(2);
}

#[test]
fn options_that_a_method_has_no_use_for_are_named() {
    let desk = CliSandbox::new();
    desk.put("hills.ply", &hills(6));
    for (words, option) in [
        ("--method melax --placement midpoint", "placement midpoint"),
        ("--method melax --fit on", "fit on"),
        ("--method lindstrom-turk --edge-length 1", "edge-length"),
    ] {
        let words = format!("simplify hills.ply -o low.ply --faces 20 {words}");
        let ran = desk.run(&words);
        assert!(
            ran.stderr.contains(option) && desk.names("").iter().all(|n| n != "low.ply"),
            "{}",
            ran.stderr
        );
    }
}
