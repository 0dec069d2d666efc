//! What goes wrong with files, and who is at fault.

use std::fmt;
use std::path::PathBuf;

use lodsmith_core::MeshError;
use lodsmith_core::memory::{TooMuchMemory, in_words};

/// Where in a file something is wrong.
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

/// Why a file could not be read. The path is added by whoever knows it ([`ReadError::at`] is [`ReadError::File`]).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The bytes break the rules of their format.
    #[error("{place}{problem}")]
    Malformed {
        /// Where.
        place: Place,
        /// What is wrong and, where something can be done, what to do.
        problem: String,
    },
    /// The file is sound, but it needs something that is not done here; an extension is named.
    #[error("{0}")]
    Unsupported(String),
    /// No format is recognised.
    #[error("not a mesh in any known format (OBJ, OFF, PLY, STL, glTF, GLB, LPM): {0}")]
    Unknown(String),
    /// A limit stands against it.
    #[error("{what} is {size}, above the limit of {limit}")]
    Limit {
        /// What is too large.
        what: &'static str,
        /// Its size.
        size: u64,
        /// The limit.
        limit: u64,
    },
    /// Reading would take more memory than [`Limits::memory`](crate::Limits::memory).
    #[error(transparent)]
    Memory(#[from] TooMuchMemory),
    /// Few bytes become more in memory than those of any mesh: they were made to fill it.
    #[error("{what} would become more than {}, above {times} times its size: no mesh is packed so well", in_words(*limit))]
    Ratio {
        /// What is packed.
        what: &'static str,
        /// Bytes that it may become.
        limit: u64,
        /// How many times its own bytes it may become.
        times: u64,
    },
    /// The file holds no face.
    #[error("no faces in the file ({vertices} vertices): nothing to work on")]
    NoFaces {
        /// Vertices that it does hold.
        vertices: usize,
    },
    /// The system could not read.
    #[error("cannot read: {0}")]
    Io(#[from] std::io::Error),
    /// The buffers are no mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// One of the others, in this file.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: Box<ReadError>,
    },
}

impl ReadError {
    /// Something is wrong in this line, counted from 1.
    pub fn line(line: usize, problem: impl Into<String>) -> Self {
        Self::Malformed { place: Place::Line(line), problem: problem.into() }
    }
    /// Something is wrong at this byte.
    pub fn byte(byte: usize, problem: impl Into<String>) -> Self {
        Self::Malformed { place: Place::Byte(byte), problem: problem.into() }
    }
    /// Something is wrong with this element.
    pub fn element(element: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Malformed { place: Place::Element(element.into()), problem: problem.into() }
    }
    /// The file as a whole is wrong.
    pub fn file(problem: impl Into<String>) -> Self {
        Self::Malformed { place: Place::File, problem: problem.into() }
    }
    /// Names the file.
    #[must_use]
    pub fn at(self, path: impl Into<PathBuf>) -> Self {
        match self {
            named @ Self::File { .. } => named,
            source => Self::File { path: path.into(), source: Box::new(source) },
        }
    }
}

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The system could not write.
    #[error("{}: cannot write: {source}", path.display())]
    Io {
        /// The target.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The ending of the path names no format.
    #[error("{}: the ending names no format; use one of .obj .off .ply .stl .gltf .glb, or say which with --to", path.display())]
    UnknownFormat {
        /// The target.
        path: PathBuf,
    },
    /// The format holds more than a mesh.
    #[error("LPM holds a progressive mesh, not a mesh alone: `lodsmith progressive build` writes one")]
    NeedsSplits,
    /// The mesh is too large for the format.
    #[error("{format} cannot hold {what}")]
    TooLarge {
        /// The format's name.
        format: &'static str,
        /// What it cannot hold.
        what: String,
    },
}

/// Something that the user should know and that is no failure.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Warning {
    /// A sentence without a full stop.
    pub text: String,
    /// Whether data of the input are lost by it; `--strict` makes that a failure.
    pub data_lost: bool,
    /// Whether what is lost is of the scene round the mesh, so that nothing is where the mesh is only looked at.
    pub of_scene: bool,
}

impl Warning {
    /// Nothing is lost.
    pub fn note(text: impl Into<String>) -> Self {
        Self { text: text.into(), data_lost: false, of_scene: false }
    }
    /// The mesh that was read of a scene lacks this; whatever is made of the mesh lacks it too.
    pub(crate) fn not_of_a_mesh(what: &str) -> Self {
        let text = format!("{what} are not carried: only a scene that goes from glTF to glTF keeps them");
        Self { of_scene: true, ..Self::lost(text) }
    }
    /// Data are lost.
    pub fn lost(text: impl Into<String>) -> Self {
        Self { text: text.into(), data_lost: true, of_scene: false }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
