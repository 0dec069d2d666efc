//! The result of reading a file: the mesh, its contents and warnings.

use std::sync::Arc;

use lodsmith_core::TriMesh;

use crate::error::Warning;
use crate::format::Format;
use crate::limits::Limits;
use crate::material::Regions;

/// Counts of the contents of a file besides the mesh, for reports.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Contents {
    /// Mesh objects: 1, or the mesh instances of a scene.
    pub meshes: usize,
    /// Meshes that are placed in a scene, however often; 0 for formats without scenes.
    pub distinct_meshes: usize,
    /// Instances of these meshes, including `EXT_mesh_gpu_instancing`; 0 for formats without scenes.
    pub instances: usize,
    /// Faces as in the file; polygons count once.
    pub polygons: usize,
    /// Materials; for an OBJ, all that it or its libraries name.
    pub materials: usize,
    /// Textures or images; for an OBJ, the paths that its libraries name.
    pub textures: usize,
    /// Skins.
    pub skins: usize,
    /// Animations.
    pub animations: usize,
    /// Morph targets.
    pub morph_targets: usize,
    /// Names of the attributes in the file, read or not: `normals`, `uvs`, `colors`, `tangents`, ...
    pub attributes: Vec<String>,
}

/// A mesh read from a file, with its contents and warnings.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The mesh: all meshes of a scene in one, placed by their nodes.
    pub mesh: Arc<TriMesh>,
    /// The format of the file.
    pub format: Format,
    /// The other contents of the file.
    pub contents: Contents,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
    /// Description of the regions of the mesh; empty if the format has none.
    pub regions: Regions,
    /// Requested properties that are in the file but not in the mesh, with one number per vertex of the mesh.
    /// Only PLY has such properties; list properties are not supported.
    pub properties: Vec<(String, Vec<f32>)>,
    /// The limits that the file was read with.
    pub(crate) limits: Limits,
}

impl Loaded {
    /// Returns the mesh alone. It is copied only if it is shared.
    pub fn into_mesh(self) -> TriMesh {
        Arc::unwrap_or_clone(self.mesh)
    }

    /// Creates the result for a format without regions.
    pub(crate) fn new(mesh: TriMesh, format: Format, contents: Contents, warnings: Vec<Warning>) -> Self {
        let mesh = Arc::new(mesh);
        let (regions, properties, limits) = (Regions::default(), Vec::new(), Limits::default());
        Self { mesh, format, contents, warnings, regions, properties, limits }
    }
}
