//! From a path or bytes to a mesh.

use std::path::{Path, PathBuf};

use lodsmith_core::TriMesh;

use crate::error::{ReadError, Warning};
use crate::format::Format;
use crate::limits::Limits;

/// How to read.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct ReadOptions {
    /// The format, where content should not decide.
    pub format: Option<Format>,
    /// What a file may ask of the machine.
    pub limits: Limits,
    /// Folder in which files named by the file are looked for (glTF buffers); none are read where it is `None`.
    pub folder: Option<PathBuf>,
}

/// What a file holds beside the mesh: counts for reports.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Contents {
    /// Mesh objects: 1, or the placed meshes of a scene.
    pub meshes: usize,
    /// Faces as the file has them, n-gons counted once.
    pub polygons: usize,
    /// Materials.
    pub materials: usize,
    /// Textures or images.
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
}

/// Reads a file; `.gz` opens by itself, content decides the format.
///
/// # Errors
/// [`ReadError::File`] with the path and the reason.
pub fn read_path(path: &Path, options: &ReadOptions) -> Result<Loaded, ReadError> {
    let _ = options;
    Err(ReadError::file("not yet").at(path))
}

/// Reads bytes.
///
/// # Errors
/// As [`read_path`], without a path.
pub fn read_bytes(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    let _ = (bytes, options);
    Err(ReadError::file("not yet"))
}
