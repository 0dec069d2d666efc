//! Playback of animations: clip, time, speed, looping. Has no clock of its own: callers pass the elapsed
//! time.

use lodsmith_core::Model;
use lodsmith_core::model::Pose;
use serde::{Deserialize, Serialize};

/// State of the playback.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Playback {
    /// Index of the clip; `None` shows the rest pose.
    pub clip: Option<usize>,
    /// Time since the start, in seconds.
    pub seconds: f64,
    /// Speed factor; 1 is the original speed.
    pub speed: f64,
    /// True if it loops.
    pub repeats: bool,
}

impl Default for Playback {
    fn default() -> Self {
        Self { clip: Some(0), seconds: 0.0, speed: 1.0, repeats: true }
    }
}

/// Lowest and highest speed.
pub const SPEED_RANGE: [f64; 2] = [0.05, 16.0];

impl Playback {
    /// Returns the start of the first clip, for another file, at the same speed.
    #[must_use]
    pub fn reset(self) -> Self {
        Self { clip: Some(0), seconds: 0.0, ..self }
    }

    /// Returns the length of the clip in seconds; 0 without a clip.
    pub fn length(&self, model: &Model) -> f64 {
        let clip = self.clip.and_then(|c| model.animations.get(c));
        clip.map_or(0.0, |c| c.duration())
    }

    /// Returns the pose of the model; the rest pose if there is no such clip. On a timeline longer than the
    /// clip, the clip loops or holds its last pose.
    pub fn pose(&self, model: &Model) -> Pose {
        let Some(clip) = self.clip.filter(|c| *c < model.animations.len()) else { return Pose::default() };
        let (length, seconds) = (self.length(model), self.moment(f64::MAX));
        let is_round = self.repeats && length > 0.0 && seconds > length;
        model.pose(clip, if is_round { seconds.rem_euclid(length) } else { seconds.min(length) })
    }

    /// Returns the time, clamped to the length; NaN and infinity count as 0.
    pub fn moment(&self, length: f64) -> f64 {
        let seconds = if self.seconds.is_finite() { self.seconds } else { 0.0 };
        seconds.clamp(0.0, length)
    }

    /// Returns the same playback at another time, clamped to the length.
    #[must_use]
    pub fn at(self, length: f64, seconds: f64) -> Self {
        let seconds = Self { seconds, ..self }.moment(length);
        Self { seconds, ..self }
    }

    /// Returns the same playback at another speed, clamped to [`SPEED_RANGE`].
    #[must_use]
    pub fn at_speed(self, speed: f64) -> Self {
        let speed = if speed.is_finite() { speed.clamp(SPEED_RANGE[0], SPEED_RANGE[1]) } else { 1.0 };
        Self { speed, ..self }
    }

    /// Advances by elapsed seconds on a timeline of `length`; returns also whether the end was reached.
    #[must_use]
    pub fn advanced(self, length: f64, elapsed_secs: f64) -> (Self, bool) {
        let further = self.moment(length) + elapsed_secs.max(0.0) * self.at_speed(self.speed).speed;
        match length > 0.0 && self.repeats {
            // The last moment is shown at the very end; only then it starts over.
            true if further > length => (Self { seconds: further.rem_euclid(length), ..self }, false),
            true => (Self { seconds: further, ..self }, false),
            false => (Self { seconds: further.min(length), ..self }, further >= length),
        }
    }

    /// Returns the playback ready to play: at the start, if it is at its end and does not loop.
    #[must_use]
    pub fn rewound_if_over(self, length: f64) -> Self {
        let is_over = !self.repeats && self.moment(length) >= length;
        Self { seconds: if is_over { 0.0 } else { self.moment(length) }, ..self }
    }

    /// Switches to the start of the next clip; after the last comes the first.
    #[must_use]
    pub fn next_clip(self, model: &Model) -> Self {
        let count = model.animations.len().max(1);
        Self { clip: Some(self.clip.map_or(0, |c| (c + 1) % count)), seconds: 0.0, ..self }
    }
}

/// Returns the names of the clips; unnamed ones are numbered.
pub fn clip_names(model: &Model) -> Vec<String> {
    let name = |(i, clip): (usize, &lodsmith_core::model::Animation)| match clip.name.trim() {
        "" => format!("Animation {}", i + 1),
        name => name.to_owned(),
    };
    model.animations.iter().enumerate().map(name).collect()
}

