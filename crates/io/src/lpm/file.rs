//! Contents of a file.

use lodsmith_core::splits::{Counts, Splits};

use crate::error::Warning;
use crate::material::Regions;

/// Contents of a file, or of a prefix of one.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Lpm {
    /// Base and splits that were read.
    pub splits: Splits,
    /// Descriptions of the regions of its faces.
    pub regions: Regions,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
    /// True if the file is complete. If not, a warning reports how much was read.
    pub is_complete: bool,
    /// Number of splits and elements of the full mesh, as declared in the file.
    pub announced: (usize, Counts),
    /// Bits of a coordinate; `None` if every bit is kept.
    pub bits: Option<u8>,
    /// Sizes of the parts of the file.
    pub sizes: LpmSizes,
}

/// Sizes of the parts of a file, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LpmSizes {
    /// Magic and head.
    pub head: u64,
    /// Materials and images.
    pub materials: u64,
    /// The base mesh.
    pub base: u64,
    /// Splits.
    pub splits: u64,
    /// Number of chunks of splits.
    pub chunks: u64,
    /// Checkpoints.
    pub checkpoints: u64,
    /// The numbering of the original.
    pub original: u64,
    /// The end mark, and skipped chunks.
    pub others: u64,
}

impl LpmSizes {
    /// Returns the total number of bytes.
    pub fn total(&self) -> u64 {
        self.head + self.materials + self.base + self.splits + self.checkpoints + self.original + self.others
    }
}
