//! `lodsmith lod` from end to end.

use std::fs;

use serde_json::Value;

use crate::sandbox::{CliSandbox, hills, keys};

fn list(sandbox: &CliSandbox, folder: &str) -> Value {
    let text = fs::read_to_string(sandbox.path(folder).join("lods.json")).expect("the list is there");
    serde_json::from_str(&text).expect("it is JSON")
}

#[test]
fn each_level_has_a_file_and_an_entry_in_the_list() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let outcome = sandbox.run("lod hills.ply -O out --levels 0.5,0.2").with_status(0);
    assert_eq!(outcome.text().lines().count(), 3, "{}", outcome.text());
    assert_eq!(sandbox.names("out"), ["hills_lod0.ply", "hills_lod1.ply", "hills_lod2.ply", "lods.json"]);
    let list = list(&sandbox, "out");
    assert_eq!(keys(&list), ["input", "unit", "diagonal", "screen", "levels"]);
    let levels = list["levels"].as_array().expect("a list");
    assert_eq!(levels.len(), 3);
    let mut before = -1.0;
    for (k, level) in levels.iter().enumerate() {
        let file = level["file"].as_str().expect("a name");
        assert_eq!(file, format!("hills_lod{k}.ply"));
        assert_eq!(sandbox.faces(&format!("out/{file}")), level["faces"].as_u64().expect("a count"));
        let (error, distance) = (level["error"].as_f64().unwrap(), level["distance"].as_f64().unwrap());
        assert!(distance > before, "{levels:?}");
        before = distance;
        // One pixel of 1080 at 60 degrees.
        let expected = error * 1080.0 / (2.0 * 30f64.to_radians().tan());
        assert!((distance - expected).abs() <= 1e-9 * expected, "{distance} for {expected}");
    }
    assert_eq!(levels[0]["faces"], 800);
}

#[test]
fn errors_in_the_list_agree_with_compare() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(16));
    sandbox.run("lod hills.ply -O out --faces 100 --fov 90 --height 1000 --pixels 2").with_status(0);
    let level = &list(&sandbox, "out")["levels"][1];
    let compared = &sandbox.run("compare hills.ply out/hills_lod1.ply --json").with_status(0).objects()[0];
    let near = |a: &Value, b: &Value| {
        let (a, b) = (a.as_f64().expect("a number"), b.as_f64().expect("a number"));
        assert!((a - b).abs() <= 0.02 * b, "{a} for {b}");
    };
    near(&level["error"], &compared["hausdorff"]["symmetric"]);
    near(&level["rms"], &compared["rms"]["symmetric"]);
    let ratio = level["distance"].as_f64().unwrap() / level["error"].as_f64().unwrap();
    assert!((ratio - 250.0).abs() < 1e-6, "{ratio}");
}

#[test]
fn lengths_in_the_list_are_in_units_of_the_files() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(16));
    sandbox.run("lod hills.ply -O one --faces 100").with_status(0);
    let report =
        &sandbox.run("lod hills.ply -O ten --faces 100 --scale 10 --json").with_status(0).objects()[0];
    let [one, ten] = ["one", "ten"].map(|folder| list(&sandbox, folder));
    let ratio = |a: &Value, b: &Value| a.as_f64().expect("a number") / b.as_f64().expect("a number");
    assert!((ratio(&ten["diagonal"], &one["diagonal"]) - 10.0).abs() < 1e-9);
    for key in ["error", "rms", "distance"] {
        let ratio = ratio(&ten["levels"][1][key], &one["levels"][1][key]);
        assert!((ratio - 10.0).abs() < 1e-6, "{key}: {ratio}");
    }
    assert_eq!(report["levels"][0]["distance"], ten["levels"][1]["distance"]);
}

