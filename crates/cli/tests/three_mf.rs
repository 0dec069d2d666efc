//! 3MF from end to end: a scene stays a scene in 3MF and in other scene formats.

use std::io::{Read as _, Write as _};
use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

const TOKENS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/tokens.3mf");

/// Runs the command in a folder; returns its status and both outputs.
fn run(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("lodsmith")
        .expect("the command is built")
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("it runs");
    let text = |bytes| String::from_utf8(bytes).expect("it is text");
    (output.status.code().expect("it ends by itself"), text(output.stdout), text(output.stderr))
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let (status, out, err) = run(folder, arguments);
    assert_eq!(status, 0, "{arguments:?}: {err}");
    serde_json::from_str(out.lines().next().expect("there is a line")).expect("it is JSON")
}

/// Counts that a scene keeps in another file.
fn counts(folder: &Path, file: &str) -> Vec<Value> {
    let info = json(folder, &["info", "--json", file]);
    ["meshes", "faces", "materials", "textures"].map(|key| info[key].clone()).to_vec()
}

#[test]
fn a_scene_stays_one() {
    let folder = TempDir::new().expect("the folder can be created");
    let folder = folder.path();
    let converted = json(folder, &["convert", TOKENS, "a.3mf", "--json"]);
    assert_eq!(converted["warnings"], Value::Array(Vec::new()));
    assert_eq!(counts(folder, "a.3mf"), counts(folder, TOKENS));
    for key in ["triangles", "draw_calls", "texture_bytes"] {
        assert_eq!(converted["input"]["sizes"][key], converted["output"]["sizes"][key], "{key}");
    }
    // Also through glTF; and writing the same file again gives the same bytes.
    json(folder, &["convert", "a.3mf", "b.glb", "--json"]);
    json(folder, &["convert", "b.glb", "b.3mf", "--json"]);
    assert_eq!(counts(folder, "b.3mf"), counts(folder, TOKENS));
    json(folder, &["convert", "a.3mf", "c.3mf", "--json"]);
    let bytes = |name: &str| std::fs::read(folder.join(name)).expect("the file is there");
    assert!(bytes("a.3mf") == bytes("c.3mf"));
    // The first entry of the archive has a fixed time and date, 1 January 1980, and not those of the run.
    assert_eq!(bytes("a.3mf")[10..14], [0, 0, 0x21, 0]);
}

#[test]
fn every_command_writes_scenes() {
    let folder = TempDir::new().expect("the folder can be created");
    let folder = folder.path();
    let meshes = counts(folder, TOKENS)[0].clone();
    json(folder, &["simplify", TOKENS, "-o", "low.3mf", "--ratio", "1", "--json"]);
    json(folder, &["clean", TOKENS, "-o", "clean.3mf", "--json"]);
    json(folder, &["lod", TOKENS, "-O", "levels", "--to", "3mf", "--levels", "0.9", "--json"]);
    for file in ["low.3mf", "clean.3mf", "levels/tokens_lod0.3mf"] {
        assert_eq!(counts(folder, file)[0], meshes, "{file}");
    }
    let (_, _, err) = run(folder, &["convert", TOKENS, "bare.3mf", "--textures", "none"]);
    assert!(err.contains("materials dropped: --textures none"), "{err}");
    // The colour group of the vertices.
    assert_eq!(counts(folder, "bare.3mf")[2..], [Value::from(1), Value::from(0)]);
}

/// Returns a part of a 3MF file.
fn part(file: &Path, name: &str) -> Option<String> {
    let archive = std::fs::File::open(file).expect("the file is there");
    let mut archive = zip::ZipArchive::new(archive).expect("it is an archive");
    let mut text = String::new();
    archive.by_name(name).ok()?.read_to_string(&mut text).expect("it is text");
    Some(text)
}

/// Writes a 3MF file with this model and further parts.
fn package(file: &Path, model: &str, parts: &[(&str, &str)]) {
    let relations = r#"<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Target="/3D/3dmodel.model" Id="a" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#;
    let mut zip = zip::ZipWriter::new(std::fs::File::create(file).expect("it can be created"));
    for (name, text) in [("_rels/.rels", relations), ("3D/3dmodel.model", model)].iter().chain(parts) {
        zip.start_file(*name, zip::write::SimpleFileOptions::default()).expect("it can be written");
        zip.write_all(text.as_bytes()).expect("it can be written");
    }
    zip.finish().expect("it can be written");
}

