//! Every command from end to end, on small files that the tests make themselves.

use std::fs;
use std::path::Path;
use std::time::Instant;

use serde_json::Value;

use crate::sandbox::{CliSandbox, coloured_cube, hills, keys, ply};

// ---------------------------------------------------------------- simplify

#[test]
fn simplify_writes_a_mesh_and_prints_one_line() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let outcome = sandbox.run("simplify hills.ply -o low.ply --ratio 0.25").with_status(0);
    let faces = sandbox.faces("low.ply");
    // A collapse can remove two faces, so one face less than requested is normal.
    assert!((199..=200).contains(&faces), "{faces}");
    assert_eq!(outcome.text().lines().count(), 1);
    let begin = format!("hills.ply: 800 → {faces} faces ({:.1} %), rms ", faces as f64 / 8.0);
    assert!(outcome.text().starts_with(&begin), "{}", outcome.text());
    assert!(
        outcome.text().contains(" % of the diagonal, ") && !outcome.text().contains("max"),
        "{}",
        outcome.text()
    );
    assert_eq!(outcome.stderr, "");
}

#[test]
fn the_report_has_the_promised_keys_in_their_order() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let report = &sandbox.run("simplify hills.ply -o low.ply --faces 100 --json").with_status(0).objects()[0];
    let promised = [
        "input",
        "output",
        "method",
        "target",
        "reached",
        "stopped_by",
        "error",
        "refusals",
        "warnings",
        "threads",
        "seconds",
    ];
    assert_eq!(keys(report)[..promised.len()], promised);
    assert_eq!(keys(&report["input"]), ["path", "format", "faces", "vertices", "sizes"]);
    assert_eq!(keys(&report["output"]), ["path", "format", "faces", "vertices", "sizes"]);
    assert_eq!(keys(&report["error"]), ["estimate", "bound", "measured", "incomplete", "unit", "diagonal"]);
    assert_eq!(keys(&report["seconds"])[..3], ["read", "prepare", "simplify"]);
    assert_eq!(*keys(&report["seconds"]).last().expect("it has stages"), "write");
    assert_eq!(report["input"]["faces"], 800);
    assert_eq!(report["input"]["vertices"], 441);
    assert_eq!(report["output"]["path"], "low.ply");
    assert_eq!(report["method"], "memoryless");
    assert_eq!(report["target"].to_string(), r#"{"faces":100}"#);
    assert_eq!(report["reached"], true);
    assert_eq!(report["stopped_by"], "faces");
    assert_eq!(report["error"]["measured"], Value::Null);
    assert_eq!(report["error"]["bound"], Value::Null);
    let (faces, low) = (report["output"]["faces"].as_u64().expect("a count"), sandbox.info("low.ply"));
    assert!((1..=100).contains(&faces));
    assert_eq!((low["faces"].as_u64(), &low["vertices"]), (Some(faces), &report["output"]["vertices"]));
}

#[test]
fn a_measured_result_reports_the_largest_distance() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(12));
    let outcome = sandbox.run("simplify hills.ply -o low.ply --ratio 0.5 --measure").with_status(0);
    assert!(outcome.text().contains(" %, max "), "{}", outcome.text());
    let arguments = "simplify hills.ply --dry-run --ratio 0.5 --bound two-sided --json";
    let report = &sandbox.run(arguments).with_status(0).objects()[0];
    assert_eq!(keys(&report["error"]["measured"]), ["hausdorff", "mean", "rms", "farthest"]);
    assert_eq!(keys(&report["error"]["measured"]["rms"]), ["forward", "backward", "symmetric"]);
    let number = |value: &Value| value.as_f64().unwrap();
    let (bound, seen) = (&report["error"]["bound"], &report["error"]["measured"]["hausdorff"]);
    assert!(
        number(bound) >= number(&seen["symmetric"]) && number(bound) <= 1.03 * number(&seen["symmetric"])
    );
    let one = &sandbox.run(&arguments.replace("two-sided", "one-sided")).with_status(0).objects()[0]["error"]
        ["bound"];
    assert!(number(one) >= number(&seen["backward"]) && number(one) <= number(bound));
}

#[test]
fn an_error_limit_is_met_and_measured() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let report =
        &sandbox.run("simplify hills.ply -o low.ply --error 0.5% --json").with_status(0).objects()[0];
    assert_eq!(report["target"].to_string(), r#"{"error":"0.5%"}"#);
    let error = &report["error"];
    let largest = error["measured"]["hausdorff"]["symmetric"].as_f64().expect("it is measured");
    assert!(largest <= 0.005 * error["diagonal"].as_f64().expect("a length"), "{error}");
}

