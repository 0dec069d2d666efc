//! Work in pieces, joined in their order: the same bytes on any number of threads.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

#[cfg(feature = "rayon")]
use rayon::prelude::*;

/// Elements in a piece at least: handing one out takes as long as some thousand elements. Multiples of it, so that a piece
/// begins at a full word of bits.
const LEAST: usize = 1 << 11;
/// Elements in a piece at most: what is made of one is still in the cache when it is read again.
const MOST: usize = 1 << 14;
/// Pieces for each thread, so that one who comes late finds work left.
const EACH: usize = 4;
/// With fewer elements than these one thread is as fast. (Guessed, between `cow` with 5,804 faces, which two threads made
/// slower, and `bunny` with 69,451, which they do not: a step of a small mesh takes less than it takes to wake a thread.)
const ALONE: usize = 1 << 13;

/// How many threads share work on so many elements; no result depends on it.
pub(super) fn threads(count: usize) -> usize {
    #[cfg(feature = "rayon")]
    let all = rayon::current_num_threads();
    #[cfg(not(feature = "rayon"))]
    let all = 1;
    if count > ALONE { all } else { 1 }
}

/// How long pieces of so many elements are; no result depends on it.
pub(super) fn len(count: usize) -> usize {
    match threads(count) {
        1 => MOST,
        threads => count.div_ceil(EACH * threads).next_multiple_of(LEAST).min(MOST),
    }
}

/// Calls `work` for each piece of `0..count`; results in the order of the pieces.
pub(super) fn map<T: Send>(count: usize, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    let len = len(count);
    each(count.div_ceil(len), |k| work(k * len..((k + 1) * len).min(count)))
}

/// What `make` makes of each number below `count`: written where it stays, for memory that is cleared first is written twice.
pub(super) fn list<T: Send>(count: usize, make: impl Fn(usize) -> T + Sync) -> Vec<T> {
    #[cfg(feature = "rayon")]
    if threads(count) > 1 {
        return (0..count).into_par_iter().with_min_len(LEAST).map(&make).collect();
    }
    (0..count).map(make).collect()
}

/// Calls `work` for each piece of a slice, with the index where it begins.
pub(super) fn fill<T: Send>(items: &mut [T], work: impl Fn(usize, &mut [T]) + Sync) {
    let len = len(items.len());
    shared(items, len, |k, piece| work(k * len, piece));
}

/// Calls `work` for each run of `len` items, with the number of the run; results in their order.
pub(super) fn shared<T: Send, R: Send>(
    items: &mut [T],
    len: usize,
    work: impl Fn(usize, &mut [T]) -> R + Sync,
) -> Vec<R> {
    over(items.chunks_mut(len).collect(), work)
}

/// Calls `work` with each item and its number; results in their order.
pub(super) fn over<T: Send, R: Send>(items: Vec<T>, work: impl Fn(usize, T) -> R + Sync) -> Vec<R> {
    let items: Vec<Mutex<Option<T>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    each(items.len(), |k| work(k, take(&items[k])))
}

/// Calls `work` with each number below `count`; results in their order.
pub(crate) fn each<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let done: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    hand_out(count, &|k| {
        let result = work(k);
        *done[k].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
    });
    done.iter().map(take).collect()
}

/// Each is put in once and taken once, by one thread each.
fn take<T>(of: &Mutex<Option<T>>) -> T {
    of.lock().unwrap_or_else(PoisonError::into_inner).take().expect("put in, and not taken yet")
}

/// Calls `work` with each number below `count`, on all threads. (Not built for each kind of work: docs/decisions/0019.)
fn hand_out(count: usize, work: &(dyn Fn(usize) + Sync)) {
    // One alone is not worth the way to another thread: tens of microseconds, where a small mesh takes hundreds.
    #[cfg(feature = "rayon")]
    if count > 1 && rayon::current_num_threads() > 1 {
        return (0..count).into_par_iter().for_each(work);
    }
    (0..count).for_each(work);
}

/// Parts of a slice, each so long.
pub(super) fn cut<T>(mut items: &mut [T], lengths: impl Iterator<Item = usize>) -> Vec<&mut [T]> {
    lengths.map(|n| items.split_off_mut(..n).expect("as long as its parts")).collect()
}

/// Sorts by whatever tells all items apart.
pub(super) fn sort<T: Ord + Send>(items: &mut [T]) {
    #[cfg(feature = "rayon")]
    if threads(items.len()) > 1 {
        return items.par_sort_unstable();
    }
    items.sort_unstable();
}

/// Both results, made side by side where there are threads and the work is on so many elements.
pub(super) fn both<A: Send, B: Send>(
    count: usize,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    #[cfg(feature = "rayon")]
    if threads(count) > 1 {
        return rayon::join(a, b);
    }
    let _ = count;
    (a(), b())
}
