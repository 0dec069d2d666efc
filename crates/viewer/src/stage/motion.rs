//! Keyframes: where copies and the camera are at which moment, and how they get from one to the next.
//!
//! Places follow a cubic curve through the keyframes, turns take the shorter way round, and neither sizes nor turns go beyond
//! what the keyframes on both sides have. Before the first and after the last keyframe nothing moves.

mod channels;
mod track;

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub use channels::Channels;
pub use track::{Curve, Keyframe, MOST_SECS, Track, moment};

use super::Placement;
use crate::orbit::Orbit;

/// Something that keyframes hold.
pub trait Keyed: Copy + PartialEq {
    /// As numbers between which there are others.
    fn parts(&self) -> Parts;
    /// What such numbers stand for.
    fn of(parts: &Parts) -> Self;
    /// With all its numbers where they may be; `None` for one that is nowhere.
    fn checked(self) -> Option<Self>;
}

/// What moves: a place, two turns, and a size that is above zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// On the stage.
    pub place: DVec3,
    /// Round the upright axis, and up.
    pub turns_deg: [f64; 2],
    /// A scale, or a distance.
    pub size: f64,
}

impl Keyed for Placement {
    fn parts(&self) -> Parts {
        let place = DVec3::new(self.x, 0.0, self.z);
        Parts { place, turns_deg: [self.turn_deg, 0.0], size: self.scale }
    }
    fn of(parts: &Parts) -> Self {
        let Parts { place, turns_deg: [turn_deg, _], size } = *parts;
        Self { x: place.x, z: place.z, turn_deg: turn_deg.rem_euclid(360.0), scale: size }
    }
    fn checked(self) -> Option<Self> {
        Placement::checked(self)
    }
}

/// Where the camera of the stage stands, and where it looks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stand {
    /// The eye.
    pub x: f64,
    /// Its height.
    pub y: f64,
    /// Towards who looks from the front.
    pub z: f64,
    /// Round the upright axis; 0 looks along -z, and a growing angle to the left.
    #[serde(default)]
    pub yaw_deg: f64,
    /// Up, at most a right angle.
    #[serde(default)]
    pub pitch_deg: f64,
    /// How far what it is turned about lies before it.
    #[serde(default = "far")]
    pub distance: f64,
}

fn far() -> f64 {
    1.0
}

impl Stand {
    /// Of a camera.
    pub fn of_orbit(orbit: &Orbit) -> Self {
        let eye = orbit.camera().eye;
        Self {
            x: eye.x,
            y: eye.y,
            z: eye.z,
            yaw_deg: orbit.yaw_rad.to_degrees(),
            pitch_deg: -orbit.pitch_rad.to_degrees(),
            distance: orbit.distance,
        }
    }

    /// A camera that stands and looks so.
    pub fn put(&self, orbit: &mut Orbit) {
        (orbit.yaw_rad, orbit.pitch_rad) = (self.yaw_deg.to_radians(), -self.pitch_deg.to_radians());
        orbit.distance = self.distance;
        orbit.target = DVec3::ZERO;
        orbit.target = DVec3::new(self.x, self.y, self.z) - orbit.camera().eye;
    }
}

impl Keyed for Stand {
    fn parts(&self) -> Parts {
        let place = DVec3::new(self.x, self.y, self.z);
        Parts { place, turns_deg: [self.yaw_deg, self.pitch_deg], size: self.distance }
    }
    fn of(parts: &Parts) -> Self {
        let Parts { place: DVec3 { x, y, z }, turns_deg: [yaw_deg, pitch_deg], size: distance } = *parts;
        Self { x, y, z, yaw_deg: yaw_deg.rem_euclid(360.0), pitch_deg, distance }
    }
    fn checked(self) -> Option<Self> {
        let Parts { place, turns_deg: [yaw, pitch], size } = self.parts();
        let is_number = place.is_finite() && yaw.is_finite() && pitch.is_finite() && size.is_finite();
        (is_number && size > 0.0).then(|| Self {
            yaw_deg: yaw.rem_euclid(360.0),
            pitch_deg: pitch.clamp(-90.0, 90.0),
            ..self
        })
    }
}

/// What moves: the camera, or a copy by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Mover {
    /// The camera of the stage.
    Camera,
    /// A copy.
    Copy(usize),
}

/// A keyframe, by what it moves and when.
pub type Name = (Mover, f64);

/// Everything that moves on a stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tracks {
    /// Seconds that were asked for; `None` takes as many as are needed.
    pub length_secs: Option<f64>,
    /// Whether one looks from where one likes, whatever the keyframes of the camera say.
    pub has_free_camera: bool,
    /// Of the camera.
    pub camera: Track<Stand>,
    /// Of copies, by their numbers; none of them is empty.
    pub copies: BTreeMap<usize, Track<Placement>>,
}

