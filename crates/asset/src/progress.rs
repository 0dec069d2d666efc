//! The progress of a whole job as one fraction.

use lodsmith::Stage;

use crate::job::Step;

/// Begin and end of each stage in the progress of a job. Guessed from runs on scans.
const READ: (f64, f64) = (0.0, 0.15);
const PREPARE: (f64, f64) = (0.15, 0.25);
const COLLAPSE: (f64, f64) = (0.25, 0.7);
const FIT: (f64, f64) = (0.7, 0.85);
const MEASURE: (f64, f64) = (0.85, 0.95);
const WRITE: (f64, f64) = (0.95, 1.0);

/// The fraction of a job that is done; it never goes back.
#[derive(Clone, Copy, Debug)]
pub struct JobProgress {
    span: (f64, f64),
    done: f64,
}

impl Default for JobProgress {
    fn default() -> Self {
        Self { span: READ, done: 0.0 }
    }
}

impl JobProgress {
    /// A step begins.
    pub fn step(&mut self, step: Step) {
        self.enter(match step {
            Step::Read => READ,
            Step::Prepare | Step::Clean => PREPARE,
            Step::Inspect | Step::Bake => MEASURE,
            Step::Write => WRITE,
        });
    }

    /// A stage of the engine begins.
    pub fn stage(&mut self, stage: Stage) {
        self.enter(match stage {
            Stage::Prepare => PREPARE,
            Stage::Fit => FIT,
            Stage::Measure => MEASURE,
            _ => COLLAPSE,
        });
    }

    fn enter(&mut self, span: (f64, f64)) {
        self.span = span;
        self.within(0.0);
    }

    /// This fraction of the present stage is done.
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
    fn a_job_never_goes_back() {
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
