//! Conversion of keyframe tracks to glTF animation channels with the same cubic curves.

use lodsmith_core::model::{self, Channel, Interpolation};

use super::{Curve, KeyframeComponents, KeyframeValue, Track};

/// Nodes that a track animates: one that moves and turns, and optionally a child node that is pitched.
#[derive(Clone, Copy, Debug)]
pub struct ChannelNodes {
    /// Node that is translated and rotated.
    pub node: usize,
    /// Node that is pitched.
    pub tilted: Option<usize>,
    /// True if the size of the values is the scale of the node.
    pub is_scaled: bool,
}

/// Maximum angle between two rotation keyframes: with it the quaternion curve is within 0.001 degrees of the
/// intended rotation. (Measured by the test below.)
const MAX_TURN_DEG: f64 = 10.0;

/// Keyframe times and values of a channel, with tangents for cubic interpolation.
struct ChannelValues<const N: usize> {
    times: Vec<f32>,
    /// In-tangent, value and out-tangent per keyframe; for steps only the value.
    all: Vec<[f32; N]>,
}

impl ChannelNodes {
    /// Returns the channels of a track. Components that are equal in all keyframes have no channel.
    pub fn channels_of<T: KeyframeValue>(&self, track: &Track<T>) -> Vec<Channel> {
        let mut channels = Vec::new();
        let values: Vec<KeyframeComponents> = track.values().map(KeyframeValue::components).collect();
        let Some(first) = values.first() else { return channels };
        let differs = |same: &dyn Fn(&KeyframeComponents) -> bool| !values.iter().all(same);
        let (curve, to_f32) = (track.curve, |v: [f64; 3]| v.map(|x| x as f32));
        if differs(&|p| p.place == first.place) {
            let values =
                sampled(track, |_| 1, |p| to_f32(p.place.to_array()), |_, s| to_f32(s.place.to_array()));
            channels.push(channel(self.node, curve, values, model::Track::Translation));
        }
        if self.is_scaled && differs(&|p| p.size == first.size) {
            let values = sampled(track, |_| 1, |p| to_f32([p.size; 3]), |_, s| to_f32([s.size; 3]));
            channels.push(channel(self.node, curve, values, model::Track::Scale));
        }
        for (k, node) in [(0, Some(self.node)), (1, self.tilted)] {
            let Some(node) = node.filter(|_| differs(&|p| p.turns_deg[k] == first.turns_deg[k])) else {
                continue;
            };
            let parts =
                |way: &KeyframeComponents| (way.turns_deg[k].abs() / MAX_TURN_DEG).ceil().max(1.0) as usize;
            // Rotation about y, or about x, from sine and cosine of half the angle.
            let quaternion = |[sin, cos]: [f64; 2]| {
                let mut q = [0.0, 0.0, 0.0, cos as f32];
                q[1 - k] = sin as f32;
                q
            };
            let half = |p: &KeyframeComponents| 0.5 * p.turns_deg[k].to_radians();
            let value = |p: &KeyframeComponents| quaternion(half(p).sin_cos().into());
            let slope = |p: &KeyframeComponents, s: &KeyframeComponents| {
                let ((sin, cos), speed) = (half(p).sin_cos(), half(s));
                quaternion([speed * cos, -speed * sin])
            };
            channels.push(channel(node, curve, sampled(track, parts, value, slope), model::Track::Rotation));
        }
        channels
    }
}

/// Samples a track at its keyframes and, if a segment is divided into several parts, between them.
fn sampled<T: KeyframeValue, const N: usize>(
    track: &Track<T>,
    parts_of: impl Fn(&KeyframeComponents) -> usize,
    value: impl Fn(&KeyframeComponents) -> [f32; N],
    slope: impl Fn(&KeyframeComponents, &KeyframeComponents) -> [f32; N],
) -> ChannelValues<N> {
    let mut out = ChannelValues { times: Vec::new(), all: Vec::new() };
    if track.curve == Curve::Step || track.len() < 2 {
        out.times = track.moments().map(|t| t as f32).collect();
        out.all = track.values().map(|v| value(&v.components())).collect();
        return out;
    }
    // Angles accumulate over all segments, so that no quaternion flips its sign.
    let mut angles = track.values().next().map_or([0.0; 2], |v| v.components().turns_deg);
    let mut push = |secs: f64, mut at: KeyframeComponents, by: [f64; 2], speed: KeyframeComponents| {
        at.turns_deg = by;
        out.times.push(secs as f32);
        out.all.extend([slope(&at, &speed), value(&at), slope(&at, &speed)]);
    };
    for i in 0..track.len() - 1 {
        let segment = track.segment(i);
        let begin = segment.at(0.0).0.turns_deg;
        let parts = parts_of(&segment.difference);
        let is_last = i + 2 == track.len();
        for part in 0..parts + usize::from(is_last) {
            let t = part as f64 / parts as f64;
            let (at, speed) = segment.at(t);
            let by = [0, 1].map(|k| angles[k] + at.turns_deg[k] - begin[k]);
            push(segment.begin + t * segment.length, at, by, speed);
        }
        angles = [0, 1].map(|k| angles[k] + segment.difference.turns_deg[k]);
    }
    out
}

