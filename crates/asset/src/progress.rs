//! The progress of a whole job as one fraction.

use lodsmith::Stage;

use crate::job::Step;

/// Start and end of a part of a job, as fractions of the whole job. (Guessed from runs on scans.)
pub type Span = (f64, f64);

/// Returns the span of a step.
pub const fn step_span(step: Step) -> Span {
    match step {
        Step::Read => (0.0, 0.15),
        Step::Prepare | Step::Clean => stage_span(Stage::Prepare),
        Step::Inspect | Step::Bake => stage_span(Stage::Measure),
        // From the start of the stages of the engine to the start of writing.
        Step::Draw => (0.25, 0.95),
        Step::Write => (0.95, 1.0),
    }
}

/// Returns the span of a stage of the engine.
pub const fn stage_span(stage: Stage) -> Span {
    match stage {
        Stage::Prepare => (0.15, 0.25),
        Stage::Fit => (0.7, 0.85),
        Stage::Measure => (0.85, 0.95),
        _ => (0.25, 0.7),
    }
}

/// The fraction of a job that is done; it never decreases.
#[derive(Clone, Copy, Debug)]
pub struct JobProgress {
    span: Span,
    done: f64,
}

impl Default for JobProgress {
    fn default() -> Self {
        Self { span: step_span(Step::Read), done: 0.0 }
    }
}

impl JobProgress {
    /// Starts a step.
    pub fn step(&mut self, step: Step) {
        self.enter(step_span(step));
    }

    /// Starts a stage of the engine.
    pub fn stage(&mut self, stage: Stage) {
        self.enter(stage_span(stage));
    }

    fn enter(&mut self, span: Span) {
        self.span = span;
        self.within(0.0);
    }

    /// Sets the fraction of the current stage that is done.
    pub fn within(&mut self, done: f64) {
        let (from, to) = self.span;
        self.done = self.done.max(from + (to - from) * done.clamp(0.0, 1.0));
    }

    /// Returns the fraction of the whole job that is done.
    pub fn done(&self) -> f64 {
        self.done
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_never_decreases() {
        let mut job = JobProgress::default();
        job.step(Step::Read);
        job.stage(Stage::Fit);
        job.stage(Stage::Collapse);
        job.within(0.1);
        assert_eq!(job.done(), 0.7);
        job.step(Step::Write);
        job.within(1.0);
        assert_eq!(job.done(), 1.0);
    }
}
