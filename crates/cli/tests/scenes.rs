//! Sizes, limits and distances are those of the scene as it stands: instances, joints, stretched nodes.

use std::fs;

use serde_json::{Value, json};

use crate::desk::{CliSandbox, hills};

/// Returns a hilly square as glTF, whose nodes the caller changes.
fn sheet(desk: &CliSandbox, n: usize) -> Value {
    desk.put("sheet.ply", &hills(n));
    desk.run("convert sheet.ply sheet.gltf --force").with_status(0);
    serde_json::from_slice(&fs::read(desk.path("sheet.gltf")).unwrap()).unwrap()
}

fn put(desk: &CliSandbox, name: &str, json: &Value) {
    desk.put(name, &json.to_string());
}

/// Adds an accessor of floats in a buffer of its own.
fn accessor(json: &mut Value, kind: &str, width: usize, numbers: &[f32]) -> usize {
    let push = |json: &mut Value, name: &str, entry: Value| {
        let all = json[name].as_array_mut().unwrap();
        all.push(entry);
        all.len() - 1
    };
    let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    // Percent-encoding needs no other crate.
    let text: String = bytes.iter().map(|b| format!("%{b:02X}")).collect();
    let uri = format!("data:application/octet-stream,{text}");
    let buffer = push(json, "buffers", json!({"byteLength": bytes.len(), "uri": uri}));
    let view = push(json, "bufferViews", json!({"buffer": buffer, "byteLength": bytes.len()}));
    let count = numbers.len() / width;
    push(json, "accessors", json!({"bufferView": view, "componentType": 5126, "count": count, "type": kind}))
}

fn report(desk: &CliSandbox, words: &str) -> Value {
    desk.run(words).with_status(0).objects().remove(0)
}

/// The limit was a share of one mesh at the origin, and one copy was written to formats without scenes.
#[test]
fn copies_of_an_extension_count_as_nodes_do() {
    let desk = CliSandbox::new();
    let places: Vec<[f32; 3]> = (0..12).map(|k| [3.0 * k as f32, (k % 3) as f32, 0.0]).collect();
    let mut nodes = sheet(&desk, 24);
    let node = |at: &[f32; 3]| json!({"mesh": 0, "translation": at});
    nodes["nodes"] = places.iter().map(node).collect();
    nodes["scenes"] = json!([{"nodes": (0..12).collect::<Vec<_>>()}]);
    put(&desk, "nodes.gltf", &nodes);
    let mut copies = sheet(&desk, 24);
    let moves = accessor(&mut copies, "VEC3", 3, places.as_flattened());
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves}}});
    (copies["nodes"], copies["scenes"]) =
        (json!([{"mesh": 0, "extensions": extension}]), json!([{"nodes": [0]}]));
    copies["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    copies["extensionsUsed"] = copies["extensionsRequired"].clone();
    put(&desk, "copies.gltf", &copies);

    let [of_nodes, of_copies] = ["nodes", "copies"].map(|name| {
        let got = report(&desk, &format!("simplify {name}.gltf -o {name}.glb --error .1% --json"));
        desk.run(&format!("convert {name}.gltf {name}.obj")).with_status(0);
        let info = desk.info(&format!("{name}.gltf"));
        assert_eq!(desk.faces(&format!("{name}.obj")), 12 * 1152);
        let seen = [&info["meshes"], &info["instances"], &info["faces"], &info["bounds"]["diagonal"]];
        (got["output"]["faces"].clone(), got["error"]["diagonal"].as_f64().unwrap(), seen.map(Value::clone))
    });
    assert_eq!((&of_nodes.0, &of_nodes.2), (&of_copies.0, &of_copies.2));
    assert!((of_nodes.1 - of_copies.1).abs() < 1e-6 * of_nodes.1, "{} and {}", of_nodes.1, of_copies.1);
    let same = report(&desk, "compare nodes.gltf copies.gltf --json");
    assert!(same["hausdorff"]["symmetric"].as_f64().unwrap() < 1e-5, "{same}");
}