#[test]
fn the_place_of_the_largest_distance_and_the_end_of_a_run_are_reported() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let outcome = sandbox.run("simplify hills.ply -o low.ply --error 0.5% --json").with_status(0);
    let report = &outcome.objects()[0];
    assert_eq!(report["stopped_by"], "error");
    assert!(report["refusals"]["error_limit"].as_u64().is_some_and(|n| n > 0), "{report}");
    let measured = &report["error"]["measured"];
    let farthest = &measured["farthest"];
    assert_eq!(keys(farthest), ["direction", "point", "nearest"]);
    let direction = farthest["direction"].as_str().expect("a word");
    assert_eq!(measured["hausdorff"][direction], measured["hausdorff"]["symmetric"]);
    let point = |key: &str| [0, 1, 2].map(|k| farthest[key][k].as_f64().expect("a coordinate"));
    let [p, q] = ["point", "nearest"].map(point);
    let apart = (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
    let largest = measured["hausdorff"]["symmetric"].as_f64().expect("a distance");
    assert!((apart - largest).abs() < 1e-9, "{apart} {largest}");
    // The written mesh has the same place, but for the rounding of the file.
    let compared =
        &sandbox.run("compare hills.ply low.ply --samples 50000 --json").with_status(0).objects()[0];
    assert_eq!(compared["farthest"]["direction"], direction);
    for k in 0..3 {
        assert!((compared["farthest"]["point"][k].as_f64().expect("a coordinate") - p[k]).abs() < 1e-4);
    }
    let text = sandbox.run("simplify hills.ply -o low.ply --error 0.5% -v --force").with_status(0);
    let side = if direction == "forward" { "input" } else { "result" };
    for words in [
        &format!(" of the {side}\n"),
        "  largest distance 0.",
        "  stopped by error; refused: ",
        "error limit ",
    ] {
        assert!(text.text().contains(words), "{words}: {}", text.text());
    }
}

#[test]
fn targets_are_checked_at_the_command_line() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(3));
    for target in [
        "",
        "--ratio 0",
        "--ratio 1.5",
        "--ratio x",
        "--faces 0",
        "--faces 1.5",
        "--vertices 0",
        "--error x",
        "--error nan",
        "--error=-1",
        "--ratio 0.5 --max-normal 400",
        "--ratio 0.5 --min-quality 2",
        "--ratio 0.5 --max-valence 1",
        "--ratio 0.5 --threads 0",
        "--ratio 0.5 --time-limit 0",
        "--ratio 0.5 --scale 0",
        "--ratio 0.5 --method magic",
        "--ratio 0.5 --preset magic",
    ] {
        let outcome = sandbox.run(&format!("simplify hills.ply -o low.ply {target}")).with_status(2);
        assert!(
            outcome.stderr.starts_with("error: ") && outcome.stdout.is_empty(),
            "{target}: {}",
            outcome.stderr
        );
    }
    assert_eq!(sandbox.names("."), ["hills.ply"]);
}

#[test]
fn several_targets_may_be_combined() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(10));
    let arguments = "simplify hills.ply -o low.ply --ratio 0.5 --faces 10 --json";
    let report = &sandbox.run(arguments).with_status(0).objects()[0];
    assert_eq!(report["target"].to_string(), r#"{"faces":10,"ratio":0.5}"#);
    assert_eq!(report["stopped_by"], "ratio");
}

#[test]
fn every_option_reaches_the_engine() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(10));
    let arguments = "simplify hills.ply -o low.obj --ratio 0.5 --fit off --placement endpoint --border lock \
                 --topology preserve --max-normal 60 --min-quality 0.01 --max-valence 12 --max-edge 50% --weld 0.001 \
                 --seed 7 --threads 1 --time-limit 60 --prune 1e-9 --escalate --per-mesh --method memoryless --normals recompute \
                 --preset visual --weight border=2";
    sandbox.run(arguments).with_status(0);
    assert!(sandbox.faces("low.obj") <= 200);
    assert_eq!(sandbox.info("low.obj")["attributes"].to_string(), r#"["normals"]"#);
}

#[test]
fn threads_do_not_change_the_result() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(30));
    sandbox.run("simplify hills.ply -o one.ply --ratio 0.1 --threads 1").with_status(0);
    sandbox.run("simplify hills.ply -o three.ply --ratio 0.1 --threads 3").with_status(0);
    let read = |name| fs::read(sandbox.path(name)).expect("it was written");
    assert!(read("one.ply") == read("three.ply"));
}

#[test]
fn dropped_attributes_are_warnings_and_errors_with_strict() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    let outcome = sandbox.run("simplify cube.ply -o low.stl --ratio 1").with_status(0);
    assert!(
        outcome.stderr.starts_with("warning: cube.ply: ") && outcome.stderr.contains("colours"),
        "{}",
        outcome.stderr
    );
    let outcome = sandbox.run("simplify cube.ply -o low.stl --ratio 1 --json").with_status(0);
    assert_eq!(outcome.objects()[0]["warnings"].as_array().map(Vec::len), Some(1));
    assert!(outcome.stderr.contains("STL cannot carry colours"), "{}", outcome.stderr);
    fs::remove_file(sandbox.path("low.stl")).expect("it was written");
    let outcome = sandbox
        .run("simplify cube.ply -o low.stl --ratio 1 --strict --quiet")
        .with_status(3)
        .with_one_error();
    assert!(outcome.stdout.is_empty());
    assert_eq!(sandbox.faces("low.stl"), 12, "the result is written all the same");
}

