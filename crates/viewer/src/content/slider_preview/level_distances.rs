//! Largest distances of some levels of a progressive mesh, from which those of all levels are estimated.

use std::iter::successors;

use lodsmith::{Control, ProgressiveScene, Stage, Verdict};
use lodsmith_asset::AssetError;
use lodsmith_core::measure::{CompareOptions, Prepared, compare_prepared};

use crate::content::Original;

/// Fraction of the faces that the finest measured level has: with all of them there is no distance.
const FIRST_RATIO: f64 = 0.8;

/// Ratio of the face counts of successive measured levels.
const FACE_RATIO: usize = 3;

/// A level with fewer triangles is not measured.
const MIN_FACES: usize = 12;

/// Samples per direction, besides all vertices. (Guessed: of levels that are not measured, only an estimate is known.)
const SAMPLES: usize = 2000;

/// Ratio of largest to RMS distance if no level could be measured. (Measured: 7 to 13 on cow, bunny, nefertiti and spot
/// at errors of 0.5 and 2 % of the diagonal, 9 to 26 at 0.1 %.)
const DEFAULT_PEAK_RATIO: f64 = 8.0;

/// Estimates the largest distance of a level from its RMS distance, and the other way round.
#[derive(Debug)]
pub(super) struct LevelDistances {
    /// RMS and largest distance of measured levels; both ascend.
    points: Vec<[f64; 2]>,
}

impl LevelDistances {
    /// Measures some levels of the progressive mesh of a model. `meshes` has the index of the model's mesh for each
    /// part. The scene ends at its finest level.
    pub(super) fn measure(
        scene: &mut ProgressiveScene,
        original: &Original,
        meshes: &[usize],
        control: &mut dyn Control,
    ) -> Result<Self, AssetError> {
        control.stage(Stage::Measure);
        let first = (scene.face_count() as f64 * FIRST_RATIO) as usize;
        let counts = successors(Some(first), |n| Some(n / FACE_RATIO));
        let mut levels: Vec<_> =
            counts.take_while(|n| *n >= MIN_FACES).map(|n| scene.level_of_faces(n)).collect();
        levels.dedup();
        let scales = original.scales();
        let mut options = CompareOptions::default();
        options.samples = SAMPLES;
        let mut points = Vec::with_capacity(levels.len());
        for (i, &level) in levels.iter().enumerate() {
            scene.to_level(level);
            let mut largest = 0f64;
            for (part, &mesh) in scene.meshes().iter().zip(meshes) {
                if control.progress(i as f64 / levels.len() as f64) == Verdict::Cancel {
                    return Err(AssetError::Cancelled);
                }
                let light = part.fitted_mesh()?;
                let (Some(reference), Ok(light)) = (original.prepared(mesh), Prepared::new(&light.surface()))
                else {
                    continue;
                };
                let found = compare_prepared(reference, &light, &options).hausdorff.symmetric;
                largest = largest.max(found * scales[mesh]);
            }
            points.push([scene.error(), largest]);
        }
        scene.to_level(scene.top());
        Ok(Self::of(points))
    }

    /// Takes RMS and largest distances of levels, the finest level first.
    fn of(mut points: Vec<[f64; 2]>) -> Self {
        points.retain(|point| point.iter().all(|d| *d > 0.0 && d.is_finite()));
        let mut before = [0f64; 2];
        for point in &mut points {
            // A coarser level never counts as closer.
            *point = [0, 1].map(|k| point[k].max(before[k]));
            before = *point;
        }
        Self { points }
    }

    /// Returns the RMS distance of the coarsest level within a largest distance.
    pub(super) fn rms_within(&self, largest: f64) -> f64 {
        self.converted(largest, 1, 0)
    }

    /// Returns the largest distance of a level with this RMS distance.
    pub(super) fn largest_at(&self, rms: f64) -> f64 {
        self.converted(rms, 0, 1)
    }

    /// Interpolates between the logarithms of the points. Coarser than all, the ratio is constant. Finer than all, the
    /// RMS distance falls as the square of the largest: fewer places differ, but each by nearly as much.
    fn converted(&self, x: f64, from: usize, to: usize) -> f64 {
        let i = self.points.partition_point(|point| point[from] <= x);
        let before = i.checked_sub(1).map(|i| &self.points[i]);
        match (before, self.points.get(i)) {
            (Some(a), Some(b)) => {
                let part = (x / a[from]).ln() / (b[from] / a[from]).ln();
                a[to] * (b[to] / a[to]).powf(part)
            }
            (None, Some(finest)) => {
                let power = if to == 0 { 2.0 } else { 0.5 };
                finest[to] * (x / finest[from]).powf(power)
            }
            (Some(coarsest), None) => x * coarsest[to] / coarsest[from],
            (None, None) if to == 0 => x / DEFAULT_PEAK_RATIO,
            (None, None) => x * DEFAULT_PEAK_RATIO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_between_measured_levels_are_interpolated() {
        let known = LevelDistances::of(vec![[1.0, 4.0], [4.0, 64.0]]);
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        near(known.largest_at(2.0), 16.0);
        near(known.rms_within(16.0), 2.0);
        near(known.rms_within(128.0), 8.0);
        near(known.largest_at(8.0), 128.0);
        near(known.rms_within(1.0), 1.0 / 16.0);
        near(known.largest_at(1.0 / 16.0), 1.0);
        let unknown = LevelDistances::of(vec![[0.0, 0.0]]);
        near(unknown.largest_at(1.0), 8.0);
        near(unknown.rms_within(8.0), 1.0);
    }

    #[test]
    fn a_coarser_level_is_never_closer() {
        let known = LevelDistances::of(vec![[1.0, 6.0], [2.0, 3.0], [4.0, 12.0]]);
        assert_eq!(known.largest_at(2.0), 6.0);
        // The coarsest of the levels with the same largest distance.
        assert_eq!(known.rms_within(6.0), 2.0);
        let limits = [1.0, 5.9, 6.0, 6.1, 12.0, 50.0];
        let found = limits.map(|limit| known.rms_within(limit));
        assert!(found.is_sorted(), "{found:?}");
        let within =
            limits.iter().zip(found).all(|(limit, rms)| known.largest_at(rms) <= limit * (1.0 + 1e-9));
        assert!(within, "{found:?}");
    }
}
