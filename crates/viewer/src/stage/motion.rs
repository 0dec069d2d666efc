//! Keyframe animation of the copies and the camera.
//!
//! Positions follow a cubic curve through the keyframes, rotations take the shorter way, and neither sizes
//! nor rotations overshoot the keyframes on both sides. Nothing moves before the first and after the last
//! keyframe.

mod channels;
mod track;
mod value;

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub use channels::ChannelNodes;
pub use track::{Curve, Keyframe, MAX_SECS, Track, rounded_secs};
pub use value::{KeyframeComponents, KeyframeValue};

use super::Placement;
use crate::view::orbit::Orbit;

impl KeyframeValue for Placement {
    fn components(&self) -> KeyframeComponents {
        let place = DVec3::new(self.x, 0.0, self.z);
        KeyframeComponents { place, turns_deg: [self.turn_deg, 0.0], size: self.scale }
    }
    fn from_components(parts: &KeyframeComponents) -> Self {
        let KeyframeComponents { place, turns_deg: [turn_deg, _], size } = *parts;
        Self { x: place.x, z: place.z, turn_deg: turn_deg.rem_euclid(360.0), scale: size }
    }
    fn checked(self) -> Option<Self> {
        Placement::checked(self)
    }
}

/// Position and direction of the stage camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraPlacement {
    /// X coordinate of the eye.
    pub x: f64,
    /// Height of the eye.
    pub y: f64,
    /// Z coordinate of the eye; positive is towards a viewer in front.
    pub z: f64,
    /// Rotation about the vertical axis: 0 looks along -z, larger angles turn left.
    #[serde(default)]
    pub yaw_deg: f64,
    /// Pitch upwards, from -90 to 90 degrees.
    #[serde(default)]
    pub pitch_deg: f64,
    /// Distance to the orbit centre in front of it.
    #[serde(default = "far")]
    pub distance: f64,
}

fn far() -> f64 {
    1.0
}

impl CameraPlacement {
    /// Returns the position and direction of a camera.
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

    /// Applies this position and direction to a camera.
    pub fn apply_to(&self, orbit: &mut Orbit) {
        (orbit.yaw_rad, orbit.pitch_rad) = (self.yaw_deg.to_radians(), -self.pitch_deg.to_radians());
        orbit.distance = self.distance;
        orbit.target = DVec3::ZERO;
        orbit.target = DVec3::new(self.x, self.y, self.z) - orbit.camera().eye;
    }
}

impl KeyframeValue for CameraPlacement {
    fn components(&self) -> KeyframeComponents {
        let place = DVec3::new(self.x, self.y, self.z);
        KeyframeComponents { place, turns_deg: [self.yaw_deg, self.pitch_deg], size: self.distance }
    }
    fn from_components(parts: &KeyframeComponents) -> Self {
        let KeyframeComponents { place: DVec3 { x, y, z }, turns_deg: [yaw_deg, pitch_deg], size: distance } =
            *parts;
        Self { x, y, z, yaw_deg: yaw_deg.rem_euclid(360.0), pitch_deg, distance }
    }
    fn checked(self) -> Option<Self> {
        let KeyframeComponents { place, turns_deg: [yaw, pitch], size } = self.components();
        let is_number = place.is_finite() && yaw.is_finite() && pitch.is_finite() && size.is_finite();
        (is_number && size > 0.0).then(|| Self {
            yaw_deg: yaw.rem_euclid(360.0),
            pitch_deg: pitch.clamp(-90.0, 90.0),
            ..self
        })
    }
}

/// Animated object: the camera, or a copy by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Mover {
    /// The camera of the stage.
    Camera,
    /// A copy.
    Copy(usize),
}

/// Identifies a keyframe by its object and time in seconds.
pub type KeyframeId = (Mover, f64);

/// All animation of a stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tracks {
    /// Requested length in seconds; `None` for the default, see [`Tracks::length`].
    pub length_secs: Option<f64>,
    /// True if the camera moves freely, ignoring its keyframes.
    pub has_free_camera: bool,
    /// Keyframes of the camera.
    pub camera: Track<CameraPlacement>,
    /// Keyframes of copies by their numbers; no track is empty.
    pub copies: BTreeMap<usize, Track<Placement>>,
}

/// [`Tracks`], shared between the undo steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion(Arc<Tracks>);

