//! Marked edges: open borders and defects.

use lodsmith_core::mesh::defects::{duplicates, is_zero_area};
use lodsmith_core::topology::EdgeKind;
use lodsmith_core::{FaceId, Topology, TriMesh, VertexId, WedgeId};
use lodsmith_render::marks::{BORDER_COLOR, DUPLICATE_COLOR, NON_MANIFOLD_COLOR, ZERO_AREA_COLOR};
use serde::{Deserialize, Serialize};

/// Colours of the kinds, in the order of their numbers.
pub(super) const COLORS: [[f32; 3]; 4] = [BORDER_COLOR, NON_MANIFOLD_COLOR, DUPLICATE_COLOR, ZERO_AREA_COLOR];

/// Marked edges of a mesh. Needs no device, so a worker thread can find them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Marks {
    /// Two wedges and an index into [`COLORS`].
    pub(super) edges: Vec<[u32; 3]>,
    borders: usize,
}

impl Marks {
    /// Finds open borders, non-manifold edges, faces without area and duplicate faces.
    ///
    /// Cost: O(n).
    pub fn find(mesh: &TriMesh) -> Self {
        let surface = mesh.surface();
        let topology = Topology::new(&surface);
        let mut wedge_of = vec![WedgeId(0); mesh.vertex_count()];
        for &w in mesh.triangles().iter().flatten() {
            wedge_of[mesh.vertex_of(w).index()] = w;
        }
        let edge =
            |ends: [VertexId; 2], kind| [wedge_of[ends[0].index()].0, wedge_of[ends[1].index()].0, kind];
        let mut edges = Vec::new();
        for (kind, number) in [(EdgeKind::Border, 0), (EdgeKind::NonManifold, 1)] {
            let found = topology.edges().filter(|&h| topology.kind(h) == Some(kind));
            edges.extend(found.map(|h| edge([topology.origin(h), topology.target(h)], number)));
        }
        let borders = edges.iter().filter(|e| e[2] == 0).count();
        let faces: Vec<[VertexId; 3]> =
            (0..topology.face_count()).map(|f| topology.triangle(FaceId::new(f))).collect();
        let mut round = |t: [VertexId; 3], kind| {
            edges.extend([[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|ends| edge(ends, kind)));
        };
        let is_plain = |t: &[VertexId; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        let plain: Vec<[VertexId; 3]> = faces.iter().copied().filter(is_plain).collect();
        let twice = duplicates(&plain, mesh.vertex_count());
        for face in twice.same_winding.iter().chain(&twice.opposite) {
            round(plain[face.index()], 2);
        }
        let positions = surface.positions();
        for t in faces.iter().filter(|t| is_zero_area(t.map(|v| positions.get(v)))) {
            round(*t, 3);
        }
        Self { edges, borders }
    }

    /// Returns the number of border edges, non-manifold edges, duplicate faces and faces without area.
    pub fn kind_counts(&self) -> [usize; 4] {
        let of = |kind: u32| self.edges.iter().filter(|e| e[2] == kind).count();
        [of(0), of(1), of(2) / 3, of(3) / 3]
    }

    /// Returns the ends of the border edges, or of the edges marked as defects.
    pub fn edges_of(&self, is_border: bool) -> impl Iterator<Item = [WedgeId; 2]> {
        self.edges.iter().filter(move |e| (e[2] == 0) == is_border).map(|e| [WedgeId(e[0]), WedgeId(e[1])])
    }

    /// Returns the number of border edges and the number of edges marked as defects.
    pub fn counts(&self) -> [usize; 2] {
        [self.borders, self.edges.len() - self.borders]
    }
}
