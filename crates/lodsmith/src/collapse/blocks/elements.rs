//! Elements of blocks, in the order of the mesh that was cut.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::chunks;

/// A vertex or face in a block: the index of the block, and its own index there. (In 64 bits, for atomic access.)
#[derive(Clone, Copy)]
pub(super) struct InBlock(u64);

impl InBlock {
    const NONE: u64 = u64::MAX;

    pub(super) fn new(block: usize, index: usize) -> Self {
        Self((block as u64) << 32 | index as u64)
    }
    #[inline(always)]
    pub(super) fn block(self) -> usize {
        (self.0 >> 32) as usize
    }
    #[inline(always)]
    pub(super) fn index(self) -> usize {
        self.0 as u32 as usize
    }
}

/// Elements by their number in the mesh that was cut, filled by several threads.
pub(super) struct ByNumber(Vec<AtomicU64>);

impl ByNumber {
    pub(super) fn new(count: usize) -> Self {
        Self(chunks::list(count, |_| AtomicU64::new(InBlock::NONE)))
    }

    #[inline(always)]
    pub(super) fn set(&self, number: u32, element: InBlock) {
        self.0[number as usize].store(element.0, Ordering::Relaxed);
    }

    /// Returns the elements that are set, in order.
    pub(super) fn in_order(&self) -> Vec<InBlock> {
        let set = |range: Range<usize>| {
            let all = self.0[range].iter().map(|at| at.load(Ordering::Relaxed));
            all.filter(|at| *at != InBlock::NONE).map(InBlock).collect::<Vec<_>>()
        };
        chunks::map(self.0.len(), set).concat()
    }
}
