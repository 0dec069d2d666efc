//! Adjacency of faces: half-edges derived from the triangles.

use crate::ids::{FaceId, HalfEdgeId, VertexId};
use crate::mesh::Surface;
use crate::mesh::defects::repeats;
use crate::mesh::weld::weld;

mod check;
mod components;
mod counts;
mod one_ring;
mod size;

pub use components::Components;
pub use counts::TopologyCounts;
pub use one_ring::{OneRing, VertexView};
pub use size::{Size, size_of};

/// Adjacency of the faces of a surface.
///
/// Each corner of each face identifies the half-edge that leaves it. The half-edges over the same two
/// vertices, in either direction, form a ring: one on a border, two inside a manifold surface, more on a
/// non-manifold edge. Faces that use a vertex twice keep their number but are not part of the topology.
///
/// ```text
///        2                half-edge h leaves corner h of face h / 3;
///       / \               ring of the edge 1-2:  1 -> 5 -> 1
///    2 / 0 \ 1            ring of the border edge 0-1:  0 -> 0
///     /     \  5
///    0 ----- 1 -----      (numbers at the sides are half-edges, inside is the face)
///        0
/// ```
#[derive(Clone, Debug)]
pub struct Topology {
    /// The vertex that each half-edge leaves, welded.
    origin: Vec<VertexId>,
    /// The next half-edge of the same edge; itself on a border.
    ring: Vec<HalfEdgeId>,
    /// The lowest half-edges of the edges with at least three faces, ascending.
    first_of_many: Vec<HalfEdgeId>,
    /// Start of each vertex' corners; one more entry than vertices.
    corner_start: Vec<u32>,
    /// Corners by vertex, fan after fan, in order around the vertex.
    corners: Vec<HalfEdgeId>,
}

/// Ring entry of half-edges of degenerate faces.
const NO_RING: HalfEdgeId = HalfEdgeId(u32::MAX);

/// Kind of an edge, by the number of its faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EdgeKind {
    /// One face.
    Border,
    /// Two faces with consistent winding.
    Inner,
    /// Two faces that use the edge in the same direction: one of them is flipped.
    Misoriented,
    /// Three or more faces.
    NonManifold,
}

impl Topology {
    /// Builds the topology of a surface after welding vertices of equal position.
    ///
    /// Vertices and faces keep their numbers; welded vertices are replaced by their representative
    /// ([`Topology::origin`]). Cost: O(n log k), where k is the number of edges at a vertex; 38 bytes per
    /// face, 45 during construction.
    ///
    /// # Panics
    /// If there are more corners than 32-bit ids can number.
    pub fn new(surface: &Surface<'_>) -> Self {
        let welded = weld(surface.positions());
        Self::build(surface, |v| welded.of(v))
    }

    /// Builds the topology of a surface from its indices: vertices at the same position stay separate.
    ///
    /// Cost and panics as [`Topology::new`].
    pub fn unwelded(surface: &Surface<'_>) -> Self {
        Self::build(surface, |v| v)
    }

    fn build(surface: &Surface<'_>, representative: impl Fn(VertexId) -> VertexId) -> Self {
        let vertex_count = surface.positions().len();
        let corner_count = surface.triangles().len() * 3;
        assert!(corner_count < u32::MAX as usize, "a mesh has fewer than 2^32 corners");
        let mut origin = Vec::with_capacity(corner_count);
        for t in surface.triangles() {
            origin.extend(t.map(&representative));
        }
        let mut this = Self {
            origin,
            ring: Vec::new(),
            first_of_many: Vec::new(),
            corner_start: Vec::new(),
            corners: Vec::new(),
        };
        this.link_edges(vertex_count);
        this.sort_corners(vertex_count);
        this
    }

    /// Builds the ring table: sorts half-edges by their lower vertex, then by the other.
    fn link_edges(&mut self, vertex_count: usize) {
        let live = |h: &HalfEdgeId| !self.is_degenerate(h.face());
        let half_edges = || (0..self.origin.len() as u32).map(HalfEdgeId).filter(live);
        let lower_end = |h: HalfEdgeId| self.origin(h).min(self.target(h));
        let (start, sorted) = bucket(vertex_count, half_edges, lower_end);
        let mut ring = vec![NO_RING; self.origin.len()];
        let (mut edges, mut first_of_many) = (Vec::new(), Vec::new());
        for at in start.windows(2).map(|w| &sorted[w[0] as usize..w[1] as usize]) {
            edges.clear();
            edges.extend(at.iter().map(|&h| (self.origin(h).max(self.target(h)), h)));
            edges.sort_unstable();
            for edge in edges.chunk_by(|a, b| a.0 == b.0) {
                for (k, &(_, h)) in edge.iter().enumerate() {
                    ring[h.index()] = edge[(k + 1) % edge.len()].1;
                }
                if edge.len() > 2 {
                    first_of_many.push(edge[0].1);
                }
            }
        }
        first_of_many.sort_unstable();
        (self.ring, self.first_of_many) = (ring, first_of_many);
    }

