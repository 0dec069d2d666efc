//! Copies of the separate images of a scene beside its output.

use std::collections::HashMap;
use std::path::Path;

use super::buffers::path_of;
use super::external_files::uri_of;
use super::scene::Scene;
use crate::drive;
use crate::error::{Warning, WriteError};
use crate::material::{SidecarFiles, bytes_of_path, copy_into};

/// Images that were copied beside a scene.
#[derive(Default)]
pub(crate) struct CopiedImages {
    /// The URI of each copy, by the URI in the scene.
    uris: HashMap<String, String>,
    files: SidecarFiles,
}

impl CopiedImages {
    /// Copies the separate images of a scene into the folder of its output at `target`, if they may be read,
    /// under their own or numbered names. Images that are in the folder or below it stay where they are.
    ///
    /// # Errors
    /// If the system cannot write; the created files are removed then. Images that cannot be read are
    /// warnings.
    pub(crate) fn new(scene: &Scene, target: &Path) -> Result<Self, WriteError> {
        let mut copied = Self::default();
        let folder = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        // The later error of writing the scene describes the problem with the folder better.
        let Ok(real_folder) = drive::canonicalize(folder) else { return Ok(copied) };
        if !scene.assets.has_folder() || drive::metadata(target).is_ok_and(|about| !about.is_file()) {
            return Ok(copied);
        }
        let is_there = |uri: &str, source: &Path| {
            let from_output = path_of(uri).ok().and_then(|path| folder.join(path).canonicalize().ok());
            source.starts_with(&real_folder) || from_output.is_some_and(|path| path == source)
        };
        let mut failure = None;
        let warnings = scene.for_each_file(|uri, file, left| {
            if failure.is_some() || is_there(uri, file.real_path()) {
                return Ok(());
            }
            // A link is copied under its own name, not the name of its target.
            match copy_into(folder, file.name(), &file.read_image(left)?, &mut copied.files) {
                Ok(name) => _ = copied.uris.insert(uri.to_owned(), uri_of(&bytes_of_path(Path::new(&name)))),
                Err(error) => failure = Some(error),
            }
            Ok(())
        });
        copied.files.warnings = warnings;
        match failure {
            None => Ok(copied),
            Some(error) => {
                copied.remove();
                Err(error)
            }
        }
    }

    /// Returns the URI of the copy of an image.
    pub(crate) fn uri(&self, uri: &str) -> Option<String> {
        self.uris.get(uri).cloned()
    }

    /// Returns the warnings about images that could not be copied.
    pub(crate) fn into_warnings(self) -> Vec<Warning> {
        self.files.warnings
    }

    /// Removes the copies, after writing the scene itself has failed.
    pub(crate) fn remove(self) {
        self.files.remove();
    }
}
