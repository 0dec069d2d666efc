//! Selection of a level of detail for each copy: the coarsest whose error covers at most a given number of
//! pixels on screen, with all copies within a triangle budget.

use glam::DVec3;
use lodsmith_render::{Camera, Lens};

use super::{ModelBase, Placement, StageDisplay};

/// A level of the model. Levels are ordered from the finest; the first is the original, with error 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LodLevel {
    /// RMS distance from the original, in units of the model.
    pub error: f64,
    /// Number of triangles.
    pub faces: u64,
}

/// Viewpoint for the level selection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// The camera.
    pub camera: Camera,
    /// Aspect ratio of the picture, width / height.
    pub aspect: f64,
    /// Height of the picture in pixels.
    pub height_px: f64,
}

/// A visible copy and its level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisibleCopy {
    /// Number of the copy.
    pub copy: usize,
    /// Index of its level.
    pub level: usize,
    /// Pixels that the error of its level covers.
    pub pixels: f64,
}

/// Copies and levels selected for a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelSelection {
    /// The visible copies, nearest first.
    pub visible: Vec<VisibleCopy>,
    /// Total number of their triangles.
    pub triangles: u64,
    /// Pixels that an error may cover, after adjustment to the budget.
    pub pixels: f64,
    /// Number of visible copies left out because even their coarsest levels exceed the budget.
    pub left_out: usize,
}

impl LevelSelection {
    /// Returns the number of pixels that the largest error in the picture covers.
    pub fn largest_px(&self) -> f64 {
        self.visible.iter().map(|s| s.pixels).fold(0.0, f64::max)
    }

    /// Returns the number of copies shown in each level.
    pub fn counts(&self, levels: usize) -> Vec<usize> {
        let mut counts = vec![0; levels];
        for seen in &self.visible {
            counts[seen.level] += 1;
        }
        counts
    }
}

/// Selects levels with hysteresis, so that a copy near the switching distance does not alternate between two
/// levels.
#[derive(Clone, Debug, Default)]
pub struct LevelSelector {
    /// Previous level of each copy.
    last: Vec<Option<u8>>,
    /// Number of factors [`BUDGET_STEP`] by which the budget currently enlarges the allowed error.
    steps: i32,
}

/// A coarser level is selected once its error is below this fraction of the allowed one. (Guessed.)
const COARSEN_MARGIN: f64 = 0.8;
/// Factor by which the allowed error grows until the budget is kept. It shrinks again when the result would
/// use at most the fraction `BUDGET_SLACK` of the budget.
const BUDGET_STEP: f64 = 1.189_207;
const BUDGET_SLACK: f64 = 0.85;
/// Maximum number of steps, a factor of 10^12: by then every copy has the coarsest level.
const MAX_BUDGET_STEPS: i32 = 160;

impl LevelSelector {
    /// Selects the levels of all visible copies. `levels` must not be empty.
    ///
    /// Cost: O(copies · levels · budget steps); there are few budget steps from frame to frame.
    pub fn choose(
        &mut self,
        copies: &[Placement],
        base: &ModelBase,
        levels: &[LodLevel],
        eye: &Viewpoint,
        view: &StageDisplay,
    ) -> LevelSelection {
        self.last.resize(copies.len(), None);
        for last in self.last.iter_mut().filter(|l| l.is_some_and(|l| usize::from(l) >= levels.len())) {
            *last = None;
        }
        let cone = ViewCone::new(eye);
        // Per visible copy: distance, number, pixels covered by an error of 1.
        let mut seen: Vec<(f64, usize, f64)> = Vec::new();
        for (number, copy) in copies.iter().enumerate() {
            let (centre, radius) = base.bounding_sphere(copy);
            if cone.sees(centre, radius) {
                let distance = (centre.distance(eye.camera.eye) - radius).max(1e-3 * radius);
                let px =
                    copy.scale / eye.camera.length_per_pixel(distance, eye.height_px).max(f64::MIN_POSITIVE);
                seen.push((distance, number, px));
            } else {
                self.last[number] = None;
            }
        }
        seen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let allowed = |steps: i32| view.pixels.max(1e-6) * BUDGET_STEP.powi(steps);
        let total = |steps: i32, chooser: &Self| -> u64 {
            let of = |s: &(f64, usize, f64)| levels[chooser.level(s.1, s.2, levels, allowed(steps))].faces;
            seen.iter().map(of).sum()
        };
        while self.steps < MAX_BUDGET_STEPS && total(self.steps, self) > view.budget {
            self.steps += 1;
        }
        while self.steps > 0 && total(self.steps - 1, self) as f64 <= BUDGET_SLACK * view.budget as f64 {
            self.steps -= 1;
        }
        let pixels = allowed(self.steps);
        let mut chosen = LevelSelection { pixels, ..LevelSelection::default() };
        for &(_, copy, px) in &seen {
            let level = self.level(copy, px, levels, pixels);
            self.last[copy] = u8::try_from(level).ok();
            let faces = levels[level].faces;
            // At least one copy is always drawn, so that the picture is not empty.
            if chosen.triangles.saturating_add(faces) > view.budget && !chosen.visible.is_empty() {
                chosen.left_out += 1;
                continue;
            }
            chosen.triangles += faces;
            chosen.visible.push(VisibleCopy { copy, level, pixels: levels[level].error * px });
        }
        chosen
    }

