//! Options of `simplify` other than the target: locks, importance, proposals, escalation.

use std::fmt::Write as _;
use std::fs;

use serde_json::{Value, json};

use crate::sandbox::{CliSandbox, coloured_cube, hills, ply};

#[test]
fn an_unreachable_target_reports_what_stopped_the_run() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(6));
    // All vertices are on the border, so no vertex may change.
    sandbox.put("square.ply", &hills(1));
    let arguments = "simplify square.ply -o low.ply --faces 1 --border lock --topology preserve";
    let outcome = sandbox.run(arguments).with_status(0);
    assert!(
        outcome.stderr.starts_with("warning: square.ply: target not reached, stopped by refusals"),
        "{}",
        outcome.stderr
    );
    assert_eq!(sandbox.faces("low.ply"), 2);
    sandbox.run(&format!("{arguments} --strict")).with_status(3).with_one_error();
    let report = &sandbox.run(&format!("{arguments} --strict --json")).with_status(3).objects()[0];
    assert_eq!(report["reached"], false);
    assert_eq!(report["stopped_by"], "refusals");
    assert_eq!(report["refusals"].to_string(), r#"{"border":10}"#);
}

#[test]
fn an_unreachable_target_reports_what_would_help() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(10));
    let arguments = "simplify hills.ply -o low.ply --faces 2";
    let outcome = sandbox.run(&format!("{arguments} --border lock")).with_status(0);
    assert!(outcome.stderr.ends_with("; --border slide (now lock) would go further\n"), "{}", outcome.stderr);
    let report = &sandbox.run(&format!("{arguments} --border lock --json")).with_status(0).objects()[0];
    let changes = &report["proposals"][0]["changes"];
    assert_eq!(changes.to_string(), r#"[{"option":"border","now":"lock","to":"slide"}]"#);
    assert!(report["proposals"][0]["gain"].as_u64() > Some(0));
    let outcome = sandbox.run(&format!("{arguments} --max-edge 20%")).with_status(0);
    assert!(
        outcome.stderr.ends_with("; a higher --max-edge (now 20%) would go further\n"),
        "{}",
        outcome.stderr
    );
    // Only the shape limits the count: a closed surface needs four faces.
    sandbox.put("cube.ply", &coloured_cube());
    let outcome = sandbox.run("simplify cube.ply -o low.ply --faces 1").with_status(0);
    assert!(outcome.stderr.ends_with("; no option permits more collapses\n"), "{}", outcome.stderr);
    let report = &sandbox.run("simplify cube.ply -o low.ply --faces 1 --json").with_status(0).objects()[0];
    assert_eq!(report["proposals"].to_string(), "[]");
}

/// A ring of `around` by `across` quads.
fn ring(around: usize, across: usize) -> String {
    let (mut vertices, mut faces) = (String::new(), String::new());
    let turn = |i: usize, n: usize| i as f64 / n as f64 * std::f64::consts::TAU;
    for i in 0..around {
        for k in 0..across {
            let (a, b) = (turn(i, around), turn(k, across));
            let r = 1.0 + 0.4 * b.cos();
            vertices += &format!("{} {} {}\n", r * a.cos(), r * a.sin(), 0.4 * b.sin());
            let at = |i: usize, k: usize| i % around * across + k % across;
            let [p, q, r, s] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            faces += &format!("3 {p} {q} {r}\n3 {p} {r} {s}\n");
        }
    }
    ply("", around * across, 2 * around * across, &vertices, &faces)
}

#[test]
fn an_escalation_is_reported() {
    let sandbox = CliSandbox::new();
    sandbox.put("ring.ply", &ring(32, 12));
    let arguments = "simplify ring.ply -o low.ply --faces 4 --topology preserve --escalate";
    let outcome = sandbox.run(&format!("{arguments} --strict -v")).with_status(0);
    assert!(outcome.stderr.contains("escalated to --topology relaxed: 18 → 4 faces"), "{}", outcome.stderr);
    let report = &sandbox.run(&format!("{arguments} --json")).with_status(0).objects()[0];
    assert_eq!(report["reached"], true);
    assert!(report["necks_cut"].as_u64() > Some(0));
    let steps: Vec<_> = report["escalated"].as_array().expect("a list").iter().map(|s| &s["to"]).collect();
    assert_eq!(steps, ["relaxed"]);
    // Without --escalate, the report proposes the step.
    let arguments = "simplify ring.ply -o low.ply --faces 4 --topology preserve --json";
    let report = &sandbox.run(arguments).with_status(0).objects()[0];
    assert_eq!(report["proposals"][0]["changes"][0]["to"], "relaxed");
}

