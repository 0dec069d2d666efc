//! What a file holds.

use lodsmith_core::splits::{Counts, Splits};

use crate::error::Warning;
use crate::material::Regions;

/// A file, or its beginning.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Lpm {
    /// The base and the splits that there are.
    pub splits: Splits,
    /// What the regions of its faces stand for.
    pub regions: Regions,
    /// What the user should know.
    pub warnings: Vec<Warning>,
    /// Whether all of it is there. If not, a warning says how far it goes.
    pub is_complete: bool,
    /// Splits and elements of the full mesh, as the file announces them.
    pub announced: (usize, Counts),
    /// Bits of a coordinate; `None` where every bit is kept.
    pub bits: Option<u8>,
    /// Where the bytes are.
    pub sizes: LpmSizes,
}

/// Bytes by what they are for.
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
    /// Chunks that they are in.
    pub chunks: u64,
    /// Levels with a fit.
    pub checkpoints: u64,
    /// The order of the original.
    pub original: u64,
    /// The end mark, and what is skipped here.
    pub others: u64,
}

impl LpmSizes {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.head + self.materials + self.base + self.splits + self.checkpoints + self.original + self.others
    }
}