    /// Resets the selector, forgetting the previous levels.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    fn level(&self, copy: usize, px: f64, levels: &[LodLevel], allowed: f64) -> usize {
        let lightest = |allowed: f64| levels.iter().rposition(|l| l.error * px <= allowed).unwrap_or(0);
        match self.last[copy].map(usize::from) {
            Some(last) if levels[last].error * px <= allowed => last.max(lightest(COARSEN_MARGIN * allowed)),
            _ => lightest(allowed),
        }
    }
}

/// Returns the distance from which a level may be shown, in units of the model, for a copy of scale 1.
pub fn switch_distance(level: &LodLevel, eye: &Viewpoint, pixels: f64) -> f64 {
    level.error / eye.camera.length_per_pixel(1.0, eye.height_px).max(f64::MIN_POSITIVE) / pixels.max(1e-6)
}

/// View cone of a camera, for culling.
struct ViewCone {
    eye: DVec3,
    axes: [DVec3; 3],
    half: [f64; 2],
}

impl ViewCone {
    fn new(eye: &Viewpoint) -> Self {
        let half_height = match eye.camera.lens {
            Lens::Perspective { fov_y_rad } => (0.5 * fov_y_rad).tan(),
            Lens::Parallel { height } => 0.5 * height / eye.camera.distance().max(1e-30),
        };
        Self { eye: eye.camera.eye, axes: eye.camera.axes(), half: [half_height * eye.aspect, half_height] }
    }

