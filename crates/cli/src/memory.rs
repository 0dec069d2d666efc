//! Memory limit of the process: `--max-memory`, or a fraction of the machine's memory.
//!
//! [`check`] refuses a step before it begins if its need, computed from counts, exceeds the limit. Counts do
//! not cover everything, so a thread also compares the memory that the process really holds with the limit
//! ([`watch`]).

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use anyhow::Context as _;
use lodsmith::core::memory::{self, format_bytes};
use lodsmith_io::{Limits, machine};

use crate::exit;

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

/// Sets the memory limit of the process and starts to monitor it.
///
/// # Errors
/// If no thread can be started.
pub(crate) fn set_limit(typed: Option<u64>) -> anyhow::Result<()> {
    let limit = typed.unwrap_or_else(default_limit);
    LIMIT.store(limit, Ordering::Relaxed);
    #[cfg(target_os = "linux")]
    if machine::address_space_limit().is_some() {
        with_one_arena();
    }
    exit::end_quietly_on_abort();
    if machine::resident_bytes().is_some() {
        std::thread::Builder::new().spawn(move || watch(limit)).context("cannot start a thread")?;
    }
    Ok(())
}

/// Restarts the program with one heap arena for all threads. By default glibc reserves 64 MiB of addresses
/// for each thread; with a limit on addresses (`ulimit -v`) these run out before the memory does.
#[cfg(target_os = "linux")]
fn with_one_arena() {
    use std::os::unix::process::CommandExt as _;
    const ARENAS: &str = "MALLOC_ARENA_MAX";
    if std::env::var_os(ARENAS).is_some() {
        return;
    }
    let Ok(program) = std::env::current_exe() else { return };
    let mut words = std::env::args_os();
    let mut command = std::process::Command::new(program);
    if let Some(name) = words.next() {
        command.arg0(name);
    }
    // `exec` returns only if it failed; then the program continues as it is.
    let _ = command.args(words).env(ARENAS, "1").exec();
}

fn default_limit() -> u64 {
    let all = machine::memory_limit().unwrap_or(ASSUMED_MEMORY);
    ((all as f64 * DEFAULT_MEMORY_SHARE) as u64).max(MIN_LIMIT)
}

/// Ends the process when it holds more than the limit. In ten milliseconds some ten megabytes of memory can
/// be filled.
fn watch(limit: u64) {
    loop {
        if machine::resident_bytes().is_some_and(|taken| taken > limit) {
            exit::end_with(&format!(
                "this takes more memory than the limit of {} (--max-memory; several files at once need less with --threads 1)",
                format_bytes(limit)
            ));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Returns the limits of readers, including that on memory.
pub(crate) fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.memory = limit();
    limits
}

fn limit() -> u64 {
    LIMIT.load(Ordering::Relaxed)
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
