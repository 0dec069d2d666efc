//! Samples of the input at the vertices, and when the phase that uses them starts.

use glam::Vec3;
use lodsmith_core::VertexId;
use wide::f32x4;

use super::invariants::need;
use super::star::Star;

/// Live triangles below which the phase starts.
const START_FACES: usize = 2000;
/// Share of the input below which the phase starts if attributes count. (Measured against 2,000: on ten
/// models at 50 to 10 % RMS 0.2 % lower, normals 3 %, textures 4 %; at 5 to 1 % 5 %, 7 % and 6 %.)
const START_SHARE: f64 = 0.15;
/// Targets below this number of faces are extreme.
const EXTREME_FACES: usize = 600;
/// Targets smaller than the input by this factor are extreme.
const EXTREME_REDUCTION: usize = 20;
/// Share of the bounds per sweep in this phase. (Measured: 0.1 to 0.3 give equal results within noise; 0.2
/// takes a sixth less time than 0.1.)
pub(crate) const LATE_QUANTILE: f64 = 0.2;

/// True if a target is extreme for a mesh of `faces` faces.
pub(crate) fn is_extreme(target: usize, faces: usize) -> bool {
    target < EXTREME_FACES || target.saturating_mul(EXTREME_REDUCTION) < faces
}

/// Returns the number of live triangles below which the phase starts in a recorded run, which has extreme and
/// other levels. If a tenth of the input is no extreme target, the phase starts below that: otherwise that
/// level would lose what lower levels gain. (Measured: fandisk at 10 % has 1.07 times the RMS of a single run
/// from 2,000 on, 1.02 from 1,600.)
pub(crate) fn start_faces_of_record(faces: usize) -> usize {
    if is_extreme(faces / 10, faces) { START_FACES } else { START_FACES.min(faces / 8) }
}

/// Returns the number of live triangles below which the phase starts in a run to one target.
pub(crate) fn start_faces(faces: usize, with_attributes: bool) -> usize {
    if with_attributes { START_FACES.min((faces as f64 * START_SHARE) as usize) } else { START_FACES }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) p: Vec3,
    /// Area that it represents.
    pub(super) weight: f32,
}

/// Samples of one live vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct SampleSet {
    pub(super) samples: Vec<Sample>,
    /// Sum of weight · squared distance to the star, as last measured.
    pub(super) loss: f32,
}

/// The sample sets, by number in the ordered input of their vertex.
#[derive(Clone)]
pub(crate) struct SampledError {
    pub(super) set_of: Vec<u32>,
    pub(super) sets: Vec<SampleSet>,
}

/// Scratch buffers of a sampled cost.
#[derive(Clone, Default)]
pub(super) struct SampleScratch {
    /// Samples of both ends.
    pub(super) merged: Vec<Sample>,
    /// Star of the merged vertex.
    pub(super) star: Star,
}

/// Cost of a merger including the growth of the sampled error.
pub(super) struct SampledCost {
    pub(super) cost: f32,
    /// Loss of all samples of the merged vertex.
    pub(super) loss: f32,
    /// The sample farthest from the star.
    pub(super) farthest: usize,
}

/// Returns the loss of samples against a star, the index of the farthest one, and its squared distance.
/// Stops once the loss exceeds `max_loss`.
pub(super) fn measure(samples: &[Sample], star: &Star, max_loss: f32) -> (f32, usize, f32) {
    let (mut loss, mut worst, mut far) = (0f32, 0f32, 0);
    let (fours, rest) = samples.as_chunks::<4>();
    // An unused lane repeats the last sample with weight 0.
    let last = rest.last().map(|&last| {
        let unused = Sample { weight: 0.0, ..last };
        [0, 1, 2, 3].map(|k| rest.get(k).copied().unwrap_or(unused))
    });
    for (i, four) in fours.iter().chain(&last).enumerate() {
        let [x, y, z, weight] = f32x4::transpose(four.map(|s| f32x4::new([s.p.x, s.p.y, s.p.z, s.weight])));
        let nearest = star.distance_sq(&[x, y, z]);
        loss += (nearest * weight).reduce_add();
        if nearest.simd_gt(f32x4::splat(worst)).any() {
            for (k, nearest) in nearest.to_array().into_iter().enumerate() {
                if nearest > worst {
                    (worst, far) = (nearest, samples.len().min(4 * i + k + 1) - 1);
                }
            }
        }
        if loss > max_loss {
            break;
        }
    }
    (loss, far, worst)
}

impl SampledError {
    /// Distributes the samples of the first of two vertices at one position to both, each to the nearer
    /// star.
    pub(super) fn split(&mut self, origins: [VertexId; 2], stars: &[Star; 2]) {
        let first = self.set_of[origins[0].index()] as usize;
        let mut sets = [SampleSet::default(), SampleSet::default()];
        for s in std::mem::take(&mut self.sets[first].samples) {
            let [a, b] = [0, 1].map(|i| measure(&[s], &stars[i], f32::INFINITY).0);
            sets[usize::from(b < a)].samples.push(s);
        }
        for (set, star) in sets.iter_mut().zip(stars) {
            set.loss = measure(&set.samples, star, f32::INFINITY).0;
        }
        let [own, other] = sets;
        self.sets[first] = own;
        let length = self.set_of.len().max(origins[1].index() + 1);
        self.set_of.resize(length, u32::MAX);
        self.set_of[origins[1].index()] = self.sets.len() as u32;
        self.sets.push(other);
    }

