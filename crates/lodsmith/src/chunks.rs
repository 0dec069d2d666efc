//! Parallel work in chunks whose results are joined in order: the same bytes with any number of threads. (A module of
//! WebAssembly has one thread: rayon would only make it larger.)

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

#[cfg(all(feature = "rayon", not(target_family = "wasm")))]
use rayon::prelude::*;

/// False in a build that has one thread only, so that code for several is left out.
pub(crate) const HAS_THREADS: bool = cfg!(all(feature = "rayon", not(target_family = "wasm")));
/// Minimum number of elements per chunk: scheduling one takes as long as some thousand elements. Chunk
/// lengths are multiples of it, so that a chunk starts at a full word of a bit set.
const MIN_CHUNK_LEN: usize = 1 << 11;
/// Maximum number of elements per chunk: its results are still in the cache when they are read again.
const MAX_CHUNK_LEN: usize = 1 << 14;
/// Chunks per thread, so that late threads still find work.
const CHUNKS_PER_THREAD: usize = 4;
/// Up to this number of elements one thread is as fast. (Guessed, between `cow` with 5,804 faces, which two
/// threads slow down, and `bunny` with 69,451, which they do not: a step of a small mesh takes less time than
/// waking a thread.)
const MAX_SEQUENTIAL_LEN: usize = 1 << 13;

/// Returns the number of threads for `count` elements; no result depends on it.
pub(crate) fn threads(count: usize) -> usize {
    #[cfg(all(feature = "rayon", not(target_family = "wasm")))]
    let all = rayon::current_num_threads();
    #[cfg(not(all(feature = "rayon", not(target_family = "wasm"))))]
    let all = 1;
    if count > MAX_SEQUENTIAL_LEN { all } else { 1 }
}

/// Returns the chunk length for `count` elements; no result depends on it.
pub(crate) fn len(count: usize) -> usize {
    match threads(count) {
        1 => MAX_CHUNK_LEN,
        threads => {
            count.div_ceil(CHUNKS_PER_THREAD * threads).next_multiple_of(MIN_CHUNK_LEN).min(MAX_CHUNK_LEN)
        }
    }
}

/// Calls `work` for each chunk of `0..count`; results in the order of the chunks.
pub(crate) fn map<T: Send>(count: usize, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    let len = len(count);
    each(count.div_ceil(len), |k| work(k * len..((k + 1) * len).min(count)))
}

/// Collects `make(i)` for each number below `count`; written in place, since zeroed memory would be written
/// twice.
pub(crate) fn list<T: Send>(count: usize, make: impl Fn(usize) -> T + Sync) -> Vec<T> {
    #[cfg(all(feature = "rayon", not(target_family = "wasm")))]
    if threads(count) > 1 {
        return (0..count).into_par_iter().with_min_len(MIN_CHUNK_LEN).map(&make).collect();
    }
    (0..count).map(make).collect()
}

/// Calls `work` for each chunk of a slice, with the index of its first item.
pub(crate) fn fill<T: Send>(items: &mut [T], work: impl Fn(usize, &mut [T]) + Sync) {
    let len = len(items.len());
    shared(items, len, |k, piece| work(k * len, piece));
}

/// Calls `work` for each run of `len` items, with the index of the run; results in their order.
pub(crate) fn shared<T: Send, R: Send>(
    items: &mut [T],
    len: usize,
    work: impl Fn(usize, &mut [T]) -> R + Sync,
) -> Vec<R> {
    over(items.chunks_mut(len).collect(), work)
}

/// Calls `work` with each item and its index; results in their order.
pub(crate) fn over<T: Send, R: Send>(items: Vec<T>, work: impl Fn(usize, T) -> R + Sync) -> Vec<R> {
    if !HAS_THREADS {
        return items.into_iter().enumerate().map(|(k, item)| work(k, item)).collect();
    }
    let items: Vec<Mutex<Option<T>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    each(items.len(), |k| work(k, take(&items[k])))
}

/// Calls `work` with each number below `count`; results in their order.
pub(crate) fn each<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    if !HAS_THREADS {
        return (0..count).map(work).collect();
    }
    let done: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    hand_out(count, &|k| {
        let result = work(k);
        *done[k].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
    });
    done.iter().map(take).collect()
}

/// Takes an item out; each is put in once and taken once, by one thread each.
fn take<T>(of: &Mutex<Option<T>>) -> T {
    of.lock().unwrap_or_else(PoisonError::into_inner).take().expect("put in, and not taken yet")
}

/// Calls `work` with each number below `count`, on all threads. (Not generic, so it is compiled only once:
/// docs/decisions/0019.)
fn hand_out(count: usize, work: &(dyn Fn(usize) + Sync)) {
    // Scheduling a single chunk on another thread costs tens of microseconds; a small mesh takes hundreds in
    // total.
    #[cfg(all(feature = "rayon", not(target_family = "wasm")))]
    if count > 1 && rayon::current_num_threads() > 1 {
        return (0..count).into_par_iter().for_each(work);
    }
    (0..count).for_each(work);
}

/// Splits a slice into parts of the given lengths.
pub(crate) fn cut<T>(mut items: &mut [T], lengths: impl Iterator<Item = usize>) -> Vec<&mut [T]> {
    lengths.map(|n| items.split_off_mut(..n).expect("as long as its parts")).collect()
}

/// Sorts items whose order is total: equal items are identical.
pub(crate) fn sort<T: Ord + Send>(items: &mut [T]) {
    #[cfg(all(feature = "rayon", not(target_family = "wasm")))]
    if threads(items.len()) > 1 {
        return items.par_sort_unstable();
    }
    items.sort_unstable();
}

/// Returns both results, computed in parallel if there are threads and `count` is large enough.
pub(crate) fn both<A: Send, B: Send>(
    count: usize,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    #[cfg(all(feature = "rayon", not(target_family = "wasm")))]
    if threads(count) > 1 {
        return rayon::join(a, b);
    }
    let _ = count;
    (a(), b())
}
