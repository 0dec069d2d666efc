//! References inside extensions after whole commands: they name the right elements, and a lost one is an error with
//! `--strict`.

use std::fs;

use serde_json::{Value, json};

use crate::sandbox::CliSandbox;

/// Returns an avatar: a grid of 128 triangles with a morph target, in the material "skin".
fn avatar() -> Vec<u8> {
    let (mut bin, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    let mut add = |kind: &str, component: u32, width: usize, bytes: Vec<u8>| {
        views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
        let count = bytes.len() / width / 4;
        accessors.push(
            json!({"bufferView": views.len() - 1, "componentType": component, "count": count, "type": kind,
            "min": vec![-1.0; width], "max": vec![100.0; width]}),
        );
        bin.extend(bytes);
        accessors.len() - 1
    };
    let floats = |all: &[f32]| all.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let point = |i: u32| [(i % 9) as f32, (i / 9) as f32, ((i % 9) as f32 * 0.7).sin() * 0.3];
    let grid = add("VEC3", 5126, 3, floats((0..81).map(point).collect::<Vec<_>>().as_flattened()));
    let uvs: Vec<f32> = (0..81).flat_map(|i| [point(i)[0] / 8.0, point(i)[1] / 8.0]).collect();
    let uvs = add("VEC2", 5126, 2, floats(&uvs));
    let morph = add("VEC3", 5126, 3, floats(&[0.5; 243]));
    let corners: Vec<u32> = (0..64)
        .flat_map(|i| {
            let a = i % 8 + 9 * (i / 8);
            [a, a + 1, a + 10, a, a + 10, a + 9]
        })
        .collect();
    let indices = add("SCALAR", 5125, 1, corners.iter().flat_map(|i| i.to_le_bytes()).collect());
    let times = add("SCALAR", 5126, 1, floats(&[0.0, 1.0]));
    let values = add("SCALAR", 5126, 1, floats(&[0.0, 1.0]));
    let pointer = |pointer: &str| {
        json!({"sampler": 0, "target": {"path": "pointer",
            "extensions": {"KHR_animation_pointer": {"pointer": pointer}}}})
    };
    let bind = |index: usize| {
        json!({"materialColorBinds": [{"material": index, "type": "color"}],
        "morphTargetBinds": [{"node": 1, "index": 0, "weight": 1}]})
    };
    let json = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_animation_pointer", "KHR_materials_variants", "VRM", "VRMC_vrm"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "hips", "children": [1]}, {"name": "body", "mesh": 0}],
        "meshes": [{"name": "body", "weights": [0.0], "primitives": [{
            "attributes": {"POSITION": grid, "TEXCOORD_0": uvs}, "targets": [{"POSITION": morph}], "indices": indices,
            "material": 1,
            "extensions": {"KHR_materials_variants": {"mappings": [{"material": 0, "variants": [0]}]}},
        }]}],
        "materials": [{"name": "other"}, {"name": "skin", "alphaCutoff": 0.5}],
        "animations": [{"samplers": [{"input": times, "output": values}], "channels": [
            pointer("/materials/1/alphaCutoff"), pointer("/meshes/0/weights/0"), pointer("/nodes/1/weights"),
        ]}],
        "extensions": {
            "KHR_materials_variants": {"variants": [{"name": "night"}]},
            "VRM": {
                "materialProperties": [
                    {"name": "other", "shader": "VRM/MToon"}, {"name": "skin", "shader": "VRM/MToon"}],
                "humanoid": {"humanBones": [{"bone": "hips", "node": 0}, {"bone": "spine", "node": 1}]},
                "blendShapeMaster": {"blendShapeGroups": [{"name": "A", "binds": [{"mesh": 0, "index": 0}],
                    "materialValues": [{"materialName": "skin", "propertyName": "_Color"}]}]},
            },
            "VRMC_vrm": {"expressions": {"preset": {"aa": bind(1)}}},
        },
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": bin.len()}],
    });
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF".to_vec();
    for number in [2, 28 + text.len() + bin.len(), text.len()] {
        glb.extend((number as u32).to_le_bytes());
    }
    glb.extend(
        [b"JSON".to_vec(), text, (bin.len() as u32).to_le_bytes().to_vec(), b"BIN\0".to_vec(), bin].concat(),
    );
    glb
}

