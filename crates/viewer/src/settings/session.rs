//! Saved state: session files, and the viewer's own settings file with recent files and theme.

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use lodsmith_io::AssetScope;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::settings::up_axis::UpAxis;
use crate::settings::{Pose, Settings};

/// A session: files, options, appearance, cameras.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// File type marker.
    pub program: String,
    /// Format version; increases when older programs cannot read it.
    pub version: u32,
    /// Settings of the document.
    pub settings: Settings,
    /// Cameras of the two sides.
    pub cameras: Option<[Pose; 2]>,
    /// Camera of the stage, if it was shown.
    #[serde(default)]
    pub stage_camera: Option<Pose>,
}

/// Format version that is written.
const VERSION: u32 = 1;
const PROGRAM: &str = "lodsmith session";

/// Error of reading or writing a session or layout.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// Error of the file system.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// Not a session or layout.
    #[error("{path}: not a {program}: {reason}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// File type that was expected.
        program: &'static str,
        /// Description of the fault.
        reason: String,
    },
    /// It refers to files that it may not read.
    #[error(
        "{path}: refers to {}, outside its folder: start with --asset-root DIR or --allow-outside to allow it",
        list_of(files)
    )]
    Outside {
        /// The file.
        path: PathBuf,
        /// The files it refers to.
        files: Vec<PathBuf>,
    },
    /// Written by a newer version.
    #[error("{path}: saved by a newer lodsmith (version {got}, supported up to {most})")]
    Newer {
        /// The file.
        path: PathBuf,
        /// Format version of the file.
        got: u64,
        /// Largest version that can be read.
        most: u32,
    },
}

impl Session {
    /// Makes a session.
    pub fn new(settings: Settings, cameras: [Pose; 2]) -> Self {
        let (program, cameras) = (PROGRAM.to_owned(), Some(cameras));
        Self { program, version: VERSION, settings, cameras, stage_camera: None }
    }

    /// Returns the session with a camera of the stage.
    pub fn with_stage_camera(self, stage_camera: Option<Pose>) -> Self {
        Self { stage_camera, ..self }
    }

    /// Saves the session atomically. Files in its folder are stored with relative paths.
    ///
    /// # Errors
    /// [`SessionError::Io`].
    pub fn save(&self, path: &Path) -> Result<(), SessionError> {
        let mut copy = self.clone();
        let folder = folder_of(path);
        for file in copy.settings.all_files_mut() {
            let whole = absolute(file);
            *file = whole.strip_prefix(&folder).map_or_else(|_| whole.clone(), Path::to_owned);
        }
        save_json(path, &copy)
    }

    /// Opens a session. The files it refers to must be in its folder or below, unless the scope allows more.
    ///
    /// # Errors
    /// Each [`SessionError`].
    pub fn open(path: &Path, scope: &AssetScope) -> Result<Self, SessionError> {
        match Self::read(path, scope)? {
            (session, files) if files.is_empty() => Ok(session),
            (_, files) => Err(SessionError::Outside { path: path.to_owned(), files }),
        }
    }

    /// Reads a session. Returns it and the files that it refers to outside the scope; none of these is read here.
    ///
    /// # Errors
    /// Each [`SessionError`] but [`SessionError::Outside`].
    pub fn read(path: &Path, scope: &AssetScope) -> Result<(Self, Vec<PathBuf>), SessionError> {
        let mut session: Self = read_json(path, PROGRAM, VERSION)?;
        let folder = folder_of(path);
        let mut outside = Vec::new();
        for file in session.settings.all_files_mut() {
            *file = folder.join(&file);
            if !scope.allows(&absolute(file), &folder) && !outside.contains(file) {
                outside.push(file.clone());
            }
        }
        Ok((session, outside))
    }
}

