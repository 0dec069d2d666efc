//! Memory and processor time of this process, and its machine.

use anyhow::{Context, Result};

/// Runs all parallel work on the calling thread. Call it first in a program that times one thread.
///
/// # Errors
/// If a global thread pool exists already.
pub fn one_thread() -> Result<()> {
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    Ok(())
}

/// Returns a thread pool of all cores, for work that is not timed.
///
/// # Errors
/// If the system cannot start threads.
pub fn all_cores() -> Result<rayon::ThreadPool> {
    let cores = std::thread::available_parallelism()?.get();
    Ok(rayon::ThreadPoolBuilder::new().num_threads(cores).build()?)
}

/// Returns the name of the processor, if the system has one, and the number of its cores.
pub fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{}, {cores} cores", name.map_or("unknown processor", |(_, name)| name))
}

/// Returns the processor time of all threads of this process in seconds.
#[cfg(unix)]
pub fn cpu_seconds() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

/// Returns seconds since the first call: processor time is not available on this system.
#[cfg(not(unix))]
pub fn cpu_seconds() -> f64 {
    static FIRST: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    FIRST.get_or_init(std::time::Instant::now).elapsed().as_secs_f64()
}

/// Resets the peak of resident memory and returns the current resident memory, in kibibytes. Linux only.
///
/// # Errors
/// If the system has no such figures.
pub fn reset_peak_kb() -> Result<u64> {
    std::fs::write("/proc/self/clear_refs", "5").context("this system cannot reset the peak of memory")?;
    status_kb("VmRSS:")
}

/// Returns the peak of resident memory since the reset, in kibibytes.
///
/// # Errors
/// If the system has no such figure.
pub fn peak_kb() -> Result<u64> {
    status_kb("VmHWM:")
}

fn status_kb(key: &str) -> Result<u64> {
    let text =
        std::fs::read_to_string("/proc/self/status").context("this system reports no memory figures")?;
    let value = text.lines().find_map(|l| l.strip_prefix(key)).and_then(|l| l.split_whitespace().next());
    Ok(value.with_context(|| format!("no {key} in /proc/self/status"))?.parse()?)
}