    /// Builds the table of corners: by vertex, then in order around it.
    fn sort_corners(&mut self, vertex_count: usize) {
        let live = |h: &HalfEdgeId| !self.is_degenerate(h.face());
        let half_edges = || (0..self.origin.len() as u32).map(HalfEdgeId).filter(live);
        let (start, mut corners) = bucket(vertex_count, half_edges, |h| self.origin(h));
        let mut done = vec![false; self.origin.len()];
        let mut sorted = Vec::new();
        for w in start.windows(2) {
            let at = &mut corners[w[0] as usize..w[1] as usize];
            sorted.clear();
            for &corner in at.iter() {
                if !done[corner.index()] {
                    for corner in self.fan_through(corner) {
                        done[corner.corner.index()] = true;
                        sorted.push(corner.corner);
                    }
                }
            }
            at.copy_from_slice(&sorted);
        }
        self.corner_start = start;
        self.corners = corners;
    }

    /// The number of vertices of the surface, used or not.
    pub fn vertex_count(&self) -> usize {
        self.corner_start.len() - 1
    }
    /// The number of faces of the surface, degenerate ones included.
    pub fn face_count(&self) -> usize {
        self.origin.len() / 3
    }
    /// True if a face uses a vertex twice, and so is not part of the topology.
    #[inline]
    pub fn is_degenerate(&self, face: FaceId) -> bool {
        let h = face.index() * 3;
        repeats([self.origin[h], self.origin[h + 1], self.origin[h + 2]])
    }
    /// The vertex that a half-edge leaves.
    #[inline]
    pub fn origin(&self, h: HalfEdgeId) -> VertexId {
        self.origin[h.index()]
    }
    /// The vertex that a half-edge arrives at.
    #[inline]
    pub fn target(&self, h: HalfEdgeId) -> VertexId {
        self.origin[h.next().index()]
    }
    /// The three vertices of a face, welded.
    #[inline]
    pub fn triangle(&self, face: FaceId) -> [VertexId; 3] {
        let h = face.index() * 3;
        [self.origin[h], self.origin[h + 1], self.origin[h + 2]]
    }
    /// Iterates over all half-edges over the same two vertices, starting with this one, then cyclically in
    /// order of their number.
    ///
    /// Empty for a half-edge of a degenerate face.
    #[inline]
    pub fn edge(&self, h: HalfEdgeId) -> impl Iterator<Item = HalfEdgeId> + '_ {
        let first = (self.ring[h.index()] != NO_RING).then_some(h);
        std::iter::successors(first, move |&g| Some(self.ring[g.index()]).filter(|&g| g != h))
    }
    /// The other half-edge of an edge with two faces, in either direction.
    #[inline]
    pub fn twin(&self, h: HalfEdgeId) -> Option<HalfEdgeId> {
        let g = self.ring[h.index()];
        (g != NO_RING && g != h && self.ring[g.index()] == h).then_some(g)
    }
    /// The kind of the edge of `h`; `None` for a half-edge of a degenerate face.
    #[inline]
    pub fn kind(&self, h: HalfEdgeId) -> Option<EdgeKind> {
        let g = self.ring[h.index()];
        if g == NO_RING {
            None
        } else if g == h {
            Some(EdgeKind::Border)
        } else if self.ring[g.index()] != h {
            Some(EdgeKind::NonManifold)
        } else if self.origin(g) == self.origin(h) {
            Some(EdgeKind::Misoriented)
        } else {
            Some(EdgeKind::Inner)
        }
    }
    /// Iterates over each edge once, as its lowest half-edge, in order; without edges of degenerate faces.
    pub fn edges(&self) -> impl Iterator<Item = HalfEdgeId> + '_ {
        (0..self.origin.len() as u32).map(HalfEdgeId).filter(|&h| self.is_first_of_edge(h))
    }

    #[inline]
    fn is_first_of_edge(&self, h: HalfEdgeId) -> bool {
        // Walking the ring would take quadratic time on an edge with many faces.
        let g = self.ring[h.index()];
        g != NO_RING && g >= h && (self.ring[g.index()] == h || self.first_of_many.binary_search(&h).is_ok())
    }
}

/// Sorts half-edges into buckets by a vertex: returns the start of each bucket, and the half-edges, in order
/// within a bucket.
fn bucket<I: Iterator<Item = HalfEdgeId>>(
    vertex_count: usize,
    half_edges: impl Fn() -> I,
    key: impl Fn(HalfEdgeId) -> VertexId,
) -> (Vec<u32>, Vec<HalfEdgeId>) {
    let mut start = vec![0u32; vertex_count + 1];
    for h in half_edges() {
        start[key(h).index() + 1] += 1;
    }
    for v in 0..vertex_count {
        start[v + 1] += start[v];
    }
    let mut sorted = vec![HalfEdgeId(0); start[vertex_count] as usize];
    let mut at = start.clone();
    for h in half_edges() {
        let slot = &mut at[key(h).index()];
        sorted[*slot as usize] = h;
        *slot += 1;
    }
    (start, sorted)
}