/// Maximum number of keyframes read from a file; they are read quickly. (Guessed.)
const MAX_KEYFRAMES: usize = 200_000;
/// Default length in seconds of a stage without animation.
const DEFAULT_LENGTH_SECS: f64 = 10.0;

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
    /// Returns a changed copy.
    #[must_use]
    pub fn with(&self, change: impl FnOnce(&mut Tracks)) -> Self {
        let mut tracks = Tracks::clone(&self.0);
        change(&mut tracks);
        tracks.into()
    }

    /// Returns the motion without these copies; later copies are renumbered. Cost: O((n + m) log m) for n
    /// tracks and m copies.
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
            // For a copy that is kept, the error of the search is the number of removed copies before it.
            let left = all.filter_map(|(n, track)| Some((n - gone.binary_search(&n).err()?, track)));
            tracks.copies = left.collect();
        })
    }

    /// Returns the motion without tracks of copies with this number or above.
    #[must_use]
    pub fn limited_to(&self, count: usize) -> Self {
        if self.copies.keys().all(|n| *n < count) {
            return self.clone();
        }
        self.with(|tracks| tracks.copies.retain(|n, _| *n < count))
    }
}

impl Tracks {
    /// Returns true if there are no keyframes.
    pub fn is_empty(&self) -> bool {
        self.camera.is_empty() && self.copies.is_empty()
    }

    /// Returns the time of the last keyframe, 0 without keyframes.
    pub fn last_secs(&self) -> f64 {
        let of_copies = self.copies.values().map(Track::last_secs);
        of_copies.fold(self.camera.last_secs(), f64::max)
    }

    /// Returns the length in seconds, given the length `clip_secs` of the model's animation.
    pub fn length(&self, clip_secs: f64) -> f64 {
        let usual = if clip_secs > 0.0 { clip_secs } else { DEFAULT_LENGTH_SECS };
        let asked = self.length_secs.filter(|s| s.is_finite()).map(|s| s.clamp(0.1, MAX_SECS));
        asked.unwrap_or(usual).max(self.last_secs())
    }

    /// Returns the times of the keyframes of an object, in ascending order.
    pub fn moments(&self, mover: Mover) -> Vec<f64> {
        match mover {
            Mover::Camera => self.camera.moments().collect(),
            Mover::Copy(n) => self.copies.get(&n).map(|t| t.moments().collect()).unwrap_or_default(),
        }
    }

    /// Returns the interpolation of an object's track.
    pub fn curve(&self, mover: Mover) -> Curve {
        match mover {
            Mover::Camera => self.camera.curve,
            Mover::Copy(n) => self.copies.get(&n).map(|t| t.curve).unwrap_or_default(),
        }
    }

    /// Sets the interpolation of an object's track.
    pub fn set_curve(&mut self, mover: Mover, curve: Curve) {
        match mover {
            Mover::Camera => self.camera.curve = curve,
            Mover::Copy(n) => _ = self.copies.get_mut(&n).map(|t| t.curve = curve),
        }
    }

    /// Removes these keyframes.
    pub fn remove(&mut self, names: &[KeyframeId]) {
        for &(mover, secs) in names {
            match mover {
                Mover::Camera => self.camera.remove(secs),
                Mover::Copy(n) => _ = self.copies.get_mut(&n).map(|t| t.remove(secs)),
            }
        }
        self.copies.retain(|_, t| !t.is_empty());
    }

    /// Shifts these keyframes in time and returns their new names. Their distances are kept, and none is
    /// shifted before the start. With `keeps`, the old ones are kept as well. Keyframes at the new times are
    /// replaced.
    pub fn shift(&mut self, names: &[KeyframeId], by_secs: f64, keeps: bool) -> Vec<KeyframeId> {
        let first = names.iter().map(|n| n.1).fold(f64::INFINITY, f64::min);
        let last = names.iter().map(|n| n.1).fold(0.0, f64::max);
        if !first.is_finite() {
            return Vec::new();
        }
        let by = by_secs.clamp(-first, (MAX_SECS - last).max(0.0));
        fn taken<T: KeyframeValue>(track: Option<&Track<T>>, secs: f64) -> Option<T> {
            track.and_then(|t| t.keyframe(secs))
        }
        enum Held {
            Camera(CameraPlacement),
            Placement(usize, Placement),
        }
        let held: Vec<(f64, Held)> = names
            .iter()
            .filter_map(|&(mover, secs)| {
                let held = match mover {
                    Mover::Camera => Held::Camera(taken(Some(&self.camera), secs)?),
                    Mover::Copy(n) => Held::Placement(n, taken(self.copies.get(&n), secs)?),
                };
                Some((rounded_secs(secs + by), held))
            })
            .collect();
        let curves: Vec<(usize, Curve)> = self.copies.iter().map(|(n, t)| (*n, t.curve)).collect();
        if !keeps {
            self.remove(names);
        }
        let mut new = Vec::with_capacity(held.len());
        for (secs, held) in held {
            new.push(match held {
                Held::Camera(placement) => {
                    self.camera.set(secs, placement);
                    (Mover::Camera, secs)
                }
                Held::Placement(n, placement) => {
                    self.copies.entry(n).or_default().set(secs, placement);
                    (Mover::Copy(n), secs)
                }
            });
        }
        // Restore the interpolation of tracks that were temporarily empty and therefore removed.
        for (n, curve) in curves {
            self.copies.entry(n).and_modify(|t| t.curve = curve);
        }
        new
    }

