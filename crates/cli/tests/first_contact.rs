//! Regression tests of first contact: common first commands, and errors that say what to do.

use std::fs;

use crate::sandbox::{self, CliSandbox, hills};

/// Fault C1: `--ratio 50%` was refused as not a number.
#[test]
fn fractions_may_be_in_percent() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(8));
    sandbox.run("simplify a.ply -o by_number.ply --ratio 0.5").with_status(0);
    sandbox.run("simplify a.ply -o by_percent.ply --ratio 50%").with_status(0);
    assert_eq!(
        fs::read(sandbox.path("by_number.ply")).unwrap(),
        fs::read(sandbox.path("by_percent.ply")).unwrap()
    );
    sandbox.run("lod a.ply -O levels --levels 50%,0.25").with_status(0);
    assert!(sandbox.path("levels/a_lod2.ply").exists());
    for wrong in ["0%", "101%", "%", "50%%"] {
        let outcome = sandbox.run(&format!("simplify a.ply -o b.ply --ratio {wrong}")).with_status(2);
        assert!(outcome.stderr.contains("--ratio"), "{}", outcome.stderr);
    }
}

/// Options that the method does not have, or that exclude each other, ended with status 1, as if the file were wrong.
#[test]
fn incompatible_options_are_usage_errors() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(4));
    for arguments in [
        "simplify a.ply -o b.ply --faces 4 --cell 1",
        "simplify a.ply -o b.ply --method remesh --voxel 1 --adaptive",
        "lod a.ply -O levels --levels 0.5 --cell 1",
        "progressive build a.ply -o b.lpm --escalate",
    ] {
        sandbox.run(arguments).with_status(2).with_one_error();
    }
    // A usage error outweighs an error in a file.
    sandbox.run("simplify a.ply missing.ply -O low --faces 4 --cell 1").with_status(2);
}

/// Fault C2: for a folder as output, the error was that its extension names no format; without an output, no
/// message named `--out-dir`.
#[test]
fn a_folder_as_output_names_the_option_for_folders() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(4));
    fs::create_dir(sandbox.path("folder")).unwrap();
    for command in ["simplify a.ply -o folder --ratio 0.5", "clean a.ply -o folder"] {
        let outcome = sandbox.run(command).with_status(2).with_one_error();
        assert!(
            outcome.stderr.contains("is a folder") && outcome.stderr.contains("--out-dir"),
            "{}",
            outcome.stderr
        );
    }
    let outcome = sandbox.run("convert a.ply folder").with_status(2).with_one_error();
    assert!(outcome.stderr.contains("is a folder"), "{}", outcome.stderr);
    for command in ["simplify a.ply --ratio 0.5", "clean a.ply"] {
        let outcome = sandbox.run(command).with_status(2);
        assert!(outcome.stderr.contains("--out-dir"), "{}", outcome.stderr);
    }
}

/// Fault C3: for formats of other programs, the error was "its first bytes are of none of them".
#[test]
fn unsupported_formats_are_named_with_advice() {
    let sandbox = CliSandbox::new();
    let files = [
        ("a.usda", "#usda 1.0\n", "USD", "Blender"),
        ("a.blend", "BLENDER-v300", "Blender project", "glTF"),
        ("a.step", "ISO-10303-21;\nHEADER;\n", "STEP", "CAD"),
        ("a.zip", "PK\u{3}\u{4}\u{14}\0", "ZIP", "unpack"),
    ];
    for (name, content, format, way_out) in files {
        sandbox.put(name, content);
        let outcome = sandbox.run(&format!("info {name}")).with_status(1);
        assert!(
            outcome.stderr.contains(format) && outcome.stderr.contains(way_out),
            "{name}: {}",
            outcome.stderr
        );
    }
}

/// Builds without FBX, which needs a C compiler, explain how to get it.
#[cfg(not(feature = "fbx"))]
#[test]
fn a_build_without_fbx_names_the_feature() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.fbx", "; FBX 7.5.0 project file\n");
    let outcome = sandbox.run("info a.fbx").with_status(1).with_one_error();
    assert!(outcome.stderr.contains("--features fbx"), "{}", outcome.stderr);
}

/// Read-only formats are refused as outputs before anything is read.
#[test]
fn read_only_formats_are_refused_as_outputs() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(2));
    for name in ["b.fbx", "b.dae"] {
        let outcome = sandbox.run(&format!("convert a.ply {name}")).with_status(2).with_one_error();
        assert!(
            outcome.stderr.contains("can be read but not written") && outcome.stderr.contains(".glb"),
            "{}",
            outcome.stderr
        );
    }
}

