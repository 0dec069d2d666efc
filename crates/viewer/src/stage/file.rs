//! Layout files: placement and motion of the copies, for this and other programs.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::motion::Motion;
use super::{Copies, Placement, Stage};
use crate::settings::session::{self, SessionError};

/// Content of a layout file. Lengths are in units of the model; the ground is y = 0, and the centre of a
/// copy's base is on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayoutFile {
    /// File type, always [`FILE_TYPE`].
    pub program: String,
    /// Format version, increased when older programs cannot read the file.
    pub version: u32,
    /// File name of the placed model.
    #[serde(default)]
    pub model: String,
    /// The copies.
    pub copies: Vec<Placement>,
    /// Keyframes of the copies and of the camera.
    #[serde(default)]
    pub motion: Motion,
}

/// Version written.
const FORMAT_VERSION: u32 = 1;
/// File type identifier of layout files.
pub const FILE_TYPE: &str = "lodsmith stage";

impl LayoutFile {
    /// Returns the layout of a stage.
    pub fn new(model: &Path, stage: &Stage) -> Self {
        let model = model.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let (copies, motion) = (stage.copies.to_vec(), stage.motion.clone());
        Self { program: FILE_TYPE.to_owned(), version: FORMAT_VERSION, model, copies, motion }
    }

    /// Returns true if a file identifies itself as a layout.
    pub fn is_layout(path: &Path) -> bool {
        let text = session::read(path).unwrap_or_default();
        serde_json::from_str::<serde_json::Value>(&text).is_ok_and(|json| json["program"] == FILE_TYPE)
    }

    /// Saves the layout: writes a temporary file first and renames it.
    ///
    /// # Errors
    /// [`SessionError::Io`].
    pub fn save(&self, path: &Path) -> Result<(), SessionError> {
        session::save_json(path, self)
    }

    /// Opens a layout. Returns its copies, the motion of copies and camera, and the number of copies that
    /// were dropped because their position or scale is invalid or there are too many.
    ///
    /// # Errors
    /// Any [`SessionError`] but [`SessionError::Outside`].
    pub fn open(path: &Path) -> Result<(Copies, Motion, usize), SessionError> {
        let file: Self = session::read_json(path, FILE_TYPE, FORMAT_VERSION)?;
        let all = file.copies.len();
        // Keyframes refer to copies by number: drop those of invalid copies and renumber the others.
        let gone: Vec<usize> = (0..all).filter(|n| file.copies[*n].checked().is_none()).collect();
        let copies = Copies::from(file.copies);
        let motion = file.motion.without_copies(&gone).limited_to(copies.len());
        let lost = all - copies.len();
        Ok((copies, motion, lost))
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
        let motion = Motion::default().with(|m| {
            m.copies.entry(0).or_default().set(1.5, copies[0]);
            m.length_secs = Some(4.0);
        });
        let stage = Stage { copies: copies.to_vec().into(), motion: motion.clone(), ..Stage::default() };
        LayoutFile::new(Path::new("some/folder/tree.glb"), &stage).save(&path).unwrap();
        assert!(LayoutFile::is_layout(&path));
        assert!(std::fs::read_to_string(&path).unwrap().contains("\"tree.glb\""));
        let (back, moves, lost) = LayoutFile::open(&path).unwrap();
        assert_eq!((&*back, moves, lost), (copies.as_slice(), motion, 0));
    }

    #[test]
    fn an_invalid_layout_is_reported_and_invalid_copies_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let open = |text: &str| {
            std::fs::write(&path, text).unwrap();
            LayoutFile::open(&path)
        };
        for text in ["{", "[]", r#"{"program":"x","version":1,"copies":[]}"#] {
            let text = open(text).unwrap_err().to_string();
            assert!(text.contains("a.json") && text.contains("not a lodsmith stage"), "{text}");
        }
        let newer = r#"{"program":"lodsmith stage","version":9,"copies":[]}"#;
        assert!(open(newer).unwrap_err().to_string().contains("newer"));
        let some =
            r#"{"program":"lodsmith stage","version":1,"copies":[{"x":1,"z":2},{"x":1,"z":2,"scale":-1}]}"#;
        let (copies, motion, lost) = open(some).unwrap();
        assert_eq!((&*copies, lost), ([Placement::at(1.0, 2.0)].as_slice(), 1));
        assert!(motion.is_empty(), "an older file");
        let moves = r#"{"program":"lodsmith stage","version":1,"copies":[{"x":1,"z":2,"scale":0},{"x":3,"z":4}],
            "motion":{"copies":[{"copy":0,"keys":[{"seconds":1,"x":0,"z":0}]},
            {"copy":1,"curve":"step","keys":[{"seconds":2,"x":5,"z":6}]},{"copy":7,"keys":[{"seconds":2,"x":5,"z":6}]}]}}"#;
        let (_, motion, lost) = open(moves).unwrap();
        assert_eq!((lost, motion.copies.keys().copied().collect::<Vec<_>>()), (1, vec![0]));
        assert_eq!(motion.copies[&0].at(0.0), Some(Placement::at(5.0, 6.0)));
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(LayoutFile::open(&path), Err(SessionError::Io { .. })));
        assert!(!LayoutFile::is_layout(&path));
    }
}
