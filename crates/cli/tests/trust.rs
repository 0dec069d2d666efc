//! Protection against untrusted files: they cannot reach other files, write to the terminal, or replace
//! existing files. docs/trust.md says the same for users.

use std::fs;

use crate::desk::{CliSandbox, hills};

const OUTSIDE: &str = "is outside the folder of the model (--asset-root DIR or --allow-outside permits it)";
const IMAGE: &str = "P3 1 1 255 120 80 40";
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";

/// A model in a folder `in` that refers to an image outside of this folder, in each way that a path can be
/// written.
fn with_a_secret() -> (CliSandbox, [String; 2]) {
    let desk = CliSandbox::new();
    for folder in ["in", "out"] {
        fs::create_dir(desk.path(folder)).expect("there is room for a folder");
    }
    desk.put("secret.ppm", IMAGE);
    desk.put("in/a.obj", &format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1/1 2/2 3/3\n"));
    let names = ["../secret.ppm".to_owned(), desk.path("secret.ppm").display().to_string()];
    (desk, names)
}

#[test]
fn no_command_copies_a_file_from_outside_the_folder() {
    let (desk, names) = with_a_secret();
    for name in names {
        desk.put("in/a.mtl", &format!("newmtl m\nmap_Kd {name}\n"));
        for words in [
            "convert in/a.obj out/a.obj",
            "convert in/a.obj out/a.glb",
            "simplify in/a.obj -o out/a.obj --ratio 1",
            "clean in/a.obj -o out/a.obj",
            "lod in/a.obj -O out --levels 1 --to obj",
            "methods in/a.obj -O out --method quadric --ratio 1",
            "progressive build in/a.obj -o out/a.lpm",
        ] {
            let ran = desk.run(words).with_status(0);
            assert!(ran.stderr.contains(OUTSIDE), "{words}: {}", ran.stderr);
            for file in desk.names("out") {
                assert!(!file.contains("secret"), "{words}: {file}");
                let bytes = fs::read(desk.path("out").join(&file)).expect("it was written");
                assert!(!bytes.windows(IMAGE.len()).any(|w| w == IMAGE.as_bytes()), "{words}: {file}");
            }
            for flag in ["--allow-outside", "--asset-root ."] {
                let ran = desk.run(&format!("{words} {flag}")).with_status(0);
                assert!(!ran.stderr.contains(OUTSIDE), "{words} {flag}: {}", ran.stderr);
            }
            fs::remove_dir_all(desk.path("out")).expect("it is ours");
            fs::create_dir(desk.path("out")).expect("there is room for a folder");
        }
    }
    desk.run("convert in/a.obj out/a.obj --allow-outside").with_status(0);
    assert_eq!(desk.names("out"), ["a.mtl", "a.obj", "secret.ppm"]);
    desk.run("info in/a.obj --allow-outside --asset-root .").with_status(2);
}

/// A glTF file with one triangle, one image, and its buffer in a separate file.
fn gltf(buffer: &str, image: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
        "textures":[{{"source":0}}],"images":[{{"uri":"{image}"}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{buffer}"}}]}}"#
    )
}

#[test]
fn a_scene_takes_in_only_images_of_its_folder() {
    let desk = CliSandbox::new();
    fs::create_dir(desk.path("in")).expect("there is room for a folder");
    let corners: Vec<u8> =
        [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].into_iter().flat_map(f32::to_le_bytes).collect();
    let secret = "a word that nobody else may read";
    for (name, bytes) in
        [("in/a.bin", &corners[..]), ("secret.bin", &corners), ("in/note.txt", secret.as_bytes())]
    {
        fs::write(desk.path(name), bytes).expect("there is room for a file");
    }
    desk.put("secret.ppm", IMAGE);
    let holds = |name: &str, what: &str| {
        let bytes = fs::read(desk.path(name)).expect("it was written");
        bytes.windows(what.len()).any(|w| w == what.as_bytes())
    };
    desk.put("in/a.gltf", &gltf("a.bin", "note.txt"));
    let ran = desk.run("convert in/a.gltf a.glb").with_status(0);
    assert!(ran.stderr.contains("the file note.txt is not an image of a known type"), "{}", ran.stderr);
    assert!(!holds("a.glb", secret));
    desk.put("in/a.gltf", &gltf("a.bin", "../secret.ppm"));
    let ran = desk.run("convert in/a.gltf a.glb").with_status(0);
    assert!(ran.stderr.contains(OUTSIDE) && !holds("a.glb", IMAGE), "{}", ran.stderr);
    desk.run("convert in/a.gltf a.glb --allow-outside").with_status(0);
    assert!(holds("a.glb", "../secret.ppm"), "a type that glTF does not know stays a file of its own");
    desk.put("in/a.gltf", &gltf("../secret.bin", "note.txt"));
    let ran = desk.run("info in/a.gltf").with_status(1).with_one_error();
    assert!(ran.stderr.contains(OUTSIDE), "{}", ran.stderr);
    desk.run("info in/a.gltf --asset-root .").with_status(0);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../secret.bin", desk.path("in/link.bin")).expect("links are known");
        desk.put("in/a.gltf", &gltf("link.bin", "note.txt"));
        let ran = desk.run("info in/a.gltf").with_status(1).with_one_error();
        assert!(ran.stderr.contains(OUTSIDE), "{}", ran.stderr);
    }
}

/// Returns true if a terminal would interpret a character instead of showing it; line ends excepted.
fn is_unsafe(c: char) -> bool {
    c != '\n' && (c.is_control() || "\u{61c}\u{200e}\u{200f}\u{202a}\u{202e}\u{2066}\u{2069}".contains(c))
}

#[test]
fn names_of_a_file_write_nothing_to_the_terminal() {
    let desk = CliSandbox::new();
    let evil = "x\u{1b}[2J\u{1b}]0;t\u{7}\u{9b}31m\u{202e}\u{7f}y";
    let (file, obj) =
        (format!("{evil}.obj"), format!("o {evil}\ng {evil}\nmtllib {evil}.mtl\n{TRIANGLE}usemtl {evil}\n"));
    desk.put(&file, &format!("{obj}f 1/1 2/2 3/3\n"));
    desk.put("a.obj", &format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1/1 2/2 3/3\n"));
    desk.put("a.mtl", &format!("newmtl m\nmap_Kd {evil}.png\n{evil} 1\n"));
    let json = evil.replace('\u{1b}', "\\u001b").replace('\u{7}', "\\u0007");
    let plain = gltf(&format!("{json}.bin"), &format!("{json}.png"));
    desk.put("a.gltf", &plain.replace("\"primitives\"", &format!("\"name\":\"{json}\",\"primitives\"")));
    for words in [
        format!("info {file} a.gltf none{file}"),
        format!("convert {file} a.stl"),
        format!("convert {file} {evil}.ply"),
        "convert a.obj a.glb".to_owned(),
        format!("simplify {file} -o b.obj --ratio 0.5 -v"),
        format!("simplify {file} -o b.obj --ratio 0.5 --lock {evil}z"),
        format!("compare {file} a.obj"),
        format!("clean {file} -o b.obj -v"),
        format!("info --{evil}"),
        format!("simplify {file} -o b.obj --ratio {evil}"),
        format!("info --json {file} a.gltf"),
        format!("simplify {file} -o b.obj --ratio 0.5 --json"),
    ] {
        let ran = desk.run(&words);
        for text in [ran.text(), &ran.stderr] {
            assert!(!text.contains(is_unsafe), "{}: {}", words.escape_debug(), text.escape_debug());
        }
        assert!(!ran.text().is_empty() || !ran.stderr.is_empty());
    }
    // JSON has the exact name.
    assert_eq!(desk.info(&file)["path"], file.as_str());
}

#[test]
fn an_input_is_written_over_by_force_alone() {
    let desk = CliSandbox::new();
    let mesh = hills(6);
    let put = || {
        desk.put("a.ply", &mesh);
        desk.put("b.ply", &mesh);
    };
    put();
    desk.run("progressive build a.ply -o a.lpm").with_status(0);
    fs::copy(desk.path("a.ply"), desk.path("a.png")).expect("there is room");
    fs::copy(desk.path("a.ply"), desk.path("low0.ply")).expect("there is room");
    for (words, input) in [
        ("simplify a.ply -o a.ply --ratio 0.5", "a.ply"),
        ("simplify a.ply b.ply -O . --name {stem}.{ext} --ratio 0.5", "a.ply"),
        ("convert a.ply ./a.ply", "a.ply"),
        ("clean a.ply -o a.ply", "a.ply"),
        ("lod low0.ply -O . --name low{level}.ply --levels 0.5", "low0.ply"),
        ("compare a.ply b.ply --heatmap a.ply", "a.ply"),
        ("compare a.ply b.ply --heatmap b.ply", "b.ply"),
        ("compare a.ply a.png --heatmap a.png", "a.png"),
        ("compare a.ply a.png --views 1 --size 16x16 --views-sheet a.png", "a.png"),
        ("render a.png -o a.png", "a.png"),
        ("progressive build a.lpm -o a.lpm --bits 12", "a.lpm"),
        ("progressive extract a.lpm -o a.lpm --to ply", "a.lpm"),
    ] {
        let before = fs::read(desk.path(input)).expect("it is there");
        let ran = desk.run(words).with_status(2).with_one_error();
        assert!(ran.stderr.contains("is an input; --force writes over it"), "{words}: {}", ran.stderr);
        assert!(fs::read(desk.path(input)).expect("it is there") == before, "{words}");
        desk.run(&format!("{words} --force")).with_status(0);
        assert!(fs::read(desk.path(input)).expect("it is there") != before, "{words}");
        fs::write(desk.path(input), before).expect("there is room");
    }
    // A dry run writes nothing, so it needs no --force.
    desk.run("simplify a.ply -o a.ply --ratio 0.5 --dry-run").with_status(0);
}

#[cfg(unix)]
#[test]
fn a_link_that_leads_nowhere_gets_its_target() {
    use std::os::unix::fs::symlink;
    let desk = CliSandbox::new();
    desk.put("a.ply", &hills(3));
    fs::create_dir(desk.path("far")).expect("there is room for a folder");
    symlink("far/b.ply", desk.path("b.ply")).expect("links are known");
    symlink("far/b.png", desk.path("b.png")).expect("links are known");
    symlink("none/c.ply", desk.path("c.ply")).expect("links are known");
    desk.run("convert a.ply b.ply").with_status(0);
    desk.run("render a.ply -o b.png --size 16x16").with_status(0);
    assert_eq!(desk.names("far"), ["b.ply", "b.png"]);
    desk.run("convert a.ply c.ply").with_status(1).with_one_error();
    for name in ["b.ply", "b.png", "c.ply"] {
        assert!(desk.path(name).is_symlink(), "{name}");
    }
}

#[cfg(unix)]
#[test]
fn a_mesh_to_a_closed_pipe_is_a_failure() {
    let desk = CliSandbox::new();
    desk.put("a.ply", &hills(40));
    for words in [
        "convert a.ply - --to obj --quiet",
        "simplify a.ply -o - --to glb --ratio 0.9",
        "progressive build a.ply -o -",
        "render a.ply -o - --size 64x64",
    ] {
        let output = desk.run_without_reader(words);
        assert_eq!(output.status.code(), Some(1), "{words}");
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(told.contains("standard output was closed before all was written"), "{words}: {told}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_is_a_failure_told_once() {
    let desk = CliSandbox::new();
    desk.put("a.ply", &hills(40));
    for words in [
        "convert a.ply - --to obj --quiet",
        "simplify a.ply -o - --to glb --ratio 0.9",
        "clean a.ply -o - --to ply",
        "render a.ply -o - --size 64x64",
        "info a.ply",
        "--help",
        "simplify --help",
        "--version",
    ] {
        let ran = desk.run_into_full_device(words).with_status(1).with_one_error();
        assert!(ran.stderr.contains("cannot write to standard output"), "{words}: {}", ran.stderr);
    }
}

#[test]
fn a_damaged_progressive_mesh_is_a_failure() {
    let desk = CliSandbox::new();
    desk.put("a.ply", &hills(12));
    desk.run("progressive build a.ply -o a.lpm").with_status(0);
    let bytes = fs::read(desk.path("a.lpm")).expect("it was written");
    let mut damaged = bytes.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 4;
    fs::write(desk.path("bad.lpm"), damaged).expect("there is room");
    fs::write(desk.path("cut.lpm"), &bytes[..middle]).expect("there is room");
    for words in ["progressive info", "info", "progressive extract -o out.ply", "convert --to ply"] {
        let (command, out) = if words.starts_with("convert") { (words, " out.ply") } else { (words, "") };
        let ran = desk.run(&format!("{command} bad.lpm{out}")).with_status(1).with_one_error();
        assert!(ran.stderr.contains("damaged"), "{words}: {}", ran.stderr);
        assert!(!desk.path("out.ply").exists(), "{words}");
        // Any prefix of a file is a coarser mesh.
        let ran = desk.run(&format!("{command} cut.lpm{out}")).with_status(0);
        assert!(ran.stderr.contains("incomplete"), "{words}: {}", ran.stderr);
        let _ = fs::remove_file(desk.path("out.ply"));
    }
}

#[test]
fn what_a_killed_run_left_is_swept() {
    let desk = CliSandbox::new();
    desk.put("a.ply", &hills(3));
    desk.put(".lodsmith-Xa81bc.part", "half a mesh");
    desk.run("convert a.ply b.ply").with_status(0);
    assert_eq!(desk.names("."), ["a.ply", "b.ply"]);
}