#[test]
fn small_parts_are_pruned_and_counted() {
    let sandbox = CliSandbox::new();
    // Tetrahedra of sizes 1, 2 and 4, apart.
    let (mut vertices, mut faces) = (String::new(), String::new());
    for (i, size) in [1, 2, 4].into_iter().enumerate() {
        let (x, n) = (10 * i, 4 * i);
        vertices += &format!("{x} 0 0\n{} 0 0\n{x} {size} 0\n{x} 0 {size}\n", x + size);
        for [a, b, c] in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
            faces += &format!("3 {} {} {}\n", a + n, b + n, c + n);
        }
    }
    sandbox.put("parts.ply", &ply("", 12, 12, &vertices, &faces));
    let arguments = "simplify parts.ply -o low.ply --ratio 1 --json --prune";
    let report = &sandbox.run(&format!("{arguments} 4")).with_status(0).objects()[0];
    assert_eq!(report["pruned"].to_string(), r#"{"parts":2,"faces":8}"#);
    assert_eq!((&report["warnings"], sandbox.faces("low.ply")), (&Value::Array(Vec::new()), 4));
    let report = &sandbox.run(&format!("{arguments} 10%")).with_status(0).objects()[0];
    assert_eq!(report["pruned"]["parts"], 1);
    let report = &sandbox.run(&format!("{arguments} 99")).with_status(0).objects()[0];
    assert_eq!(report["warnings"][0], "all parts are smaller than --prune: the largest was kept");
    assert_eq!(sandbox.faces("low.ply"), 4);
    let report = &sandbox.run(&format!("{arguments} 0")).with_status(0).objects()[0];
    assert_eq!(report["pruned"]["parts"], 0);
}

#[test]
fn explicit_options_override_a_preset() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let of = |arguments: &str| {
        sandbox.run(&format!("simplify hills.ply -o low.ply --ratio 0.2 {arguments}")).with_status(0);
        fs::read(sandbox.path("low.ply")).expect("it was written")
    };
    assert!(of("--preset auto") == of(""));
    let visual = of("--preset visual");
    assert_eq!(
        sandbox.info("low.ply")["attributes"],
        serde_json::json!([]),
        "temporary normals are not written"
    );
    assert!(visual != of(""));
    assert!(of("--preset cad") == of("--border slide --topology preserve --effort best"));
    assert!(of("--preset cad --border keep --topology relaxed --effort default") == of(""));
}

/// The hills as OBJ, the left half in a group with a material.
fn hills_in_groups(n: usize) -> String {
    let ply = hills(n);
    let body = ply.split_once("end_header\n").expect("it has a header").1;
    let (vertices, faces): (Vec<_>, Vec<_>) = body.lines().partition(|l| l.split(' ').count() == 3);
    let numbers =
        |l: &str| l.split(' ').skip(1).map(|i| i.parse::<usize>().expect("a number")).collect::<Vec<_>>();
    let line =
        |l: &&str| numbers(l).iter().fold("f".to_owned(), |text, i| format!("{text} {}", i + 1)) + "\n";
    let is_left = |l: &&&str| numbers(l)[0] % (n + 1) < n / 2;
    let (left, right): (Vec<&str>, Vec<&str>) = faces.iter().copied().partition(|l| is_left(&l));
    let mut text: String = vertices.iter().map(|v| format!("v {v}\n")).collect();
    text += "g left side\nusemtl grass\n";
    text.extend(left.iter().map(line));
    text += "g right\nusemtl rock\n";
    text.extend(right.iter().map(line));
    text
}

