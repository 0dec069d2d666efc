//! One collapse: the last checks, the exact cost, and the change itself.

use glam::Vec3;
use lodsmith_core::VertexId;

use super::Engine;
use super::kind::distinct;
use super::order::NONE;
use super::store::{Ring, Vertex};
use super::wings::{End, Verdict, Wing};
use crate::metric::{Form, Judge, Metric, TIE};
use crate::options::BorderPolicy;
use crate::report::Refusal;
use crate::triangle;

/// Weight of the largest squared distance, times the mean area of a triangle: protects small features. (Measured on 12 cases:
/// 0.1, 0.2 and 0.3 have equal means within a percent; from 0.2 on the largest distances are a third lower.)
const PEAK: f32 = 0.2;
/// Most that the largest squared distance from a plane counts, a share of the star's own area: on meshes with faces of all
/// sizes the mean triangle is far larger than those of a fillet. Bare places have no such limit: tips often end in tiny faces.
/// (Measured: docs/decisions/0001.)
pub(super) const PEAK_OF_STAR: f32 = 0.3;
/// Cosine between two faces at an edge below which they lie back to back.
pub(super) const FOLD: f32 = -0.8;

/// No neighbour lies farther behind a vertex than this share of its step, both along the step: then it is a tip, or on a
/// rim, and its old place may be left bare.
const BEHIND: f32 = -0.5;
/// What the squared distance of a bare place counts against that of a plane. (Measured on horse, horse400k, horse1.5m,
/// nefertiti, brain_mri, bunny: the largest distances fall by up to ten, the means stay within a percent.)
const BARE: f32 = 4.0;

/// What came of a try.
pub(crate) enum Outcome {
    Done,
    /// It costs this much, which is more than allowed now.
    Later(f32),
    Refused(Refusal),
}

/// A collapse as it was evaluated: the merged vertex goes to the kept one's position + `step`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) cost: f32,
    pub(crate) removed: VertexId,
    pub(crate) step: Vec3,
    /// What its form says there, where that is known to a few digits; else 0.
    pub(crate) sure: f32,
}

/// Where the merged vertex goes: exactly onto the removed end where the step leads there.
#[inline(always)]
pub(crate) fn merged_position(kept: Vec3, removed: Vec3, step: Vec3) -> Vec3 {
    if step == removed - kept { removed } else { kept + step }
}

