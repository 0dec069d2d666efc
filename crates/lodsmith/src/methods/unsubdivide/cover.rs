//! Tilings of a surface component by tiles of four triangles.
//!
//! ```text
//!          e2                 e: even, kept          the middle face has no even vertex,
//!         /  \                o: odd, removed        the other three have one each
//!      o1 ---- o2
//!      / \    / \             every edge of a tile from e to e is shared at its o with the tile
//!    e0 -- o0 -- e1           beyond it, so one tile determines all others of its component
//! ```

use lodsmith_core::{FaceId, HalfEdgeId, Topology, VertexId};

use crate::collapse::order::NONE;

/// A tile: the middle face, and the even vertices beyond its three edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tile {
    pub(super) middle: FaceId,
    pub(super) even: [VertexId; 3],
}

/// Role of a face in a cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Middle,
    /// Corner face of a tile, with this even vertex.
    Corner(VertexId),
}

/// Search for covers; holds reusable tables.
pub(super) struct CoverSearch<'a> {
    topology: &'a Topology,
    /// Roles by face and parity by vertex, each with the number of the try that set it.
    roles: Vec<(u32, Role)>,
    parity: Vec<(u32, bool)>,
    /// For each odd vertex, the even vertices at the ends of its edge.
    between: Vec<[VertexId; 2]>,
    /// Number of the current try.
    turn: u32,
    todo: Vec<(FaceId, VertexId)>,
}

/// A tiling of a component, and the edges that its odd vertices split.
pub(super) struct Cover {
    pub(super) tiles: Vec<Tile>,
    /// Each odd vertex once, with the ends of its edge.
    pub(super) odd: Vec<(VertexId, [VertexId; 2])>,
}

impl<'a> CoverSearch<'a> {
    pub(super) fn new(topology: &'a Topology) -> Self {
        let (faces, vertices) = (topology.face_count(), topology.vertex_count());
        Self {
            topology,
            roles: vec![(0, Role::Middle); faces],
            parity: vec![(0, false); vertices],
            between: vec![[NONE; 2]; vertices],
            turn: 0,
            todo: Vec::new(),
        }
    }

    /// Returns the covers of an edge-connected component: at most four, since its first face is the middle of
    /// a tile or one of the three corners. Cost: O(n). Source: [Taubin 2001], whose equivalence classes of
    /// tiles are these covers.
    pub(super) fn covers(&mut self, part: &[FaceId]) -> Vec<Cover> {
        let first = part[0];
        let middles =
            [0, 1, 2].map(|k| self.across(HalfEdgeId::new(3 * first.index() + k)).map(HalfEdgeId::face));
        let middles = std::iter::once(Some(first)).chain(middles).flatten();
        middles.filter_map(|middle| self.cover(part, middle)).collect()
    }

    /// Returns the twin half-edge, if there is exactly one and the two faces agree on orientation.
    fn across(&self, h: HalfEdgeId) -> Option<HalfEdgeId> {
        self.topology.twin(h).filter(|&t| self.topology.origin(t) == self.topology.target(h))
    }

    fn cover(&mut self, part: &[FaceId], middle: FaceId) -> Option<Cover> {
        self.turn += 1;
        self.todo.clear();
        let mut cover = Cover { tiles: Vec::new(), odd: Vec::new() };
        self.lay(middle, &mut cover)?;
        while let Some((face, even)) = self.todo.pop() {
            match self.role(face) {
                Some(Role::Corner(v)) if v == even => continue,
                Some(_) => return None,
                None => {}
            }
            let opposite = self.half_edges(face).into_iter().find(|&h| self.apex(h) == even)?;
            let middle = self.across(opposite)?.face();
            self.lay(middle, &mut cover)?;
        }
        if 4 * cover.tiles.len() != part.len() {
            return None;
        }
        // Two edges between the same two vertices would coincide.
        let mut edges: Vec<_> = cover.odd.iter().map(|x| x.1).collect();
        edges.sort_unstable();
        edges.windows(2).all(|w| w[0] != w[1]).then_some(cover)
    }

    /// Adds a tile, and queues the faces next to it.
    fn lay(&mut self, middle: FaceId, cover: &mut Cover) -> Option<()> {
        let inner = self.half_edges(middle);
        let mut outer = inner;
        for (k, &h) in inner.iter().enumerate() {
            outer[k] = self.across(h)?;
        }
        let even = outer.map(|h| self.apex(h));
        self.take(middle, Role::Middle)?;
        for k in 0..3 {
            self.take(outer[k].face(), Role::Corner(even[k]))?;
            self.mark(even[k], true)?;
        }
        for k in 0..3 {
            // The vertex between edge k and the previous one.
            let odd = self.topology.origin(inner[k]);
            let (a, b) = (even[(k + 2) % 3], even[k]);
            let ends = [a.min(b), a.max(b)];
            if a == b {
                return None;
            }
            if self.mark(odd, false)? {
                self.between[odd.index()] = ends;
                cover.odd.push((odd, ends));
            } else if self.between[odd.index()] != ends {
                return None;
            }
        }
        for k in 0..3 {
            for side in [outer[k].next(), outer[k].next().next()] {
                let beyond = self.topology.edge(side).map(HalfEdgeId::face).filter(|&f| f != side.face());
                self.todo.extend(beyond.map(|f| (f, even[k])));
            }
        }
        cover.tiles.push(Tile { middle, even });
        Some(())
    }

    fn half_edges(&self, f: FaceId) -> [HalfEdgeId; 3] {
        [0, 1, 2].map(|k| HalfEdgeId::new(3 * f.index() + k))
    }
    /// Returns the vertex opposite to a half-edge in its face.
    fn apex(&self, h: HalfEdgeId) -> VertexId {
        self.topology.origin(h.next().next())
    }
    fn role(&self, f: FaceId) -> Option<Role> {
        let (turn, role) = self.roles[f.index()];
        (turn == self.turn).then_some(role)
    }
    fn take(&mut self, f: FaceId, role: Role) -> Option<()> {
        let is_free = self.role(f).is_none();
        self.roles[f.index()] = (self.turn, role);
        is_free.then_some(())
    }
    /// Marks a vertex; returns whether it was unmarked before, or `None` if it had the other parity.
    fn mark(&mut self, v: VertexId, is_even: bool) -> Option<bool> {
        let (turn, before) = std::mem::replace(&mut self.parity[v.index()], (self.turn, is_even));
        if turn != self.turn {
            return Some(true);
        }
        (before == is_even).then_some(false)
    }
}
