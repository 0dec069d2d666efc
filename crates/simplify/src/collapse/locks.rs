//! What is asked for of single vertices: locked ones stay as they are, important ones are dearer.

use lodsmith_core::VertexId;

use super::LiveMesh;
use super::store::{Spoke, Store};
use crate::metric::{Metric, VertexMemory};
use crate::report::Refusal;

impl<Q: VertexMemory> Store<Q> {
    /// Locks vertices, by number in the ordered input; before anything was merged.
    pub(crate) fn lock(&mut self, locked: &[bool]) {
        for (x, &locked) in self.v.iter_mut().zip(locked) {
            x.kind = x.kind.locked(locked);
        }
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Prices of vertices, by number in the ordered input, as they are for the method that is without memory.
    pub(crate) fn set_prices(&mut self, prices: Option<Vec<f32>>) {
        self.constraints.prices = prices;
        if self.cost.metric.price_power() != 1.0 {
            self.constraints
                .prices
                .iter_mut()
                .flatten()
                .for_each(|p| *p = p.powf(self.cost.metric.price_power()));
        }
    }

    /// What the cost of merging two vertices, by number in the ordered input, counts times.
    #[inline(always)]
    pub(crate) fn price_weight(&self, kept: VertexId, removed: VertexId) -> f32 {
        match &self.constraints.prices {
            None => 1.0,
            Some(prices) => prices[kept.index()].max(prices[removed.index()]),
        }
    }

    /// The merged vertex is as important as the more important end.
    #[inline(always)]
    pub(crate) fn merge_prices(&mut self, origin: VertexId, merged: VertexId) {
        if let Some(prices) = &mut self.constraints.prices {
            prices[origin.index()] = prices[origin.index()].max(prices[merged.index()]);
        }
    }

    /// A vertex cut off from another is as important.
    pub(crate) fn copy_price(&mut self, of: VertexId) {
        if let Some(prices) = &mut self.constraints.prices {
            prices.push(prices[of.index()]);
        }
    }

    #[inline(always)]
    pub(crate) fn is_either_locked(&self, u: VertexId, v: VertexId) -> bool {
        self.store.v[u.index()].kind.is_locked() || self.store.v[v.index()].kind.is_locked()
    }

    /// Whether an end that is locked keeps its place and each of its wedges.
    #[inline(always)]
    pub(crate) fn check_locked(&self, u: VertexId, v: VertexId, ru: &[Spoke]) -> Result<(), Refusal> {
        if !self.is_either_locked(u, v) {
            return Ok(());
        }
        // Two places that single precision does not tell apart: which one stays could not be said.
        if self.store.p(u) == self.store.p(v) || !self.keeps_wedges(u, v, ru) {
            return Err(Refusal::Locked);
        }
        Ok(())
    }
}
