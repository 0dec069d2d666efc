//! The Stage: copies of the model on a ground, to see which level stands where.
//!
//! The ground is the plane y = 0. A copy stands on it with the middle of its base at its place; lengths are those of the
//! model. All of this is plain data that commands change; only [`picture`] knows a window.

#[cfg(feature = "window")]
pub mod export;
pub mod file;
#[cfg(feature = "window")]
pub mod ground;
pub mod levels;
pub mod motion;
#[cfg(feature = "window")]
pub mod picture;
pub mod scatter;
pub mod walk;

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use lodsmith_core::Bounds;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::orbit::{turn_matrix, turned_bounds};
use motion::{Motion, Track};
use scatter::Scatter;

/// A copy of the model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Where it stands.
    pub x: f64,
    /// Towards who looks from the front.
    pub z: f64,
    /// How it is turned round the upright axis, against the clock seen from above.
    #[serde(default)]
    pub turn_deg: f64,
    /// How much larger than the model it is.
    #[serde(default = "one")]
    pub scale: f64,
}

fn one() -> f64 {
    1.0
}

/// Scales that a copy may have.
pub const SCALES: std::ops::RangeInclusive<f64> = 0.01..=100.0;
/// Copies that a stage holds. So many take up to 10 ms of a frame. (Measured, on foot.)
pub const MOST: usize = 20_000;

impl Placement {
    /// One as large as the model.
    pub fn at(x: f64, z: f64) -> Self {
        Self { x, z, turn_deg: 0.0, scale: 1.0 }
    }

    /// With all its numbers where they may be; `None` for one that stands nowhere.
    pub fn checked(self) -> Option<Self> {
        let is_number = [self.x, self.z, self.turn_deg, self.scale].iter().all(|v| v.is_finite());
        (is_number && self.scale > 0.0).then(|| Self {
            turn_deg: self.turn_deg.rem_euclid(360.0),
            scale: self.scale.clamp(*SCALES.start(), *SCALES.end()),
            ..self
        })
    }
}

/// Copies, shared between the settings of many steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Copies(Arc<Vec<Placement>>);

impl std::ops::Deref for Copies {
    type Target = [Placement];

    fn deref(&self) -> &[Placement] {
        &self.0
    }
}

impl From<Vec<Placement>> for Copies {
    /// Those that stand somewhere, and no more than [`MOST`].
    fn from(all: Vec<Placement>) -> Self {
        Self(Arc::new(all.into_iter().filter_map(Placement::checked).take(MOST).collect()))
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

/// All of the stage that commands change.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Stage {
    /// Whether it is shown in the place of the two sides.
    pub is_on: bool,
    /// The copies, in the order in which they came.
    pub copies: Copies,
    /// How copies are scattered.
    pub scatter: Scatter,
    /// How they are shown.
    pub view: View,
    /// What moves.
    pub motion: Motion,
}

impl Stage {
    /// Where all copies stand at a moment. Cost: O(copies) where some move.
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

    /// Every place where copies stand or have a keyframe.
    pub fn places(&self) -> impl Iterator<Item = &Placement> {
        self.copies.iter().chain(self.motion.copies.values().flat_map(Track::values))
    }
}

/// How the stage is shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct View {
    /// Pixels that the error of a level may cover.
    pub pixels: f64,
    /// Triangles that a frame may have.
    pub budget: u64,
    /// Whether each level has a colour of its own.
    pub has_level_colors: bool,
    /// Height of the eye while walking, in heights of the model.
    pub eye_height: f64,
    /// Speed of walking, in sizes of the model a second.
    pub speed: f64,
}

impl Default for View {
    fn default() -> Self {
        Self { pixels: 0.5, budget: 2_000_000, has_level_colors: false, eye_height: 0.6, speed: 1.0 }
    }
}