fn channel<const N: usize>(
    node: usize,
    curve: Curve,
    values: ChannelValues<N>,
    track: impl FnOnce(Vec<[f32; N]>) -> model::Track,
) -> Channel {
    let is_cubic = curve == Curve::Smooth && values.all.len() > values.times.len();
    let interpolation = if is_cubic { Interpolation::Cubic } else { Interpolation::Step };
    Channel { node, track: track(values.all), times: values.times, interpolation }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};
    use lodsmith_core::Model;
    use lodsmith_core::model::{Animation, Node, Transform};

    use super::super::super::Placement;
    use super::super::CameraPlacement;
    use super::*;

    fn played(channels: Vec<Channel>) -> Model {
        let animations = vec![Animation { name: String::new(), channels }];
        Model { nodes: vec![Node::default(); 2], roots: vec![0, 1], animations, ..Model::default() }
    }

    fn parts(model: &Model, node: usize, secs: f64) -> (DVec3, DQuat, DVec3) {
        match model.pose(0, secs).transforms[node] {
            Transform::Parts { translation, rotation, scale } => (translation, rotation, scale),
            Transform::Matrix(_) => (DVec3::NAN, DQuat::IDENTITY, DVec3::NAN),
        }
    }

    #[test]
    fn an_animation_of_gltf_follows_the_same_curve() {
        for curve in [Curve::Smooth, Curve::Step] {
            let mut track = Track::default();
            track.curve = curve;
            for (secs, x, turn_deg, scale) in [
                (0.5, 0.0, 10.0, 1.0),
                (1.0, 3.0, 189.0, 2.0),
                (2.5, 4.0, 120.0, 0.5),
                (4.0, -1.0, 290.0, 0.5),
            ] {
                track.set(secs, Placement { x, z: 2.0 * x, turn_deg, scale });
            }
            let model = played(ChannelNodes { node: 1, tilted: None, is_scaled: true }.channels_of(&track));
            for k in 0..=220 {
                // Not exactly at the keyframes, where rounding would decide on which side of a step a time
                // falls.
                let secs = 0.02 * f64::from(k) + 0.003;
                let (translation, rotation, scale) = parts(&model, 1, secs);
                let p = track.at(secs).unwrap();
                assert!(translation.distance(DVec3::new(p.x, 0.0, p.z)) < 1e-5, "{secs}");
                assert!((scale.x - p.scale).abs() < 1e-5);
                let turn = DQuat::from_rotation_y(p.turn_deg.to_radians());
                let off = rotation.angle_between(turn).to_degrees();
                assert!(off < 1e-3, "{curve:?} {secs}: {off}");
            }
        }
    }

    #[test]
    fn a_camera_is_turned_by_one_node_and_tilted_by_another() {
        let mut track = Track::default();
        let stand = |yaw_deg: f64, pitch_deg: f64| CameraPlacement {
            x: 1.0,
            y: yaw_deg,
            z: 0.0,
            yaw_deg,
            pitch_deg,
            distance: 2.0,
        };
        track.set(0.0, stand(350.0, -80.0));
        track.set(2.0, stand(60.0, 40.0));
        let channels = ChannelNodes { node: 0, tilted: Some(1), is_scaled: false }.channels_of(&track);
        assert_eq!(channels.len(), 3);
        let model = played(channels);
        for k in 0..=40 {
            let secs = 0.05 * f64::from(k);
            let p = track.at(secs).unwrap();
            let [yaw, pitch] = [p.yaw_deg, p.pitch_deg].map(f64::to_radians);
            assert!(parts(&model, 0, secs).1.angle_between(DQuat::from_rotation_y(yaw)).to_degrees() < 1e-3);
            assert!(
                parts(&model, 1, secs).1.angle_between(DQuat::from_rotation_x(pitch)).to_degrees() < 1e-3
            );
        }
    }

    #[test]
    fn constant_components_have_no_channel() {
        let mut track = Track::default();
        let of = ChannelNodes { node: 0, tilted: None, is_scaled: true };
        assert!(of.channels_of(&track).is_empty());
        track.set(1.0, Placement::at(1.0, 0.0));
        assert!(of.channels_of(&track).is_empty());
        track.set(2.0, Placement::at(2.0, 0.0));
        assert_eq!(of.channels_of(&track).len(), 1);
    }
}
