//! Removal of zero-area faces.
//!
//! Every step lowers a measure, so the process terminates: first the number of zero-area faces, then, if that
//! stays the same, the sum of all edge lengths. Removing a face lowers the first. A flip next to a face with
//! area must leave no zero-area face, and so lowers it too; a flip between two zero-area faces must leave
//! fewer of them, or the same number and a shorter edge. (Without the last rule, two adjacent ones flipped
//! their common edge back and forth without end.) Only finitely many edges are possible, and [`MAX_FLIPS`]
//! keeps the number of steps proportional to the number of faces.

use std::collections::HashMap;

use lodsmith_core::mesh::defects::is_zero_area;
use lodsmith_core::{VertexId, WedgeId};

use super::state::CleanState;

/// Maximum number of flips that one zero-area face may start, so that the steps are linear in the faces.
/// (Guessed; few need three.)
const MAX_FLIPS: u8 = 8;

/// Maximum number of rounds in which faces that had to stay are visited again, so that the steps are linear
/// in the faces. (Guessed; few models need a second visit.)
const ROUNDS: usize = 8;

/// The edges with a corner of a zero-area face.
type Edges = HashMap<(VertexId, VertexId), FacesAt>;

/// The faces at an edge: their number, and the exclusive or of their indices. Adding or removing a face takes
/// constant time, and of two faces each gives the other.
#[derive(Clone, Copy, Default)]
struct FacesAt {
    count: usize,
    joined: usize,
}

/// Result of the repair, and its cost.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SliverRepair {
    /// Faces that were removed or got an area.
    pub(super) faces: usize,
    /// Number of faces visited, repeats included.
    pub(super) steps: usize,
}

/// Removes zero-area faces.
///
/// The longest edge of a sliver runs through its third corner. So the neighbour over that edge is divided
/// there: the edge is flipped, and both faces get an area. If there is no neighbour, or none beyond the other
/// two edges, the sliver is removed. It stays if the longest edge has more than two faces, is a seam or a
/// border of regions, if the flipped edge already exists, and if two of its corners almost coincide; it is
/// visited again once others have been removed. Cost: O(n), whatever the number of faces at an edge.
pub(super) fn repair(work: &mut CleanState<'_>) -> SliverRepair {
    let mut waiting: Vec<usize> =
        (0..work.faces.len()).rev().filter(|&f| is_sliver(work, work.faces[f])).collect();
    if waiting.is_empty() {
        return SliverRepair::default();
    }
    let (before, mut steps) = (waiting.len(), 0);
    let mut is_near = vec![false; work.mesh.vertex_count()];
    for &f in &waiting {
        work.places(work.faces[f]).iter().for_each(|v| is_near[v.index()] = true);
    }
    let mut edges = Edges::new();
    for f in 0..work.faces.len() {
        if work.places(work.faces[f]).iter().any(|v| is_near[v.index()]) {
            add(work, &mut edges, f);
        }
    }
    let mut gone = vec![false; work.faces.len()];
    let mut turns = vec![0u8; work.faces.len()];
    let (mut slivers, mut changes) = (waiting.clone(), 0usize);
    for _ in 0..ROUNDS {
        let changes_before = changes;
        while let Some(f) = waiting.pop() {
            steps += 1;
            if gone[f] || turns[f] == MAX_FLIPS || !is_sliver(work, work.faces[f]) {
                continue;
            }
            let [a, b, c] = [0, 1, 2].map(|k| length_sq(work, edge(work, f, k)));
            let longest = if a >= b && a >= c {
                0
            } else if b >= c {
                1
            } else {
                2
            };
            let is_border = |k: usize| edges[&edge(work, f, k % 3)].count == 1;
            let is_fin = is_border(longest + 1) && is_border(longest + 2);
            let FacesAt { count, joined } = edges[&edge(work, f, longest)];
            if is_fin || count == 1 {
                remove(work, &mut edges, f);
                gone[f] = true;
                changes += 1;
            } else if count == 2 {
                let g = joined ^ f;
                if flip(work, &mut edges, f, longest, g) {
                    // (Counted for the face that started it, so that every flip counts.)
                    turns[f] += 1;
                    changes += 1;
                    waiting.extend([f, g]);
                }
            }
        }
        // A face that had to stay may be removable once its neighbours are gone.
        slivers.retain(|&f| !gone[f] && turns[f] < MAX_FLIPS && is_sliver(work, work.faces[f]));
        if slivers.is_empty() || changes == changes_before {
            break;
        }
        waiting.clone_from(&slivers);
    }
    work.drop_faces(|f| gone[f]);
    let after = (0..work.faces.len()).filter(|&f| is_sliver(work, work.faces[f])).count();
    SliverRepair { faces: before.saturating_sub(after), steps }
}