/// Returns the distinct keyframe times of a clip, ascending.
pub fn keyframes(model: &Model, clip: usize) -> Vec<f64> {
    let channels = model.animations.get(clip).map(|a| a.channels.as_slice()).unwrap_or_default();
    let mut all: Vec<f64> = channels.iter().flat_map(|c| c.times.iter().map(|&t| f64::from(t))).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use lodsmith_core::model::{Animation, Channel, Interpolation, Node, Track, Transform};

    use super::*;

    /// A node that moves from 0 to 2 along x in two seconds, and another clip of half a second.
    fn model() -> Model {
        let clip = |name: &str, last: f32| {
            let track = Track::Translation(vec![[0.0; 3], [last, 0.0, 0.0]]);
            let times = vec![0.0, last];
            let channel = Channel { node: 0, track, times, interpolation: Interpolation::Linear };
            Animation { name: name.to_owned(), channels: vec![channel] }
        };
        let animations = vec![clip("Walk", 2.0), clip(" ", 0.5)];
        Model { nodes: vec![Node::default()], roots: vec![0], animations, ..Model::default() }
    }

    fn x(playback: &Playback) -> f64 {
        match playback.pose(&model()).transforms[0] {
            Transform::Parts { translation: DVec3 { x, .. }, .. } => x,
            Transform::Matrix(_) => f64::NAN,
        }
    }

    #[test]
    fn the_pose_follows_the_time() {
        let begin = Playback::default();
        for (elapsed, speed, wanted) in
            [(0.0, 1.0, 0.0), (0.5, 1.0, 0.5), (0.5, 2.0, 1.0), (2.0, 1.0, 2.0), (2.5, 1.0, 0.5)]
        {
            let (then, is_over) = begin.at_speed(speed).advanced(2.0, elapsed);
            assert!((x(&then) - wanted).abs() < 1e-9 && !is_over, "{elapsed} {speed}: {}", x(&then));
        }
        // On a longer timeline the clip loops, or holds its last pose.
        let late = begin.at(10.0, 5.5);
        assert_eq!([x(&late), x(&Playback { repeats: false, ..late })], [1.5, 2.0]);
        assert_eq!(Playback { clip: None, ..begin }.pose(&model()), Pose::default());
        assert_eq!(Playback { clip: Some(7), ..begin }.pose(&model()), Pose::default());
    }

    #[test]
    fn without_looping_playback_ends_and_starts_over_on_request() {
        let once = Playback { repeats: false, ..Playback::default() };
        let (then, is_over) = once.advanced(2.0, 1.9);
        assert!(!is_over);
        let (then, is_over) = then.advanced(2.0, 0.2);
        assert!(is_over && x(&then) == 2.0);
        assert_eq!(then.rewound_if_over(2.0).seconds, 0.0);
        assert_eq!(once.at(2.0, 1.5).rewound_if_over(2.0).seconds, 1.5);
        // Without a clip it is over at once.
        assert!(once.advanced(0.0, 0.1).1);
    }

    #[test]
    fn invalid_numbers_do_no_harm() {
        for seconds in [f64::NAN, f64::INFINITY, -3.0, 1e300] {
            for speed in [f64::NAN, 0.0, -1.0, 1e300] {
                let odd = Playback { seconds, speed, ..Playback::default() };
                assert!((0.0..=2.0).contains(&x(&odd)), "{seconds}");
                let (then, _) = odd.advanced(2.0, 0.1);
                assert!((0.0..=2.0).contains(&then.seconds), "{seconds} {speed}: {then:?}");
            }
        }
        assert_eq!(Playback::default().at(2.0, 9.0).seconds, 2.0);
    }

    #[test]
    fn clips_have_names_and_keyframes() {
        let model = model();
        assert_eq!(clip_names(&model), ["Walk", "Animation 2"]);
        assert_eq!(keyframes(&model, 1), [0.0, 0.5]);
        assert!(keyframes(&model, 2).is_empty());
        let second = Playback { seconds: 1.0, ..Playback::default() }.next_clip(&model);
        assert_eq!((second.clip, second.seconds), (Some(1), 0.0));
        assert_eq!(second.next_clip(&model).clip, Some(0));
    }
}
