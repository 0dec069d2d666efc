//! Debug checks: verify every invariant of the engine's data after each sweep, so that a fault is found in
//! the sweep that caused it.
//!
//! Data that may be stale on purpose, because nothing reads it or an update costs more than it gains:
//! - a vertex stays irregular, or on a seam, after the reason has gone: only a change on a non-manifold
//!   curve, a cut and a pair contraction recompute kinds. The reverse is a fault, because regular stars skip
//!   tests;
//! - lines of seams keep the weight that they had when the tensor was computed, though wedges are merged
//!   and hard seams become soft;
//! - the tensor of a metric with memory includes removed planes, so there is nothing to compare it with.

use glam::Vec3;
use lodsmith_core::VertexId;

use super::invariants::{Checks, need};
use super::order::NONE;
use super::ring::Ring;
use super::{Engine, LiveMesh};
use crate::collapse::ordered_input::OriginalInput;
use crate::cost::metric::Metric;

/// Tolerance between an incrementally updated tensor and the recomputed one, as a share of its trace.
/// (Measured on the shapes and soups of the tests: up to 4e-6; gradients on thin faces add to that.)
const DRIFT_TOLERANCE: f32 = 1e-3;
/// Tolerance as a share of the largest tensor or squared edge so far: large values that are subtracted
/// again leave rounding errors of single precision behind, 6e-8 of the value for each change.
const ROUNDING_TOLERANCE: f32 = 1e-5;
/// Doubled area of a thin face, as a share of its longest edge squared. Its normal is rounding noise and
/// differs by corner.
const THIN_AREA_SHARE: f32 = 1e-3;

impl<M: Metric> Engine<M> {
    /// Checks everything if checks are enabled: after each sweep, and after the steps between two sweeps.
    ///
    /// # Panics
    /// If an invariant does not hold, which is a bug.
    pub(super) fn check_if_enabled(&mut self, original: &OriginalInput<'_>) {
        // (Constant outside of tests and debug builds, so the check is compiled out there.)
        if !cfg!(any(test, debug_assertions)) {
            return;
        }
        let Some(mut checks) = self.checks.take() else { return };
        let mut found = self.check(&mut checks);
        if found.is_ok() {
            found = original.visit(|points, faces| self.check_against(points, faces));
        }
        self.checks = Some(checks);
        let why = found.err();
        assert!(why.is_none(), "the engine broke an invariant: {}", why.unwrap_or_default());
    }

