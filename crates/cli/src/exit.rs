//! The end of the process: interrupts, time limits, and panics as errors.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, PoisonError, RwLock, RwLockReadGuard};
use std::time::Duration;

use anyhow::{Context as _, anyhow};

use crate::output;
use crate::status::{Interrupted, Status};

/// Exit code for the signal that asked the process to end; 0 before any signal.
static ENDED_WITH: AtomicU8 = AtomicU8::new(0);
/// Held shared while a file is written, and exclusively to end the process, so that no partial file is left
/// behind.
static WRITING: RwLock<()> = RwLock::new(());

/// Returns true after a signal has asked the process to end.
pub(crate) fn interrupted() -> bool {
    ENDED_WITH.load(Ordering::Relaxed) != 0
}

/// Ends the process on a signal (Ctrl-C, SIGTERM or a terminal that closes), after the file that is being
/// written is complete or removed.
///
/// Runs that poll [`interrupted`] may end sooner, with the same status.
pub(crate) fn catch_interrupts() {
    // If no handler can be installed, signals keep their default action.
    #[cfg(unix)]
    if let Ok(mut signals) = signal_hook::iterator::Signals::new(ending_signals(is_hangup_ignored())) {
        // By convention, the number of the signal is in the status.
        let wait =
            move || signals.forever().for_each(|signal| end(u8::try_from(128 + signal).unwrap_or(130)));
        // If no thread can be started, signals keep their default action.
        let _ = std::thread::Builder::new().spawn(wait);
    }
    #[cfg(not(unix))]
    let _ = ctrlc::set_handler(|| end(Status::Interrupted as u8));
}

fn end(status: u8) {
    ENDED_WITH.store(status, Ordering::Relaxed);
    let _exclusive = WRITING.write().unwrap_or_else(PoisonError::into_inner);
    std::process::exit(i32::from(status));
}

/// Returns the exit code of a status; after a signal, the exit code for that signal.
pub(crate) fn code(status: Status) -> ExitCode {
    match ENDED_WITH.load(Ordering::Relaxed) {
        by if status == Status::Interrupted && by != 0 => ExitCode::from(by),
        _ => ExitCode::from(status as u8),
    }
}

/// Returns the signals that end a run, without SIGHUP if `nohup` ignores it.
#[cfg(unix)]
fn ending_signals(is_hangup_ignored: bool) -> Vec<i32> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    if is_hangup_ignored { vec![SIGINT, SIGTERM] } else { vec![SIGINT, SIGTERM, SIGHUP] }
}

/// Returns true if the process was started with SIGHUP ignored, for example by `nohup`. Always false except on
/// Linux.
#[cfg(unix)]
fn is_hangup_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored =
        status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    // Signals are counted from 1, bits from 0.
    ignored.is_some_and(|bits| bits & 1 << (signal_hook::consts::SIGHUP - 1) != 0)
}

/// Ends the process when its time is over, unless it is dropped before.
pub(crate) struct Alarm {
    _until_dropped: Sender<()>,
}

/// Ends the process with an error after this many seconds, whatever it is doing then: a file that is being
/// written is completed or removed first, as with [`catch_interrupts`].
///
/// # Errors
/// If no thread can be started.
pub(crate) fn end_after(seconds: f64) -> anyhow::Result<Alarm> {
    let (_until_dropped, dropped) = channel();
    let wait = move || {
        if dropped.recv_timeout(Duration::from_secs_f64(seconds)) == Err(RecvTimeoutError::Timeout) {
            end_with(&format!("not done within the time limit of {seconds} s"));
        }
    };
    std::thread::Builder::new().spawn(wait).context("cannot start a thread")?;
    Ok(Alarm { _until_dropped })
}

/// Ends the process with an error, whatever its other threads are doing: a file that is being written is
/// completed or removed first.
pub(crate) fn end_with(error: &str) -> ! {
    let _exclusive = WRITING.write().unwrap_or_else(PoisonError::into_inner);
    output::error(error);
    std::process::exit(Status::Failed as i32);
}

/// Turns an abort into an exit with status 1, without a core dump: if an allocation fails, Rust prints one line
/// and aborts. A partial file is left behind, as after SIGKILL.
pub(crate) fn end_quietly_on_abort() {
    #[cfg(unix)]
    {
        use std::sync::Arc;
        use std::sync::atomic::AtomicBool;
        let always = Arc::new(AtomicBool::new(true));
        // If the handler cannot be installed, an abort stays an abort.
        let abort = signal_hook::consts::SIGABRT;
        let _ = signal_hook::flag::register_conditional_shutdown(abort, Status::Failed as i32, always);
    }
}

/// Delays interrupts while a file is written.
///
/// # Errors
/// [`Interrupted`] if the run was interrupted before.
pub(crate) fn writing() -> Result<RwLockReadGuard<'static, ()>, Interrupted> {
    let guard = WRITING.read().unwrap_or_else(PoisonError::into_inner);
    if interrupted() { Err(Interrupted) } else { Ok(guard) }
}

static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

thread_local! {
    static OWN_PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Stores the message of a panic for [`guarded`] instead of printing it; with `RUST_BACKTRACE`, the full report
/// is printed.
pub(crate) fn shorten_panics() {
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
    let what = info.payload_as_str().unwrap_or("panic without a message").replace('\n', " ");
    match info.location() {
        Some(at) => format!("{what} ({}:{})", at.file(), at.line()),
        None => what,
    }
}

/// Calls a function and turns a panic in it into an error.
pub(crate) fn guarded<T>(work: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        // A panic in a thread of a pool stores its message only in the shared variable.
        let own = OWN_PANIC.with(RefCell::take);
        let last = std::mem::take(&mut *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner));
        // Without the panic hook of the command, only the payload of the panic is known.
        let payload_text = || {
            payload
                .downcast_ref::<String>()
                .cloned()
                .or_else(|| Some((*payload.downcast_ref::<&str>()?).into()))
        };
        let text =
            [own, last].into_iter().find(|text| !text.is_empty()).or_else(payload_text).unwrap_or_default();
        Err(anyhow!("internal error, please report it: {text}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_closing_terminal_ends_a_run_except_under_nohup() {
        use signal_hook::consts::SIGHUP;
        assert!(ending_signals(false).contains(&SIGHUP) && !ending_signals(true).contains(&SIGHUP));
    }

    #[test]
    fn a_panic_becomes_an_error() {
        assert!(guarded::<()>(|| panic!("seven")).is_err());
        assert_eq!(guarded(|| Ok(7)).unwrap(), 7);
    }
}