#[test]
fn parts_locked_by_name_are_unchanged() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.obj", &hills_in_groups(20));
    for name in ["left", "grass", "side"] {
        let arguments = format!("simplify hills.obj -o low.obj --ratio 0.6 --lock {name} --json");
        let report = &sandbox.run(&arguments).with_status(0).objects()[0];
        assert_eq!(report["reached"], true);
        assert_eq!(report["locked"]["faces"], 400, "{name}");
        assert_eq!(report["locked"]["vertices"], 11 * 21);
    }
    // Everything unlocked is removed; the reasons name the lock.
    let arguments = "simplify hills.obj -o low.obj --ratio 0.01 --lock left --lock rock --json";
    let report = &sandbox.run(arguments).with_status(0).objects()[0];
    assert_eq!((&report["reached"], &report["output"]["faces"]), (&false.into(), &800.into()));
    assert!(report["refusals"]["locked"].as_u64().is_some_and(|n| n > 0), "{}", report["refusals"]);
    let outcome = sandbox
        .run("simplify hills.obj -o low.obj --ratio 0.5 --lock middle")
        .with_status(1)
        .with_one_error();
    assert!(
        outcome.stderr.contains("--lock middle") && outcome.stderr.contains("grass, left side, left, side"),
        "{}",
        outcome.stderr
    );
    let plain = sandbox.run("simplify hills.obj -o low.obj --ratio 0.6 --json").with_status(0);
    assert_eq!(plain.objects()[0]["locked"], json!({ "vertices": 0, "faces": 0 }));
}

/// The hills with two additional vertex properties: whether y is above a half, and y.
fn marked_hills(n: usize) -> String {
    let ply = hills(n);
    let (header, body) = ply.split_once("element face").expect("it has faces");
    let mut marked = String::new();
    for line in body.lines() {
        let y = line.split(' ').nth(1).and_then(|y| y.parse::<f64>().ok());
        match (line.split(' ').count(), y) {
            (3, Some(y)) if !line.contains("list") => {
                writeln!(marked, "{line} {} {}", u8::from(y > 0.5), 200.0 * y).expect("text");
            }
            _ => writeln!(marked, "{line}").expect("text"),
        }
    }
    format!("{header}property uchar lock\nproperty float rank\nelement face{marked}")
}

#[test]
fn vertex_attributes_lock_and_weight() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &marked_hills(20));
    let outcome = sandbox.run("simplify hills.ply -o low.ply --faces 1 --lock lock --json").with_status(0);
    let report = &outcome.objects()[0];
    assert_eq!((&report["locked"]["vertices"], &report["locked"]["faces"]), (&210.into(), &360.into()));
    let left = report["output"]["faces"].as_u64().expect("a count");
    assert!((360..440).contains(&left), "{left}");

    // With importance, the half with large y gets more triangles.
    let far = |name: &str| {
        let text = fs::read_to_string(sandbox.path(name)).expect("it was written");
        let y = |l: &&str| l.split(' ').nth(2).and_then(|y| y.parse::<f64>().ok()).is_some_and(|y| y > 0.5);
        text.lines().filter(|l| l.starts_with("v ")).filter(y).count()
    };
    sandbox.run("simplify hills.ply -o plain.obj --faces 200").with_status(0);
    sandbox.run("simplify hills.ply -o far.obj --faces 200 --importance rank=20").with_status(0);
    assert!(far("far.obj") * 2 > far("plain.obj") * 3, "{} and {}", far("far.obj"), far("plain.obj"));
    let outcome = sandbox
        .run("simplify hills.ply -o x.ply --faces 9 --importance heat")
        .with_status(1)
        .with_one_error();
    assert!(
        outcome.stderr.contains("--importance heat") && outcome.stderr.contains("lock, rank"),
        "{}",
        outcome.stderr
    );
    sandbox.run("simplify hills.ply -o x.ply --faces 9 --importance rank=0").with_status(2);
}

