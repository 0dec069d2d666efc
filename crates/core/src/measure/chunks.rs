//! Work in pieces of fixed size, joined in their order: the same numbers at any number of threads.

use std::ops::Range;

/// Queries in a piece. Long enough that the first, which has no hint, does not count; short enough to share out.
const CHUNK: usize = 2048;

/// Calls `work` for each piece of `0..count`; results in the order of the pieces.
pub fn map<T: Send>(count: usize, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    map_by(CHUNK, count, work)
}

/// The same in pieces of another size, which is not 0.
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

/// The mean of numbers; 0 of none. Summed by pieces, so that millions of small terms keep their digits.
pub(crate) fn mean(numbers: &[f64]) -> f64 {
    let sum: f64 = numbers.chunks(CHUNK).map(|part| part.iter().sum::<f64>()).sum();
    if numbers.is_empty() { 0.0 } else { sum / numbers.len() as f64 }
}
