//! Control of the engine's runs by the command: time by stage, progress bar, Ctrl-C and time limit.

use std::time::{Duration, Instant};

use lodsmith::{Control, SimplifyError, Stage, Verdict};

use crate::exit;
use crate::progress::FileProgress;
use crate::status::Interrupted;

/// Converts the result of a run: a cancelled run was interrupted.
pub(crate) fn not_interrupted<T>(result: Result<T, SimplifyError>) -> anyhow::Result<T> {
    match result {
        Err(SimplifyError::Cancelled) if exit::interrupted() => Err(Interrupted.into()),
        result => Ok(result?),
    }
}

/// Time by stage, in the order in which stages first began.
#[derive(Clone)]
pub(crate) struct StageClock {
    pub(crate) stages: Vec<(&'static str, f64)>,
    running: Option<(usize, Instant)>,
}

impl StageClock {
    fn new() -> Self {
        // Always present, in this order; the engine may add more.
        let stages = ["read", Stage::Prepare.name(), Stage::Collapse.name()];
        Self { stages: stages.map(|s| (s, 0.0)).to_vec(), running: None }
    }
    /// Starts a stage, or continues it.
    fn enter(&mut self, name: &'static str) {
        self.end();
        let i = self.stages.iter().position(|(n, _)| *n == name).unwrap_or_else(|| {
            self.stages.push((name, 0.0));
            self.stages.len() - 1
        });
        self.running = Some((i, Instant::now()));
    }
    /// Ends the present stage.
    fn end(&mut self) {
        if let Some((i, begin)) = self.running.take() {
            self.stages[i].1 += begin.elapsed().as_secs_f64();
        }
    }
    pub(crate) fn total(&self) -> f64 {
        self.stages.iter().map(|(_, secs)| secs).sum()
    }
}

/// Control of a run: times its stages, moves the bar, and ends it on an interrupt or at the time limit.
pub(crate) struct RunControl<'a> {
    clock: StageClock,
    pub(crate) bar: &'a FileProgress<'a>,
    stage: Stage,
    /// Seconds from the start.
    pub(crate) time_limit: Option<f64>,
    deadline: Option<Instant>,
}

impl<'a> RunControl<'a> {
    /// Starts a run.
    pub(crate) fn new(bar: &'a FileProgress<'a>, time_limit: Option<f64>) -> Self {
        let deadline = time_limit.map(|s| Instant::now() + Duration::from_secs_f64(s));
        Self { clock: StageClock::new(), bar, stage: Stage::Prepare, time_limit, deadline }
    }
    /// Announces the start of reading.
    pub(crate) fn read(&mut self) {
        self.bar.read();
        self.clock.enter("read");
    }
    /// Announces the end of reading and the start of the engine's run.
    pub(crate) fn prepare(&mut self) {
        self.clock.enter(Stage::Prepare.name());
    }
    /// Announces the start of baking.
    pub(crate) fn bake(&mut self) {
        self.bar.bake();
        self.clock.enter("bake");
    }
    /// Announces the end of the engine's run and the start of writing.
    pub(crate) fn write(&mut self) {
        self.bar.write();
        self.clock.enter("write");
    }
    /// Ends the run and returns its times.
    pub(crate) fn end(mut self) -> StageClock {
        self.clock.end();
        self.clock
    }
}

impl Control for RunControl<'_> {
    fn stage(&mut self, stage: Stage) {
        self.clock.enter(stage.name());
        self.bar.stage(stage);
        self.stage = stage;
    }
    fn progress(&mut self, done: f64) -> Verdict {
        self.bar.within(self.stage, done);
        if exit::interrupted() {
            Verdict::Cancel
        } else if self.deadline.is_some_and(|d| Instant::now() >= d) {
            Verdict::Finish
        } else {
            Verdict::Continue
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_keep_their_order_and_add_up() {
        let mut clock = StageClock::new();
        for stage in ["read", "prepare", "simplify", "fit", "simplify", "write"] {
            clock.enter(stage);
        }
        clock.end();
        let names: Vec<_> = clock.stages.iter().map(|(n, _)| *n).collect();
        assert_eq!(names, ["read", "prepare", "simplify", "fit", "write"]);
    }
}
