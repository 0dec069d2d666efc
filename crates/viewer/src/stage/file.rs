//! Layouts as files: where copies stand, for this program and for others.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{Copies, Placement};

/// A layout as a file. Lengths are those of the model; the ground is y = 0, the middle of a copy's base stands on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayoutFile {
    /// What it is, for who finds the file.
    pub program: String,
    /// Grows when older programs could not read it.
    pub version: u32,
    /// The file name of the model that was placed.
    #[serde(default)]
    pub model: String,
    /// The copies.
    pub copies: Vec<Placement>,
}

/// The version that is written.
const VERSION: u32 = 1;
/// What a file says that it is.
pub const PROGRAM: &str = "lodsmith stage";

/// Why a layout cannot be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LayoutError {
    /// The disk says no.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the disk says.
        source: io::Error,
    },
    /// It is none.
    #[error("{path}: is no layout of the stage: {reason}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What was met.
        reason: String,
    },
}

impl LayoutFile {
    /// A layout of these.
    pub fn new(model: &Path, copies: &[Placement]) -> Self {
        let model = model.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        Self { program: PROGRAM.to_owned(), version: VERSION, model, copies: copies.to_vec() }
    }

    /// Whether a file says that it is one.
    pub fn is_one(path: &Path) -> bool {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        serde_json::from_str::<serde_json::Value>(&text).is_ok_and(|json| json["program"] == PROGRAM)
    }

    /// Saves it: to a temporary file first, which then takes the name.
    ///
    /// # Errors
    /// [`LayoutError::Io`].
    pub fn save(&self, path: &Path) -> Result<(), LayoutError> {
        let text = serde_json::to_string_pretty(self).map_err(io::Error::from);
        text.and_then(|text| crate::session::write(path, text.as_bytes()))
            .map_err(|source| LayoutError::Io { path: path.to_owned(), source })
    }

    /// Opens one: its copies, and how many of the file are none, because they have no place, no size, or are too many.
    ///
    /// # Errors
    /// Each [`LayoutError`].
    pub fn open(path: &Path) -> Result<(Copies, usize), LayoutError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| LayoutError::Io { path: path.to_owned(), source })?;
        let malformed = |reason: String| LayoutError::Malformed { path: path.to_owned(), reason };
        let file: Self = serde_json::from_str(&text).map_err(|e| malformed(e.to_string()))?;
        if file.program != PROGRAM {
            return Err(malformed("it does not say that it is one".to_owned()));
        }
        if file.version > VERSION {
            let reason =
                format!("a newer lodsmith saved it (version {}, {VERSION} is known here)", file.version);
            return Err(malformed(reason));
        }
        let all = file.copies.len();
        let copies = Copies::from(file.copies);
        let lost = all - copies.len();
        Ok((copies, lost))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layout_comes_back_from_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let copies = [Placement { turn_deg: 33.25, scale: 0.1 + 0.2, ..Placement::at(1.0 / 3.0, -4e-7) }];
        LayoutFile::new(Path::new("some/folder/tree.glb"), &copies).save(&path).unwrap();
        assert!(LayoutFile::is_one(&path));
        assert!(std::fs::read_to_string(&path).unwrap().contains("\"tree.glb\""));
        let (back, lost) = LayoutFile::open(&path).unwrap();
        assert_eq!((&*back, lost), (copies.as_slice(), 0));
    }

    #[test]
    fn what_is_no_layout_is_told_and_copies_without_a_place_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let open = |text: &str| {
            std::fs::write(&path, text).unwrap();
            LayoutFile::open(&path)
        };
        for text in ["{", "[]", r#"{"program":"x","version":1,"copies":[]}"#] {
            let text = open(text).unwrap_err().to_string();
            assert!(text.contains("a.json") && text.contains("no layout"), "{text}");
        }
        let newer = r#"{"program":"lodsmith stage","version":9,"copies":[]}"#;
        assert!(open(newer).unwrap_err().to_string().contains("newer"));
        let some =
            r#"{"program":"lodsmith stage","version":1,"copies":[{"x":1,"z":2},{"x":1,"z":2,"scale":-1}]}"#;
        let (copies, lost) = open(some).unwrap();
        assert_eq!((&*copies, lost), ([Placement::at(1.0, 2.0)].as_slice(), 1));
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(LayoutFile::open(&path), Err(LayoutError::Io { .. })));
        assert!(!LayoutFile::is_one(&path));
    }
}