/// Positions that are not finite are named wherever they are removed, and count as a loss.
#[test]
fn faces_that_are_not_finite_are_named() {
    let sandbox = CliSandbox::new();
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv nan 2 0\nf 1 2 3\nf 1 3 4\nf 4 3 5\n";
    sandbox.put("nan.obj", text);
    for job in ["convert nan.obj out.glb", "convert nan.obj out.ply", "simplify nan.obj -o out.ply --ratio 1"]
    {
        let outcome = sandbox.run(&format!("{job} --strict --force")).with_status(3).with_one_error();
        assert!(outcome.stderr.contains("not finite"), "{}", outcome.stderr);
    }
    assert_eq!(sandbox.faces("out.ply"), 2);
}

#[test]
fn a_scene_without_faces_is_a_loss() {
    let sandbox = CliSandbox::new();
    let empty =
        r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"name": "a"}]}"#;
    sandbox.put("empty.gltf", empty);
    sandbox.run("convert empty.gltf out.glb").with_status(0);
    let outcome = sandbox.run("convert empty.gltf out.glb --strict --force").with_status(3).with_one_error();
    assert!(outcome.stderr.contains("no faces"), "{}", outcome.stderr);
}

#[test]
fn attributes_are_kept() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    let outcome =
        sandbox.run("simplify cube.ply -o low.ply --faces 8 --strict --weight color=2").with_status(0);
    assert_eq!(outcome.stderr, "");
    assert_eq!(sandbox.info("low.ply")["attributes"].to_string(), r#"["colors"]"#);
    for wrong in ["--weight color", "--weight colour=1", "--weight color=-1"] {
        sandbox.run(&format!("simplify cube.ply -o low.ply --faces 8 {wrong}")).with_status(2);
    }
}

#[test]
fn a_failing_file_does_not_stop_the_others() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(5));
    sandbox.put("bad.ply", "ply\nformat ascii 1.0\nelement vertex many\nend_header\n");
    sandbox.put("b.ply", &hills(6));
    let outcome =
        sandbox.run("simplify a.ply bad.ply missing.ply b.ply -O low --ratio 0.5 --json").with_status(1);
    let objects = outcome.objects();
    assert_eq!(objects.len(), 4);
    assert_eq!(objects[0]["input"]["path"], "a.ply");
    assert_eq!(keys(&objects[1]), ["path", "error"]);
    assert_eq!(objects[1]["path"], "bad.ply");
    assert_eq!(objects[2]["path"], "missing.ply");
    assert_eq!(objects[3]["input"]["path"], "b.ply");
    assert_eq!(outcome.stderr.lines().count(), 2);
    assert!(outcome.stderr.starts_with("error: bad.ply: "), "{}", outcome.stderr);
    assert_eq!(sandbox.names("low"), ["a_low.ply", "b_low.ply"]);
}

#[test]
fn results_are_in_the_order_of_the_inputs() {
    let sandbox = CliSandbox::new();
    let names: Vec<String> = (0..9).map(|i| format!("m{i}.ply")).collect();
    for (i, name) in names.iter().enumerate() {
        sandbox.put(name, &hills(20 - 2 * i));
    }
    let arguments = format!("simplify {} -O low --ratio 0.5 --json --threads 4", names.join(" "));
    let objects = sandbox.run(&arguments).with_status(0).objects();
    let got: Vec<&str> = objects.iter().filter_map(|o| o["input"]["path"].as_str()).collect();
    assert_eq!(got, names);
}

#[test]
fn results_are_named_by_the_template() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(3));
    sandbox.put("b.ply", &hills(3));
    sandbox
        .run("simplify a.ply b.ply -O out/deep --to stl --name {stem}-half.{ext} --ratio 0.5")
        .with_status(0);
    assert_eq!(sandbox.names("out/deep"), ["a-half.stl", "b-half.stl"]);
    assert_eq!(sandbox.info("out/deep/a-half.stl")["format"], "stl");
    for arguments in ["-O out --name same.ply", "-o one.ply", "-O out --name {nothing}.ply"] {
        let outcome = sandbox.run(&format!("simplify a.ply b.ply {arguments} --ratio 0.5"));
        outcome.with_status(2).with_one_error();
    }
    assert_eq!(sandbox.names("out"), ["deep"], "nothing is done before the fault is found");
}

