//! The Stage: copies of the model on a ground plane, to see which level of detail is used where.
//!
//! The ground is the plane y = 0. The centre of a copy's base is on it, at the copy's position; lengths are
//! in units of the model. All of this is plain data that commands change; only [`picture`] shows it in a
//! window.

#[cfg(feature = "window")]
pub mod export;
pub mod file;
#[cfg(feature = "window")]
pub mod ground;
pub mod levels;
pub mod motion;
#[cfg(feature = "window")]
pub mod picture;
mod placement;
pub mod scatter;
#[cfg(feature = "window")]
pub mod status;
pub mod walk;

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use lodsmith_core::Bounds;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::view::orbit::{turn_matrix, turned_bounds};
use motion::{Motion, Track};
use scatter::Scatter;

pub use placement::{MAX_COPIES, Placement, SCALE_RANGE};

/// List of copies, shared between the undo steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Copies(Arc<Vec<Placement>>);

impl std::ops::Deref for Copies {
    type Target = [Placement];

    fn deref(&self) -> &[Placement] {
        &self.0
    }
}

impl From<Vec<Placement>> for Copies {
    /// Keeps the valid copies, at most [`MAX_COPIES`].
    fn from(all: Vec<Placement>) -> Self {
        Self(Arc::new(all.into_iter().filter_map(Placement::checked).take(MAX_COPIES).collect()))
    }
}

impl Serialize for Copies {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.as_slice().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Copies {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Vec::deserialize(deserializer).map(Self::from)
    }
}

/// State of the stage that commands change.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Stage {
    /// True if the stage is shown instead of the two viewports.
    pub is_on: bool,
    /// The copies, in the order they were added.
    pub copies: Copies,
    /// Settings for scattering copies.
    pub scatter: Scatter,
    /// Display settings.
    pub view: StageDisplay,
    /// Keyframe animation.
    pub motion: Motion,
}

impl Stage {
    /// Returns all copies as placed at a time. Cost: O(copies) if some are animated.
    pub fn copies_at(&self, secs: f64) -> Copies {
        if self.motion.copies.is_empty() {
            return self.copies.clone();
        }
        let mut copies = self.copies.to_vec();
        for (n, track) in &self.motion.copies {
            if let (Some(copy), Some(now)) = (copies.get_mut(*n), track.at(secs)) {
                *copy = now;
            }
        }
        Copies(Arc::new(copies))
    }

    /// Returns the placements of all copies and of all their keyframes.
    pub fn all_placements(&self) -> impl Iterator<Item = &Placement> {
        self.copies.iter().chain(self.motion.copies.values().flat_map(Track::values))
    }
}

/// Display settings of the stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StageDisplay {
    /// Maximum number of pixels that the error of a level may cover.
    pub pixels: f64,
    /// Maximum number of triangles in a frame.
    pub budget: u64,
    /// True if copies are coloured by level.
    pub has_level_colors: bool,
    /// Eye height while walking, as a multiple of the model's height.
    pub eye_height: f64,
    /// Walking speed, in model diagonals per second.
    pub speed: f64,
}

impl Default for StageDisplay {
    fn default() -> Self {
        Self { pixels: 0.5, budget: 2_000_000, has_level_colors: false, eye_height: 0.6, speed: 1.0 }
    }
}

/// A change of the stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum StageChange {
    /// Shows or hides the stage.
    Show(bool),
    /// Adds copies.
    Add(Vec<Placement>),
    /// Scatters copies, replacing the existing ones or between them.
    Scatter(Scatter),
    /// Duplicates copies by their numbers, with their keyframes.
    Duplicate {
        /// Numbers of the copies.
        numbers: Vec<usize>,
        /// Offset to the right for a copy of scale 1.
        aside: f64,
    },
    /// Moves copies by their numbers; copies with keyframes get a keyframe at this time.
    Move {
        /// Numbers of the copies, and their new placements.
        copies: Vec<(usize, Placement)>,
        /// Time of the keyframes in seconds.
        secs: f64,
    },
    /// Deletes the copies with these numbers.
    Delete(Vec<usize>),
    /// Replaces all copies and their motion.
    Replace(Copies, Motion),
    /// Replaces all keyframes.
    Motion(Motion),
    /// Replaces the display settings.
    View(StageDisplay),
}