    /// Returns an error unless each live vertex, given by number in the ordered input, has a sample set of
    /// its own.
    pub(super) fn check(&self, living: impl Iterator<Item = VertexId>) -> Result<(), String> {
        let mut owners = vec![u32::MAX; self.sets.len()];
        for origin in living {
            let set = self.set_of.get(origin.index()).map_or(usize::MAX, |set| *set as usize);
            let Some(owner) = owners.get_mut(set) else {
                return Err(format!("number {origin} has sample set {set} of {}", self.sets.len()));
            };
            let other = std::mem::replace(owner, origin.0);
            need(other == u32::MAX, || format!("numbers {other} and {origin} share one sample set"))?;
            let loss = self.sets[set].loss;
            need(loss >= 0.0, || format!("the sample set of number {origin} has lost {loss}"))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the star of the origin with four triangles in the plane z = 0, up to a square of side 2.
    fn square() -> Star {
        let rim = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
        let mut star = Star::default();
        star.set(Vec3::ZERO, (0..4).map(|i| [i, (i + 1) % 4].map(|k| (VertexId(k as u32), rim[k]))));
        star
    }

    fn sample(x: f32, z: f32, weight: f32) -> Sample {
        Sample { p: Vec3::new(x, 0.0, z), weight }
    }

    #[test]
    fn extreme_targets_are_small_or_far_below_the_input() {
        assert!(is_extreme(599, 1000) && !is_extreme(600, 1000));
        assert!(is_extreme(600, 12_001) && !is_extreme(600, 12_000));
        assert_eq!(
            [(1_000_000, false), (1_000_000, true), (10_000, true)].map(|(n, a)| start_faces(n, a)),
            [2000, 2000, 1500]
        );
        // A tenth of 5,990 faces is an extreme target, a tenth of 6,000 is not.
        assert_eq!([5_990, 6_000, 160_000].map(start_faces_of_record), [2000, 750, 2000]);
    }

    #[test]
    fn the_loss_is_the_weighted_sum_of_squared_distances() {
        // Above the square, below it, and one unit beside it: five samples make two groups of four.
        let samples = [
            sample(0.0, 0.5, 1.0),
            sample(0.5, -1.0, 2.0),
            sample(2.0, 0.0, 4.0),
            sample(0.3, 0.0, 9.0),
            sample(0.0, 2.0, 0.25),
        ];
        let (loss, farthest, worst) = measure(&samples, &square(), f32::INFINITY);
        assert!((loss - (0.25 + 2.0 + 4.0 + 1.0)).abs() < 1e-5, "{loss}");
        assert_eq!((farthest, worst), (4, 4.0));
        // Beyond the limit no further group is measured.
        let (loss, farthest, worst) = measure(&samples, &square(), 6.0);
        assert!((loss - 6.25).abs() < 1e-5, "{loss}");
        assert_eq!((farthest, worst), (1, 1.0));
        assert_eq!(measure(&[], &square(), 1.0), (0.0, 0, 0.0));
    }

    #[test]
    fn samples_are_split_between_the_nearer_stars() {
        // The second star is the square, the first lies two units above it.
        let (mut above, here) = (Star::default(), square());
        let rim = [Vec3::new(1.0, 1.0, 2.0), Vec3::new(-1.0, 1.0, 2.0), Vec3::new(0.0, -1.0, 2.0)];
        above.set(
            Vec3::new(0.0, 0.0, 2.0),
            (0..3).map(|i| [i, (i + 1) % 3].map(|k| (VertexId(k as u32), rim[k]))),
        );
        let samples = vec![sample(0.0, 0.5, 1.0), sample(0.0, 1.5, 3.0), sample(0.0, 1.0, 5.0)];
        let mut all = SampledError { set_of: vec![0], sets: vec![SampleSet { samples, loss: 0.0 }] };
        all.split([VertexId(0), VertexId(3)], &[above, here]);
        assert_eq!(all.set_of, [0, u32::MAX, u32::MAX, 1]);
        // The one in the middle stays with the first.
        let weights = all.sets.iter().map(|set| set.samples.iter().map(|s| s.weight).collect::<Vec<_>>());
        assert_eq!(weights.collect::<Vec<_>>(), [vec![3.0, 5.0], vec![1.0]]);
        let losses = [all.sets[0].loss, all.sets[1].loss];
        assert!((losses[0] - 5.75).abs() < 1e-5 && (losses[1] - 0.25).abs() < 1e-5, "{losses:?}");
        assert_eq!(all.check([VertexId(0), VertexId(3)].into_iter()), Ok(()));
        // The error names vertices without a set of their own.
        let two = all.check([VertexId(0), VertexId(0)].into_iter()).expect_err("one set for two");
        assert!(two.contains("share one sample set"), "{two}");
        let none = all.check([VertexId(1)].into_iter()).expect_err("no set");
        assert!(none.contains("of 2"), "{none}");
    }
}