    fn sees(&self, centre: DVec3, radius: f64) -> bool {
        let to = centre - self.eye;
        let [right, up, back] = self.axes.map(|a| a.dot(to));
        let beside =
            |along: f64, half: f64| (along.abs() + back * half) / (1.0 + half * half).sqrt() > radius;
        !(back > radius || beside(right, self.half[0]) || beside(up, self.half[1]))
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use lodsmith_core::Bounds;

    use super::super::scatter::Scatter;
    use super::*;

    const LEVELS: [LodLevel; 4] = [
        LodLevel { error: 0.0, faces: 70_000 },
        LodLevel { error: 0.001, faces: 7_000 },
        LodLevel { error: 0.01, faces: 700 },
        LodLevel { error: 0.1, faces: 70 },
    ];

    fn base() -> ModelBase {
        ModelBase::new(&Bounds { min: [-0.5; 3], max: [0.5; 3] }, DQuat::IDENTITY)
    }

    /// A viewpoint near the ground, looking along -z.
    fn eye(z: f64) -> Viewpoint {
        let eye = DVec3::new(0.0, 0.5, z);
        let lens = Lens::Perspective { fov_y_rad: 0.6 };
        let camera = Camera { eye, target: eye + DVec3::NEG_Z, up: DVec3::Y, lens };
        Viewpoint { camera, aspect: 1.5, height_px: 900.0 }
    }

    fn view(budget: u64) -> StageDisplay {
        StageDisplay { budget, pixels: 1.0, ..StageDisplay::default() }
    }

    #[test]
    fn farther_copies_are_lighter_and_no_error_shows() {
        let copies: Vec<_> = (0..60).map(|k| Placement::at(0.0, -2.0 * f64::from(k))).collect();
        let chosen = LevelSelector::default().choose(&copies, &base(), &LEVELS, &eye(1.5), &view(u64::MAX));
        assert_eq!(chosen.visible.len(), 60);
        assert!(chosen.visible.windows(2).all(|w| w[0].level <= w[1].level && w[0].copy < w[1].copy));
        assert!(chosen.largest_px() <= 1.0);
        let counts = chosen.counts(4);
        assert!(counts[0] > 0 && counts[1] > 0 && counts[2] > 0, "{counts:?}");
        // The first copy in level 1 is just beyond the switching distance of that level.
        let first_of = |level: usize| chosen.visible.iter().find(|s| s.level == level).unwrap().copy as f64;
        let far = switch_distance(&LEVELS[1], &eye(1.5), 1.0);
        let place = 1.5 + 2.0 * first_of(1) - 0.5 * base().length();
        assert!(place >= far && place < far + 2.0, "{place} {far}");
    }

    #[test]
    fn instances_behind_the_camera_are_not_drawn() {
        let copies = [Placement::at(0.0, 20.0), Placement::at(50.0, -5.0), Placement::at(0.0, -5.0)];
        let chosen = LevelSelector::default().choose(&copies, &base(), &LEVELS, &eye(3.0), &view(u64::MAX));
        assert_eq!(chosen.visible.iter().map(|s| s.copy).collect::<Vec<_>>(), [2]);
    }

    #[test]
    fn a_level_does_not_alternate_at_its_switching_distance() {
        let copies = [Placement::at(0.0, 0.0)];
        let border = switch_distance(&LEVELS[2], &eye(0.0), 1.0) + 0.5 * base().length();
        let level = |chooser: &mut LevelSelector, z: f64| {
            chooser.choose(&copies, &base(), &LEVELS, &eye(z), &view(u64::MAX)).visible[0].level
        };
        let mut chooser = LevelSelector::default();
        assert_eq!(level(&mut chooser, border * 0.9), 1);
        // Moving back, the coarser level is selected with a delay; moving forward, it is dropped at once,
        // since its error would be visible.
        assert_eq!(level(&mut chooser, border * 1.05), 1);
        assert_eq!(level(&mut chooser, border * 1.3), 2);
        assert_eq!(level(&mut chooser, border * 1.05), 2);
        assert_eq!(level(&mut chooser, border * 0.99), 1);
    }

    #[test]
    fn the_budget_is_kept_from_every_position() {
        let scatter = Scatter { count: 500, footprint: base().footprint(), ..Scatter::default() };
        let copies = scatter.placements(&[]);
        let mut chooser = LevelSelector::default();
        for budget in [2_000_000, 100_000, 40_000] {
            for k in 0..60 {
                let z = 40.0 - 1.5 * f64::from(k);
                let chosen = chooser.choose(&copies, &base(), &LEVELS, &eye(z), &view(budget));
                assert!(chosen.triangles <= budget, "{budget}: {} at {z}", chosen.triangles);
                assert_eq!(chosen.left_out, 0, "{budget} at {z}");
                assert_eq!(
                    chosen.triangles,
                    chosen.visible.iter().map(|s| LEVELS[s.level].faces).sum::<u64>()
                );
            }
        }
    }

    #[test]
    fn a_budget_that_cannot_be_kept_leaves_the_farthest_out() {
        let copies: Vec<_> = (0..50).map(|k| Placement::at(0.0, -2.0 * f64::from(k))).collect();
        let chosen =
            LevelSelector::default().choose(&copies, &base(), &LEVELS[..1], &eye(3.0), &view(150_000));
        assert_eq!((chosen.visible.len(), chosen.left_out), (2, 48));
        assert_eq!(chosen.visible[1].copy, 1);
        // At least one copy is always drawn.
        let chosen = LevelSelector::default().choose(&copies, &base(), &LEVELS[..1], &eye(3.0), &view(1));
        assert_eq!((chosen.visible.len(), chosen.left_out), (1, 49));
    }
}
