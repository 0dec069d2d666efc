//! Connected components.

use crate::ids::{FaceId, VertexId};
use crate::topology::Topology;

/// The connected components of a surface: faces that share a vertex are of the same component.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    label: Vec<u32>,
    face_counts: Vec<usize>,
}

/// The label of a degenerate face.
const NO_LABEL: u32 = u32::MAX;

impl Components {
    /// Number of components.
    pub fn count(&self) -> usize {
        self.face_counts.len()
    }
    /// Number of faces of each component, in the order of their first faces.
    pub fn face_counts(&self) -> &[usize] {
        &self.face_counts
    }
    /// The component of a face; `None` if it is degenerate.
    ///
    /// # Panics
    /// If there is no such face.
    pub fn of_face(&self, face: FaceId) -> Option<usize> {
        let label = self.label[face.index()];
        (label != NO_LABEL).then_some(label as usize)
    }
}

impl Topology {
    /// Finds the components of the surface; they are numbered in the order of their first faces.
    ///
    /// Components that touch in a single vertex are one. Degenerate faces belong to none and connect nothing.
    /// Cost: nearly O(n).
    pub fn components(&self) -> Components {
        let mut sets = Sets::new(self.vertex_count());
        let faces = || (0..self.face_count() as u32).map(FaceId);
        for face in faces().filter(|&f| !self.is_degenerate(f)) {
            let [a, b, c] = self.triangle(face);
            sets.join(a, b);
            sets.join(a, c);
        }
        let mut number = vec![NO_LABEL; self.vertex_count()];
        let mut face_counts = Vec::new();
        let label = faces()
            .map(|face| {
                if self.is_degenerate(face) {
                    return NO_LABEL;
                }
                let own = &mut number[sets.find(self.triangle(face)[0]).index()];
                if *own == NO_LABEL {
                    *own = face_counts.len() as u32;
                    face_counts.push(0);
                }
                face_counts[*own as usize] += 1;
                *own
            })
            .collect();
        Components { label, face_counts }
    }
}

/// Disjoint sets of vertices; the lowest one represents its set.
pub(super) struct Sets(Vec<VertexId>);

impl Sets {
    pub(super) fn new(count: usize) -> Self {
        Self((0..count as u32).map(VertexId).collect())
    }
    pub(super) fn find(&mut self, mut v: VertexId) -> VertexId {
        while self.0[v.index()] != v {
            // Path halving.
            let up = self.0[self.0[v.index()].index()];
            self.0[v.index()] = up;
            v = up;
        }
        v
    }
    /// Joins two sets; true if they were separate.
    pub(super) fn join(&mut self, a: VertexId, b: VertexId) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        let (low, high) = (a.min(b), a.max(b));
        self.0[high.index()] = low;
        low != high
    }
}
