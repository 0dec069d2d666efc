//! The visit to a vertex: its edges are evaluated, and the cheapest is collapsed.

use glam::Vec3;
use lodsmith_core::VertexId;
use wide::f32x8;

use super::attributes::Member;
use super::bound::UNKNOWN;
use super::candidate::{Attempt, Candidate, CollapseOutcome, Found, OwnedEdges};
use super::hub_budget::HubBudget;
use super::ring::Ring;
use super::{Engine, LiveMesh};
use crate::cost::metric::Metric;
use crate::options::Placement;
use crate::report::Refusal;

/// Scratch buffers of a visit, allocated once.
#[derive(Default)]
pub(super) struct VisitScratch {
    pub(super) ru: Ring,
    pub(super) rv: Ring,
    pub(super) owned: Vec<VertexId>,
    pub(super) found: Found,
    pub(super) members: Vec<Member>,
}

impl<M: Metric> Engine<M> {
    /// Evaluates all edges that `u` owns, at any cost; leaves its ring in the scratch.
    #[inline(never)]
    pub(super) fn evaluate_at_any_cost(&mut self, u: VertexId, scratch: &mut VisitScratch) {
        let VisitScratch { ru, owned, found, members, .. } = scratch;
        self.mesh.store.ring(u, ru);
        let Self { mesh, scratch, tally, .. } = self;
        mesh.store.list_owned(u, ru, owned, &mut scratch.marks);
        found.clear();
        let are_lone = mesh.cache_wedge_reductions(u, owned);
        let edges = OwnedEdges { u, owned, ring: ru, max_cost: f32::INFINITY, have_single_wedges: are_lone };
        mesh.evaluate_owned(&edges, members, found, scratch, tally);
    }

    /// Evaluates the edges that u owns, collapses the cheapest possible one that costs at most tau, and
    /// updates `bound[u]`.
    pub(super) fn visit(&mut self, u: VertexId, tau: f32, probe: bool, scratch: &mut VisitScratch) {
        let VisitScratch { ru, rv, owned, found, members } = scratch;
        self.mesh.store.ring(u, ru);
        found.clear();
        self.tally.faces_visited += ru.len() as u64;
        let Self { mesh, scratch, tally, .. } = self;
        let owned = if mesh.store.v[u.index()].kind.is_regular() {
            list_owned_in_fan(u, ru, owned)
        } else {
            mesh.store.list_owned(u, ru, owned, &mut scratch.marks);
            &owned[..]
        };
        let are_lone = mesh.cache_wedge_reductions(u, owned);
        let edges = OwnedEdges { u, owned, ring: ru, max_cost: tau, have_single_wedges: are_lone };
        let stuck = mesh.evaluate_owned(&edges, members, found, scratch, tally);
        let mut least = found.beyond();
        let kind = self.mesh.store.v[u.index()].kind;
        let why = match () {
            () if kind.is_locked() => Refusal::Locked,
            () if kind.is_border() => Refusal::Border,
            () => Refusal::NonManifold,
        };
        self.tally.refusals[why as usize] += stuck;
        let mut may_retry = false;
        while let Some(candidate) = found.take_cheapest() {
            if let Some(bounded) = &self.mesh.bounded
                && !probe
            {
                let ends = [u, candidate.removed].map(|w| self.mesh.store.v[w.index()].origin);
                if bounded.was_refused(ends, candidate.cost) {
                    continue;
                }
            }
            // A vertex that has not been visited yet owns edges of unknown cost; they are evaluated in the
            // next sweep.
            let inherited = match self.mesh.store.bound[candidate.removed.index()] {
                UNKNOWN => tau,
                bound => bound,
            };
            if !self.tally.hub_budget.admit(ru.len() + self.mesh.store.listed(candidate.removed).len()) {
                self.tally.refuse(Refusal::Valence);
                if !probe {
                    least = least.min(4.0 * tau + 1e-20);
                }
                if HubBudget::is_hub(ru.len()) {
                    // All other edges of a hub exceed the budget too.
                    break;
                }
                continue;
            }
            self.mesh.store.ring(candidate.removed, rv);
            match self.collapse(&Attempt {
                kept: u,
                candidate: &candidate,
                tau,
                is_probe: probe,
                rings: [&*ru, &*rv],
            }) {
                CollapseOutcome::Done if self.mesh.bounded.is_some() => {
                    // Edges that were refused before may be possible now.
                    self.mesh.store.bound[u.index()] = UNKNOWN;
                    return;
                }
                CollapseOutcome::Done => {
                    least = found.within.iter().fold(least.min(inherited), |l, f| l.min(f.cost));
                    break;
                }
                CollapseOutcome::Later(cost) => least = least.min(cost),
                CollapseOutcome::Refused(why) => {
                    self.tally.refuse(why);
                    if let (Some(bounded), Refusal::ErrorLimit) = (&mut self.mesh.bounded, why) {
                        let ends = [u, candidate.removed].map(|w| self.mesh.store.v[w.index()].origin);
                        bounded.set_witness(ends, self.scratch.bounded.witness);
                        continue;
                    }
                    may_retry = true;
                    if let Some(other) = self.mesh.candidate_at_end(u, &candidate, why, tau, ru, members) {
                        found.within.push(other);
                    } else if !probe {
                        // Retried at a higher threshold: the neighbourhood may change until then.
                        least = least.min(4.0 * tau + 1e-20);
                    }
                }
            }
        }
        self.mesh.store.bound[u.index()] = least;
        let origin = self.mesh.store.v[u.index()].origin;
        // (Other refusals may end at a higher threshold, where a collapse onto an end is cheap enough.)
        if let Some(bounded) = &mut self.mesh.bounded
            && !probe
            && !may_retry
        {
            bounded.set_tried(origin, tau);
        }
    }
}

