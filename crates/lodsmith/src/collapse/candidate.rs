//! Candidates for a collapse: their evaluation, and the outcome of trying one.

use glam::Vec3;
use lodsmith_core::VertexId;
use wide::f32x4;

use super::ring::Ring;
use crate::report::Refusal;

/// Cosine between two faces at an edge below which they lie back to back.
pub(super) const FOLD_COS: f32 = -0.8;

/// Result of trying a collapse.
pub(crate) enum CollapseOutcome {
    Done,
    /// It costs this much, which is more than currently allowed.
    Later(f32),
    Refused(Refusal),
}

impl From<Refusal> for CollapseOutcome {
    fn from(why: Refusal) -> Self {
        Self::Refused(why)
    }
}

/// An evaluated collapse: the merged vertex moves to the kept one's position + `step`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) cost: f32,
    pub(crate) removed: VertexId,
    pub(crate) step: Vec3,
    /// The quadratic form at the new position, unless cancellation left less than a relative 1e-5 of it; then
    /// 0. (Four are computed side by side, and 0 marks the lanes without a value.)
    pub(crate) form_cost: f32,
}

/// An edge to be collapsed, and the current limits.
#[derive(Clone, Copy)]
pub(crate) struct Attempt<'a> {
    pub(crate) kept: VertexId,
    pub(crate) candidate: &'a Candidate,
    /// Highest cost that is currently allowed.
    pub(crate) tau: f32,
    /// True if only the cost is computed and nothing is changed.
    pub(crate) is_probe: bool,
    /// Rings of the kept and the removed end.
    pub(crate) rings: [&'a Ring; 2],
}

/// Results of evaluating the edges of a vertex.
#[derive(Debug, Default)]
pub(crate) struct Found {
    /// Candidates within the cost limit, in the order of the ring.
    pub(crate) within: Vec<Candidate>,
    /// Lowest costs above the limit, by lane.
    pub(super) beyond: f32x4,
}

impl Found {
    pub(crate) fn clear(&mut self) {
        self.within.clear();
        self.beyond = f32x4::splat(f32::INFINITY);
    }

    pub(super) fn add(&mut self, candidate: Candidate, max_cost: f32) {
        if candidate.cost <= max_cost {
            self.within.push(candidate);
        } else {
            self.beyond = f32x4::splat(candidate.cost).fast_min(self.beyond);
        }
    }

    /// Returns the lowest cost above the limit.
    pub(crate) fn beyond(&self) -> f32 {
        self.beyond.to_array().into_iter().fold(f32::INFINITY, f32::min)
    }

    /// Removes and returns the cheapest candidate, the first among equals.
    pub(crate) fn take_cheapest(&mut self) -> Option<Candidate> {
        let cost = |i: usize| self.within[i].cost;
        let cheapest = (0..self.within.len()).min_by(|&i, &j| cost(i).total_cmp(&cost(j)))?;
        Some(self.within.swap_remove(cheapest))
    }
}

/// The edges from a vertex to its neighbours that come after it.
pub(super) struct OwnedEdges<'a> {
    pub(super) u: VertexId,
    pub(super) owned: &'a [VertexId],
    pub(super) ring: &'a Ring,
    /// Cost limit: edges above it are not listed one by one.
    pub(super) max_cost: f32,
    /// True if each end has a single wedge (`LiveMesh::cache_wedge_reductions`).
    pub(super) have_single_wedges: bool,
}

/// Position of the merged vertex: exactly the removed end's if the step leads there.
#[inline(always)]
pub(crate) fn merged_position(kept: Vec3, removed: Vec3, step: Vec3) -> Vec3 {
    if step == removed - kept { removed } else { kept + step }
}
