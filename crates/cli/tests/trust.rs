//! What files of strangers may not do: reach other files, write to the terminal, take the place of what is there.
//! docs/trust.md says the same for people.

mod desk;

use std::fs;

use desk::Desk;

const OUTSIDE: &str =
    "lies outside of the folder of the model (--asset-root DIR or --allow-outside lets it in)";
const IMAGE: &str = "P3 1 1 255 120 80 40";
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";

/// A model in a folder `in` that names an image beside this folder, in each way that a path can be written.
fn with_a_secret() -> (Desk, [String; 2]) {
    let desk = Desk::new();
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

/// A glTF file with one triangle, one image and its buffer in a file of its own.
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
    let desk = Desk::new();
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
    assert!(ran.stderr.contains("the file note.txt is no image of a known type"), "{}", ran.stderr);
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

/// Whether a terminal would do more with a character than show it; ends of lines aside.
fn is_unsafe(c: char) -> bool {
    c != '\n' && (c.is_control() || "\u{61c}\u{200e}\u{200f}\u{202a}\u{202e}\u{2066}\u{2069}".contains(c))
}

#[test]
fn names_of_a_file_write_nothing_to_the_terminal() {
    let desk = Desk::new();
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
        format!("info --json {file} a.gltf"),
        format!("simplify {file} -o b.obj --ratio 0.5 --json"),
    ] {
        let ran = desk.run(&words);
        for text in [ran.text(), &ran.stderr] {
            assert!(!text.contains(is_unsafe), "{}: {}", words.escape_debug(), text.escape_debug());
        }
        assert!(!ran.text().is_empty() || !ran.stderr.is_empty());
    }
    // Programs get the very name.
    assert_eq!(desk.info(&file)["path"], file.as_str());
}