#[test]
fn one_file_holds_all_levels() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    sandbox.run("lod hills.ply -o all.glb --count 3 --factor 0.5").with_status(0);
    assert_eq!(sandbox.faces("all.glb"), 800, "levels are not counted twice");
    let bytes = fs::read(sandbox.path("all.glb")).expect("it is there");
    let size = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: Value = serde_json::from_slice(&bytes[20..20 + size]).expect("JSON");
    assert_eq!(json["nodes"][0]["extensions"]["MSFT_lod"]["ids"].as_array().map(Vec::len), Some(3));
    assert_eq!(json["nodes"][0]["extras"]["MSFT_screencoverage"].as_array().map(Vec::len), Some(4));
    assert_eq!(json["meshes"].as_array().map(Vec::len), Some(4));
    let outcome = sandbox.run("lod all.glb -o again.glb --levels 0.5").with_status(1).with_one_error();
    assert!(outcome.stderr.contains("levels of detail already"), "{}", outcome.stderr);
}

#[test]
fn names_follow_the_style_or_the_template() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(8));
    sandbox.run("lod a.ply -O u --levels 0.5 --naming unity --to glb").with_status(0);
    assert_eq!(sandbox.names("u"), ["a_LOD0.glb", "a_LOD1.glb", "lods.json"]);
    sandbox.run("lod a.ply -O t --levels 0.5 --name {stem}-{level}.{ext} --to obj").with_status(0);
    assert_eq!(sandbox.names("t"), ["a-0.obj", "a-1.obj", "lods.json"]);
    for name in ["low.ply", "{level}{stem}.ply", "../{stem}{level}.ply"] {
        sandbox.run(&format!("lod a.ply -O t --levels 0.5 --name {name}")).with_status(2).with_one_error();
    }
}

#[test]
fn no_level_overwrites_the_input() {
    let sandbox = CliSandbox::new();
    sandbox.put("a2.ply", &hills(8));
    let command = "lod a2.ply -O . --levels 0.5,0.2 --name a{level}.ply";
    let outcome = sandbox.run(command).with_status(2).with_one_error();
    assert!(outcome.stderr.contains("a2.ply: is an input"), "{}", outcome.stderr);
    assert_eq!((sandbox.names("."), sandbox.faces("a2.ply")), (vec!["a2.ply".to_owned()], 128));
    sandbox.run(&format!("{command} --force")).with_status(0);
    assert!(sandbox.faces("a2.ply") < 128);
}

#[test]
fn levels_in_the_wrong_order_are_a_usage_error() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(8));
    for levels in ["--levels 0.2,0.5", "--faces 10,20", "--errors 1%,0.1%"] {
        let outcome = sandbox.run(&format!("lod a.ply -O out {levels}")).with_status(2).with_one_error();
        assert!(outcome.stderr.contains("levels must be "), "{}", outcome.stderr);
    }
}

#[test]
fn a_dry_run_leaves_standard_output_to_the_report() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(8));
    for command in ["lod a.ply --levels 0.5", "simplify a.ply --ratio 0.5"] {
        let outcome = sandbox.run(&format!("{command} -o - --to glb --dry-run")).with_status(0);
        assert!(outcome.text().starts_with("a.ply: 128 "), "{command}: {}", outcome.text());
        assert!(!outcome.stderr.contains("128"), "{command}: {}", outcome.stderr);
    }
}

#[test]
fn geomorph_data_are_written_to_glb_and_ply() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(12));
    sandbox.run("lod a.ply -O p --levels 0.5,0.2 --geomorph --ascii").with_status(0);
    let text = |name: &str| fs::read_to_string(sandbox.path(name)).expect("it is there");
    assert!(text("p/a_lod0.ply").contains("property float geomorph_x\n"));
    assert!(text("p/a_lod1.ply").contains("property float geomorph_z\n"));
    assert!(!text("p/a_lod2.ply").contains("geomorph"), "the last has none after it");
    sandbox.run("lod a.ply -o a.glb --levels 0.5,0.2 --geomorph").with_status(0);
    let glb = String::from_utf8_lossy(&fs::read(sandbox.path("a.glb")).unwrap()).into_owned();
    assert_eq!(glb.matches("_GEOMORPH").count(), 2);
    let outcome = sandbox.run("lod a.ply -O o --levels 0.5 --geomorph --to stl --strict").with_status(3);
    assert!(outcome.stderr.contains("cannot store geomorph data"), "{}", outcome.stderr);
}

