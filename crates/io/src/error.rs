//! Errors and warnings of readers and writers.

use std::fmt;
use std::path::PathBuf;

use lodsmith_core::MeshError;
use lodsmith_core::memory::{TooMuchMemory, format_bytes};

/// The location of a problem in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// A line, counted from 1.
    Line(usize),
    /// A byte, counted from 0.
    Byte(usize),
    /// A named element, such as `face 12` or `accessors[3]`.
    Element(String),
    /// The file as a whole.
    File,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(n) => write!(f, "line {n}: "),
            Self::Byte(n) => write!(f, "byte {n}: "),
            Self::Element(e) => write!(f, "{e}: "),
            Self::File => Ok(()),
        }
    }
}

/// An error while reading a file. The caller that knows the path adds it ([`ReadError::at`] makes a
/// [`ReadError::File`]).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The bytes break the rules of their format.
    #[error("{place}{problem}")]
    Malformed {
        /// The location.
        place: Place,
        /// The problem and, if possible, a remedy.
        problem: String,
    },
    /// The file is valid but needs an unsupported feature, such as an extension, which is named.
    #[error("{0}")]
    Unsupported(String),
    /// No format is recognised.
    #[error("not a mesh in any known format (OBJ, OFF, PLY, STL, glTF, GLB, 3MF, COLLADA, FBX, LPM): {0}")]
    Unknown(String),
    /// A limit is exceeded.
    #[error("{what} is {size}, above the limit of {limit}")]
    Limit {
        /// Name of the quantity that is too large.
        what: &'static str,
        /// Its size.
        size: u64,
        /// The limit.
        limit: u64,
    },
    /// Reading would take more memory than [`Limits::memory`](crate::Limits::memory).
    #[error(transparent)]
    Memory(#[from] TooMuchMemory),
    /// The data would unpack to far more bytes than any real mesh: they were crafted to fill the memory.
    #[error("{what} would unpack to more than {}, over {times} times its size: implausible compression ratio, file rejected", format_bytes(*limit))]
    Ratio {
        /// The packed object.
        what: &'static str,
        /// Maximum number of unpacked bytes.
        limit: u64,
        /// Maximum ratio of unpacked to packed bytes.
        times: u64,
    },
    /// The file has no faces.
    #[error("no faces in the file ({vertices} vertices): nothing to work on")]
    NoFaces {
        /// Number of vertices in the file.
        vertices: usize,
    },
    /// The system failed to read.
    #[error("cannot read: {0}")]
    Io(#[from] std::io::Error),
    /// The buffers do not form a mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Another error, with the path of the file.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The error.
        source: Box<ReadError>,
    },
}

impl ReadError {
    /// Creates an error about this line, counted from 1.
    pub fn line(line: usize, problem: impl Into<String>) -> Self {
        Self::Malformed { place: Place::Line(line), problem: problem.into() }
    }
    /// Creates an error about this byte.
    pub fn byte(byte: usize, problem: impl Into<String>) -> Self {
        Self::Malformed { place: Place::Byte(byte), problem: problem.into() }
    }
    /// Creates an error about this element.
    pub fn element(element: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Malformed { place: Place::Element(element.into()), problem: problem.into() }
    }
    /// Creates an error about the whole file.
    pub fn file(problem: impl Into<String>) -> Self {
        Self::Malformed { place: Place::File, problem: problem.into() }
    }
    /// Adds the path of the file.
    #[must_use]
    pub fn at(self, path: impl Into<PathBuf>) -> Self {
        match self {
            named @ Self::File { .. } => named,
            source => Self::File { path: path.into(), source: Box::new(source) },
        }
    }
}

/// An error while writing a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The system failed to write.
    #[error("{}: cannot write: {source}", path.display())]
    Io {
        /// The path of the output.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The extension of the path does not belong to a format.
    #[error("{}: the extension does not belong to a known format; use .obj, .off, .ply, .stl, .gltf, .glb or .3mf, or set the format with --to", path.display())]
    UnknownFormat {
        /// The path of the output.
        path: PathBuf,
    },
    /// The format needs more than a mesh.
    #[error("LPM stores progressive meshes, not plain ones: write it with `lodsmith progressive build`")]
    NeedsSplits,
    /// The format is read only.
    #[error("{format} files can be read but not written; use .obj, .off, .ply, .stl, .gltf, .glb or .3mf")]
    ReadOnly {
        /// The format's name.
        format: &'static str,
    },
    /// The mesh is too large for the format.
    #[error("{format} cannot hold {what}")]
    TooLarge {
        /// The format's name.
        format: &'static str,
        /// Description of the data that it cannot hold.
        what: String,
    },
}

/// A message for the user about something that is not an error.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Warning {
    /// A sentence without a full stop.
    pub text: String,
    /// True if data of the input are lost; `--strict` turns that into an error.
    pub data_lost: bool,
    /// True if the lost data belong to the scene and not to the mesh, which does not matter if the mesh is
    /// only viewed.
    pub of_scene: bool,
}

impl Warning {
    /// Creates a warning without loss.
    pub fn note(text: impl Into<String>) -> Self {
        Self { text: text.into(), data_lost: false, of_scene: false }
    }
    /// Creates a warning that the mesh read from a scene lacks this; everything derived from the mesh lacks
    /// it too.
    pub(crate) fn lost_scene_data(what: &str) -> Self {
        let text = format!("{what} are not carried: only a scene that is written as glTF or GLB keeps them");
        Self { of_scene: true, ..Self::lost(text) }
    }
    /// Creates a warning about lost data of the scene that the mesh does not have.
    pub(crate) fn lost_of_scene(text: impl Into<String>) -> Self {
        Self { of_scene: true, ..Self::lost(text) }
    }
    /// Creates a warning about lost data.
    pub fn lost(text: impl Into<String>) -> Self {
        Self { text: text.into(), data_lost: true, of_scene: false }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
