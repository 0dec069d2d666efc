//! Sampled error: the last phase at extreme targets, in which the cost of a collapse includes its true
//! error.
//!
//! A cost without memory forgets how far a tip has already moved, so a limb can shrink away cheaply, step
//! by step. When few triangles are left, every vertex carries samples of the original surface that was
//! merged into it, and the cost of a collapse includes the growth of their distances to the surface.
//! (docs/decisions/0007)

use glam::Vec3;
use lodsmith_core::VertexId;
use wide::f32x4;

use super::check::need;
use super::star::Star;
use super::wings::Wing;
use super::{LiveMesh, Scratch, Tally};
use crate::metric::Metric;

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
/// Maximum mean number of samples per vertex when the phase begins.
const SAMPLES_PER_VERTEX: usize = 32;
/// Number of samples above which a vertex keeps every second one, and the farthest.
const MAX_SAMPLES: usize = 96;
/// Maximum number of faces round a merged vertex for which samples are measured. (Guessed: no vertex of a
/// model has more, except hubs of fans or books.)
const MAX_MEASURED_STAR: usize = 512;
/// Weight of the loss. (6 would make it count like area · height², whose integral is a sixth; 3 to 6 are
/// equal.)
const LOSS_WEIGHT: f32 = 4.0;

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

/// Weight of the farthest sample's squared distance, times the mean area of a triangle. (Measured with the
/// samples: at this value, the largest distances of cow, bunny and brain588k at 100 faces and of horse and
/// fandisk at 1 % are all below the best rival's; at 0.4 to 0.7 means stay within noise.)
const FARTHEST_WEIGHT: f32 = 0.7;

#[derive(Clone, Copy, Debug)]
struct Sample {
    p: Vec3,
    /// Area that it represents.
    weight: f32,
}

/// Samples that one live vertex carries.
#[derive(Clone, Debug, Default)]
struct SampleSet {
    samples: Vec<Sample>,
    /// Sum of weight · squared distance to the star, as last measured.
    loss: f32,
}

/// The sample sets, by number in the ordered input of their vertex.
#[derive(Clone)]
pub(crate) struct SampledError {
    set_of: Vec<u32>,
    sets: Vec<SampleSet>,
}

/// Scratch buffers of a sampled cost.
#[derive(Clone, Default)]
pub(super) struct SampleScratch {
    /// Samples of both ends.
    merged: Vec<Sample>,
    /// Star of the merged vertex.
    star: Star,
}

/// Cost of a merger including the growth of the sampled error.
pub(super) struct SampledCost {
    pub(super) cost: f32,
    /// Loss of all samples of the merged vertex.
    loss: f32,
    /// The sample farthest from the star.
    farthest: usize,
}

/// Returns the loss of samples against a star, the index of the farthest one, and its squared distance.
/// Stops once the loss exceeds `most`.
fn measure(samples: &[Sample], star: &Star, most: f32) -> (f32, usize, f32) {
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
        let mut bags = [SampleSet::default(), SampleSet::default()];
        for s in std::mem::take(&mut self.sets[first].samples) {
            let [a, b] = [0, 1].map(|i| measure(&[s], &stars[i], f32::INFINITY).0);
            bags[usize::from(b < a)].samples.push(s);
        }
        for (bag, star) in bags.iter_mut().zip(stars) {
            bag.loss = measure(&bag.samples, star, f32::INFINITY).0;
        }
        let [own, other] = bags;
        self.sets[first] = own;
        let length = self.set_of.len().max(origins[1].index() + 1);
        self.set_of.resize(length, u32::MAX);
        self.set_of[origins[1].index()] = self.sets.len() as u32;
        self.sets.push(other);
    }
}

