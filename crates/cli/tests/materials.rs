//! OBJ with materials from end to end: the files written beside the output, and the messages about them.

use std::fs;
use std::path::PathBuf;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// A folder with a model of a table with two materials, a material library and a texture of one pixel.
struct MaterialSandbox {
    folder: TempDir,
}

/// Status, standard output and standard error of a run.
type RunOutput = (i32, String, String);

const LIBRARY: &str = "newmtl wood\nKd 1 1 1\nmap_Kd -clamp on tex\\grain.ppm\nnewmtl iron\nNs 20\n";

impl MaterialSandbox {
    fn new() -> Self {
        let sandbox = Self { folder: TempDir::new().expect("the folder can be created") };
        for folder in ["in/tex", "out"] {
            fs::create_dir_all(sandbox.path(folder)).expect("the folder can be created");
        }
        let places = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
        let faces = "g top\nusemtl wood\nf 1/1 2/2 3/3\ng rim\nusemtl iron\nf 1/1 3/3 4/4\n";
        sandbox.put("in/table.obj", &format!("mtllib table.mtl\no table\n{places}{faces}"));
        sandbox.put("in/table.mtl", LIBRARY);
        sandbox.put("in/tex/grain.ppm", "P3 1 1 255 120 80 40");
        sandbox
    }
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
    fn put(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("the file can be written");
    }
    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).expect("the file is there")
    }
    fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).expect("the folder is there");
        let name = |e: fs::DirEntry| e.file_name().to_string_lossy().into_owned();
        let mut names: Vec<_> = entries.map(|e| name(e.expect("it can be listed"))).collect();
        names.sort();
        names
    }
    fn run(&self, arguments: &str) -> RunOutput {
        let output = Command::cargo_bin("lodsmith")
            .expect("the command is built")
            .args(arguments.split_whitespace())
            .current_dir(self.folder.path())
            .output()
            .expect("it runs");
        let text = |bytes| String::from_utf8(bytes).expect("it is text");
        (output.status.code().expect("it ends by itself"), text(output.stdout), text(output.stderr))
    }
    fn info(&self, name: &str) -> Value {
        let (status, out, _) = self.run(&format!("info --json {name}"));
        assert_eq!(status, 0);
        serde_json::from_str(&out).expect("it is JSON")
    }
}

#[test]
fn convert_copies_library_and_texture() {
    let sandbox = MaterialSandbox::new();
    let (status, _, stderr) = sandbox.run("convert in/table.obj out/copy.obj --strict");
    assert_eq!((status, stderr.as_str()), (0, ""));
    assert_eq!(sandbox.names("out"), ["copy.mtl", "copy.obj", "grain.ppm"]);
    assert_eq!(sandbox.text("out/copy.mtl"), format!("# Lodsmith\n{}", LIBRARY.replace("tex\\", "")));
    let text = sandbox.text("out/copy.obj");
    assert!(text.starts_with("# Lodsmith\nmtllib copy.mtl\n"), "{text}");
    assert!(text.contains("o table\ng top\nusemtl wood\nf 1/1 2/2 3/3\ng rim\nusemtl iron\nf "), "{text}");
    for name in ["in/table.obj", "out/copy.obj"] {
        let info = sandbox.info(name);
        assert_eq!((&info["materials"], &info["textures"]), (&2.into(), &1.into()), "{name}");
    }
}

#[test]
fn textures_may_be_linked_or_dropped() {
    let sandbox = MaterialSandbox::new();
    assert_eq!(sandbox.run("convert in/table.obj out/a.obj --textures link").0, 0);
    assert_eq!(sandbox.names("out"), ["a.mtl", "a.obj"]);
    assert!(sandbox.text("out/a.mtl").contains("map_Kd -clamp on ../in/tex/grain.ppm\n"));
    let (status, _, stderr) = sandbox.run("convert in/table.obj out/b.obj --textures none --strict");
    assert_eq!((status, stderr.as_str()), (0, "warning: in/table.obj: materials dropped: --textures none\n"));
    assert_eq!(sandbox.names("out"), ["a.mtl", "a.obj", "b.obj"]);
    assert!(!sandbox.text("out/b.obj").contains("mtl"));
    assert_eq!(sandbox.run("convert in/table.obj out/b.obj --textures maybe").0, 2);
}