#[test]
fn standard_streams_carry_meshes() {
    let sandbox = CliSandbox::new();
    let outcome = sandbox.run_with("simplify - -o - --to stl --ratio 0.5", hills(10)).with_status(0);
    let faces = (outcome.stdout.len() - 84) / 50;
    assert!((99..=100).contains(&faces), "{faces}");
    assert!(outcome.stderr.starts_with(&format!("-: 200 → {faces} faces")), "{}", outcome.stderr);
    let outcome = sandbox.run_with("info - --json", outcome.stdout).with_status(0);
    assert_eq!(
        (&outcome.objects()[0]["format"], &outcome.objects()[0]["faces"]),
        (&"stl".into(), &faces.into())
    );
    sandbox.run_with("simplify - -o - --ratio 0.5", hills(2)).with_status(2).with_one_error();
    sandbox.run_with("info --from stl -", "no mesh").with_status(1).with_one_error();
    sandbox.run("compare - -").with_status(2).with_one_error();
}

#[test]
fn an_existing_file_survives_a_failure_and_a_folder_is_refused() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(3));
    sandbox.put("bad.ply", "ply\nbad");
    sandbox.put("out.ply", "precious");
    sandbox.run("simplify bad.ply -o out.ply --ratio 0.5").with_status(1).with_one_error();
    assert_eq!(fs::read_to_string(sandbox.path("out.ply")).expect("it is there"), "precious");
    sandbox.run("simplify a.ply -o out.ply --ratio 0.5").with_status(0);
    assert_eq!(sandbox.faces("out.ply"), 9);
    fs::create_dir(sandbox.path("folder.ply")).expect("the file can be written");
    for command in ["simplify --ratio 0.5 a.ply -o", "simplify --ratio 0.5 --force a.ply -o", "convert a.ply"]
    {
        sandbox.run(&format!("{command} folder.ply")).with_status(2).with_one_error();
    }
    sandbox.run("simplify a.ply -o nowhere/out.ply --ratio 0.5").with_status(1).with_one_error();
    sandbox.run("simplify a.ply -O out.ply --ratio 0.5").with_status(2).with_one_error();
    assert_eq!(
        sandbox.names("."),
        ["a.ply", "bad.ply", "folder.ply", "out.ply"],
        "nothing else stays behind"
    );
}

#[test]
fn a_file_can_be_its_own_output_with_force() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(10));
    sandbox.run("simplify a.ply -o a.ply --faces 50 --force").with_status(0);
    assert!(sandbox.faces("a.ply") <= 50);
}

#[test]
fn a_write_protected_file_needs_force() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(3));
    sandbox.put("out.ply", "precious");
    let protect = |yes| {
        let mut permissions = fs::metadata(sandbox.path("out.ply")).expect("it is there").permissions();
        permissions.set_readonly(yes);
        fs::set_permissions(sandbox.path("out.ply"), permissions).expect("the test owns it");
    };
    protect(true);
    sandbox.run("convert a.ply out.ply").with_status(1).with_one_error();
    assert_eq!(fs::read_to_string(sandbox.path("out.ply")).expect("it is there"), "precious");
    sandbox.run("convert a.ply out.ply --force").with_status(0);
    assert_eq!(sandbox.faces("out.ply"), 18);
    assert_eq!(sandbox.names("."), ["a.ply", "out.ply"]);
}

#[test]
fn a_dry_run_writes_nothing_and_reports_losses() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    let arguments = "simplify cube.ply -O low --to stl --ratio 1 --dry-run --json";
    let report = &sandbox.run(arguments).with_status(0).objects()[0];
    assert_eq!(report["dry_run"], true);
    assert_eq!(report["output"]["format"], "stl");
    assert_eq!(sandbox.names("."), ["cube.ply"]);
}

#[test]
fn quiet_prints_nothing_and_verbose_prints_more() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(5));
    let outcome = sandbox.run("simplify a.ply -o b.ply --ratio 0.5 --quiet").with_status(0);
    assert_eq!((outcome.stdout.len(), outcome.stderr.as_str()), (0, ""));
    let outcome = sandbox.run("simplify a.ply -o b.ply --ratio 0.5 -v").with_status(0);
    assert!(outcome.text().contains("prepare ") && outcome.text().lines().count() > 1, "{}", outcome.text());
    let outcome =
        sandbox.run("simplify nothing.ply -o b.ply --ratio 0.5 --quiet").with_status(1).with_one_error();
    assert_eq!(outcome.stderr, "error: nothing.ply: cannot read: there is no such file\n");
}

#[test]
fn the_output_is_scaled_and_rotated() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    sandbox.run("convert cube.ply big.ply --scale 10 --up y").with_status(0);
    let bounds = &sandbox.info("big.ply")["bounds"];
    assert_eq!(bounds["min"].to_string(), "[0.0,0.0,-10.0]");
    assert_eq!(bounds["max"].to_string(), "[10.0,10.0,0.0]");
    assert!(
        sandbox.info("big.ply")["volume"].as_f64().expect("a volume") > 999.0,
        "it is not turned inside out"
    );
}

// ------------------------------------------------ info, compare, convert