/// A project of PrusaSlicer: a tetrahedron with painted supports and one that is subtracted, with a range of heights.
fn project(file: &Path) {
    let vertices: String = [0, 20]
        .map(|x| {
            let row = |[a, y, z]: [i32; 3]| format!(r#"<vertex x="{}" y="{y}" z="{z}"/>"#, x + a);
            [[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]].map(row).concat()
        })
        .concat();
    let triangles: String = [0, 4]
        .map(|first| {
            let paint = if first == 0 { r#" slic3rpe:custom_supports="4""# } else { "" };
            let row = |[a, b, c]: [i32; 3]| {
                let [a, b, c] = [a, b, c].map(|v| v + first);
                format!(r#"<triangle v1="{a}" v2="{b}" v3="{c}"{paint}/>"#)
            };
            [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]].map(row).concat()
        })
        .concat();
    let model = format!(
        r#"<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" xmlns:slic3rpe="http://schemas.slic3r.org/3mf/2017/06">
<resources><object id="7" name="body"><mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh></object></resources>
<build><item objectid="7" transform="1 0 0 0 1 0 0 0 1 1 2 3"/></build></model>"#
    );
    let config = r#"<config><object id="7"><volume firstid="0" lastid="3"/>
<volume firstid="4" lastid="7"><metadata key="volume_type" value="NegativeVolume"/></volume></object></config>"#;
    let parts = [
        ("Metadata/Slic3r_PE_model.config", config),
        ("Metadata/Slic3r_PE.config", "; layer_height = 0.2"),
        ("Metadata/Prusa_Slicer_layer_config_ranges.xml", "<objects/>"),
    ];
    package(file, &model, &parts);
}

/// A moved scene was merged, and the reason for what it lost was said to be a format other than 3MF.
#[test]
fn a_moved_scene_keeps_what_a_slicer_added() {
    let folder = TempDir::new().expect("the folder can be created");
    let folder = folder.path();
    project(&folder.join("a.3mf"));
    let heights = "settings at heights, such as Metadata/Prusa_Slicer_layer_config_ranges.xml, are left out: they are those before --scale and --up";
    let moved = [
        (["--scale", "2"], "2 0 0 0 2 0 0 0 2 2 4 6"),
        (["--up", "y"], "1 0 0 0 0 -1 0 1 0 1 3 -2"),
        (["--up", "z"], "1 0 0 0 0 1 0 -1 0 1 -3 2"),
    ];
    for (options, transform) in moved {
        for command in
            [&["convert", "a.3mf", "b.3mf"][..], &["simplify", "a.3mf", "-o", "b.3mf", "--ratio", "1"]]
        {
            let arguments = [command, &options, &["--json", "--force"]].concat();
            let report = json(folder, &arguments);
            assert_eq!(report["warnings"], serde_json::json!([heights]), "{arguments:?}");
            let file = folder.join("b.3mf");
            let model = part(&file, "3D/3dmodel.model").expect("it has a model");
            assert!(model.contains(&format!(r#"<item objectid="7" transform="{transform}"/>"#)), "{model}");
            assert_eq!(model.matches(r#"custom_supports="4""#).count(), 4, "{model}");
            let config = part(&file, "Metadata/Slic3r_PE_model.config").expect("it has settings");
            assert!(config.contains("NegativeVolume"), "{config}");
            assert!(part(&file, "Metadata/Slic3r_PE.config").is_some());
        }
    }
    // It has the coordinates of the mesh that other formats get.
    for (options, _) in moved {
        for file in ["c.3mf", "c.stl"] {
            json(folder, &[&["convert", "a.3mf", file], &options[..], &["--json", "--force"]].concat());
        }
        let distance = json(folder, &["compare", "c.3mf", "c.stl", "--json"]);
        let largest = distance["hausdorff"]["symmetric"].as_f64().expect("it is a number");
        assert!(largest < 1e-12, "{options:?}: {distance}");
    }
}
