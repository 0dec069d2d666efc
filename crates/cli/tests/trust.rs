//! Protection against untrusted files: they cannot access other files, write to the terminal, or replace
//! existing files. docs/trust.md promises this to users.

use std::fs;

use crate::sandbox::{CliSandbox, hills};

const OUTSIDE: &str = "is outside the folder of the model (--asset-root DIR or --allow-outside permits it)";
const IMAGE: &str = "P3 1 1 255 120 80 40";
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";

/// A model in a folder `in`, and the names of an image outside this folder: as a relative and as an absolute path.
fn with_a_secret() -> (CliSandbox, [String; 2]) {
    let sandbox = CliSandbox::new();
    for folder in ["in", "out"] {
        fs::create_dir(sandbox.path(folder)).expect("the folder can be created");
    }
    sandbox.put("secret.ppm", IMAGE);
    sandbox.put("in/a.obj", &format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1/1 2/2 3/3\n"));
    let names = ["../secret.ppm".to_owned(), sandbox.path("secret.ppm").display().to_string()];
    (sandbox, names)
}

#[test]
fn no_command_copies_a_file_from_outside_the_folder() {
    let (sandbox, names) = with_a_secret();
    for name in names {
        sandbox.put("in/a.mtl", &format!("newmtl m\nmap_Kd {name}\n"));
        for arguments in [
            "convert in/a.obj out/a.obj",
            "convert in/a.obj out/a.glb",
            "simplify in/a.obj -o out/a.obj --ratio 1",
            "clean in/a.obj -o out/a.obj",
            "lod in/a.obj -O out --levels 1 --to obj",
            "methods in/a.obj -O out --method quadric --ratio 1",
            "progressive build in/a.obj -o out/a.lpm",
        ] {
            let outcome = sandbox.run(arguments).with_status(0);
            assert!(outcome.stderr.contains(OUTSIDE), "{arguments}: {}", outcome.stderr);
            for file in sandbox.names("out") {
                assert!(!file.contains("secret"), "{arguments}: {file}");
                let bytes = fs::read(sandbox.path("out").join(&file)).expect("it was written");
                assert!(!bytes.windows(IMAGE.len()).any(|w| w == IMAGE.as_bytes()), "{arguments}: {file}");
            }
            for flag in ["--allow-outside", "--asset-root ."] {
                let outcome = sandbox.run(&format!("{arguments} {flag}")).with_status(0);
                assert!(!outcome.stderr.contains(OUTSIDE), "{arguments} {flag}: {}", outcome.stderr);
            }
            fs::remove_dir_all(sandbox.path("out")).expect("the test owns it");
            fs::create_dir(sandbox.path("out")).expect("the folder can be created");
        }
    }
    sandbox.run("convert in/a.obj out/a.obj --allow-outside").with_status(0);
    assert_eq!(sandbox.names("out"), ["a.mtl", "a.obj", "secret.ppm"]);
    sandbox.run("info in/a.obj --allow-outside --asset-root .").with_status(2);
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
fn a_scene_embeds_only_images_of_its_folder() {
    let sandbox = CliSandbox::new();
    fs::create_dir(sandbox.path("in")).expect("the folder can be created");
    let corners: Vec<u8> =
        [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].into_iter().flat_map(f32::to_le_bytes).collect();
    let secret = "a word that nobody else may read";
    for (name, bytes) in
        [("in/a.bin", &corners[..]), ("secret.bin", &corners), ("in/note.txt", secret.as_bytes())]
    {
        fs::write(sandbox.path(name), bytes).expect("the file can be written");
    }
    sandbox.put("secret.ppm", IMAGE);
    let holds = |name: &str, what: &str| {
        let bytes = fs::read(sandbox.path(name)).expect("it was written");
        bytes.windows(what.len()).any(|w| w == what.as_bytes())
    };
    sandbox.put("in/a.gltf", &gltf("a.bin", "note.txt"));
    let outcome = sandbox.run("convert in/a.gltf a.glb").with_status(0);
    assert!(
        outcome.stderr.contains("the file note.txt is not an image of a known type"),
        "{}",
        outcome.stderr
    );
    assert!(!holds("a.glb", secret));
    sandbox.put("in/a.gltf", &gltf("a.bin", "../secret.ppm"));
    let outcome = sandbox.run("convert in/a.gltf a.glb").with_status(0);
    assert!(outcome.stderr.contains(OUTSIDE) && !holds("a.glb", IMAGE), "{}", outcome.stderr);
    sandbox.run("convert in/a.gltf a.glb --allow-outside").with_status(0);
    assert!(holds("a.glb", "../secret.ppm"), "a type that glTF does not know stays a file of its own");
    sandbox.put("in/a.gltf", &gltf("../secret.bin", "note.txt"));
    let outcome = sandbox.run("info in/a.gltf").with_status(1).with_one_error();
    assert!(outcome.stderr.contains(OUTSIDE), "{}", outcome.stderr);
    sandbox.run("info in/a.gltf --asset-root .").with_status(0);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../secret.bin", sandbox.path("in/link.bin"))
            .expect("symbolic links are supported");
        sandbox.put("in/a.gltf", &gltf("link.bin", "note.txt"));
        let outcome = sandbox.run("info in/a.gltf").with_status(1).with_one_error();
        assert!(outcome.stderr.contains(OUTSIDE), "{}", outcome.stderr);
    }
}

/// Returns true if a terminal would interpret a character instead of showing it; line ends excepted.
fn is_unsafe(c: char) -> bool {
    c != '\n' && (c.is_control() || "\u{61c}\u{200e}\u{200f}\u{202a}\u{202e}\u{2066}\u{2069}".contains(c))
}

#[test]
fn names_of_a_file_write_nothing_to_the_terminal() {
    let sandbox = CliSandbox::new();
    let evil = "x\u{1b}[2J\u{1b}]0;t\u{7}\u{9b}31m\u{202e}\u{7f}y";
    let (file, obj) =
        (format!("{evil}.obj"), format!("o {evil}\ng {evil}\nmtllib {evil}.mtl\n{TRIANGLE}usemtl {evil}\n"));
    sandbox.put(&file, &format!("{obj}f 1/1 2/2 3/3\n"));
    sandbox.put("a.obj", &format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1/1 2/2 3/3\n"));
    sandbox.put("a.mtl", &format!("newmtl m\nmap_Kd {evil}.png\n{evil} 1\n"));
    let json = evil.replace('\u{1b}', "\\u001b").replace('\u{7}', "\\u0007");
    let plain = gltf(&format!("{json}.bin"), &format!("{json}.png"));
    sandbox.put("a.gltf", &plain.replace("\"primitives\"", &format!("\"name\":\"{json}\",\"primitives\"")));
    for arguments in [
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
        let outcome = sandbox.run(&arguments);
        for text in [outcome.text(), &outcome.stderr] {
            assert!(!text.contains(is_unsafe), "{}: {}", arguments.escape_debug(), text.escape_debug());
        }
        assert!(!outcome.text().is_empty() || !outcome.stderr.is_empty());
    }
    // JSON has the exact name.
    assert_eq!(sandbox.info(&file)["path"], file.as_str());
}

#[test]
fn an_input_is_overwritten_only_with_force() {
    let sandbox = CliSandbox::new();
    let mesh = hills(6);
    let put = || {
        sandbox.put("a.ply", &mesh);
        sandbox.put("b.ply", &mesh);
    };
    put();
    sandbox.run("progressive build a.ply -o a.lpm").with_status(0);
    fs::copy(sandbox.path("a.ply"), sandbox.path("a.png")).expect("the file can be written");
    fs::copy(sandbox.path("a.ply"), sandbox.path("low0.ply")).expect("the file can be written");
    for (arguments, input) in [
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
        let before = fs::read(sandbox.path(input)).expect("it is there");
        let outcome = sandbox.run(arguments).with_status(2).with_one_error();
        assert!(
            outcome.stderr.contains("is an input; --force overwrites it"),
            "{arguments}: {}",
            outcome.stderr
        );
        assert!(fs::read(sandbox.path(input)).expect("it is there") == before, "{arguments}");
        sandbox.run(&format!("{arguments} --force")).with_status(0);
        assert!(fs::read(sandbox.path(input)).expect("it is there") != before, "{arguments}");
        fs::write(sandbox.path(input), before).expect("the file can be written");
    }
    // A dry run writes nothing, so it needs no --force.
    sandbox.run("simplify a.ply -o a.ply --ratio 0.5 --dry-run").with_status(0);
}

#[cfg(unix)]
#[test]
fn a_dangling_link_gets_its_target() {
    use std::os::unix::fs::symlink;
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(3));
    fs::create_dir(sandbox.path("far")).expect("the folder can be created");
    symlink("far/b.ply", sandbox.path("b.ply")).expect("symbolic links are supported");
    symlink("far/b.png", sandbox.path("b.png")).expect("symbolic links are supported");
    symlink("none/c.ply", sandbox.path("c.ply")).expect("symbolic links are supported");
    sandbox.run("convert a.ply b.ply").with_status(0);
    sandbox.run("render a.ply -o b.png --size 16x16").with_status(0);
    assert_eq!(sandbox.names("far"), ["b.ply", "b.png"]);
    sandbox.run("convert a.ply c.ply").with_status(1).with_one_error();
    for name in ["b.ply", "b.png", "c.ply"] {
        assert!(sandbox.path(name).is_symlink(), "{name}");
    }
}

#[cfg(unix)]
#[test]
fn a_mesh_to_a_closed_pipe_is_a_failure() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(40));
    for arguments in [
        "convert a.ply - --to obj --quiet",
        "simplify a.ply -o - --to glb --ratio 0.9",
        "progressive build a.ply -o -",
        "render a.ply -o - --size 64x64",
    ] {
        let output = sandbox.run_without_reader(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments}");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(
            stderr.contains("standard output was closed before all was written"),
            "{arguments}: {stderr}"
        );
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_is_reported_once() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(40));
    for arguments in [
        "convert a.ply - --to obj --quiet",
        "simplify a.ply -o - --to glb --ratio 0.9",
        "clean a.ply -o - --to ply",
        "render a.ply -o - --size 64x64",
        "info a.ply",
        "--help",
        "simplify --help",
        "--version",
    ] {
        let outcome = sandbox.run_into_full_device(arguments).with_status(1).with_one_error();
        assert!(
            outcome.stderr.contains("cannot write to standard output"),
            "{arguments}: {}",
            outcome.stderr
        );
    }
}

