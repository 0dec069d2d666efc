//! Memory limit of the process: `--max-memory`, or a fraction of the machine's memory.
//!
//! [`check`] refuses a step before it begins if its need, computed from counts, exceeds the limit.

use std::sync::atomic::{AtomicU64, Ordering};

use lodsmith_asset::Job;
use lodsmith_io::Limits;

/// Limit of the process, in bytes.
static LIMIT: AtomicU64 = AtomicU64::new(u64::MAX);

/// Sets the memory limit of the process, and returns it.
pub(crate) fn set_limit(typed: Option<u64>) -> u64 {
    let limit = typed.unwrap_or_else(Job::default_memory);
    LIMIT.store(limit, Ordering::Relaxed);
    limit
}

/// Returns the limits of readers, including that on memory.
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
/// One line that names the step, its need, the limit and the option.
pub(crate) fn check(step: &str, need: u64) -> anyhow::Result<()> {
    Ok(lodsmith_asset::check_memory(step, need, limit())?)
}