    /// Returns an error that names the first broken invariant, if any, of an engine that is ready for a
    /// sweep.
    ///
    /// Cost: O(n log n).
    pub(crate) fn check(&self, checks: &mut Checks) -> Result<(), String> {
        self.mesh.store.check()?;
        self.check_companions()?;
        self.mesh.record_sizes(checks);
        if let Some(attributes) = &self.mesh.values.attributes {
            attributes.check(&self.mesh.store, checks)?;
        }
        let mut ring = Ring::default();
        for u in self.mesh.store.living() {
            self.mesh.store.ring(u, &mut ring);
            self.mesh.check_kind(u, &ring)?;
            if self.mesh.cost.metric.is_memoryless() {
                self.mesh.check_tensor(u, &ring, checks)?;
            }
        }
        Ok(())
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Records the largest sizes so far.
    fn record_sizes(&self, checks: &mut Checks) {
        let traces = self.store.living().map(|u| M::tensor_of(&self.store.v[u.index()].q).trace());
        checks.largest = traces.fold(checks.largest, f32::max);
        for t in self.store.t.iter().filter(|t| t[0] != NONE) {
            let [a, b, c] = t.map(|w| self.store.p(w));
            let edges = [b - a, c - b, a - c].map(Vec3::length_squared);
            let longest = edges.into_iter().fold(0.0, f32::max);
            checks.largest = checks.largest.max(longest);
            checks.has_thin |= (b - a).cross(c - a).length() < THIN_AREA_SHARE * longest;
        }
    }
}

impl<M: Metric> Engine<M> {
    /// Checks that the data next to the store fits it.
    fn check_companions(&self) -> Result<(), String> {
        let numbers = self.mesh.store.merged_into.len();
        if let Some(prices) = &self.mesh.constraints.cost_factors {
            need(prices.len() == numbers, || format!("{numbers} numbers have {} prices", prices.len()))?;
        }
        for (name, cost) in [("spent", self.tally.collapse_cost), ("lost", self.tally.removed_part_cost)] {
            need(cost >= 0.0, || format!("the costs {name} are {cost}"))?;
        }
        if let Some(parts) = &self.mesh.topology.parts {
            self.check_parts(parts)?;
        }
        if let Some(late) = &self.mesh.sampled {
            late.check(self.mesh.store.living().map(|u| self.mesh.store.v[u.index()].origin))?;
        }
        if let Some(pairs) = &self.mesh.topology.pairs {
            pairs.check(&self.mesh.store)?;
        }
        Ok(())
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Checks that a kind matches the current star, apart from marks that may be stale.
    fn check_kind(&self, u: VertexId, ring: &Ring) -> Result<(), String> {
        let (recorded, now) = (self.store.v[u.index()].kind, self.current_kind(u, ring));
        need(recorded == now || recorded == now.with_stale(recorded), || {
            format!("vertex {u} is of {recorded:?}, but its star gives {now:?}")
        })
    }

    /// Checks that the tensor of a memoryless metric matches the current star.
    fn check_tensor(&self, u: VertexId, ring: &Ring, checks: &Checks) -> Result<(), String> {
        let (recorded, now) = (M::tensor_of(&self.store.v[u.index()].q), self.current_tensor(u, ring));
        let within = DRIFT_TOLERANCE * now.trace() + ROUNDING_TOLERANCE * checks.largest;
        // Attribute tensors of thin faces are mostly rounding noise.
        if !within.is_finite() || checks.has_thin && self.counts_attributes() {
            return Ok(());
        }
        if self.store.v[u.index()].kind.is_seam() {
            // Lines of unknown weight add to the planes, and subtract nothing.
            let planes = self.current_planes(u, ring);
            let least = recorded.less(&planes).0[..3].iter().fold(f32::INFINITY, |least, x| least.min(*x));
            return need(least >= -within, || {
                format!("vertex {u} on a seam has {recorded:?}, less than its planes {planes:?}")
            });
        }
        let most = recorded.less(&now).0.into_iter().fold(0f32, |most, x| most.max(x.abs()));
        need(most <= within, || {
            format!("vertex {u} has {recorded:?}, its star {now:?} (tolerance {within:e})")
        })
    }
}

impl<M: Metric> Engine<M> {
    /// Checks that a vertex that did not move is at the position of the input vertex of its number; and, as
    /// long as no part was removed, that each input vertex used by a face was merged into a live one.
    fn check_against(&self, points: &[Vec3], faces: &[[VertexId; 3]]) -> Result<(), String> {
        for u in self.mesh.store.living() {
            let x = &self.mesh.store.v[u.index()];
            let place = self.mesh.store.place_of(x.origin);
            if !x.kind.is_moved() {
                let given = points.get(place.index()).copied();
                need(given == Some(x.p), || {
                    format!("vertex {u} has not moved and is at {}, number {place} at {given:?}", x.p)
                })?;
            }
        }
        if self.tally.parts_removed > 0 || self.tally.pairs_contracted > 0 {
            return Ok(());
        }
        let mut homes = vec![NONE; self.mesh.store.merged_into.len()];
        self.mesh.store.living().for_each(|u| homes[self.mesh.store.v[u.index()].origin.index()] = u);
        for &w in faces.as_flattened() {
            let mut root = w;
            while self.mesh.store.merged_into[root.index()] != root {
                root = self.mesh.store.merged_into[root.index()];
            }
            need(homes[root.index()] != NONE, || format!("number {w} became {root}, which is not live"))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;
    use crate::collapse::StopReason;
    use crate::collapse::invariants::CHECKED_BELOW;
    use crate::control::NoControl;
    use crate::cost::metric::Memoryless;
    use crate::cost::tensor::Tensor;
    use crate::options::{SimplifyOptions, Stop};
    use crate::test_support::{in_two_charts, with_engine};

    #[test]
    fn each_broken_invariant_is_reported() {
        type Breaks = fn(&mut Engine<Memoryless>, VertexId);
        // For a vertex on the seam, and for one that is not.
        let cases: [(bool, Breaks, &str); 9] = [
            (
                true,
                |e, u| e.mesh.store.v[u.index()].kind = e.mesh.store.v[u.index()].kind.on_seam(false),
                "is of Kind",
            ),
            (
                false,
                |e, u| e.mesh.store.v[u.index()].q.0[0] += 0.01 * e.mesh.store.v[u.index()].q.trace(),
                "its star Tensor",
            ),
            (true, |e, u| e.mesh.store.v[u.index()].q = Tensor::default(), "less than its planes"),
            (false, |e, u| e.mesh.constraints.cost_factors = Some(vec![1.0; u.index()]), "numbers have"),
            (false, |e, _| e.tally.collapse_cost = -1.0, "the costs spent are -1"),
            (
                false,
                |e, u| e.mesh.store.first_wedge[u.index()] = e.mesh.store.first_wedge[0],
                "is in the chains of",
            ),
            (true, |e, u| first_head(e, u).faces += 1, "its head records"),
            (true, |e, u| first_head(e, u).area *= 1.1, "its head records"),
            (true, |e, u| first_head(e, u).next = lodsmith_core::WedgeId(u32::MAX), "in no chain"),
        ];
        let mesh = in_two_charts(&shapes::torus(24, 12));
        with_engine(Memoryless, &mesh, &SimplifyOptions::new(Stop::ratio(0.5)), &mut |engine, _| {
            assert_eq!(engine.check(&mut Checks::default()), Ok(()));
            for (on_seam, breaks, wanted) in cases {
                let mut broken = engine.clone();
                let is_wanted =
                    |u: &VertexId| u.0 > 0 && broken.mesh.store.v[u.index()].kind.is_seam() == on_seam;
                let u = broken.mesh.store.living().find(is_wanted).expect("there is one");
                breaks(&mut broken, u);
                let why = broken.check(&mut Checks::default()).expect_err(wanted);
                assert!(why.contains(wanted), "{why}; not: {wanted}");
            }
        });
    }

    /// Returns the head of the first wedge of a vertex.
    fn first_head(engine: &mut Engine<Memoryless>, u: VertexId) -> &mut crate::collapse::attributes::Head {
        let first = engine.mesh.store.first_wedge[u.index()];
        &mut engine.mesh.values.attributes.as_mut().expect("there are some").heads[first.index()]
    }

    #[test]
    fn a_vertex_that_moved_without_a_mark_is_reported() {
        let mesh = shapes::torus(24, 12);
        with_engine(Memoryless, &mesh, &SimplifyOptions::new(Stop::ratio(0.5)), &mut |engine, run| {
            let source = OriginalInput { surface: &run.input.surface, ordered: run.ordered, is_kept: true };
            let points: Vec<Vec3> = engine.mesh.store.v.iter().map(|x| x.p).collect();
            let result = source.visit(|points, faces| engine.check_against(points, faces));
            assert_eq!(result, Ok(()));
            engine.mesh.store.v[3].p.x += 1e-6;
            let faces = engine.mesh.store.t.clone();
            let why = engine.check_against(&points, &faces).expect_err("vertex 3 moved");
            assert!(why.contains("vertex 3 has not moved"), "{why}");
        });
    }

    #[test]
    fn meshes_of_any_size_are_checked_on_request() {
        let mesh = in_two_charts(&shapes::blob(4, 3));
        assert!(mesh.face_count() >= CHECKED_BELOW);
        with_engine(Memoryless, &mesh, &SimplifyOptions::new(Stop::faces(300)), &mut |engine, run| {
            assert!(engine.checks.is_none());
            engine.checks = Some(Checks::default());
            let source = OriginalInput { surface: &run.input.surface, ordered: run.ordered, is_kept: true };
            assert_eq!(engine.sweep(&run.goal, &source, &mut NoControl), StopReason::Goal);
            assert!(engine.checks.as_ref().is_some_and(|c| c.largest > 0.0));
        });
    }
}
