//! Evaluation of the edges of a vertex: cost, and position of the merged vertex.

use glam::Vec3;
use lodsmith_core::VertexId;
use wide::f32x4;

use super::attributes::Member;
use super::candidate::{Candidate, Found, OwnedEdges};
use super::ring::Ring;
use super::{LiveMesh, Scratch, Tally};
use crate::cost::{self, FourCosts, FourForms, best_place, times};
use crate::lanes::{self, dot, splat, sub};
use crate::metric::{CostSource, Form, Metric};
use crate::options::Placement;

impl<M: Metric> LiveMesh<M> {
    /// Evaluates the edges from `u` to `owned` and adds them to `found`; those that cost up to `most` are
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
        let &OwnedEdges { u, owned, ring: ru, most, have_single_wedges: are_lone } = edges;
        if matches!(self.cost.metric.cost_source(), CostSource::Stars | CostSource::Ends) {
            return self.evaluate_owned_by_metric(edges, found, scratch, tally);
        }
        let mut stuck = 0;
        let is_plain = |w: VertexId| self.store.v[w.index()].kind.is_free();
        let plain = self.cost.metric.is_memoryless()
            && self.constraints.rules.placement == Placement::Optimal
            && is_plain(u);
        for four in owned.chunks(4) {
            if plain
                && (four.len() > 1 || self.values.attributes.is_some())
                && four.iter().all(|&w| is_plain(w))
            {
                let FourCosts { cost, step, form_cost: sure, solved } =
                    self.evaluate_four(u, four, are_lone || self.have_single_wedges(u, four), ru, members);
                let within = solved & cost.simd_le(f32x4::splat(most));
                let dear = (solved ^ within).bitselect(cost, f32x4::splat(f32::INFINITY));
                found.beyond = dear.fast_min(found.beyond);
                let (solved, all) = (solved.to_bitmask(), (1 << four.len()) - 1);
                let mut left = (within.to_bitmask() | !solved) & all;
                while left != 0 {
                    let i = left.trailing_zeros() as usize & 3;
                    left &= left - 1;
                    if solved & (1 << i) != 0 {
                        let step = Vec3::from(step.map(|x| x.to_array()[i]));
                        let (cost, sure) = (cost.to_array()[i], sure.to_array()[i]);
                        found.within.push(Candidate { cost, removed: four[i], step, form_cost: sure });
                    } else if let Some(candidate) = self.evaluate_edge(u, four[i], ru, members) {
                        found.add(candidate, most);
                    }
                }
                continue;
            }
            for &w in four {
                match self.evaluate_edge(u, w, ru, members) {
                    Some(candidate) => found.add(candidate, most),
                    None => stuck += 1,
                }
            }
        }
        stuck
    }

    /// Evaluates up to four edges of free ends side by side with SIMD, with the results of
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
        cost::of_four(&FourForms { a, h, c }, &d, self.peak_weight(), self.values.attributes.is_some())
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
                // Both ends are points of the curve; a point between them would be on its chord.
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
    use crate::cost::PEAK_GUESS;
    use crate::metric::Memoryless;
    use crate::options::{SimplifyOptions, Stop};
    use crate::test_support::{in_two_charts, with_engine};

    /// Compares the costs of four edges side by side with those of each alone. Returns the number of
    /// comparisons, and the mismatches.
    fn compared(mesh: &TriMesh) -> (usize, Vec<String>) {
        let (mut count, mut wrong) = (0, Vec::new());
        let options = SimplifyOptions::new(Stop::ratio(0.5));
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
                    most: f32::INFINITY,
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
                        wrong.push(format!(
                            "{u}-{w} is sure to cost {} of {}",
                            of_four.form_cost, of_four.cost
                        ));
                    }
                }
            }
        });
        (count, wrong)
    }

    #[test]
    fn four_edges_cost_what_each_costs_alone() {
        let mut all = 0;
        for (name, mesh) in shapes::all() {
            for mesh in [&in_two_charts(&mesh), &mesh] {
                let (count, wrong) = compared(mesh);
                assert!(wrong.is_empty(), "{name}: {} of {count}: {}", wrong.len(), wrong[0]);
                all += count;
            }
        }
        assert!(all > 10_000, "{all} edges");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(48) })]

        #[test]
        fn edges_of_any_mesh_cost_the_same_by_four_and_alone(
            mesh in prop_oneof![perturbed_shape(0.02), perturbed_shape(0.5), soup(40, Coordinates::Tame)],
            has_charts in any::<bool>(),
        ) {
            let has_charts = has_charts && mesh.face_count() > 0;
            let (_, wrong) = compared(&if has_charts { in_two_charts(&mesh) } else { mesh });
            prop_assert!(wrong.is_empty(), "{}: {}", wrong.len(), wrong[0]);
        }
    }
}
