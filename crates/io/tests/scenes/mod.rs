//! Small glTF scenes, built by hand.

mod pack;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

pub(crate) use pack::{PNG, Pack, data_uri, glb};

pub(crate) fn gltf(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = json.clone();
    json["buffers"][0]["uri"] = data_uri(bin).into();
    json.to_string().into_bytes()
}

/// Returns the JSON and the bytes of a file with one buffer.
pub(crate) fn split(file: &[u8]) -> (Value, Vec<u8>) {
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    let (json, bin): (Value, Vec<u8>) = if file.starts_with(b"glTF") {
        let end = 20 + word(12);
        let json = serde_json::from_slice(&file[20..end]).unwrap();
        (json, file.get(end + 8..).unwrap_or_default().to_vec())
    } else {
        let json: Value = serde_json::from_slice(file).unwrap();
        let uri = json["buffers"][0]["uri"].as_str().unwrap_or(",");
        let bin = STANDARD.decode(uri.split_once(',').unwrap().1).unwrap();
        (json, bin)
    };
    let length = json["buffers"][0]["byteLength"].as_u64().unwrap_or(0) as usize;
    (json, bin[..length].to_vec())
}

/// Returns one triangle.
pub(crate) fn small() -> (Value, Vec<u8>) {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let json = pack.json(json!({"meshes": [{"primitives": [{"attributes": {"POSITION": positions}}]}]}));
    (json, pack.bin)
}

/// ```text
/// 3---2 3---2    two primitives that share an edge, with lines between them; a second mesh that stays;
/// | 0 | | 2 |    a skin, an animation, a sparse morph target, a camera, a light, an image, extras,
/// 0---1 0---1    and an extension that nobody knows
/// ```
pub(crate) fn everything() -> (Value, Vec<u8>) {
    let mut pack = Pack::default();
    let image = pack.view(PNG);
    let quad = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x + 1.0, 1.0, 0.0], [x, 1.0, 0.0]];
    let left = pack.positions(&quad(0.0));
    let right = pack.positions(&quad(1.0));
    pack.accessors[right]["name"] = "corners".into();
    let normals = pack.floats("VEC3", 3, [[0.0, 0.0, 1.0]; 4].as_flattened());
    let uvs = pack.floats("VEC2", 2, &[0.0, 0.0, 0.25, 0.25, 1.0, 1.0, 0.0, 1.0]);
    let joints = pack.push("VEC4", 5121, &[0, 1, 0, 0].repeat(4), 4);
    let weights = pack.push("VEC4", 5121, &[204, 51, 0, 0].repeat(4), 4);
    pack.accessors[weights]["normalized"] = true.into();
    let colors = pack.push("VEC3", 5121, &[255, 0, 51, 0].repeat(4), 4);
    pack.accessors[colors]["normalized"] = true.into();
    let color_view = pack.accessors[colors]["bufferView"].as_u64().unwrap() as usize;
    pack.views[color_view]["byteStride"] = 4.into();
    let heat = pack.floats("SCALAR", 1, &[0.5, 1.0, 1.5, 2.0]);
    let indices = pack.indices(&[0, 1, 2, 0, 2, 3]);
    let lines = pack.indices(&[0, 1, 1, 2]);
    let sparse_at = pack.view(&1u16.to_le_bytes());
    let sparse_values = pack.view(&[0.0f32, 0.0, 2.0].map(f32::to_le_bytes).concat());
    pack.accessors.push(json!({"componentType": 5126, "count": 4, "type": "VEC3",
        "sparse": {"count": 1, "indices": {"bufferView": sparse_at, "componentType": 5123},
            "values": {"bufferView": sparse_values}},
        "min": [0.0, 0.0, 0.0], "max": [0.0, 0.0, 2.0]}));
    let morph = pack.accessors.len() - 1;
    let other = pack.positions(&[[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]]);
    let times = pack.floats("SCALAR", 1, &[0.0, 1.0]);
    pack.accessors[times]["min"] = json!([0.0]);
    pack.accessors[times]["max"] = json!([1.0]);
    let strengths = pack.floats("SCALAR", 1, &[0.0, 1.0]);
    let identity: Vec<f32> = (0..32).map(|i| if i % 16 % 5 == 0 { 1.0 } else { 0.0 }).collect();
    let bind = pack.floats("MAT4", 16, &identity);
    let json = pack.json(json!({
        "scene": 1,
        "extras": {"z": 1, "a": [null, {"k": 0.1}]},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_audio_emitter", "ACME_unknown"],
        "extensions": {
            "KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 3.5}]},
            "KHR_audio_emitter": {"audio": [{"bufferView": image}]},
            "ACME_unknown": {"zeta": [0.5, 1000], "alpha": {"on": true}},
        },
        "scenes": [{"name": "empty"}, {"nodes": [0, 1, 4]}],
        "nodes": [
            {"skin": 0, "name": "a", "mesh": 0, "weights": [0.5]},
            {"scale": [1, 3, 2], "children": [2, 3], "rotation": [0, 0, 0.6, 0.8]},
            {"mesh": 0, "name": "b", "skin": 0, "extras": {"kept": true}},
            {"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"name": "bone", "children": [5]},
            {"name": "bone tip"},
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.01}}],
        "materials": [{"name": "m0"}, {"name": "m1", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": image, "mimeType": "image/png", "name": "odd"}],
        "skins": [{"joints": [4, 5], "inverseBindMatrices": bind}],
        "animations": [{"channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
            "samplers": [{"input": times, "output": strengths}]}],
        "meshes": [
            {"weights": [0.0], "name": "quad", "extras": {"targetNames": ["up"]}, "primitives": [
                {"material": 1, "indices": indices, "extras": {"p": 0},
                    "attributes": {"TEXCOORD_0": uvs, "POSITION": left, "NORMAL": normals, "JOINTS_0": joints,
                        "WEIGHTS_0": weights, "_HEAT": heat},
                    "targets": [{"POSITION": morph}]},
                {"mode": 1, "indices": lines, "attributes": {"POSITION": left}, "targets": [{"POSITION": morph}]},
                {"attributes": {"POSITION": right, "COLOR_0": colors, "JOINTS_0": joints, "WEIGHTS_0": weights},
                    "mode": 4, "indices": indices, "material": 0, "targets": [{"POSITION": morph}]},
            ]},
            {"primitives": [{"attributes": {"POSITION": other}}]},
        ],
    }));
    (json, pack.bin)
}