/// A skin with a hundredth in its inverse bind matrices made the mesh a hundred times too important.
#[test]
fn a_skinned_mesh_has_the_size_that_its_joints_give_it() {
    let desk = CliSandbox::new();
    let mut json = sheet(&desk, 24);
    let (position, count) = (json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].clone(), 25 * 25);
    let joints = accessor(&mut json, "VEC4", 4, &vec![0.0; 4 * count]);
    // Joints are bytes; zeros of four times the size are as good.
    json["accessors"][joints]["componentType"] = 5121.into();
    let weights = accessor(&mut json, "VEC4", 4, &[1.0f32, 0.0, 0.0, 0.0].repeat(count));
    let small = [0.01f32, 0., 0., 0., 0., 0.01, 0., 0., 0., 0., 0.01, 0., 0., 0., 0., 1.];
    let bind = accessor(&mut json, "MAT4", 16, &small);
    let mut skinned = json["meshes"][0].clone();
    skinned["primitives"][0]["attributes"] =
        json!({"POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights});
    json["meshes"].as_array_mut().unwrap().push(skinned);
    json["skins"] = json!([{"joints": [2], "inverseBindMatrices": bind}]);
    // A hundred times as large in the file, a hundredth of that by its joint.
    json["nodes"] = json!([{"mesh": 0}, {"mesh": 1, "skin": 0}, {"translation": [5.0, 0.0, 0.0], "scale": [100.0, 100.0, 100.0]}]);
    json["scenes"] = json!([{"nodes": [0, 1, 2]}]);
    put(&desk, "both.gltf", &json);
    let got = report(&desk, "simplify both.gltf -o both.glb --ratio .2 --json");
    let faces = |k: usize| got["meshes"][k]["output"]["faces"].as_u64().unwrap();
    assert!(faces(0).abs_diff(faces(1)) * 10 <= faces(0), "{} and {}", faces(0), faces(1));
    let diagonal = got["error"]["diagonal"].as_f64().unwrap();
    let info = desk.info("both.gltf")["bounds"]["diagonal"].as_f64().unwrap();
    assert!((diagonal - info).abs() < 1e-5 * info && diagonal < 7.0, "{diagonal} and {info}");
}

/// A node that stretches its mesh made every error as large as along its longest axis.
#[test]
fn a_stretched_mesh_is_measured_as_it_stands() {
    let desk = CliSandbox::new();
    let mut json = sheet(&desk, 32);
    let node = json["nodes"].as_array().unwrap().iter().position(|n| !n["mesh"].is_null()).unwrap();
    json["nodes"][node]["scale"] = json!([60.0, 1.0, 1.0]);
    put(&desk, "node.gltf", &json);
    desk.run("convert node.gltf mesh.obj").with_status(0);
    desk.run("convert mesh.obj mesh.glb").with_status(0);
    let [of_node, of_mesh] = ["node.gltf", "mesh.glb"].map(|name| {
        let got = report(&desk, &format!("simplify {name} -o out_{name} --error .01 --measure --json"));
        let seen = report(&desk, &format!("compare {name} out_{name} --json"));
        let (told, seen) = (&got["error"]["measured"]["rms"]["symmetric"], &seen["rms"]["symmetric"]);
        let (told, seen) = (told.as_f64().unwrap(), seen.as_f64().unwrap());
        assert!((told - seen).abs() <= 0.1 * seen, "{name}: told {told}, seen {seen}");
        got["output"]["faces"].as_u64().unwrap()
    });
    assert!(of_node.abs_diff(of_mesh) * 10 <= of_mesh, "{of_node} and {of_mesh}");
}

/// Small meshes beside a large one vanished without a word.
#[test]
fn meshes_that_starve_under_a_common_target_are_told() {
    let desk = CliSandbox::new();
    let mut json = sheet(&desk, 24);
    let prop = |k: usize| json!({"mesh": 1, "translation": [k, 2.0, 0.0], "scale": [0.001, 0.001, 0.001]});
    let second = json["meshes"][0].clone();
    json["meshes"].as_array_mut().unwrap().push(second);
    json["nodes"] = json!([{"mesh": 0}, prop(1), prop(2)]);
    json["scenes"] = json!([{"nodes": [0, 1, 2]}]);
    put(&desk, "props.gltf", &json);
    let ran = desk.run("simplify props.gltf -o a.glb --ratio .2 --strict").with_status(0);
    let told = "1 of 2 meshes are small in the scene and lost their shape";
    assert!(ran.stderr.contains(told) && ran.stderr.contains("--per-mesh"), "{}", ran.stderr);
    let each = desk.run("simplify props.gltf -o b.glb --ratio .2 --per-mesh").with_status(0);
    assert!(!each.stderr.contains("small in the scene"), "{}", each.stderr);
    let ran = desk.run("lod props.gltf -o lod.glb --levels .5,.2");
    assert!(ran.stderr.contains("small in the scene"), "{}", ran.stderr);
}