#[test]
fn info_has_the_promised_keys_in_their_order() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    let info = sandbox.info("cube.ply");
    assert_eq!(
        keys(&info),
        [
            "path",
            "format",
            "meshes",
            "faces",
            "polygons",
            "vertices",
            "positions",
            "components",
            "border_edges",
            "border_loops",
            "non_manifold_edges",
            "non_manifold_vertices",
            "degenerate_faces",
            "duplicate_faces",
            "two_sided_faces",
            "unused_vertices",
            "non_finite_vertices",
            "closed",
            "closed_by_index",
            "manifold",
            "oriented",
            "genus",
            "bounds",
            "area",
            "volume",
            "attributes",
            "materials",
            "textures",
            "skins",
            "animations",
            "morph_targets",
            "sizes",
            "cache",
            "warnings",
        ]
    );
    assert_eq!(keys(&info["bounds"]), ["min", "max", "diagonal"]);
    assert_eq!(
        (&info["closed"], &info["manifold"], &info["oriented"]),
        (&true.into(), &true.into(), &true.into())
    );
    assert_eq!(
        (&info["genus"], &info["components"], &info["border_edges"]),
        (&0.into(), &1.into(), &0.into())
    );
    assert!((info["area"].as_f64().expect("an area") - 6.0).abs() < 1e-9);
    assert!((info["volume"].as_f64().expect("a volume") - 1.0).abs() < 1e-9);
    assert_eq!(info["attributes"].to_string(), r#"["colors"]"#);
}

#[test]
fn info_names_defects() {
    let sandbox = CliSandbox::new();
    // Three faces at one edge, one of them duplicated, one without area, and an unused vertex.
    let vertices = "0 0 0\n1 0 0\n0 1 0\n0 -1 0\n0 0 1\n9 9 9\n";
    let faces = "3 0 1 2\n3 1 0 3\n3 0 1 4\n3 0 1 4\n3 0 0 1\n";
    sandbox.put("bad.ply", &ply("", 6, 5, vertices, faces));
    let info = sandbox.info("bad.ply");
    assert_eq!((&info["manifold"], &info["genus"]), (&false.into(), &Value::Null));
    assert_eq!(info["duplicate_faces"], 1);
    assert_eq!(info["degenerate_faces"], 1);
    assert_eq!(info["unused_vertices"], 1);
    let outcome = sandbox.run("info bad.ply").with_status(0);
    for line in ["  duplicate faces   1", "  surface           not closed, not manifold"] {
        assert!(outcome.text().contains(line), "{}", outcome.text());
    }
}

#[test]
fn info_continues_after_a_failure() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(2));
    let outcome = sandbox.run("info --json missing.ply a.ply").with_status(1);
    assert_eq!(keys(&outcome.objects()[0]), ["path", "error"]);
    assert_eq!(outcome.objects()[1]["faces"], 8);
    sandbox.run("info").with_status(2);
}

#[test]
fn compare_has_the_promised_keys_and_recognises_equal_meshes() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(8));
    sandbox.run("convert a.ply b.ply --scale 1.5").with_status(0);
    let same =
        sandbox.run("compare a.ply a.ply --json --samples 1000 --seed 3").with_status(0).objects().remove(0);
    assert_eq!(
        keys(&same),
        [
            "hausdorff",
            "mean",
            "rms",
            "farthest",
            "p99",
            "relative_to_diagonal",
            "diagonal",
            "normal_deviation_deg",
            "samples",
            "seed",
            "attributes",
            "warnings",
        ]
    );
    assert_eq!(keys(&same["p99"]), ["forward", "backward", "symmetric"]);
    assert_eq!(keys(&same["relative_to_diagonal"]), ["hausdorff", "mean", "rms"]);
    assert_eq!(keys(&same["normal_deviation_deg"]), ["mean", "p95"]);
    assert_eq!(same["seed"], 3);
    assert!(same["hausdorff"]["symmetric"].as_f64().expect("a distance") < 1e-12);
    let other = sandbox.run("compare a.ply b.ply --json").with_status(0).objects().remove(0);
    assert!(other["hausdorff"]["symmetric"].as_f64().expect("a distance") > 0.5);
    let table = sandbox.run("compare a.ply b.ply").with_status(0);
    for word in ["largest", "mean", "rms", "p99", "forward", "backward", "symmetric", "farthest point  0."] {
        assert!(table.text().contains(word), "{}", table.text());
    }
    sandbox.run("compare a.ply missing.ply").with_status(1).with_one_error();
}

#[test]
fn a_heat_map_colours_the_reference() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(8));
    sandbox.put("b.ply", &hills(3));
    sandbox.run("compare a.ply b.ply --heatmap heat.ply").with_status(0);
    let info = sandbox.info("heat.ply");
    assert_eq!((&info["faces"], &info["vertices"]), (&128.into(), &81.into()));
    assert_eq!(info["attributes"].to_string(), r#"["colors"]"#);
    sandbox.run("compare a.ply b.ply --heatmap heat.stl").with_status(2).with_one_error();
}

