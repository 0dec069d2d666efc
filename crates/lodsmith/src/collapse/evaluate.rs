//! Evaluation of the edges of a vertex: cost, and position of the merged vertex.

use glam::Vec3;
use lodsmith_core::VertexId;
use wide::f32x4;

use super::attributes::Member;
use super::candidate::{Candidate, Found, OwnedEdges};
use super::ring::Ring;
use super::{LiveMesh, Scratch, Tally};
use crate::cost::lanes::{self, dot, splat, sub};
use crate::cost::metric::{CostSource, Form, Metric};
use crate::cost::{self, FourCosts, FourForms, best_place, times};
use crate::options::Placement;

impl<M: Metric> LiveMesh<M> {
    /// Evaluates the edges from `u` to `owned` and adds them to `found`; edges that cost up to `max_cost` are
    /// listed one by one. Returns the number of edges with two ends that may not move.
    #[inline(always)]
    pub(super) fn evaluate_owned(
        &self,
        edges: &OwnedEdges<'_>,
        members: &mut Vec<Member>,
        found: &mut Found,
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> u64 {
        let &OwnedEdges { u, owned, ring: ru, max_cost, have_single_wedges: are_lone } = edges;
        if matches!(self.cost.metric.cost_source(), CostSource::Stars | CostSource::Ends) {
            return self.evaluate_owned_by_metric(edges, found, scratch, tally);
        }
        let mut stuck = 0;
        let is_plain = |w: VertexId| self.store.v[w.index()].kind.is_free();
        let plain = self.cost.metric.is_memoryless()
            && self.constraints.rules.placement != Placement::Midpoint
            && is_plain(u);
        for four in owned.chunks(4) {
            if plain
                && (four.len() > 1 || self.values.attributes.is_some())
                && four.iter().all(|&w| is_plain(w))
            {
                let FourCosts { cost, step, form_cost, solved } =
                    self.evaluate_four(u, four, are_lone || self.have_single_wedges(u, four), ru, members);
                let within = solved & cost.simd_le(f32x4::splat(max_cost));
                let over_limit = (solved ^ within).bitselect(cost, f32x4::splat(f32::INFINITY));
                found.beyond = over_limit.fast_min(found.beyond);
                let (solved, all) = (solved.to_bitmask(), (1 << four.len()) - 1);
                let mut left = (within.to_bitmask() | !solved) & all;
                while left != 0 {
                    let i = left.trailing_zeros() as usize & 3;
                    left &= left - 1;
                    if solved & (1 << i) != 0 {
                        let step = Vec3::from(step.map(|x| x.to_array()[i]));
                        let (cost, form_cost) = (cost.to_array()[i], form_cost.to_array()[i]);
                        found.within.push(Candidate { cost, removed: four[i], step, form_cost });
                    } else if let Some(candidate) = self.evaluate_edge(u, four[i], ru, members) {
                        found.add(candidate, max_cost);
                    }
                }
                continue;
            }
            for &w in four {
                match self.evaluate_edge(u, w, ru, members) {
                    Some(candidate) => found.add(candidate, max_cost),
                    None => stuck += 1,
                }
            }
        }
        stuck
    }

    /// Evaluates up to four edges of free ends side by side with SIMD, with the same results as
    /// [`Self::evaluate_edge`].
    #[inline(always)]
    fn evaluate_four(
        &self,
        u: VertexId,
        ends: &[VertexId],
        are_lone: bool,
        ru: &Ring,
        members: &mut Vec<Member>,
    ) -> FourCosts {
        let x = &self.store.v[u.index()];
        let four = [0, 1, 2, 3].map(|i: usize| ends[i.min(ends.len() - 1)]);
        let (mut s, mut t) = (
            *M::tensor_of(&x.q),
            lanes::side_by_side(four.map(|w| M::tensor_of(&self.store.v[w.index()].q))),
        );
        if !are_lone {
            s = self.reduced_tensor(u);
            t = lanes::side_by_side(four.map(|w| self.reduced_tensor(w)).each_ref());
        }
        let s = s.0.map(f32x4::splat);
        let d = sub(&self.store.four(four), &splat(x.p));
        let mut h = times(&t, &d);
        let mut c = dot(&d, &h);
        let mut a: [f32x4; 6] = std::array::from_fn(|k| s[k] + t[k]);
        if self.values.attributes.is_some() {
            self.add_attributes_to_four((u, ends, are_lone), &d, (&mut a, &mut h, &mut c), ru, members);
        }
        let (forms, has_attributes) = (FourForms { a, h, c }, self.values.attributes.is_some());
        match self.constraints.rules.placement {
            Placement::Endpoint => cost::of_four_ends(&forms, &d, self.peak_weight(), has_attributes),
            _ => cost::of_four(&forms, &d, self.peak_weight(), has_attributes),
        }
    }

    /// Returns the cost of a form at `y`, for edge vector `d`.
    #[inline(always)]
    pub(super) fn cost_of(&self, form: &Form, d: Vec3, y: Vec3) -> f32 {
        match self.cost.metric.is_memoryless() {
            true => cost::of_form(form, d, y, self.peak_weight()),
            false => cost::of_accumulated_form(form, d, y),
        }
    }

    /// Returns the cost of merging `v` into `u` at the position of `u` + `step`.
    pub(crate) fn cost_at(
        &self,
        u: VertexId,
        v: VertexId,
        step: Vec3,
        ru: &Ring,
        members: &mut Vec<Member>,
    ) -> f32 {
        let (form, d) = self.form(u, v, ru, members);
        self.cost_of(&form, d, step)
    }

    /// Returns the form of an edge, including attributes, and the vector to its other end.
    #[inline(always)]
    fn form(&self, u: VertexId, v: VertexId, ru: &Ring, members: &mut Vec<Member>) -> (Form, Vec3) {
        let (x, z) = (&self.store.v[u.index()], &self.store.v[v.index()]);
        let d = z.p - x.p;
        if self.values.attributes.is_none() {
            return (self.cost.metric.form(&x.q, &z.q, d), d);
        }
        let (mut own, mut other) = (x.q, z.q);
        *M::tensor(&mut own) = self.reduced_tensor(u);
        *M::tensor(&mut other) = self.reduced_tensor(v);
        let mut form = self.cost.metric.form(&own, &other, d);
        self.add_attributes(u, v, d, ru, members, &mut form);
        (form, d)
    }

    /// Returns the cost of the collapse of u and v and the best position of the merged vertex relative to
    /// u; `None` if neither end may move.
    #[inline(never)]
    fn evaluate_edge(
        &self,
        u: VertexId,
        v: VertexId,
        ru: &Ring,
        members: &mut Vec<Member>,
    ) -> Option<Candidate> {
        let (x, z) = (&self.store.v[u.index()], &self.store.v[v.index()]);
        let (form, d) = self.form(u, v, ru, members);
        let cost = |y: Vec3| self.cost_of(&form, d, y);
        let at = |y: Vec3| Some(Candidate { cost: cost(y), removed: v, step: y, form_cost: 0.0 });
        let ends = || if cost(Vec3::ZERO) <= cost(d) { at(Vec3::ZERO) } else { at(d) };
        if !(x.kind.is_free() && z.kind.is_free()) {
            return match (x.kind, z.kind) {
                (k, l) if k.is_fixed() && l.is_fixed() => None,
                (k, _) if k.is_fixed() => at(Vec3::ZERO),
                (_, l) if l.is_fixed() => at(d),
                // Both ends are on the curve; a point between them would be on its chord.
                (k, l) if k.is_rail() && l.is_rail() => ends(),
                (k, _) if k.is_rail() => at(Vec3::ZERO),
                _ => at(d),
            };
        }
        match self.constraints.rules.placement {
            Placement::Optimal => {}
            Placement::Endpoint => return ends(),
            Placement::Midpoint => return at(d * 0.5),
        }
        if let Some(y) = best_place(&form, d) {
            return at(y);
        }
        let (mid, ends) = (d * 0.5, ends()?);
        if cost(mid) <= ends.cost { at(mid) } else { Some(ends) }
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::arbitrary::{Coordinates, perturbed_shape, soup};
    use lodsmith_core::{TriMesh, shapes};
    use proptest::prelude::*;

    use super::*;
    use crate::collapse::Engine;
    use crate::collapse::kind::Kind;
    use crate::collapse::test_support::{assert_near, engine_of, ring_of, without_lines};
    use crate::cost::PEAK_GUESS;
    use crate::cost::metric::{Memoryless, Quadric};
    use crate::options::{BorderPolicy, SimplifyOptions, Stop};
    use crate::test_support::{SmallMesh, in_two_charts, pyramid, sheet, with_engine};

    /// Compares the costs of four edges side by side with the cost of each alone. Returns the number of
    /// comparisons, and the mismatches.
    fn compared(mesh: &TriMesh, placement: Placement) -> (usize, Vec<String>) {
        let (mut count, mut wrong) = (0, Vec::new());
        let mut options = SimplifyOptions::new(Stop::ratio(0.5));
        options.placement = placement;
        with_engine(Memoryless, mesh, &options, &mut |engine, _| {
            let (mut ring, mut owned, mut members) = (Ring::default(), Vec::new(), Vec::new());
            for u in (0..engine.mesh.store.v.len()).map(VertexId::new) {
                engine.mesh.store.ring(u, &mut ring);
                let Engine { mesh, scratch, tally, .. } = &mut *engine;
                mesh.store.list_owned(u, &ring, &mut owned, &mut scratch.marks);
                let mut found = Found::default();
                found.clear();
                let are_lone = mesh.cache_wedge_reductions(u, &owned);
                let edges = OwnedEdges {
                    u,
                    owned: &owned,
                    ring: &ring,
                    max_cost: f32::INFINITY,
                    have_single_wedges: are_lone,
                };
                let stuck = mesh.evaluate_owned(&edges, &mut members, &mut found, scratch, tally);
                let alone: Vec<Option<Candidate>> =
                    owned.iter().map(|&w| engine.mesh.evaluate_edge(u, w, &ring, &mut members)).collect();
                if stuck as usize != alone.iter().filter(|c| c.is_none()).count() {
                    wrong.push(format!("{u}: {stuck} of {alone:?} are stuck"));
                }
                for of_one in alone.into_iter().flatten() {
                    let (w, mut of_four) = (of_one.removed, found.within.iter());
                    let Some(of_four) = of_four.find(|c| c.removed == w) else {
                        wrong.push(format!("{u}-{w} was not found"));
                        continue;
                    };
                    count += 1;
                    // Differences of squares in single precision: tolerance relative to the subtracted
                    // values, scaled by the distance of the farthest position. The position itself is as
                    // good as its cost, by the form of one edge.
                    let (form, d) = engine.mesh.form(u, w, &ring, &mut members);
                    let peak = 1.0 + PEAK_GUESS * engine.mesh.peak_weight() / form.a.trace().max(1e-37);
                    let within = 1e-4 * of_one.cost + 1e-5 * form.a.trace() * d.length_squared() * peak;
                    let there = engine.mesh.cost_of(&form, d, of_four.step);
                    for (name, cost) in [("cost", of_four.cost), ("cost of the place", there)] {
                        let is_near = (cost - of_one.cost).abs() <= within;
                        if !is_near {
                            wrong.push(format!(
                                "{u}-{w}: {name} {cost} for {} (within {within})",
                                of_one.cost
                            ));
                        }
                    }
                    let is_part = of_four.form_cost <= of_four.cost * 1.001;
                    if !is_part {
                        wrong.push(format!("{u}-{w} costs {} of {}", of_four.form_cost, of_four.cost));
                    }
                }
            }
        });
        (count, wrong)
    }

    #[test]
    fn four_edges_at_once_cost_the_same_as_each_alone() {
        let mut all = 0;
        for (name, mesh) in shapes::all() {
            for (mesh, placement) in [
                (&in_two_charts(&mesh), Placement::Optimal),
                (&mesh, Placement::Optimal),
                (&mesh, Placement::Endpoint),
            ] {
                let (count, wrong) = compared(mesh, placement);
                assert!(wrong.is_empty(), "{name}: {} of {count}: {}", wrong.len(), wrong[0]);
                all += count;
            }
        }
        assert!(all > 10_000, "{all} edges");
    }

    /// Four unit squares in a row along x, bent by a right angle in the middle: the first two lie in the plane z = 0,
    /// the others in the plane x = 2.
    fn bent() -> SmallMesh {
        let mut bent = sheet(4);
        bent.points.iter_mut().filter(|p| p.x > 2.0).for_each(|p| *p = Vec3::new(2.0, p.y, p.x - 2.0));
        bent
    }

    fn edge_at(engine: &Engine<Memoryless>, u: u32, v: u32) -> Option<Candidate> {
        let ring = ring_of(engine, u);
        engine.mesh.evaluate_edge(VertexId(u), VertexId(v), &ring, &mut Vec::new())
    }

    #[test]
    fn the_cost_of_a_form_is_its_planes_and_a_guess_of_the_largest_distance() {
        let h = 0.5f32;
        let engine = engine_of(Memoryless, &pyramid(h), &without_lines());
        let ring = ring_of(&engine, 1);
        let cost = engine.mesh.cost_at(VertexId(1), VertexId(0), Vec3::ZERO, &ring, &mut Vec::new());
        // The apex leaves the planes of two sides with doubled area 2 s, by a distance of 2 h / s. The
        // doubled areas of the two stars add up to 12 s, and a fifth of the mean doubled area is .4 s.
        let s = (1.0 + h * h).sqrt();
        assert_near(cost, 16.0 * h * h / s * (1.0 + PEAK_GUESS * 0.4 / 12.0));
        // With accumulated planes it is the same, without the guess.
        let engine = engine_of(Quadric, &pyramid(h), &without_lines());
        let cost = engine.mesh.cost_at(VertexId(1), VertexId(0), Vec3::ZERO, &ring, &mut Vec::new());
        assert_near(cost, 16.0 * h * h / s);
    }

    #[test]
    fn a_vertex_on_a_bend_stays_on_it() {
        let engine = engine_of(Memoryless, &bent(), &without_lines());
        // 11 and 12 are inner neighbours in the plane z = 0, and 12 is on the bend.
        let found = edge_at(&engine, 11, 12).expect("both are free");
        assert_eq!(found.removed, VertexId(12));
        assert!((found.step - Vec3::X).abs().max_element() < 1e-3, "{}", found.step);
        let back = edge_at(&engine, 12, 11).expect("both are free");
        assert!(back.step.abs().max_element() < 1e-3, "{}", back.step);
        // Along the bend it costs nothing, across it does.
        assert!(found.cost < 1e-4 && edge_at(&engine, 12, 17).unwrap().cost < 1e-6);
        assert!(
            engine.mesh.cost_at(
                VertexId(11),
                VertexId(12),
                Vec3::ZERO,
                &ring_of(&engine, 11),
                &mut Vec::new()
            ) > 0.1
        );
    }

    #[test]
    fn flat_edges_collapse_to_their_midpoint() {
        let engine = engine_of(Memoryless, &sheet(5), &without_lines());
        let found = edge_at(&engine, 14, 15).expect("both are free");
        assert_eq!(found.step, Vec3::X * 0.5);
        assert_near(found.cost, 0.5 * crate::cost::TIE * 12.0 * 0.5);
    }

    #[test]
    fn ends_that_may_not_move_determine_the_position() {
        let d = Vec3::X;
        let mut engine = engine_of(Memoryless, &sheet(5), &without_lines());
        let free = engine.mesh.store.v[14].kind;
        let fixed = free.locked(true);
        let rail = Kind::of(&ring_of(&engine, 1), BorderPolicy::Slide);
        assert!(rail.is_rail() && !rail.is_fixed() && fixed.is_fixed() && free.is_free());
        let mut step_of = |own, other| {
            (engine.mesh.store.v[14].kind, engine.mesh.store.v[15].kind) = (own, other);
            edge_at(&engine, 14, 15).map(|found| found.step)
        };
        assert_eq!(step_of(fixed, fixed), None);
        assert_eq!(step_of(fixed, free), Some(Vec3::ZERO));
        assert_eq!(step_of(free, fixed), Some(d));
        assert_eq!(step_of(fixed, rail), Some(Vec3::ZERO));
        assert_eq!(step_of(rail, fixed), Some(d));
        assert_eq!(step_of(rail, free), Some(Vec3::ZERO));
        assert_eq!(step_of(free, rail), Some(d));
        // If both ends are on a line: at one of them, the kept one if they cost the same.
        assert_eq!(step_of(rail, rail), Some(Vec3::ZERO));
        assert_eq!(step_of(free, free), Some(d * 0.5));
    }

    #[test]
    fn placements_are_at_an_end_or_at_the_midpoint() {
        let mut engine = engine_of(Memoryless, &bent(), &without_lines());
        engine.mesh.constraints.rules.placement = Placement::Endpoint;
        // 12 is on the bend, 11 is not.
        assert_eq!(edge_at(&engine, 11, 12).unwrap().step, Vec3::X);
        assert_eq!(edge_at(&engine, 12, 11).unwrap().step, Vec3::ZERO);
        engine.mesh.constraints.rules.placement = Placement::Midpoint;
        assert_eq!(edge_at(&engine, 11, 12).unwrap().step, Vec3::X * 0.5);
        assert_eq!(edge_at(&engine, 12, 11).unwrap().step, Vec3::X * -0.5);
    }

    #[test]
    fn edges_above_the_limit_are_not_listed_but_set_the_bound() {
        let list = |placement: Placement, max_cost: f32| {
            let mut engine = engine_of(Memoryless, &bent(), &without_lines());
            engine.mesh.constraints.rules.placement = placement;
            let Engine { mesh, scratch, tally, .. } = &mut engine;
            let u = VertexId(11);
            let mut ring = Ring::default();
            mesh.store.ring(u, &mut ring);
            let mut owned = Vec::new();
            mesh.store.list_owned(u, &ring, &mut owned, &mut scratch.marks);
            owned.sort_unstable();
            // Of six neighbours, the vertex owns the edges to the three higher ones: 12 and 17 on the bend,
            // 16 in the plane.
            assert_eq!(owned, [12, 16, 17].map(VertexId));
            let mut found = Found::default();
            found.clear();
            let edges = OwnedEdges { u, owned: &owned, ring: &ring, max_cost, have_single_wedges: true };
            let stuck = mesh.evaluate_owned(&edges, &mut Vec::new(), &mut found, scratch, tally);
            assert_eq!(stuck, 0);
            found
        };
        for placement in [Placement::Optimal, Placement::Midpoint] {
            let all = list(placement, f32::INFINITY);
            assert_eq!((all.within.len(), all.beyond()), (3, f32::INFINITY));
            let least = all.within.iter().map(|c| c.cost).fold(f32::INFINITY, f32::min);
            let none = list(placement, 0.5 * least);
            assert_eq!((none.within.len(), none.beyond()), (0, least));
        }
        // At the midpoint only the edge in the plane is cheap: the others are half a unit from a plane of
        // three faces.
        let some = list(Placement::Midpoint, 1e-6);
        assert_eq!(some.within.iter().map(|c| c.removed.0).collect::<Vec<_>>(), [16]);
        // Times the guess of the largest distance: four times a fifth, over the trace, which is 12.
        assert_near(some.beyond(), 3.0 * 0.25 * (1.0 + PEAK_GUESS * 0.2 / 12.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(48) })]

        #[test]
        fn four_edges_of_any_mesh_cost_the_same_as_each_alone(
            mesh in prop_oneof![perturbed_shape(0.02), perturbed_shape(0.5), soup(40, Coordinates::Tame)],
            has_charts in any::<bool>(),
        ) {
            let has_charts = has_charts && mesh.face_count() > 0;
            let mesh = if has_charts { in_two_charts(&mesh) } else { mesh };
            let (_, wrong) = compared(&mesh, Placement::Optimal);
            prop_assert!(wrong.is_empty(), "{}: {}", wrong.len(), wrong[0]);
        }
    }
}
