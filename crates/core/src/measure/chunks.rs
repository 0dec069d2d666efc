//! Work in chunks of fixed size, joined in order: the same numbers at any number of threads.

use std::ops::Range;

/// Queries per chunk. Long enough to amortize the first query, which has no hint; short enough to balance the
/// load.
const CHUNK_LENGTH: usize = 2048;

/// Calls `work` for each chunk of `0..count`; returns the results in the order of the chunks.
pub fn map<T: Send>(count: usize, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    map_by(CHUNK_LENGTH, count, work)
}

/// Calls `work` for each chunk of `size`, which is not 0.
pub(crate) fn map_by<T: Send>(size: usize, count: usize, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    let piece = |k: usize| work(k * size..((k + 1) * size).min(count));
    let pieces = 0..count.div_ceil(size);
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        pieces.into_par_iter().map(piece).collect()
    }
    #[cfg(not(feature = "rayon"))]
    pieces.map(piece).collect()
}

/// Returns the mean of numbers; 0 if there are none. Summed by chunks, so that millions of small terms keep
/// their digits.
pub(crate) fn mean(numbers: &[f64]) -> f64 {
    let sum: f64 = numbers.chunks(CHUNK_LENGTH).map(|part| part.iter().sum::<f64>()).sum();
    if numbers.is_empty() { 0.0 } else { sum / numbers.len() as f64 }
}