impl StageChange {
    /// Returns the name for the menu.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Show(_) => "stage",
            Self::Add(_) => "add copies",
            Self::Scatter(_) => "scatter",
            Self::Duplicate { .. } => "duplicate copies",
            Self::Move { .. } => "move copies",
            Self::Delete(_) => "delete copies",
            Self::Replace(..) => "layout",
            Self::Motion(_) => "keyframes",
            Self::View(_) => "stage settings",
        }
    }

    /// Applies the change to a stage.
    pub fn apply(&self, stage: &mut Stage) {
        match self {
            Self::Show(is_on) => stage.is_on = *is_on,
            Self::Add(new) => {
                stage.copies = stage.copies.iter().chain(new).copied().collect::<Vec<_>>().into();
            }
            Self::Scatter(scatter) => {
                stage.scatter = *scatter;
                let kept = if scatter.keeps { stage.copies.len() } else { 0 };
                stage.copies = scatter.placements(&stage.copies).into();
                stage.motion = stage.motion.limited_to(kept);
            }
            Self::Duplicate { numbers, aside } => stage.duplicate(numbers, *aside),
            Self::Move { copies, secs } => stage.move_copies(copies, *secs),
            Self::Delete(gone) => {
                let mut is_kept = vec![true; stage.copies.len()];
                for &number in gone.iter().filter(|n| **n < stage.copies.len()) {
                    is_kept[number] = false;
                }
                let kept: Vec<_> = stage.copies.iter().zip(is_kept).filter(|x| x.1).map(|x| *x.0).collect();
                stage.copies = kept.into();
                stage.motion = stage.motion.without_copies(gone);
            }
            Self::Replace(copies, motion) => {
                stage.copies = copies.clone();
                stage.motion = motion.limited_to(copies.len());
            }
            Self::Motion(motion) => stage.set_motion(motion.limited_to(stage.copies.len())),
            Self::View(view) => stage.view = *view,
        }
    }
}

impl Stage {
    fn duplicate(&mut self, numbers: &[usize], aside: f64) {
        let beside = |c: &Placement| Placement { x: c.x + aside * c.scale, ..*c };
        let mut copies = self.copies.to_vec();
        let mut tracks = Vec::new();
        for n in numbers.iter().filter(|n| **n < self.copies.len()) {
            if let Some(track) = self.motion.copies.get(n) {
                tracks.push((copies.len(), track.changed(beside)));
            }
            copies.push(beside(&self.copies[*n]));
        }
        self.copies = copies.into();
        if !tracks.is_empty() {
            self.motion = self.motion.with(|m| m.copies.extend(tracks)).limited_to(self.copies.len());
        }
    }

    fn move_copies(&mut self, moved: &[(usize, Placement)], secs: f64) {
        let mut copies = self.copies.to_vec();
        let mut keyed = Vec::new();
        for (number, placement) in moved {
            let Some(placement) = placement.checked() else { continue };
            if self.motion.copies.contains_key(number) {
                keyed.push((*number, placement));
            } else if let Some(copy) = copies.get_mut(*number) {
                *copy = placement;
            }
        }
        self.copies = copies.into();
        if !keyed.is_empty() {
            self.motion = self.motion.with(|m| {
                keyed.into_iter().for_each(|(n, p)| m.copies.entry(n).or_default().set(secs, p));
            });
        }
    }

    /// Replaces the keyframes. A copy that loses all its keyframes is placed at the first of them.
    fn set_motion(&mut self, motion: Motion) {
        let stays = |(n, track): (&usize, &Track<Placement>)| {
            let is_still = !motion.copies.contains_key(n);
            track.values().next().filter(|_| is_still).map(|p| (*n, *p))
        };
        let stay: Vec<_> = self.motion.copies.iter().filter_map(stays).collect();
        self.motion = motion;
        self.move_copies(&stay, 0.0);
    }
}

/// Placement of the model on the ground, common to all copies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelBase {
    /// Transform from the model to a copy of scale 1 at the centre of the stage, including `turn`.
    pub stage_from_model: DMat4,
    /// Rotation of the model.
    pub turn: DQuat,
    /// Width, height and depth of its bounding box after the rotation.
    pub size: DVec3,
}

impl ModelBase {
    /// Creates the base of a model with this bounding box, rotated about its centre.
    pub fn new(bounds: &Bounds, turn: DQuat) -> Self {
        let box_ = turned_bounds(bounds, turn);
        let [min, max] = [box_.min, box_.max].map(DVec3::from);
        let middle = 0.5 * min + 0.5 * max;
        let foot = DVec3::new(middle.x, min.y, middle.z);
        let stage_from_model = DMat4::from_translation(-foot) * turn_matrix(bounds, turn);
        Self { stage_from_model, turn, size: max - min }
    }