impl<M: Metric> Engine<M> {
    /// Merges `v` into `u` if topology, guards and exact cost allow it. With `probe` nothing is changed and the cost is
    /// said.
    #[inline(never)]
    pub(crate) fn collapse(
        &mut self,
        u: VertexId,
        candidate: &Candidate,
        tau: f32,
        probe: bool,
        ru: &Ring,
        rv: &Ring,
    ) -> Outcome {
        let (v, mut y) = (candidate.removed, candidate.step);
        self.tally.faces_visited += (ru.len() + rv.len()) as u64;
        // (Not as a pair: that would be copied twice.)
        let x = self.store.v[u.index()];
        let z = self.store.v[v.index()];
        let price = self.price(x.origin, z.origin);
        let tau = tau / price;
        let mut neck = None;
        let shared = match self.store.link_condition(u, v, ru, rv) {
            Ok(shared) => shared,
            Err(why) => {
                neck = self.neck(u, v, ru, rv);
                if neck.is_none() {
                    return Outcome::Refused(why);
                }
                2
            }
        };
        if ru.len() + rv.len() == 2 * shared {
            return Outcome::Refused(Refusal::Component);
        }
        if let Err(why) = self.ask_seams(u, v, ru, rv) {
            return Outcome::Refused(why);
        }
        if let Err(why) = self.ask_locked(u, v, ru) {
            return Outcome::Refused(why);
        }
        let d = z.p - x.p;
        let mut judged = candidate.cost;
        if matches!(self.cost.metric.decides(), Judge::FormThenStars) {
            let Some(Candidate { cost, step, .. }) = self.judged(u, v, ru, rv) else {
                return Outcome::Refused(Refusal::Locked);
            };
            if cost > tau {
                return Outcome::Later(cost * price);
            }
            (judged, y) = (cost, if step == d { d } else { step });
        }
        let off = y - d;
        let at = merged_position(x.p, z.p, y);

        // Exact cost and normals. A triangle at both ends counts twice, as in the evaluation.
        let mut verdict = Verdict::default();
        let mut bare = [false; 2];
        self.scratch.wings.clear();
        self.scratch.spokes.take_without(u, rv);
        let kept = End { from: x.p, step: y, other: Some(v) };
        let removed = End { from: z.p, step: off, other: None };
        for (k, (spokes, end)) in [(ru, kept), (&self.scratch.spokes, removed)].into_iter().enumerate() {
            let (wings, turn) = (&mut self.scratch.wings, self.constraints.rules.max_turn);
            match self.store.look_at_wings(spokes, &end, at, turn, wings, &mut verdict) {
                Ok(behind) => bare[k] = behind > BEHIND * end.step.length_squared(),
                Err(why) => return Outcome::Refused(why),
            }
        }
        let (mut cost, area, mut peak) = verdict.sum();
        if verdict.turns_far && self.folds(x.facing.direction() + z.facing.direction()) {
            return Outcome::Refused(Refusal::NormalFlip);
        }
        let is_exact = matches!(self.cost.metric.decides(), Judge::Engine);
        // What the form and the triangles say already may be too dear, before lines and attributes are looked at. (Where
        // lines change with what lies beside them, the form does not know all of it.)
        let on_lines = x.kind.has_lines() || z.kind.has_lines();
        let is_sure = is_exact && !on_lines && candidate.sure > 0.0;
        if is_exact
            && self.values.attributes.is_some()
            && !probe
            && peak <= self.constraints.rules.max_step_sq
        {
            let known = if is_sure { candidate.sure + self.peak_weight() * peak } else { candidate.cost };
            if known > tau {
                return Outcome::Later(known * price);
            }
        }
        if self.constraints.rules.has_extra_guards()
            && let Err(why) = self.ask_guards(at, x.p, z.p, shared, ru, rv)
        {
            return Outcome::Refused(why);
        }
        // Feature edges of the star, by the end that stays; the edge u-v, if it is one, is listed with v.
        self.scratch.rim.clear();
        if (x.kind.has_lines() || z.kind.has_lines()) && self.has_lines() {
            for (ring, other, at_u, end, step) in [(ru, v, true, &x, y), (rv, u, false, &z, off)] {
                if !end.kind.has_lines() {
                    continue;
                }
                let mut edges = std::mem::take(&mut self.scratch.edges);
                self.store.edges(ring, end.kind, &mut edges);
                for e in &edges {
                    let (w, line) = (e.to, self.weight_of(e, end.kind.is_seam()));
                    if line == 0.0 || (w == other && !at_u) {
                        continue;
                    }
                    let edge = self.store.p(w) - end.p;
                    let c = edge.cross(step);
                    let weight = if w == v { 2.0 } else { 1.0 };
                    cost += line * weight * c.length_squared();
                    peak = peak.max(c.length_squared() / edge.length_squared().max(1e-37));
                    self.scratch.rim.push((w, at_u, line));
                }
                self.scratch.edges = edges;
            }
        }
        // What is too dear already need not be known to the last digit.
        if is_sure {
            cost = cost.max(candidate.sure);
        } else if is_exact && self.values.attributes.is_some() && (cost <= tau || probe) {
            self.prepare_merge(u, v, y, ru);
            cost += self.attribute_cost(u, v, y, ru.len());
        }
        let mut plain = cost;
        if is_exact {
            let peak_weight = self.peak_weight();
            let mut weighted = peak_weight.min(PEAK_OF_STAR * area) * peak;
            // A tip that draws back along its own planes leaves none of them, but its place.
            for (from, step, bare) in [(x.p, y, bare[0]), (z.p, off, bare[1])] {
                if bare && peak_weight * step.length_squared() > 0.5 * cost {
                    let distance = BARE * self.distance_to_star(from, at);
                    peak = peak.max(distance);
                    weighted = weighted.max(peak_weight * distance);
                }
            }
            cost += weighted;
            cost += 0.5 * TIE * area * (y.length_squared() + off.length_squared());
        } else {
            cost = judged;
        }
        if peak > self.constraints.rules.max_step_sq {
            return Outcome::Refused(Refusal::Cost);
        }
        if !self.cost.metric.decides().is_metric() {
            plain = cost;
        }
        let mut change = None;
        if cost <= tau || probe {
            change = self.change_of_detail(u, v, at, [ru, rv]);
            if change.is_some_and(|change| !self.keeps_detail(change)) {
                return Outcome::Refused(Refusal::Component);
            }
        }
        let mut handed_over = Vec::new();
        if cost <= tau && !probe {
            // (Before samples change hands, which cannot be taken back.)
            match self.wedges_to_hand_over(u, v, y, off, ru, rv) {
                Ok(changes) => handed_over = changes,
                Err(why) => return Outcome::Refused(why),
            }
        }
        if cost <= tau || probe {
            cost = self.charge(x.origin, z.origin, at, cost, tau, probe);
        }
        if cost > tau || probe {
            return Outcome::Later(cost * price);
        }
        self.hand_over_wedges(&handed_over);
        if let Some(change) = change {
            self.change_detail(change);
        }
        if !is_exact || is_sure {
            self.prepare_merge(u, v, y, ru);
        }
        self.tally.spent += f64::from(plain);
        match &neck {
            None => {
                self.change(u, v, y, shared, ru, rv);
                self.note(ru.iter().chain(rv).map(|r| r.corner.face()), &[u], cost * price);
            }
            Some(neck) => {
                self.cut(u, v, y, neck, ru, rv);
                self.note_cut(u, v, neck, [ru, rv], cost * price);
            }
        }
        Outcome::Done
    }

