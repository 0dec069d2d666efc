//! Animations: curves of all kinds, baked to keyframes that are interpolated linearly.

use std::collections::HashMap;

use serde_json::{Value, json};
use ufbx::{AllocatorOpts, AnimStack, BakeOpts, BakedAnim, BakedVec3, Mesh, Scene};

use crate::error::Warning;
use crate::gltf::SceneBuilder;
use crate::limits::Limits;

/// Adds the animations of a file: one for each stack.
pub(super) fn add(fbx: &Scene, node_of: &HashMap<u32, usize>, limits: Limits, scene: &mut SceneBuilder) {
    for stack in &fbx.anim_stacks {
        let limit = || AllocatorOpts {
            memory_limit: usize::try_from(limits.memory / 4).unwrap_or(usize::MAX),
            ..AllocatorOpts::default()
        };
        let options = BakeOpts {
            temp_allocator: limit(),
            result_allocator: limit(),
            trim_start_time: true,
            key_reduction_enabled: true,
            ..BakeOpts::default()
        };
        let name = crate::excerpt::excerpt(&stack.element.name);
        match ufbx::bake_anim(fbx, &stack.anim, options) {
            Ok(baked) => add_stack(fbx, stack, &baked, node_of, scene),
            Err(e) => {
                let text = format!("the animation `{name}` cannot be read ({}): dropped", &*e.description);
                scene.warn(Warning::lost_of_scene(text));
            }
        }
    }
}

fn add_stack(
    fbx: &Scene,
    stack: &AnimStack,
    baked: &BakedAnim,
    node_of: &HashMap<u32, usize>,
    scene: &mut SceneBuilder,
) {
    let mut animation = Animation::default();
    for node in &baked.nodes {
        let (Some(&index), Some(rest)) = (node_of.get(&node.typed_id), fbx.nodes.get(node.typed_id as usize))
        else {
            continue;
        };
        let rest = &rest.local_transform;
        let vector = |v: &ufbx::Vec3| [v.x as f32, v.y as f32, v.z as f32];
        for (path, keys, rest, is_constant) in [
            ("translation", &node.translation_keys, &rest.translation, node.constant_translation),
            ("scale", &node.scale_keys, &rest.scale, node.constant_scale),
        ] {
            if is_constant && keys.first().is_none_or(|k| vector(&k.value) == vector(rest)) {
                continue;
            }
            let keys: Vec<(f64, [f32; 3])> = keys.iter().map(|k| (k.time, vector(&k.value))).collect();
            animation.channel(index, path, &keys, scene);
        }
        let quaternion = |q: &ufbx::Quat| unit_quaternion([q.x, q.y, q.z, q.w]).map(|x| x as f32);
        let keys = &node.rotation_keys;
        if !(node.constant_rotation
            && keys.first().is_none_or(|k| quaternion(&k.value) == quaternion(&rest.rotation)))
        {
            let keys: Vec<(f64, [f32; 4])> = keys.iter().map(|k| (k.time, quaternion(&k.value))).collect();
            animation.channel(index, "rotation", &keys, scene);
        }
    }
    for node in &fbx.nodes {
        if let (Some(mesh), Some(&index)) = (node.mesh.as_ref(), node_of.get(&node.element.typed_id)) {
            animation.weights(index, mesh, baked, scene);
        }
    }
    if animation.channels.is_empty() {
        return;
    }
    let mut entry = json!({ "channels": animation.channels, "samplers": animation.samplers });
    if !stack.element.name.is_empty() {
        entry["name"] = (*stack.element.name).into();
    }
    scene.add("animations", entry);
}

#[derive(Default)]
struct Animation {
    channels: Vec<Value>,
    samplers: Vec<Value>,
    /// Accessors of times that exist already.
    times: HashMap<Vec<u32>, usize>,
}

