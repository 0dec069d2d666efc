//! Sizes, limits and distances are measured in world coordinates: with instances, joints and stretched nodes.

use std::fs;

use serde_json::{Value, json};

use crate::sandbox::{CliSandbox, hills};

/// Returns a hilly square as glTF JSON, for changes of its nodes.
fn sheet(sandbox: &CliSandbox, n: usize) -> Value {
    sandbox.put("sheet.ply", &hills(n));
    sandbox.run("convert sheet.ply sheet.gltf --force").with_status(0);
    serde_json::from_slice(&fs::read(sandbox.path("sheet.gltf")).unwrap()).unwrap()
}

fn put(sandbox: &CliSandbox, name: &str, json: &Value) {
    sandbox.put(name, &json.to_string());
}

/// Adds an accessor of floats in a new buffer.
fn accessor(json: &mut Value, kind: &str, width: usize, numbers: &[f32]) -> usize {
    let push = |json: &mut Value, name: &str, entry: Value| {
        let all = json[name].as_array_mut().unwrap();
        all.push(entry);
        all.len() - 1
    };
    let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    // Percent-encoding needs no additional crate.
    let text: String = bytes.iter().map(|b| format!("%{b:02X}")).collect();
    let uri = format!("data:application/octet-stream,{text}");
    let buffer = push(json, "buffers", json!({"byteLength": bytes.len(), "uri": uri}));
    let view = push(json, "bufferViews", json!({"buffer": buffer, "byteLength": bytes.len()}));
    let count = numbers.len() / width;
    push(json, "accessors", json!({"bufferView": view, "componentType": 5126, "count": count, "type": kind}))
}

fn report(sandbox: &CliSandbox, arguments: &str) -> Value {
    sandbox.run(arguments).with_status(0).objects().remove(0)
}

/// The limit was relative to one mesh at the origin, and only one instance was written to formats without scenes.
#[test]
fn instances_of_an_extension_count_like_nodes() {
    let sandbox = CliSandbox::new();
    let places: Vec<[f32; 3]> = (0..12).map(|k| [3.0 * k as f32, (k % 3) as f32, 0.0]).collect();
    let mut nodes = sheet(&sandbox, 24);
    let node = |at: &[f32; 3]| json!({"mesh": 0, "translation": at});
    nodes["nodes"] = places.iter().map(node).collect();
    nodes["scenes"] = json!([{"nodes": (0..12).collect::<Vec<_>>()}]);
    put(&sandbox, "nodes.gltf", &nodes);
    let mut copies = sheet(&sandbox, 24);
    let moves = accessor(&mut copies, "VEC3", 3, places.as_flattened());
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves}}});
    (copies["nodes"], copies["scenes"]) =
        (json!([{"mesh": 0, "extensions": extension}]), json!([{"nodes": [0]}]));
    copies["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    copies["extensionsUsed"] = copies["extensionsRequired"].clone();
    put(&sandbox, "copies.gltf", &copies);

    let [of_nodes, of_copies] = ["nodes", "copies"].map(|name| {
        let got = report(&sandbox, &format!("simplify {name}.gltf -o {name}.glb --error .1% --json"));
        sandbox.run(&format!("convert {name}.gltf {name}.obj")).with_status(0);
        let info = sandbox.info(&format!("{name}.gltf"));
        assert_eq!(sandbox.faces(&format!("{name}.obj")), 12 * 1152);
        let seen = [&info["meshes"], &info["instances"], &info["faces"], &info["bounds"]["diagonal"]];
        (got["output"]["faces"].clone(), got["error"]["diagonal"].as_f64().unwrap(), seen.map(Value::clone))
    });
    assert_eq!((&of_nodes.0, &of_nodes.2), (&of_copies.0, &of_copies.2));
    assert!((of_nodes.1 - of_copies.1).abs() < 1e-6 * of_nodes.1, "{} and {}", of_nodes.1, of_copies.1);
    let same = report(&sandbox, "compare nodes.gltf copies.gltf --json");
    assert!(same["hausdorff"]["symmetric"].as_f64().unwrap() < 1e-5, "{same}");
}