#[test]
fn a_vertex_attribute_is_an_error_map() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &marked_hills(20));
    let run = |options: &str| {
        let line = format!("simplify hills.ply -o low.ply --error 5% {options} --json");
        let outcome = sandbox.run(&line).with_status(0);
        let report = &outcome.objects()[0];
        (report["output"]["faces"].as_u64().expect("a count"), report["locked"]["vertices"].as_u64())
    };
    let (plain, (mapped, locked)) = (run("").0, run("--error-map lock"));
    assert!(plain < mapped && mapped < 700, "{plain} {mapped}");
    // The half where the attribute is 0 is kept.
    assert_eq!(locked, Some(231));
    sandbox.run("simplify hills.ply -o x.ply --faces 9 --error-map lock").with_status(2);
    sandbox.run("simplify hills.ply -o x.ply --error 1% --method planar --error-map lock").with_status(2);
    for (name, wanted) in [("heat", "lock, rank"), ("rank", "from 0 to 1, not")] {
        let line = format!("simplify hills.ply -o x.ply --error 1% --error-map {name}");
        let outcome = sandbox.run(&line).with_status(1).with_one_error();
        assert!(outcome.stderr.contains(wanted), "{}", outcome.stderr);
    }
}

#[test]
fn a_part_of_a_scene_is_locked_by_its_names() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(10));
    sandbox.run("convert hills.ply hills.gltf").with_status(0);
    let text = fs::read_to_string(sandbox.path("hills.gltf")).expect("it was written");
    let mut json: Value = serde_json::from_str(&text).expect("it is JSON");
    json["nodes"][0]["name"] = "near".into();
    json["nodes"].as_array_mut().expect("nodes").push(serde_json::json!({
        "name": "far", "mesh": 1, "translation": [5, 0, 0]
    }));
    let mut mesh = json["meshes"][0].clone();
    mesh["primitives"][0]["material"] = 0.into();
    json["meshes"].as_array_mut().expect("meshes").push(mesh);
    json["materials"] = serde_json::json!([{ "name": "stone" }]);
    json["scenes"][0]["nodes"] = serde_json::json!([0, 1]);
    sandbox.put("two.gltf", &json.to_string());
    for name in ["far", "stone", "meshes[1]"] {
        let arguments = format!("simplify two.gltf -o low.glb --ratio 0.1 --lock {name} --json");
        let report = &sandbox.run(&arguments).with_status(0).objects()[0];
        assert_eq!((&report["reached"], &report["locked"]["faces"]), (&false.into(), &200.into()), "{name}");
        let left = report["output"]["faces"].as_u64().expect("a count");
        // (Slightly above the target, because the last faces would cost too much.)
        assert!((200..231).contains(&left), "{left}");
    }
    let outcome =
        sandbox.run("simplify two.gltf -o low.glb --ratio 0.1 --lock x").with_status(1).with_one_error();
    assert!(["near", "far", "stone"].iter().all(|n| outcome.stderr.contains(n)), "{}", outcome.stderr);
    let outcome =
        sandbox.run("simplify two.gltf -o low.obj --ratio 0.1 --lock far").with_status(1).with_one_error();
    assert!(outcome.stderr.contains("only if the output is glTF"), "{}", outcome.stderr);
}

#[test]
fn the_report_has_the_cells_of_clusters() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(60));
    let arguments = "simplify hills.ply -o low.ply --method cluster";
    let report = &sandbox.run(&format!("{arguments} --faces 700 --json")).with_status(0).objects()[0];
    assert_eq!((&report["method"], &report["stopped_by"]), (&Value::from("cluster"), &Value::from("faces")));
    assert_eq!(report["clustered"]["faces"], report["output"]["faces"]);
    assert!(report["clustered"]["cell"].as_f64() > Some(0.0));
    // The cell size ends a run without a target.
    let report = &sandbox.run(&format!("{arguments} --cell 5% --json")).with_status(0).objects()[0];
    assert_eq!((&report["reached"], &report["stopped_by"]), (&Value::from(true), &Value::from("exhausted")));
    let report =
        &sandbox.run(&format!("{arguments} --two-stage --faces 300 --json")).with_status(0).objects()[0];
    assert!(report["clustered"]["faces"].as_u64() > report["output"]["faces"].as_u64());
    let outcome = sandbox.run(&format!("{arguments} --faces 700 --topology preserve")).with_status(2);
    assert!(
        outcome.stderr.contains("topology preserve is not an option of method cluster"),
        "{}",
        outcome.stderr
    );
    // A grid with such small cells is impossible, and with such large cells no face would be left.
    for cell in ["0.0000001%", "1000"] {
        sandbox.run(&format!("{arguments} --cell {cell}")).with_status(2).with_one_error();
    }
}