/// Fault C6: labels of `info` were not separated from their numbers.
#[test]
fn labels_of_info_are_separated_from_their_numbers() {
    let sandbox = CliSandbox::new();
    // Two triangles that share a corner but no edge.
    sandbox.put("bow.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv -1 0 0\nv 0 -1 0\nf 1 2 3\nf 1 4 5\n");
    let outcome = sandbox.run("info bow.obj").with_status(0);
    assert!(outcome.text().contains("non-man. vertices 1"), "{}", outcome.text());
}

/// Fault C6: `info` did not count instances.
#[test]
fn info_counts_instances() {
    let sandbox = CliSandbox::new();
    sandbox.put("cart.gltf", &cart(""));
    let outcome = sandbox.run("info cart.gltf").with_status(0);
    assert!(outcome.text().contains("meshes            1 in 2 instances"), "{}", outcome.text());
    // The left wheel three times.
    let instancing =
        r#""left wheel", "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}"#;
    let used = r#", "extensionsUsed": ["EXT_mesh_gpu_instancing"]"#;
    sandbox.put("wheels.gltf", &cart(used).replace("\"left wheel\"", instancing));
    let object = sandbox.info("wheels.gltf");
    assert_eq!([&object["meshes"], &object["distinct_meshes"], &object["instances"]], [4, 1, 4]);
    let outcome = sandbox.run("info wheels.gltf").with_status(0);
    assert!(outcome.text().contains("1 in 4 instances"), "{}", outcome.text());
    sandbox.put("a.ply", &hills(2));
    assert!(!sandbox.run("info a.ply").with_status(0).text().contains("instances"));
}

/// Faults C6 and C8: `info` said that skins "are not carried" although nothing is written, and `compare` had
/// two rows of the same name.
#[test]
fn rows_of_compare_have_distinct_names() {
    let sandbox = CliSandbox::new();
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n";
    sandbox.put("a.obj", text);
    let outcome = sandbox.run("compare a.obj a.obj").with_status(0);
    let names: Vec<&str> = outcome.text().lines().filter_map(|line| line.get(..16)).map(str::trim).collect();
    let mut single = names.clone();
    single.sort_unstable();
    single.dedup();
    assert_eq!(single.len(), names.len(), "{names:?}");
    assert!(names.contains(&"face normals") && names.contains(&"vertex normals"), "{names:?}");
}

/// Fault C10: with `--json`, warnings were not printed to standard error, contrary to `docs/report.md`.
#[test]
fn warnings_reach_standard_error_with_json_too() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &sandbox::coloured_cube());
    let plain = sandbox.run("convert a.ply a.stl").with_status(0);
    assert!(plain.stderr.contains("warning:"), "{}", plain.stderr);
    let with_json = sandbox.run("simplify a.ply -o b.stl --ratio 0.5 --json").with_status(0);
    let [object] = &with_json.objects()[..] else { panic!("{:?}", with_json.stdout) };
    let warnings = object["warnings"].as_array().unwrap();
    assert!(!warnings.is_empty());
    for text in warnings {
        assert!(with_json.stderr.contains(text.as_str().unwrap()), "{text} of {}", with_json.stderr);
    }
    let quiet = sandbox.run("simplify a.ply -o c.stl --ratio 0.5 --json --quiet").with_status(0);
    assert_eq!(quiet.stderr, "");
}

/// Fault C10: `input.vertices` of a scene counted distinct positions instead of vertices of the file.
#[test]
fn vertices_of_the_input_are_counted_as_in_the_file() {
    let sandbox = CliSandbox::new();
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/arm.glb"), sandbox.path("arm.glb"))
        .unwrap();
    let of_file = sandbox.info("arm.glb");
    assert!(of_file["vertices"].as_u64() > of_file["positions"].as_u64());
    for output in ["low.glb", "low.ply"] {
        let outcome = sandbox.run(&format!("simplify arm.glb -o {output} --ratio 0.5 --json")).with_status(0);
        assert_eq!(outcome.objects()[0]["input"]["vertices"], of_file["vertices"], "{output}");
    }
}

/// Fault C11: levels of a mesh without a name were called `node_0_lod1`, contrary to `docs/lod.md`.
#[test]
fn levels_of_an_unnamed_mesh_are_named_after_the_file() {
    let sandbox = CliSandbox::new();
    sandbox.put("rock.ply", &hills(8));
    sandbox.run("lod rock.ply -o out.glb --levels 0.5,0.25").with_status(0);
    let bytes = fs::read(sandbox.path("out.glb")).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    for kind in ["nodes", "meshes"] {
        let names: Vec<&str> =
            json[kind].as_array().unwrap().iter().filter_map(|x| x["name"].as_str()).collect();
        assert_eq!(names, ["rock", "rock_lod1", "rock_lod2"], "{kind}");
    }
}

