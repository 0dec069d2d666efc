//! First contact of a user: options as people type them, and errors that name a remedy. Regressions, by name.

use std::fs;

use crate::desk::{self, CliSandbox, hills};

/// Fault C1: `--ratio 50%` was refused as no number.
#[test]
fn fractions_may_be_typed_in_percent() {
    let desk = CliSandbox::new();
    desk.put("a.ply", &hills(8));
    desk.run("simplify a.ply -o by_number.ply --ratio 0.5").with_status(0);
    desk.run("simplify a.ply -o by_percent.ply --ratio 50%").with_status(0);
    assert_eq!(fs::read(desk.path("by_number.ply")).unwrap(), fs::read(desk.path("by_percent.ply")).unwrap());
    desk.run("lod a.ply -O levels --levels 50%,0.25").with_status(0);
    assert!(desk.path("levels/a_lod2.ply").exists());
    for wrong in ["0%", "101%", "%", "50%%"] {
        let ran = desk.run(&format!("simplify a.ply -o b.ply --ratio {wrong}")).with_status(2);
        assert!(ran.stderr.contains("--ratio"), "{}", ran.stderr);
    }
}

/// Options that the method does not have, or that exclude each other, ended with status 1, as if the file were at
/// fault.
#[test]
fn options_that_do_not_go_together_are_a_fault_of_the_command_line() {
    let desk = CliSandbox::new();
    desk.put("a.ply", &hills(4));
    for words in [
        "simplify a.ply -o b.ply --faces 4 --cell 1",
        "simplify a.ply -o b.ply --method remesh --voxel 1 --adaptive",
        "lod a.ply -O levels --levels 0.5 --cell 1",
        "progressive build a.ply -o b.lpm --escalate",
    ] {
        desk.run(words).with_status(2).with_one_error();
    }
    // The command line outweighs a file at fault.
    desk.run("simplify a.ply missing.ply -O low --faces 4 --cell 1").with_status(2);
}

/// Fault C2: for a folder as output the error was that its ending names no format, and without an output
/// nothing named `-O`.
#[test]
fn a_folder_as_output_names_the_option_for_folders() {
    let desk = CliSandbox::new();
    desk.put("a.ply", &hills(4));
    fs::create_dir(desk.path("folder")).unwrap();
    for command in ["simplify a.ply -o folder --ratio 0.5", "clean a.ply -o folder"] {
        let ran = desk.run(command).with_status(2).with_one_error();
        assert!(ran.stderr.contains("is a folder") && ran.stderr.contains("-O"), "{}", ran.stderr);
    }
    let ran = desk.run("convert a.ply folder").with_status(2).with_one_error();
    assert!(ran.stderr.contains("is a folder"), "{}", ran.stderr);
    for command in ["simplify a.ply --ratio 0.5", "clean a.ply"] {
        let ran = desk.run(command).with_status(2);
        assert!(ran.stderr.contains("--out-dir"), "{}", ran.stderr);
    }
}

/// Fault C3: for formats that other programs write the error was "its first bytes are of none of them".
#[test]
fn formats_that_are_not_read_are_named_with_a_way_out() {
    let desk = CliSandbox::new();
    let files = [
        ("a.usda", "#usda 1.0\n", "USD", "Blender"),
        ("a.blend", "BLENDER-v300", "Blender project", "glTF"),
        ("a.step", "ISO-10303-21;\nHEADER;\n", "STEP", "CAD"),
        ("a.zip", "PK\u{3}\u{4}\u{14}\0", "ZIP", "unpack"),
    ];
    for (name, content, format, way_out) in files {
        desk.put(name, content);
        let ran = desk.run(&format!("info {name}")).with_status(1);
        assert!(ran.stderr.contains(format) && ran.stderr.contains(way_out), "{name}: {}", ran.stderr);
    }
}

/// FBX needs a C compiler to build: without it, the message says how to get it.
#[cfg(not(feature = "fbx"))]
#[test]
fn a_build_without_fbx_names_the_feature() {
    let desk = CliSandbox::new();
    desk.put("a.fbx", "; FBX 7.5.0 project file\n");
    let ran = desk.run("info a.fbx").with_status(1).with_one_error();
    assert!(ran.stderr.contains("--features fbx"), "{}", ran.stderr);
}

/// Formats that are read only are refused as outputs before anything is read.
#[test]
fn outputs_that_are_not_written_are_refused() {
    let desk = CliSandbox::new();
    desk.put("a.ply", &hills(2));
    for name in ["b.fbx", "b.dae"] {
        let ran = desk.run(&format!("convert a.ply {name}")).with_status(2).with_one_error();
        assert!(
            ran.stderr.contains("can be read but not written") && ran.stderr.contains(".glb"),
            "{}",
            ran.stderr
        );
    }
}

