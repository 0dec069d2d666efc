//! Pair contraction: merges close vertices that share no edge. [Garland-Heckbert 1997]
//!
//! Unlike in the paper, pairs are searched for again as positions change, but not between neighbours along
//! the surface or vertices that are back to back (near); a pair costs extra for the gap that it closes; and
//! unless the topology is free, pairs are contracted together with adjacent ones if one alone would connect
//! surfaces only in a point (bundle).

use glam::Vec3;
use lodsmith_core::VertexId;

use super::bound::UNKNOWN;
use super::bundle::{Bundle, Effect};
use super::candidate::CollapseOutcome;
use super::near::{Site, near_pairs};
use super::order::NONE;
use super::pair_list::{Pair, PairScratch, Pairs};
use super::ring::{Ring, distinct, faces_at};
use super::sweeps::VISITS_PER_PROGRESS_REPORT;
use super::vertex::Facing;
use super::{Engine, Goal, LiveMesh};
use crate::control::Verdict;
use crate::cost::metric::{Form, Metric};
use crate::cost::tensor::Tensor;
use crate::options::TopologyPolicy;
use crate::report::Refusal;

/// Pairs are searched for again when this percentage of the vertices at the last search is left.
const RENEW_PERCENT: usize = 70;
/// Below this number of vertices, pairs are searched for after every sweep that changed anything: the last
/// ones matter.
const RENEW_BELOW: usize = 2000;
/// Vertices with more faces are skipped, and so are their neighbours.
const MAX_PAIR_FACES: usize = 200;

/// Maximum number of bundles to try for a pair with adjacent pairs, the nearest first.
const MAX_BUNDLES: usize = 3;

/// Keeps the nearest bundles, in order.
fn keep_nearest(bundles: &mut Vec<(f32, Vec<[VertexId; 2]>)>) {
    bundles.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
    bundles.truncate(MAX_BUNDLES);
}