/// Formats a list of files: `a.glb, b.glb`.
fn list_of(files: &[PathBuf]) -> String {
    files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join(", ")
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

fn folder_of(path: &Path) -> PathBuf {
    absolute(path).parent().map(Path::to_owned).unwrap_or_default()
}

/// Largest session or layout file, in bytes: the maximum of copies and keyframes takes a quarter of it.
const MAX_FILE_BYTES: u64 = 256 << 20;

/// Writes a session or a layout atomically.
pub(crate) fn save_json(path: &Path, content: &impl Serialize) -> Result<(), SessionError> {
    let text = serde_json::to_string_pretty(content).map_err(io::Error::from);
    text.and_then(|text| write(path, text.as_bytes()))
        .map_err(|source| SessionError::Io { path: path.to_owned(), source })
}

/// Reads a session or a layout whose fields `program` and `version` are these, or of an older version.
pub(crate) fn read_json<T: DeserializeOwned>(
    path: &Path,
    program: &'static str,
    most: u32,
) -> Result<T, SessionError> {
    let text = read(path).map_err(|source| SessionError::Io { path: path.to_owned(), source })?;
    let malformed = |reason: String| SessionError::Malformed { path: path.to_owned(), program, reason };
    let json: serde_json::Value = serde_json::from_str(&text).map_err(|e| malformed(e.to_string()))?;
    if let Some(got) = json["version"].as_u64().filter(|&version| version > u64::from(most)) {
        return Err(SessionError::Newer { path: path.to_owned(), got, most });
    }
    if json["program"] != program {
        return Err(malformed("the field `program` is missing or different".to_owned()));
    }
    serde_json::from_str(&text).map_err(|e| malformed(e.to_string()))
}

/// Reads the text of a session or a layout.
pub(crate) fn read(path: &Path) -> io::Result<String> {
    read_up_to(path, MAX_FILE_BYTES)
}

fn read_up_to(path: &Path, most: u64) -> io::Result<String> {
    let mut text = String::new();
    lodsmith_io::drive::open(path)?.take(most + 1).read_to_string(&mut text)?;
    if text.len() as u64 > most {
        let why = format!("has more than {most} bytes, too large for a session or layout");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, why));
    }
    Ok(text)
}

/// Writes a file atomically: after an error the old file is unchanged.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    lodsmith_io::write::write_file(path, false, |out| out.write_all(bytes))
}

/// Settings that the viewer keeps between runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ViewerPrefs {
    /// Recent files, newest first.
    pub recent: Vec<PathBuf>,
    /// True for the light theme.
    pub is_light: bool,
    /// Axes that the user chose for files.
    pub ups: Vec<(PathBuf, UpAxis)>,
    /// True once the hint for the first minute was closed.
    pub knows_hint: bool,
}

/// Number of recent files that are kept.
const MAX_RECENT_FILES: usize = 12;
/// Number of files whose axis is kept.
const MAX_UPS: usize = 200;

impl ViewerPrefs {
    /// Returns the path of the settings file; `None` if the system defines no such folder.
    pub fn path() -> Option<PathBuf> {
        let from = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
        let folder = if cfg!(target_os = "windows") {
            from("APPDATA")?
        } else if cfg!(target_os = "macos") {
            from("HOME")?.join("Library/Application Support")
        } else {
            from("XDG_CONFIG_HOME").or_else(|| Some(from("HOME")?.join(".config")))?
        };
        Some(folder.join("lodsmith").join("viewer.json"))
    }

