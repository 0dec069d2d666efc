//! Samples of the input at the vertices, and when the phase that uses them begins.

use glam::Vec3;
use lodsmith_core::VertexId;
use wide::f32x4;

use super::invariants::need;
use super::star::Star;

/// Live triangles below which the phase begins.
const START_FACES: usize = 2000;
/// Share of the input below which the phase begins if attributes count. (Measured against 2,000: on ten
/// models at 50 to 10 % RMS 0.2 % lower, normals 3 %, textures 4 %; at 5 to 1 % 5 %, 7 % and 6 %.)
const START_SHARE: f64 = 0.15;
/// Targets below this number of faces are extreme.
const EXTREME_FACES: usize = 600;
/// Targets smaller than the input by this factor are extreme.
const EXTREME_REDUCTION: usize = 20;
/// Share of the bounds per sweep in this phase. (Measured: 0.1 to 0.3 are equal within noise, 0.2 takes a
/// sixth less time than 0.1.)
pub(crate) const LATE_QUANTILE: f64 = 0.2;

/// True if a target is extreme for a mesh of `faces` faces.
pub(crate) fn is_extreme(target: usize, faces: usize) -> bool {
    target < EXTREME_FACES || target.saturating_mul(EXTREME_REDUCTION) < faces
}

/// Returns the number of live triangles below which the phase begins in a recorded run, which has extreme
/// and other levels. If a tenth of the input is no extreme target, the phase begins below that: otherwise
/// that level would lose what lower ones gain. (Measured: fandisk at 10 % has 1.07 times the RMS of a
/// single run from 2,000 on, 1.02 from 1,600.)
pub(crate) fn start_faces_of_record(faces: usize) -> usize {
    if is_extreme(faces / 10, faces) { START_FACES } else { START_FACES.min(faces / 8) }
}

/// Returns the number of live triangles below which the phase begins in a run to one target.
pub(crate) fn start_faces(faces: usize, with_attributes: bool) -> usize {
    if with_attributes { START_FACES.min((faces as f64 * START_SHARE) as usize) } else { START_FACES }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) p: Vec3,
    /// Area that it represents.
    pub(super) weight: f32,
}

/// Samples that one live vertex carries.
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
/// Stops once the loss exceeds `most`.
pub(super) fn measure(samples: &[Sample], star: &Star, most: f32) -> (f32, usize, f32) {
    let (mut loss, mut worst, mut far) = (0f32, 0f32, 0);
    for (i, four) in samples.chunks(4).enumerate() {
        // An unused lane repeats the last sample with weight 0.
        let lane = |k: usize| four[k.min(four.len() - 1)].p;
        let axis = |j: usize| f32x4::new([lane(0)[j], lane(1)[j], lane(2)[j], lane(3)[j]]);
        let weight = |k: usize| four.get(k).map_or(0.0, |s| s.weight);
        let nearest = star.distance_sq([axis(0), axis(1), axis(2)]);
        loss += (nearest * f32x4::new([weight(0), weight(1), weight(2), weight(3)])).reduce_add();
        for (k, nearest) in nearest.to_array().into_iter().enumerate() {
            if nearest > worst {
                (worst, far) = (nearest, 4 * i + k.min(four.len() - 1));
            }
        }
        if loss > most {
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
            need(other == u32::MAX, || format!("numbers {other} and {origin} have one sample set"))?;
            let loss = self.sets[set].loss;
            need(loss >= 0.0, || format!("the sample set of number {origin} has lost {loss}"))?;
        }
        Ok(())
    }
}
