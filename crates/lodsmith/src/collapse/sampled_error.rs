//! Sampled error: the last phase at extreme targets, in which the cost of a collapse includes its true
//! error.
//!
//! A cost without memory forgets how far a tip has already moved, so a limb can shrink away cheaply, step
//! by step. When few triangles are left, every vertex has samples of the original surface that was merged
//! into it, and the cost of a collapse includes the growth of their distances to the surface.
//! (docs/decisions/0007)

use glam::Vec3;
use lodsmith_core::VertexId;

use super::samples::{Sample, SampleScratch, SampleSet, SampledCost, SampledError, measure};
use super::star::Star;
use super::wings::Wing;
use super::{LiveMesh, Scratch, Tally};
use crate::cost;
use crate::cost::metric::Metric;

/// Maximum mean number of samples per vertex when the phase starts.
const SAMPLES_PER_VERTEX: usize = 32;
/// Number of samples above which a vertex keeps every second one, and the farthest.
const MAX_SAMPLES: usize = 96;
/// Maximum number of faces around a merged vertex for which samples are measured. The work of such a vertex is cubic in
/// it. (Measured: books of 250 and 500 pages take 0.03 and 0.1 s, with 512 faces 1 and 4 s, and outputs of models that
/// are no books stay the same.)
const MAX_MEASURED_STAR: usize = 128;

