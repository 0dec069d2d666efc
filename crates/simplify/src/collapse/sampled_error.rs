//! Sampled error: the last phase at extreme targets, in which the cost of a collapse includes its true
//! error.
//!
//! A cost without memory forgets how far a tip has already moved, so a limb can shrink away cheaply, step
//! by step. When few triangles are left, every vertex carries samples of the original surface that was
//! merged into it, and the cost of a collapse includes the growth of their distances to the surface.
//! (docs/decisions/0007)

use glam::Vec3;
use lodsmith_core::VertexId;

use super::samples::{Sample, SampleScratch, SampleSet, SampledCost, SampledError, measure};
use super::star::Star;
use super::wings::Wing;
use super::{LiveMesh, Scratch, Tally};
use crate::cost;
use crate::metric::Metric;

/// Maximum mean number of samples per vertex when the phase begins.
const SAMPLES_PER_VERTEX: usize = 32;
/// Number of samples above which a vertex keeps every second one, and the farthest.
const MAX_SAMPLES: usize = 96;
/// Maximum number of faces round a merged vertex for which samples are measured. (Guessed: no vertex of a
/// model has more, except hubs of fans or books.)
const MAX_MEASURED_STAR: usize = 512;

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
            true => measure(merged, star, cost::loss_limit(cost, before, most)),
            false => (before, 0, 0.0),
        };
        let cost = cost::with_samples(cost, [before, loss], self.cost.area, worst);
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
