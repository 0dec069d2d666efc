//! Builder of glTF files: a buffer with views and accessors.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// A placeholder for an image; its content is not examined.
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
    /// Returns the JSON of a file with this buffer and other properties.
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
