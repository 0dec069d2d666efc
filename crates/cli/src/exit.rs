//! How a run ends: statuses, interrupts, and what a panic of ours becomes.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Mutex, PoisonError, RwLock, RwLockReadGuard};
use std::time::Duration;

use anyhow::{Context as _, anyhow};
use lodsmith::SimplifyError;

use crate::output;

/// What the caller's shell sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Status {
    /// All done.
    Done = 0,
    /// The file, the mesh or the system is at fault.
    Failed = 1,
    /// The command line is at fault.
    Usage = 2,
    /// With `--strict`: target not reached or data dropped.
    Strict = 3,
    /// Ended from outside.
    Interrupted = 130,
}

/// The command line is at fault, beyond what its grammar can tell.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct UsageError(pub(crate) String);

/// The run was ended from outside.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(crate) struct Interrupted;

/// A fault of the command line as an error.
pub(crate) fn usage(text: impl Into<String>) -> anyhow::Error {
    UsageError(text.into()).into()
}

/// The status that an error ends with.
pub(crate) fn status_of(error: &anyhow::Error) -> Status {
    let is_unlike = matches!(
        error.downcast_ref(),
        Some(SimplifyError::NotOfMethod { .. } | SimplifyError::NotTogether { .. })
    );
    if is_unlike || error.is::<UsageError>() {
        Status::Usage
    } else if error.is::<Interrupted>() {
        Status::Interrupted
    } else {
        Status::Failed
    }
}

/// Exit code that names the signal which asked the process to end; 0 before any has.
static ENDED_WITH: AtomicU8 = AtomicU8::new(0);
/// Held shared by whoever writes a file, alone by whoever ends the process: no half file stays behind.
static WRITING: RwLock<()> = RwLock::new(());

/// True once a signal has asked the process to end.
pub(crate) fn interrupted() -> bool {
    ENDED_WITH.load(Ordering::Relaxed) != 0
}

/// Ends the process when it is told to (by Ctrl-C, SIGTERM or a terminal that closes), after the file that is being
/// written is complete or gone.
///
/// Runs that ask [`interrupted`] may end sooner by themselves, with the same status.
pub(crate) fn catch_interrupts() {
    // Where no handler can be set, the system does what it does.
    #[cfg(unix)]
    if let Ok(mut signals) = signal_hook::iterator::Signals::new(ending_signals(is_hangup_ignored())) {
        // By convention, the number of the signal is in the status.
        let wait =
            move || signals.forever().for_each(|signal| end(u8::try_from(128 + signal).unwrap_or(130)));
        // Without memory for a thread, signals do what they do.
        let _ = std::thread::Builder::new().spawn(wait);
    }
    #[cfg(not(unix))]
    let _ = ctrlc::set_handler(|| end(Status::Interrupted as u8));
}

fn end(status: u8) {
    ENDED_WITH.store(status, Ordering::Relaxed);
    let _alone = WRITING.write().unwrap_or_else(PoisonError::into_inner);
    std::process::exit(i32::from(status));
}

/// Exit code of a status; after a signal, the one that names the signal.
pub(crate) fn code(status: Status) -> ExitCode {
    match ENDED_WITH.load(Ordering::Relaxed) {
        by if status == Status::Interrupted && by != 0 => ExitCode::from(by),
        _ => ExitCode::from(status as u8),
    }
}

/// The signals that end a run. One that `nohup` keeps away is left alone.
#[cfg(unix)]
fn ending_signals(is_hangup_ignored: bool) -> Vec<i32> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    if is_hangup_ignored { vec![SIGINT, SIGTERM] } else { vec![SIGINT, SIGTERM, SIGHUP] }
}

/// True if the process was started to ignore SIGHUP, as `nohup` does. Known on Linux only.
#[cfg(unix)]
fn is_hangup_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored =
        status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    // Signals are counted from 1, bits from 0.
    ignored.is_some_and(|bits| bits & 1 << (signal_hook::consts::SIGHUP - 1) != 0)
}

