//! A mesh from a file, and what was met on the way.

use lodsmith_core::TriMesh;

use crate::error::Warning;
use crate::format::Format;
use crate::limits::Limits;
use crate::material::Regions;

/// What a file holds beside the mesh: counts for reports.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Contents {
    /// Mesh objects: 1, or the placed meshes of a scene.
    pub meshes: usize,
    /// Faces as the file has them, n-gons counted once.
    pub polygons: usize,
    /// Materials; of an OBJ those that it or its libraries name.
    pub materials: usize,
    /// Textures or images; of an OBJ the paths that its libraries name.
    pub textures: usize,
    /// Skins.
    pub skins: usize,
    /// Animations.
    pub animations: usize,
    /// Morph targets.
    pub morph_targets: usize,
    /// Names of the attributes that the file carries, read or not: `normals`, `uvs`, `colors`, `tangents`, ...
    pub attributes: Vec<String>,
}

/// A mesh from a file, and what was met on the way.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The mesh: all meshes of a scene in one, placed by their nodes.
    pub mesh: TriMesh,
    /// The format that it was in.
    pub format: Format,
    /// What else the file holds.
    pub contents: Contents,
    /// What the user should know.
    pub warnings: Vec<Warning>,
    /// What the regions of the mesh stand for; empty where the format has none.
    pub regions: Regions,
    /// Those of the wanted properties that the file has and the mesh does not carry, with one number for each vertex of
    /// the mesh. Only PLY has such properties; a list is none.
    pub properties: Vec<(String, Vec<f32>)>,
    /// Those that the file was read under.
    pub(crate) limits: Limits,
}

impl Loaded {
    /// A mesh from a format without regions.
    pub(crate) fn new(mesh: TriMesh, format: Format, contents: Contents, warnings: Vec<Warning>) -> Self {
        let (regions, properties, limits) = (Regions::default(), Vec::new(), Limits::default());
        Self { mesh, format, contents, warnings, regions, properties, limits }
    }
}
