//! Reader of FBX, binary and text, by the C library ufbx (feature `fbx`).
//!
//! A file becomes a glTF scene in memory, in metres and y up, with nodes, skins, morph targets, animations,
//! materials and embedded textures. Lights, cameras, curves and constraints are left out, with a warning.

mod animation;
mod materials;
mod mesh;
mod scene;

use crate::error::ReadError;
use crate::gltf::{BuiltScene, read_built};
use crate::loaded::Loaded;
use crate::options::ReadOptions;

/// Reads an FBX file as one mesh: all meshes of its scene, in metres and y up.
///
/// # Errors
/// [`ReadError::Malformed`] if the file is damaged; [`ReadError::Limit`] and [`ReadError::Memory`] beyond the
/// limits.
pub fn read(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    read_built(scene(bytes, options)?, bytes.len(), options)
}

/// Returns an FBX file as a scene.
pub(crate) fn scene(bytes: &[u8], options: &ReadOptions) -> Result<BuiltScene, ReadError> {
    scene::build(bytes, options)
}