/// Fault C15: image formats that few readers of material libraries support were written without a warning.
#[test]
fn image_formats_unusual_in_material_libraries_give_warnings() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
    sandbox.put("a.mtl", "newmtl m\nmap_Kd a.webp\n");
    sandbox.put("a.webp", "RIFF\x04\0\0\0WEBP");
    let outcome = sandbox.run("convert a.obj b.obj").with_status(0);
    assert!(outcome.stderr.contains("WebP") && outcome.stderr.contains("PNG"), "{}", outcome.stderr);
    sandbox.put("a.mtl", "newmtl m\nmap_Kd a.png\n");
    fs::write(sandbox.path("a.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    let outcome = sandbox.run("convert a.obj c.obj").with_status(0);
    assert!(!outcome.stderr.contains("PNG"), "{}", outcome.stderr);
}

/// Fault C12: "no option would go further" was printed for a run that `--border free` takes further. The advice that
/// replaced it was also given for closed meshes.
#[test]
fn without_a_proposal_other_advice_is_given() {
    let sandbox = CliSandbox::new();
    // Two triangles that share a corner.
    sandbox.put("bow.off", "OFF\n5 2 0\n0 0 0\n1 0 0\n0 1 0\n-1 0 0\n0 -1 0\n3 0 1 2\n3 0 3 4\n");
    let keep = sandbox.run("simplify bow.off -o keep.off --faces 1").with_status(0);
    assert!(keep.stderr.contains("--border free may remove more"), "{}", keep.stderr);
    let free = sandbox.run("simplify bow.off -o free.off --faces 1 --border free").with_status(0);
    assert!(!free.stderr.contains("--border free"), "{}", free.stderr);
    sandbox.put("cube.ply", &sandbox::coloured_cube());
    let closed = sandbox.run("simplify cube.ply -o low.ply --faces 1").with_status(0);
    assert!(closed.stderr.ends_with("no option permits more collapses\n"), "{}", closed.stderr);
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
    let sandbox = CliSandbox::new();
    for folder in ["in", "in/tex", "out", "taken", "linked"] {
        fs::create_dir(sandbox.path(folder)).unwrap();
    }
    sandbox.put("in/cart.gltf", &cart(r#", "images": [{"uri": "tex/a%20b.png"}, {"uri": "../secret.png"}]"#));
    let image = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01";
    fs::write(sandbox.path("in/tex/a b.png"), image).unwrap();
    fs::write(sandbox.path("secret.png"), image).unwrap();
    let uris = |name: &str| {
        let json: serde_json::Value = serde_json::from_slice(&fs::read(sandbox.path(name)).unwrap()).unwrap();
        [0, 1].map(|i| json["images"][i]["uri"].as_str().unwrap().to_owned())
    };
    for command in ["convert in/cart.gltf out/cart.gltf", "clean in/cart.gltf -o out/cart.gltf"] {
        let outcome = sandbox.run(command).with_status(0);
        assert!(outcome.stderr.contains("secret.png is outside"), "{}", outcome.stderr);
        assert_eq!(uris("out/cart.gltf"), ["a%20b.png", "../in/../secret.png"]);
        assert_eq!(fs::read(sandbox.path("out/a b.png")).unwrap(), image);
        assert_eq!(sandbox.names("out"), ["a b.png", "cart.gltf"]);
    }
    // An existing file with this name is not changed.
    sandbox.put("taken/a b.png", "mine");
    sandbox.run("convert in/cart.gltf taken/cart.gltf").with_status(0);
    assert_eq!(uris("taken/cart.gltf")[0], "a%20b_1.png");
    assert_eq!(sandbox.names("taken"), ["a b.png", "a b_1.png", "cart.gltf"]);
    assert_eq!(fs::read(sandbox.path("taken/a b.png")).unwrap(), b"mine");
    // Images that exist already or are linked are not copied.
    sandbox.run("convert in/cart.gltf in/wagon.gltf").with_status(0);
    assert_eq!(uris("in/wagon.gltf"), ["tex/a%20b.png", "../secret.png"]);
    sandbox.run("convert in/cart.gltf linked/cart.gltf --textures link").with_status(0);
    assert_eq!(uris("linked/cart.gltf")[0], "../in/tex/a%20b.png");
    assert_eq!(sandbox.names("linked"), ["cart.gltf"]);
    assert_eq!(sandbox.names("."), ["in", "linked", "out", "secret.png", "taken"]);
}

/// Fault C4: from GLB to OBJ, names of nodes and meshes were dropped without a warning.
#[test]
fn dropped_names_give_warnings() {
    let sandbox = CliSandbox::new();
    sandbox.put("cart.gltf", &cart(""));
    let outcome = sandbox.run("convert cart.gltf cart.obj").with_status(0);
    assert!(outcome.stderr.contains("names of nodes and meshes"), "{}", outcome.stderr);
    let outcome = sandbox.run("convert cart.gltf cart.glb").with_status(0);
    assert_eq!(outcome.stderr, "");
}