#[test]
fn the_report_has_each_level() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(12));
    let outcome = sandbox.run("lod a.ply --dry-run --faces 100,20 --json").with_status(0);
    let report = &outcome.objects()[0];
    assert_eq!(report["dry_run"], true);
    assert_eq!(report["target"].to_string(), r#"{"faces":[100,20]}"#);
    let levels = report["levels"].as_array().expect("a list");
    assert_eq!(levels.len(), 2);
    for level in levels {
        assert_eq!(
            keys(level)[..8],
            ["level", "path", "faces", "vertices", "reached", "stopped_by", "error", "distance"]
        );
        assert_eq!(level["stopped_by"], "faces");
        assert!(level["error"]["measured"]["hausdorff"]["symmetric"].as_f64().expect("measured") > 0.0);
        assert!(level["error"]["estimate"].as_f64().expect("estimated") > 0.0);
    }
    assert!(sandbox.names(".").iter().all(|n| n == "a.ply"));
}

#[test]
fn an_unreachable_level_is_reported() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(8));
    let arguments = "lod a.ply --dry-run --faces 100,4 --border lock";
    let outcome = sandbox.run(arguments).with_status(0);
    assert!(outcome.stderr.contains("level 2: target not reached"), "{}", outcome.stderr);
    sandbox.run(&format!("{arguments} --strict")).with_status(3);
}

#[test]
fn the_command_line_is_checked() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(4));
    for arguments in [
        "lod a.ply -O out",
        "lod a.ply --levels 0.5",
        "lod a.ply -O out --levels 0.5 --faces 10",
        "lod a.ply -O out --factor 0.5 --levels 0.5",
        "lod a.ply -O out --levels 1.5",
        "lod a.ply -o out.ply --levels 0.5",
        "lod a.ply -O out --levels 0.5 --fov 180",
        "lod a.ply -o - --levels 0.5",
    ] {
        sandbox.run(arguments).with_status(2);
    }
    sandbox.run("lod none.ply -O out --levels 0.5").with_status(1).with_one_error();
}

#[test]
fn locked_faces_are_in_every_level_of_a_file() {
    let sandbox = CliSandbox::new();
    let obj = |material: &str, x: f64| {
        let mut text = format!("usemtl {material}\n");
        let first = if x > 0.0 { 82 } else { 1 };
        for i in 0..8 {
            for j in 0..8 {
                let a = first + i * 9 + j;
                text += &format!("f {} {} {}\nf {} {} {}\n", a, a + 1, a + 10, a, a + 10, a + 9);
            }
        }
        text
    };
    let mut text = String::new();
    for x in [0.0, 5.0] {
        for i in 0..9 {
            for j in 0..9 {
                let (u, v) = (f64::from(i) / 8.0, f64::from(j) / 8.0);
                text += &format!("v {} {v} {}\n", u + x, 0.1 * (6.0 * u).sin() * (5.0 * v).cos());
            }
        }
    }
    sandbox.put("two.obj", &(text + &obj("left", 0.0) + &obj("right", 5.0)));
    sandbox.put("two.mtl", "newmtl left\nnewmtl right\n");
    sandbox.run("lod two.obj -o two.glb --faces 200,160 --lock left").with_status(0);
    let report =
        &sandbox.run("lod two.obj --dry-run --faces 200,160 --lock left --json").with_status(0).objects()[0];
    assert!(report["levels"][1]["faces"].as_u64().unwrap() <= 160);
    let missing = sandbox.run("lod two.obj -o two.glb --faces 200 --lock middle").with_status(1);
    assert!(missing.stderr.contains("middle"), "{}", missing.stderr);
}
