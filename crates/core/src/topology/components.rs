//! Connected components.

use crate::disjoint_sets::DisjointSets;
use crate::ids::FaceId;
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
        let mut sets = DisjointSets::new(self.vertex_count());
        let faces = || (0..self.face_count() as u32).map(FaceId);
        for face in faces().filter(|&f| !self.is_degenerate(f)) {
            let [a, b, c] = self.triangle(face);
            sets.join(a.0, b.0);
            sets.join(a.0, c.0);
        }
        let mut number = vec![NO_LABEL; self.vertex_count()];
        let mut face_counts = Vec::new();
        let label = faces()
            .map(|face| {
                if self.is_degenerate(face) {
                    return NO_LABEL;
                }
                let own = &mut number[sets.find(self.triangle(face)[0].0) as usize];
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
