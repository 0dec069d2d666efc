//! Reader and writer of 3MF: a ZIP archive with models as XML, textures and relations between them.
//!
//! A file becomes a glTF scene in memory (`scene`), which all commands read like any other. A mesh that is
//! merged from it keeps the coordinates of the file: its unit, and z up.
//!
//! Source: 3MF Consortium, "3MF Core Specification" 1.3, "Materials and Properties Extension" 1.2, "Production
//! Extension" 1.1.

mod assemblies;
mod build;
mod document;
mod kept;
mod looks;
mod marks;
mod model;
mod package;
mod properties;
mod resources;
mod settings;
mod write;
mod xml;

use std::io::{self, Write};

pub(crate) use kept::{KeptContents, OF_THREE_MF};
use lodsmith_core::TriMesh;

use crate::error::{ReadError, Warning};
use crate::gltf::{BuiltScene, Scene, Written, read_built};
use crate::loaded::Loaded;
use crate::material::Textures;
use crate::options::{ReadOptions, WriteOptions};

/// Reads a 3MF file as one mesh: all items of the build, in the coordinates of the file (its unit, z up).
///
/// # Errors
/// [`ReadError::Malformed`] with the part, the line and the element; [`ReadError::Unsupported`] for a required
/// extension that is not known; [`ReadError::Limit`], [`ReadError::Ratio`] and [`ReadError::Memory`] beyond
/// the limits.
pub fn read(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    let (built, frame) = build::build(bytes, options, build::Coordinates::File)?;
    let mut loaded = read_built(built, bytes.len(), options)?;
    loaded.regions = loaded.regions.with_frame(frame);
    Ok(loaded)
}

/// Returns a 3MF file as a scene, in metres and y up as glTF has it.
pub(crate) fn scene(bytes: &[u8], options: &ReadOptions) -> Result<BuiltScene, ReadError> {
    Ok(build::build(bytes, options, build::Coordinates::Gltf)?.0)
}

/// Writes a mesh as 3MF: one object, with colours of vertices, materials and textures.
///
/// The unit is taken from [`WriteOptions::regions`], else it is the millimetre. Returns warnings about what 3MF cannot
/// hold.
///
/// # Errors
/// I/O errors of the stream.
pub fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    write::write(mesh, options, out)
}

/// Writes a scene as 3MF, with some meshes replaced: one object for each placed mesh, one object of components for each
/// node with children, and one build item for each root. Returns warnings about what 3MF cannot hold.
///
/// The unit is taken from the 3MF file that was read, else it is the metre.
///
/// # Errors
/// I/O errors of the stream.
pub(crate) fn write_scene(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    textures: Textures,
    out: &mut dyn Write,
) -> io::Result<Written> {
    write::write_scene(scene, replaced, textures, out)
}
