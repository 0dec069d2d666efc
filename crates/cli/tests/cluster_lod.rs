//! `lodsmith clusters`: from a mesh to a file of clusters, and surfaces out of it.

mod desk;

use desk::{Desk, hills, keys};
use serde_json::Value;

/// A desk with hills of 20,000 triangles as clusters.
fn built() -> (Desk, Value) {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(100));
    let report =
        desk.run("clusters build hills.ply -o hills.lclod --json").with_status(0).objects().remove(0);
    (desk, report)
}

#[test]
fn a_mesh_becomes_levels_that_can_be_looked_into() {
    let (desk, report) = built();
    let wanted = [
        "input",
        "output",
        "clusters",
        "groups",
        "triangles_per_cluster",
        "coarsest_error",
        "levels",
        "rounds",
        "stuck_groups",
        "broken_groups",
        "cleanup",
        "warnings",
        "seconds",
    ];
    assert_eq!(keys(&report), wanted);
    assert_eq!((&report["input"]["faces"], &report["warnings"]), (&20_000.into(), &Value::Array(Vec::new())));
    let levels = report["levels"].as_array().unwrap();
    assert_eq!(levels[0]["faces"], 20_000);
    assert!(levels[0]["fill"].as_f64().unwrap() > 0.9 && levels.len() > 5, "{report}");

    let info = desk.run("clusters info hills.lclod --json").with_status(0).objects().remove(0);
    assert_eq!((&info["levels"], &info["clusters"]), (&report["levels"], &report["clusters"]));
    let ran = desk.run("clusters info hills.lclod").with_status(0);
    assert!(ran.text().starts_with("hills.lclod: ") && ran.text().lines().count() == 2 + levels.len());
    let line = desk.run("clusters build hills.ply -o again.lclod --threads 3").with_status(0);
    assert!(line.text().starts_with("hills.ply → again.lclod: 20,000 faces in "), "{}", line.text());
    let bytes = |name| std::fs::read(desk.path(name)).unwrap();
    assert_eq!(bytes("again.lclod"), bytes("hills.lclod"));
    assert_eq!(desk.run("clusters build hills.ply -o again.lclod --quiet").with_status(0).text(), "");
}

#[test]
fn a_cut_is_as_close_as_it_says() {
    let (desk, _) = built();
    let mut faces = Vec::new();
    for (error, out) in [("0", "a.ply"), ("0.1%", "b.glb"), ("0.01", "c.obj")] {
        let cut = format!("clusters cut hills.lclod -o {out} --error {error} --json");
        let report = desk.run(&cut).with_status(0).objects().remove(0);
        assert_eq!(report["output"]["faces"], desk.faces(out));
        faces.push(desk.faces(out));
        let compared =
            desk.run(&format!("compare hills.ply {out} --json")).with_status(0).objects().remove(0);
        let far = compared["hausdorff"]["symmetric"].as_f64().unwrap();
        assert!(far <= 1.3 * report["error"].as_f64().unwrap() + 1e-6, "{error}: {far} {report}");
        assert_eq!(desk.info(out)["border_loops"], 1);
    }
    assert!(faces[0] > 2 * faces[1] && faces[1] > faces[2], "{faces:?}");
}

#[test]
fn an_eye_sees_detail_where_it_is() {
    let (desk, _) = built();
    let count = |eye: &str| {
        let ran = desk.run(&format!("clusters cut hills.lclod -o eye.ply --eye {eye} --pixels 2 --json"));
        ran.with_status(0).objects()[0]["output"]["faces"].as_u64().unwrap()
    };
    let (near, far) = (count("0,0,0.3"), count("-20,0,5"));
    assert!(near > 3 * far, "{near} {far}");
    assert_eq!(desk.info("eye.ply")["border_loops"], 1);
}

