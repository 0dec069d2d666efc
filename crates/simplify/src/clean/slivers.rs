//! Faces without area.
//!
//! Each step that is taken lowers a measure, so that the steps come to an end: first the number of faces without area,
//! then, where that stays, the sum of the lengths of all edges. A face that is removed lowers the first. A turn beside a
//! face with area may leave none without, and lowers it too; one between two faces without area has to leave fewer of
//! them, or the same number and a shorter edge. (Without the last rule, two such faces beside each other turned their
//! common edge back and forth without end.) Only finitely many edges are possible, and [`TURNS`] keeps the number of steps
//! in proportion to that of faces.

use std::collections::HashMap;

use lodsmith_core::mesh::defects::is_zero_area;
use lodsmith_core::{VertexId, WedgeId};

use super::Work;

/// Turns that a face without area may begin: eight in all keep the steps linear in the faces. (Guessed; few need three.)
const TURNS: u8 = 8;

/// The edges that a face without area has a corner on.
type Edges = HashMap<(VertexId, VertexId), FacesAt>;

/// The faces at an edge: how many, and their numbers joined by exclusive or. So a face comes and goes at once however many
/// there are, and of two each tells the other.
#[derive(Clone, Copy, Default)]
struct FacesAt {
    count: usize,
    joined: usize,
}

/// What was done, and at what cost.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Mended {
    /// Faces that went or got an area.
    pub(super) faces: usize,
    /// Faces looked at, each as often as it was.
    pub(super) steps: usize,
}

/// Takes faces without area out.
///
/// A sliver's longest edge runs through its third corner. So the neighbour over that edge is divided there instead: the
/// edge is turned, and both faces have an area. Where there is no neighbour, or nothing beyond the other edges, the sliver goes. It stays where the longest
/// edge has more than two faces, is a seam or a border of regions, where the turned edge is there already, and where two
/// of its corners are all but one place.
/// Cost: O(n), whatever the number of faces at an edge.
pub(super) fn mend(work: &mut Work<'_>) -> Mended {
    let mut waiting: Vec<usize> =
        (0..work.faces.len()).rev().filter(|&f| is_sliver(work, work.faces[f])).collect();
    if waiting.is_empty() {
        return Mended::default();
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
    while let Some(f) = waiting.pop() {
        steps += 1;
        if gone[f] || turns[f] == TURNS || !is_sliver(work, work.faces[f]) {
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
        } else if count == 2 {
            let g = joined ^ f;
            if turn(work, &mut edges, f, longest, g) {
                // (Counted for the one that began it, so that each turn is.)
                turns[f] += 1;
                waiting.extend([f, g]);
            }
        }
    }
    work.drop_faces(|f| gone[f]);
    let after = (0..work.faces.len()).filter(|&f| is_sliver(work, work.faces[f])).count();
    Mended { faces: before.saturating_sub(after), steps }
}

fn length_sq(work: &Work<'_>, (a, b): (VertexId, VertexId)) -> f64 {
    let [a, b] = [a, b].map(|v| work.mesh.positions().view().get(v));
    (0..3).map(|i| (b[i] - a[i]).powi(2)).sum()
}

fn is_sliver(work: &Work<'_>, face: [WedgeId; 3]) -> bool {
    is_zero_area(work.places(face).map(|v| work.mesh.positions().view().get(v)))
}

/// The edge that leaves corner `k` of a face.
fn edge(work: &Work<'_>, f: usize, k: usize) -> (VertexId, VertexId) {
    let t = work.places(work.faces[f]);
    let (a, b) = (t[k], t[(k + 1) % 3]);
    (a.min(b), a.max(b))
}

fn add(work: &Work<'_>, edges: &mut Edges, f: usize) {
    for k in 0..3 {
        let at = edges.entry(edge(work, f, k)).or_default();
        *at = FacesAt { count: at.count + 1, joined: at.joined ^ f };
    }
}

fn remove(work: &Work<'_>, edges: &mut Edges, f: usize) {
    for k in 0..3 {
        let at = edges.entry(edge(work, f, k)).or_default();
        *at = FacesAt { count: at.count - 1, joined: at.joined ^ f };
    }
}

/// Turns the edge that leaves corner `k` of `f` and that it shares with `g`, if that may be.
///
/// ```text
///       c                c
///     / f \            / | \
///    a-----b    ->    a  |  b
///     \ g /            \ | /
///       d                d
/// ```
fn turn(work: &mut Work<'_>, edges: &mut Edges, f: usize, k: usize, g: usize) -> bool {
    let [fa, fb, fc] = [0, 1, 2].map(|i| work.faces[f][(k + i) % 3]);
    let same_region = work.regions.as_ref().is_none_or(|r| r[f] == r[g]);
    // The same wedges, the other way round.
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
