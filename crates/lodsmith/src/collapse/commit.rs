//! One collapse in three steps: `check` tests topology and guards, `exact_cost` computes the cost, `apply`
//! makes the change.

use glam::Vec3;
use lodsmith_core::VertexId;

use super::candidate::{Attempt, Candidate, CollapseOutcome, FOLD_COS, merged_position};
use super::cut::Neck;
use super::marks::Marks;
use super::order::NONE;
use super::ring::{Ring, distinct};
use super::samples::SampledCost;
use super::vertex::Vertex;
use super::wedges::HandedOver;
use super::wings::{EdgeEnd, StarStats, Wing, Wings};
use super::{Engine, LiveMesh, Scratch, Tally};
use crate::collapse::triangle;
use crate::cost;
use crate::cost::metric::{CostSource, Form, Metric};
use crate::cost::tensor::Tensor;
use crate::options::BorderPolicy;
use crate::report::Refusal;

/// If no neighbour lies farther behind a vertex, along its displacement, than this share of the displacement,
/// the collapse shortens a tip or leaves a rim. Distances to planes do not measure that, so the distance from
/// the old position to the new star counts as well.
const TIP_MAX_BEHIND: f32 = -0.5;

/// A collapse that topology and guards allow. The triangles of the star are in the scratch.
pub(super) struct Checked {
    /// Displacements of the kept and of the removed end.
    steps: [Vec3; 2],
    /// Position of the merged vertex.
    at: Vec3,
    /// Faces on the edge.
    shared: usize,
    /// The neck to cut, where the collapse would pinch the surface.
    neck: Option<Neck>,
    /// Whether each end leaves its old position uncovered.
    is_bare: [bool; 2],
    /// Sum of the squared distances to the planes of the star, twice its area, and the largest squared distance.
    planes: [f32; 3],
    /// Cost by the metric, if the metric decides.
    metric_cost: f32,
    /// Weight of the costs at these vertices, and the highest cost currently allowed without that weight.
    weight: f32,
    tau: f32,
    /// True if the form at the new position replaces the exact cost of the planes and values of the star.
    uses_form_cost: bool,
}

/// A collapse of known cost that may be applied now.
pub(super) struct Priced {
    cost: f32,
    /// Cost that adds up to the error of the result.
    spent: f32,
    /// Change of the area of a small detail.
    detail: Option<(usize, f32)>,
    handed_over: HandedOver,
    sampled: Option<SampledCost>,
}