/// A change of the stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum StageChange {
    /// Shown, or not.
    Show(bool),
    /// More copies.
    Add(Vec<Placement>),
    /// Copies by chance: in the place of all, or between those that stand.
    Scatter(Scatter),
    /// The same once more beside them, by their numbers, with their keyframes.
    Duplicate {
        /// Which.
        numbers: Vec<usize>,
        /// How far to the right, for a copy of scale 1.
        aside: f64,
    },
    /// Other places for some, by their numbers: where these have keyframes, as a keyframe at this moment.
    Move {
        /// Which, and where they are to be.
        copies: Vec<(usize, Placement)>,
        /// When.
        secs: f64,
    },
    /// Those with these numbers go.
    Delete(Vec<usize>),
    /// These and no others, and how they move.
    Replace(Copies, Motion),
    /// Other keyframes.
    Motion(Motion),
    /// Another way to show them.
    View(View),
}

impl StageChange {
    /// Its name, for the menu.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Show(_) => "stage",
            Self::Add(_) => "new copies",
            Self::Scatter(_) => "scatter",
            Self::Duplicate { .. } => "duplicate copies",
            Self::Move { .. } => "move copies",
            Self::Delete(_) => "delete copies",
            Self::Replace(..) => "layout",
            Self::Motion(_) => "keyframes",
            Self::View(_) => "look of the stage",
        }
    }

    /// Changes the stage.
    pub fn apply(&self, stage: &mut Stage) {
        match self {
            Self::Show(is_on) => stage.is_on = *is_on,
            Self::Add(new) => {
                stage.copies = stage.copies.iter().chain(new).copied().collect::<Vec<_>>().into();
            }
            Self::Scatter(scatter) => {
                stage.scatter = *scatter;
                let kept = if scatter.keeps { stage.copies.len() } else { 0 };
                stage.copies = scatter.scattered(&stage.copies).into();
                stage.motion = stage.motion.within(kept);
            }
            Self::Duplicate { numbers, aside } => stage.duplicate(numbers, *aside),
            Self::Move { copies, secs } => stage.move_copies(copies, *secs),
            Self::Delete(gone) => {
                let is_left = |(number, _): &(usize, &Placement)| !gone.contains(number);
                let left: Vec<_> = stage.copies.iter().enumerate().filter(is_left).map(|x| *x.1).collect();
                stage.copies = left.into();
                stage.motion = stage.motion.without_copies(gone);
            }
            Self::Replace(copies, motion) => {
                stage.copies = copies.clone();
                stage.motion = motion.within(copies.len());
            }
            Self::Motion(motion) => stage.set_motion(motion.within(stage.copies.len())),
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
            self.motion = self.motion.with(|m| m.copies.extend(tracks)).within(self.copies.len());
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

    /// Other keyframes. A copy that loses its last stays where that was.
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

/// The model as it stands on a ground: what is the same for all copies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Base {
    /// From the model, turned as it is, to a copy of its size at the middle of the stage.
    pub stage_from_model: DMat4,
    /// How it is turned.
    pub turn: DQuat,
    /// Width, height and depth of its box.
    pub size: DVec3,
}

impl Base {
    /// Of a model with this box, turned about the middle of it.
    pub fn new(bounds: &Bounds, turn: DQuat) -> Self {
        let box_ = turned_bounds(bounds, turn);
        let [min, max] = [box_.min, box_.max].map(DVec3::from);
        let middle = 0.5 * min + 0.5 * max;
        let foot = DVec3::new(middle.x, min.y, middle.z);
        let stage_from_model = DMat4::from_translation(-foot) * turn_matrix(bounds, turn);
        Self { stage_from_model, turn, size: max - min }
    }

    /// Radius of a circle on the ground that the model stands in, however it is turned there.
    pub fn footprint(&self) -> f64 {
        let radius = 0.5 * self.size.x.hypot(self.size.z);
        // Something thin and upright needs room as well.
        radius.max(0.05 * self.size.y).max(f64::MIN_POSITIVE)
    }

    /// The length by which the stage is measured: the diagonal of the model.
    pub fn length(&self) -> f64 {
        let length = self.size.length();
        if length > 0.0 && length.is_finite() { length } else { 1.0 }
    }

    /// Centre and radius of a ball round a copy.
    pub fn ball(&self, copy: &Placement) -> (DVec3, f64) {
        (DVec3::new(copy.x, 0.5 * self.size.y * copy.scale, copy.z), 0.5 * self.length() * copy.scale)
    }

    /// From a copy's own system, whose origin is the middle of its base, to the stage.
    pub fn stage_from_copy(copy: &Placement) -> DMat4 {
        let turn = DQuat::from_rotation_y(copy.turn_deg.to_radians());
        DMat4::from_scale_rotation_translation(
            DVec3::splat(copy.scale),
            turn,
            DVec3::new(copy.x, 0.0, copy.z),
        )
    }

    /// From the model to where a copy of it stands.
    pub fn stage_from(&self, copy: &Placement) -> DMat4 {
        Self::stage_from_copy(copy) * self.stage_from_model
    }

    /// A box round the whole stage: at least some models large, and then in steps of two, so that ground and light stay as
    /// they are while copies come and go.
    pub fn bounds<'a>(&self, copies: impl IntoIterator<Item = &'a Placement>) -> Bounds {
        let mut reach = 0f64;
        let mut height = self.size.y;
        for copy in copies {
            let (centre, radius) = self.ball(copy);
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
    fn copies_come_move_and_go() {
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
        assert_eq!(stage.places().count(), 5 + 6);
        // Numbers follow, scatter leaves none, and without keyframes a copy stays where the first was.
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
    fn what_stands_nowhere_is_no_copy() {
        let bad = [
            Placement { scale: 0.0, ..Placement::at(0.0, 0.0) },
            Placement { scale: -1.0, ..Placement::at(0.0, 0.0) },
            Placement::at(f64::NAN, 0.0),
            Placement::at(0.0, f64::INFINITY),
        ];
        let stage =
            stage_of(&[StageChange::Add(bad.to_vec()), StageChange::Add(vec![Placement::at(1.0, 1.0)])]);
        assert_eq!(*stage.copies, [Placement::at(1.0, 1.0)]);
        let many = StageChange::Add(vec![Placement::at(0.0, 0.0); MOST + 5]);
        assert_eq!(stage_of(&[many]).copies.len(), MOST);
        let huge = Placement { scale: 1e9, ..Placement::at(0.0, 0.0) };
        assert_eq!(stage_of(&[StageChange::Add(vec![huge])]).copies[0].scale, *SCALES.end());
    }

    #[test]
    fn a_copy_stands_on_the_ground_whichever_way_the_model_is_turned() {
        let bounds = Bounds { min: [3.0, -2.0, 5.0], max: [5.0, 6.0, 6.0] };
        for turn in [DQuat::IDENTITY, DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2)] {
            let base = Base::new(&bounds, turn);
            let copy = Placement { x: 10.0, z: -4.0, turn_deg: 30.0, scale: 3.0 };
            let corners = (0..8).map(|k| {
                let pick = |i: usize| if k >> i & 1 == 0 { bounds.min[i] } else { bounds.max[i] };
                base.stage_from(&copy).transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
            });
            let (centre, radius) = base.ball(&copy);
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
        let base = Base::new(&Bounds { min: [-1.0; 3], max: [1.0; 3] }, DQuat::IDENTITY);
        let few = base.bounds(&[Placement::at(0.0, 0.0)]);
        assert_eq!(few, base.bounds(&[Placement::at(1.0, 1.0)]));
        let far = base.bounds(&[Placement::at(100.0, 0.0)]);
        assert!(far.max[0] >= 101.0 && far.max[0] / few.max[0] == (far.max[0] / few.max[0]).round());
    }
}
