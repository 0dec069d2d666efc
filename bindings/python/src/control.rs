//! Runs of the engine: they use separate threads, while the calling thread checks signals and reports progress. The
//! interpreter lock is held only for that, a few times a second.

use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lodsmith::{Control, Stage, Verdict};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Time between two checks for signals. (Guessed: too short to be noticed.)
const CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// The stages, each with its start and end in the progress of a run. (Guessed from runs on scans.)
const STAGES: [(Stage, f64, f64); 4] = [
    (Stage::Prepare, 0.0, 0.1),
    (Stage::Collapse, 0.1, 0.65),
    (Stage::Fit, 0.65, 0.9),
    (Stage::Measure, 0.9, 1.0),
];

/// The threads, and the process that they belong to.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Returns the threads of this process. The threads of a parent do not exist in a fork, so a child gets its own; the
/// global pool of rayon would wait forever there.
fn pool() -> PyResult<Arc<ThreadPool>> {
    let process = std::process::id();
    let mut made = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, pool)) = made.as_ref().filter(|(owner, _)| *owner == process) {
        return Ok(pool.clone());
    }
    let pool = ThreadPoolBuilder::new().build().map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
    let pool = Arc::new(pool);
    if let Some(of_parent) = made.replace((process, pool.clone())) {
        // Its threads do not exist here, so that dropping it would wait forever.
        std::mem::forget(of_parent);
    }
    Ok(pool)
}

/// State that a run shares with the calling thread.
#[derive(Default)]
struct SharedState {
    is_cancelled: AtomicBool,
    /// Bits of the fraction done; for non-negative numbers, bits are ordered like the numbers.
    done: AtomicU64,
    /// Index of the stage.
    stage: AtomicU8,
}

/// Time after the time limit in which the result of an ended run is still measured and proven, as in jobs on files.
const GRACE: Duration = Duration::from_secs(1);

/// The control of a run, used by the engine.
pub(crate) struct WatchedRun {
    shared: Arc<SharedState>,
    deadline: Option<Instant>,
}

impl WatchedRun {
    /// True after a signal or an exception of the progress function.
    pub(crate) fn is_cancelled(&self) -> bool {
        self.shared.is_cancelled.load(Ordering::Relaxed)
    }

    /// True after the time limit; where results are measured, a while later.
    fn is_late(&self) -> bool {
        let is_measuring = STAGES[usize::from(self.shared.stage.load(Ordering::Relaxed))].0 == Stage::Measure;
        let grace = if is_measuring { GRACE } else { Duration::ZERO };
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline + grace)
    }
}

impl Control for WatchedRun {
    fn stage(&mut self, stage: Stage) {
        let index = STAGES.iter().position(|s| s.0 == stage).unwrap_or(1);
        self.shared.stage.store(index as u8, Ordering::Relaxed);
    }

    fn progress(&mut self, done: f64) -> Verdict {
        let (_, from, to) = STAGES[usize::from(self.shared.stage.load(Ordering::Relaxed))];
        // Several runs may follow each other; the progress of all never decreases.
        let done = from + (to - from) * done.clamp(0.0, 1.0);
        self.shared.done.fetch_max(done.to_bits(), Ordering::Relaxed);
        if self.is_cancelled() {
            Verdict::Cancel
        } else if self.is_late() {
            Verdict::Finish
        } else {
            Verdict::Continue
        }
    }
}

/// Progress and cancellation of a run.
#[derive(Default)]
pub(crate) struct Watch {
    /// A function of the fraction done and the name of the stage.
    pub(crate) progress: Option<Py<PyAny>>,
    /// Seconds after which a run ends with its best result.
    pub(crate) time_limit: Option<f64>,
}

impl Watch {
    /// Does work in threads of the engine while this thread waits. A signal or an exception of the progress function
    /// cancels it.
    pub(crate) fn run<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut WatchedRun) -> T + Send,
    ) -> PyResult<T> {
        let pool = pool()?;
        let shared = Arc::new(SharedState::default());
        // Limited to a year, which does not overflow a clock.
        let limit = self.time_limit.map(|s| Duration::from_secs_f64(s.clamp(0.0, 365.0 * 86400.0)));
        let mut run = WatchedRun { shared: shared.clone(), deadline: limit.map(|d| Instant::now() + d) };
        py.detach(|| {
            pool.in_place_scope(|scope| {
                let (send, receive) = channel();
                scope.spawn(move |_| drop(send.send(work(&mut run))));
                let state = || {
                    let stage = usize::from(shared.stage.load(Ordering::Relaxed));
                    (f64::from_bits(shared.done.load(Ordering::Relaxed)), STAGES[stage].0.name())
                };
                let cancel = || shared.is_cancelled.store(true, Ordering::Relaxed);
                wait(&receive, self.progress.as_ref(), state, cancel)
            })
        })
    }
}

/// Waits for the outcome of work in another thread; a signal or an exception of the progress function cancels it.
pub(crate) fn wait<T>(
    receive: &Receiver<T>,
    progress: Option<&Py<PyAny>>,
    state: impl Fn() -> (f64, &'static str),
    cancel: impl Fn(),
) -> PyResult<T> {
    let mut raised = None;
    loop {
        match receive.recv_timeout(CHECK_INTERVAL) {
            Ok(outcome) => return raised.map_or(Ok(outcome), Err),
            // The scope passes on a panic of the work.
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("the run ended without a result"));
            }
            Err(RecvTimeoutError::Timeout) if raised.is_some() => {}
            Err(RecvTimeoutError::Timeout) => {
                let checked = Python::attach(|py| {
                    py.check_signals()?;
                    progress.map_or(Ok(()), |f| f.call1(py, state()).map(drop))
                });
                if let Err(error) = checked {
                    cancel();
                    raised = Some(error);
                }
            }
        }
    }
}
