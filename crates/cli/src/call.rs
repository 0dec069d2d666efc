//! A call of the command from another program, in its process: printing is collected, and nothing ends or changes the
//! process.
//!
//! The state of a call belongs to its threads: the one that makes the call, and those of its pools.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

thread_local! {
    static CURRENT: RefCell<Option<Arc<CallState>>> = const { RefCell::new(None) };
}

/// State that a call shares with its caller.
#[derive(Debug)]
pub(crate) struct CallState {
    is_cancelled: AtomicBool,
    /// Bits of the fraction done; for numbers from 0 up their order is that of the numbers.
    done: AtomicU64,
    memory_limit: AtomicU64,
    printed: Mutex<Printed>,
}

/// Text that a call printed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Printed {
    pub(crate) results: String,
    /// Warnings and errors, without their leading word, each with whether it is an error.
    pub(crate) messages: Vec<(bool, String)>,
}

impl CallState {
    pub(crate) fn new() -> Self {
        Self {
            is_cancelled: AtomicBool::new(false),
            done: AtomicU64::new(0),
            memory_limit: AtomicU64::new(u64::MAX),
            printed: Mutex::default(),
        }
    }
    pub(crate) fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }
    pub(crate) fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
    /// Reports the fraction done; it never goes back.
    pub(crate) fn report(&self, done: f64) {
        self.done.fetch_max(done.clamp(0.0, 1.0).to_bits(), Ordering::Relaxed);
    }
    pub(crate) fn done(&self) -> f64 {
        f64::from_bits(self.done.load(Ordering::Relaxed))
    }
    pub(crate) fn set_memory_limit(&self, bytes: u64) {
        self.memory_limit.store(bytes, Ordering::Relaxed);
    }
    pub(crate) fn memory_limit(&self) -> u64 {
        self.memory_limit.load(Ordering::Relaxed)
    }
    pub(crate) fn print(&self, edit: impl FnOnce(&mut Printed)) {
        edit(&mut self.printed.lock().unwrap_or_else(PoisonError::into_inner));
    }
    pub(crate) fn take_printed(&self) -> Printed {
        std::mem::take(&mut *self.printed.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Returns the call that this thread works for; `None` in the command itself.
pub(crate) fn current() -> Option<Arc<CallState>> {
    CURRENT.with_borrow(Clone::clone)
}

/// Makes this thread work for a call.
pub(crate) fn enter(call: Option<Arc<CallState>>) {
    CURRENT.set(call);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_of_a_pool_work_for_the_call_that_made_it() {
        let call = Arc::new(CallState::new());
        enter(Some(call.clone()));
        let pool = crate::in_order::pool(2).expect("two threads");
        enter(None);
        pool.broadcast(|_| current().expect("a call").report(0.5));
        assert!(current().is_none());
        call.report(0.25);
        assert_eq!(call.done(), 0.5);
    }
}
