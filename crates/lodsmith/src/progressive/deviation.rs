//! Levels by their measured distance from the full mesh.

use lodsmith_core::Surface;
use lodsmith_core::measure::{CompareOptions, Comparison, Prepared, compare_prepared};
use lodsmith_core::spatial::Bvh;

use super::Progressive;
use crate::SimplifyError;
use crate::control::{Control, Stage, Verdict};

/// Ratio between the face counts of successive measured levels. (Guessed: the count is within 5 % of the
/// best.)
const LEVEL_RATIO: f64 = 1.05;
/// Maximum number of vertices of the full mesh in a first check of a level, which most levels that are too
/// far away fail. (Guessed.)
const SPOT_CHECK_VERTICES: usize = 4000;
/// A level whose estimated RMS distance exceeds this multiple of the limit is not measured: the estimate is
/// at most 1.1 times the RMS distance (docs/progressive.md), and the largest distance is at least the RMS
/// distance.
const MAX_ESTIMATE_RATIO: f64 = 4.0;
/// Distances below this share of the diagonal are rounding.
const ROUNDING: f64 = 1e-12;

impl Progressive {
    /// Returns the coarsest level found whose largest distance from the full mesh, measured in both
    /// directions, is at most `distance`, in the units of the mesh. If `is_fitted`, levels include the moves
    /// of their fit. If there is none, returns the level of the full mesh.
    ///
    /// Which levels are measured does not depend on the distance, so a larger distance never leads to more
    /// faces. Each has 5 % more faces than the one before. The current level does not change. Cost: about a
    /// second per million faces of the full mesh and per level that is nearly within the distance.
    ///
    /// # Errors
    /// [`SimplifyError::Cancelled`] if the control cancels; otherwise the errors of [`Progressive::mesh`].
    pub fn level_of_deviation(
        &self,
        distance: f64,
        is_fitted: bool,
        control: &mut dyn Control,
    ) -> Result<usize, SimplifyError> {
        control.stage(Stage::Measure);
        let Some(comparer) = LevelComparer::new(self)? else { return Ok(self.top()) };
        let limit = distance + ROUNDING * comparer.reference.diagonal();
        let mut progressive = self.clone();
        let levels = self.levels_to_measure();
        for (i, &level) in levels.iter().enumerate() {
            if control.progress(i as f64 / levels.len() as f64) == Verdict::Cancel {
                return Err(SimplifyError::Cancelled);
            }
            if self.error_at(level) > MAX_ESTIMATE_RATIO * limit {
                continue;
            }
            progressive.to_level(level);
            if comparer.is_within(&progressive, limit, is_fitted)? {
                return Ok(level);
            }
        }
        Ok(self.top())
    }

    /// Returns the distance of the current level from the full mesh, measured in both directions, with the
    /// moves of its fit if `is_fitted`. `None` if one of the two has no face with an extent.
    ///
    /// # Errors
    /// Those of [`Progressive::mesh`].
    pub fn deviation(&self, is_fitted: bool) -> Result<Option<Comparison>, SimplifyError> {
        let Some(comparer) = LevelComparer::new(self)? else { return Ok(None) };
        let mesh = if is_fitted { self.fitted_mesh() } else { self.mesh() }?;
        Ok(comparer.compare(&mesh.surface()))
    }

    /// Returns levels from the base up, each with 5 % more faces than the one before; the last is the full
    /// mesh.
    fn levels_to_measure(&self) -> Vec<usize> {
        let counts = &self.splits().counts;
        let (mut levels, mut level) = (vec![0], 0);
        while level < self.top() {
            let wanted = f64::from(counts[level].faces) * LEVEL_RATIO;
            level = self.level_of_faces(wanted as usize).max(level + 1);
            levels.push(level);
        }
        levels
    }
}

/// The full mesh, prepared for comparison, and some of its vertices.
struct LevelComparer {
    reference: Prepared,
    places: Vec<[f64; 3]>,
}

impl LevelComparer {
    /// Returns `None` if the full mesh has no face to measure from.
    fn new(progressive: &Progressive) -> Result<Option<Self>, SimplifyError> {
        let mut full = progressive.clone();
        full.to_level(full.top());
        let mesh = full.mesh()?;
        let surface = mesh.surface();
        let Ok(reference) = Prepared::new(&surface) else { return Ok(None) };
        let positions = surface.positions();
        // Sampled by faces: a vertex without faces is not part of the surface.
        let stride = surface.triangles().len().div_ceil(SPOT_CHECK_VERTICES).max(1);
        let places = surface.triangles().iter().step_by(stride).map(|t| positions.get(t[0]));
        let places = places.filter(|p| p.iter().all(|x| x.is_finite())).collect();
        Ok(Some(Self { reference, places }))
    }

    fn is_within(
        &self,
        progressive: &Progressive,
        limit: f64,
        is_fitted: bool,
    ) -> Result<bool, SimplifyError> {
        let mesh = if is_fitted { progressive.fitted_mesh() } else { progressive.mesh() }?;
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

#[cfg(test)]
mod tests {
    use lodsmith_core::Splits;

    use super::*;
    use crate::control::NoControl;
    use crate::test_support::three_levels;

    #[test]
    fn each_measured_level_has_more_faces_than_the_last() {
        let mut data = three_levels();
        // Twenty more splits without a change: levels 2 to 22 have four faces.
        for _ in 0..20 {
            data.counts.push(data.counts[2]);
            for ends in
                [&mut data.corners.ends, &mut data.owners.ends, &mut data.rows.ends, &mut data.places.ends]
            {
                ends.push(ends[2]);
            }
        }
        let progressive = Progressive::new(Splits::new(data).expect("sound splits"));
        // One face, two, four; of all levels with four faces, the first and the last.
        assert_eq!(progressive.levels_to_measure(), [0, 1, 2, 22]);
    }

    #[test]
    fn the_deviation_includes_the_fit_if_requested() {
        let mut data = three_levels();
        data.checkpoints.clear();
        // The base is the triangle of (0, 0), (2, 0) and (0, 1), within the full mesh, which extends to (1,
        // 2). This point is 3 / √5 from the line x + 2 y = 2.
        let mut progressive = Progressive::new(Splits::new(data).expect("sound splits"));
        progressive.to_level(0);
        let found =
            progressive.deviation(false).expect("a mesh").expect("faces with an area").hausdorff.symmetric;
        assert!((found - 3.0 / 5f64.sqrt()).abs() < 0.02, "{found}");
        // The full mesh itself.
        progressive.to_level(2);
        let found =
            progressive.deviation(false).expect("a mesh").expect("faces with an area").hausdorff.symmetric;
        assert!(found < 1e-9, "{found}");
        let level =
            |limit: f64| progressive.level_of_deviation(limit, false, &mut NoControl).expect("a mesh");
        assert_eq!([10.0, 0.01].map(level), [0, 2]);
    }
}
