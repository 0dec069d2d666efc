//! Constraints on single vertices: locked ones stay unchanged, important ones cost more.

use glam::Vec3;
use lodsmith_core::VertexId;

use super::LiveMesh;
use super::ring::Spoke;
use super::store::Store;
use super::vertex::Vertex;
use crate::cost::metric::{Metric, VertexMemory};
use crate::report::Refusal;

/// Weight of the squared displacement of an important vertex in a quick pass, times the area of its star: it
/// counts like a distance from the surface. (As in meshoptimizer.)
const IMPORTANT_MOVE: f32 = 1.0;

impl<Q: VertexMemory> Store<Q> {
    /// Locks vertices, by number in the ordered input, before any collapse.
    pub(crate) fn lock(&mut self, locked: &[bool]) {
        for (x, &locked) in self.v.iter_mut().zip(locked) {
            x.kind = x.kind.locked(locked);
        }
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Sets the weights of vertices, by number in the ordered input, as given for the memoryless metric.
    pub(crate) fn set_cost_factors(&mut self, prices: Option<Vec<f32>>) {
        self.constraints.cost_factors = prices;
        if self.cost.metric.cost_factor_exponent() != 1.0 {
            self.constraints
                .cost_factors
                .iter_mut()
                .flatten()
                .for_each(|p| *p = libm::powf(*p, self.cost.metric.cost_factor_exponent()));
        }
    }

    /// Returns the factor of the cost of merging two vertices, given by number in the ordered input.
    #[inline(always)]
    pub(crate) fn cost_factor(&self, kept: VertexId, removed: VertexId) -> f32 {
        match &self.constraints.cost_factors {
            None => 1.0,
            Some(prices) => prices[kept.index()].max(prices[removed.index()]),
        }
    }

    /// Gives the merged vertex the weight of the more important end.
    #[inline(always)]
    pub(crate) fn merge_cost_factors(&mut self, origin: VertexId, merged: VertexId) {
        if let Some(prices) = &mut self.constraints.cost_factors {
            prices[origin.index()] = prices[origin.index()].max(prices[merged.index()]);
        }
    }

    /// Gives a vertex created by a cut the weight of its original.
    pub(crate) fn copy_cost_factor(&mut self, of: VertexId) {
        if let Some(prices) = &mut self.constraints.cost_factors {
            prices.push(prices[of.index()]);
        }
    }

    /// Returns the cost of moving both ends, in a quick pass: this keeps faces regular, and important
    /// vertices in place even where the surface is flat. It does not count in the estimate of the error.
    pub(super) fn cost_of_moves(&self, ends: [&Vertex<M::Memory>; 2], steps: [Vec3; 2], area: f32) -> f32 {
        let factors = self.constraints.cost_factors.as_deref();
        let is_important = |end: &Vertex<M::Memory>| factors.is_some_and(|f| f[end.origin.index()] > 1.0);
        let weight =
            |end| if is_important(end) { IMPORTANT_MOVE } else { self.constraints.rules.move_weight };
        let squares = ends.iter().zip(steps).map(|(end, step)| weight(end) * step.length_squared());
        area * squares.sum::<f32>()
    }

    #[inline(always)]
    pub(crate) fn is_either_locked(&self, u: VertexId, v: VertexId) -> bool {
        self.store.v[u.index()].kind.is_locked() || self.store.v[v.index()].kind.is_locked()
    }

    /// Checks that a locked end keeps its position and each of its wedges.
    #[inline(always)]
    pub(crate) fn check_locked(&self, u: VertexId, v: VertexId, ru: &[Spoke]) -> Result<(), Refusal> {
        if !self.is_either_locked(u, v) {
            return Ok(());
        }
        // If both positions are equal in single precision, it is undefined which one stays.
        if self.store.p(u) == self.store.p(v) || !self.keeps_wedges(u, v, ru) {
            return Err(Refusal::Locked);
        }
        Ok(())
    }
}
