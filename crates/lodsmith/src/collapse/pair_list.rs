//! Pairs of vertices that may be contracted, with their last known costs.

use lodsmith_core::VertexId;

use super::bundle::Bundle;
use super::invariants::need;
use super::ring::Ring;
use super::store::Store;
use crate::cost::metric::VertexMemory;

/// Budget for the search for pairs and for visits to the faces around them, per vertex of the input; when it
/// is spent, no more pairs are contracted. (A level of 1,194 parts took 300,000 visits and 400 searches until
/// nothing was left to contract, half a minute in all; contractions after the first tenth of that improved
/// nothing.)
const VISITS_PER_VERTEX: usize = 8;
/// Additional budget, since on small meshes pairs are searched for after every sweep.
const FREE_VISITS: usize = 100_000;

/// Two vertices, the kept one first, and the last known cost of their contraction.
#[derive(Clone, Copy)]
pub(super) struct Pair {
    pub(super) ends: [VertexId; 2],
    pub(super) bound: f32,
}

/// Candidate pairs for contraction.
#[derive(Clone)]
pub(crate) struct Pairs {
    /// Search distance.
    pub(super) reach: f32,
    pub(super) list: Vec<Pair>,
    /// State at the last search: numbering of the store, live vertices, and collapses.
    pub(super) found_at: Option<(u32, usize, u64)>,
    /// Remaining budget of visits to the faces around a pair.
    pub(super) visits_left: usize,
    pub(super) work: PairScratch,
}

/// Scratch buffers for one pair, allocated once.
#[derive(Clone, Default)]
pub(super) struct PairScratch {
    pub(super) bundle: Bundle,
    pub(super) ru: Ring,
    pub(super) rv: Ring,
    pub(super) ring: Ring,
    pub(super) bundles: Vec<(f32, Vec<[VertexId; 2]>)>,
}

impl Pairs {
    pub(crate) fn new(reach: f32, vertices: usize) -> Self {
        let looks_left = VISITS_PER_VERTEX.saturating_mul(vertices).saturating_add(FREE_VISITS);
        Self {
            reach,
            list: Vec::new(),
            found_at: None,
            visits_left: looks_left,
            work: PairScratch::default(),
        }
    }
    /// Returns an error if the current pairs are inconsistent; skipped if vertices were renumbered since
    /// the search.
    pub(super) fn check<Q: VertexMemory>(&self, store: &Store<Q>) -> Result<(), String> {
        if self.found_at.is_none_or(|at| at.0 != store.generation) {
            return Ok(());
        }
        let count = store.v.len();
        for &Pair { ends: [u, v], bound } in &self.list {
            need(u < v && v.index() < count, || format!("{u} and {v} of {count} vertices are a pair"))?;
            need(bound >= 0.0, || format!("the pair {u} and {v} has the bound {bound}"))?;
        }
        Ok(())
    }
    pub(super) fn bounds(&self) -> impl Iterator<Item = f32> + '_ {
        self.list.iter().map(|p| p.bound)
    }
}
