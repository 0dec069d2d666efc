//! Errors of baking.

use lodsmith_core::memory::TooMuchMemory;

/// Reasons why a bake has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// A model has no faces with finite corners that are placed in it.
    #[error("the {which} model has no faces to bake")]
    Empty {
        /// `detailed` or `lighter`.
        which: &'static str,
    },
    /// An option is out of its range.
    #[error("{option}: {problem}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// The problem, and what to do.
        problem: String,
    },
    /// It needs more memory than allowed.
    #[error(transparent)]
    Memory(#[from] TooMuchMemory),
    /// The surface could not be unwrapped into one atlas.
    #[error("no atlas of {size} x {size} texels: {problem}")]
    Atlas {
        /// Width and height of the atlas.
        size: usize,
        /// The reason.
        problem: String,
    },
    /// A map cannot be written as PNG.
    #[error("the map {map}: {problem}")]
    Picture {
        /// Name of the map.
        map: &'static str,
        /// The reason.
        problem: String,
    },
    /// The control cancelled the run.
    #[error("cancelled")]
    Cancelled,
}
