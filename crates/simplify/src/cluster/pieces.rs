//! Work in pieces of fixed size, joined in their order: the same bytes on any number of threads.

use std::ops::Range;

#[cfg(feature = "rayon")]
use rayon::prelude::*;

/// Elements in a piece: long enough to be worth handing out.
pub(super) const PIECE: usize = 1 << 12;

/// Calls `work` for each piece of `0..count`; results in the order of the pieces.
pub(super) fn map<T: Send>(count: usize, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    each(count.div_ceil(PIECE), |k| work(k * PIECE..((k + 1) * PIECE).min(count)))
}

/// Calls `work` for each piece of a slice, with the index where it begins.
pub(super) fn fill<T: Send>(items: &mut [T], work: impl Fn(usize, &mut [T]) + Sync) {
    shared(items, PIECE, |k, piece| work(k * PIECE, piece));
}

/// Calls `work` for each run of `len` items, with the number of the run; results in their order.
pub(super) fn shared<T: Send, R: Send>(
    items: &mut [T],
    len: usize,
    work: impl Fn(usize, &mut [T]) -> R + Sync,
) -> Vec<R> {
    #[cfg(feature = "rayon")]
    if items.len() > len {
        return items.par_chunks_mut(len).enumerate().map(|(k, share)| work(k, share)).collect();
    }
    items.chunks_mut(len).enumerate().map(|(k, share)| work(k, share)).collect()
}

/// Calls `work` with each number below `count`; results in their order.
pub(crate) fn each<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    // One alone is not worth the way to another thread: tens of microseconds, where a small mesh takes hundreds.
    #[cfg(feature = "rayon")]
    if count > 1 {
        return (0..count).into_par_iter().map(&work).collect();
    }
    (0..count).map(work).collect()
}

/// How many threads share work on so many elements; no result depends on it.
pub(super) fn threads(count: usize) -> usize {
    #[cfg(feature = "rayon")]
    if count > PIECE {
        return rayon::current_num_threads();
    }
    let _ = count;
    1
}

/// Sorts by whatever tells all items apart.
pub(super) fn sort<T: Ord + Send>(items: &mut [T]) {
    #[cfg(feature = "rayon")]
    if items.len() > PIECE {
        return items.par_sort_unstable();
    }
    items.sort_unstable();
}

/// Both results, made side by side where there are threads and the work is on more than a piece.
pub(super) fn both<A: Send, B: Send>(
    count: usize,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    #[cfg(feature = "rayon")]
    if count > PIECE {
        return rayon::join(a, b);
    }
    let _ = count;
    (a(), b())
}