impl<M: Metric> Engine<M> {
    /// Merges the candidate's end into the kept one if topology, guards and exact cost allow it. A probe changes nothing
    /// and returns the cost.
    #[inline(never)]
    pub(crate) fn collapse(&mut self, attempt: &Attempt<'_>) -> CollapseOutcome {
        let Self { mesh, scratch, tally, .. } = self;
        let checked = match mesh.check(attempt, scratch, tally) {
            Ok(checked) => checked,
            Err(outcome) => return outcome,
        };
        let priced = match mesh.exact_cost(attempt, &checked, scratch, tally) {
            Ok(priced) => priced,
            Err(outcome) => return outcome,
        };
        let (u, v, [ru, rv]) = (attempt.kept, attempt.candidate.removed, attempt.rings);
        let cost = priced.cost * checked.weight;
        let [into, from] = mesh.apply(attempt, &checked, &priced, scratch, tally);
        match &checked.neck {
            None => {
                if let Some(record) = &mut self.record {
                    record.merge(from, into);
                }
                self.log_change(ru.iter().chain(rv).map(|r| r.corner.face()), &[u], cost);
            }
            Some(neck) => self.log_cut(u, v, neck, [ru, rv], cost),
        }
        CollapseOutcome::Done
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Checks topology, seams, locks and guards of a collapse, and fills the scratch with the triangles of the star.
    #[inline(always)]
    fn check(
        &self,
        attempt: &Attempt<'_>,
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> Result<Checked, CollapseOutcome> {
        let &Attempt { kept: u, candidate, tau, is_probe, rings: [ru, rv] } = attempt;
        let (v, mut y) = (candidate.removed, candidate.step);
        tally.faces_visited += (ru.len() + rv.len()) as u64;
        let (x, z) = (&self.store.v[u.index()], &self.store.v[v.index()]);
        let weight = self.cost_factor(x.origin, z.origin);
        let tau = tau / weight;
        let (shared, neck) = self.check_topology(attempt, &mut scratch.marks, tally)?;
        let d = z.p - x.p;
        let mut metric_cost = candidate.cost;
        if matches!(self.cost.metric.cost_source(), CostSource::FormThenStars) {
            let Some(Candidate { cost, step, .. }) = self.candidate_by_metric(u, v, ru, rv, scratch, tally)
            else {
                return Err(Refusal::Locked.into());
            };
            if cost > tau {
                return Err(CollapseOutcome::Later(cost * weight));
            }
            (metric_cost, y) = (cost, if step == d { d } else { step });
        }
        let off = y - d;
        let at = merged_position(x.p, z.p, y);

        let kept = EdgeEnd { from: x.p, step: y, other: Some(v) };
        let removed = EdgeEnd { from: z.p, step: off, other: None };
        let (planes, is_bare) = self.evaluate_star(attempt, [kept, removed], at, scratch)?;
        let peak = planes[2];
        let is_exact = matches!(self.cost.metric.cost_source(), CostSource::Engine);
        // The form and the triangles may cost too much already, before lines and attributes are evaluated.
        // (On feature lines the form does not include all changes.)
        let is_on_lines = x.kind.has_lines() || z.kind.has_lines();
        let uses_form_cost = is_exact && !is_on_lines && candidate.form_cost > 0.0;
        if is_exact && self.values.attributes.is_some() && !is_probe {
            let known =
                if uses_form_cost { candidate.form_cost + self.peak_weight() * peak } else { candidate.cost };
            if known > tau {
                return Err(CollapseOutcome::Later(known * weight));
            }
        }
        if self.constraints.rules.has_extra_guards() {
            self.check_guards(&scratch.wings, at, [x.p, z.p], shared, [ru, rv])?;
        }
        Ok(Checked {
            steps: [y, off],
            at,
            shared,
            neck,
            is_bare,
            planes,
            metric_cost,
            weight,
            tau,
            uses_form_cost,
        })
    }

    /// Checks topology, seams and locks. Returns the number of faces on the edge, and the neck to cut where
    /// the collapse would pinch the surface.
    #[inline(always)]
    fn check_topology(
        &self,
        &Attempt { kept: u, candidate, rings: [ru, rv], .. }: &Attempt<'_>,
        marks: &mut Marks,
        tally: &mut Tally,
    ) -> Result<(usize, Option<Neck>), CollapseOutcome> {
        let v = candidate.removed;
        let mut neck = None;
        let shared = match self.store.link_condition(u, v, ru, rv, marks) {
            Ok(shared) => shared,
            Err(why) => {
                neck = self.neck(u, v, ru, rv, tally);
                if neck.is_none() {
                    return Err(why.into());
                }
                2
            }
        };
        if ru.len() + rv.len() == 2 * shared {
            return Err(Refusal::Component.into());
        }
        self.check_seams(u, v, ru, rv)?;
        self.check_locked(u, v, ru)?;
        Ok((shared, neck))
    }

    /// Fills the scratch with the triangles around the edge, with the merged vertex at position `at`, and
    /// checks that none turns over or folds. Returns the sum of their squared distances to the old planes,
    /// twice their area and the largest squared distance; and for each end whether it leaves its old position
    /// uncovered. A triangle at both ends counts twice, as in the evaluation.
    #[inline(always)]
    fn evaluate_star(
        &self,
        &Attempt { kept: u, candidate, rings: [ru, rv], .. }: &Attempt<'_>,
        [kept, removed]: [EdgeEnd; 2],
        at: Vec3,
        scratch: &mut Scratch,
    ) -> Result<([f32; 3], [bool; 2]), CollapseOutcome> {
        let mut stats = StarStats::default();
        let mut is_bare = [false; 2];
        scratch.wings.clear();
        scratch.spokes.take_without(u, rv);
        for (k, (spokes, end)) in [(ru, kept), (&scratch.spokes, removed)].into_iter().enumerate() {
            let (wings, turn) = (&mut scratch.wings, self.constraints.rules.max_turn);
            let behind = self.store.evaluate_wings(spokes, &end, at, turn, wings, &mut stats)?;
            is_bare[k] = behind > TIP_MAX_BEHIND * end.step.length_squared();
        }
        let (cost, area, peak) = stats.sum();
        let facing = |w: VertexId| self.store.v[w.index()].facing.direction();
        if stats.turns_far && self.folds(&scratch.wings, facing(u) + facing(candidate.removed)) {
            return Err(Refusal::NormalFlip.into());
        }
        Ok(([cost, area, peak], is_bare))
    }

    /// Returns the exact cost of a checked collapse if it is within the limit; the scratch then holds the
    /// lines and merged values that belong to it.
    #[inline(always)]
    fn exact_cost(
        &self,
        attempt: &Attempt<'_>,
        checked: &Checked,
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> Result<Priced, CollapseOutcome> {
        let &Attempt { kept: u, candidate, is_probe, rings: [ru, rv], .. } = attempt;
        let &Checked { steps: [y, off], at, is_bare, weight, tau, uses_form_cost, .. } = checked;
        let [mut cost, area, mut peak] = checked.planes;
        let v = candidate.removed;
        let (x, z) = (&self.store.v[u.index()], &self.store.v[v.index()]);
        let is_exact = matches!(self.cost.metric.cost_source(), CostSource::Engine);
        scratch.rim.clear();
        if (x.kind.has_lines() || z.kind.has_lines()) && self.has_lines() {
            [cost, peak] = self.with_lines([cost, peak], attempt, [y, off], scratch);
        }
        // A cost that is known to be too high is not computed fully.
        if uses_form_cost {
            cost = cost.max(candidate.form_cost);
        } else if is_exact && self.values.attributes.is_some() && (cost <= tau || is_probe) {
            self.prepare_merge(u, v, y, ru, &mut scratch.merge);
            cost += self.attribute_cost(u, v, y, ru.len(), &scratch.wings, &mut scratch.merge);
        }
        let mut spent = cost;
        if is_exact {
            let peak_weight = self.peak_weight();
            let mut weighted = cost::of_peak(peak_weight, area, peak);
            // A tip that shrinks along its own planes stays on all of them, but leaves its old position.
            for (from, step, is_bare) in [(x.p, y, is_bare[0]), (z.p, off, is_bare[1])] {
                if is_bare && peak_weight * step.length_squared() > 0.5 * cost {
                    let distance = cost::of_tip(self.distance_to_star(&scratch.wings, from, at));
                    weighted = weighted.max(peak_weight * distance);
                }
            }
            cost += weighted;
            cost += cost::of_steps(area, y, off);
        } else {
            cost = checked.metric_cost;
        }
        let mut handed_over = None;
        if self.counts_wedge_values() && (cost <= tau || is_probe) {
            let changes = self.wedges_to_hand_over(u, v, y, off, ru, rv)?;
            cost += self.cost_of_wedges(&changes, at);
            handed_over = Some(changes);
        }
        if !self.cost.metric.cost_source().is_decided_by_metric() {
            spent = cost;
        }
        if self.constraints.rules.is_quick {
            cost += self.cost_of_moves([x, z], [y, off], area);
        }
        if cost > tau && !is_probe {
            return Err(CollapseOutcome::Later(cost * weight));
        }
        let detail = self.change_of_detail(u, v, at, [ru, rv]);
        if detail.is_some_and(|change| !self.keeps_detail(change)) {
            return Err(Refusal::Component.into());
        }
        let handed_over = match handed_over {
            Some(known) => known,
            None => self.wedges_to_hand_over(u, v, y, off, ru, rv)?,
        };
        let mut sampled = None;
        if let Some(late) = &self.sampled {
            let max_cost = if is_probe { f32::INFINITY } else { tau };
            let found = self.sampled_cost(late, [x.origin, z.origin], at, [cost, max_cost], scratch, tally);
            cost = found.cost;
            sampled = Some(found);
        }
        if cost > tau || is_probe {
            return Err(CollapseOutcome::Later(cost * weight));
        }
        if let Some(bounded) = &self.bounded {
            let ends = [x.origin, z.origin];
            let tested = self.stays_within(bounded, ends, at, &scratch.wings, &mut scratch.bounded);
            tally.faces_visited += std::mem::take(&mut scratch.bounded.star.visited);
            if let Err(witness) = tested {
                scratch.bounded.witness = witness;
                return Err(Refusal::ErrorLimit.into());
            }
        }
        Ok(Priced { cost, spent, detail, handed_over, sampled })
    }

    /// Adds the cost of the feature edges of the star to a cost, and their distances to the largest squared
    /// distance. Lists them in the scratch, by end; the edge itself, if it is one, with the removed end.
    #[inline(always)]
    fn with_lines(
        &self,
        [mut cost, mut peak]: [f32; 2],
        &Attempt { kept: u, candidate, rings: [ru, rv], .. }: &Attempt<'_>,
        steps: [Vec3; 2],
        scratch: &mut Scratch,
    ) -> [f32; 2] {
        let v = candidate.removed;
        let (x, z) = (&self.store.v[u.index()], &self.store.v[v.index()]);
        for (ring, other, at_u, end, step) in [(ru, v, true, x, steps[0]), (rv, u, false, z, steps[1])] {
            if !end.kind.has_lines() {
                continue;
            }
            self.store.edges(ring, end.kind, &mut scratch.edges);
            for e in &scratch.edges {
                let (w, line) = (e.to, self.weight_of(e, end.kind.is_seam()));
                if line == 0.0 || (w == other && !at_u) {
                    continue;
                }
                let edge = self.store.p(w) - end.p;
                let c = edge.cross(step);
                let weight = if w == v { 2.0 } else { 1.0 };
                cost += line * weight * c.length_squared();
                peak = peak.max(c.length_squared() / edge.length_squared().max(1e-37));
                scratch.rim.push((w, at_u, line));
            }
        }
        [cost, peak]
    }

    /// Applies a collapse that was checked and priced. Returns the numbers in the ordered input of the
    /// merged vertex, and of the vertex merged into it.
    #[inline(always)]
    fn apply(
        &mut self,
        attempt: &Attempt<'_>,
        checked: &Checked,
        priced: &Priced,
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> [VertexId; 2] {
        let &Attempt { kept: u, candidate, rings: [ru, rv], .. } = attempt;
        let (v, y) = (candidate.removed, checked.steps[0]);
        let (x, z) = (&self.store.v[u.index()], &self.store.v[v.index()]);
        let origins = [x.origin, z.origin];
        if let Some(sampled) = &priced.sampled {
            self.hand_over_samples(origins, sampled, &mut scratch.samples);
        }
        self.hand_over_wedges(&priced.handed_over);
        if let Some(change) = priced.detail {
            self.change_detail(change);
        }
        if !matches!(self.cost.metric.cost_source(), CostSource::Engine) || checked.uses_form_cost {
            self.prepare_merge(u, v, y, ru, &mut scratch.merge);
        }
        tally.collapse_cost += f64::from(priced.spent);
        let merged = match &checked.neck {
            None => self.change(u, v, y, checked.shared, [ru, rv], scratch, tally),
            Some(neck) => {
                self.cut(u, v, y, neck, [ru, rv], scratch, tally);
                origins
            }
        };
        if self.bounded.is_some() {
            self.note_bounded(u, &mut scratch.bounded);
        }
        merged
    }

    /// Applies a collapse without a cut. Returns the same as [`Self::apply`].
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the data of a collapse, one by one")]
    fn change(
        &mut self,
        u: VertexId,
        v: VertexId,
        y: Vec3,
        shared: usize,
        [ru, rv]: [&Ring; 2],
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> [VertexId; 2] {
        let x = self.store.v[u.index()];
        let z = self.store.v[v.index()];
        let at = merged_position(x.p, z.p, y);
        let kind = x.kind.union(z.kind);
        let own = self.merge_wedges(u, v, y, at, ru, &scratch.wings, &mut scratch.merge);
        let q = self.merge_memory([&x, &z], v, [y, at], &own, scratch);
        for spoke in rv {
            let face = spoke.corner.face();
            // (By selection: which triangles are removed is unpredictable.)
            let goes = spoke.has(u);
            let t = &mut self.store.t[face];
            t[if goes { 0 } else { spoke.corner.k() }] = if goes { NONE } else { u };
            self.store.live_faces -= usize::from(goes);
            if goes {
                // (The lists of the two ends are rebuilt below.)
                self.store.unlist(if spoke.a == u { spoke.b } else { spoke.a }, face);
            }
        }
        let count = ru.len() + rv.len() - 2 * shared;
        let slots = self.store.relist(u, v, count);
        let mut n = 0;
        for r in ru {
            // (Branchless: each is written, and the write position advances only for those that stay; a
            // branch would be unpredictable.)
            if let Some(slot) = slots.get_mut(n) {
                *slot = r.corner;
            }
            n += usize::from(!r.has(v));
        }
        for (slot, r) in slots[n.min(count)..].iter_mut().zip(&scratch.spokes) {
            *slot = r.corner;
        }
        // The merged vertex takes the number of the end whose position was kept: the result then contains
        // that vertex of the input.
        let is_place_of = |end: &Vertex<M::Memory>| end.p == at && !end.kind.is_moved();
        let kept_v = is_place_of(&z) && !is_place_of(&x);
        let (origin, merged) = if kept_v { (z.origin, x.origin) } else { (x.origin, z.origin) };
        self.store.merged_into[merged.index()] = origin;
        self.merge_cost_factors(origin, merged);
        let unmoved = kept_v || (y == Vec3::ZERO && !x.kind.is_moved());
        let kept = &mut self.store.v[u.index()];
        if kept_v {
            kept.facing = z.facing;
        }
        (kept.p, kept.q, kept.origin, kept.kind) = (at, q, origin, kind.moved(!unmoved));
        let removed = &mut self.store.v[v.index()];
        removed.kind = removed.kind.gone();
        self.store.bound[v.index()] = f32::INFINITY;
        self.store.live_vertices -= 1;
        tally.collapses += 1;
        if kind.is_complex() || self.has_new_seams(u) {
            self.refresh_around(u);
        }
        [origin, merged]
    }

    /// Returns the memory of the merged vertex of the ends `x` and `z`, at position `at`, which is `x` + `y`.
    /// `own` is the attribute tensor of the new triangles.
    #[inline(always)]
    fn merge_memory(
        &mut self,
        [x, z]: [&Vertex<M::Memory>; 2],
        v: VertexId,
        [y, at]: [Vec3; 2],
        own: &Tensor,
        scratch: &Scratch,
    ) -> M::Memory {
        if !self.cost.metric.is_memoryless() {
            let form: Form = self.cost.metric.form(&x.q, &z.q, z.p - x.p);
            if !self.cost.lines.is_empty() {
                self.merge_lines([x.origin, z.origin], z.p - x.p, y);
            }
            return self.cost.metric.merged(&form, y);
        }
        // The surrounding vertices replace old planes by new ones; the merged vertex starts from zero.
        let mut q = self.swap_planes(&scratch.wings);
        M::tensor(&mut q).add(own);
        for &(w, at_u, line) in scratch.rim.iter().filter(|r| r.0 != v) {
            let o = &mut self.store.v[w.index()];
            let from = if at_u { x.p } else { z.p };
            let [old, new] = [from, at].map(|p| self.cost.metric.line(p - o.p, line, self.cost.mean_face));
            let s = M::tensor(&mut o.q);
            s.sub(&old);
            s.add(&new);
            M::tensor(&mut q).add(&new);
        }
        q
    }

    /// Replaces old planes by new ones at the vertices around the collapse; returns the planes of the
    /// merged vertex.
    #[inline(always)]
    pub(super) fn swap_planes(&mut self, wings: &Wings) -> M::Memory {
        let (metric, mean, mut q) = (self.cost.metric, self.cost.mean_face, M::Memory::default());
        let vertices = &mut self.store.v;
        wings.swaps(
            |lengths| metric.plane_weights(lengths, mean),
            |rim, change, new| {
                M::tensor(&mut q).add(new);
                for w in rim {
                    // (One of them may be the removed vertex.)
                    M::tensor(&mut vertices[w.index()].q).add(change);
                }
            },
        );
        q
    }

    /// Returns the weight of the largest squared distance; 0 in the late phase, where the sampled cost
    /// replaces it.
    #[inline(always)]
    pub(crate) fn peak_weight(&self) -> f32 {
        if self.sampled.is_some() || self.cost.metric.cost_source().is_decided_by_metric() {
            0.0
        } else {
            cost::peak_weight(self.cost.area)
        }
    }

    /// Returns the squared distance from `q` to the star after the collapse.
    #[inline(never)]
    fn distance_to_star(&self, wings: &Wings, q: Vec3, at: Vec3) -> f32 {
        let to = |w: Wing| triangle::closest(q, at, self.store.p(w.a), self.store.p(w.b)).0;
        wings.iter().filter(|w| !w.both).map(to).fold(f32::INFINITY, f32::min)
    }

    /// True if any edges have line tensors: borders and non-manifold curves, unless they are free, or sharp
    /// edges.
    pub(crate) fn has_lines(&self) -> bool {
        self.constraints.rules.border != BorderPolicy::Free || self.store.creases.is_some()
    }

    /// True if a vertex at or around `u`, which was just merged, is now on a seam: in a run onto endpoints
    /// the merged vertex may have the sides of either end.
    fn has_new_seams(&self, u: VertexId) -> bool {
        let is_split = |all: &[bool]| all[self.store.v[u.index()].origin.index()];
        if !self.split_vertices().is_some_and(is_split) {
            return false;
        }
        let (mut around, mut ring) = (Ring::default(), Ring::default());
        self.store.ring(u, &mut around);
        distinct(&around).chain([u]).any(|w| {
            self.store.ring(w, &mut ring);
            !self.store.v[w.index()].kind.is_seam() && self.current_kind(w, &ring).is_seam()
        })
    }

    /// Recomputes kinds and tensors of `u` and of the vertices around it: after a change on a non-manifold
    /// curve, where counts of faces at edges add up, or if seams reach other vertices.
    #[inline(never)]
    fn refresh_around(&mut self, u: VertexId) {
        let mut ring = Ring::default();
        self.store.ring(u, &mut ring);
        let around: Vec<VertexId> = distinct(&ring).chain([u]).collect();
        for w in around {
            self.refresh(w, &mut ring);
        }
    }

    /// True if a new triangle of the star would face away from the orientation of the input (`facing` at
    /// the ends), or lie back to back with another, within the star or beyond its rim.
    #[inline(never)]
    fn folds(&self, wings: &Wings, facing: Vec3) -> bool {
        let unit = |n: Vec3| n / n.length().max(1e-30);
        let kept = || wings.iter().filter(|w: &Wing| !w.both);
        for (i, w) in kept().enumerate() {
            let n = unit(w.after);
            let around = [w.a, w.b].map(|o| self.store.v[o.index()].facing.direction());
            if n.dot(facing * 0.5 + around[0] + around[1]) < 0.0 {
                return true;
            }
            for other in kept().skip(i + 1) {
                if (other.a == w.b || other.b == w.a || other.a == w.a || other.b == w.b)
                    && n.dot(unit(other.after)) < FOLD_COS
                {
                    return true;
                }
            }
            // (The shorter list is searched: one of the two vertices may be a hub.)
            let [here, there] = [w.a, w.b].map(|o| self.store.listed(o));
            // (In a block that face may be elsewhere.)
            let mut is_hidden = [w.a, w.b].iter().all(|o| o.index() < self.constraints.frozen);
            for &c in if here.len() <= there.len() { here } else { there } {
                let t = &self.store.t[c.face()];
                if c.face() == w.corner.face() || ![w.a, w.b].iter().all(|o| t.contains(o)) {
                    continue;
                }
                is_hidden = false;
                let [p, q, r] = t.map(|o| self.store.p(o));
                if n.dot(unit((q - p).cross(r - p))) < FOLD_COS {
                    return true;
                }
            }
            if is_hidden {
                return true;
            }
        }
        false
    }

    /// Checks the optional guards.
    #[inline(never)]
    fn check_guards(
        &self,
        wings: &Wings,
        at: Vec3,
        [pu, pv]: [Vec3; 2],
        shared: usize,
        [ru, rv]: [&Ring; 2],
    ) -> Result<(), Refusal> {
        let rules = &self.constraints.rules;
        let shape = |a: Vec3, b: Vec3, c: Vec3| {
            let around = (b - a).length_squared() + (c - b).length_squared() + (a - c).length_squared();
            12.0 * (b - a).cross(c - a).length_squared() / (around * around).max(1e-37)
        };
        if rules.min_shape > 0.0 {
            let (mut before, mut after) = (1f32, 1f32);
            for (i, w) in wings.iter().enumerate() {
                let from = if i < ru.len() { pu } else { pv };
                let (a, b) = (self.store.p(w.a), self.store.p(w.b));
                before = before.min(shape(from, a, b));
                if !w.both {
                    after = after.min(shape(at, a, b));
                }
            }
            if after < rules.min_shape && after < before {
                return Err(Refusal::Quality);
            }
        }
        if rules.max_valence != usize::MAX {
            // An open fan has one more edge than faces.
            let open = usize::from(ru.iter().chain(rv).any(|r| !self.store.v[r.a.index()].kind.is_regular()));
            let faces = ru.len() + rv.len() - 2 * shared;
            if faces + open > rules.max_valence && faces > ru.len().max(rv.len()) {
                return Err(Refusal::Valence);
            }
        }
        if rules.max_edge_sq.is_finite() {
            for (i, w) in wings.iter().enumerate().filter(|w| !w.1.both) {
                let from = if i < ru.len() { pu } else { pv };
                for o in [w.a, w.b] {
                    let length_sq = (self.store.p(o) - at).length_squared();
                    if length_sq > rules.max_edge_sq && length_sq > (self.store.p(o) - from).length_squared()
                    {
                        return Err(Refusal::EdgeLength);
                    }
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
