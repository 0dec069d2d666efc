//! Topological effect of contracting several pairs of vertices at once.
//!
//! ```text
//!     --x----u--      --x----u--        --*----*--      One pair from two borders would connect them
//!                       |  ⇒   |   or     (both)        only in a point. Two pairs join them along an
//!     --y----v--      --y----v--        --*----*--      edge, and three pairs join two faces, which
//!                                                       then lie back to back and are removed.
//! ```
//!
//! The change is evaluated as a whole, from the faces that it touches and their edges, before it is
//! applied.

use glam::Vec3;
use lodsmith_core::VertexId;

use super::ring::{Ring, faces_at};
use super::store::Store;
use crate::cost::metric::VertexMemory;

/// Two vertices that are merged: `v` into `u`, both move to `at`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    pub(super) u: VertexId,
    pub(super) v: VertexId,
    pub(super) at: Vec3,
}

/// A face of a star, before and after.
#[derive(Clone, Copy, Debug)]
pub(super) struct Changed {
    pub(super) face: usize,
    pub(super) before: [VertexId; 3],
    pub(super) after: [VertexId; 3],
    /// True if it becomes degenerate or a duplicate.
    pub(super) is_gone: bool,
}

/// Pairs, and the faces changed by their contraction.
#[derive(Clone, Default)]
pub(super) struct Bundle {
    pub(super) joints: Vec<Joint>,
    pub(super) faces: Vec<Changed>,
    ring: Ring,
    edges: Vec<(VertexId, VertexId, bool)>,
}

/// Effect of a contraction on the topology.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    /// All touched vertices are inside, or on the border of, a single fan.
    Manifold,
    /// Fans are connected only in a vertex. No count of faulty edges rises.
    Singular,
    /// There would be more border edges, more edges with three or more faces, more edges whose faces are
    /// wound differently, or a vertex without faces.
    Worse,
}

/// Counts of topologically faulty edges.
#[derive(Clone, Copy, Default)]
struct TopologyFaults {
    open: usize,
    many: usize,
    twisted: usize,
}

impl TopologyFaults {
    fn add(&mut self, there: usize, back: usize) {
        self.open += usize::from(there + back == 1);
        self.many += usize::from(there + back > 2);
        self.twisted += usize::from(there + back == 2 && there != 1);
    }
    /// Adds directed edges and sorts them.
    fn add_all(&mut self, edges: &mut [(VertexId, VertexId, bool)]) {
        edges.sort_unstable();
        for same in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let there = same.iter().filter(|e| e.2).count();
            self.add(there, same.len() - there);
        }
    }
    fn is_within(self, most: Self) -> bool {
        self.open <= most.open
            && self.many <= most.many
            && self.many + self.twisted <= most.many + most.twisted
    }
}

impl Bundle {
    /// Returns the vertex that a vertex becomes by the contraction.
    pub(super) fn vertex_after(&self, w: VertexId) -> VertexId {
        self.joints.iter().find(|j| j.v == w).map_or(w, |j| j.u)
    }
    /// Returns the new position of an end; `None` for other vertices.
    pub(super) fn place_of(&self, w: VertexId) -> Option<Vec3> {
        self.joints.iter().find(|j| j.u == w || j.v == w).map(|j| j.at)
    }
    fn is_end(&self, w: VertexId) -> bool {
        self.joints.iter().any(|j| j.u == w || j.v == w)
    }
    pub(super) fn is_gone(&self, face: usize) -> bool {
        self.faces.binary_search_by_key(&face, |c| c.face).is_ok_and(|i| self.faces[i].is_gone)
    }