impl<M: Metric> Engine<M> {
    /// Contracts the pairs that cost at most `tau`, the nearest first, until the goal is reached; with
    /// `probe` only computes their costs. `ask` is called from time to time and decides whether to continue.
    pub(super) fn contract_pairs(
        &mut self,
        goal: &Goal,
        tau: f32,
        probe: bool,
        mut ask: impl FnMut(&Self) -> Verdict,
    ) -> Verdict {
        let Some(mut pairs) = self.mesh.topology.pairs.take() else { return Verdict::Continue };
        let is_current = |engine: &Self, at: (u32, usize, u64)| {
            at.0 == engine.mesh.store.generation
                && engine.mesh.store.live_vertices * 100 >= at.1 * RENEW_PERCENT
                && (at.2 == engine.tally.collapses
                    || !probe && engine.mesh.store.live_vertices >= RENEW_BELOW)
        };
        let mut verdict = Verdict::Continue;
        if !pairs.found_at.is_some_and(|at| is_current(self, at)) {
            verdict = self.find_pairs(&mut pairs, &mut ask);
        }
        let mut list = std::mem::take(&mut pairs.list);
        let tau = if probe { f32::MAX } else { tau };
        for (i, pair) in list.iter_mut().enumerate() {
            if verdict != Verdict::Continue || self.mesh.needed(goal) == Some(0) || pairs.visits_left == 0 {
                break;
            }
            if i % VISITS_PER_PROGRESS_REPORT == VISITS_PER_PROGRESS_REPORT - 1 {
                verdict = ask(self);
            }
            if pair.bound <= tau || probe {
                pair.bound = match self.contract(pair.ends, tau, probe, &mut pairs) {
                    CollapseOutcome::Done => f32::INFINITY,
                    CollapseOutcome::Later(cost) => cost,
                    CollapseOutcome::Refused(why) => {
                        self.tally.refuse(why);
                        // Retried at a higher threshold: the neighbourhood may change until then.
                        if probe { f32::INFINITY } else { 4.0 * tau + 1e-20 }
                    }
                };
            }
        }
        pairs.list = list;
        // (Without pairs the sweeps continue with edges alone.)
        if pairs.visits_left > 0 {
            self.mesh.topology.pairs = Some(pairs);
        }
        verdict
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Enables contraction of pairs nearer than `reach`; before any collapse.
    pub(crate) fn enable_pairs(&mut self, reach: f32) {
        self.topology.pairs = Some(Pairs::new(reach, self.store.live_vertices));
        if self.cost.metric.is_memoryless() || !self.has_lines() {
            return;
        }
        self.cost.lines = vec![M::Memory::default(); self.store.merged_into.len()];
        let (mut ring, mut edges) = (Ring::default(), Vec::new());
        for u in (0..self.store.v.len() as u32).map(VertexId) {
            let x = self.store.v[u.index()];
            if x.kind.has_lines() {
                self.store.ring(u, &mut ring);
                let mut sum = Tensor::default();
                self.add_lines_to(&mut sum, u, &ring, &mut edges);
                *M::tensor(&mut self.cost.lines[x.origin.index()]) = sum;
            }
        }
    }

    /// Merges the line quadrics of two vertices, by number in the ordered input, `d` apart; the first moves
    /// by `y`.
    pub(super) fn merge_lines(&mut self, origins: [VertexId; 2], d: Vec3, y: Vec3) {
        let merged = self.cost.metric.merged(&self.form_of_lines(origins, d), y);
        for origin in origins {
            if let Some(lines) = self.cost.lines.get_mut(origin.index()) {
                *lines = merged;
            }
        }
    }

    /// Removes the line quadrics of a vertex if its borders have closed.
    fn remove_lines(&mut self, w: VertexId) {
        let x = self.store.v[w.index()];
        let Some(lines) = self.cost.lines.get_mut(x.origin.index()).filter(|_| !x.kind.is_feature()) else {
            return;
        };
        let (own, none) = (std::mem::take(lines), M::Memory::default());
        let (form, lines) =
            (self.cost.metric.form(&x.q, &none, Vec3::ZERO), self.cost.metric.form(&own, &none, Vec3::ZERO));
        let planes = Form { a: form.a.less(&lines.a), h: form.h - lines.h, c: form.c - lines.c };
        self.store.v[w.index()].q = self.cost.metric.merged(&planes, Vec3::ZERO);
    }

    pub(super) fn form_of_lines(&self, origins: [VertexId; 2], d: Vec3) -> Form {
        let of = |origin: VertexId| self.cost.lines.get(origin.index()).copied().unwrap_or_default();
        self.cost.metric.form(&of(origins[0]), &of(origins[1]), d)
    }
}

impl<M: Metric> Engine<M> {
    /// Returns the number of pairs within `reach` that could be contracted at some cost. Changes nothing.
    pub(super) fn possible_pairs(&mut self, reach: f32) -> usize {
        let mut pairs = Pairs::new(reach, self.mesh.store.live_vertices);
        self.find_pairs(&mut pairs, &mut |_: &Self| Verdict::Continue);
        let list = std::mem::take(&mut pairs.list);
        let mut is_possible = |pair: &&Pair| {
            let outcome = self.contract(pair.ends, f32::MAX, true, &mut pairs);
            matches!(outcome, CollapseOutcome::Later(cost) if cost.is_finite())
        };
        list.iter().filter(&mut is_possible).count()
    }

