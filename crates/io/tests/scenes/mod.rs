//! Small glTF scenes, made by hand.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// Stands for an image; nobody looks inside.
pub(crate) const PNG: &[u8] = b"\x89PNG not really, and of odd length";

/// A buffer with its views and accessors.
#[derive(Default)]
pub(crate) struct Pack {
    pub(crate) bin: Vec<u8>,
    pub(crate) views: Vec<Value>,
    pub(crate) accessors: Vec<Value>,
}

impl Pack {
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend_from_slice(bytes);
        self.views.len() - 1
    }
    pub(crate) fn push(&mut self, kind: &str, component: u32, bytes: &[u8], count: usize) -> usize {
        let view = self.view(bytes);
        self.accessors
            .push(json!({"bufferView": view, "componentType": component, "count": count, "type": kind}));
        self.accessors.len() - 1
    }
    pub(crate) fn floats(&mut self, kind: &str, width: usize, numbers: &[f32]) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.push(kind, 5126, &bytes, numbers.len() / width)
    }
    pub(crate) fn positions(&mut self, points: &[[f32; 3]]) -> usize {
        let index = self.floats("VEC3", 3, points.as_flattened());
        let bound = |pick: fn(f32, f32) -> f32| {
            let all = points.iter().copied().reduce(|a, b| [0, 1, 2].map(|k| pick(a[k], b[k])));
            json!(all.unwrap_or_default())
        };
        self.accessors[index]["min"] = bound(f32::min);
        self.accessors[index]["max"] = bound(f32::max);
        index
    }
    pub(crate) fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.push("SCALAR", 5123, &bytes, indices.len())
    }
    /// The rest of a file about this buffer.
    pub(crate) fn json(&self, rest: Value) -> Value {
        let mut json = json!({"asset": {"version": "2.0"}});
        rest.as_object().unwrap().iter().for_each(|(key, value)| json[key] = value.clone());
        json["accessors"] = self.accessors.clone().into();
        json["bufferViews"] = self.views.clone().into();
        json["buffers"] = json!([{"byteLength": self.bin.len()}]);
        json
    }
}

pub(crate) fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut out = b"glTF".to_vec();
    for number in [2, 12 + 8 + text.len() + 8 + bin.len(), text.len()] {
        out.extend((number as u32).to_le_bytes());
    }
    out.extend(b"JSON");
    out.extend(text);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}

pub(crate) fn data_uri(bin: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", STANDARD.encode(bin))
}

pub(crate) fn gltf(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = json.clone();
    json["buffers"][0]["uri"] = data_uri(bin).into();
    json.to_string().into_bytes()
}

/// The JSON and the bytes of a file with one buffer.
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

/// One triangle.
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
        "extensionsUsed": ["KHR_lights_punctual", "ACME_unknown"],
        "extensions": {
            "KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 3.5}]},
            "ACME_unknown": {"zeta": [1, 2], "alpha": {"bufferView": image}},
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
