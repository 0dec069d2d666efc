//! A job in progress: its caller, times and limits.

use std::io::{self, Read, Write};
use std::path::Path;
use std::time::Duration;

use lodsmith::{Control, NoControl, Stage, Verdict};
use lodsmith_core::memory;
use lodsmith_io::{Limits, WriteError, machine};
use web_time::Instant;

use crate::error::AssetError;
use crate::paths::Sink;
use crate::values::MIN_MEMORY;

/// A step of a job. (The stages of the engine are within the run.)
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Step {
    /// Read the input.
    Read,
    /// Prepare the run of the engine, which reports its stages from then on.
    Prepare,
    /// Clean the meshes.
    Clean,
    /// Inspect the mesh.
    Inspect,
    /// Bake maps.
    Bake,
    /// Draw pictures.
    Draw,
    /// Write the output.
    Write,
}

impl Step {
    /// Returns the name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Prepare => Stage::Prepare.name(),
            Self::Clean => "clean",
            Self::Inspect => "inspect",
            Self::Bake => "bake",
            Self::Draw => "draw",
            Self::Write => "write",
        }
    }
}

/// The interface of a job to its caller: progress and cancellation, as in [`Control`], and standard streams.
pub trait Watch: Control {
    /// Called at the start of a step.
    fn enter(&mut self, step: Step) {
        let _ = step;
    }

    /// Called before each frame of an animation: `done` of `all` frames are rendered.
    fn frame(&mut self, done: usize, all: usize) {
        let _ = (done, all);
    }

    /// Returns the stream that serves as standard input.
    fn input(&mut self) -> Box<dyn Read + '_> {
        Box::new(io::empty())
    }

    /// Returns the stream that serves as standard output.
    fn output(&mut self) -> Box<dyn Write + '_> {
        Box::new(io::sink())
    }

    /// Waits for the jobs of earlier inputs. Called before writing files with names from the input, since earlier
    /// inputs have precedence for a name.
    fn wait_for_earlier(&mut self) {}

    /// Writes a file by calling `write`. A caller that may end the process must wait until it has returned. Returns
    /// false, without writing, if the job must end.
    fn while_writing(&mut self, path: &Path, write: &mut dyn FnMut()) -> bool {
        let _ = path;
        write();
        true
    }
}

impl Watch for NoControl {}

/// Seconds by stage, in the order of their first start.
#[derive(Clone, Debug, Default)]
pub struct StageClock {
    /// The stages with their seconds.
    pub stages: Vec<(&'static str, f64)>,
    running: Option<(usize, Instant)>,
}

impl StageClock {
    /// Makes a clock; these stages come first, in this order, even if they never start.
    pub fn new(stages: &[&'static str]) -> Self {
        Self { stages: stages.iter().map(|name| (*name, 0.0)).collect(), running: None }
    }

    /// Starts or continues a stage.
    fn enter(&mut self, name: &'static str) {
        self.end();
        let i = self.stages.iter().position(|(n, _)| *n == name).unwrap_or_else(|| {
            self.stages.push((name, 0.0));
            self.stages.len() - 1
        });
        self.running = Some((i, Instant::now()));
    }

    /// Ends the current stage.
    fn end(&mut self) {
        if let Some((i, start)) = self.running.take() {
            self.stages[i].1 += start.elapsed().as_secs_f64();
        }
    }

    /// Returns the sum of all stages.
    pub fn total(&self) -> f64 {
        self.stages.iter().map(|(_, secs)| secs).sum()
    }
}

/// A job in progress. It is also the [`Control`] of its engine runs.
pub struct Job<'w> {
    watch: &'w mut dyn Watch,
    clock: StageClock,
    /// False during steps without stages of the engine.
    has_stages: bool,
    /// True in the stages of measuring and proving.
    is_measuring: bool,
    time_limit: Option<f64>,
    deadline: Option<Instant>,
    /// Time after the deadline in which results are still measured and proven.
    grace: Duration,
    /// Memory limit of a step, in bytes.
    memory: u64,
    is_cancelled: bool,
}

/// Seconds after the time limit in which the result of an ended run is still measured and proven, so that most keep the
/// promise of an error limit. (Guessed: as long as a user hardly notices.)
const GRACE_SECS: f64 = 1.0;
/// Default fraction of the available memory: the rest is for the system, and for memory that the estimates do not
/// cover.
const DEFAULT_MEMORY_SHARE: f64 = 0.75;
/// Assumed memory of a machine if the system does not report it (on all systems but Linux). (Guessed.)
const ASSUMED_MEMORY: u64 = 16 << 30;
/// Bytes of the program itself, without any model.
const PROGRAM_BYTES: u64 = 8 << 20;

/// Refuses a step that would need more than `limit` bytes, including the program itself.
///
/// # Errors
/// [`AssetError::Memory`], with the step, the memory that it needs and the limit.
pub fn check_memory(step: &str, need: u64, limit: u64) -> Result<(), AssetError> {
    Ok(memory::check(step, need.saturating_add(PROGRAM_BYTES), limit)?)
}

impl<'w> Job<'w> {
    /// Starts a job: `time_limit` seconds from now, runs end with the best result so far, and one second later what is
    /// not yet measured or proven of it stays so; a step that would need more than `memory` bytes is refused.
    pub fn new(watch: &'w mut dyn Watch, time_limit: Option<f64>, memory: u64) -> Self {
        let limit = time_limit.map(seconds_of);
        let clock = StageClock::new(&[Step::Read.name(), Step::Prepare.name(), Stage::Collapse.name()]);
        let deadline = limit.map(|d| Instant::now() + d);
        Self {
            watch,
            clock,
            has_stages: true,
            is_measuring: false,
            time_limit,
            deadline,
            grace: seconds_of(GRACE_SECS),
            memory,
            is_cancelled: false,
        }
    }

