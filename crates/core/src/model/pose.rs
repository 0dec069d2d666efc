//! Evaluation of animations: the pose of a model at a moment.

use glam::{DQuat, DVec3};

use super::{Animation, Channel, Interpolation, Model, Pose, Track, Transform};

impl Animation {
    /// Time of the last keyframe in seconds; 0 if nothing moves.
    pub fn duration(&self) -> f64 {
        let last = self.channels.iter().filter_map(|c| c.times.last());
        f64::from(last.fold(0f32, |longest, &t| longest.max(t)))
    }
}

impl Model {
    /// Computes the pose of the model at a moment of an animation.
    ///
    /// Before the first and after the last keyframe of a channel, its first and last values hold: to loop,
    /// take the seconds modulo [`Animation::duration`]. Nodes with a matrix do not move. If several channels
    /// animate the same property, the last one counts. Cost: O(nodes + channels · log moments).
    ///
    /// # Panics
    /// If there is no such animation.
    ///
    /// Source: Khronos, "glTF 2.0 Specification" (2.0.1, 2021), appendix C.
    pub fn pose(&self, animation: usize, seconds: f64) -> Pose {
        let mut pose = Pose {
            transforms: self.nodes.iter().map(|n| n.transform).collect(),
            morph_weights: vec![None; self.nodes.len()],
        };
        for channel in &self.animations[animation].channels {
            let Some(moment) = KeyframePosition::of(channel, seconds) else { continue };
            match (&channel.track, &mut pose.transforms[channel.node]) {
                (Track::Translation(values), Transform::Parts { translation, .. }) => {
                    *translation = moment.vector(values);
                }
                (Track::Scale(values), Transform::Parts { scale, .. }) => *scale = moment.vector(values),
                (Track::Rotation(values), Transform::Parts { rotation, .. }) => {
                    *rotation = moment.rotation(values);
                }
                (Track::MorphWeights(values), _) => {
                    pose.morph_weights[channel.node] = Some(moment.weights(values));
                }
                (_, Transform::Matrix(_)) => {}
            }
        }
        pose
    }
}

/// The two keyframes around a moment, and the position between them.
struct KeyframePosition {
    interpolation: Interpolation,
    /// Number of keyframes.
    count: usize,
    from: usize,
    to: usize,
    /// Position between the two keyframes, from 0 to 1.
    fraction: f64,
    /// Seconds between the two keyframes.
    between: f64,
}

impl KeyframePosition {
    /// Returns `None` for a channel without keyframes.
    fn of(channel: &Channel, seconds: f64) -> Option<Self> {
        let Channel { times, interpolation, .. } = channel;
        let last = times.len().checked_sub(1)?;
        let after = times.partition_point(|&t| f64::from(t) <= seconds);
        let at = |i: usize| f64::from(times[i]);
        let (from, to) = (after.saturating_sub(1), after.min(last));
        let between = at(to) - at(from);
        let part = if between > 0.0 { (seconds - at(from)) / between } else { 0.0 };
        Some(Self { interpolation: *interpolation, count: times.len(), from, to, fraction: part, between })
    }

    /// Interpolates one component. `get` returns it by index; a cubic spline has three entries per keyframe.
    fn number(&self, get: impl Fn(usize) -> f32) -> f64 {
        let get = |place: usize| f64::from(get(place));
        let t = self.fraction;
        match self.interpolation {
            Interpolation::Step => get(self.from),
            Interpolation::Linear => get(self.from) * (1.0 - t) + get(self.to) * t,
            Interpolation::Cubic => {
                let (t2, t3) = (t * t, t * t * t);
                let (out, into) = (get(3 * self.from + 2), get(3 * self.to));
                (2.0 * t3 - 3.0 * t2 + 1.0) * get(3 * self.from + 1)
                    + self.between * (t3 - 2.0 * t2 + t) * out
                    + (3.0 * t2 - 2.0 * t3) * get(3 * self.to + 1)
                    + self.between * (t3 - t2) * into
            }
        }
    }

    fn vector(&self, values: &[[f32; 3]]) -> DVec3 {
        DVec3::from([0, 1, 2].map(|k| self.number(|place| values[place][k])))
    }

    fn rotation(&self, values: &[[f32; 4]]) -> DQuat {
        let unit = |q: [f64; 4]| {
            let q = DQuat::from_array(q);
            let length = q.length();
            if length > 0.0 && length.is_finite() { q / length } else { DQuat::IDENTITY }
        };
        if self.interpolation == Interpolation::Linear {
            let [from, to] = [self.from, self.to].map(|i| unit(values[i].map(f64::from)));
            // `slerp` takes the shorter arc.
            return from.slerp(to, self.fraction);
        }
        unit([0, 1, 2, 3].map(|k| self.number(|place| values[place][k])))
    }

