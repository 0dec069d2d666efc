//! Levels by the distance that is measured between them and the full mesh.

use lodsmith_core::Surface;
use lodsmith_core::measure::{CompareOptions, Comparison, Prepared, compare_prepared};
use lodsmith_core::spatial::Bvh;

use super::Progressive;
use crate::SimplifyError;
use crate::control::{Control, Stage, Verdict};

/// Faces of a level that is looked at over those of the next coarser one. (A guess: the count is within 5 % of the best.)
const STEP: f64 = 1.05;
/// Vertices of the full mesh that a first look at a level measures, at most: most levels that are too far away show it
/// there. (A guess.)
const FIRST_LOOK: usize = 4000;
/// A level whose estimated RMS distance is so many times the limit is not measured: the estimate is at most 1.1 times the
/// RMS distance (docs/progressive.md), and the largest distance is no less than that.
const HOPELESS: f64 = 4.0;
/// Distances below this share of the diagonal are rounding.
const ROUNDING: f64 = 1e-12;

impl Progressive {
    /// The coarsest level found whose largest distance from the full mesh, measured both ways, is at most `distance` in the
    /// units of the mesh; with the moves of its fit if `is_fitted`. Without one, the full mesh's level.
    ///
    /// The levels that are measured do not depend on the distance, so a larger one never leads to more faces. Each has 5 %
    /// more faces than the one before. The road stands where it stood. Cost: about a second for each million faces of the
    /// full mesh and each level that is nearly within the distance.
    ///
    /// # Errors
    /// [`SimplifyError::Cancelled`] if the control says so; as [`Progressive::mesh`].
    pub fn level_of_deviation(
        &self,
        distance: f64,
        is_fitted: bool,
        control: &mut dyn Control,
    ) -> Result<usize, SimplifyError> {
        control.stage(Stage::Measure);
        let Some(judge) = Judge::new(self)? else { return Ok(self.top()) };
        let limit = distance + ROUNDING * judge.reference.diagonal();
        let mut road = self.clone();
        let levels = self.levels_to_measure();
        for (i, &level) in levels.iter().enumerate() {
            if control.progress(i as f64 / levels.len() as f64) == Verdict::Cancel {
                return Err(SimplifyError::Cancelled);
            }
            if self.error_at(level) > HOPELESS * limit {
                continue;
            }
            road.to_level(level);
            if judge.is_within(&road, limit, is_fitted)? {
                return Ok(level);
            }
        }
        Ok(self.top())
    }

    /// How far the present level is from the full mesh, measured both ways; with the moves of its fit if `is_fitted`.
    /// `None` where one of the two has no face with an extent.
    ///
    /// # Errors
    /// As [`Progressive::mesh`].
    pub fn deviation(&self, is_fitted: bool) -> Result<Option<Comparison>, SimplifyError> {
        let Some(judge) = Judge::new(self)? else { return Ok(None) };
        let mesh = if is_fitted { self.fitted_mesh() } else { self.mesh() }?;
        Ok(judge.compare(&mesh.surface()))
    }

    /// Levels from the base up, each with a twentieth more faces than the one before; the full mesh's is the last.
    fn levels_to_measure(&self) -> Vec<usize> {
        let counts = &self.splits().counts;
        let (mut levels, mut level) = (vec![0], 0);
        while level < self.top() {
            let wanted = f64::from(counts[level].faces) * STEP;
            level = self.level_of_faces(wanted as usize).max(level + 1);
            levels.push(level);
        }
        levels
    }
}

/// The full mesh, and some of its vertices.
struct Judge {
    reference: Prepared,
    places: Vec<[f64; 3]>,
}

impl Judge {
    /// `None` where the full mesh has no face to measure from.
    fn new(road: &Progressive) -> Result<Option<Self>, SimplifyError> {
        let mut full = road.clone();
        full.to_level(full.top());
        let mesh = full.mesh()?;
        let surface = mesh.surface();
        let Ok(reference) = Prepared::new(&surface) else { return Ok(None) };
        let positions = surface.positions();
        // By faces: a vertex without one is no part of the surface.
        let stride = surface.triangles().len().div_ceil(FIRST_LOOK).max(1);
        let places = surface.triangles().iter().step_by(stride).map(|t| positions.get(t[0]));
        let places = places.filter(|p| p.iter().all(|x| x.is_finite())).collect();
        Ok(Some(Self { reference, places }))
    }

    fn is_within(&self, road: &Progressive, limit: f64, is_fitted: bool) -> Result<bool, SimplifyError> {
        let mesh = if is_fitted { road.fitted_mesh() } else { road.mesh() }?;
        let surface = mesh.surface();
        let tree = Bvh::new(&surface);
        let is_far = |p: &[f64; 3]| tree.closest(*p).is_none_or(|hit| hit.distance > limit);
        if self.places.iter().any(is_far) {
            return Ok(false);
        }
        Ok(self.compare(&surface).is_some_and(|c| c.hausdorff.symmetric <= limit))
    }

    fn compare(&self, surface: &Surface<'_>) -> Option<Comparison> {
        let candidate = Prepared::new(surface).ok()?;
        Some(compare_prepared(&self.reference, &candidate, &CompareOptions::default()))
    }
}
