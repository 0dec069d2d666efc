//! `lodsmith methods` from end to end.

use serde_json::Value;

use crate::sandbox::{CliSandbox, coloured_cube, hills, keys, ply};

/// Arguments that select the methods that these tests run (by default, all run), with few samples: the figures are not
/// tested.
const METHODS: &str = "--samples 3000 --method memoryless --method quadric";

fn rows(report: &Value) -> &Vec<Value> {
    report["methods"].as_array().expect("a list")
}

#[test]
fn a_table_has_a_line_for_each_method() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let outcome = sandbox.run(&format!("methods hills.ply --faces 200 {METHODS}")).with_status(0);
    let lines: Vec<&str> = outcome.text().lines().collect();
    assert_eq!(lines[0], "hills.ply: 800 faces; distances in % of the diagonal");
    assert!(lines[1].starts_with("method ") && lines[1].ends_with("new defects  attributes"), "{}", lines[1]);
    assert!(lines[2].starts_with("memoryless ") && lines[3].starts_with("quadric "), "{}", outcome.text());
    for line in &lines[2..4] {
        let cells: Vec<&str> = line.split_whitespace().collect();
        let faces: usize = cells[1].parse().expect("a count");
        assert!((190..=200).contains(&faces), "{line}");
        assert_eq!(cells[3..5].iter().filter(|w| **w == "%" || **w == "s").count(), 1, "{line}");
        assert!(line.contains(" faces ") && line.contains(" none "), "{line}");
    }
    assert_eq!(outcome.stderr, "");
    assert_eq!(sandbox.names("."), ["hills.ply"], "nothing is written unasked");
}

#[test]
fn the_report_is_one_object_with_a_list() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let outcome = sandbox.run(&format!("methods hills.ply --ratio 0.25 --json {METHODS}")).with_status(0);
    let report = outcome.objects().remove(0);
    assert_eq!(outcome.objects().len(), 1);
    assert_eq!(keys(&report), ["input", "target", "diagonal", "samples", "threads", "methods", "warnings"]);
    assert_eq!(report["input"]["faces"], 800);
    assert_eq!(report["input"]["components"], 1);
    assert_eq!(report["input"]["defects"]["border_edges"], 80);
    assert_eq!(report["target"].to_string(), r#"{"ratio":0.25}"#);
    assert_eq!(report["samples"], 3000);
    let diagonal = report["diagonal"].as_f64().expect("a length");
    for row in rows(&report) {
        assert!(row["reached"] == true && row["output"] == Value::Null, "{row}");
        assert!(row["seconds"]["simplify"].as_f64().is_some_and(|s| s >= 0.0), "{row}");
        let largest = row["measured"]["hausdorff"]["symmetric"].as_f64().expect("it is measured");
        let mean = row["measured"]["mean"]["symmetric"].as_f64().expect("it is measured");
        assert!(largest > mean && mean > 0.0, "{row}");
        let share = row["relative_to_diagonal"]["hausdorff"].as_f64().expect("it is measured");
        assert!((share * diagonal - largest).abs() < 1e-9, "{row}");
        let risen = row["new_defects"].as_object().expect("an object");
        assert_eq!(risen.len(), 5, "{row}");
        assert_eq!(keys(&row["defects"]), keys(&report["input"]["defects"]));
        assert!(risen.values().all(|n| *n == 0), "{row}");
        assert_eq!(row["components"], 1);
    }
}

#[test]
fn figures_agree_with_simplify_and_compare() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(16));
    let arguments = format!("methods hills.ply -O out --vertices 60 --seed 4 --json {METHODS}");
    let report = sandbox.run(&arguments).with_status(0).objects().remove(0);
    for row in rows(&report) {
        let name = row["method"].as_str().expect("a word");
        let path = format!("out/hills_{name}.ply");
        assert_eq!(row["output"]["path"], path.as_str());
        let info = sandbox.info(&path);
        assert_eq!((&info["faces"], &info["vertices"]), (&row["faces"], &row["vertices"]));
        let own =
            sandbox.run(&format!("simplify hills.ply -o own.ply --vertices 60 --seed 4 --method {name}"));
        own.with_status(0);
        let [a, b] = [path.as_str(), "own.ply"].map(|p| std::fs::read(sandbox.path(p)).expect("it is there"));
        assert!(a == b, "{name}: differs from the mesh of simplify");
        let compared =
            sandbox.run(&format!("compare hills.ply {path} --seed 4 --samples 3000 --json")).with_status(0);
        let compared = compared.objects().remove(0);
        for figure in ["mean", "rms", "hausdorff"] {
            let [a, b] = [&row["measured"], &compared].map(|v| v[figure]["symmetric"].as_f64());
            let near = a.zip(b).is_some_and(|(a, b)| (a - b).abs() <= 1e-5 * b);
            assert!(near, "{name}: {figure} {a:?} and {b:?}");
        }
    }
}

