//! The limit on the memory of the process: `--max-memory`, or a share of what the machine has.
//!
//! [`check`] refuses a step before it begins if its need, computed from counts, is above the limit. Counts cannot tell all, so
//! a thread compares the memory that the process really holds with the limit as well ([`watch`]).

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use anyhow::Context as _;
use lodsmith::core::memory::{self, in_words};
use lodsmith_io::{Limits, machine};

use crate::exit;

/// Share of what there is that the process takes: the rest is for the system, and for what counts do not tell.
const SHARE: f64 = 0.75;
/// Memory that a machine is assumed to have where the system does not say (anywhere but on Linux). (Guessed.)
const UNKNOWN: u64 = 16 << 30;
/// The least limit: the program with its threads takes up to half of that without any model.
pub(crate) const LEAST: u64 = 32 << 20;
/// Bytes of the program itself, without any model.
const PROGRAM: u64 = 8 << 20;

/// Bytes that the process may take.
static LIMIT: AtomicU64 = AtomicU64::new(u64::MAX);

/// Settles how much the process may take, and begins to watch that it does.
///
/// # Errors
/// When no thread can be started.
pub(crate) fn bound(typed: Option<u64>) -> anyhow::Result<()> {
    let limit = typed.unwrap_or_else(default_limit);
    LIMIT.store(limit, Ordering::Relaxed);
    #[cfg(target_os = "linux")]
    if machine::addresses().is_some() {
        with_one_arena();
    }
    exit::end_quietly_on_abort();
    if machine::taken().is_some() {
        std::thread::Builder::new().spawn(move || watch(limit)).context("cannot start a thread")?;
    }
    Ok(())
}

/// Starts the program anew with one heap for all threads. By default glibc sets 64 MiB of addresses aside for each thread,
/// which nobody notices unless addresses are what is limited (`ulimit -v`): then they are gone before the memory is.
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
    // It comes back only where it could not be done, and then all goes on as it is.
    let _ = command.args(words).env(ARENAS, "1").exec();
}

fn default_limit() -> u64 {
    let all = machine::memory().unwrap_or(UNKNOWN);
    ((all as f64 * SHARE) as u64).max(LEAST)
}

/// Ends the process once it holds more than the limit. Ten milliseconds are some ten megabytes of memory filled.
fn watch(limit: u64) {
    loop {
        if machine::taken().is_some_and(|taken| taken > limit) {
            exit::end_with(&format!(
                "this takes more memory than the limit of {} (--max-memory; several files at once need less with --threads 1)",
                in_words(limit)
            ));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The limits of readers, that on memory included.
pub(crate) fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.memory = limit();
    limits
}

fn limit() -> u64 {
    LIMIT.load(Ordering::Relaxed)
}

/// Refuses a step that would take more than the process may.
///
/// # Errors
/// One line that names the step, what it takes, the limit and the option.
pub(crate) fn check(step: &str, need: u64) -> anyhow::Result<()> {
    Ok(memory::check(step, need.saturating_add(PROGRAM), limit())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_word_it_is_a_share_of_what_there_is() {
        let limit = default_limit();
        assert!(limit >= LEAST);
        if let Some(all) = machine::memory() {
            assert!(limit <= all.max(LEAST), "{limit} of {all}");
        }
    }
}
