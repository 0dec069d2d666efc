//! Topology counts.

use crate::disjoint_sets::DisjointSets;
use crate::ids::{FaceId, HalfEdgeId, VertexId};
use crate::topology::{EdgeKind, Topology};

/// Topology counts of a surface; degenerate faces are excluded from all but their own count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TopologyCounts {
    /// Vertices used by a face, after welding if any was done.
    pub vertex_count: usize,
    /// Edges.
    pub edge_count: usize,
    /// Faces that are not degenerate.
    pub face_count: usize,
    /// Faces that use a vertex twice.
    pub degenerate_face_count: usize,
    /// Connected components: faces that share a vertex are connected.
    pub component_count: usize,
    /// Edges with one face.
    pub border_edge_count: usize,
    /// Sets of border edges connected at vertices: outer borders and holes. Two holes that touch are one.
    pub border_loop_count: usize,
    /// Edges with at least three faces.
    pub non_manifold_edge_count: usize,
    /// Vertices whose faces are not all connected across edges with two faces, such as the ends of a
    /// non-manifold edge.
    pub non_manifold_vertex_count: usize,
    /// Vertices whose faces are not all connected across edges, however many faces those edges have: the tip
    /// of an hourglass.
    pub pinched_vertex_count: usize,
    /// Edges whose two faces use them in the same direction.
    pub misoriented_edge_count: usize,
    /// True if faces can be flipped so that no edge is misoriented.
    pub is_orientable: bool,
}

impl TopologyCounts {
    /// Euler number: vertices minus edges plus faces.
    pub fn euler(&self) -> i64 {
        self.vertex_count as i64 - self.edge_count as i64 + self.face_count as i64
    }
    /// True if there are faces, and each edge has exactly two.
    pub fn is_closed(&self) -> bool {
        self.face_count > 0 && self.border_edge_count == 0 && self.non_manifold_edge_count == 0
    }
    /// True if no edge has more than two faces and the faces at each vertex are connected.
    pub fn is_manifold(&self) -> bool {
        self.non_manifold_edge_count == 0 && self.non_manifold_vertex_count == 0
    }
    /// True if no edge is misoriented.
    pub fn is_oriented(&self) -> bool {
        self.misoriented_edge_count == 0
    }
    /// The number of handles of all components together; `None` unless the surface is manifold, orientable
    /// and not empty.
    pub fn genus(&self) -> Option<u64> {
        if self.face_count == 0 || !self.is_manifold() || !self.is_orientable {
            return None;
        }
        let twice = 2 * self.component_count as i64 - self.euler() - self.border_loop_count as i64;
        u64::try_from(twice / 2).ok()
    }
}

impl Topology {
    /// Computes the topology counts.
    ///
    /// Cost: nearly O(n).
    pub fn counts(&self) -> TopologyCounts {
        let mut counts = TopologyCounts::default();
        let faces = || (0..self.face_count() as u32).map(FaceId);
        counts.degenerate_face_count = faces().filter(|&f| self.is_degenerate(f)).count();
        counts.face_count = self.face_count() - counts.degenerate_face_count;
        counts.component_count = self.components().count();
        let mut rims = DisjointSets::new(self.vertex_count());
        let mut on_rim = vec![false; self.vertex_count()];
        for h in self.edges() {
            counts.edge_count += 1;
            match self.kind(h) {
                Some(EdgeKind::Border) => {
                    counts.border_edge_count += 1;
                    for v in [self.origin(h), self.target(h)] {
                        let is_new = !std::mem::replace(&mut on_rim[v.index()], true);
                        counts.border_loop_count += usize::from(is_new);
                    }
                    // Border loops: border vertices minus the edges that join two sets of them.
                    counts.border_loop_count -= usize::from(rims.join(self.origin(h).0, self.target(h).0));
                }
                Some(EdgeKind::NonManifold) => counts.non_manifold_edge_count += 1,
                Some(EdgeKind::Misoriented) => counts.misoriented_edge_count += 1,
                Some(EdgeKind::Inner) | None => {}
            }
        }
        for v in (0..self.vertex_count() as u32).map(VertexId) {
            let view = self.vertex(v);
            if view.corners().is_empty() {
                continue;
            }
            counts.vertex_count += 1;
            if view.fan_count() > 1 {
                counts.non_manifold_vertex_count += 1;
                counts.pinched_vertex_count += usize::from(self.is_pinched(v));
            }
        }
        counts.is_orientable = counts.misoriented_edge_count == 0 || self.is_orientable();
        counts
    }

    /// True if the faces at a vertex are not all connected across edges of any kind.
    fn is_pinched(&self, vertex: VertexId) -> bool {
        // Each face joins the far ends of its two edges at the vertex; faces that share an end share the
        // edge.
        let ends = || self.vertex(vertex).corners().iter().map(|&c| (self.target(c), self.origin(c.prev())));
        let mut link: Vec<VertexId> = ends().flat_map(|(a, b)| [a, b]).collect();
        link.sort_unstable();
        link.dedup();
        let number = |v: VertexId| link.partition_point(|&w| w < v) as u32;
        let mut sets = DisjointSets::new(link.len());
        let joined = ends().filter(|&(a, b)| sets.join(number(a), number(b))).count();
        link.len() - joined > 1
    }

    /// True if flipping some faces would orient all edges with two faces.
    fn is_orientable(&self) -> bool {
        const UNKNOWN: u8 = 2;
        let mut turned = vec![UNKNOWN; self.face_count()];
        let mut stack = Vec::new();
        for face in (0..self.face_count() as u32).map(FaceId) {
            if turned[face.index()] != UNKNOWN {
                continue;
            }
            turned[face.index()] = 0;
            stack.push(face);
            while let Some(face) = stack.pop() {
                for h in (0..3).map(|k| HalfEdgeId::of(face, k)) {
                    let Some(g) = self.twin(h) else { continue };
                    let want = turned[face.index()] ^ u8::from(self.origin(h) == self.origin(g));
                    let other = &mut turned[g.face().index()];
                    if *other == UNKNOWN {
                        *other = want;
                        stack.push(g.face());
                    } else if *other != want {
                        return false;
                    }
                }
            }
        }
        true
    }
}
