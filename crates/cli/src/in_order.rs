//! Several files at once, answers in the order of the files.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use anyhow::Context as _;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// All threads that the machine has for us.
pub(crate) fn available_threads() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// A pool of so many threads.
pub(crate) fn pool(threads: usize) -> anyhow::Result<ThreadPool> {
    ThreadPoolBuilder::new().num_threads(threads).build().context("cannot start threads")
}

/// Does some work on each item and hands the answers over in the order of the items, each as soon as it can be.
///
/// At most `threads` items are in work at once, which bounds memory. Each worker has a pool of its own with its share of
/// the threads: in a common pool, one item would wait within the other, and no time would be its own.
///
/// # Errors
/// When threads cannot be started.
pub(crate) fn each<T: Sync, R: Send>(
    items: &[T],
    threads: usize,
    work: impl Fn(&T) -> R + Sync,
    mut answer: impl FnMut(usize, R),
) -> anyhow::Result<()> {
    let workers = items.len().min(threads).max(1);
    let pools: Vec<ThreadPool> =
        (0..workers).map(|w| pool(share(threads, workers, w))).collect::<Result<_, _>>()?;
    let next = AtomicUsize::new(0);
    let (send, receive) = mpsc::channel();
    std::thread::scope(|scope| {
        for pool in &pools {
            let (send, next, work) = (send.clone(), &next, &work);
            scope.spawn(move || {
                while let Some((i, item)) = take(items, next) {
                    // The receiver lives until every worker has ended.
                    let _ = send.send((i, pool.install(|| work(item))));
                }
            });
        }
        drop(send);
        let mut waiting: Vec<Option<R>> = items.iter().map(|_| None).collect();
        let mut due = 0;
        for (i, result) in receive {
            waiting[i] = Some(result);
            while let Some(result) = waiting.get_mut(due).and_then(Option::take) {
                answer(due, result);
                due += 1;
            }
        }
    });
    Ok(())
}

fn take<'a, T>(items: &'a [T], next: &AtomicUsize) -> Option<(usize, &'a T)> {
    let i = next.fetch_add(1, Ordering::Relaxed);
    items.get(i).map(|item| (i, item))
}

/// Threads of worker `w`: the rest of the division goes to the first ones.
fn share(threads: usize, workers: usize, w: usize) -> usize {
    (threads / workers + usize::from(w < threads % workers)).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_come_in_the_order_of_the_items() {
        let items: Vec<u64> = (0..20).rev().collect();
        let mut got = Vec::new();
        let work = |x: &u64| {
            std::thread::sleep(std::time::Duration::from_micros(100 * x));
            *x
        };
        each(&items, 4, work, |i, x| got.push((i, x))).unwrap();
        assert_eq!(got, items.iter().copied().enumerate().collect::<Vec<_>>());
    }

    #[test]
    fn threads_are_shared_out_without_rest() {
        assert_eq!((0..3).map(|w| share(8, 3, w)).collect::<Vec<_>>(), [3, 3, 2]);
        let mut seen = 0;
        each(&[()], 3, |()| rayon::current_num_threads(), |_, n| seen = n).unwrap();
        assert_eq!(seen, 3);
    }
}