fn length_sq(work: &CleanState<'_>, (a, b): (VertexId, VertexId)) -> f64 {
    let [a, b] = [a, b].map(|v| work.mesh.positions().view().get(v));
    (0..3).map(|i| (b[i] - a[i]).powi(2)).sum()
}

fn is_sliver(work: &CleanState<'_>, face: [WedgeId; 3]) -> bool {
    is_zero_area(work.places(face).map(|v| work.mesh.positions().view().get(v)))
}

/// The edge that leaves corner `k` of a face.
fn edge(work: &CleanState<'_>, f: usize, k: usize) -> (VertexId, VertexId) {
    let t = work.places(work.faces[f]);
    let (a, b) = (t[k], t[(k + 1) % 3]);
    (a.min(b), a.max(b))
}

fn add(work: &CleanState<'_>, edges: &mut Edges, f: usize) {
    for k in 0..3 {
        let at = edges.entry(edge(work, f, k)).or_default();
        *at = FacesAt { count: at.count + 1, joined: at.joined ^ f };
    }
}

fn remove(work: &CleanState<'_>, edges: &mut Edges, f: usize) {
    for k in 0..3 {
        let at = edges.entry(edge(work, f, k)).or_default();
        *at = FacesAt { count: at.count - 1, joined: at.joined ^ f };
    }
}

/// Flips the edge that leaves corner `k` of `f` and is shared with `g`, if allowed.
///
/// ```text
///       c                c
///     / f \            / | \
///    a-----b    ->    a  |  b
///     \ g /            \ | /
///       d                d
/// ```
fn flip(work: &mut CleanState<'_>, edges: &mut Edges, f: usize, k: usize, g: usize) -> bool {
    let [fa, fb, fc] = [0, 1, 2].map(|i| work.faces[f][(k + i) % 3]);
    let same_region = work.regions.as_ref().is_none_or(|r| r[f] == r[g]);
    // The same wedges, in the opposite direction.
    let Some(j) = (0..3).find(|&j| work.faces[g][j] == fb && work.faces[g][(j + 1) % 3] == fa) else {
        return false;
    };
    let gd = work.faces[g][(j + 2) % 3];
    let [c, _, d] = work.places([fc, fa, gd]);
    let turned = (c.min(d), c.max(d));
    let is_there = edges.get(&turned).is_some_and(|at| at.count > 0);
    let new = [[fc, fa, gd], [gd, fb, fc]];
    let slivers = |faces: [[WedgeId; 3]; 2]| faces.into_iter().filter(|&t| is_sliver(work, t)).count();
    let is_better = match (is_sliver(work, work.faces[g]), slivers(new)) {
        (_, 0) => true,
        (true, 1) => true,
        (true, _) => length_sq(work, turned) < length_sq(work, edge(work, f, k)),
        (false, _) => false,
    };
    if !same_region || c == d || is_there || !is_better {
        return false;
    }
    remove(work, edges, f);
    remove(work, edges, g);
    [work.faces[f], work.faces[g]] = new;
    add(work, edges, f);
    add(work, edges, g);
    true
}
