//! `--method planar` from end to end.

use std::fmt::Write as _;

use crate::sandbox::CliSandbox;

/// A ridge: two flat sides of n by n squares at an angle, or one flat sheet if `height` is zero.
fn ridge(n: usize, height: f64) -> String {
    let mut text = String::new();
    for i in 0..=2 * n {
        for j in 0..=n {
            let z = height * (n as f64 - (i as f64 - n as f64).abs());
            writeln!(text, "v {i} {j} {z}").expect("writing to a string cannot fail");
        }
    }
    for i in 0..2 * n {
        for j in 1..=n {
            let a = i * (n + 1) + j;
            let (b, c, d) = (a + n + 1, a + n + 2, a + 1);
            writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}").expect("writing to a string cannot fail");
        }
    }
    text
}

#[test]
fn flat_sides_become_as_few_triangles_as_their_outline_needs() {
    let sandbox = CliSandbox::new();
    sandbox.put("ridge.obj", &ridge(8, 0.5));
    let report = &sandbox.run("simplify ridge.obj -o low.obj --method planar --measure --json").objects()[0];
    assert_eq!(sandbox.faces("low.obj"), 4);
    assert_eq!((&report["reached"], &report["stopped_by"]), (&true.into(), &"exhausted".into()));
    let largest = report["error"]["measured"]["hausdorff"]["symmetric"].as_f64();
    assert!(largest < Some(1e-12), "{report}");
    let report = &sandbox.run("simplify ridge.obj -o low.obj --method planar --faces 3 --json").objects()[0];
    assert_eq!((&report["reached"], &report["stopped_by"]), (&false.into(), &"exhausted".into()));
    sandbox.run("simplify ridge.obj -o low.obj --method planar --faces 3 --strict").with_status(3);
    sandbox.run("simplify ridge.obj -o low.obj --method planar --faces 100").with_status(0);
    assert!((99..=100).contains(&sandbox.faces("low.obj")));
}

#[test]
fn angle_and_distance_both_limit_a_region() {
    let sandbox = CliSandbox::new();
    sandbox.put("ridge.obj", &ridge(8, 0.03));
    let faces = |arguments: &str| {
        sandbox.run(&format!("simplify ridge.obj -o low.obj --method planar {arguments}")).with_status(0);
        sandbox.faces("low.obj")
    };
    // The sides differ by 3.4 degrees, and the ridge is 0.24 high.
    assert_eq!(faces(""), 4);
    assert_eq!(faces("--flat 0.5"), 2);
    assert_eq!(faces("--error 0.5"), 2);
    assert_eq!(faces("--flat 0.5 --angle 1"), 4);
    assert_eq!(faces("--flat 0.02 --angle 80"), 4);
}

#[test]
fn unsupported_options_are_refused() {
    let sandbox = CliSandbox::new();
    sandbox.put("ridge.obj", &ridge(2, 0.5));
    for arguments in ["--max-valence 9", "--placement midpoint", "--fit on", "--cell 1"] {
        let outcome =
            sandbox.run(&format!("simplify ridge.obj -o low.obj --method planar {arguments}")).with_status(2);
        assert!(outcome.stderr.contains("not an option of method planar"), "{arguments}: {}", outcome.stderr);
    }
    sandbox.run("simplify ridge.obj -o low.obj --faces 4 --flat 0.1").with_status(2);
}