#[test]
fn a_damaged_progressive_mesh_is_a_failure() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(12));
    sandbox.run("progressive build a.ply -o a.lpm").with_status(0);
    let bytes = fs::read(sandbox.path("a.lpm")).expect("it was written");
    let mut damaged = bytes.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 4;
    fs::write(sandbox.path("bad.lpm"), damaged).expect("the file can be written");
    fs::write(sandbox.path("cut.lpm"), &bytes[..middle]).expect("the file can be written");
    for arguments in ["progressive info", "info", "progressive extract -o out.ply", "convert --to ply"] {
        let (command, out) =
            if arguments.starts_with("convert") { (arguments, " out.ply") } else { (arguments, "") };
        let outcome = sandbox.run(&format!("{command} bad.lpm{out}")).with_status(1).with_one_error();
        assert!(outcome.stderr.contains("damaged"), "{arguments}: {}", outcome.stderr);
        assert!(!sandbox.path("out.ply").exists(), "{arguments}");
        // Any prefix of a file is a coarser mesh.
        let outcome = sandbox.run(&format!("{command} cut.lpm{out}")).with_status(0);
        assert!(outcome.stderr.contains("incomplete"), "{arguments}: {}", outcome.stderr);
        let _ = fs::remove_file(sandbox.path("out.ply"));
    }
}

#[test]
fn leftovers_of_a_killed_run_are_removed() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(3));
    sandbox.put(".lodsmith-Xa81bc.part", "half a mesh");
    sandbox.run("convert a.ply b.ply").with_status(0);
    assert_eq!(sandbox.names("."), ["a.ply", "b.ply"]);
}