    /// Finds the faces changed by these pairs, and which of them are removed.
    pub(super) fn set_pairs<Q: VertexMemory>(&mut self, store: &mut Store<Q>, pairs: &[[VertexId; 2]]) {
        self.joints.clear();
        self.joints.extend(pairs.iter().map(|&[u, v]| Joint { u, v, at: Vec3::ZERO }));
        let (mut ring, mut faces) = (std::mem::take(&mut self.ring), std::mem::take(&mut self.faces));
        faces.clear();
        for &end in pairs.iter().flatten() {
            store.ring(end, &mut ring);
            faces.extend(ring.iter().map(|r| {
                let before = store.t[r.corner.face()];
                let after = before.map(|w| self.vertex_after(w));
                let [a, b, c] = after;
                Changed { face: r.corner.face(), before, after, is_gone: a == b || b == c || c == a }
            }));
        }
        faces.sort_unstable_by_key(|c| c.face);
        faces.dedup_by_key(|c| c.face);
        // Coincident faces of opposite winding cancel out; one of the others remains.
        let mut places: Vec<([VertexId; 3], bool, usize)> = Vec::with_capacity(faces.len());
        places.extend(faces.iter().enumerate().filter(|(_, c)| !c.is_gone).map(|(i, c)| {
            let mut sorted = c.after;
            sorted.sort_unstable();
            let first = c.after.iter().position(|w| *w == sorted[0]).unwrap_or(0);
            (sorted, c.after[(first + 1) % 3] == sorted[1], i)
        }));
        places.sort_unstable();
        for same in places.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
            let there = same.iter().filter(|x| x.1).count();
            let stays = match there.cmp(&(same.len() - there)) {
                std::cmp::Ordering::Equal => None,
                more => same.iter().find(|x| x.1 == more.is_gt()),
            };
            for x in same {
                faces[x.2].is_gone = stays.is_none_or(|s| s.2 != x.2);
            }
        }
        (self.ring, self.faces) = (ring, faces);
    }

    /// Returns the effect of the contraction on the topology.
    pub(super) fn effect<Q: VertexMemory>(&mut self, store: &mut Store<Q>) -> Effect {
        let directed = |a: VertexId, b: VertexId| (a.min(b), a.max(b), a < b);
        let sides = |[a, b, c]: [VertexId; 3]| [directed(a, b), directed(b, c), directed(c, a)];
        let (mut before, mut after) = (TopologyFaults::default(), TopologyFaults::default());
        let mut edges = std::mem::take(&mut self.edges);
        edges.clear();
        let at_end = |e: &(VertexId, VertexId, bool)| self.is_end(e.0) || self.is_end(e.1);
        edges.extend(self.faces.iter().flat_map(|c| sides(c.before)).filter(at_end));
        before.add_all(&mut edges);
        edges.clear();
        edges.extend(self.faces.iter().filter(|c| !c.is_gone).flat_map(|c| sides(c.after)).filter(at_end));
        after.add_all(&mut edges);
        // Edges opposite to the ends lose the removed faces.
        edges.clear();
        let gone = self.faces.iter().filter(|c| c.is_gone);
        edges.extend(gone.flat_map(|c| sides(c.before)).filter(|e| !at_end(e)));
        edges.sort_unstable();
        edges.dedup_by_key(|e| (e.0, e.1));
        let mut ring = std::mem::take(&mut self.ring);
        for &(a, b, _) in &edges {
            store.ring(a, &mut ring);
            let count = |goes: bool, there: bool| {
                let on = ring.iter().filter(|r| if there { r.a == b } else { r.b == b });
                on.filter(|r| !(goes && self.is_gone(r.corner.face()))).count()
            };
            before.add(count(false, true), count(false, false));
            after.add(count(true, true), count(true, false));
        }
        self.edges = edges;
        let effect = match after.is_within(before) {
            false => Effect::Worse,
            true => self.effect_on_vertices(store, &mut ring),
        };
        self.ring = ring;
        effect
    }

    /// True if a locked vertex loses all its faces, or a face whose corners are all locked is removed.
    pub(super) fn loses_locked<Q: VertexMemory>(&mut self, store: &mut Store<Q>) -> bool {
        let mut ring = std::mem::take(&mut self.ring);
        let is_lost = self.faces.iter().filter(|c| c.is_gone).any(|c| {
            let is_locked = c.before.map(|w| store.v[w.index()].kind.is_locked());
            let mut locked = c.before.into_iter().zip(is_locked).filter(|x| x.1);
            is_locked == [true; 3]
                || locked.any(|(w, _)| {
                    let w = self.vertex_after(w);
                    if self.is_end(w) {
                        return !self.faces.iter().any(|c| !c.is_gone && c.after.contains(&w));
                    }
                    store.ring(w, &mut ring);
                    ring.iter().all(|r| self.is_gone(r.corner.face()))
                })
        });
        self.ring = ring;
        is_lost
    }

    fn effect_on_vertices<Q: VertexMemory>(&self, store: &mut Store<Q>, ring: &mut Ring) -> Effect {
        let mut fan = Vec::new();
        let mut is_manifold = true;
        for joint in &self.joints {
            fan.clear();
            let stays = self.faces.iter().filter(|c| !c.is_gone && c.after.contains(&joint.u));
            fan.extend(stays.map(|c| {
                let k = c.after.iter().position(|w| *w == joint.u).unwrap_or(0);
                [c.after[(k + 1) % 3], c.after[(k + 2) % 3]]
            }));
            if fan.is_empty() {
                return Effect::Worse;
            }
            is_manifold &= is_one_fan(&fan);
        }
        // The stars of other vertices change if two of their edges are merged, or faces are removed.
        let mut others: Vec<VertexId> = Vec::new();
        for w in self.faces.iter().flat_map(|c| c.before).filter(|w| !self.is_end(*w)) {
            if !others.contains(&w) {
                others.push(w);
            }
        }
        for w in others {
            store.ring(w, ring);
            let loses = ring.iter().any(|r| self.is_gone(r.corner.face()));
            let fuses = self
                .joints
                .iter()
                .any(|j| ring.iter().any(|r| r.has(j.u)) && ring.iter().any(|r| r.has(j.v)));
            if !loses && !fuses {
                continue;
            }
            fan.clear();
            fan.extend(ring.iter().map(|r| [r.a, r.b]));
            if !is_one_fan(&fan) {
                continue;
            }
            fan.clear();
            let stays = ring.iter().filter(|r| !self.is_gone(r.corner.face()));
            fan.extend(stays.map(|r| [self.vertex_after(r.a), self.vertex_after(r.b)]));
            is_manifold &= fan.is_empty() || is_one_fan(&fan);
        }
        if is_manifold { Effect::Manifold } else { Effect::Singular }
    }
}

