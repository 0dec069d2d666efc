//! The mesh between the steps of a clean-up.

use lodsmith_core::mesh::weld::Weld;
use lodsmith_core::{RegionId, Surface, TriMesh, VertexId, WedgeId};

use crate::SimplifyError;

/// A mesh being cleaned: faces may be removed or flipped, wedges and vertices are fixed.
pub(super) struct CleanState<'a> {
    pub(super) mesh: &'a TriMesh,
    /// Representative vertex at the position of each vertex.
    pub(super) place: Weld,
    pub(super) faces: Vec<[WedgeId; 3]>,
    pub(super) regions: Option<Vec<RegionId>>,
}

impl CleanState<'_> {
    /// Returns the representative vertices of a face.
    pub(super) fn places(&self, t: [WedgeId; 3]) -> [VertexId; 3] {
        t.map(|w| self.place.of(self.mesh.vertex_of(w)))
    }
    /// Returns the faces as a surface over representative vertices.
    pub(super) fn surface(&self) -> Result<Surface<'_>, SimplifyError> {
        let triangles = self.faces.iter().map(|&t| self.places(t)).collect();
        Ok(Surface::with_triangles(self.mesh.positions().view(), triangles)?)
    }
    /// Removes the faces for which `is_dropped` is true.
    pub(super) fn drop_faces(&mut self, is_dropped: impl Fn(usize) -> bool) {
        let mut at = 0;
        let mut stays = || {
            at += 1;
            !is_dropped(at - 1)
        };
        self.faces.retain(|_| stays());
        at = 0;
        if let Some(regions) = &mut self.regions {
            regions.retain(|_| {
                at += 1;
                !is_dropped(at - 1)
            });
        }
    }
}