/// Fault C6: labels of `info` were not separated from their numbers.
#[test]
fn labels_of_info_stand_apart_from_their_numbers() {
    let desk = CliSandbox::new();
    // Two triangles that share a corner but no edge.
    desk.put("bow.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv -1 0 0\nv 0 -1 0\nf 1 2 3\nf 1 4 5\n");
    let ran = desk.run("info bow.obj").with_status(0);
    assert!(ran.text().contains("non-man. vertices 1"), "{}", ran.text());
}

/// Fault C6: `info` did not count the instances of a mesh.
#[test]
fn info_counts_instances() {
    let desk = CliSandbox::new();
    desk.put("cart.gltf", &cart(""));
    let ran = desk.run("info cart.gltf").with_status(0);
    assert!(ran.text().contains("meshes            1 in 2 instances"), "{}", ran.text());
    // The left wheel three times.
    let instancing =
        r#""left wheel", "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}"#;
    let used = r#", "extensionsUsed": ["EXT_mesh_gpu_instancing"]"#;
    desk.put("wheels.gltf", &cart(used).replace("\"left wheel\"", instancing));
    let object = desk.info("wheels.gltf");
    assert_eq!([&object["meshes"], &object["distinct_meshes"], &object["instances"]], [4, 1, 4]);
    let ran = desk.run("info wheels.gltf").with_status(0);
    assert!(ran.text().contains("1 in 4 instances"), "{}", ran.text());
    desk.put("a.ply", &hills(2));
    assert!(!desk.run("info a.ply").with_status(0).text().contains("instances"));
}

/// Faults C6 and C8: `info` said that skins "are not carried" although nothing is written, and `compare` had
/// two rows of the same name.
#[test]
fn rows_of_compare_have_names_of_their_own() {
    let desk = CliSandbox::new();
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n";
    desk.put("a.obj", text);
    let ran = desk.run("compare a.obj a.obj").with_status(0);
    let names: Vec<&str> = ran.text().lines().filter_map(|line| line.get(..16)).map(str::trim).collect();
    let mut single = names.clone();
    single.sort_unstable();
    single.dedup();
    assert_eq!(single.len(), names.len(), "{names:?}");
    assert!(names.contains(&"face normals") && names.contains(&"vertex normals"), "{names:?}");
}

/// Fault C10: with `--json` no warning reached standard error, against `docs/report.md`.
#[test]
fn warnings_reach_standard_error_with_json_too() {
    let desk = CliSandbox::new();
    desk.put("a.ply", &desk::coloured_cube());
    let plain = desk.run("convert a.ply a.stl").with_status(0);
    assert!(plain.stderr.contains("warning:"), "{}", plain.stderr);
    let with_json = desk.run("simplify a.ply -o b.stl --ratio 0.5 --json").with_status(0);
    let [object] = &with_json.objects()[..] else { panic!("{:?}", with_json.stdout) };
    let told = object["warnings"].as_array().unwrap();
    assert!(!told.is_empty());
    for text in told {
        assert!(with_json.stderr.contains(text.as_str().unwrap()), "{text} of {}", with_json.stderr);
    }
    let quiet = desk.run("simplify a.ply -o c.stl --ratio 0.5 --json --quiet").with_status(0);
    assert_eq!(quiet.stderr, "");
}

/// Fault C10: `input.vertices` of a scene did not count what the file has, but places.
#[test]
fn vertices_of_the_input_are_those_of_the_file() {
    let desk = CliSandbox::new();
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/arm.glb"), desk.path("arm.glb")).unwrap();
    let of_file = desk.info("arm.glb");
    assert!(of_file["vertices"].as_u64() > of_file["positions"].as_u64());
    for output in ["low.glb", "low.ply"] {
        let ran = desk.run(&format!("simplify arm.glb -o {output} --ratio 0.5 --json")).with_status(0);
        assert_eq!(ran.objects()[0]["input"]["vertices"], of_file["vertices"], "{output}");
    }
}

/// Fault C11: levels of a mesh without a name were called `node_0_lod1`, against `docs/lod.md`.
#[test]
fn levels_of_a_mesh_without_a_name_are_called_after_its_file() {
    let desk = CliSandbox::new();
    desk.put("rock.ply", &hills(8));
    desk.run("lod rock.ply -o out.glb --levels 0.5,0.25").with_status(0);
    let bytes = fs::read(desk.path("out.glb")).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    for kind in ["nodes", "meshes"] {
        let names: Vec<&str> =
            json[kind].as_array().unwrap().iter().filter_map(|x| x["name"].as_str()).collect();
        assert_eq!(names, ["rock", "rock_lod1", "rock_lod2"], "{kind}");
    }
}