/// True if triangles around a vertex, each given by its two other corners in order, form one fan, open or
/// closed, of consistent winding.
fn is_one_fan(fan: &[[VertexId; 2]]) -> bool {
    let begins = |w: VertexId| fan.iter().filter(|f| f[0] == w).count();
    let ends = |w: VertexId| fan.iter().filter(|f| f[1] == w).count();
    if fan.iter().any(|f| begins(f[0]) > 1 || ends(f[1]) > 1) {
        return false;
    }
    let first = fan.iter().find(|f| ends(f[0]) == 0).or(fan.first()).map(|f| f[0]);
    let Some(first) = first else { return false };
    let (mut at, mut count) = (first, 0);
    while let Some(next) = fan.iter().find(|f| f[0] == at) {
        (at, count) = (next[1], count + 1);
        if at == first {
            break;
        }
    }
    count == fan.len()
}

impl<Q: VertexMemory> Store<Q> {
    /// True if an edge joins two vertices.
    pub(super) fn is_edge(&mut self, u: VertexId, v: VertexId, ring: &mut Ring) -> bool {
        self.ring(u, ring);
        faces_at(ring, v) > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::tensor::Tensor;

    fn effect(points: usize, faces: &[[u32; 3]], pairs: &[[u32; 2]]) -> (Effect, usize) {
        let faces = faces.iter().map(|t| t.map(VertexId)).collect();
        let mut store = Store::<Tensor>::new(&vec![Vec3::ZERO; points], faces, None, None);
        store.link();
        let pairs: Vec<_> = pairs.iter().map(|p| p.map(VertexId)).collect();
        let mut bundle = Bundle::default();
        bundle.set_pairs(&mut store, &pairs);
        (bundle.effect(&mut store), bundle.faces.iter().filter(|c| c.is_gone).count())
    }

    #[test]
    fn two_triangles_meet_in_a_point_or_along_an_edge() {
        //   2      5
        //  / \    / \       each wound counter-clockwise
        // 0---1  3---4
        let faces = [[0, 1, 2], [3, 4, 5]];
        assert_eq!(effect(6, &faces, &[[1, 3]]), (Effect::Singular, 0));
        assert_eq!(effect(6, &faces, &[[1, 3], [2, 5]]), (Effect::Manifold, 0));
        // Along two edges with the same direction.
        assert_eq!(effect(6, &faces, &[[1, 4], [2, 5]]), (Effect::Worse, 0));
        // Of duplicates, one remains. Of faces back to back, nothing would be left.
        assert_eq!(effect(6, &faces, &[[0, 3], [1, 4], [2, 5]]), (Effect::Manifold, 1));
        assert_eq!(effect(6, &faces, &[[0, 3], [1, 5], [2, 4]]), (Effect::Worse, 2));
    }

    #[test]
    fn a_crack_is_closed_from_its_tip() {
        // 1   2 5   3    two triangles meet in 0, with a gap between 2 and 5 \  | |  /
        //   \ |/  /
        //     0
        assert_eq!(effect(6, &[[0, 2, 1], [0, 3, 5]], &[[2, 5]]), (Effect::Manifold, 0));
        // One of them with the opposite winding.
        assert_eq!(effect(6, &[[0, 2, 1], [0, 5, 3]], &[[2, 5]]), (Effect::Worse, 0));
    }

    #[test]
    fn two_tetrahedra_join_by_a_face() {
        let tetrahedron =
            |o: u32| [[o, o + 1, o + 2], [o, o + 3, o + 1], [o, o + 2, o + 3], [o + 1, o + 3, o + 2]];
        let faces: Vec<[u32; 3]> = tetrahedron(0).into_iter().chain(tetrahedron(4)).collect();
        // Face 0 1 2 of one tetrahedron faces 4 5 6 of the other if that has the opposite winding.
        assert_eq!(effect(8, &faces, &[[0, 4]]), (Effect::Singular, 0));
        assert_eq!(effect(8, &faces, &[[0, 4], [1, 6]]), (Effect::Worse, 0));
        assert_eq!(effect(8, &faces, &[[0, 4], [1, 6], [2, 5]]), (Effect::Manifold, 2));
    }

    #[test]
    fn locked_vertices_and_faces_are_not_lost() {
        // Two triangles that meet in 4 end up back to back, and both are removed; 5 is connected to one of
        // the pairs.
        let faces = [[0, 1, 4], [3, 2, 4], [0, 5, 1]].map(|t| t.map(VertexId));
        let loses = |locked: &[u32]| {
            let mut store = Store::<Tensor>::new(&[Vec3::ZERO; 6], faces.to_vec(), None, None);
            store.link();
            for &v in locked {
                store.v[v as usize].kind = store.v[v as usize].kind.locked(true);
            }
            let mut bundle = Bundle::default();
            bundle.set_pairs(&mut store, &[[0, 2], [1, 3]].map(|p| p.map(VertexId)));
            bundle.loses_locked(&mut store)
        };
        assert!(!loses(&[]) && !loses(&[5]) && !loses(&[0, 1]));
        assert!(loses(&[4]) && loses(&[0, 1, 4]));
    }
}