/// The same, shared between the settings of many steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion(Arc<Tracks>);

/// Keyframes that a stage holds. Guessed: so many are read in a moment.
const MOST_KEYS: usize = 200_000;
/// Seconds of a stage on which nothing moves yet.
const USUAL_SECS: f64 = 10.0;

impl std::ops::Deref for Motion {
    type Target = Tracks;

    fn deref(&self) -> &Tracks {
        &self.0
    }
}

impl From<Tracks> for Motion {
    fn from(mut tracks: Tracks) -> Self {
        tracks.copies.retain(|_, track| !track.is_empty());
        Self(Arc::new(tracks))
    }
}

impl Motion {
    /// Changed in some way.
    #[must_use]
    pub fn with(&self, change: impl FnOnce(&mut Tracks)) -> Self {
        let mut tracks = Tracks::clone(&self.0);
        change(&mut tracks);
        tracks.into()
    }

    /// Without these copies; those behind them have lower numbers then. Cost: O((n + m) log m) for n tracks and m copies.
    #[must_use]
    pub fn without_copies(&self, gone: &[usize]) -> Self {
        if self.copies.is_empty() {
            return self.clone();
        }
        let mut gone = gone.to_vec();
        gone.sort_unstable();
        gone.dedup();
        self.with(|tracks| {
            let all = std::mem::take(&mut tracks.copies).into_iter();
            // The number of those before it, where it is not one of them.
            let left = all.filter_map(|(n, track)| Some((n - gone.binary_search(&n).err()?, track)));
            tracks.copies = left.collect();
        })
    }

    /// Only those of copies with numbers below this.
    #[must_use]
    pub fn within(&self, count: usize) -> Self {
        if self.copies.keys().all(|n| *n < count) {
            return self.clone();
        }
        self.with(|tracks| tracks.copies.retain(|n, _| *n < count))
    }
}

impl Tracks {
    /// Whether nothing moves.
    pub fn is_empty(&self) -> bool {
        self.camera.is_empty() && self.copies.is_empty()
    }

    /// The moment of the last keyframe; 0 without any.
    pub fn last_secs(&self) -> f64 {
        let of_copies = self.copies.values().map(Track::last_secs);
        of_copies.fold(self.camera.last_secs(), f64::max)
    }

    /// Seconds from begin to end, where an animation of the model takes `clip_secs`.
    pub fn length(&self, clip_secs: f64) -> f64 {
        let usual = if clip_secs > 0.0 { clip_secs } else { USUAL_SECS };
        let asked = self.length_secs.filter(|s| s.is_finite()).map(|s| s.clamp(0.1, MOST_SECS));
        asked.unwrap_or(usual).max(self.last_secs())
    }

    /// Moments of the keyframes of something, rising.
    pub fn moments(&self, mover: Mover) -> Vec<f64> {
        match mover {
            Mover::Camera => self.camera.moments().collect(),
            Mover::Copy(n) => self.copies.get(&n).map(|t| t.moments().collect()).unwrap_or_default(),
        }
    }

    /// How something gets from one keyframe to the next.
    pub fn curve(&self, mover: Mover) -> Curve {
        match mover {
            Mover::Camera => self.camera.curve,
            Mover::Copy(n) => self.copies.get(&n).map(|t| t.curve).unwrap_or_default(),
        }
    }

    /// Gets there otherwise.
    pub fn set_curve(&mut self, mover: Mover, curve: Curve) {
        match mover {
            Mover::Camera => self.camera.curve = curve,
            Mover::Copy(n) => _ = self.copies.get_mut(&n).map(|t| t.curve = curve),
        }
    }

    /// Without these keyframes.
    pub fn remove(&mut self, names: &[Name]) {
        for &(mover, secs) in names {
            match mover {
                Mover::Camera => self.camera.remove(secs),
                Mover::Copy(n) => _ = self.copies.get_mut(&n).map(|t| t.remove(secs)),
            }
        }
        self.copies.retain(|_, t| !t.is_empty());
    }