    /// Loads the settings; defaults if they cannot be read.
    pub fn load(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    /// Saves the settings. Errors are ignored: nothing of value is lost.
    pub fn save(&self, path: &Path) {
        if let (Some(folder), Ok(text)) = (path.parent(), serde_json::to_string_pretty(self))
            && std::fs::create_dir_all(folder).is_ok()
        {
            let _ = write(path, text.as_bytes());
        }
    }

    /// Returns the axis that the user chose for a file.
    pub fn up_of(&self, file: &Path) -> Option<UpAxis> {
        let file = absolute(file);
        self.ups.iter().find(|(of, _)| *of == file).map(|(_, up)| *up)
    }

    /// Remembers the axis for a file; [`UpAxis::Auto`] forgets it.
    pub fn set_up(&mut self, file: &Path, up: UpAxis) {
        let file = absolute(file);
        self.ups.retain(|(of, _)| *of != file);
        if up != UpAxis::Auto {
            self.ups.insert(0, (file, up));
        }
        self.ups.truncate(MAX_UPS);
    }

    /// Adds a file to the recent files.
    pub fn add_recent(&mut self, file: &Path) {
        let file = absolute(file);
        self.recent.retain(|f| *f != file);
        self.recent.insert(0, file);
        self.recent.truncate(MAX_RECENT_FILES);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::EnvironmentChoice;

    fn session(folder: &Path) -> Session {
        let mut settings = Settings { files: vec![folder.join("a.glb")], ..Settings::default() };
        settings.look.matcap = Some(folder.join("look/ball.png"));
        settings.look.shader = Some(folder.join("look/s.wgsl"));
        settings.look.around = EnvironmentChoice::File(folder.join("look/sky.hdr"));
        let pose = Pose { eye: [1.0; 3], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov_y_rad: 0.6 };
        Session::new(settings, [pose; 2])
    }

    #[test]
    fn a_session_moves_with_its_folder() {
        let [one, two] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        session(one.path()).save(&one.path().join("s.json")).unwrap();
        std::fs::rename(one.path().join("s.json"), two.path().join("s.json")).unwrap();
        let opened = Session::open(&two.path().join("s.json"), &AssetScope::Folder).unwrap();
        assert_eq!(opened.settings.files, [two.path().join("a.glb")]);
        let look: Vec<_> = opened.settings.look.files().collect();
        assert_eq!(
            look,
            ["ball.png", "s.wgsl", "sky.hdr"].map(|name| two.path().join("look").join(name)).each_ref()
        );
    }

    #[test]
    fn a_session_names_no_file_outside_of_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("in");
        std::fs::create_dir(&inside).unwrap();
        session(folder.path()).save(&inside.join("s.json")).unwrap();
        let open = |scope| Session::open(&inside.join("s.json"), &scope);
        let message = open(AssetScope::Folder).unwrap_err().to_string();
        assert!(message.contains("a.glb") && message.contains("--allow-outside"), "{message}");
        assert!(open(AssetScope::Anywhere).is_ok());
        assert!(open(AssetScope::Root(folder.path().to_owned())).is_ok());
        // Files of the appearance are checked too.
        let mut looks = session(&inside);
        looks.settings.look.matcap = Some(folder.path().join("ball.png"));
        looks.save(&inside.join("s.json")).unwrap();
        assert!(open(AssetScope::Folder).unwrap_err().to_string().contains("ball.png"));
        // All of them are named, each once.
        looks.settings.files = ["b.glb", "a.glb", "b.glb"].map(|name| folder.path().join(name)).to_vec();
        looks.save(&inside.join("s.json")).unwrap();
        let Err(SessionError::Outside { files, .. }) = open(AssetScope::Folder) else {
            panic!("it is refused")
        };
        assert_eq!(files, ["b.glb", "a.glb", "ball.png"].map(|name| folder.path().join(name)));
    }

    #[test]
    fn an_invalid_session_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.json");
        let error_of = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Session::open(&path, &AssetScope::Folder).unwrap_err().to_string()
        };
        assert!(error_of("{").contains("not a lodsmith session"));
        assert!(error_of("{}").contains("not a lodsmith session"));
        assert!(error_of(r#"{"version":99}"#).contains("newer"));
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(Session::open(&path, &AssetScope::Folder), Err(SessionError::Io { .. })));
    }

    #[test]
    fn an_endless_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.json");
        std::fs::write(&path, "0123456789").unwrap();
        assert_eq!(read_up_to(&path, 10).unwrap(), "0123456789");
        assert!(read_up_to(&path, 9).unwrap_err().to_string().contains("more than 9 bytes"));
        // An endless file.
        if Path::new("/dev/zero").exists() {
            assert!(Session::open(Path::new("/dev/zero"), &AssetScope::Anywhere).is_err());
        }
    }

    #[test]
    fn the_newest_file_comes_first_and_once() {
        let mut memory = ViewerPrefs::default();
        for name in ["a", "b", "a"] {
            memory.add_recent(Path::new(name));
        }
        let names: Vec<_> = memory.recent.iter().map(|p| p.file_name().unwrap()).collect();
        assert_eq!(names, ["a", "b"]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/viewer.json");
        memory.save(&path);
        assert_eq!(ViewerPrefs::load(&path), memory);
    }
}