/// Ends the process with an error after so many seconds, whatever it does then: a file that is being written is complete
/// or gone first, as with [`catch_interrupts`].
///
/// # Errors
/// When no thread can be started.
pub(crate) fn end_after(seconds: f64) -> anyhow::Result<()> {
    let wait = move || {
        std::thread::sleep(Duration::from_secs_f64(seconds));
        end_with(&format!("not done within the time limit of {seconds} s"));
    };
    std::thread::Builder::new().spawn(wait).context("cannot start a thread")?;
    Ok(())
}

/// Ends the process with an error, whatever its other threads do: a file that is being written is complete or gone first.
pub(crate) fn end_with(error: &str) -> ! {
    let _alone = WRITING.write().unwrap_or_else(PoisonError::into_inner);
    output::error(error);
    std::process::exit(Status::Failed as i32);
}

/// Turns an abort into an exit with status 1, without a core dump: Rust aborts, after one line, where the system refuses it
/// memory. A file that is being written is left behind as after SIGKILL.
pub(crate) fn end_quietly_on_abort() {
    #[cfg(unix)]
    {
        use std::sync::Arc;
        use std::sync::atomic::AtomicBool;
        let always = Arc::new(AtomicBool::new(true));
        // Where that cannot be, an abort is one.
        let abort = signal_hook::consts::SIGABRT;
        let _ = signal_hook::flag::register_conditional_shutdown(abort, Status::Failed as i32, always);
    }
}

/// Keeps interrupts away while a file is written.
///
/// # Errors
/// [`Interrupted`] if one came before.
pub(crate) fn writing() -> Result<RwLockReadGuard<'static, ()>, Interrupted> {
    let guard = WRITING.read().unwrap_or_else(PoisonError::into_inner);
    if interrupted() { Err(Interrupted) } else { Ok(guard) }
}

static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

thread_local! {
    static OWN_PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Panics become errors of one line ([`guarded`]) instead of a report of many; `RUST_BACKTRACE` brings that back.
pub(crate) fn hush_panics() {
    if std::env::var_os("RUST_BACKTRACE").is_some() {
        return;
    }
    std::panic::set_hook(Box::new(|info| {
        let text = describe(info);
        OWN_PANIC.with(|own| own.borrow_mut().clone_from(&text));
        *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = text;
    }));
}

fn describe(info: &PanicHookInfo<'_>) -> String {
    let what = info.payload_as_str().unwrap_or("no words for it").replace('\n', " ");
    match info.location() {
        Some(at) => format!("{what} ({}:{})", at.file(), at.line()),
        None => what,
    }
}

/// Does some work; a panic in it becomes an error.
pub(crate) fn guarded<T>(work: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| {
        // A panic in a thread of a pool leaves its words only in the common place.
        let own = OWN_PANIC.with(RefCell::take);
        let last = std::mem::take(&mut *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner));
        Err(anyhow!("a fault of this program, please report it: {}", if own.is_empty() { last } else { own }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_at_fault_decides_the_status() {
        assert_eq!(status_of(&usage("no")), Status::Usage);
        assert_eq!(status_of(&Interrupted.into()), Status::Interrupted);
        assert_eq!(status_of(&anyhow!("disk full")), Status::Failed);
    }

    #[cfg(unix)]
    #[test]
    fn a_terminal_that_closes_ends_a_run_unless_nohup_is_asked_for() {
        use signal_hook::consts::SIGHUP;
        assert!(ending_signals(false).contains(&SIGHUP) && !ending_signals(true).contains(&SIGHUP));
    }

    #[test]
    fn a_panic_becomes_an_error() {
        assert!(guarded::<()>(|| panic!("seven")).is_err());
        assert_eq!(guarded(|| Ok(7)).unwrap(), 7);
    }
}