#[test]
fn convert_warns_of_data_that_the_format_lacks() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    let outcome = sandbox.run("convert cube.ply cube.obj").with_status(0);
    assert_eq!(outcome.stderr, "");
    assert_eq!(sandbox.info("cube.obj")["attributes"].to_string(), r#"["colors"]"#);
    let outcome = sandbox.run("convert cube.ply cube.stl").with_status(0);
    assert!(outcome.stderr.starts_with("warning: cube.ply: STL cannot carry colours"), "{}", outcome.stderr);
    sandbox.run("convert cube.ply strict.stl --strict").with_status(3).with_one_error();
    assert_eq!(sandbox.faces("strict.stl"), 12);
    for name in ["cube.off", "cube.glb", "cube.gltf", "text.ply"] {
        sandbox.run(&format!("convert cube.ply {name} --ascii")).with_status(0);
        assert_eq!(sandbox.faces(name), 12, "{name}");
    }
    assert!(fs::read_to_string(sandbox.path("text.ply")).expect("it is text").contains("format ascii"));
    let outcome = sandbox.run("convert cube.ply - --to stl --ascii --quiet").with_status(0);
    assert!(outcome.text().starts_with("solid"));
    sandbox.run("convert cube.ply cube.doc").with_status(2).with_one_error();
}