    /// Searches for pairs again.
    fn find_pairs(&mut self, pairs: &mut Pairs, ask: &mut impl FnMut(&Self) -> Verdict) -> Verdict {
        let (alive, sites) = self.mesh.sites();
        pairs.visits_left = pairs.visits_left.saturating_sub(alive.len());
        let (mut verdict, mut asked) = (Verdict::Continue, 0usize);
        let found = near_pairs(&sites, pairs.reach, || {
            asked += 1;
            if asked.is_multiple_of(VISITS_PER_PROGRESS_REPORT) {
                verdict = ask(self);
            }
            verdict == Verdict::Continue
        });
        let mut all: Vec<(f32, [VertexId; 2])> = Vec::new();
        all.extend(
            found.unwrap_or_default().iter().map(|n| (n.distance_sq, n.ends.map(|i| alive[i as usize]))),
        );
        let mut ring = Ring::default();
        all.retain(|&(_, [u, v])| !self.mesh.store.is_edge(u, v, &mut ring));
        self.mesh.find_slits(&alive, pairs.reach, &mut all);
        all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        pairs.list.clear();
        pairs.list.extend(all.into_iter().map(|(_, ends)| Pair { ends, bound: UNKNOWN }));
        pairs.found_at =
            Some((self.mesh.store.generation, self.mesh.store.live_vertices, self.tally.collapses));
        verdict
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Returns the live vertices with their sites.
    fn sites(&self) -> (Vec<VertexId>, Vec<Site>) {
        let store = &self.store;
        let part_of = self.label_parts();
        let mut normals = vec![Vec3::ZERO; store.v.len()];
        for t in store.t.iter().filter(|t| t[0] != NONE) {
            let [a, b, c] = t.map(|w| store.p(w));
            let normal = (b - a).cross(c - a);
            t.iter().for_each(|w| normals[w.index()] += normal);
        }
        let alive: Vec<VertexId> =
            (0..store.v.len() as u32).map(VertexId).filter(|u| !store.v[u.index()].kind.is_gone()).collect();
        let sites = alive.iter().map(|&u| Site {
            p: store.p(u),
            part: part_of[u.index()],
            normal: normals[u.index()].normalize_or_zero(),
            out: self.outward_direction(u),
        });
        let sites = sites.collect();
        (alive, sites)
    }

    /// Returns the direction away from the surface in its plane for a vertex on a border; zero if its
    /// borders point in several directions.
    fn outward_direction(&self, u: VertexId) -> Option<Vec3> {
        let store = &self.store;
        if !store.v[u.index()].kind.is_feature() {
            return None;
        }
        let ring: Vec<[VertexId; 2]> =
            store.listed(u).iter().map(|c| [1, 2].map(|i| store.t[c.face()][(c.k() + i) % 3])).collect();
        let (mut out, mut length) = (Vec3::ZERO, 0f32);
        for &[a, b] in &ring {
            let (to_a, to_b) = (store.p(a) - store.p(u), store.p(b) - store.p(u));
            let normal = to_a.cross(to_b).normalize_or_zero();
            for (w, edge) in [(a, to_a), (b, -to_b)] {
                if ring.iter().filter(|r| r.contains(&w)).count() == 1 {
                    out += edge.cross(normal);
                    length += edge.length();
                }
            }
        }
        (length > 0.0)
            .then(|| if out.length() > 0.25 * length { out.normalize_or_zero() } else { Vec3::ZERO })
    }

    /// Adds border edges shorter than `reach` whose ends are also connected by another path of two border
    /// edges: to close such a slit three vertices are merged, which no edge collapse may do.
    fn find_slits(&mut self, alive: &[VertexId], reach: f32, all: &mut Vec<(f32, [VertexId; 2])>) {
        let (mut ru, mut rv) = (Ring::default(), Ring::default());
        for &u in alive {
            if !self.store.v[u.index()].kind.is_feature() {
                continue;
            }
            self.store.ring(u, &mut ru);
            if ru.len() > MAX_PAIR_FACES {
                continue;
            }
            for v in distinct(&ru).filter(|&v| v > u && faces_at(&ru, v) == 1) {
                let distance_sq = (self.store.p(v) - self.store.p(u)).length_squared();
                if distance_sq >= reach * reach || self.store.listed(v).len() > MAX_PAIR_FACES {
                    continue;
                }
                self.store.ring(v, &mut rv);
                let is_apex = |w: VertexId| ru.iter().any(|r| r.has(v) && r.has(w));
                let is_third = |w: VertexId| !is_apex(w) && faces_at(&ru, w) == 1 && faces_at(&rv, w) == 1;
                if distinct(&rv).any(is_third) {
                    all.push((distance_sq, [u, v]));
                }
            }
        }
    }
}

impl<M: Metric> Engine<M> {
    /// Contracts a pair, together with adjacent ones if that is better, if topology, guards and cost allow
    /// it. With `probe` changes nothing and returns the cost.
    fn contract(
        &mut self,
        [u, v]: [VertexId; 2],
        tau: f32,
        probe: bool,
        pairs: &mut Pairs,
    ) -> CollapseOutcome {
        let (reach, work) = (pairs.reach, &mut pairs.work);
        let is_gone = |w: VertexId| self.mesh.store.v[w.index()].kind.is_gone();
        if is_gone(u)
            || is_gone(v)
            || (self.mesh.store.p(v) - self.mesh.store.p(u)).length_squared() >= reach * reach
        {
            return CollapseOutcome::Later(f32::INFINITY);
        }
        // Adjacent pairs only add to the cost, so this is a lower bound; at any time, most pairs are too
        // expensive.
        let least = match self.mesh.place_pair(u, v, &mut work.ring) {
            Ok((_, cost)) => (cost + self.mesh.gap_cost(u, v)) * self.mesh.pair_cost_factor(u, v),
            Err(why) => return CollapseOutcome::Refused(why),
        };
        if least > tau && !probe {
            return CollapseOutcome::Later(least);
        }
        pairs.visits_left = pairs.visits_left.saturating_sub(1);
        self.mesh.store.ring(u, &mut work.ru);
        self.mesh.store.ring(v, &mut work.rv);
        let is_large = |w: VertexId| self.mesh.store.listed(w).len() > MAX_PAIR_FACES;
        if work.ru.len() + work.rv.len() > MAX_PAIR_FACES
            || work.ru.iter().chain(&work.rv).any(|r| is_large(r.a) || is_large(r.b))
        {
            return CollapseOutcome::Refused(Refusal::Valence);
        }
        work.bundle.set_pairs(&mut self.mesh.store, &[[u, v]]);
        let alone = work.bundle.effect(&mut self.mesh.store);
        if alone == Effect::Manifold {
            return self.try_bundle(tau, probe, work);
        }
        let mut why = Refusal::LinkCondition;
        if faces_at(&work.ru, v) == 0 {
            self.mesh.find_bundles(u, v, reach, work);
            for i in 0..work.bundles.len() {
                work.bundle.set_pairs(&mut self.mesh.store, &work.bundles[i].1);
                if work.bundle.effect(&mut self.mesh.store) != Effect::Manifold {
                    continue;
                }
                match self.try_bundle(tau, probe, work) {
                    CollapseOutcome::Refused(other) => why = other,
                    done => return done,
                }
            }
        }
        let may = match self.mesh.constraints.rules.topology {
            TopologyPolicy::Preserve => false,
            // A point where borders meet would be fixed, and block other collapses.
            TopologyPolicy::Relaxed => {
                let is_open = |w: VertexId| self.mesh.store.v[w.index()].kind.is_feature();
                alone == Effect::Singular && !is_open(u) && !is_open(v)
            }
            TopologyPolicy::Free => true,
        };
        if !may {
            return CollapseOutcome::Refused(why);
        }
        work.bundle.set_pairs(&mut self.mesh.store, &[[u, v]]);
        self.try_bundle(tau, probe, work)
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Finds bundles with adjacent pairs that may join the surfaces along an edge or by two faces, the
    /// nearest first.
    fn find_bundles(&mut self, u: VertexId, v: VertexId, reach: f32, work: &mut PairScratch) {
        let PairScratch { ru, rv, ring, bundles, .. } = work;
        bundles.clear();
        let apart =
            |mesh: &Self, x: VertexId, y: VertexId| (mesh.store.p(x) - mesh.store.p(y)).length_squared();
        let is_end = |w: VertexId| w == u || w == v;
        let side_of = |ring: &Ring| -> Vec<VertexId> {
            distinct(ring).filter(|&w| faces_at(ring, w) == 1 && !is_end(w)).collect()
        };
        let (sides_u, sides_v) = (side_of(ru), side_of(rv));
        for &x in &sides_u {
            for &y in sides_v.iter().filter(|y| **y != x) {
                let distance_sq = apart(self, x, y);
                if distance_sq < reach * reach && !self.store.is_edge(x, y, ring) {
                    bundles.push((distance_sq, vec![[u, v], [x.min(y), x.max(y)]]));
                }
            }
        }
        for r in ru.iter() {
            for s in rv.iter() {
                // Two faces that face each other have opposite winding.
                let others = [[r.a, s.b], [r.b, s.a]];
                if others.as_flattened().iter().any(|w| is_end(*w)) || r.a == s.a || r.b == s.b {
                    continue;
                }
                let mut sum = 0.0;
                let mut all = vec![[u, v]];
                for [x, y] in others.into_iter().filter(|[x, y]| x != y) {
                    let distance_sq = apart(self, x, y);
                    sum += distance_sq;
                    all.push([x.min(y), x.max(y)]);
                    if distance_sq >= reach * reach || self.store.is_edge(x, y, ring) {
                        all.clear();
                        break;
                    }
                }
                if all.len() > 1 {
                    bundles.push((sum, all));
                }
            }
        }
        keep_nearest(bundles);
    }
}

impl<M: Metric> Engine<M> {
    /// Places the pairs of a bundle, checks the guards, and contracts them if they cost at most `tau`.
    fn try_bundle(&mut self, tau: f32, probe: bool, work: &mut PairScratch) -> CollapseOutcome {
        let bundle = &mut work.bundle;
        if bundle.faces.iter().filter(|c| c.is_gone).count() >= self.mesh.store.live_faces {
            return CollapseOutcome::Refused(Refusal::Component);
        }
        if bundle.loses_locked(&mut self.mesh.store) {
            return CollapseOutcome::Refused(Refusal::Locked);
        }
        let (mut price, mut remembered, mut gaps) = (0f32, 0f32, 0f32);
        for i in 0..bundle.joints.len() {
            let joint = bundle.joints[i];
            match self.mesh.place_pair(joint.u, joint.v, &mut work.ring) {
                Ok((at, cost)) => {
                    bundle.joints[i].at = at;
                    remembered += cost;
                }
                Err(why) => return CollapseOutcome::Refused(why),
            }
            price = price.max(self.mesh.pair_cost_factor(joint.u, joint.v));
            gaps += self.mesh.gap_cost(joint.u, joint.v);
        }
        let loss = match self.mesh.plane_cost(bundle, &mut work.ring) {
            Ok(loss) => loss,
            Err(why) => return CollapseOutcome::Refused(why),
        };
        let plain = if self.mesh.cost.metric.is_memoryless() { loss } else { remembered } + gaps;
        let mut cost = plain;
        let tau = tau / price;
        for joint in &bundle.joints {
            if cost > tau && !probe {
                break;
            }
            let charge = self.mesh.sampled_pair_cost(
                joint,
                [cost, f32::INFINITY],
                &mut work.ring,
                &mut self.scratch,
                &mut self.tally,
            );
            cost = charge.map_or(cost, |charge| charge.cost);
        }
        if cost > tau || probe {
            return CollapseOutcome::Later(cost * price);
        }
        self.tally.collapse_cost += f64::from(plain);
        self.apply_bundle(bundle, &mut work.ring);
        let moved: Vec<VertexId> = bundle.joints.iter().map(|j| j.u).collect();
        self.log_change(bundle.faces.iter().map(|c| c.face), &moved, cost * price);
        CollapseOutcome::Done
    }
}

impl<M: Metric> Engine<M> {
    /// Applies the contraction: both vertices of each pair of the bundle become one.
    fn apply_bundle(&mut self, bundle: &Bundle, ring: &mut Ring) {
        let mut touched: Vec<VertexId> = bundle.faces.iter().flat_map(|c| c.before).collect();
        touched.sort_unstable();
        touched.dedup();
        for &joint in &bundle.joints {
            let Self { mesh, scratch, tally, .. } = self;
            if let Some(charge) = mesh.sampled_pair_cost(&joint, [0.0, f32::MAX], ring, scratch, tally)
                && charge.cost <= f32::MAX
            {
                let origins = [joint.u, joint.v].map(|w| mesh.store.v[w.index()].origin);
                mesh.hand_over_samples(origins, &charge, &mut scratch.samples);
            }
            self.merge_ends(joint.u, joint.v, joint.at, ring);
        }
        for c in bundle.faces.iter().filter(|c| c.is_gone) {
            self.mesh.store.remove_face(c.face);
        }
        touched.retain(|&w| bundle.vertex_after(w) == w);
        for &w in &touched {
            self.mesh.store.ring(w, ring);
            if ring.is_empty() {
                let x = &mut self.mesh.store.v[w.index()];
                x.kind = x.kind.gone();
                self.mesh.store.bound[w.index()] = f32::INFINITY;
                self.mesh.store.live_vertices -= 1;
            } else {
                self.mesh.chain_wedges_of(w, ring);
                self.mesh.store.bound[w.index()] = UNKNOWN;
            }
        }
        touched.retain(|w| !self.mesh.store.v[w.index()].kind.is_gone());
        for &w in &touched {
            self.mesh.refresh(w, ring);
            self.mesh.remove_lines(w);
        }
        self.tally.pairs_contracted += bundle.joints.len();
    }