    /// Returns the time of the next or previous keyframe of any object.
    pub fn next_moment(&self, secs: f64, is_forward: bool) -> Option<f64> {
        let secs = rounded_secs(secs);
        let all = self.camera.moments().chain(self.copies.values().flat_map(Track::moments));
        if is_forward {
            all.filter(|m| *m > secs).min_by(f64::total_cmp)
        } else {
            all.filter(|m| *m < secs).max_by(f64::total_cmp)
        }
    }
}

/// Representation of [`Motion`] in files.
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
struct MotionRecord {
    #[serde(skip_serializing_if = "Option::is_none")]
    length_secs: Option<f64>,
    #[serde(skip_serializing_if = "is_off")]
    has_free_camera: bool,
    #[serde(skip_serializing_if = "Track::is_empty")]
    camera: Track<CameraPlacement>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    copies: Vec<CopyTrackRecord>,
}

fn is_off(value: &bool) -> bool {
    !value
}

#[derive(Serialize, Deserialize)]
struct CopyTrackRecord {
    /// Number of the copy, from 0.
    copy: usize,
    #[serde(flatten)]
    track: Track<Placement>,
}

impl Serialize for Motion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let copies =
            self.copies.iter().map(|(n, t)| CopyTrackRecord { copy: *n, track: t.clone() }).collect();
        let Tracks { length_secs, has_free_camera, camera, .. } = &**self;
        MotionRecord {
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
        let file = MotionRecord::deserialize(deserializer)?;
        let mut left = MAX_KEYFRAMES.saturating_sub(file.camera.len());
        let mut copies = BTreeMap::new();
        for CopyTrackRecord { copy, track } in file.copies {
            if let Some(less) = left.checked_sub(track.len()) {
                left = less;
                copies.insert(copy, track);
            }
        }
        let MotionRecord { length_secs, has_free_camera, camera, .. } = file;
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
        tracks.camera.set(
            1.0,
            CameraPlacement { x: 1.0, y: 2.0, z: 3.0, yaw_deg: 10.0, pitch_deg: -5.0, distance: 4.0 },
        );
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
            CameraPlacement::of_orbit(&orbit).apply_to(&mut back);
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
        assert_eq!(read.copies[&0].len(), 2, "before the start is at the start");
    }

    #[test]
    fn tracks_follow_the_numbers_of_their_copies() {
        let left = moving().without_copies(&[0, 1]);
        assert_eq!(left.copies.keys().copied().collect::<Vec<_>>(), [1]);
        assert_eq!(left.copies[&1], moving().copies[&3]);
        assert_eq!(moving().limited_to(2).copies.len(), 1);
        assert_eq!(moving().limited_to(9), moving());
    }

    /// Each track used to be searched among all removed copies: a layout of 15 megabytes took half a minute.
    /// A copy listed twice used to count twice.
    #[test]
    fn very_many_copies_are_removed_at_once_and_each_once() {
        const MANY: usize = 400_000;
        let mut tracks = Tracks::default();
        for n in (0..MANY).step_by(2) {
            tracks.copies.entry(n).or_default().set(0.0, Placement::at(0.0, 0.0));
        }
        // In descending order, each twice.
        let gone: Vec<usize> = (0..MANY).rev().filter(|n| n % 2 == 1).flat_map(|n| [n, n]).collect();
        let left = Motion::from(tracks).without_copies(&gone);
        assert!(left.copies.keys().copied().eq(0..MANY / 2));
    }

    #[test]
    fn keyframes_move_together_and_never_before_the_start() {
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
    fn a_stage_is_as_long_as_its_motion() {
        let empty = Tracks::default();
        assert_eq!((empty.length(0.0), empty.length(2.5)), (DEFAULT_LENGTH_SECS, 2.5));
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