/// Lists the edges that a vertex inside a closed fan owns: every neighbour comes first in one of the
/// triangles, so the second ones need not be visited. (Branchless: each is written, some are kept; a branch
/// on the order would be unpredictable.)
#[inline(always)]
fn list_owned_in_fan<'a>(u: VertexId, ring: &Ring, owned: &'a mut Vec<VertexId>) -> &'a [VertexId] {
    if owned.len() < ring.len() {
        owned.resize(ring.len(), u);
    }
    let (slots, mut n) = (&mut owned[..ring.len()], 0);
    for r in ring.iter() {
        slots[n] = r.a;
        n += usize::from(r.a > u);
    }
    &owned[..n]
}

impl<M: Metric> LiveMesh<M> {
    /// Returns a collapse onto one of the ends, the kept one first, if faces would turn or vanish at the
    /// best position and the end costs at most tau.
    pub(super) fn candidate_at_end(
        &self,
        u: VertexId,
        refused: &Candidate,
        why: Refusal,
        tau: f32,
        ru: &Ring,
        members: &mut Vec<Member>,
    ) -> Option<Candidate> {
        let v = refused.removed;
        let (x, z) = (&self.store.v[u.index()], &self.store.v[v.index()]);
        let turned = matches!(why, Refusal::NormalFlip | Refusal::Quality);
        let is_open = self.constraints.rules.placement == Placement::Optimal
            && !self.cost.metric.cost_source().is_decided_by_metric();
        if !(turned && is_open && x.kind.is_free() && z.kind.is_free()) {
            return None;
        }
        let d = z.p - x.p;
        let step = match refused.step {
            step if step == d => return None,
            Vec3::ZERO => d,
            _ => Vec3::ZERO,
        };
        let cost = self.cost_at(u, v, step, ru, members);
        let other = Candidate { step, cost, removed: v, form_cost: 0.0 };
        (other.cost <= tau).then_some(other)
    }
}

/// Lists the vertices that a sweep visits; `bounds` has the bounds of the vertices from `start` on.
pub(super) fn list_visits(bounds: &[f32], start: usize, tau: f32, all: bool, visits: &mut Vec<VertexId>) {
    visits.clear();
    let id = |i: usize| VertexId((start + i) as u32);
    if all {
        visits.extend((0..bounds.len()).map(id));
        return;
    }
    let (eights, rest) = bounds.as_chunks::<8>();
    for (k, &eight) in eights.iter().enumerate() {
        let mut low = f32x8::from(eight).simd_le(f32x8::splat(tau)).to_bitmask();
        while low != 0 {
            visits.push(id(8 * k + low.trailing_zeros() as usize));
            low &= low - 1;
        }
    }
    let first = 8 * eights.len();
    visits.extend(rest.iter().enumerate().filter(|x| *x.1 <= tau).map(|x| id(first + x.0)));
}
