//! The error of calls with index buffers.

use lodsmith::SimplifyError;
use lodsmith_core::MeshError;

/// Reason why an index buffer was not simplified.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IndexError {
    /// An argument is not valid.
    #[error("{0}")]
    Argument(String),
    /// The engine refused the mesh or an option.
    #[error(transparent)]
    Engine(#[from] SimplifyError),
    /// An internal error.
    #[error("{0}")]
    Internal(String),
}

impl From<MeshError> for IndexError {
    fn from(error: MeshError) -> Self {
        Self::Argument(error.to_string())
    }
}
