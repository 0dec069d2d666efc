//! Enforcement of the memory limit: estimates from counts do not cover everything, so a thread compares the
//! memory that the process actually uses with the limit.

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

/// Restarts the program with one heap arena for all threads. By default, glibc reserves 64 MiB of address space
/// for each thread; with a limit on the address space (`ulimit -v`), it runs out before the memory does.
#[cfg(target_os = "linux")]
fn with_one_arena() {
    use std::os::unix::process::CommandExt as _;
    const ARENAS: &str = "MALLOC_ARENA_MAX";
    if std::env::var_os(ARENAS).is_some() {
        return;
    }
    let Ok(program) = std::env::current_exe() else { return };
    let mut arguments = std::env::args_os();
    let mut command = std::process::Command::new(program);
    if let Some(name) = arguments.next() {
        command.arg0(name);
    }
    // `exec` returns only if it failed; then the program continues as it is.
    let _ = command.args(arguments).env(ARENAS, "1").exec();
}

/// Ends the process when it uses more than the limit. In the ten milliseconds between two checks, about ten
/// megabytes of memory can be filled.
fn watch(limit: u64) {
    loop {
        if machine::resident_bytes().is_some_and(|used| used > limit) {
            exit::end_with(&format!(
                "more memory is needed than the limit of {} (--max-memory; with several files, --threads 1 needs less)",
                format_bytes(limit)
            ));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}
