//! The files that readers and writers use: the files of the system or, in a browser, files in memory.

#[cfg(any(target_arch = "wasm32", test))]
pub mod memory;

#[cfg(not(target_arch = "wasm32"))]
pub(crate) use std::fs::{File, canonicalize, metadata, remove_file, symlink_metadata};

#[cfg(target_arch = "wasm32")]
pub(crate) use memory::{File, canonicalize, metadata, metadata as symlink_metadata, remove_file};

/// Opens a file for reading.
///
/// # Errors
/// The errors of the system.
pub fn open(path: &std::path::Path) -> std::io::Result<impl std::io::Read> {
    File::open(path)
}

/// Returns true if files can be written into this folder.
pub(crate) fn is_folder(path: &std::path::Path) -> bool {
    // In memory every folder exists.
    metadata(path).map_or(cfg!(target_arch = "wasm32"), |about| about.is_dir())
}
