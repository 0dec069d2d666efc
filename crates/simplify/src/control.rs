//! How a caller follows a run and ends it. The library has no clock: who calls measures the time.

/// What a run is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stage {
    /// Welding, ordering and linking.
    Prepare,
    /// Collapsing edges.
    Collapse,
    /// The last least-squares step.
    Fit,
    /// Measuring the result against the input.
    Measure,
}

impl Stage {
    /// The word for it in reports, such as `prepare`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Prepare => "prepare",
            Self::Collapse => "simplify",
            Self::Fit => "fit",
            Self::Measure => "measure",
        }
    }
}

/// What a caller wants next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Go on.
    Continue,
    /// End soon and return the best mesh so far.
    Finish,
    /// End soon and return nothing.
    Cancel,
}

/// Follows a run. Asked often (at least once in a few thousand collapses), so answers should be quick.
pub trait Control {
    /// A stage begins; the one before has ended.
    fn stage(&mut self, stage: Stage) {
        let _ = stage;
    }
    /// How far the present stage is, from 0 to 1; never less than said before within a stage.
    fn progress(&mut self, done: f64) -> Verdict {
        let _ = done;
        Verdict::Continue
    }
}

/// Nobody watches.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoControl;

impl Control for NoControl {}

/// One of several runs, as a part of the whole.
pub(crate) struct Share<'a> {
    pub(crate) control: &'a mut dyn Control,
    pub(crate) begin: f64,
    pub(crate) length: f64,
}

impl<'a> Share<'a> {
    /// One of `count` equal shares.
    pub(crate) fn of(control: &'a mut dyn Control, i: usize, count: usize) -> Self {
        let length = 1.0 / count.max(1) as f64;
        Self { control, begin: i as f64 * length, length }
    }
}

impl Control for Share<'_> {
    fn stage(&mut self, stage: Stage) {
        self.control.stage(stage);
    }
    fn progress(&mut self, done: f64) -> Verdict {
        self.control.progress(self.begin + self.length * done)
    }
}
