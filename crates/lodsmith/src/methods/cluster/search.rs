//! Search for the grid that meets a count.

use super::faces::{self, ClusterFace, Shares};
use super::grid::{ClusterGrid, MAX_RESOLUTION};
use super::locked::LockedPositions;
use super::model::{ClusterInput, ClusterPosition};
use super::sample::{Counter, Guess};
use crate::collapse::Goal;

/// Assignment of vertices to clusters, and the faces between them.
pub(super) struct Clusters {
    pub(super) grid: ClusterGrid,
    /// Cluster of each vertex of the input.
    pub(super) of: Vec<u32>,
    /// Grid coordinates of the cell of each cluster.
    pub(super) cells: Vec<[u32; 3]>,
    /// Index of the first cluster that is a locked position instead of a cell.
    pub(super) first_locked: usize,
    /// Faces by the share of their lowest cluster.
    pub(super) faces: Vec<Vec<ClusterFace>>,
    pub(super) shares: Shares,
}

impl Clusters {
    pub(super) fn new<P: ClusterPosition>(
        model: &ClusterInput<'_, P>,
        locked: &LockedPositions,
        resolution: f64,
    ) -> Self {
        let grid = ClusterGrid::new(model, resolution);
        let (mut of, mut cells) = grid.cells(model);
        let first_locked = cells.len();
        locked.assign_clusters(&mut of, first_locked);
        cells.extend(locked.places.iter().map(|v| grid.cell_of(model, v.index())));
        let (faces, shares) = faces::faces_between(&model.faces, &of, cells.len());
        Self { grid, of, cells, first_locked, faces, shares }
    }

    /// Number of faces.
    pub(super) fn face_count(&self) -> usize {
        self.faces.iter().map(Vec::len).sum()
    }

    /// Number of clusters with a face.
    pub(super) fn vertices(&self) -> usize {
        let mut is_used = vec![false; self.cells.len()];
        self.faces.iter().flatten().flat_map(|f| f.corners).for_each(|c| is_used[c as usize] = true);
        is_used.iter().filter(|u| **u).count()
    }
}

/// Maximum number of passes over the whole mesh in a search.
const MAX_PASSES: usize = 12;
/// Accepted shortfall below the goal, as a share of it, in the first `FIRST_PASSES` passes.
const FIRST_SHORTFALL: f64 = 0.06;
const FIRST_PASSES: usize = 4;
/// Accepted shortfall after that; for small goals, where one cell changes the count a lot, it is larger.
const LATE_SHORTFALL: f64 = 0.1;
fn accepted_shortfall(goal: usize, pass: usize) -> f64 {
    let by_pass = if pass < FIRST_PASSES { FIRST_SHORTFALL } else { LATE_SHORTFALL };
    by_pass.max((goal.max(1) as f64).sqrt().recip().min(0.25))
}
/// Shortfall that the search aims at, as a share of the accepted one.
const AIMED_SHORTFALL: f64 = 0.4;
/// Share of the faces with corners in three cells that remain without duplicates. (Measured: 0.96 to 1.)
const DISTINCT_SHARE: f64 = 0.992;

/// Result of a search for a count.
pub(super) struct SearchResult {
    /// The result with the most faces within the goal; if there is none, the result with the fewest.
    pub(super) clusters: Clusters,
    pub(super) is_within: bool,
}

/// Searches for the finest grid within the goal, none coarser than `coarsest`. Calls `should_continue` before
/// each pass with the share done; false ends the search with the best result so far.
pub(super) fn search<P: ClusterPosition, E>(
    model: &ClusterInput<'_, P>,
    locked: &LockedPositions,
    goal: Goal,
    coarsest: Option<f64>,
    mut should_continue: impl FnMut(f64) -> Result<bool, E>,
) -> Result<SearchResult, E> {
    let excess = |clusters: &Clusters| {
        let of = |count: usize, goal: usize| count as f64 / goal.max(1) as f64;
        let by_faces = goal.faces.map(|n| of(clusters.face_count(), n));
        let by_vertices = goal.vertices.map(|n| of(clusters.vertices(), n));
        // The stop met first is enough.
        by_faces.into_iter().chain(by_vertices).fold(f64::INFINITY, f64::min)
    };
    let wanted = goal.faces.into_iter().chain(goal.vertices.map(|n| n.saturating_mul(2))).max();
    let coarsest = coarsest.unwrap_or(1.0);
    // Bounds of the resolution: too coarse or within the goal, and too fine.
    let (mut low, mut high) = (coarsest, MAX_RESOLUTION);
    let count = wanted.unwrap_or(usize::MAX);
    let aim = 1.0 - AIMED_SHORTFALL * accepted_shortfall(count, 0);
    let Guess { mut resolution, slope } = match wanted {
        Some(n) => {
            let faces = (aim * n.max(1) as f64).min(0.9 * model.faces.len() as f64);
            Counter::new(model).guess(faces / DISTINCT_SHARE, [low, high])
        }
        None => Guess { resolution: coarsest, slope: 2.0 },
    };
    let mut best: Option<(Clusters, f64)> = None;
    for pass in 0..MAX_PASSES {
        if !should_continue(pass as f64 / MAX_PASSES as f64)? && best.is_some() {
            break;
        }
        let clusters = Clusters::new(model, locked, resolution);
        let is_empty = clusters.face_count() == 0;
        let now = if wanted.is_some() { excess(&clusters) } else { 1.0 };
        let is_better = best.as_ref().is_none_or(|(old, before)| match (old.face_count() == 0, is_empty) {
            (false, false) if now <= 1.0 => *before > 1.0 || now > *before,
            (false, false) => *before > 1.0 && now < *before,
            (old_is_empty, _) => old_is_empty,
        });
        if is_better {
            best = Some((clusters, now));
        }
        let is_near = |(best, share): &(Clusters, f64)| {
            *share <= 1.0 && best.face_count() > 0 && *share >= 1.0 - accepted_shortfall(count, pass)
        };
        if wanted.is_none() || now > 1.0 && resolution <= coarsest || best.as_ref().is_some_and(is_near) {
            break;
        }
        if now <= 1.0 {
            low = low.max(resolution);
        } else {
            high = high.min(resolution);
        }
        if high <= low * (1.0 + 1e-6) {
            break;
        }
        let next = resolution * libm::pow(aim / now.max(0.01), 1.0 / slope);
        resolution = if next > low && next < high { next } else { (low * high).sqrt() };
        if pass + 2 == MAX_PASSES && best.as_ref().is_some_and(|b| b.0.face_count() == 0) {
            resolution = high;
        }
    }
    let (clusters, now) = best.expect("there is a first pass");
    Ok(SearchResult { is_within: now <= 1.0, clusters })
}