impl Animation {
    fn channel<const N: usize>(
        &mut self,
        node: usize,
        path: &str,
        keys: &[(f64, [f32; N])],
        scene: &mut SceneBuilder,
    ) {
        // Keys whose times are equal as floats are steps: the last one counts.
        let mut kept: Vec<(f32, [f32; N])> = Vec::with_capacity(keys.len());
        for &(time, value) in keys {
            let time = (time as f32).max(0.0);
            match kept.last_mut() {
                Some(last) if last.0 >= time => last.1 = value,
                _ => kept.push((time, value)),
            }
        }
        let times: Vec<f32> = kept.iter().map(|(t, _)| *t).collect();
        let values: Vec<f32> = kept.iter().flat_map(|(_, v)| *v).collect();
        let kind = if N == 3 { "VEC3" } else { "VEC4" };
        self.add(node, path, &times, (&values, kind, N), scene);
    }

    /// Adds the weights of the morph targets of a node, if any of them is animated.
    fn weights(&mut self, node: usize, mesh: &Mesh, baked: &BakedAnim, scene: &mut SceneBuilder) {
        let channels: Vec<_> = mesh.blend_deformers.iter().flat_map(|b| b.channels.iter()).collect();
        let keys_of = |id: u32| -> Option<&[BakedVec3]> {
            let element = baked.elements.iter().find(|e| e.element_id == id)?;
            Some(&element.props.iter().find(|p| &*p.name == "DeformPercent")?.keys)
        };
        let tracks: Vec<Option<&[BakedVec3]>> =
            channels.iter().map(|c| keys_of(c.element.element_id)).collect();
        let mut times: Vec<f32> =
            tracks.iter().flatten().flat_map(|keys| keys.iter().map(|k| (k.time as f32).max(0.0))).collect();
        times.sort_by(f32::total_cmp);
        times.dedup();
        if times.is_empty() {
            return;
        }
        // Guessed: a hundred targets at a thousand keys are a megabyte; no file needs a thousand times that.
        if times.len().saturating_mul(tracks.len()) > 1 << 28 {
            scene.warn(Warning::lost_of_scene("an animation of morph targets is too large: dropped"));
            return;
        }
        let mut values = Vec::with_capacity(times.len() * tracks.len());
        for &time in &times {
            for (track, channel) in tracks.iter().zip(&channels) {
                let percent = track.and_then(|keys| value_at(keys, f64::from(time)));
                values.push(percent.map_or(channel.weight, |p| p / 100.0) as f32);
            }
        }
        self.add(node, "weights", &times, (&values, "SCALAR", 1), scene);
    }

    fn add(
        &mut self,
        node: usize,
        path: &str,
        times: &[f32],
        (values, kind, width): (&[f32], &str, usize),
        scene: &mut SceneBuilder,
    ) {
        if times.is_empty() || !times.iter().chain(values).all(|x| x.is_finite()) {
            return;
        }
        let bits: Vec<u32> = times.iter().map(|t| t.to_bits()).collect();
        let input = *self.times.entry(bits).or_insert_with(|| scene.numbers(times, "SCALAR", 1, true));
        let output = scene.numbers(values, kind, width, false);
        self.channels
            .push(json!({ "sampler": self.samplers.len(), "target": { "node": node, "path": path } }));
        self.samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
    }
}

/// Returns the value of a track at a time, interpolated linearly.
fn value_at(keys: &[BakedVec3], time: f64) -> Option<f64> {
    let next = keys.partition_point(|k| k.time < time);
    let (before, after) = (next.checked_sub(1).and_then(|i| keys.get(i)), keys.get(next));
    match (before, after) {
        (Some(a), Some(b)) => {
            let t = (time - a.time) / (b.time - a.time);
            Some(a.value.x + (b.value.x - a.value.x) * t)
        }
        (Some(key), None) | (None, Some(key)) => Some(key.value.x),
        (None, None) => None,
    }
}

/// Returns a quaternion of length one; the identity if its length is zero.
pub(super) fn unit_quaternion(q: [f64; 4]) -> [f64; 4] {
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() { q.map(|x| x / length) } else { [0.0, 0.0, 0.0, 1.0] }
}