    /// Sets the seconds after the time limit in which the result of an ended run is still measured and proven.
    pub fn with_grace(self, secs: f64) -> Self {
        Self { grace: seconds_of(secs), ..self }
    }

    /// Returns the default memory limit of a step in bytes: three quarters of the memory of the machine or container.
    pub fn default_memory() -> u64 {
        let all = machine::memory_limit().unwrap_or(ASSUMED_MEMORY);
        ((all as f64 * DEFAULT_MEMORY_SHARE) as u64).max(MIN_MEMORY)
    }

    /// Sets the stages that come first in the report.
    pub(crate) fn set_stages(&mut self, steps: &[Step]) {
        self.clock = StageClock::new(&steps.iter().map(|step| step.name()).collect::<Vec<_>>());
    }

    /// Starts a step.
    pub fn enter(&mut self, step: Step) {
        self.has_stages = step == Step::Prepare;
        self.is_measuring = false;
        self.clock.enter(step.name());
        self.watch.enter(step);
    }

    /// Reports the number of rendered frames.
    #[cfg(feature = "pictures")]
    pub(crate) fn frame(&mut self, done: usize, all: usize) {
        self.watch.frame(done, all);
    }

    /// Returns the time limit of runs, in seconds.
    pub fn time_limit(&self) -> Option<f64> {
        self.time_limit
    }

    /// Returns the memory limit of a step, in bytes.
    pub(crate) fn memory(&self) -> u64 {
        self.memory
    }

    /// True after the time limit and, where results are measured, the grace.
    fn is_late(&self) -> bool {
        let grace = if self.is_measuring { self.grace } else { Duration::ZERO };
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline + grace)
    }

    /// True if the caller cancelled the job.
    pub(crate) fn is_cancelled(&self) -> bool {
        self.is_cancelled
    }

    /// Ends the current stage and returns the times so far.
    pub fn times(&mut self) -> StageClock {
        self.clock.end();
        self.clock.clone()
    }

    /// Refuses a step that would need more memory than allowed.
    ///
    /// # Errors
    /// [`AssetError::Memory`], with the step, the memory that it needs and the limit.
    pub fn check_memory(&self, step: &str, need: u64) -> Result<(), AssetError> {
        check_memory(step, need, self.memory)
    }

    /// Reads all of standard input, within the limits.
    pub(crate) fn input(&mut self, limits: Limits) -> Result<Vec<u8>, AssetError> {
        Ok(lodsmith_io::read_stream(&mut *self.watch.input(), Vec::new(), limits)?)
    }

    pub(crate) fn wait_for_earlier(&mut self) {
        self.watch.wait_for_earlier();
    }

