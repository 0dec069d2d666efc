//! Work in chunks of fixed size, joined in order: the same numbers at any number of threads. A module of WebAssembly has one
//! thread, and rayon would only make it larger.

use std::ops::Range;

/// Queries per chunk. Long enough to amortize the first query, which has no hint; short enough to balance the
/// load.
pub(crate) const CHUNK_LENGTH: usize = 2048;
/// Chunks for each thread between two questions whether to end. (Guessed: a chunk takes a few thousandths of a second,
/// and threads seldom wait for the last of so many.)
const CHUNKS_PER_QUESTION: usize = 8;

/// Calls `work` for each chunk of `0..count`; returns the results in the order of the chunks.
pub fn map<T: Send>(count: usize, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    map_by(CHUNK_LENGTH, count, work)
}

/// Calls `work` for each chunk of `size`, which is not 0.
pub(crate) fn map_by<T: Send>(size: usize, count: usize, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    let piece = |k: usize| work(k * size..((k + 1) * size).min(count));
    let pieces = 0..count.div_ceil(size);
    #[cfg(all(feature = "rayon", not(target_family = "wasm")))]
    {
        use rayon::prelude::*;
        pieces.into_par_iter().map(piece).collect()
    }
    #[cfg(not(all(feature = "rayon", not(target_family = "wasm"))))]
    pieces.map(piece).collect()
}

/// Calls `work` like [`map_by`], and before every few chunks asks on this thread whether to end: `None` once `is_over` has
/// returned true.
pub(crate) fn map_until<T: Send>(
    size: usize,
    count: usize,
    is_over: &mut dyn FnMut() -> bool,
    work: impl Fn(Range<usize>) -> T + Sync,
) -> Option<Vec<T>> {
    #[cfg(all(feature = "rayon", not(target_family = "wasm")))]
    let threads = rayon::current_num_threads();
    #[cfg(not(all(feature = "rayon", not(target_family = "wasm"))))]
    let threads = 1;
    let step = size * CHUNKS_PER_QUESTION * threads;
    let mut all = Vec::new();
    for first in (0..count).step_by(step) {
        if is_over() {
            return None;
        }
        let length = step.min(count - first);
        all.append(&mut map_by(size, length, |range| work(first + range.start..first + range.end)));
    }
    Some(all)
}

/// Returns the mean of numbers; 0 if there are none. Summed by chunks, so that millions of small terms keep
/// their digits.
pub(crate) fn mean(numbers: &[f64]) -> f64 {
    let sum: f64 = numbers.chunks(CHUNK_LENGTH).map(|part| part.iter().sum::<f64>()).sum();
    if numbers.is_empty() { 0.0 } else { sum / numbers.len() as f64 }
}
