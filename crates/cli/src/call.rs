//! A call of the command from another program, in its process: warnings and errors are collected, nothing is printed, and
//! nothing ends or changes the process.
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
    memory_limit: AtomicU64,
    /// Warnings and errors, without their leading word, each with whether it is an error.
    messages: Mutex<Vec<(bool, String)>>,
}

impl CallState {
    pub(crate) fn new() -> Self {
        Self {
            is_cancelled: AtomicBool::new(false),
            memory_limit: AtomicU64::new(u64::MAX),
            messages: Mutex::default(),
        }
    }
    pub(crate) fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }
    pub(crate) fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
    pub(crate) fn set_memory_limit(&self, bytes: u64) {
        self.memory_limit.store(bytes, Ordering::Relaxed);
    }
    pub(crate) fn memory_limit(&self) -> u64 {
        self.memory_limit.load(Ordering::Relaxed)
    }
    pub(crate) fn message(&self, is_error: bool, text: String) {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner).push((is_error, text));
    }
    pub(crate) fn take_messages(&self) -> Vec<(bool, String)> {
        std::mem::take(&mut *self.messages.lock().unwrap_or_else(PoisonError::into_inner))
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
        pool.broadcast(|_| current().expect("a call").cancel());
        assert!(current().is_none());
        assert!(call.is_cancelled());
    }
}