    /// Returns the radius of a circle on the ground that contains the model in any rotation about the
    /// vertical axis.
    pub fn footprint(&self) -> f64 {
        let radius = 0.5 * self.size.x.hypot(self.size.z);
        // Minimum radius for thin, upright models.
        radius.max(0.05 * self.size.y).max(f64::MIN_POSITIVE)
    }

    /// Returns the reference length of the stage: the diagonal of the model.
    pub fn length(&self) -> f64 {
        let length = self.size.length();
        if length > 0.0 && length.is_finite() { length } else { 1.0 }
    }

    /// Returns centre and radius of the bounding sphere of a copy.
    pub fn bounding_sphere(&self, copy: &Placement) -> (DVec3, f64) {
        (DVec3::new(copy.x, 0.5 * self.size.y * copy.scale, copy.z), 0.5 * self.length() * copy.scale)
    }

    /// Returns the transform from a copy's local coordinates, with the origin at the centre of its base, to
    /// the stage.
    pub fn stage_from_copy(copy: &Placement) -> DMat4 {
        let turn = DQuat::from_rotation_y(copy.turn_deg.to_radians());
        DMat4::from_scale_rotation_translation(
            DVec3::splat(copy.scale),
            turn,
            DVec3::new(copy.x, 0.0, copy.z),
        )
    }

    /// Returns the transform from the model to a copy on the stage.
    pub fn stage_from(&self, copy: &Placement) -> DMat4 {
        Self::stage_from_copy(copy) * self.stage_from_model
    }