impl SampledError {
    /// Returns an error unless each live vertex, given by number in the ordered input, has a sample set of
    /// its own.
    pub(super) fn check(&self, living: impl Iterator<Item = VertexId>) -> Result<(), String> {
        let mut owners = vec![u32::MAX; self.sets.len()];
        for origin in living {
            let bag = self.set_of.get(origin.index()).map_or(usize::MAX, |bag| *bag as usize);
            let Some(owner) = owners.get_mut(bag) else {
                return Err(format!("number {origin} has bag {bag} of {}", self.sets.len()));
            };
            let other = std::mem::replace(owner, origin.0);
            need(other == u32::MAX, || format!("numbers {other} and {origin} have one bag"))?;
            let loss = self.sets[bag].loss;
            need(loss >= 0.0, || format!("the bag of number {origin} has lost {loss}"))?;
        }
        Ok(())
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Starts the phase: gives every vertex its samples, which are centres of the original faces (3/4 of
    /// the weight) and vertices.
    pub(crate) fn start_sampling(&mut self, points: &[Vec3], faces: &[[VertexId; 3]]) {
        self.store.compact();
        let home = self.store.homes();
        let mut bags = vec![SampleSet::default(); self.store.v.len()];
        let stride = ((points.len() + faces.len()) / (SAMPLES_PER_VERTEX * self.store.v.len()).max(1)).max(1);
        let mut sum = 0.0;
        for t in faces.iter().step_by(stride) {
            let [a, b, c] = t.map(|w| points[w.index()]);
            let area = (b - a).cross(c - a).length() * stride as f32;
            sum += area;
            if let Some(bag) = bags.get_mut(home[t[0].index()].index()) {
                bag.samples.push(Sample { p: (a + b + c) / 3.0, weight: 0.75 * area });
            }
        }
        let weight = 0.25 * sum / points.len().div_ceil(stride) as f32;
        for i in (0..points.len()).step_by(stride) {
            if let Some(bag) = bags.get_mut(home[i].index()) {
                bag.samples.push(Sample { p: points[i], weight });
            }
        }
        let mut ring = super::Ring::default();
        let mut star = Star::default();
        for (u, bag) in bags.iter_mut().enumerate() {
            let u = VertexId(u as u32);
            self.store.ring(u, &mut ring);
            star.set(self.store.p(u), ring.iter().map(|r| [r.a, r.b].map(|w| (w, self.store.p(w)))));
            bag.loss = measure(&bag.samples, &star, f32::INFINITY).0;
        }
        let mut bag_of = vec![u32::MAX; self.store.merged_into.len()];
        for (i, x) in self.store.v.iter().enumerate() {
            bag_of[x.origin.index()] = i as u32;
        }
        self.sampled = Some(SampledError { set_of: bag_of, sets: bags });
    }

    /// Adds to a cost the growth of the sampled error when two vertices (by number in the ordered input)
    /// are merged at `at`, with the triangles of the star in the scratch. Samples are measured until the
    /// cost exceeds `most`.
    pub(super) fn sampled_cost(
        &self,
        late: &SampledError,
        origins: [VertexId; 2],
        at: Vec3,
        [cost, most]: [f32; 2],
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> SampledCost {
        let [u, v] = origins.map(|x| &late.sets[late.set_of[x.index()] as usize]);
        let (wings, SampleScratch { merged, star }) = (&scratch.wings, &mut scratch.samples);
        // (Samples times faces: too expensive round a hub of a thousand faces, where no sampled cost is
        // added.)
        let is_measured = 4 * wings.fours().len() <= MAX_MEASURED_STAR;
        if is_measured {
            let rim = |w: Wing| [w.a, w.b].map(|o| (o, self.store.v[o.index()].p));
            star.set(at, wings.iter().filter(|w| !w.both).map(rim));
        }
        merged.clear();
        merged.extend_from_slice(&u.samples);
        merged.extend_from_slice(&v.samples);
        if is_measured {
            tally.faces_visited += (star.len() * merged.len().div_ceil(4)) as u64;
        }
        let before = u.loss + v.loss;
        let (loss, farthest, worst) = match is_measured {
            true => measure(merged, star, before + (most - cost) / LOSS_WEIGHT),
            false => (before, 0, 0.0),
        };
        let cost = cost + LOSS_WEIGHT * (loss - before).max(0.0) + FARTHEST_WEIGHT * self.cost.area * worst;
        SampledCost { cost, loss, farthest }
    }

    /// Gives the merged vertex the samples of both, for which the cost was just computed.
    pub(super) fn hand_over_samples(
        &mut self,
        [kept, removed]: [VertexId; 2],
        charge: &SampledCost,
        SampleScratch { merged, .. }: &mut SampleScratch,
    ) {
        let Some(late) = &mut self.sampled else { return };
        let [u, v] = [kept, removed].map(|x| late.set_of[x.index()] as usize);
        if merged.len() > MAX_SAMPLES {
            let weigh = |samples: &[Sample]| samples.iter().map(|s| s.weight).sum::<f32>();
            let (whole, farthest) = (weigh(merged), merged[charge.farthest]);
            let mut i = 0;
            merged.retain(|_| {
                i += 1;
                i % 2 == 0
            });
            merged.push(farthest);
            let scale = whole / weigh(merged);
            merged.iter_mut().for_each(|s| s.weight *= scale);
        }
        late.sets[v].samples = Vec::new();
        let bag = &mut late.sets[u];
        bag.samples.clear();
        bag.samples.extend_from_slice(merged);
        bag.loss = charge.loss;
        // Either number may be that of the merged vertex later.
        late.set_of[removed.index()] = u as u32;
    }
}
