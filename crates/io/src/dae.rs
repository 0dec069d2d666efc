//! Reader of COLLADA (DAE) 1.4 and 1.5: an XML file of geometries, materials and nodes.
//!
//! A file becomes a glTF scene in memory, in metres and y up, which all commands read like any other. Skins,
//! animations, cameras and lights are left out, with a warning.
//!
//! Source: Khronos, "COLLADA – Digital Asset Schema Release 1.4.1" and "1.5.0" (2008).

mod document;
mod geometry;
mod materials;
mod nodes;
mod tree;

use crate::error::ReadError;
use crate::gltf::{BuiltScene, read_built};
use crate::lines::utf8_of;
use crate::loaded::Loaded;
use crate::options::ReadOptions;

/// Reads a COLLADA file as one mesh: all geometries of its scene, in metres and y up.
///
/// # Errors
/// [`ReadError::Malformed`] with the element at fault; [`ReadError::Limit`] and [`ReadError::Memory`] beyond
/// the limits.
pub fn read(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    read_built(scene(bytes, options)?, bytes.len(), options)
}

/// Returns a COLLADA file as a scene.
pub(crate) fn scene(bytes: &[u8], options: &ReadOptions) -> Result<BuiltScene, ReadError> {
    let utf8 = utf8_of(bytes);
    let (text, warning) = document::text_of(&utf8)?;
    nodes::build(&text, warning, options)
}
