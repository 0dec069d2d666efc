//! The grid for a count.

use super::faces::{self, Face, Shares};
use super::grid::{FINEST, Grid};
use super::locked::Locked;
use super::model::{Model, Place};
use super::sample::{Counter, Guess};
use crate::collapse::Goal;

/// Which cluster each vertex is in, and the faces between them.
pub(super) struct Clusters {
    pub(super) grid: Grid,
    /// For each vertex of the input.
    pub(super) of: Vec<u32>,
    /// The cell of each cluster, so far along each axis.
    pub(super) cells: Vec<[u32; 3]>,
    /// The first cluster that is a locked place and not a cell.
    pub(super) first_locked: usize,
    /// By the shares of their least clusters.
    pub(super) faces: Vec<Vec<Face>>,
    pub(super) shares: Shares,
}

impl Clusters {
    pub(super) fn new<P: Place>(model: &Model<'_, P>, locked: &Locked, resolution: f64) -> Self {
        let grid = Grid::new(model, resolution);
        let (mut of, mut cells) = grid.cells(model);
        let first_locked = cells.len();
        locked.set_apart(&mut of, first_locked);
        cells.extend(locked.places.iter().map(|v| grid.cell_of(model, v.index())));
        let (faces, shares) = faces::between(&model.faces, &of, cells.len());
        Self { grid, of, cells, first_locked, faces, shares }
    }

    /// How many faces there are.
    pub(super) fn face_count(&self) -> usize {
        self.faces.iter().map(Vec::len).sum()
    }

    /// Clusters with a face.
    pub(super) fn vertices(&self) -> usize {
        let mut is_used = vec![false; self.cells.len()];
        self.faces.iter().flatten().flat_map(|f| f.corners).for_each(|c| is_used[c as usize] = true);
        is_used.iter().filter(|u| **u).count()
    }
}

/// Passes over the whole mesh in search of a count, at most.
const PASSES: usize = 12;
/// A count is near enough from so far below the goal on, as a share of it; after so many passes ...
const NEAR: f64 = 0.06;
const PATIENCE: usize = 4;
/// ... from as far as this; and where there are so few that a cell more or less is a jump, from farther.
const LEAST_NEAR: f64 = 0.1;
fn near(goal: usize, pass: usize) -> f64 {
    let by_pass = if pass < PATIENCE { NEAR } else { LEAST_NEAR };
    by_pass.max((goal.max(1) as f64).sqrt().recip().min(0.25))
}
/// How far below the goal is aimed at, in what is near enough at first.
const AIM: f64 = 0.4;
/// Of faces with corners in three cells so many are left when each stands once. (Measured: 0.96 to 1.)
const DISTINCT: f64 = 0.992;

/// How a search for a count came out.
pub(super) struct Found {
    /// The most faces within the goal; the fewest, if none are.
    pub(super) clusters: Clusters,
    pub(super) is_within: bool,
}

/// Searches for the finest grid that keeps the goal, none coarser than `coarsest`. `go_on` is asked before each pass: with
/// the share that is done; false ends the search with what there is.
pub(super) fn search<P: Place, E>(
    model: &Model<'_, P>,
    locked: &Locked,
    goal: Goal,
    coarsest: Option<f64>,
    mut go_on: impl FnMut(f64) -> Result<bool, E>,
) -> Result<Found, E> {
    let excess = |clusters: &Clusters| {
        let of = |count: usize, goal: usize| count as f64 / goal.max(1) as f64;
        let by_faces = goal.faces.map(|n| of(clusters.face_count(), n));
        let by_vertices = goal.vertices.map(|n| of(clusters.vertices(), n));
        // The first one met is enough.
        by_faces.into_iter().chain(by_vertices).fold(f64::INFINITY, f64::min)
    };
    let wanted = goal.faces.into_iter().chain(goal.vertices.map(|n| n.saturating_mul(2))).max();
    let coarsest = coarsest.unwrap_or(1.0);
    // Bounds of the resolution: too coarse or just right, and too fine.
    let (mut low, mut high) = (coarsest, FINEST);
    let count = wanted.unwrap_or(usize::MAX);
    let aim = 1.0 - AIM * near(count, 0);
    let Guess { mut resolution, slope } = match wanted {
        Some(n) => {
            let faces = (aim * n.max(1) as f64).min(0.9 * model.faces.len() as f64);
            Counter::new(model).guess(faces / DISTINCT, [low, high])
        }
        None => Guess { resolution: coarsest, slope: 2.0 },
    };
    let mut best: Option<(Clusters, f64)> = None;
    for pass in 0..PASSES {
        if !go_on(pass as f64 / PASSES as f64)? && best.is_some() {
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
            *share <= 1.0 && best.face_count() > 0 && *share >= 1.0 - near(count, pass)
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
        let wish = resolution * (aim / now.max(0.01)).powf(1.0 / slope);
        resolution = if wish > low && wish < high { wish } else { (low * high).sqrt() };
        if pass + 2 == PASSES && best.as_ref().is_some_and(|b| b.0.face_count() == 0) {
            resolution = high;
        }
    }
    let (clusters, now) = best.expect("there is a first pass");
    Ok(Found { is_within: now <= 1.0, clusters })
}