#[test]
fn names_of_materials_stay_and_the_rest_comes_from_the_input() {
    let desk = Desk::new();
    let mut text = "mtllib m.mtl\n".to_owned();
    for y in 0..=20 {
        for x in 0..=20 {
            text += &format!("v {x} {y} {}\nvt {} {}\n", (x * y) % 3, x as f64 / 20.0, y as f64 / 20.0);
        }
    }
    for (material, rows) in [("wood", 0..10), ("iron", 10..20)] {
        text += &format!("usemtl {material}\n");
        for y in rows {
            for x in 0..20 {
                let a = y * 21 + x + 1;
                let (b, c, d) = (a + 1, a + 22, a + 21);
                text += &format!("f {a}/{a} {b}/{b} {c}/{c} {d}/{d}\n");
            }
        }
    }
    desk.put("m.obj", &text);
    desk.put("m.mtl", "newmtl wood\nKd 1 0 0\nnewmtl iron\nKd 0 0 1\n");
    let ran = desk.run("clusters build m.obj -o m.lclod").with_status(0);
    assert!(ran.stderr.contains("keep the names"), "{}", ran.stderr);
    let info = desk.run("clusters info m.lclod --json").with_status(0).objects().remove(0);
    assert_eq!(info["materials"], serde_json::json!(["wood", "iron"]));
    assert_eq!(info["attributes"], serde_json::json!(["uvs"]));

    let ran = desk.run("clusters cut m.lclod -o plain.obj --error 0.2").with_status(0);
    assert!(ran.stderr.contains("--materials"), "{}", ran.stderr);
    let plain = std::fs::read_to_string(desk.path("plain.obj")).unwrap();
    assert!(plain.contains("usemtl wood") && plain.contains("usemtl iron") && !plain.contains("mtllib"));
    desk.run("clusters cut m.lclod -o full.glb --error 0.2 --materials m.obj --strict").with_status(0);
    assert_eq!(desk.info("full.glb")["materials"], 2);
    desk.put("other.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let wrong = desk.run("clusters cut m.lclod -o x.glb --error 0 --materials other.obj");
    wrong.with_status(2).with_one_error();
    assert!(!desk.path("x.glb").exists());
}

#[test]
fn faults_are_told_in_one_line_and_leave_no_file() {
    let (desk, _) = built();
    desk.put("text.lclod", "no clusters");
    for (words, status) in [
        ("clusters cut text.lclod -o a.ply --error 0", 1),
        ("clusters cut hills.ply -o a.ply --error 0", 1),
        ("clusters cut none.lclod -o a.ply --error 0", 1),
        ("clusters cut hills.lclod -o a.doc --error 0", 2),
        ("clusters cut hills.lclod -o none/a.ply --error 0", 1),
        ("clusters build text.lclod -o a.lclod", 1),
        ("clusters build hills.ply -o - --json", 2),
        ("clusters info text.lclod", 1),
    ] {
        desk.run(words).with_status(status).with_one_error();
    }
    for words in [
        "clusters cut hills.lclod -o a.ply",
        "clusters cut hills.lclod -o a.ply --error 1 --eye 0,0,1",
        "clusters cut hills.lclod -o a.ply --eye 0,1",
        "clusters build hills.ply -o a.lclod --triangles 300",
        "clusters build hills.ply",
    ] {
        desk.run(words).with_status(2);
    }
    assert_eq!(desk.names("."), ["hills.lclod", "hills.ply", "text.lclod"]);
}

#[test]
fn streams_take_clusters_and_surfaces() {
    let (desk, _) = built();
    let clusters = desk.run_with("clusters build - -o -", hills(100)).with_status(0).stdout;
    assert_eq!(clusters, std::fs::read(desk.path("hills.lclod")).unwrap());
    let surface = desk.run_with("clusters cut - -o - --to stl --error 0.01", clusters).with_status(0).stdout;
    desk.run("clusters cut hills.lclod -o file.stl --error 0.01").with_status(0);
    assert_eq!(surface, std::fs::read(desk.path("file.stl")).unwrap());
}

#[test]
fn pages_of_the_manual_go_down_to_the_parts_of_a_command() {
    let desk = Desk::new();
    let page = desk.run("man clusters").with_status(0);
    assert!(page.text().contains("build"));
    desk.run("man nothing").with_status(2).with_one_error();
}