    fn weights(&self, values: &[f32]) -> Vec<f32> {
        let each = values.len() / self.count;
        let targets = if self.interpolation == Interpolation::Cubic { each / 3 } else { each };
        (0..targets).map(|k| self.number(|place| values[place * targets + k]) as f32).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat4;

    use super::*;
    use crate::model::Node;

    fn model(track: Track, times: &[f32], interpolation: Interpolation) -> Model {
        let channel = Channel { node: 0, track, times: times.to_vec(), interpolation };
        let animations = vec![Animation { name: String::new(), channels: vec![channel] }];
        Model { nodes: vec![Node::default()], roots: vec![0], animations, ..Model::default() }
    }

    fn parts(model: &Model, seconds: f64) -> (DVec3, DQuat, DVec3) {
        match model.pose(0, seconds).transforms[0] {
            Transform::Parts { translation, rotation, scale } => (translation, rotation, scale),
            Transform::Matrix(_) => panic!("no matrix"),
        }
    }

    #[test]
    fn values_go_straight_and_hold_outside() {
        let track = Track::Translation(vec![[1.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0; 3]]);
        let linear = model(track.clone(), &[1.0, 2.0, 4.0], Interpolation::Linear);
        assert_eq!(linear.animations[0].duration(), 4.0);
        for (seconds, wanted) in [
            (-1.0, [1.0, 0.0, 0.0]),
            (1.0, [1.0, 0.0, 0.0]),
            (1.5, [2.0, 2.0, 0.0]),
            (2.0, [3.0, 4.0, 0.0]),
            (3.5, [0.75, 1.0, 0.0]),
            (9.0, [0.0; 3]),
        ] {
            assert_eq!(parts(&linear, seconds).0.to_array(), wanted, "{seconds}");
        }
        let steps = model(track, &[1.0, 2.0, 4.0], Interpolation::Step);
        let x = |seconds| parts(&steps, seconds).0.x;
        assert_eq!([x(0.0), x(1.9), x(2.0), x(3.9), x(4.0), x(9.0)], [1.0, 1.0, 3.0, 3.0, 0.0, 0.0]);
    }

    #[test]
    fn a_cubic_is_the_cubic() {
        // x³ from 1 to 3, with slopes 3 x²; y linear; the tangents beyond the ends are not used.
        let at = |x: f32| [[9.0, 9.0, 9.0], [x * x * x, 2.0 * x, 0.0], [9.0, 9.0, 9.0]];
        let mut values = [at(1.0), at(3.0)].concat();
        values[2] = [3.0, 2.0, 0.0];
        values[3] = [27.0, 2.0, 0.0];
        let curve = model(Track::Scale(values), &[1.0, 3.0], Interpolation::Cubic);
        for x in [1.0, 1.25, 2.0, 2.875, 3.0] {
            let got = parts(&curve, x).2;
            assert!((got - DVec3::new(x * x * x, 2.0 * x, 0.0)).length() < 1e-12, "{x}: {got}");
        }
        assert_eq!(parts(&curve, 7.0).2.to_array(), [27.0, 6.0, 0.0]);
    }

    #[test]
    fn rotations_take_the_shorter_arc() {
        let turn = |degrees: f32| {
            let (sin, cos) = (degrees.to_radians() / 2.0).sin_cos();
            [0.0, 0.0, sin, cos]
        };
        // The second quaternion is negated: the same rotation, in the other hemisphere.
        let values = vec![turn(10.0), turn(70.0).map(|x| -x)];
        let turning = model(Track::Rotation(values), &[0.0, 3.0], Interpolation::Linear);
        let x = parts(&turning, 1.0).1 * DVec3::X;
        assert!((x.y.atan2(x.x).to_degrees() - 30.0).abs() < 1e-4, "{x}");
        // A quaternion of another length is normalized, and a zero one is the identity.
        let rough =
            model(Track::Rotation(vec![[0.0, 0.0, 2.0, 0.0], [0.0; 4]]), &[0.0, 1.0], Interpolation::Step);
        assert_eq!(parts(&rough, 0.0).1.to_array(), [0.0, 0.0, 1.0, 0.0]);
        assert_eq!(parts(&rough, 1.0).1, DQuat::IDENTITY);
    }

    #[test]
    fn strengths_of_all_targets_go_together() {
        let values = vec![0.0, 1.0, 1.0, 0.0];
        let morphing = model(Track::MorphWeights(values), &[0.0, 4.0], Interpolation::Linear);
        assert_eq!(morphing.pose(0, 1.0).morph_weights, [Some(vec![0.25, 0.75])]);
        // In-tangents, values, out-tangents; two of each.
        let values = [[0.0, 0.0], [0.0, 2.0], [0.0, 0.0], [0.0, 0.0], [1.0, 2.0], [0.0, 0.0]].concat();
        let curve = model(Track::MorphWeights(values), &[0.0, 4.0], Interpolation::Cubic);
        assert_eq!(curve.pose(0, 2.0).morph_weights, [Some(vec![0.5, 2.0])]);
    }

    #[test]
    fn matrices_and_channels_without_moments_stand_still() {
        let mut still = model(Track::Translation(vec![[1.0; 3]]), &[0.0], Interpolation::Linear);
        still.nodes[0].transform = Transform::Matrix(DMat4::from_scale(DVec3::splat(2.0)));
        assert_eq!(still.pose(0, 1.0).transforms, [still.nodes[0].transform]);
        let empty = model(Track::Translation(Vec::new()), &[], Interpolation::Linear);
        assert_eq!(empty.pose(0, 1.0).transforms, [Transform::default()]);
        assert_eq!(empty.animations[0].duration(), 0.0);
    }
}
