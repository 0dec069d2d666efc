//! Keyframe track of one object, and its interpolation.

use glam::DVec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{KeyframeComponents, KeyframeValue};

/// A value at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Keyframe<T> {
    /// Time from the start, in whole milliseconds.
    pub seconds: f64,
    /// The value.
    #[serde(flatten)]
    pub value: T,
}

/// Interpolation between keyframes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Curve {
    /// Smooth cubic curve.
    #[default]
    Smooth,
    /// Constant until the next keyframe.
    Step,
}

/// Keyframes of one object, sorted by time; no two have the same time.
#[derive(Clone, Debug, PartialEq)]
pub struct Track<T> {
    /// Interpolation between the keyframes.
    pub curve: Curve,
    keys: Vec<Keyframe<T>>,
}

impl<T> Default for Track<T> {
    fn default() -> Self {
        Self { curve: Curve::Smooth, keys: Vec::new() }
    }
}

/// Maximum time of a keyframe: one hour.
pub const MAX_SECS: f64 = 3600.0;

/// Returns the time rounded to milliseconds and clamped to the valid range.
pub fn rounded_secs(seconds: f64) -> f64 {
    let seconds = if seconds.is_finite() { seconds } else { 0.0 };
    (1000.0 * seconds.clamp(0.0, MAX_SECS)).round() / 1000.0
}

impl<T> Track<T> {
    /// Returns true if there are no keyframes.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }
    /// Returns the number of keyframes.
    pub fn len(&self) -> usize {
        self.keys.len()
    }
    /// Returns the times of the keyframes, in ascending order.
    pub fn moments(&self) -> impl Iterator<Item = f64> {
        self.keys.iter().map(|k| k.seconds)
    }
    /// Returns the time of the last keyframe, 0 without keyframes.
    pub fn last_secs(&self) -> f64 {
        self.keys.last().map_or(0.0, |k| k.seconds)
    }

    fn index_of(&self, secs: f64) -> Result<usize, usize> {
        self.keys.binary_search_by(|k| k.seconds.total_cmp(&rounded_secs(secs)))
    }

    /// Removes the keyframe at a time, if there is one.
    pub fn remove(&mut self, secs: f64) {
        if let Ok(i) = self.index_of(secs) {
            self.keys.remove(i);
        }
    }
}

impl<T: KeyframeValue> Track<T> {
    /// Sets a keyframe, replacing one at the same time. Invalid values are ignored.
    pub fn set(&mut self, secs: f64, value: T) {
        let Some(value) = value.checked() else { return };
        let key = Keyframe { seconds: rounded_secs(secs), value };
        match self.index_of(secs) {
            Ok(i) => self.keys[i] = key,
            Err(i) => self.keys.insert(i, key),
        }
    }

    /// Returns a track with all values changed by a function.
    #[must_use]
    pub fn changed(&self, of: impl Fn(&T) -> T) -> Self {
        let mut track = Self { curve: self.curve, keys: Vec::new() };
        self.keys.iter().for_each(|k| track.set(k.seconds, of(&k.value)));
        track
    }

    /// Returns the values of all keyframes.
    pub fn values(&self) -> impl Iterator<Item = &T> {
        self.keys.iter().map(|k| &k.value)
    }
    /// Returns the value of the keyframe at a time, if there is one.
    pub fn keyframe(&self, secs: f64) -> Option<T> {
        self.index_of(secs).ok().map(|i| self.keys[i].value)
    }
    /// Returns the interpolated value at a time; `None` without keyframes. Cost: O(log n).
    pub fn at(&self, secs: f64) -> Option<T> {
        let (first, last) = (self.keys.first()?, self.keys.last()?);
        if secs <= first.seconds {
            return Some(first.value);
        }
        if secs >= last.seconds || secs.is_nan() {
            return Some(last.value);
        }
        let i = self.keys.partition_point(|k| k.seconds <= secs) - 1;
        if self.curve == Curve::Step {
            return Some(self.keys[i].value);
        }
        let segment = self.segment(i);
        T::from_components(&segment.at((secs - segment.begin) / segment.length).0).checked()
    }

    /// Returns the curve from keyframe `i` to the next.
    pub(super) fn segment(&self, i: usize) -> Segment {
        let [from, to] = [i, i + 1].map(|i| &self.keys[i]);
        let way = difference(&from.value.components(), &to.value.components());
        Segment {
            begin: from.seconds,
            length: to.seconds - from.seconds,
            from: from.value.components(),
            difference: way,
            slopes: [self.derivative(i), self.derivative(i + 1)],
        }
    }

