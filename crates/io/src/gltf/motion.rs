//! Export of node and camera animations: new nodes above the nodes of a scene, and an animation that moves
//! them.
//!
//! ```text
//! scene ─┬─ "a"            scene ─┬─ "a_moves" ── "a"
//!        └─ "b"                   ├─ "b"
//!                                 └─ "camera_moves" ── "camera"
//! ```

use std::collections::HashMap;

use lodsmith_core::model::{Channel, Interpolation, Track};
use serde_json::{Value, json};

use super::container::{list, number};
use super::lists::append;
use super::placements;
use crate::error::ReadError;

/// Nodes and an animation to add to a scene; see [`Scene::with_motion`](super::Scene::with_motion).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneMotion {
    /// Name of the animation.
    pub name: String,
    /// Nodes to add to the scene.
    pub nodes: Vec<MovingNode>,
    /// Channels of the animation; their nodes are indices into the list above.
    pub channels: Vec<Channel>,
}

/// A node to add to a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingNode {
    /// Its name.
    pub name: String,
    /// Its parent, by index of an earlier node of the list; `None` for a root of the scene.
    pub parent: Option<usize>,
    /// The root of the scene that becomes its child, by index in the list of roots, from 0.
    pub child_root: Option<usize>,
    /// Translation of its origin.
    pub translation: [f64; 3],
    /// Rotation: a quaternion of length one, its real part last.
    pub rotation: [f64; 4],
    /// Uniform scale factor.
    pub scale: f64,
    /// Its camera, which looks along -z.
    pub camera: Option<SceneCamera>,
}

impl Default for MovingNode {
    fn default() -> Self {
        let (translation, rotation) = ([0.0; 3], [0.0, 0.0, 0.0, 1.0]);
        Self {
            name: String::new(),
            parent: None,
            child_root: None,
            translation,
            rotation,
            scale: 1.0,
            camera: None,
        }
    }
}

/// A perspective camera without a far plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneCamera {
    /// Vertical field of view, in radians.
    pub fov_y_rad: f64,
    /// Distance of the near plane.
    pub near: f64,
}

/// Returns the JSON with the nodes, cameras and animation, and the buffer of its numbers; `None` if nothing
/// moves.
pub(super) fn with_motion(
    source: &Value,
    motion: &SceneMotion,
) -> Result<(Value, Option<Vec<u8>>), ReadError> {
    let mut json = source.clone();
    let first = list(&json, "nodes").len();
    let mut roots: Vec<Value> = placements::roots(source)?.into_iter().map(Value::from).collect();
    let before = roots.len();
    for (k, node) in motion.nodes.iter().enumerate() {
        let mut entry = json!({
            "name": node.name,
            "translation": node.translation,
            "rotation": node.rotation,
            "scale": ([node.scale; 3]),
        });
        if let Some(lens) = node.camera {
            let perspective = json!({ "yfov": lens.fov_y_rad, "znear": lens.near });
            let camera = json!({ "type": "perspective", "perspective": perspective });
            entry["camera"] = append(&mut json, "cameras", camera).into();
        }
        let added: Value = append(&mut json, "nodes", entry).into();
        let below = node.child_root.filter(|n| *n < before && roots[*n].is_number());
        if let Some(over) = below {
            json["nodes"][first + k]["children"] = json!([std::mem::take(&mut roots[over])]);
        }
        match node.parent.filter(|p| *p < k) {
            Some(parent) => {
                let parent = &mut json["nodes"][first + parent];
                let mut children = list(parent, "children").to_vec();
                children.push(added);
                parent["children"] = children.into();
            }
            // It replaces its child among the roots.
            None => match below {
                Some(over) => roots[over] = json!([added]),
                None => roots.push(added),
            },
        }
    }
    let roots: Vec<Value> = roots
        .into_iter()
        .filter_map(|root| match root {
            Value::Array(mut one) => one.pop(),
            Value::Null => None,
            number => Some(number),
        })
        .collect();
    if list(&json, "scenes").is_empty() {
        json["scenes"] = json!([{}]);
        json["scene"] = 0.into();
    }
    let shown = number(&json["scene"]).unwrap_or(0);
    json["scenes"][shown]["nodes"] = roots.into();
    let bytes = animate(&mut json, motion, first);
    Ok((json, bytes))
}

/// Adds the animation; returns the bytes of its numbers.
fn animate(json: &mut Value, motion: &SceneMotion, first: usize) -> Option<Vec<u8>> {
    let of_nodes = |c: &&Channel| c.node < motion.nodes.len() && !c.times.is_empty();
    let channels: Vec<&Channel> = motion.channels.iter().filter(of_nodes).collect();
    if channels.is_empty() {
        return None;
    }
    let view = list(json, "bufferViews").len();
    let mut data = AnimationData { bytes: Vec::new(), view, times: HashMap::new() };
    let (mut samplers, mut entries) = (Vec::new(), Vec::new());
    for channel in channels {
        let input = data.times(json, &channel.times);
        let (path, output) = match &channel.track {
            Track::Translation(v) => ("translation", data.put(json, v.as_flattened(), "VEC3", false)),
            Track::Rotation(v) => ("rotation", data.put(json, v.as_flattened(), "VEC4", false)),
            Track::Scale(v) => ("scale", data.put(json, v.as_flattened(), "VEC3", false)),
            Track::MorphWeights(v) => ("weights", data.put(json, v, "SCALAR", false)),
        };
        let interpolation = match channel.interpolation {
            Interpolation::Linear => "LINEAR",
            Interpolation::Step => "STEP",
            Interpolation::Cubic => "CUBICSPLINE",
        };
        entries.push(json!({
            "sampler": samplers.len(),
            "target": { "node": first + channel.node, "path": path },
        }));
        samplers.push(json!({ "input": input, "output": output, "interpolation": interpolation }));
    }
    let animation = json!({ "name": motion.name, "channels": entries, "samplers": samplers });
    append(json, "animations", animation);
    let buffer = append(json, "buffers", json!({ "byteLength": data.bytes.len() }));
    append(json, "bufferViews", json!({ "buffer": buffer, "byteLength": data.bytes.len() }));
    Some(data.bytes)
}

/// Data of an animation: one view that holds all accessors, one after another.
struct AnimationData {
    bytes: Vec<u8>,
    view: usize,
    /// Accessors of keyframe times that exist already.
    times: HashMap<Vec<u32>, usize>,
}

impl AnimationData {
    fn times(&mut self, json: &mut Value, times: &[f32]) -> usize {
        let bits: Vec<u32> = times.iter().map(|t| t.to_bits()).collect();
        if let Some(&known) = self.times.get(&bits) {
            return known;
        }
        let new = self.put(json, times, "SCALAR", true);
        self.times.insert(bits, new);
        new
    }

    fn put(&mut self, json: &mut Value, values: &[f32], kind: &str, has_bounds: bool) -> usize {
        let width = match kind {
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 1,
        };
        let mut accessor = json!({
            "bufferView": self.view,
            "byteOffset": self.bytes.len(),
            "componentType": 5126,
            "count": values.len() / width,
            "type": kind,
        });
        if has_bounds && let (Some(first), Some(last)) = (values.first(), values.last()) {
            (accessor["min"], accessor["max"]) = (json!([first]), json!([last]));
        }
        self.bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        append(json, "accessors", accessor)
    }
}