    /// Returns a bounding box of the whole stage: at least four model diagonals wide and growing by factors
    /// of two, so that ground and lights do not change with every copy.
    pub fn bounds<'a>(&self, copies: impl IntoIterator<Item = &'a Placement>) -> Bounds {
        let mut reach = 0f64;
        let mut height = self.size.y;
        for copy in copies {
            let (centre, radius) = self.bounding_sphere(copy);
            reach = reach.max(centre.x.abs().max(centre.z.abs()) + radius);
            height = height.max(self.size.y * copy.scale);
        }
        let mut half = 2.0 * self.length();
        while half < reach && half.is_finite() {
            half *= 2.0;
        }
        Bounds { min: [-half, 0.0, -half], max: [half, height, half] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage_of(changes: &[StageChange]) -> Stage {
        let mut stage = Stage::default();
        changes.iter().for_each(|c| c.apply(&mut stage));
        stage
    }

    #[test]
    fn copies_are_added_moved_and_deleted() {
        let moved = Placement { turn_deg: -90.0, scale: 2.0, ..Placement::at(5.0, 6.0) };
        let stage = stage_of(&[
            StageChange::Add(vec![Placement::at(0.0, 0.0), Placement::at(1.0, 0.0)]),
            StageChange::Add(vec![Placement::at(2.0, 0.0)]),
            StageChange::Move { copies: vec![(1, moved), (99, moved)], secs: 0.0 },
            StageChange::Delete(vec![0, 77]),
        ]);
        assert_eq!(stage.copies.len(), 2);
        assert_eq!(stage.copies[0], Placement { turn_deg: 270.0, ..moved });
        assert_eq!(stage.copies[1], Placement::at(2.0, 0.0));
    }

    /// Each copy used to be searched among all deleted ones, which is quadratic.
    #[test]
    fn very_many_copies_are_deleted_at_once() {
        let count = MAX_COPIES as u32;
        let stage = stage_of(&[
            StageChange::Add((0..count).map(|n| Placement::at(f64::from(n), 0.0)).collect()),
            StageChange::Delete((0..count as usize).rev().filter(|n| n % 2 == 1).collect()),
        ]);
        assert!(stage.copies.iter().map(|c| c.x).eq((0..count).step_by(2).map(f64::from)));
    }

    #[test]
    fn copies_with_keyframes_take_them_along() {
        let mut motion = motion::Tracks::default();
        for (secs, x) in [(0.0, 1.0), (4.0, 9.0)] {
            motion.copies.entry(1).or_default().set(secs, Placement::at(x, 0.0));
        }
        let changes = [
            StageChange::Add((0..3).map(|k| Placement::at(f64::from(k), 0.0)).collect()),
            StageChange::Motion(motion.into()),
            StageChange::Move {
                copies: vec![(0, Placement::at(-1.0, 0.0)), (1, Placement::at(0.0, 7.0))],
                secs: 2.0,
            },
            StageChange::Duplicate { numbers: vec![1, 2], aside: 10.0 },
        ];
        let stage = stage_of(&changes);
        assert_eq!(stage.copies.iter().map(|c| c.x).collect::<Vec<_>>(), [-1.0, 1.0, 2.0, 11.0, 12.0]);
        let at = |secs: f64| stage.copies_at(secs).iter().map(|c| (c.x, c.z)).collect::<Vec<_>>();
        assert_eq!(at(0.0), [(-1.0, 0.0), (1.0, 0.0), (2.0, 0.0), (11.0, 0.0), (12.0, 0.0)]);
        assert_eq!(at(2.0)[1..4], [(0.0, 7.0), (2.0, 0.0), (10.0, 7.0)]);
        assert_eq!(at(9.0)[3], (19.0, 0.0));
        assert_eq!(stage.all_placements().count(), 5 + 6);
        // Copies are renumbered, scattering removes keyframes, and a copy without keyframes stays at its
        // first one.
        let mut less = stage.clone();
        StageChange::Delete(vec![0, 1]).apply(&mut less);
        assert_eq!(less.motion.copies.keys().copied().collect::<Vec<_>>(), [1]);
        StageChange::Scatter(Scatter { keeps: true, count: 5, ..Scatter::default() }).apply(&mut less);
        assert_eq!(less.motion.copies.len(), 1);
        StageChange::Scatter(Scatter { count: 5, ..Scatter::default() }).apply(&mut less);
        assert!(less.motion.is_empty());
        let mut still = stage;
        StageChange::Move { copies: vec![(1, Placement::at(5.0, 5.0))], secs: 0.0 }.apply(&mut still);
        StageChange::Motion(Motion::default()).apply(&mut still);
        assert_eq!(still.copies[1], Placement::at(5.0, 5.0));
    }

    #[test]
    fn an_invalid_placement_is_no_copy() {
        let bad = [
            Placement { scale: 0.0, ..Placement::at(0.0, 0.0) },
            Placement { scale: -1.0, ..Placement::at(0.0, 0.0) },
            Placement::at(f64::NAN, 0.0),
            Placement::at(0.0, f64::INFINITY),
        ];
        let stage =
            stage_of(&[StageChange::Add(bad.to_vec()), StageChange::Add(vec![Placement::at(1.0, 1.0)])]);
        assert_eq!(*stage.copies, [Placement::at(1.0, 1.0)]);
        let many = StageChange::Add(vec![Placement::at(0.0, 0.0); MAX_COPIES + 5]);
        assert_eq!(stage_of(&[many]).copies.len(), MAX_COPIES);
        let huge = Placement { scale: 1e9, ..Placement::at(0.0, 0.0) };
        assert_eq!(stage_of(&[StageChange::Add(vec![huge])]).copies[0].scale, *SCALE_RANGE.end());
    }

    #[test]
    fn a_copy_stands_on_the_ground_whichever_way_the_model_is_turned() {
        let bounds = Bounds { min: [3.0, -2.0, 5.0], max: [5.0, 6.0, 6.0] };
        for turn in [DQuat::IDENTITY, DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2)] {
            let base = ModelBase::new(&bounds, turn);
            let copy = Placement { x: 10.0, z: -4.0, turn_deg: 30.0, scale: 3.0 };
            let corners = (0..8).map(|k| {
                let pick = |i: usize| if k >> i & 1 == 0 { bounds.min[i] } else { bounds.max[i] };
                base.stage_from(&copy).transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
            });
            let (centre, radius) = base.bounding_sphere(&copy);
            let mut lowest = f64::INFINITY;
            for corner in corners {
                lowest = lowest.min(corner.y);
                assert!(corner.distance(centre) <= radius * (1.0 + 1e-9), "{corner}");
                let aside = (corner.x - 10.0).hypot(corner.z + 4.0);
                assert!(aside <= 3.0 * base.footprint() * (1.0 + 1e-9));
            }
            assert!(lowest.abs() < 1e-9, "{lowest}");
        }
    }

    #[test]
    fn the_ground_grows_by_steps() {
        let base = ModelBase::new(&Bounds { min: [-1.0; 3], max: [1.0; 3] }, DQuat::IDENTITY);
        let few = base.bounds(&[Placement::at(0.0, 0.0)]);
        assert_eq!(few, base.bounds(&[Placement::at(1.0, 1.0)]));
        let far = base.bounds(&[Placement::at(100.0, 0.0)]);
        assert!(far.max[0] >= 101.0 && far.max[0] / few.max[0] == (far.max[0] / few.max[0]).round());
    }
}