    /// These keyframes so many seconds later, and what they are called then; all keep their distances, and none goes before
    /// the begin. `keeps` leaves the old ones too. One that stands where one of them comes is replaced.
    pub fn shift(&mut self, names: &[Name], by_secs: f64, keeps: bool) -> Vec<Name> {
        let first = names.iter().map(|n| n.1).fold(f64::INFINITY, f64::min);
        let last = names.iter().map(|n| n.1).fold(0.0, f64::max);
        if !first.is_finite() {
            return Vec::new();
        }
        let by = by_secs.clamp(-first, (MOST_SECS - last).max(0.0));
        fn taken<T: Keyed>(track: Option<&Track<T>>, secs: f64) -> Option<T> {
            track.and_then(|t| t.keyframe(secs))
        }
        enum Held {
            Stand(Stand),
            Placement(usize, Placement),
        }
        let held: Vec<(f64, Held)> = names
            .iter()
            .filter_map(|&(mover, secs)| {
                let held = match mover {
                    Mover::Camera => Held::Stand(taken(Some(&self.camera), secs)?),
                    Mover::Copy(n) => Held::Placement(n, taken(self.copies.get(&n), secs)?),
                };
                Some((moment(secs + by), held))
            })
            .collect();
        let curves: Vec<(usize, Curve)> = self.copies.iter().map(|(n, t)| (*n, t.curve)).collect();
        if !keeps {
            self.remove(names);
        }
        let mut new = Vec::with_capacity(held.len());
        for (secs, held) in held {
            new.push(match held {
                Held::Stand(stand) => {
                    self.camera.set(secs, stand);
                    (Mover::Camera, secs)
                }
                Held::Placement(n, placement) => {
                    self.copies.entry(n).or_default().set(secs, placement);
                    (Mover::Copy(n), secs)
                }
            });
        }
        // A track that lost all its keyframes for a moment goes on as it went.
        for (n, curve) in curves {
            self.copies.entry(n).and_modify(|t| t.curve = curve);
        }
        new
    }

    /// The moment of the keyframe before or after a moment, of all that move.
    pub fn next_moment(&self, secs: f64, is_forward: bool) -> Option<f64> {
        let secs = moment(secs);
        let all = self.camera.moments().chain(self.copies.values().flat_map(Track::moments));
        if is_forward {
            all.filter(|m| *m > secs).min_by(f64::total_cmp)
        } else {
            all.filter(|m| *m < secs).max_by(f64::total_cmp)
        }
    }
}

/// As files have it.
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
struct InFile {
    #[serde(skip_serializing_if = "Option::is_none")]
    length_secs: Option<f64>,
    #[serde(skip_serializing_if = "is_off")]
    has_free_camera: bool,
    #[serde(skip_serializing_if = "Track::is_empty")]
    camera: Track<Stand>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    copies: Vec<OfCopy>,
}

fn is_off(value: &bool) -> bool {
    !value
}

#[derive(Serialize, Deserialize)]
struct OfCopy {
    /// Its number, from 0.
    copy: usize,
    #[serde(flatten)]
    track: Track<Placement>,
}

