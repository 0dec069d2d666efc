//! Faces without area.

use std::collections::HashMap;

use lodsmith_core::mesh::defects::is_zero_area;
use lodsmith_core::{VertexId, WedgeId};

use super::Work;

/// Turns of the long edge that one face takes part in, at most: two faces without area side by side could go on for ever.
const TURNS: u8 = 8;

/// The faces at each edge that a sliver has a corner on.
type Edges = HashMap<(VertexId, VertexId), Vec<usize>>;

/// Takes faces without area out, and returns how many went or got an area.
///
/// A sliver's longest edge runs through its third corner. So the neighbour over that edge is divided there instead: the
/// edge is turned, and both faces have an area. Where there is no neighbour, or nothing beyond the other edges, the sliver goes. It stays where the longest
/// edge has more than two faces, is a seam or a border of regions, where the turned edge is there already, and where two
/// of its corners are all but one place.
pub(super) fn mend(work: &mut Work<'_>) -> usize {
    let mut waiting: Vec<usize> =
        (0..work.faces.len()).rev().filter(|&f| is_sliver(work, work.faces[f])).collect();
    if waiting.is_empty() {
        return 0;
    }
    let before = waiting.len();
    let mut is_near = vec![false; work.mesh.vertex_count()];
    for &f in &waiting {
        work.places(work.faces[f]).iter().for_each(|v| is_near[v.index()] = true);
    }
    let mut edges = Edges::new();
    for f in 0..work.faces.len() {
        if work.places(work.faces[f]).iter().any(|v| is_near[v.index()]) {
            for k in 0..3 {
                edges.entry(edge(work, f, k)).or_default().push(f);
            }
        }
    }
    let mut gone = vec![false; work.faces.len()];
    let mut turns = vec![0u8; work.faces.len()];
    while let Some(f) = waiting.pop() {
        if gone[f] || turns[f] == TURNS || !is_sliver(work, work.faces[f]) {
            continue;
        }
        let p = work.places(work.faces[f]).map(|v| work.mesh.positions().view().get(v));
        let length = |k: usize| (0..3).map(|i| (p[(k + 1) % 3][i] - p[k][i]).powi(2)).sum::<f64>();
        let longest = if length(0) >= length(1) && length(0) >= length(2) {
            0
        } else if length(1) >= length(2) {
            1
        } else {
            2
        };
        let is_border = |k: usize| edges[&edge(work, f, k % 3)].len() == 1;
        let is_fin = is_border(longest + 1) && is_border(longest + 2);
        match edges[&edge(work, f, longest)][..] {
            [..] if is_fin => {
                remove(work, &mut edges, f);
                gone[f] = true;
            }
            [_] => {
                remove(work, &mut edges, f);
                gone[f] = true;
            }
            [g, h] => {
                let g = if g == f { h } else { g };
                if turn(work, &mut edges, f, longest, g) {
                    for x in [f, g] {
                        turns[x] += 1;
                        waiting.push(x);
                    }
                }
            }
            _ => {}
        }
    }
    work.drop_faces(|f| gone[f]);
    let after = (0..work.faces.len()).filter(|&f| is_sliver(work, work.faces[f])).count();
    before.saturating_sub(after)
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

fn remove(work: &Work<'_>, edges: &mut Edges, f: usize) {
    for k in 0..3 {
        if let Some(at) = edges.get_mut(&edge(work, f, k)) {
            at.retain(|&x| x != f);
        }
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
    let is_there = edges.get(&(c.min(d), c.max(d))).is_some_and(|at| !at.is_empty());
    let new = [[fc, fa, gd], [gd, fb, fc]];
    let is_worse = !is_sliver(work, work.faces[g]) && new.iter().any(|&t| is_sliver(work, t));
    if !same_region || c == d || is_there || is_worse {
        return false;
    }
    remove(work, edges, f);
    remove(work, edges, g);
    [work.faces[f], work.faces[g]] = new;
    for x in [f, g] {
        for k in 0..3 {
            edges.entry(edge(work, x, k)).or_default().push(x);
        }
    }
    true
}
