//! 3MF from end to end: a scene stays a scene in 3MF and in other scene formats.

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
    // A scaled scene becomes one mesh.
    json(folder, &["convert", TOKENS, "big.3mf", "--scale", "2", "--json"]);
    assert_eq!(counts(folder, "big.3mf")[0], 1);
    let (_, _, err) = run(folder, &["convert", TOKENS, "bare.3mf", "--textures", "none"]);
    assert!(err.contains("materials dropped: --textures none"), "{err}");
    // The colour group of the vertices.
    assert_eq!(counts(folder, "bare.3mf")[2..], [Value::from(1), Value::from(0)]);
}