    /// Writes to a stream or a file; no partial file is left behind.
    ///
    /// # Errors
    /// [`AssetError::Write`], [`AssetError::Stream`]; [`AssetError::Cancelled`] if the caller ends.
    pub fn put<T>(
        &mut self,
        sink: &Sink,
        to_stream: impl FnOnce(&mut dyn Write) -> Result<T, WriteError>,
        to_path: impl FnOnce(&Path) -> Result<T, WriteError>,
    ) -> Result<T, AssetError> {
        match sink {
            Sink::Stream => match to_stream(&mut *self.watch.output()) {
                Err(WriteError::Io { source, .. }) => Err(AssetError::Stream(source)),
                result => Ok(result?),
            },
            Sink::Path(path) => {
                let (mut write, mut result) = (Some(to_path), None);
                let mut once = || result = write.take().map(|write| write(path));
                if !self.watch.while_writing(path, &mut once) {
                    return Err(AssetError::Cancelled);
                }
                Ok(result.ok_or(AssetError::Cancelled)??)
            }
        }
    }

    /// Writes bytes to a stream or a file.
    ///
    /// # Errors
    /// Those of [`Job::put`].
    pub fn put_bytes(&mut self, bytes: &[u8], sink: &Sink, force: bool) -> Result<(), AssetError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            |source| WriteError::Io { path, source }
        };
        self.put(
            sink,
            |out| out.write_all(bytes).and_then(|()| out.flush()).map_err(failed(Path::new("output stream"))),
            |path| {
                lodsmith_io::write::write_file(path, force, |out| out.write_all(bytes)).map_err(failed(path))
            },
        )
    }
}

impl Control for Job<'_> {
    fn stage(&mut self, stage: Stage) {
        if self.has_stages {
            self.clock.enter(stage.name());
            self.is_measuring = stage == Stage::Measure;
        }
        self.watch.stage(stage);
    }

    fn progress(&mut self, done: f64) -> Verdict {
        match self.watch.progress(done) {
            Verdict::Cancel => {
                self.is_cancelled = true;
                Verdict::Cancel
            }
            Verdict::Continue if self.is_late() => Verdict::Finish,
            verdict => verdict,
        }
    }
}

/// Converts seconds, limited to a year, which does not overflow a clock.
fn seconds_of(secs: f64) -> Duration {
    Duration::from_secs_f64(secs.clamp(0.0, 365.0 * 86400.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_a_fraction_of_the_memory() {
        let limit = Job::default_memory();
        assert!(limit >= MIN_MEMORY);
        if let Some(all) = machine::memory_limit() {
            assert!(limit <= all.max(MIN_MEMORY), "{limit} of {all}");
        }
    }

    #[test]
    fn stages_keep_their_order_and_add_up() {
        let mut clock = StageClock::new(&["read", "prepare", "simplify"]);
        for stage in ["read", "prepare", "simplify", "fit", "simplify", "write"] {
            clock.enter(stage);
        }
        clock.end();
        let names: Vec<_> = clock.stages.iter().map(|(n, _)| *n).collect();
        assert_eq!(names, ["read", "prepare", "simplify", "fit", "write"]);
        assert_eq!(clock.total(), clock.stages.iter().map(|s| s.1).sum::<f64>());
    }

    #[test]
    fn results_are_still_measured_after_the_time_limit_but_not_for_ever() {
        let mut watch = NoControl;
        let mut job = Job::new(&mut watch, Some(0.0), u64::MAX).with_grace(3600.0);
        job.enter(Step::Prepare);
        for (stage, verdict) in [
            (Stage::Collapse, Verdict::Finish),
            (Stage::Measure, Verdict::Continue),
            (Stage::Fit, Verdict::Finish),
            (Stage::Measure, Verdict::Continue),
        ] {
            job.stage(stage);
            assert_eq!(job.progress(0.0), verdict, "{stage:?}");
        }
        job.enter(Step::Bake);
        assert_eq!(job.progress(0.0), Verdict::Finish);
        let mut job = Job::new(&mut watch, Some(0.0), u64::MAX).with_grace(0.0);
        job.stage(Stage::Measure);
        assert_eq!(job.progress(0.0), Verdict::Finish);
    }

    #[test]
    fn a_step_that_needs_too_much_memory_is_refused() {
        let mut watch = NoControl;
        let job = Job::new(&mut watch, None, 100 << 20);
        assert!(job.check_memory("simplify", 90 << 20).is_ok());
        let refused = job.check_memory("simplify", 93 << 20).unwrap_err().to_string();
        assert!(refused.contains("simplify"), "{refused}");
    }
}
