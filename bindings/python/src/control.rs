//! Control of runs from Python: signals, progress and a time limit. The interpreter lock is taken a few times a second
//! only.

use std::time::{Duration, Instant};

use lodsmith::{Control, Stage, Verdict};
use pyo3::prelude::*;

/// Time between two looks at signals. (Guessed: too short to be felt.)
pub(crate) const LOOK: Duration = Duration::from_millis(50);

/// Begin and end of each stage in the progress of a run. Guessed from runs on scans.
const PREPARE: (f64, f64) = (0.0, 0.1);
const COLLAPSE: (f64, f64) = (0.1, 0.65);
const FIT: (f64, f64) = (0.65, 0.9);
const MEASURE: (f64, f64) = (0.9, 1.0);

/// Control of one run of the engine.
pub(crate) struct PythonControl {
    /// A function of the fraction done and the name of the stage.
    progress: Option<Py<PyAny>>,
    deadline: Option<Instant>,
    next_look: Instant,
    stage: Stage,
    done: f64,
    /// The exception that ended the run.
    raised: Option<PyErr>,
}

impl PythonControl {
    pub(crate) fn new(progress: Option<Py<PyAny>>, time_limit: Option<f64>) -> Self {
        let now = Instant::now();
        // A year is for ever, and does not overflow a clock.
        let limit = time_limit.map(|s| Duration::from_secs_f64(s.clamp(0.0, 365.0 * 86400.0)));
        Self {
            progress,
            deadline: limit.map(|limit| now + limit),
            next_look: now + LOOK,
            stage: Stage::Prepare,
            done: 0.0,
            raised: None,
        }
    }

    /// Returns the exception that ended the run, if one did.
    pub(crate) fn raised(&mut self) -> Option<PyErr> {
        self.raised.take()
    }

    fn look(&mut self) -> Verdict {
        let (progress, done, stage) = (self.progress.as_ref(), self.done, self.stage.name());
        let looked = Python::attach(|py| {
            py.check_signals()?;
            progress.map_or(Ok(()), |f| f.call1(py, (done, stage)).map(drop))
        });
        self.next_look = Instant::now() + LOOK;
        match looked {
            Ok(()) => Verdict::Continue,
            Err(error) => {
                self.raised = Some(error);
                Verdict::Cancel
            }
        }
    }
}

impl Control for PythonControl {
    fn stage(&mut self, stage: Stage) {
        self.stage = stage;
    }

    fn progress(&mut self, done: f64) -> Verdict {
        let (from, to) = match self.stage {
            Stage::Prepare => PREPARE,
            Stage::Fit => FIT,
            Stage::Measure => MEASURE,
            _ => COLLAPSE,
        };
        // Runs may follow each other; the whole never goes back.
        self.done = self.done.max(from + (to - from) * done.clamp(0.0, 1.0));
        let now = Instant::now();
        if self.raised.is_some() {
            return Verdict::Cancel;
        }
        if now >= self.next_look && self.look() == Verdict::Cancel {
            return Verdict::Cancel;
        }
        if self.deadline.is_some_and(|d| now >= d) { Verdict::Finish } else { Verdict::Continue }
    }
}