impl Serialize for Motion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let copies = self.copies.iter().map(|(n, t)| OfCopy { copy: *n, track: t.clone() }).collect();
        let Tracks { length_secs, has_free_camera, camera, .. } = &**self;
        InFile {
            length_secs: *length_secs,
            has_free_camera: *has_free_camera,
            camera: camera.clone(),
            copies,
        }
        .serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Motion {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let file = InFile::deserialize(deserializer)?;
        let mut left = MOST_KEYS.saturating_sub(file.camera.len());
        let mut copies = BTreeMap::new();
        for OfCopy { copy, track } in file.copies {
            if let Some(less) = left.checked_sub(track.len()) {
                left = less;
                copies.insert(copy, track);
            }
        }
        let InFile { length_secs, has_free_camera, camera, .. } = file;
        let length_secs = length_secs.filter(|s| s.is_finite() && *s > 0.0);
        Ok(Tracks { length_secs, has_free_camera, camera, copies }.into())
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::Bounds;
    use lodsmith_render::StandardView;

    use super::*;

    fn moving() -> Motion {
        let mut tracks = Tracks { length_secs: Some(8.0), ..Tracks::default() };
        tracks
            .camera
            .set(1.0, Stand { x: 1.0, y: 2.0, z: 3.0, yaw_deg: 10.0, pitch_deg: -5.0, distance: 4.0 });
        for n in [1, 3] {
            let mut track = Track::default();
            track.curve = Curve::Step;
            track.set(0.5, Placement::at(n as f64, 0.0));
            track.set(2.0, Placement::at(n as f64, 5.0));
            tracks.copies.insert(n, track);
        }
        tracks.into()
    }

    #[test]
    fn a_camera_comes_back_from_its_keyframe() {
        let bounds = Bounds { min: [-1.0, 0.0, -2.0], max: [1.0, 3.0, 2.0] };
        for view in StandardView::ALL {
            let orbit = Orbit::fitting(&bounds, view, 1.5);
            let mut back = Orbit::fitting(&bounds, StandardView::Front, 1.0);
            Stand::of_orbit(&orbit).put(&mut back);
            assert!(back.camera().eye.distance(orbit.camera().eye) < 1e-9, "{view:?}");
            assert!(back.target.distance(orbit.target) < 1e-9, "{view:?}");
        }
    }

    #[test]
    fn keyframes_come_back_from_a_file_and_older_files_have_none() {
        let text = serde_json::to_string(&moving()).unwrap();
        assert_eq!(serde_json::from_str::<Motion>(&text).unwrap(), moving());
        assert_eq!(serde_json::from_str::<Motion>("{}").unwrap(), Motion::default());
        assert_eq!(serde_json::to_string(&Motion::default()).unwrap(), "{}");
        let odd = r#"{"length_secs":-1,"copies":[{"copy":0,"keys":[{"seconds":-1,"x":0,"z":0},
            {"seconds":2,"x":0,"z":0,"scale":-1},{"seconds":1,"x":4,"z":0},{"seconds":1,"x":5,"z":0}]},
            {"copy":1,"keys":[]}]}"#;
        let read = serde_json::from_str::<Motion>(odd).unwrap();
        assert_eq!((read.length_secs, read.copies.len()), (None, 1));
        assert_eq!(read.copies[&0].keyframe(1.0), Some(Placement::at(5.0, 0.0)));
        assert_eq!(read.copies[&0].len(), 2, "before the begin is at the begin");
    }

    #[test]
    fn tracks_follow_the_numbers_of_their_copies() {
        let left = moving().without_copies(&[0, 1]);
        assert_eq!(left.copies.keys().copied().collect::<Vec<_>>(), [1]);
        assert_eq!(left.copies[&1], moving().copies[&3]);
        assert_eq!(moving().within(2).copies.len(), 1);
        assert_eq!(moving().within(9), moving());
    }

    /// Each track was looked for among all copies that go: a layout of 15 megabytes took half a minute. One that was named
    /// twice counted twice.
    #[test]
    fn very_many_copies_go_at_once_and_each_once() {
        const MANY: usize = 400_000;
        let mut tracks = Tracks::default();
        for n in (0..MANY).step_by(2) {
            tracks.copies.entry(n).or_default().set(0.0, Placement::at(0.0, 0.0));
        }
        // From the last on, each twice.
        let gone: Vec<usize> = (0..MANY).rev().filter(|n| n % 2 == 1).flat_map(|n| [n, n]).collect();
        let left = Motion::from(tracks).without_copies(&gone);
        assert!(left.copies.keys().copied().eq(0..MANY / 2));
    }

    #[test]
    fn keyframes_move_together_and_never_before_the_begin() {
        let mut tracks = Tracks::clone(&moving());
        let names =
            [(Mover::Copy(1), 0.5), (Mover::Copy(1), 2.0), (Mover::Camera, 1.0), (Mover::Copy(9), 1.0)];
        let new = tracks.shift(&names, -3.0, false);
        assert_eq!(new, [(Mover::Copy(1), 0.0), (Mover::Copy(1), 1.5), (Mover::Camera, 0.5)]);
        assert_eq!(tracks.moments(Mover::Copy(1)), [0.0, 1.5]);
        assert_eq!(tracks.curve(Mover::Copy(1)), Curve::Step, "a track stays what it is");
        let copied = tracks.shift(&[(Mover::Copy(1), 0.0)], 4.0, true);
        assert_eq!((copied.len(), tracks.moments(Mover::Copy(1))), (1, vec![0.0, 1.5, 4.0]));
        tracks.remove(&[(Mover::Copy(1), 0.0), (Mover::Copy(1), 1.5), (Mover::Copy(1), 4.0)]);
        assert!(!tracks.copies.contains_key(&1));
        assert!(tracks.shift(&[], 1.0, false).is_empty());
    }

    #[test]
    fn a_stage_is_as_long_as_what_moves_on_it() {
        let empty = Tracks::default();
        assert_eq!((empty.length(0.0), empty.length(2.5)), (USUAL_SECS, 2.5));
        let tracks = Tracks { length_secs: Some(1.0), ..Tracks::clone(&moving()) };
        assert_eq!(tracks.length(30.0), 2.0, "the last keyframe is within");
        assert_eq!(moving().length(0.0), 8.0);
        assert_eq!(
            [moving().next_moment(1.0, true), moving().next_moment(1.0, false)],
            [Some(2.0), Some(0.5)]
        );
        assert_eq!(moving().next_moment(2.0, true), None);
    }
}