/// A scale of 0.01 in the inverse bind matrices of a skin made the mesh a hundred times too important.
#[test]
fn a_skinned_mesh_has_the_size_that_its_joints_give_it() {
    let sandbox = CliSandbox::new();
    let mut json = sheet(&sandbox, 24);
    let (position, count) = (json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].clone(), 25 * 25);
    let joints = accessor(&mut json, "VEC4", 4, &vec![0.0; 4 * count]);
    // Joints are bytes; zeros in a buffer of four times the size work too.
    json["accessors"][joints]["componentType"] = 5121.into();
    let weights = accessor(&mut json, "VEC4", 4, &[1.0f32, 0.0, 0.0, 0.0].repeat(count));
    let small = [0.01f32, 0., 0., 0., 0., 0.01, 0., 0., 0., 0., 0.01, 0., 0., 0., 0., 1.];
    let bind = accessor(&mut json, "MAT4", 16, &small);
    let mut skinned = json["meshes"][0].clone();
    skinned["primitives"][0]["attributes"] =
        json!({"POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights});
    json["meshes"].as_array_mut().unwrap().push(skinned);
    json["skins"] = json!([{"joints": [2], "inverseBindMatrices": bind}]);
    // The mesh is a hundred times as large in the file, and its joint scales it back.
    json["nodes"] = json!([{"mesh": 0}, {"mesh": 1, "skin": 0}, {"translation": [5.0, 0.0, 0.0], "scale": [100.0, 100.0, 100.0]}]);
    json["scenes"] = json!([{"nodes": [0, 1, 2]}]);
    put(&sandbox, "both.gltf", &json);
    let got = report(&sandbox, "simplify both.gltf -o both.glb --ratio .2 --json");
    let faces = |k: usize| got["meshes"][k]["output"]["faces"].as_u64().unwrap();
    assert!(faces(0).abs_diff(faces(1)) * 10 <= faces(0), "{} and {}", faces(0), faces(1));
    let diagonal = got["error"]["diagonal"].as_f64().unwrap();
    let info = sandbox.info("both.gltf")["bounds"]["diagonal"].as_f64().unwrap();
    assert!((diagonal - info).abs() < 1e-5 * info && diagonal < 7.0, "{diagonal} and {info}");
}

/// With a node that stretches its mesh, every error was scaled like the longest axis.
#[test]
fn a_stretched_mesh_is_measured_in_world_coordinates() {
    let sandbox = CliSandbox::new();
    let mut json = sheet(&sandbox, 32);
    let node = json["nodes"].as_array().unwrap().iter().position(|n| !n["mesh"].is_null()).unwrap();
    json["nodes"][node]["scale"] = json!([60.0, 1.0, 1.0]);
    put(&sandbox, "node.gltf", &json);
    sandbox.run("convert node.gltf mesh.obj").with_status(0);
    sandbox.run("convert mesh.obj mesh.glb").with_status(0);
    let [of_node, of_mesh] = ["node.gltf", "mesh.glb"].map(|name| {
        let got = report(&sandbox, &format!("simplify {name} -o out_{name} --error .01 --measure --json"));
        let seen = report(&sandbox, &format!("compare {name} out_{name} --json"));
        let (reported, measured) = (&got["error"]["measured"]["rms"]["symmetric"], &seen["rms"]["symmetric"]);
        let (reported, measured) = (reported.as_f64().unwrap(), measured.as_f64().unwrap());
        assert!(
            (reported - measured).abs() <= 0.1 * measured,
            "{name}: reported {reported}, measured {measured}"
        );
        got["output"]["faces"].as_u64().unwrap()
    });
    assert!(of_node.abs_diff(of_mesh) * 10 <= of_mesh, "{of_node} and {of_mesh}");
}

#[test]
fn the_farthest_point_is_in_world_coordinates() {
    let sandbox = CliSandbox::new();
    let mut json = sheet(&sandbox, 24);
    let second = json["meshes"][0].clone();
    json["meshes"].as_array_mut().unwrap().push(second);
    (json["meshes"][0]["name"], json["meshes"][1]["name"]) = ("small".into(), "large".into());
    let node = |mesh: usize, x: f64, scale: f64| json!({"mesh": mesh, "translation": [x, 0.0, 0.0], "scale": [scale, scale, scale]});
    json["nodes"] = json!([node(0, 0.0, 1.0), node(1, 10.0, 2.0), node(1, 20.0, 3.0)]);
    json["scenes"] = json!([{"nodes": [0, 1, 2]}]);
    put(&sandbox, "two.gltf", &json);
    for more in ["", " --per-mesh"] {
        let arguments = format!("simplify two.gltf -o two.glb --ratio .2 --measure --force{more}");
        let got = report(&sandbox, &format!("{arguments} --json"));
        let measured = &got["error"]["measured"];
        let mesh = measured["farthest"]["mesh"].as_u64().expect("a mesh") as usize;
        let name = got["meshes"][mesh]["name"].as_str().expect("a name");
        // With the same share of faces for each, the larger mesh has the larger distance; at its larger instance.
        assert!(more.is_empty() || name == "large");
        let range = if name == "large" { 20.0..23.0 + 1e-5 } else { 0.0..1.0 + 1e-5 };
        let x = measured["farthest"]["point"][0].as_f64().expect("a coordinate");
        assert!(range.contains(&x), "{x} in {name}");
        let seen = report(&sandbox, "compare two.gltf two.glb --json");
        let [reported, seen] = [measured, &seen].map(|c| c["hausdorff"]["symmetric"].as_f64().unwrap());
        assert!((reported - seen).abs() <= 0.05 * seen, "reported {reported}, measured {seen}");
        let text = sandbox.run(&format!("{arguments} -v")).with_status(0);
        assert!(text.text().contains(&format!(", in {name}\n")), "{}", text.text());
    }
}

/// Small meshes beside a large one vanished without a warning.
#[test]
fn meshes_that_lose_their_shape_under_a_common_target_are_reported() {
    let sandbox = CliSandbox::new();
    let mut json = sheet(&sandbox, 24);
    let prop = |k: usize| json!({"mesh": 1, "translation": [k, 2.0, 0.0], "scale": [0.001, 0.001, 0.001]});
    let second = json["meshes"][0].clone();
    json["meshes"].as_array_mut().unwrap().push(second);
    json["nodes"] = json!([{"mesh": 0}, prop(1), prop(2)]);
    json["scenes"] = json!([{"nodes": [0, 1, 2]}]);
    put(&sandbox, "props.gltf", &json);
    let outcome = sandbox.run("simplify props.gltf -o a.glb --ratio .2 --strict").with_status(0);
    let warning = "1 of 2 meshes are small in the scene and lost their shape";
    assert!(outcome.stderr.contains(warning) && outcome.stderr.contains("--per-mesh"), "{}", outcome.stderr);
    let each = sandbox.run("simplify props.gltf -o b.glb --ratio .2 --per-mesh").with_status(0);
    assert!(!each.stderr.contains("small in the scene"), "{}", each.stderr);
    let outcome = sandbox.run("lod props.gltf -o lod.glb --levels .5,.2");
    assert!(outcome.stderr.contains("small in the scene"), "{}", outcome.stderr);
}