fn json_of(sandbox: &CliSandbox, name: &str) -> Value {
    let bytes = fs::read(sandbox.path(name)).expect("it was written");
    assert!(bytes.starts_with(b"glTF"), "{name} is a GLB");
    let length = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    serde_json::from_slice(&bytes[20..20 + length]).expect("it is JSON")
}

fn sandbox() -> CliSandbox {
    let sandbox = CliSandbox::new();
    fs::write(sandbox.path("avatar.vrm"), avatar()).expect("the file can be written");
    sandbox
}

#[test]
fn a_baked_material_takes_what_named_the_old_one_with_it() {
    let sandbox = sandbox();
    let job = "simplify avatar.vrm --ratio 0.5 --bake color --atlas new --texture-size 64";
    let outcome = sandbox.run(&format!("{job} -o out.vrm")).with_status(0);
    for name in ["KHR_materials_variants", "KHR_animation_pointer", "extension VRM ", "extension VRMC_vrm "] {
        assert!(outcome.stderr.contains(name), "{name}: {}", outcome.stderr);
    }
    sandbox.run(&format!("{job} -o strict.vrm --strict")).with_status(3);
    let json = json_of(&sandbox, "out.vrm");
    let materials: Vec<&Value> = json["materials"].as_array().unwrap().iter().map(|m| &m["name"]).collect();
    assert_eq!(materials, ["baked"]);
    let vrm = &json["extensions"]["VRM"];
    assert_eq!(vrm["materialProperties"].as_array().map(Vec::len), Some(1));
    assert_eq!(vrm["materialProperties"][0]["shader"], "VRM_USE_GLTFSHADER");
    let group = &vrm["blendShapeMaster"]["blendShapeGroups"][0];
    assert_eq!((&group["materialValues"], &group["binds"][0]["mesh"]), (&json!([]), &json!(0)));
    let expression = &json["extensions"]["VRMC_vrm"]["expressions"]["preset"]["aa"];
    assert_eq!(
        (&expression["materialColorBinds"], &expression["morphTargetBinds"][0]["node"]),
        (&json!([]), &json!(1))
    );
    assert!(json["meshes"][0]["primitives"][0]["extensions"].is_null());
    assert_eq!(pointers(&json), ["/meshes/0/weights/0", "/nodes/1/weights"]);
}

fn pointers(json: &Value) -> Vec<String> {
    let channels = json["animations"][0]["channels"].as_array().unwrap().iter();
    let pointer =
        |c: &Value| c["target"]["extensions"]["KHR_animation_pointer"]["pointer"].as_str().map(str::to_owned);
    channels.map(|c| pointer(c).unwrap()).collect()
}

#[test]
fn expressions_follow_a_mesh_into_its_own_node_and_its_levels() {
    let sandbox = sandbox();
    sandbox.run("convert avatar.vrm small.vrm --quantize --compress meshopt --strict").with_status(0);
    let json = json_of(&sandbox, "small.vrm");
    let expression = |json: &Value| json["extensions"]["VRMC_vrm"]["expressions"]["preset"]["aa"].clone();
    let body = expression(&json)["morphTargetBinds"][0]["node"].as_u64().unwrap() as usize;
    assert!(body > 1 && json["nodes"][body]["mesh"] == 0, "{json:#}");
    assert_eq!(json["extensions"]["VRM"]["humanoid"]["humanBones"][1]["node"], 1);
    assert_eq!(pointers(&json)[2], format!("/nodes/{body}/weights"));

    sandbox.run("lod avatar.vrm -o levels.vrm --levels 50%,25% --strict").with_status(0);
    let json = json_of(&sandbox, "levels.vrm");
    let binds = expression(&json)["morphTargetBinds"].as_array().unwrap().clone();
    let mesh_of = |bind: &Value| {
        let node = &json["nodes"][bind["node"].as_u64().unwrap() as usize];
        json["meshes"][node["mesh"].as_u64().unwrap() as usize]["name"].clone()
    };
    let names: Vec<Value> = binds.iter().map(mesh_of).collect();
    assert_eq!(names, ["body", "body_lod1", "body_lod2"]);
    assert_eq!(
        json["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"][0]["binds"]
            .as_array()
            .map(Vec::len),
        Some(3)
    );
    assert_eq!(pointers(&json).len(), 3 + 4);
}