    /// Returns the derivative per second at a keyframe; zero at the first and the last one.
    fn derivative(&self, i: usize) -> KeyframeComponents {
        if i == 0 || i + 1 >= self.keys.len() {
            return KeyframeComponents::default();
        }
        let [before, here, after] = [i - 1, i, i + 1].map(|i| &self.keys[i]);
        let (h0, h1) = (here.seconds - before.seconds, after.seconds - here.seconds);
        let d0 = difference(&before.value.components(), &here.value.components());
        let d1 = difference(&here.value.components(), &after.value.components());
        // Slope of the parabola through the three keyframes.
        let mean = |d0: f64, d1: f64| (h1 * (d0 / h0) + h0 * (d1 / h1)) / (h0 + h1);
        // Within these bounds the curve does not overshoot its ends [Fritsch-Carlson 1980].
        let bounded = |d0: f64, d1: f64| {
            let most = 3.0 * (d0 / h0).abs().min((d1 / h1).abs());
            if d0 * d1 > 0.0 { mean(d0, d1).clamp(-most, most) } else { 0.0 }
        };
        let place = if d0.place == DVec3::ZERO || d1.place == DVec3::ZERO {
            // No overshoot next to a segment without motion.
            DVec3::ZERO
        } else {
            DVec3::from([0, 1, 2].map(|k| mean(d0.place[k], d1.place[k])))
        };
        KeyframeComponents {
            place,
            turns_deg: [0, 1].map(|k| bounded(d0.turns_deg[k], d1.turns_deg[k])),
            size: bounded(d0.size, d1.size),
        }
    }
}

/// Returns the difference between two values; angles take the shorter way.
fn difference(from: &KeyframeComponents, to: &KeyframeComponents) -> KeyframeComponents {
    let shorter = |k: usize| {
        let turn = (to.turns_deg[k] - from.turns_deg[k]).rem_euclid(360.0);
        if turn > 180.0 { turn - 360.0 } else { turn }
    };
    KeyframeComponents {
        place: to.place - from.place,
        turns_deg: [0, 1].map(shorter),
        size: to.size - from.size,
    }
}

/// Cubic curve between two keyframes.
pub(super) struct Segment {
    /// Start time.
    pub begin: f64,
    /// Duration in seconds.
    pub length: f64,
    from: KeyframeComponents,
    /// Difference from start to end; angles take the shorter way.
    pub difference: KeyframeComponents,
    slopes: [KeyframeComponents; 2],
}

impl Segment {
    /// Returns the value at a parameter from 0 to 1 and the derivative per second. Angles continue from the
    /// start of the segment without wrapping.
    pub(super) fn at(&self, t: f64) -> (KeyframeComponents, KeyframeComponents) {
        let h = self.length;
        let (t2, t3) = (t * t, t * t * t);
        // Hermite basis relative to the start value, hence without the first polynomial.
        let number = |way: f64, s: [f64; 2]| {
            let value = (3.0 * t2 - 2.0 * t3) * way + h * ((t3 - 2.0 * t2 + t) * s[0] + (t3 - t2) * s[1]);
            let speed = (6.0 * t - 6.0 * t2) / h * way
                + (3.0 * t2 - 4.0 * t + 1.0) * s[0]
                + (3.0 * t2 - 2.0 * t) * s[1];
            (value, speed)
        };
        let [a, b] = &self.slopes;
        let place = [0, 1, 2].map(|k| number(self.difference.place[k], [a.place[k], b.place[k]]));
        let turns = [0, 1].map(|k| number(self.difference.turns_deg[k], [a.turns_deg[k], b.turns_deg[k]]));
        let size = number(self.difference.size, [a.size, b.size]);
        let value = KeyframeComponents {
            place: self.from.place + DVec3::from(place.map(|p| p.0)),
            turns_deg: [0, 1].map(|k| self.from.turns_deg[k] + turns[k].0),
            size: self.from.size + size.0,
        };
        (
            value,
            KeyframeComponents {
                place: place.map(|p| p.1).into(),
                turns_deg: turns.map(|t| t.1),
                size: size.1,
            },
        )
    }
}

/// Representation of [`Track`] in files.
#[derive(Serialize, Deserialize)]
struct TrackRecord<T> {
    #[serde(default)]
    curve: Curve,
    #[serde(default = "Vec::new")]
    keys: Vec<Keyframe<T>>,
}

impl<T: Serialize + Clone> Serialize for Track<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        TrackRecord { curve: self.curve, keys: self.keys.clone() }.serialize(serializer)
    }
}