/// Fault C15: images that few readers of material libraries know went into one without a word.
#[test]
fn images_that_material_libraries_rarely_name_are_warned_of() {
    let desk = CliSandbox::new();
    desk.put("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
    desk.put("a.mtl", "newmtl m\nmap_Kd a.webp\n");
    desk.put("a.webp", "RIFF\x04\0\0\0WEBP");
    let ran = desk.run("convert a.obj b.obj").with_status(0);
    assert!(ran.stderr.contains("WebP") && ran.stderr.contains("PNG"), "{}", ran.stderr);
    desk.put("a.mtl", "newmtl m\nmap_Kd a.png\n");
    fs::write(desk.path("a.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    let ran = desk.run("convert a.obj c.obj").with_status(0);
    assert!(!ran.stderr.contains("PNG"), "{}", ran.stderr);
}

/// Fault C12: "no option would go further" was said of a run that `--border free` takes further. The advice that
/// replaced it was also given for closed meshes.
#[test]
fn where_nothing_is_proposed_another_way_is_named() {
    let desk = CliSandbox::new();
    // Two triangles that share a corner.
    desk.put("bow.off", "OFF\n5 2 0\n0 0 0\n1 0 0\n0 1 0\n-1 0 0\n0 -1 0\n3 0 1 2\n3 0 3 4\n");
    let keep = desk.run("simplify bow.off -o keep.off --faces 1").with_status(0);
    assert!(keep.stderr.contains("--border free may still end lower"), "{}", keep.stderr);
    let free = desk.run("simplify bow.off -o free.off --faces 1 --border free").with_status(0);
    assert!(!free.stderr.contains("--border free"), "{}", free.stderr);
    desk.put("cube.ply", &desk::coloured_cube());
    let closed = desk.run("simplify cube.ply -o low.ply --faces 1").with_status(0);
    assert!(closed.stderr.ends_with("no option frees what is left\n"), "{}", closed.stderr);
}

/// A triangle that two nodes place, with more keys of the file.
fn cart(more: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 1]}}],
        "nodes": [{{"name": "left wheel", "mesh": 0}}, {{"name": "right wheel", "mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
        "buffers": [{{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}]{more}}}"#
    )
}

/// Fault C5: `--textures copy` did nothing for a `.gltf` in another folder.
#[test]
fn images_are_copied_beside_a_scene() {
    let desk = CliSandbox::new();
    for folder in ["in", "in/tex", "out", "taken", "linked"] {
        fs::create_dir(desk.path(folder)).unwrap();
    }
    desk.put("in/cart.gltf", &cart(r#", "images": [{"uri": "tex/a%20b.png"}, {"uri": "../secret.png"}]"#));
    let image = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01";
    fs::write(desk.path("in/tex/a b.png"), image).unwrap();
    fs::write(desk.path("secret.png"), image).unwrap();
    let uris = |name: &str| {
        let json: serde_json::Value = serde_json::from_slice(&fs::read(desk.path(name)).unwrap()).unwrap();
        [0, 1].map(|i| json["images"][i]["uri"].as_str().unwrap().to_owned())
    };
    for command in ["convert in/cart.gltf out/cart.gltf", "clean in/cart.gltf -o out/cart.gltf"] {
        let ran = desk.run(command).with_status(0);
        assert!(ran.stderr.contains("secret.png is outside"), "{}", ran.stderr);
        assert_eq!(uris("out/cart.gltf"), ["a%20b.png", "../in/../secret.png"]);
        assert_eq!(fs::read(desk.path("out/a b.png")).unwrap(), image);
        assert_eq!(desk.names("out"), ["a b.png", "cart.gltf"]);
    }
    // Another file of the name stays as it is.
    desk.put("taken/a b.png", "mine");
    desk.run("convert in/cart.gltf taken/cart.gltf").with_status(0);
    assert_eq!(uris("taken/cart.gltf")[0], "a%20b_1.png");
    assert_eq!(desk.names("taken"), ["a b.png", "a b_1.png", "cart.gltf"]);
    assert_eq!(fs::read(desk.path("taken/a b.png")).unwrap(), b"mine");
    // Images that are there already, or linked, are not copied.
    desk.run("convert in/cart.gltf in/wagon.gltf").with_status(0);
    assert_eq!(uris("in/wagon.gltf"), ["tex/a%20b.png", "../secret.png"]);
    desk.run("convert in/cart.gltf linked/cart.gltf --textures link").with_status(0);
    assert_eq!(uris("linked/cart.gltf")[0], "../in/tex/a%20b.png");
    assert_eq!(desk.names("linked"), ["cart.gltf"]);
    assert_eq!(desk.names("."), ["in", "linked", "out", "secret.png", "taken"]);
}

/// Fault C4: on the way from GLB to OBJ names of nodes and meshes went without a word.
#[test]
fn names_that_go_are_warned_of() {
    let desk = CliSandbox::new();
    desk.put("cart.gltf", &cart(""));
    let ran = desk.run("convert cart.gltf cart.obj").with_status(0);
    assert!(ran.stderr.contains("names of nodes and meshes"), "{}", ran.stderr);
    let ran = desk.run("convert cart.gltf cart.glb").with_status(0);
    assert_eq!(ran.stderr, "");
}