    /// Moves all corners of `v` to `u`, at the position `at`.
    fn merge_ends(&mut self, u: VertexId, v: VertexId, at: Vec3, ring: &mut Ring) {
        let (x, z) = (self.mesh.store.v[u.index()], self.mesh.store.v[v.index()]);
        self.mesh.share_wedges(u, v, ring);
        self.mesh.store.ring(u, ring);
        let mut corners: Vec<_> = ring.iter().map(|r| r.corner).collect();
        self.mesh.store.ring(v, ring);
        for r in ring.iter() {
            // A face that contains both is removed with the bundle.
            if !r.has(u) {
                corners.push(r.corner);
            }
        }
        self.mesh.store.set_corners(u, &corners);
        // The merged vertex takes the number of the end whose position was kept: the result then contains
        // that vertex of the input.
        let [own, other] = [&x, &z].map(|end| end.p == at && !end.kind.is_moved());
        let kept_v = other && !own;
        let (origin, merged) = if kept_v { (z.origin, x.origin) } else { (x.origin, z.origin) };
        self.mesh.store.merged_into[merged.index()] = origin;
        if let Some(record) = &mut self.record {
            record.merge(merged, origin);
        }
        self.mesh.merge_cost_factors(origin, merged);
        if !self.mesh.cost.metric.is_memoryless() {
            let (d, y) = (z.p - x.p, at - x.p);
            self.mesh.store.v[u.index()].q =
                self.mesh.cost.metric.merged(&self.mesh.cost.metric.form(&x.q, &z.q, d), y);
            self.mesh.merge_lines([x.origin, z.origin], d, y);
        }
        let kept = &mut self.mesh.store.v[u.index()];
        let facing = x.facing.direction() + z.facing.direction();
        let agree = x.facing.direction().dot(z.facing.direction()) > 0.0;
        (kept.p, kept.origin, kept.kind) = (at, origin, x.kind.union(z.kind).moved(!(own || other)));
        // Surfaces that face each other have no common direction.
        kept.facing = if agree { Facing::of(facing) } else { Facing::default() };
        let removed = &mut self.mesh.store.v[v.index()];
        removed.kind = removed.kind.gone();
        self.mesh.store.bound[v.index()] = f32::INFINITY;
        self.mesh.store.live_vertices -= 1;
        self.tally.collapses += 1;
    }
}

#[cfg(test)]
mod tests;
