//! Writing of files in memory, in a browser.

use std::io::{self, Write};
use std::path::Path;

use crate::drive::{self, memory};

/// Replaces the file at `path` by what `write` writes; on an error the old file is unchanged.
///
/// # Errors
/// The errors of `write`.
pub fn write_file<T>(
    path: &Path,
    _force: bool,
    write: impl FnOnce(&mut dyn Write) -> io::Result<T>,
) -> io::Result<T> {
    let mut bytes = Vec::new();
    let value = write(&mut bytes)?;
    memory::put(path, bytes);
    Ok(value)
}

/// Writes a new file.
///
/// # Errors
/// [`io::ErrorKind::AlreadyExists`] if there is a file already.
pub(crate) fn write_new_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if drive::metadata(path).is_ok() {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    memory::put(path, bytes);
    Ok(())
}