impl<'de, T: KeyframeValue + Deserialize<'de>> Deserialize<'de> for Track<T> {
    /// Sorts keyframes by time and drops invalid ones; of several at the same time the last one is kept.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let TrackRecord { curve, keys } = TrackRecord::<T>::deserialize(deserializer)?;
        let checked =
            |k: Keyframe<T>| Some(Keyframe { seconds: rounded_secs(k.seconds), value: k.value.checked()? });
        let mut keys: Vec<_> = keys.into_iter().filter_map(checked).collect();
        // The stable sort keeps keyframes with equal times in file order.
        keys.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        keys.reverse();
        keys.dedup_by(|a, b| a.seconds == b.seconds);
        keys.reverse();
        Ok(Self { curve, keys })
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::Placement;
    use super::*;

    fn track(keys: &[(f64, Placement)]) -> Track<Placement> {
        let mut track = Track::default();
        keys.iter().for_each(|(secs, value)| track.set(*secs, *value));
        track
    }

    fn turned(turn_deg: f64) -> Placement {
        Placement { turn_deg, ..Placement::at(0.0, 0.0) }
    }

    #[test]
    fn a_track_passes_its_keyframes_and_is_constant_before_and_after() {
        let keys: Vec<_> = [(0.5, 1.0), (1.0, 4.0), (2.5, -3.0), (3.0, 0.0)]
            .map(|(t, x)| (t, Placement { turn_deg: 20.0 * t, scale: 1.0 + t, ..Placement::at(x, 2.0 * x) }))
            .to_vec();
        let track = track(&keys);
        for (secs, value) in &keys {
            let got = track.at(*secs).unwrap();
            assert!((got.x - value.x).abs() < 1e-12 && (got.turn_deg - value.turn_deg).abs() < 1e-9);
        }
        assert_eq!((track.at(-1.0), track.at(9.0)), (Some(keys[0].1), Some(keys[3].1)));
        assert_eq!(Track::<Placement>::default().at(1.0), None);
        // Derivatives agree on both sides of a keyframe, and are zero at the ends.
        for i in 0..2 {
            let (end, begin) = (track.segment(i).at(1.0).1, track.segment(i + 1).at(0.0).1);
            assert!(end.place.distance(begin.place) < 1e-9 && (end.size - begin.size).abs() < 1e-9);
            assert!((end.turns_deg[0] - begin.turns_deg[0]).abs() < 1e-9);
        }
        assert_eq!(track.segment(0).at(0.0).1.place, DVec3::ZERO);
        // They match finite differences of the values.
        let (segment, step) = (track.segment(1), 1e-6);
        let [a, b] = [0.4 - step, 0.4 + step].map(|t| segment.at(t).0.place);
        let slope = (b - a) / (2.0 * step * segment.length);
        assert!(slope.distance(segment.at(0.4).1.place) < 1e-5);
    }

    #[test]
    fn turns_take_the_shorter_way_and_sizes_stay_between_their_keyframes() {
        let round = track(&[(0.0, turned(350.0)), (1.0, turned(20.0))]);
        assert!((round.at(0.5).unwrap().turn_deg - 5.0).abs() < 1e-9);
        let back = track(&[(0.0, turned(20.0)), (1.0, turned(350.0))]);
        assert!((back.at(0.5).unwrap().turn_deg - 5.0).abs() < 1e-9);
        let sized = |scale: f64| Placement { scale, ..Placement::at(0.0, 0.0) };
        let sizes = track(&[(0.0, sized(1.0)), (1.0, sized(0.02)), (1.1, sized(50.0)), (5.0, sized(49.0))]);
        for k in 0..=500 {
            let scale = sizes.at(0.01 * f64::from(k)).unwrap().scale;
            assert!((0.02 - 1e-9..=50.0 + 1e-9).contains(&scale), "{k}: {scale}");
        }
    }

    #[test]
    fn constant_segments_do_not_overshoot_and_steps_hold() {
        let places = [(0.0, 0.0), (1.0, 0.0), (2.0, 8.0), (3.0, 8.0)];
        let mut rests = track(&places.map(|(t, x)| (t, Placement::at(x, 0.0))));
        for k in 0..=300 {
            let x = rests.at(0.01 * f64::from(k)).unwrap().x;
            assert!((-1e-12..=8.0 + 1e-12).contains(&x), "{k}: {x}");
        }
        assert_eq!([rests.at(0.5).unwrap().x, rests.at(1.5).unwrap().x], [0.0, 4.0]);
        rests.curve = Curve::Step;
        assert_eq!([1.999, 2.0, 2.7].map(|t| rests.at(t).unwrap().x), [0.0, 8.0, 8.0]);
    }

    #[test]
    fn a_track_has_one_keyframe_at_a_time() {
        let mut track = track(&[(1.0, Placement::at(1.0, 0.0)), (1.0004, Placement::at(2.0, 0.0))]);
        assert_eq!((track.len(), track.keyframe(1.0)), (1, Some(Placement::at(2.0, 0.0))));
        track.set(f64::NAN, Placement::at(3.0, 0.0));
        track.set(5.0, Placement { scale: -1.0, ..Placement::at(0.0, 0.0) });
        assert_eq!(track.moments().collect::<Vec<_>>(), [0.0, 1.0]);
        track.remove(1.0);
        assert_eq!(track.len(), 1);
        assert_eq!([rounded_secs(-1.0), rounded_secs(1e9), rounded_secs(0.12345)], [0.0, MAX_SECS, 0.123]);
    }
}
