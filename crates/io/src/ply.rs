//! ply.

use std::io::{self, Write};

use lodsmith_core::TriMesh;

use crate::error::{ReadError, Warning};
use crate::read::{Loaded, ReadOptions};
use crate::write::WriteOptions;

/// Reads the bytes of a file.
///
/// # Errors
/// [`ReadError`].
pub fn read(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    let _ = (bytes, options);
    Err(ReadError::file("not yet"))
}

/// Writes a mesh; returns what the format could not carry.
///
/// # Errors
/// What the stream answers.
pub fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    let _ = (mesh, options, out);
    Ok(Vec::new())
}
