//! Memory limit of the process: `--max-memory`, or a fraction of the memory of the machine.
//!
//! [`check`] refuses a step before it starts if the memory that it needs, computed from counts, exceeds the limit.

use std::sync::atomic::{AtomicU64, Ordering};

use lodsmith_asset::Job;
use lodsmith_io::Limits;

/// Limit of the process, in bytes.
static LIMIT: AtomicU64 = AtomicU64::new(u64::MAX);

/// Sets the memory limit of the process, and returns it.
pub(crate) fn set_limit(given: Option<u64>) -> u64 {
    let limit = given.unwrap_or_else(Job::default_memory);
    LIMIT.store(limit, Ordering::Relaxed);
    limit
}

/// Returns the limits of readers, including the memory limit.
pub(crate) fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.memory = limit();
    limits
}

/// Returns the limit in bytes.
pub(crate) fn limit() -> u64 {
    LIMIT.load(Ordering::Relaxed)
}

/// Refuses a step that would exceed the memory limit.
///
/// # Errors
/// One line with the step, the memory that it needs, the limit and the option.
pub(crate) fn check(step: &str, need: u64) -> anyhow::Result<()> {
    Ok(lodsmith_asset::check_memory(step, need, limit())?)
}