    /// Does the collapse that was checked; wings and rim are at hand.
    #[inline(always)]
    fn change(&mut self, u: VertexId, v: VertexId, y: Vec3, shared: usize, ru: &Ring, rv: &Ring) {
        let x = self.store.v[u.index()];
        let z = self.store.v[v.index()];
        let at = merged_position(x.p, z.p, y);
        let kind = x.kind.union(z.kind);
        let own = self.merge_wedges(u, v, y, at, ru);
        let q = if self.cost.metric.is_memoryless() {
            // The vertices around swap old planes for new ones; u starts afresh.
            let mut q = self.swap_planes();
            M::tensor(&mut q).add(&own);
            for &(w, at_u, line) in self.scratch.rim.iter().filter(|r| r.0 != v) {
                let o = &mut self.store.v[w.index()];
                let from = if at_u { x.p } else { z.p };
                let [old, new] =
                    [from, at].map(|p| self.cost.metric.line(p - o.p, line, self.cost.mean_face));
                let s = M::tensor(&mut o.q);
                s.sub(&old);
                s.add(&new);
                M::tensor(&mut q).add(&new);
            }
            q
        } else {
            let form: Form = self.cost.metric.form(&x.q, &z.q, z.p - x.p);
            if !self.cost.lines.is_empty() {
                self.merge_lines([x.origin, z.origin], z.p - x.p, y);
            }
            self.cost.metric.merged(&form, y)
        };
        for spoke in rv {
            let face = spoke.corner.face();
            // (By selection: which triangles go is unpredictable.)
            let goes = spoke.has(u);
            let t = &mut self.store.t[face];
            t[if goes { 0 } else { spoke.corner.k() }] = if goes { NONE } else { u };
            self.store.live_faces -= usize::from(goes);
            if goes {
                // (The lists of the two ends are made anew below.)
                self.store.unlist(if spoke.a == u { spoke.b } else { spoke.a }, face);
            }
        }
        let count = ru.len() + rv.len() - 2 * shared;
        let slots = self.store.relist(u, v, count);
        let mut n = 0;
        for r in ru {
            // (Written all, kept those that stay: which they are could not be foretold.)
            if let Some(slot) = slots.get_mut(n) {
                *slot = r.corner;
            }
            n += usize::from(!r.has(v));
        }
        for (slot, r) in slots[n.min(count)..].iter_mut().zip(&self.scratch.spokes) {
            *slot = r.corner;
        }
        // Whose place was kept gives its number: the result then has that vertex of the input.
        let is_place_of = |end: &Vertex<M::Memory>| end.p == at && !end.kind.is_moved();
        let kept_v = is_place_of(&z) && !is_place_of(&x);
        let (origin, merged) = if kept_v { (z.origin, x.origin) } else { (x.origin, z.origin) };
        self.store.merged_into[merged.index()] = origin;
        if let Some(record) = &mut self.record {
            record.merge(merged, origin);
        }
        self.merge_prices(origin, merged);
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
        self.tally.collapses += 1;
        if kind.is_complex() {
            self.refresh_around(u);
        }
    }

