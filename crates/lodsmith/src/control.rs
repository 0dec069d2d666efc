//! Progress and cancellation of a run. The library has no clock: the caller measures time.

use crate::SimplifyError;

/// Stage of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stage {
    /// Welding, ordering and building the connectivity.
    Prepare,
    /// Collapsing edges.
    Collapse,
    /// The final least-squares step.
    Fit,
    /// Measuring results against the input, and proving bounds.
    Measure,
}

impl Stage {
    /// Returns the name of the stage in reports, such as `prepare`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Prepare => "prepare",
            Self::Collapse => "simplify",
            Self::Fit => "fit",
            Self::Measure => "measure",
        }
    }
}

/// Answer of a caller to a progress report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Continue.
    Continue,
    /// End soon and return the best mesh so far. What is not yet measured or proven stays so, and the
    /// [report](crate::ErrorReport::is_incomplete) says it. A caller that wants the result of
    /// an unfinished run measured or proven gives this answer later in the stage [`Measure`](Stage::Measure), at the end of
    /// the time that this may take.
    Finish,
    /// End soon with an error and no mesh.
    Cancel,
}

/// Receiver of progress reports. It is called often (at least once in a few thousand collapses), so it should
/// answer quickly.
pub trait Control {
    /// Announces the start of a stage; the previous stage has ended.
    fn stage(&mut self, stage: Stage) {
        let _ = stage;
    }
    /// Reports the progress of the current stage, from 0 to 1; it never decreases within a stage.
    fn progress(&mut self, done: f64) -> Verdict {
        let _ = done;
        Verdict::Continue
    }
}

/// Starts a stage, and asks whether there is time for it.
///
/// # Errors
/// [`SimplifyError::Cancelled`].
pub(crate) fn has_time_for(stage: Stage, control: &mut dyn Control) -> Result<bool, SimplifyError> {
    control.stage(stage);
    match control.progress(0.0) {
        Verdict::Continue => Ok(true),
        Verdict::Finish => Ok(false),
        Verdict::Cancel => Err(SimplifyError::Cancelled),
    }
}

/// Does work of the current stage that asks from time to time whether to end, and then returns `None`. Returns `None` too if
/// the caller ends the run.
///
/// # Errors
/// [`SimplifyError::Cancelled`].
pub(crate) fn while_wanted<T>(
    control: &mut dyn Control,
    work: impl FnOnce(&mut dyn FnMut() -> bool) -> Option<T>,
) -> Result<Option<T>, SimplifyError> {
    let mut verdict = Verdict::Continue;
    let made = work(&mut || {
        if verdict == Verdict::Continue {
            verdict = control.progress(0.0);
        }
        verdict != Verdict::Continue
    });
    match verdict {
        Verdict::Continue => Ok(made),
        Verdict::Finish => Ok(None),
        Verdict::Cancel => Err(SimplifyError::Cancelled),
    }
}

/// A control that never interrupts.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoControl;

impl Control for NoControl {}

/// Progress of one of several runs, mapped to its share of the whole.
pub(crate) struct ProgressShare<'a> {
    pub(crate) control: &'a mut dyn Control,
    pub(crate) begin: f64,
    pub(crate) length: f64,
}

impl<'a> ProgressShare<'a> {
    /// Returns the i-th of `count` equal shares.
    pub(crate) fn of(control: &'a mut dyn Control, i: usize, count: usize) -> Self {
        let length = 1.0 / count.max(1) as f64;
        Self { control, begin: i as f64 * length, length }
    }
}

impl Control for ProgressShare<'_> {
    fn stage(&mut self, stage: Stage) {
        self.control.stage(stage);
    }
    fn progress(&mut self, done: f64) -> Verdict {
        self.control.progress(self.begin + self.length * done)
    }
}
