//! Memory limit of the process: `--max-memory`, or a fraction of the machine's memory.
//!
//! [`check`] refuses a step before it begins if its need, computed from counts, exceeds the limit.

use std::sync::atomic::{AtomicU64, Ordering};

use lodsmith::core::memory;
use lodsmith_io::{Limits, machine};

use crate::call;

/// Default fraction of the available memory: the rest is for the system, and for needs that counts do not
/// cover.
const DEFAULT_MEMORY_SHARE: f64 = 0.75;
/// Assumed memory of a machine if the system does not report it (anywhere but on Linux). (Guessed.)
const ASSUMED_MEMORY: u64 = 16 << 30;
/// Lowest limit: without any model the program and its threads take up to half of it.
pub(crate) const MIN_LIMIT: u64 = 32 << 20;
/// Bytes of the program itself, without any model.
const PROGRAM_BYTES: u64 = 8 << 20;

/// Limit of the process, in bytes.
static LIMIT: AtomicU64 = AtomicU64::new(u64::MAX);

/// Sets the memory limit of the process, or of the call, and returns it.
pub(crate) fn set_limit(typed: Option<u64>) -> u64 {
    let limit = typed.unwrap_or_else(default_limit);
    match call::current() {
        Some(call) => call.set_memory_limit(limit),
        None => LIMIT.store(limit, Ordering::Relaxed),
    }
    limit
}

fn default_limit() -> u64 {
    let all = machine::memory_limit().unwrap_or(ASSUMED_MEMORY);
    ((all as f64 * DEFAULT_MEMORY_SHARE) as u64).max(MIN_LIMIT)
}

/// Returns the limits of readers, including that on memory.
pub(crate) fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.memory = limit();
    limits
}

fn limit() -> u64 {
    call::current().map_or_else(|| LIMIT.load(Ordering::Relaxed), |call| call.memory_limit())
}

/// Refuses a step that would exceed the memory limit.
///
/// # Errors
/// One line that names the step, its need, the limit and the option.
pub(crate) fn check(step: &str, need: u64) -> anyhow::Result<()> {
    Ok(memory::check(step, need.saturating_add(PROGRAM_BYTES), limit())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_word_it_is_a_share_of_what_there_is() {
        let limit = default_limit();
        assert!(limit >= MIN_LIMIT);
        if let Some(all) = machine::memory_limit() {
            assert!(limit <= all.max(MIN_LIMIT), "{limit} of {all}");
        }
    }
}
