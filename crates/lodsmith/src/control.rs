//! Progress and cancellation of a run. The library has no clock: the caller measures time.

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
    /// Measuring the result against the input.
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
    /// End soon and return the best mesh so far.
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