/// A triangle with an external image, an animated node and an unknown extension.
const SCENE: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[1]}],
"nodes":[{"name":"leaf","mesh":0},{"name":"root","children":[0],"scale":[2,2,2],"extras":{"z":1,"a":0.1}}],
"meshes":[{"name":"kite","primitives":[{"material":0,"attributes":{"POSITION":0}}]}],
"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}},"extensions":{"ACME_shine":{"b":2,"a":1}}}],
"textures":[{"source":0}],"images":[{"name":"skin","uri":"a%20b.png"}],"extensionsUsed":["ACME_shine"],
"animations":[{"channels":[{"sampler":0,"target":{"node":1,"path":"translation"}}],"samplers":[{"input":1,"output":2}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"count":1,"type":"SCALAR","min":[0],"max":[0]},
{"bufferView":1,"componentType":5126,"count":1,"type":"VEC3"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":12}],
"buffers":[{"byteLength":48,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAA"}]}"#;

#[test]
fn convert_keeps_a_whole_scene() {
    let sandbox = CliSandbox::new();
    for folder in ["in", "out"] {
        fs::create_dir(sandbox.path(folder)).expect("the folder can be created");
    }
    sandbox.put("in/a.gltf", SCENE);
    let image = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x02\0\0\0\x02\x08\x02\0\0\0";
    fs::write(sandbox.path("in/a b.png"), image).expect("the file can be written");
    let source: Value = serde_json::from_str(SCENE).expect("it is JSON");
    let kept =
        ["asset", "scene", "scenes", "nodes", "meshes", "materials", "textures", "animations", "accessors"];
    let json_of = |name: &str| {
        let bytes = fs::read(sandbox.path(name)).expect("it was written");
        let json = match bytes.strip_prefix(b"glTF") {
            None => bytes,
            Some(_) => bytes[20..]
                [..u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize]
                .to_vec(),
        };
        let json: Value = serde_json::from_slice(&json).expect("it is JSON");
        kept.iter()
            .for_each(|key| assert_eq!(json[key].to_string(), source[key].to_string(), "{name}: {key}"));
        json
    };

    // Into one file, with the image.
    let outcome = sandbox.run("convert in/a.gltf out/a.glb --strict").with_status(0);
    assert_eq!(outcome.stderr, "");
    let glb = json_of("out/a.glb");
    assert_eq!(glb["images"].to_string(), r#"[{"name":"skin","bufferView":2,"mimeType":"image/png"}]"#);
    let bytes = fs::read(sandbox.path("out/a.glb")).expect("it was written");
    assert!(bytes.windows(image.len()).any(|w| w == image));
    // And back; also from standard input.
    sandbox.run("convert out/a.glb out/b.gltf --strict").with_status(0);
    assert_eq!(json_of("out/b.gltf")["images"], glb["images"]);
    let outcome = sandbox.run_with("convert - - --to glb --quiet", bytes.clone()).with_status(0);
    assert_eq!(outcome.stdout, bytes);

    // Into another folder: with --textures link, the image is not copied.
    let outcome = sandbox.run("convert in/a.gltf out/c.gltf --strict --textures link").with_status(0);
    assert!(outcome.stderr.contains("still in the folder of the input: a%20b.png"), "{}", outcome.stderr);
    assert_eq!(json_of("out/c.gltf")["images"][0]["uri"], "../in/a%20b.png");
    let outcome = sandbox.run("convert in/a.gltf in/d.gltf --strict").with_status(0);
    assert_eq!(outcome.stderr, "");
    assert_eq!(json_of("in/d.gltf")["images"], source["images"]);

    // Another format, or a rotation, keeps only the mesh, with a warning.
    let outcome = sandbox.run("convert in/a.gltf out/a.ply").with_status(0);
    assert!(outcome.stderr.contains("animations are not carried"), "{}", outcome.stderr);
    sandbox.run("convert in/a.gltf out/e.glb --up z --strict").with_status(3);
    assert_eq!(sandbox.faces("out/e.glb"), 1);
}

#[test]
fn simplify_keeps_a_whole_scene() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.gltf", SCENE);
    let source: Value = serde_json::from_str(SCENE).expect("it is JSON");
    let outcome = sandbox.run("simplify a.gltf -o b.gltf --faces 1 --strict --json").with_status(0);
    let report = &outcome.objects()[0];
    assert_eq!((&report["input"]["faces"], &report["output"]["faces"]), (&1.into(), &1.into()));
    // The diagonal is measured in the scene, where a node makes the mesh twice as large.
    let diagonal = report["error"]["diagonal"].as_f64().expect("it is a number");
    assert!((diagonal - 8f64.sqrt()).abs() < 1e-6, "{diagonal}");
    let text = fs::read_to_string(sandbox.path("b.gltf")).expect("it was written");
    let json: Value = serde_json::from_str(&text).expect("it is JSON");
    for key in ["asset", "scene", "scenes", "nodes", "materials", "textures", "images", "animations"] {
        assert_eq!(json[key].to_string(), source[key].to_string(), "{key}");
    }
    // With more triangles, the mesh is simplified; its node is kept.
    sandbox.put("hills.ply", &hills(10));
    sandbox.run("convert hills.ply hills.glb").with_status(0);
    sandbox.run("simplify hills.glb -o low.glb --ratio 0.2 --strict").with_status(0);
    assert!(sandbox.faces("low.glb") <= 40);
    sandbox.run("simplify hills.glb -o low.ply --ratio 0.2").with_status(0);
    assert!(sandbox.faces("low.ply") <= 40);
    let arguments = "simplify hills.glb -o low.glb --ratio 0.2 --per-mesh --json";
    let meshes = &sandbox.run(arguments).with_status(0).objects()[0]["meshes"];
    assert_eq!((&meshes[0]["instances"], &meshes[0]["input"]["faces"]), (&1.into(), &200.into()));
    assert_eq!(meshes[0]["output"]["faces"].as_u64(), Some(sandbox.faces("low.glb")));
    assert_eq!(meshes[0]["reached"], true);
}

// ------------------------------------------------------- other commands

#[test]
fn manual_pages_and_completions_are_printed() {
    let sandbox = CliSandbox::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(sandbox.run(&format!("completions {shell}")).with_status(0).text().contains("lodsmith"));
    }
    assert!(sandbox.run("man").with_status(0).text().contains(".TH lodsmith 1"));
    assert!(sandbox.run("man simplify").with_status(0).text().contains("lodsmith\\-simplify"));
    sandbox.run("man nothing").with_status(2).with_one_error();
    assert!(sandbox.run("--version").with_status(0).text().starts_with("lodsmith 0."));
}

#[test]
fn unknown_commands_are_refused() {
    let sandbox = CliSandbox::new();
    for command in ["simplfy", "levels"] {
        let outcome = sandbox.run(command).with_status(2);
        assert!(outcome.stderr.contains("unrecognized subcommand"), "{command}: {}", outcome.stderr);
    }
}

#[test]
#[cfg(unix)]
fn a_closed_pipe_is_no_error() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(40));
    for arguments in ["info --json a.ply a.ply", "completions zsh", "simplify --help"] {
        let output = sandbox.run_without_reader(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments}");
        assert!(output.stderr.is_empty(), "{arguments}: {}", output.stderr.escape_ascii());
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_reported_once() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(4));
    let outcome = sandbox.run("convert a.ply /dev/full --to stl").with_status(1).with_one_error();
    assert_eq!(outcome.stderr.matches("No space left").count(), 1, "{}", outcome.stderr);
}

#[test]
#[cfg(unix)]
fn an_interrupt_leaves_no_partial_files() {
    use std::io::Read as _;
    use std::os::unix::process::ExitStatusExt as _;
    use std::process::Command;
    for (signal, status) in [("-INT", 130), ("-TERM", 143)] {
        let sandbox = CliSandbox::new();
        sandbox.put("a.ply", &hills(20));
        // The command waits for a mesh on a pipe that stays open, so that the interrupt cannot come too late.
        let mut child = sandbox.start("simplify a.ply - -O low --to ply --ratio 0.5 --threads 1 --json");
        // Waiting for the end would close the pipe.
        let _open = child.stdin.take();
        // The first report shows that the command has started.
        let mut byte = [0];
        child.stdout.as_mut().expect("it is piped").read_exact(&mut byte).expect("a report comes");
        // Uses the shell's builtin: a program of that name does not exist everywhere.
        let kill = ["-c", "kill \"$0\" \"$1\"", signal, &child.id().to_string()];
        assert!(Command::new("sh").args(kill).status().expect("a shell is there").success());
        let ended = child.wait().expect("it ends");
        assert_eq!((ended.code(), ended.signal()), (Some(status), None));
        assert_eq!(sandbox.names("low"), ["a_low.ply"]);
    }
}

/// The commands wait for a mesh on a pipe that stays open.
#[test]
fn a_time_limit_ends_every_command() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(4));
    for line in [
        "info -",
        "convert - b.ply",
        "clean - -o b.ply",
        "compare - a.ply",
        "render - -o b.png",
        // (These have partial results, but not of a file that is still being read.)
        "simplify - -o b.ply --ratio 0.5",
        "lod - -o b.glb --count 2",
        "methods - --ratio 0.5",
    ] {
        let mut child = sandbox.start(&format!("{line} --time-limit 0.2"));
        // Waiting for the end would close the pipe.
        let _open = child.stdin.take();
        let ended = child.wait_with_output().expect("it ends");
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(1), "{line}: {stderr}");
        assert!(stderr.contains("not done within the time limit of 0.2 s"), "{line}: {stderr}");
        assert_eq!(sandbox.names("."), ["a.ply"], "{line}");
    }
}

