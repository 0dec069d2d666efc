//! `lodsmith clean`.

use crate::sandbox::{CliSandbox, coloured_cube, keys, ply};

/// Two cubes that share an edge, with flipped faces, a duplicate face and an unused vertex; no two faces share a
/// vertex.
fn broken() -> String {
    use std::fmt::Write as _;
    let (mut vertices, mut faces, mut count) = (String::new(), String::new(), 0);
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut put = |at: [u32; 3], t: [u32; 3]| {
        for i in t {
            let [x, y, z] = [i & 1, i >> 1 & 1, i >> 2];
            writeln!(vertices, "{} {} {}", x + at[0], y + at[1], z + at[2]).expect("text");
        }
        writeln!(faces, "3 {count} {} {}", count + 1, count + 2).expect("text");
        count += 3;
    };
    for at in [[0, 0, 0], [1, 1, 0]] {
        for (i, q) in quads.iter().enumerate() {
            let turn = |t: [u32; 3]| if i == 1 { [t[0], t[2], t[1]] } else { t };
            put(at, turn([q[0], q[1], q[2]]));
            put(at, turn([q[0], q[2], q[3]]));
        }
    }
    put([0, 0, 0], [0, 2, 3]);
    vertices += "9 9 9\n";
    ply("", 76, 25, &vertices, &faces)
}

#[test]
fn each_step_is_reported_and_the_policies_differ() {
    let sandbox = CliSandbox::new();
    sandbox.put("in.ply", &broken());
    let outcome = sandbox.run("clean in.ply -o keep.ply").with_status(0);
    let lines: Vec<_> = outcome.text().lines().collect();
    assert!(lines[0].starts_with("in.ply: 25 → 24 faces, 76 → 14 vertices, "), "{lines:?}");
    let done = "  done  61 welded vertices, 1 duplicate faces, 4 flipped faces, 1 unused vertices";
    assert_eq!(lines[1], done);
    assert_eq!(lines[2], "  left  1 non manifold edges, 2 non manifold vertices");
    assert!(
        outcome.stderr.starts_with("warning: in.ply: 1 edge with more than two faces"),
        "{}",
        outcome.stderr
    );

    let report =
        &sandbox.run("clean in.ply -o cut.ply --non-manifold cut --json").with_status(0).objects()[0];
    assert_eq!(keys(report), ["input", "output", "done", "left", "warnings", "seconds"]);
    assert_eq!(report["done"]["parted_vertices"], 2);
    assert_eq!(report["output"]["vertices"], 16);
    assert!(report["left"].as_object().expect("counts").values().all(|n| n == 0), "{report}");

    let report =
        &sandbox.run("clean in.ply -o sewn.ply --non-manifold merge --json").with_status(0).objects()[0];
    assert_eq!((&report["done"]["sewn_edges"], &report["output"]["vertices"]), (&36.into(), &16.into()));
    assert!(report["left"].as_object().expect("counts").values().all(|n| n == 0), "{report}");
}

#[test]
fn lengths_are_of_the_file_or_of_its_diagonal() {
    let sandbox = CliSandbox::new();
    sandbox.put("in.ply", &broken());
    for weld in ["0.1", "1%"] {
        let outcome = sandbox.run(&format!("clean in.ply --dry-run --json --weld {weld}")).with_status(0);
        assert_eq!(outcome.objects()[0]["output"]["vertices"], 14, "{weld}");
    }
    sandbox.run("clean in.ply -o out.ply --weld 99").with_status(1).with_one_error();
    assert!(!sandbox.path("out.ply").exists());
}

#[test]
fn several_inputs_go_into_a_folder_and_failures_are_reported() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &coloured_cube());
    sandbox.put("b.ply", "no mesh");
    sandbox.put("c.ply", &broken());
    let outcome = sandbox.run("clean a.ply b.ply c.ply -O out --to obj --json").with_status(1);
    let reports = outcome.objects();
    assert_eq!((reports.len(), reports[1]["path"].as_str()), (3, Some("b.ply")));
    assert_eq!(sandbox.names("out"), ["a_clean.obj", "c_clean.obj"]);
    assert_eq!(sandbox.faces("out/c_clean.obj"), 24);
    sandbox.run("clean a.ply c.ply -o x.ply").with_status(2).with_one_error();
    sandbox.run("clean a.ply -o x.ply --non-manifold glue").with_status(2);
}

#[test]
fn colours_are_kept_and_strict_reports_losses() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    sandbox.run("clean cube.ply -o same.ply --strict").with_status(0);
    let report = &sandbox.run("compare cube.ply same.ply --json").with_status(0).objects()[0];
    assert!(report["hausdorff"]["symmetric"].as_f64() < Some(1e-12));
    assert_eq!(sandbox.info("same.ply")["attributes"], sandbox.info("cube.ply")["attributes"]);
    sandbox.run("clean cube.ply -o lost.stl --strict").with_status(3).with_one_error();
    sandbox.put("in.ply", &broken());
    let outcome = sandbox.run("clean in.ply -o cut.stl --non-manifold cut").with_status(0);
    assert!(outcome.stderr.contains("readers merge again the vertices"), "{}", outcome.stderr);
}

#[test]
fn a_scene_stays_a_scene() {
    let sandbox = CliSandbox::new();
    sandbox.put("in.ply", &broken());
    sandbox.run("convert in.ply in.glb").with_status(0);
    let outcome = sandbox.run("clean in.glb -o out.glb --non-manifold cut --json").with_status(0);
    let report = &outcome.objects()[0];
    assert_eq!(report["meshes"][0]["done"], report["done"]);
    assert_eq!((&report["done"]["flipped_faces"], &report["output"]["faces"]), (&4.into(), &24.into()));
    assert_eq!(sandbox.faces("out.glb"), 24);
    // A dry run reports the same.
    let dry = sandbox.run("clean in.glb -o dry.glb --dry-run --json").with_status(0);
    assert_eq!(dry.objects()[0]["dry_run"], true);
    assert!(!sandbox.path("dry.glb").exists());
}

#[test]
fn sizes_and_compression_are_reported() {
    let sandbox = CliSandbox::new();
    sandbox.put("in.ply", &broken());
    let report = sandbox.run("clean in.ply -o out.glb --compress meshopt --quantize --json").with_status(0);
    let report = report.objects().remove(0);
    let before = &report["input"]["sizes"];
    assert_eq!(
        (before["triangles"].as_u64(), before["draw_calls"].as_u64()),
        (Some(25), Some(1)),
        "{report}"
    );
    assert!(before["file_bytes"].as_u64() > Some(100), "{report}");
    assert_eq!(report["output"]["sizes"]["triangles"], 24);
    assert!(report["output"]["packing"]["packed_bytes"].as_u64() > Some(0), "{report}");
    let outcome = sandbox.run("clean in.ply -o out.ply -v").with_status(0);
    assert!(outcome.text().contains("triangles 25 → 24, draw calls 1 → 1"), "{}", outcome.text());
    // A scene from standard input has sizes too, though its file has none.
    let scene = std::fs::read(sandbox.path("out.glb")).unwrap();
    let outcome = sandbox.run_with("clean - --from glb -o again.glb --json", scene).with_status(0);
    let sizes = &outcome.objects()[0]["input"]["sizes"];
    assert_eq!((sizes["triangles"].as_u64(), sizes["file_bytes"].as_u64()), (Some(24), None), "{sizes}");
}
