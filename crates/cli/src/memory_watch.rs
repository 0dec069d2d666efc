//! Enforcement of the memory limit: counts do not cover everything, so a thread compares the memory that the
//! process really holds with the limit.

use std::time::Duration;

use anyhow::Context as _;
use lodsmith::core::memory::format_bytes;
use lodsmith_io::machine;

use crate::exit;

/// Starts to monitor the memory of the process.
///
/// # Errors
/// If no thread can be started.
pub(crate) fn start(limit: u64) -> anyhow::Result<()> {
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