#[test]
fn dropped_materials_are_reported_once() {
    let sandbox = MaterialSandbox::new();
    let (status, _, stderr) = sandbox.run("convert in/table.obj out/a.ply --strict");
    assert_eq!(status, 3);
    assert_eq!(stderr, "error: in/table.obj: PLY cannot carry groups, materials: dropped\n");
    sandbox.put("in/plain.obj", "o a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
    let (status, _, stderr) = sandbox.run("convert in/plain.obj out/a.ply --strict");
    assert_eq!((status, stderr.as_str()), (0, ""));
}

#[test]
fn simplify_writes_a_library_too_and_a_dry_run_does_not() {
    let sandbox = MaterialSandbox::new();
    let lines = sandbox.text("in/table.obj").replace("g rim\nusemtl iron\n", "");
    sandbox.put("in/table.obj", &lines);
    let arguments = "simplify in/table.obj -o out/low.obj --ratio 1 --placement endpoint";
    assert_eq!(sandbox.run(&format!("{arguments} --dry-run")).0, 0);
    assert!(sandbox.names("out").is_empty());
    let (status, _, stderr) = sandbox.run(arguments);
    assert_eq!((status, stderr.as_str()), (0, ""));
    assert_eq!(sandbox.names("out"), ["grain.ppm", "low.mtl", "low.obj"]);
    assert!(sandbox.text("out/low.obj").contains("o table\ng top\nusemtl wood\nf "));
}

#[test]
fn a_protected_output_replaced_by_force_keeps_its_name_for_the_library() {
    let sandbox = MaterialSandbox::new();
    sandbox.put("out/a.obj", "old");
    let mut permissions = fs::metadata(sandbox.path("out/a.obj")).expect("it was written").permissions();
    permissions.set_readonly(true);
    fs::set_permissions(sandbox.path("out/a.obj"), permissions).expect("the test owns it");
    assert_eq!(sandbox.run("convert in/table.obj out/a.obj").0, 1);
    assert_eq!(sandbox.names("out"), ["a.obj"]);
    assert_eq!(sandbox.run("convert in/table.obj out/a.obj --force").0, 0);
    assert_eq!(sandbox.names("out"), ["a.mtl", "a.obj", "grain.ppm"]);
    assert!(sandbox.text("out/a.obj").contains("mtllib a.mtl\n"));
}

#[test]
fn the_first_input_keeps_the_name_of_two_equally_named_textures() {
    let sandbox = MaterialSandbox::new();
    for folder in ["slow/tex", "fast"] {
        fs::create_dir_all(sandbox.path(folder)).expect("the folder can be created");
    }
    // It takes much longer than the table, but comes first.
    let n = 120;
    let mut text = "mtllib sheet.mtl\nusemtl wood\n".to_owned();
    for i in 0..n * n {
        text.push_str(&format!("v {} {} {}\n", i % n, i / n, (i * 7919) % 13));
    }
    for j in 0..n - 1 {
        for i in 1..n {
            let a = j * n + i;
            text.push_str(&format!("f {a} {} {} {}\n", a + 1, a + n + 1, a + n));
        }
    }
    sandbox.put("slow/sheet.obj", &text);
    sandbox.put("slow/sheet.mtl", LIBRARY);
    sandbox.put("slow/tex/grain.ppm", "P3 1 1 255 1 2 3");
    let (status, ..) = sandbox
        .run("simplify slow/sheet.obj in/table.obj -O out --ratio 0.2 --threads 2 --placement endpoint");
    assert_eq!(status, 0);
    assert_eq!(sandbox.text("out/grain.ppm"), "P3 1 1 255 1 2 3");
    assert_eq!(sandbox.text("out/grain_1.ppm"), "P3 1 1 255 120 80 40");
    assert!(sandbox.text("out/table_low.mtl").contains("grain_1.ppm"));
}

/// Returns the start of a PNG file, which contains its size.
fn png(width: u32, height: u32) -> Vec<u8> {
    [&b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR"[..], &width.to_be_bytes(), &height.to_be_bytes(), &[8, 2, 0, 0, 0]]
        .concat()
}

/// The table with an image that glTF accepts, of 200 by 100 texels; the iron has none.
fn with_png() -> MaterialSandbox {
    let sandbox = MaterialSandbox::new();
    sandbox.put(
        "in/table.mtl",
        "newmtl wood\nmap_Kd grain.png\nPm 0\nPr 0.5\nnewmtl iron\nKd 0.5 0.25 0\nPm 1\nPr 1\n",
    );
    fs::write(sandbox.path("in/grain.png"), png(200, 100)).expect("the file can be written");
    sandbox
}

#[test]
fn compare_reports_texels_where_there_is_an_image() {
    let sandbox = with_png();
    let moved = sandbox.text("in/table.obj").replace("vt 0 ", "vt 0.03 ").replace("vt 1 ", "vt 1.03 ");
    sandbox.put("in/moved.obj", &moved);
    let compared = |arguments: &str| {
        let (status, out, stderr) = sandbox.run(&format!("compare {arguments} --json --samples 2000"));
        assert_eq!(status, 0, "{stderr}");
        let mut json: Value = serde_json::from_str(&out).expect("it is JSON");
        (json["attributes"].take(), json["warnings"].take())
    };
    let near = |value: &Value, expected: f64| (value.as_f64().expect("a number") - expected).abs() < 1e-4;
    let (errors, warnings) = compared("in/table.obj in/moved.obj");
    assert_eq!(warnings, serde_json::json!([]));
    for way in ["forward", "backward", "symmetric"] {
        assert!(
            near(&errors["uvs"]["mean"][way], 0.03) && near(&errors["uvs_texels"]["mean"][way], 6.0),
            "{errors}"
        );
    }
    let (_, line, _) = sandbox.run("compare in/table.obj in/moved.obj --samples 2000");
    assert!(line.contains("mean 6.000 texels, rms 6.000 texels, 95 % below 6.000 texels"), "{line}");

    // The same for a scene with an embedded image.
    assert_eq!(sandbox.run("convert in/table.obj out/table.glb").0, 0);
    let (errors, _) = compared("out/table.glb in/moved.obj");
    assert!(near(&errors["uvs_texels"]["rms"]["symmetric"], 6.0), "{errors}");

    fs::write(sandbox.path("in/grain.png"), "no image").expect("the file can be written");
    let (errors, warnings) = compared("in/table.obj in/moved.obj");
    assert!(errors["uvs_texels"].is_null() && !errors["uvs"].is_null());
    let expected = "in/table.obj: texture grain.png is not an image of a known type: errors in texels are not measured where it is used";
    assert_eq!(warnings, serde_json::json!([expected]));
    let (_, _, stderr) = sandbox.run("compare in/table.obj in/moved.obj --samples 2000");
    assert_eq!(stderr, format!("warning: {expected}\n"));
}

#[test]
fn highlights_are_not_a_loss_in_gltf() {
    let sandbox = with_png();
    sandbox.put("in/table.mtl", "newmtl wood\nKd 1 1 1\nKs 1 1 1\nNs 200\nNi 1.5\nillum 2\n");
    sandbox.put("in/table.obj", &sandbox.text("in/table.obj").replace("g top\n", "").replace("g rim\n", ""));
    let (status, _, note) = sandbox.run("convert in/table.obj out/a.glb --strict");
    assert_eq!(status, 0);
    assert_eq!(note, "warning: in/table.obj: glTF has another shading model: ks, ns left out\n");
}

#[test]
fn a_scene_becomes_an_obj_with_library_and_images() {
    let sandbox = with_png();
    sandbox.put("in/table.obj", &sandbox.text("in/table.obj").replace("g top\n", "").replace("g rim\n", ""));
    assert_eq!(sandbox.run("convert in/table.obj in/table.glb --strict").0, 0);
    let (status, _, stderr) = sandbox.run("convert in/table.glb out/copy.obj --strict");
    assert_eq!((status, stderr.as_str()), (0, ""));
    assert_eq!(sandbox.names("out"), ["copy.mtl", "copy.obj", "grain.png"]);
    assert_eq!(fs::read(sandbox.path("out/grain.png")).expect("it is there"), png(200, 100));
    assert_eq!(
        sandbox.text("out/copy.mtl"),
        "# Lodsmith\nnewmtl wood\nKd 1 1 1\nPm 0\nPr 0.5\nmap_Kd grain.png\n\
         newmtl iron\nKd 0.5 0.25 0\nPm 1\nPr 1\n"
    );
    // A second run has nothing new to write.
    assert_eq!(sandbox.run("convert in/table.glb out/copy.obj --strict").0, 0);
    assert_eq!(sandbox.names("out"), ["copy.mtl", "copy.obj", "grain.png"]);

    let arguments = "simplify in/table.glb -o out/low.obj --ratio 1 --placement endpoint --strict";
    let (status, _, stderr) = sandbox.run(&format!("{arguments} --dry-run"));
    assert_eq!((status, stderr.as_str(), sandbox.names("out").len()), (0, "", 3));
    assert_eq!(sandbox.run(arguments).0, 0);
    assert_eq!(sandbox.names("out"), ["copy.mtl", "copy.obj", "grain.png", "low.mtl", "low.obj"]);
    assert!(sandbox.text("out/low.obj").contains("usemtl wood\nf "));

    let (status, _, stderr) = sandbox.run("convert in/table.glb out/a.ply --strict");
    assert_eq!((status, stderr.as_str()), (3, "error: in/table.glb: PLY cannot carry materials: dropped\n"));
    let (status, out, stderr) = sandbox.run("convert in/table.glb - --to obj");
    let expected = "a stream cannot have material files beside it: only the names of materials are written";
    assert!(status == 0 && out.contains("usemtl iron\n") && stderr.contains(expected), "{stderr}");
}

#[test]
fn a_material_of_a_scene_can_be_locked_for_every_output_format() {
    let sandbox = with_png();
    assert_eq!(sandbox.run("convert in/table.obj in/table.glb").0, 0);
    for name in ["low.obj", "low.ply"] {
        let (status, out, _) =
            sandbox.run(&format!("simplify in/table.glb -o out/{name} --ratio 1 --lock iron --json"));
        let report: Value = serde_json::from_str(&out).expect("it is JSON");
        assert_eq!((status, &report["locked"]["faces"]), (0, &1.into()), "{name}");
    }
}
