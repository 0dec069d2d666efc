//! Parallel processing of several files, with results in the order of the files.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use anyhow::Context as _;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Returns the number of threads available.
pub(crate) fn available_threads() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// Creates a pool of this many threads.
pub(crate) fn pool(threads: usize) -> anyhow::Result<ThreadPool> {
    ThreadPoolBuilder::new().num_threads(threads).build().context("cannot start threads")
}

/// Processes each item and passes on the results in the order of the items, each as soon as possible.
///
/// At most `threads` items are processed at once, which bounds memory. Each worker has its own pool with its
/// share of the threads: in a common pool, the work of one item could run inside a wait of another, and times
/// could not be attributed to items. Work that must not depend on which item is faster waits for its [`Turn`].
///
/// # Errors
/// If threads cannot be started.
pub(crate) fn process_in_order<T: Sync, R: Send>(
    items: &[T],
    threads: usize,
    work: impl Fn(&T, &Turn<'_>) -> R + Sync,
    mut on_result: impl FnMut(usize, R),
) -> anyhow::Result<()> {
    let workers = items.len().min(threads).max(1);
    let pools: Vec<ThreadPool> =
        (0..workers).map(|w| pool(share(threads, workers, w))).collect::<Result<_, _>>()?;
    let next = AtomicUsize::new(0);
    let ended = FinishedItems::default();
    let (send, receive) = mpsc::channel();
    std::thread::scope(|scope| {
        for pool in &pools {
            let (send, next, ended, work) = (send.clone(), &next, &ended, &work);
            scope.spawn(move || {
                while let Some((i, item)) = take(items, next) {
                    let turn = Turn { index: i, ended };
                    let result = pool.install(|| work(item, &turn));
                    drop(turn);
                    // The receiver lives until all workers have ended.
                    let _ = send.send((i, result));
                }
            });
        }
        drop(send);
        let mut waiting: Vec<Option<R>> = items.iter().map(|_| None).collect();
        let mut next_index = 0;
        for (i, result) in receive {
            waiting[i] = Some(result);
            while let Some(result) = waiting.get_mut(next_index).and_then(Option::take) {
                on_result(next_index, result);
                next_index += 1;
            }
        }
    });
    Ok(())
}

/// Position of an item in the order, until its processing has ended.
pub(crate) struct Turn<'e> {
    index: usize,
    ended: &'e FinishedItems,
}

impl Turn<'_> {
    /// Waits until all items before this one have been processed. They have started, since items are taken in
    /// order.
    pub(crate) fn wait(&self) {
        let guard = self.ended.lock();
        let has_unfinished = |state: &mut State| state.all_before < self.index;
        drop(self.ended.changed.wait_while(guard, has_unfinished).unwrap_or_else(PoisonError::into_inner));
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.ended.lock().end(self.index);
        self.ended.changed.notify_all();
    }
}

/// The finished items, shared by the workers.
#[derive(Default)]
struct FinishedItems {
    state: Mutex<State>,
    changed: Condvar,
}

impl FinishedItems {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[derive(Default)]
struct State {
    /// Number of leading items that are all finished.
    all_before: usize,
    /// Finished items after the leading ones.
    others: BTreeSet<usize>,
}

impl State {
    fn end(&mut self, index: usize) {
        self.others.insert(index);
        while self.others.remove(&self.all_before) {
            self.all_before += 1;
        }
    }
}

fn take<'a, T>(items: &'a [T], next: &AtomicUsize) -> Option<(usize, &'a T)> {
    let i = next.fetch_add(1, Ordering::Relaxed);
    items.get(i).map(|item| (i, item))
}

/// Returns the number of threads of worker `w`; the first workers get one more if the division has a remainder.
fn share(threads: usize, workers: usize, w: usize) -> usize {
    (threads / workers + usize::from(w < threads % workers)).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_the_order_of_the_items() {
        let items: Vec<u64> = (0..20).rev().collect();
        let mut got = Vec::new();
        let work = |x: &u64, _: &Turn<'_>| {
            std::thread::sleep(std::time::Duration::from_micros(100 * x));
            *x
        };
        process_in_order(&items, 4, work, |i, x| got.push((i, x))).unwrap();
        assert_eq!(got, items.iter().copied().enumerate().collect::<Vec<_>>());
    }

    #[test]
    fn turns_come_in_the_order_of_the_items() {
        let items: Vec<u64> = (0..12).rev().collect();
        let order = Mutex::new(Vec::new());
        let work = |x: &u64, turn: &Turn<'_>| {
            std::thread::sleep(std::time::Duration::from_micros(100 * x));
            // Items that do not wait must not delay others.
            if !x.is_multiple_of(3) {
                turn.wait();
                order.lock().unwrap().push(*x);
            }
        };
        process_in_order(&items, 4, work, |_, ()| {}).unwrap();
        assert_eq!(order.into_inner().unwrap(), [11, 10, 8, 7, 5, 4, 2, 1]);
    }

    #[test]
    fn all_threads_are_distributed() {
        assert_eq!((0..3).map(|w| share(8, 3, w)).collect::<Vec<_>>(), [3, 3, 2]);
        let mut seen = 0;
        process_in_order(&[()], 3, |(), _| rayon::current_num_threads(), |_, n| seen = n).unwrap();
        assert_eq!(seen, 3);
    }
}