/// All levels were measured after the end of the time: 64 levels of a cube took 16 s. What is made in time is written, and
/// what is not measured has no numbers.
#[test]
fn levels_that_there_is_no_time_to_measure_have_no_distances() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(100));
    let begin = Instant::now();
    let line = "lod a.ply -o b.glb --count 64 --factor 0.95 --threads 1 --time-limit 1 --json";
    let done = sandbox.run(line).with_status(0);
    // (It is about two seconds, and without a limit many more. Tests run side by side.)
    assert!(begin.elapsed().as_secs() < 20, "{:?}", begin.elapsed());
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    let levels = report["levels"].as_array().unwrap();
    assert!(levels.last().is_some_and(|level| level["error"]["incomplete"] == Value::Bool(true)));
    for level in levels {
        let is_known = level["error"]["incomplete"] == Value::Bool(false);
        assert_eq!(level["error"]["measured"].is_object(), is_known, "{level}");
        assert_eq!(level["distance"].is_number(), is_known, "{level}");
        let says_so = level["warnings"]
            .to_string()
            .contains("time limit: the distance from the original is not measured");
        assert_eq!(says_so, !is_known, "{level}");
    }
    assert!(Path::new(&sandbox.path("b.glb")).is_file());
}

/// Each method had the whole time.
#[test]
fn methods_share_the_time_limit() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(100));
    let begin = Instant::now();
    let line = "methods a.ply --ratio 0.1 --threads 1 --time-limit 1 --json";
    let done = sandbox.run(line).with_status(0);
    assert!(begin.elapsed().as_secs() < 20, "{:?}", begin.elapsed());
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    let rows = report["methods"].as_array().unwrap();
    assert!(rows.iter().any(|row| row["measured"].is_null()));
    for row in rows {
        let says_so = row["warnings"].to_string().contains("is not measured");
        assert_eq!(row["measured"].is_null(), says_so, "{row}");
    }
}

#[test]
fn no_progress_bar_is_drawn_on_a_pipe() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(40));
    let outcome = sandbox.run("simplify a.ply -o b.ply --ratio 0.1").with_status(0);
    assert!(!outcome.stderr.contains('\x1b') && !outcome.text().contains('\x1b'));
    assert!(Path::new(&sandbox.path("b.ply")).is_file());
}

/// A closed surface may be open for programs that do not merge vertices at equal positions.
#[test]
fn info_says_whether_a_surface_is_closed_by_its_indices() {
    let sandbox = CliSandbox::new();
    let corners = ["0 0 0\n", "1 0 0\n", "0 1 0\n", "0 0 1\n"];
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let shared: String = faces.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n")).collect();
    sandbox.put("shared.ply", &ply("", 4, 4, &corners.concat(), &shared));
    let apart: String = faces.as_flattened().iter().map(|&i| corners[i]).collect();
    let each: String = (0..4).map(|f| format!("3 {} {} {}\n", 3 * f, 3 * f + 1, 3 * f + 2)).collect();
    sandbox.put("apart.ply", &ply("", 12, 4, &apart, &each));
    let closed = |name: &str| {
        let info = sandbox.info(name);
        (info["closed"].clone(), info["closed_by_index"].clone())
    };
    assert_eq!(closed("shared.ply"), (true.into(), true.into()));
    assert_eq!(closed("apart.ply"), (true.into(), false.into()));
    let text = sandbox.run("info apart.ply").with_status(0);
    assert!(text.text().contains("closed, not by its indices"), "{}", text.text());
}