impl<M: Metric> LiveMesh<M> {
    /// Starts the phase: gives every vertex its samples, which are centres of the original faces (3/4 of
    /// the weight) and vertices.
    pub(crate) fn start_sampling(&mut self, points: &[Vec3], faces: &[[VertexId; 3]]) {
        self.store.compact();
        let home = self.store.homes();
        let count = self.store.v.len().max(1);
        let stride = ((points.len() + faces.len()) / (SAMPLES_PER_VERTEX * count)).max(1);
        // (Room for twice the mean, so that few sets grow.)
        let room = 2 * (points.len() + faces.len()) / (stride * count);
        let empty = || SampleSet { samples: Vec::with_capacity(room), loss: 0.0 };
        let mut bags: Vec<SampleSet> = std::iter::repeat_with(empty).take(self.store.v.len()).collect();
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
    /// cost exceeds `max_cost`.
    pub(super) fn sampled_cost(
        &self,
        late: &SampledError,
        origins: [VertexId; 2],
        at: Vec3,
        [cost, max_cost]: [f32; 2],
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> SampledCost {
        let [u, v] = origins.map(|x| &late.sets[late.set_of[x.index()] as usize]);
        let (wings, SampleScratch { merged, star }) = (&scratch.wings, &mut scratch.samples);
        // (Samples times faces: too expensive around a hub with a thousand faces, where no sampled cost is
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
            true => measure(merged, star, cost::loss_limit(cost, before, max_cost)),
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
        // The merged vertex may get either number later.
        late.set_of[removed.index()] = u as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapse::Engine;
    use crate::collapse::candidate::CollapseOutcome;
    use crate::collapse::test_support::{assert_near, checked, cost_at, engine_of, try_at, without_lines};
    use crate::cost::metric::Memoryless;
    use crate::test_support::sheet;

    /// Returns an engine of a flat sheet of 5 × 5 cells whose input lay this much above it.
    fn sampled(height: f32) -> Engine<Memoryless> {
        let small = sheet(5);
        let mut engine = engine_of(Memoryless, &small, &without_lines());
        let points: Vec<Vec3> = small.points.iter().map(|p| *p + Vec3::Z * height).collect();
        engine.mesh.start_sampling(&points, &small.triangles());
        engine
    }

    fn sets(engine: &Engine<Memoryless>) -> &[SampleSet] {
        &engine.mesh.sampled.as_ref().expect("the phase has started").sets
    }

    fn weight(samples: &[Sample]) -> f32 {
        samples.iter().map(|s| s.weight).sum()
    }

    #[test]
    fn every_vertex_has_its_share_of_the_surface() {
        let engine = sampled(0.5);
        let all = sets(&engine);
        assert_eq!(all.len(), 36);
        // 50 centres with 3/4 of the doubled area 50, and 36 vertices with the rest.
        assert_eq!(all.iter().map(|set| set.samples.len()).sum::<usize>(), 50 + 36);
        let whole: f32 = all.iter().map(|set| weight(&set.samples)).sum();
        assert_near(whole, 50.0);
        // Vertex 0 comes first in two faces, and has itself; the last vertex comes first in no face.
        assert_near(weight(&all[14].samples), 2.0 * 0.75 + 12.5 / 36.0);
        assert_near(weight(&all[35].samples), 12.5 / 36.0);
        // All lie half a unit above the star of their vertex.
        for set in all {
            assert_near(set.loss, 0.25 * weight(&set.samples));
        }
        assert_eq!(checked(&engine), Ok(()));
    }

    #[test]
    fn samples_on_the_surface_have_no_loss() {
        let engine = sampled(0.0);
        assert!(sets(&engine).iter().all(|set| set.loss < 1e-12));
    }

    #[test]
    fn the_cost_grows_with_the_loss_and_with_the_farthest_sample() {
        // A flat collapse moves no sample nearer or farther: the remaining cost is .7 times the mean doubled
        // area times the squared distance.
        let mut engine = sampled(0.5);
        assert_near(cost_at(&mut engine, [14, 15], Vec3::X * 0.5).unwrap(), 0.7 * 0.25);
        // On the surface there is no cost.
        let mut engine = sampled(0.0);
        assert!(cost_at(&mut engine, [14, 15], Vec3::X * 0.5).unwrap() < 1e-9);
        // If the vertex is lifted off it, the distances of both ends' samples to the new star count: one
        // sample of the kept end and three face centres of the other.
        let flat = cost_at(&mut engine, [14, 15], Vec3::X * 0.5).unwrap();
        let lifted = cost_at(&mut engine, [14, 15], Vec3::new(0.5, 0.0, 0.25)).unwrap();
        let plain = {
            let samples = engine.mesh.sampled.take();
            // (Without the largest distance, which the samples replace.)
            engine.mesh.cost.area = 0.0;
            let cost = cost_at(&mut engine, [14, 15], Vec3::new(0.5, 0.0, 0.25)).unwrap();
            (engine.mesh.sampled, engine.mesh.cost.area) = (samples, 1.0);
            cost
        };
        let mut star = Star::default();
        let rim = [13u32, 7, 8, 9, 16, 22, 21, 20].map(|w| (VertexId(w), engine.mesh.store.p(VertexId(w))));
        star.set(Vec3::new(2.5, 2.0, 0.25), (0..8).map(|i| [rim[i], rim[(i + 1) % 8]]));
        let merged: Vec<Sample> =
            [14, 15].iter().flat_map(|&u: &usize| sets(&engine)[u].samples.clone()).collect();
        let (loss, _, worst) = measure(&merged, &star, f32::INFINITY);
        assert!(loss > 0.01 && worst > 0.01 && flat < lifted);
        assert_near(lifted, plain + 4.0 * loss + 0.7 * worst);
    }

    #[test]
    fn the_merged_vertex_gets_the_samples_of_both() {
        let mut engine = sampled(0.5);
        let before: usize = [14, 15].iter().map(|&u: &usize| sets(&engine)[u].samples.len()).sum();
        let outcome = try_at(&mut engine, [14, 15], Vec3::X * 0.5, 1.0);
        assert!(matches!(outcome, CollapseOutcome::Done));
        let late = engine.mesh.sampled.as_ref().expect("the phase has started");
        // Both numbers lead to one set, as the merged vertex may get either number later.
        assert_eq!((late.set_of[14], late.set_of[15]), (14, 14));
        assert_eq!((late.sets[14].samples.len(), late.sets[15].samples.len()), (before, 0));
        assert_near(late.sets[14].loss, 0.25 * weight(&late.sets[14].samples));
        assert_eq!(checked(&engine), Ok(()));
    }

    #[test]
    fn many_samples_are_thinned_and_keep_their_weight_and_the_farthest() {
        let mut engine = sampled(0.5);
        let mut scratch = SampleScratch::default();
        for (count, left) in [(MAX_SAMPLES, MAX_SAMPLES), (MAX_SAMPLES + 2, MAX_SAMPLES / 2 + 2)] {
            scratch.merged = (0..count).map(|i| Sample { p: Vec3::X * i as f32, weight: 1.0 }).collect();
            let charge = SampledCost { cost: 0.0, loss: 7.0, farthest: 10 };
            engine.mesh.hand_over_samples([VertexId(14), VertexId(15)], &charge, &mut scratch);
            let set = &sets(&engine)[14];
            assert_eq!((set.samples.len(), set.loss), (left, 7.0));
            assert!((weight(&set.samples) - count as f32).abs() < 1e-3);
            assert!(set.samples.iter().any(|s| s.p.x == 10.0), "the farthest is gone");
        }
    }
}
