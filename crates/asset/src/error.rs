//! Errors of jobs.

use std::io;
use std::path::PathBuf;

use lodsmith::SimplifyError;
use lodsmith::options::by_name::OptionError;
use lodsmith_bake::BakeError;
use lodsmith_core::MeshError;
use lodsmith_core::measure::MeasureError;
use lodsmith_core::memory::TooMuchMemory;
use lodsmith_io::{ReadError, WriteError};
#[cfg(feature = "pictures")]
use lodsmith_render::{AnimationError, PictureError, RenderError};

/// Reasons why a job failed. The texts do not name the input, which the caller knows.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AssetError {
    /// An error in the options of a job.
    #[error("{0}")]
    Usage(String),
    /// There is no such option.
    #[error("there is no option {name}{}", nearest.map_or_else(String::new, |name| format!("; a similar one is {}", name.replace('-', "_"))))]
    UnknownOption {
        /// The name given.
        name: String,
        /// The most similar name of an option, if any is similar.
        nearest: Option<&'static str>,
    },
    /// The input cannot be read.
    #[error("{0}")]
    Read(ReadError),
    /// An error of an input other than the main input, which the caller names.
    #[error("{path}: {problem}")]
    Input {
        /// The input.
        path: String,
        /// The reason.
        problem: Box<AssetError>,
    },
    /// A name of a part or an attribute does not occur in the input.
    #[error("{0}")]
    Name(String),
    /// A step would take more memory than allowed.
    #[error("{0}")]
    Memory(TooMuchMemory),
    /// The run of the engine failed.
    #[error("{0}")]
    Simplify(SimplifyError),
    /// Baking failed.
    #[error("{0}")]
    Bake(BakeError),
    /// The time limit ended baking.
    #[error("the time limit ended baking, which has no partial result")]
    BakeTimeout,
    /// Levels were requested for a scene that has levels already.
    #[error("the scene has levels of detail already (MSFT_lod): use a file without levels")]
    Levels,
    /// Values do not fit a mesh.
    #[error("{0}")]
    Mesh(MeshError),
    /// Distances cannot be measured.
    #[error("{0}")]
    Measure(MeasureError),
    /// A picture cannot be drawn.
    #[cfg(feature = "pictures")]
    #[error("{0}")]
    Render(RenderError),
    /// An image cannot be decoded or encoded.
    #[cfg(feature = "pictures")]
    #[error("{0}")]
    Picture(PictureError),
    /// An animation cannot be encoded.
    #[cfg(feature = "pictures")]
    #[error("{0}")]
    Animation(AnimationError),
    /// The output cannot be written.
    #[error("{0}")]
    Write(WriteError),
    /// Standard output did not accept all of a file. This is also the error if the reader of a pipe closes it early,
    /// since the file is truncated then.
    #[error("{}", stream_text(.0))]
    Stream(io::Error),
    /// A file that the options name cannot be read, or a folder cannot be created.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The reason.
        problem: io::Error,
    },
    /// A folder for outputs cannot be created.
    #[error("{}: cannot create the folder: {problem}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The reason.
        problem: io::Error,
    },
    /// The caller cancelled the job.
    #[error("cancelled")]
    Cancelled,
}

impl AssetError {
    /// Adds the name of the input, except to [`AssetError::Cancelled`], which does not concern it.
    pub(crate) fn of(self, input: impl ToString) -> Self {
        match self {
            Self::Cancelled => self,
            why => Self::Input { path: input.to_string(), problem: Box::new(why) },
        }
    }

    /// True for an error in the options, not in a file, a mesh or the system.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Usage(_) | Self::UnknownOption { .. } => true,
            Self::Simplify(why) => why.is_usage(),
            Self::Input { problem, .. } => problem.is_usage(),
            _ => false,
        }
    }
}

fn stream_text(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::BrokenPipe => "standard output was closed before all was written".to_owned(),
        _ => format!("cannot write to standard output: {error}"),
    }
}

/// Returns an error in the options.
pub(crate) fn usage(text: impl Into<String>) -> AssetError {
    AssetError::Usage(text.into())
}

impl From<ReadError> for AssetError {
    fn from(error: ReadError) -> Self {
        match error {
            ReadError::File { source, .. } => Self::Read(*source),
            other => Self::Read(other),
        }
    }
}

impl From<SimplifyError> for AssetError {
    fn from(error: SimplifyError) -> Self {
        match error {
            SimplifyError::Cancelled => Self::Cancelled,
            other => Self::Simplify(other),
        }
    }
}

impl From<OptionError> for AssetError {
    fn from(error: OptionError) -> Self {
        match error {
            OptionError::Unknown { name, nearest } => Self::UnknownOption { name, nearest },
            OptionError::Combination(why) => Self::Simplify(why),
            OptionError::Value { option, why } => Self::Usage(format!("--{option}: {why}")),
            other => Self::Usage(other.to_string()),
        }
    }
}

impl From<TooMuchMemory> for AssetError {
    fn from(error: TooMuchMemory) -> Self {
        Self::Memory(error)
    }
}

impl From<MeshError> for AssetError {
    fn from(error: MeshError) -> Self {
        Self::Mesh(error)
    }
}

impl From<WriteError> for AssetError {
    fn from(error: WriteError) -> Self {
        Self::Write(error)
    }
}

impl From<MeasureError> for AssetError {
    fn from(error: MeasureError) -> Self {
        Self::Measure(error)
    }
}

#[cfg(feature = "pictures")]
impl From<RenderError> for AssetError {
    fn from(error: RenderError) -> Self {
        Self::Render(error)
    }
}

#[cfg(feature = "pictures")]
impl From<PictureError> for AssetError {
    fn from(error: PictureError) -> Self {
        Self::Picture(error)
    }
}

#[cfg(feature = "pictures")]
impl From<AnimationError> for AssetError {
    fn from(error: AnimationError) -> Self {
        Self::Animation(error)
    }
}