    /// Lets the vertices around the collapse swap old planes for new ones; returns the new ones of the merged vertex.
    #[inline(always)]
    pub(super) fn swap_planes(&mut self) -> M::Memory {
        let (metric, mean, mut q) = (self.cost.metric, self.cost.mean_face, M::Memory::default());
        let vertices = &mut self.store.v;
        self.scratch.wings.swaps(
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

    /// Weight of a largest squared distance. In the late phase true distances are charged instead.
    #[inline(always)]
    pub(crate) fn peak_weight(&self) -> f32 {
        if self.late.is_some() || self.cost.metric.decides().is_metric() {
            0.0
        } else {
            PEAK * self.cost.area
        }
    }

    /// Squared distance from `q` to the star that the wings become.
    #[inline(never)]
    fn distance_to_star(&self, q: Vec3, at: Vec3) -> f32 {
        let to = |w: Wing| triangle::closest(q, at, self.store.p(w.a), self.store.p(w.b)).0;
        self.scratch.wings.iter().filter(|w| !w.both).map(to).fold(f32::INFINITY, f32::min)
    }

    /// Whether any edges carry lines: borders and curves, unless they are free, or sharp edges.
    pub(crate) fn has_lines(&self) -> bool {
        self.constraints.rules.border != BorderPolicy::Free || self.store.creases.is_some()
    }

    /// Kinds and tensors of `u` and of the vertices around it, afresh: after a change on a non-manifold curve, where
    /// counts of faces at edges add up.
    #[inline(never)]
    fn refresh_around(&mut self, u: VertexId) {
        let mut ring = Ring::default();
        self.store.ring(u, &mut ring);
        let around: Vec<VertexId> = distinct(&ring).chain([u]).collect();
        for w in around {
            self.refresh(w, &mut ring);
        }
    }

    /// Whether a new triangle of the star would turn its back to where the input faced (`facing` at the ends), or lie back
    /// to back with another, within the star or beyond its rim.
    #[inline(never)]
    fn folds(&self, facing: Vec3) -> bool {
        let unit = |n: Vec3| n / n.length().max(1e-30);
        let kept = || self.scratch.wings.iter().filter(|w: &Wing| !w.both);
        for (i, w) in kept().enumerate() {
            let n = unit(w.after);
            let around = [w.a, w.b].map(|o| self.store.v[o.index()].facing.direction());
            if n.dot(facing * 0.5 + around[0] + around[1]) < 0.0 {
                return true;
            }
            for other in kept().skip(i + 1) {
                if (other.a == w.b || other.b == w.a || other.a == w.a || other.b == w.b)
                    && n.dot(unit(other.after)) < FOLD
                {
                    return true;
                }
            }
            // (The shorter list: one of the two may be the hub of a fan of many faces.)
            let [here, there] = [w.a, w.b].map(|o| self.store.listed(o));
            for &c in if here.len() <= there.len() { here } else { there } {
                let t = &self.store.t[c.face()];
                if c.face() == w.corner.face() || ![w.a, w.b].iter().all(|o| t.contains(o)) {
                    continue;
                }
                let [p, q, r] = t.map(|o| self.store.p(o));
                if n.dot(unit((q - p).cross(r - p))) < FOLD {
                    return true;
                }
            }
        }
        false
    }

    /// The guards that options turn on.
    #[inline(never)]
    fn ask_guards(
        &self,
        at: Vec3,
        pu: Vec3,
        pv: Vec3,
        shared: usize,
        ru: &Ring,
        rv: &Ring,
    ) -> Result<(), Refusal> {
        let rules = &self.constraints.rules;
        let shape = |a: Vec3, b: Vec3, c: Vec3| {
            let around = (b - a).length_squared() + (c - b).length_squared() + (a - c).length_squared();
            12.0 * (b - a).cross(c - a).length_squared() / (around * around).max(1e-37)
        };
        if rules.min_shape > 0.0 {
            let (mut before, mut after) = (1f32, 1f32);
            for (i, w) in self.scratch.wings.iter().enumerate() {
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
            // An open fan has one edge more than faces.
            let open = usize::from(ru.iter().chain(rv).any(|r| !self.store.v[r.a.index()].kind.is_regular()));
            let faces = ru.len() + rv.len() - 2 * shared;
            if faces + open > rules.max_valence && faces > ru.len().max(rv.len()) {
                return Err(Refusal::Valence);
            }
        }
        if rules.max_edge_sq.is_finite() {
            for (i, w) in self.scratch.wings.iter().enumerate().filter(|w| !w.1.both) {
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
