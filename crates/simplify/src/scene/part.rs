//! The meshes of a scene, and the results of simplifying them.

use lodsmith_core::TriMesh;

use crate::report::Report;

/// A transform: three rows, each of three factors and a translation.
pub type Place = [[f64; 4]; 3];

/// A mesh of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// The mesh, in its own coordinates.
    pub mesh: &'a TriMesh,
    /// Number of instances in the scene. A mesh without instances is simplified too but not counted, unless
    /// no mesh has any.
    pub instances: usize,
    /// Scale of the mesh in the scene.
    pub scale: f64,
    /// Number of the coordinate system of the mesh, if it has one instance. Parts of one system that touch
    /// stay connected.
    pub system: Option<usize>,
    /// Where its instances stand in the scene, if that is known. Borders of two parts that touch there stay connected
    /// too, those of instances by keeping the vertices at which they touch.
    pub places: &'a [Place],
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
