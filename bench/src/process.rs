//! What this process has used: memory and processor time.

use anyhow::{Context, Result};

/// Has all parallel work run on the calling thread alone. To be called first in a program that times one thread.
///
/// # Errors
/// If a pool has been set up before.
pub fn one_thread() -> Result<()> {
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    Ok(())
}

/// A pool of all cores, for what is not timed.
///
/// # Errors
/// If the system gives no threads.
pub fn all_cores() -> Result<rayon::ThreadPool> {
    let cores = std::thread::available_parallelism()?.get();
    Ok(rayon::ThreadPoolBuilder::new().num_threads(cores).build()?)
}

/// Seconds of processor time that this process has used, over all its threads.
#[cfg(unix)]
pub fn cpu_seconds() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

/// Seconds since the first call: other systems have no figure for the process here.
#[cfg(not(unix))]
pub fn cpu_seconds() -> f64 {
    static FIRST: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    FIRST.get_or_init(std::time::Instant::now).elapsed().as_secs_f64()
}

/// Starts the peak of resident memory afresh and returns what is resident now, in kibibytes. Linux alone has this.
///
/// # Errors
/// If the system has no such figures.
pub fn reset_peak_kb() -> Result<u64> {
    std::fs::write("/proc/self/clear_refs", "5").context("this system cannot reset the peak of memory")?;
    status_kb("VmRSS:")
}

/// Peak of resident memory since it was reset, in kibibytes.
///
/// # Errors
/// If the system has no such figure.
pub fn peak_kb() -> Result<u64> {
    status_kb("VmHWM:")
}

fn status_kb(key: &str) -> Result<u64> {
    let text = std::fs::read_to_string("/proc/self/status").context("this system tells no memory figures")?;
    let value = text.lines().find_map(|l| l.strip_prefix(key)).and_then(|l| l.split_whitespace().next());
    Ok(value.with_context(|| format!("no {key} in /proc/self/status"))?.parse()?)
}