#[test]
fn kept_and_dropped_attributes_are_reported() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    let arguments = "methods cube.ply --faces 8 --samples 3000 --json --method quadric";
    let report = sandbox.run(arguments).with_status(0).objects().remove(0);
    let carried = &rows(&report)[0]["carried"];
    assert_eq!(carried.to_string(), r#"{"kept":["colors"],"dropped":[],"regions":null}"#);
    let outcome = sandbox.run("methods cube.ply --faces 8 --method quadric").with_status(0);
    assert!(outcome.text().lines().last().is_some_and(|l| l.ends_with(" colors")), "{}", outcome.text());
}

#[test]
fn methods_are_run_once_each_in_their_order() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(6));
    let arguments = "methods hills.ply --faces 30 --samples 9 --method quadric --method memoryless --method quadric --json";
    let report = sandbox.run(arguments).with_status(0).objects().remove(0);
    let names: Vec<_> = rows(&report).iter().map(|r| r["method"].as_str().expect("a word")).collect();
    assert_eq!(names, ["memoryless", "quadric"]);
}

#[test]
fn all_methods_run_by_default() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(6));
    let report = sandbox.run("methods hills.ply --faces 30 --samples 3000 --json").objects().remove(0);
    let names: Vec<_> = rows(&report).iter().map(|r| r["method"].as_str().expect("a word")).collect();
    assert_eq!(names, lodsmith::MethodKind::ALL.map(lodsmith::MethodKind::name));
}

#[test]
fn a_method_that_fails_is_a_row() {
    let sandbox = CliSandbox::new();
    // A single face without area.
    sandbox.put("flat.ply", &ply("", 3, 1, "0 0 0\n1 0 0\n2 0 0\n", "3 0 1 2\n"));
    let outcome = sandbox.run(&format!("methods flat.ply --faces 1 --json {METHODS}")).with_status(1);
    let report = outcome.objects().remove(0);
    for row in rows(&report) {
        assert_eq!(keys(row), ["method", "error"]);
        assert!(row["error"].as_str().is_some_and(|e| e.contains("no face with an area")), "{row}");
    }
    assert_eq!(outcome.stderr.lines().count(), rows(&report).len(), "{}", outcome.stderr);
    let outcome = sandbox.run(&format!("methods flat.ply --faces 1 {METHODS}")).with_status(1);
    assert!(
        outcome.text().contains("\nquadric: failed: the mesh has no face with an area"),
        "{}",
        outcome.text()
    );
}

#[test]
fn an_unreached_target_has_a_reason() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    let outcome = sandbox.run("methods cube.ply --faces 1 --method quadric").with_status(0);
    assert!(outcome.text().contains("refusals, not reached"), "{}", outcome.text());
    let outcome = sandbox.run("methods cube.ply --faces 1 --method quadric -v").with_status(0);
    let last = outcome.text().lines().last().expect("a line");
    assert!(last.starts_with("  quadric: prepare ") && last.contains("refused: "), "{last}");
}

#[test]
fn threads_change_nothing_but_times() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(12));
    let report = |threads: usize| {
        let arguments = format!("methods hills.ply --error 1% --threads {threads} --json {METHODS}");
        let mut report = sandbox.run(&arguments).with_status(0).objects().remove(0);
        assert_eq!(report["threads"], threads);
        report["threads"] = Value::Null;
        for row in report["methods"].as_array_mut().expect("a list") {
            assert!(row["relative_to_diagonal"]["hausdorff"].as_f64().is_some_and(|x| x <= 0.01), "{row}");
            row["seconds"] = Value::Null;
        }
        report
    };
    assert_eq!(report(1), report(2));
}

#[test]
fn usage_errors() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(3));
    sandbox.put("file", "");
    for arguments in [
        "hills.ply",
        "--faces 5",
        "hills.ply --faces 0",
        "hills.ply --faces 5 --method magic",
        "hills.ply --faces 5 --sheet out.txt",
        "hills.ply hills.ply --faces 5",
        "hills.ply --faces 5 -O file",
        "- --faces 5 -O out",
    ] {
        let outcome = sandbox.run(&format!("methods {arguments}")).with_status(2);
        assert!(
            outcome.stderr.starts_with("error: ") && outcome.stdout.is_empty(),
            "{arguments}: {}",
            outcome.stderr
        );
    }
    sandbox.run("methods none.ply --faces 5 --method quadric").with_status(1).with_one_error();
    assert_eq!(sandbox.names("."), ["file", "hills.ply"]);
}

#[test]
fn quiet_prints_nothing_and_streams_are_read() {
    let sandbox = CliSandbox::new();
    let outcome = sandbox.run_with(&format!("methods - --faces 50 -q {METHODS}"), hills(8)).with_status(0);
    assert!(outcome.stdout.is_empty() && outcome.stderr.is_empty(), "{}", outcome.stderr);
    let arguments = format!("methods - --faces 50 --to obj -O out {METHODS}");
    sandbox.run_with(&arguments, hills(8)).with_status(0);
    assert_eq!(sandbox.names("out"), ["stdin_memoryless.obj", "stdin_quadric.obj"]);
}
