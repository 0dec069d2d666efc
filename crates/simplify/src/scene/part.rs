//! The meshes of a scene, and the results of simplifying them.

use glam::{DMat3, DVec3};
use lodsmith_core::topology::size_of;
use lodsmith_core::{PositionsView, Surface, TriMesh};

use crate::report::Report;

/// A mesh of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// The mesh, in its own coordinates.
    pub mesh: &'a TriMesh,
    /// Number of instances in the scene. A mesh without instances is simplified too but not counted, unless
    /// no mesh has any.
    pub instances: usize,
    /// Scale of the mesh in the scene: the largest, if several instances or axes have different ones.
    pub scale: f64,
    /// The rows of a linear map under which the mesh has the lengths that it has in the scene, if its scales differ by axis:
    /// it is simplified and measured as that map makes it. `None` if [`Part::scale`] is the factor of all lengths, or, where
    /// instances are stretched in different ways, their bound. A map without an inverse counts as `None`.
    pub stretch: Option<[[f64; 3]; 3]>,
    /// Number of the coordinate system of the mesh, if it has one instance. Parts of one system that touch
    /// stay connected; others keep their borders separately.
    pub system: Option<usize>,
}

/// The simplified meshes of a scene and the report of the run.
#[derive(Clone, Debug, PartialEq)]
pub struct SimplifiedScene {
    /// As many meshes as parts, in their order; a mesh may have lost all its faces.
    pub meshes: Vec<TriMesh>,
    /// Report with counts of all instances and lengths of the scene.
    pub report: Report,
    /// Counts of each mesh, in the same order.
    pub counts: Vec<MeshCounts>,
}

/// Counts of one mesh of a scene, whatever its number of instances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MeshCounts {
    /// Number of instances in the scene.
    pub instances: usize,
    /// Triangles of the input.
    pub input_faces: usize,
    /// Vertices of the input.
    pub input_vertices: usize,
    /// Triangles of the result.
    pub faces: usize,
    /// Vertices of the result.
    pub vertices: usize,
    /// True if its stop was met: that of the scene, if all meshes share one.
    pub reached: bool,
}

impl Part<'_> {
    /// Returns its area in the scene, of one instance.
    pub(crate) fn area(&self) -> f64 {
        match PartMap::new(self) {
            PartMap::Scale(scale) => size_of(&self.mesh.surface()).area * scale * scale,
            map => {
                let places: Vec<[f64; 3]> =
                    self.mesh.positions().view().iter().map(|p| map.to_scene(p)).collect();
                let surface = self.mesh.surface();
                let stretched =
                    Surface::with_triangles(PositionsView::F64(&places), surface.triangles().to_vec());
                stretched.map_or(0.0, |stretched| size_of(&stretched).area)
            }
        }
    }
}

/// The linear map from a part to the scene, up to a rotation.
#[derive(Clone, Copy)]
pub(super) enum PartMap {
    Scale(f64),
    Stretch { to_scene: DMat3, to_part: DMat3 },
}

impl PartMap {
    pub(super) fn new(part: &Part<'_>) -> Self {
        let stretch = part.stretch.map(|rows| DMat3::from_cols_array_2d(&rows).transpose());
        let inverse = |to_scene: DMat3| (to_scene, to_scene.inverse());
        match stretch.map(inverse).filter(|(m, inverse)| m.is_finite() && inverse.is_finite()) {
            Some((to_scene, to_part)) => Self::Stretch { to_scene, to_part },
            None if part.scale.is_finite() && part.scale > 0.0 => Self::Scale(part.scale),
            None => Self::Scale(1.0),
        }
    }

    pub(super) fn to_scene(self, p: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Scale(scale) => p.map(|x| x * scale),
            Self::Stretch { to_scene, .. } => (to_scene * DVec3::from(p)).to_array(),
        }
    }
    pub(super) fn to_part(self, p: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Scale(scale) => p.map(|x| x / scale),
            Self::Stretch { to_part, .. } => (to_part * DVec3::from(p)).to_array(),
        }
    }

    /// Returns a direction of the part, such as a tangent, in the scene; unit length is kept.
    pub(super) fn direction_to_scene(self, d: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Scale(_) => d,
            Self::Stretch { to_scene, .. } => turned(to_scene, d),
        }
    }
    pub(super) fn direction_to_part(self, d: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Scale(_) => d,
            Self::Stretch { to_part, .. } => turned(to_part, d),
        }
    }
    /// Returns a normal of the part in the scene.
    pub(super) fn normal_to_scene(self, n: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Scale(_) => n,
            Self::Stretch { to_part, .. } => turned(to_part.transpose(), n),
        }
    }
    pub(super) fn normal_to_part(self, n: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Scale(_) => n,
            Self::Stretch { to_scene, .. } => turned(to_scene.transpose(), n),
        }
    }
}

/// Returns the image of a direction with unit length; zero and what is not finite stay as they are.
fn turned(matrix: DMat3, d: [f32; 3]) -> [f32; 3] {
    let image = matrix * DVec3::from(d.map(f64::from));
    image.try_normalize().map_or(d, |image| image.as_vec3().to_array())
}

impl MeshCounts {
    pub(super) fn new(part: &Part<'_>, result: &TriMesh, reached: bool) -> Self {
        Self {
            instances: part.instances,
            input_faces: part.mesh.face_count(),
            input_vertices: part.mesh.vertex_count(),
            faces: result.face_count(),
            vertices: result.vertex_count(),
            reached,
        }
    }
}
