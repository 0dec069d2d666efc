//! Progress bar, on a terminal only.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lodsmith::Stage;
use lodsmith_asset::Step;
use lodsmith_asset::progress::{Span, stage_span, step_span};

use crate::output::escaped;

/// Steps of the bar for each file.
const BAR_STEPS: f64 = 1000.0;

/// Time between two updates of the elapsed time.
const TICK: Duration = Duration::from_millis(500);

/// The progress bar of a command, for all its files.
pub(crate) struct Progress {
    bar: ProgressBar,
    files: usize,
}

impl Progress {
    /// Creates a bar on standard error, if that is a terminal and `quiet` is not set.
    pub(crate) fn new(files: usize, quiet: bool) -> Self {
        if quiet || !std::io::stderr().is_terminal() {
            return Self { bar: ProgressBar::hidden(), files };
        }
        // Ten updates a second look smooth and cost nothing.
        let target = ProgressDrawTarget::stderr_with_hz(10);
        let bar = ProgressBar::with_draw_target(Some((files as f64 * BAR_STEPS) as u64), target);
        if let Ok(style) = ProgressStyle::with_template("{bar:32} {percent:>3} %  {msg}  {elapsed}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(TICK);
        Self { bar, files }
    }

    /// Returns the progress of one file.
    pub(crate) fn file<'a>(&'a self, name: &'a str) -> FileProgress<'a> {
        FileProgress { whole: self, name, done: AtomicU64::new(0), runs: AtomicU64::new(0) }
    }

    /// Calls a function with the bar hidden.
    pub(crate) fn with_bar_hidden<T>(&self, work: impl FnOnce() -> T) -> T {
        self.bar.suspend(work)
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Progress of one file.
pub(crate) struct FileProgress<'a> {
    whole: &'a Progress,
    name: &'a str,
    done: AtomicU64,
    /// Number of runs of the engine: a search for an error bound makes many.
    runs: AtomicU64,
}

impl FileProgress<'_> {
    /// Announces the start of reading.
    pub(crate) fn read(&self) {
        self.enter("read", step_span(Step::Read));
    }
    /// Announces the start of a stage of the engine.
    pub(crate) fn stage(&self, stage: Stage) {
        if stage == Stage::Collapse {
            self.runs.fetch_add(1, Ordering::Relaxed);
        }
        match self.runs.load(Ordering::Relaxed) {
            0 | 1 => self.enter(stage.name(), stage_span(stage)),
            run => self.enter(&format!("{}, run {run}", stage.name()), stage_span(stage)),
        }
    }
    /// Reports the progress of a stage of the engine, from 0 to 1.
    pub(crate) fn within(&self, stage: Stage, done: f64) {
        let (from, to) = stage_span(stage);
        self.to(from + (to - from) * done.clamp(0.0, 1.0));
    }
    /// Announces the start of baking.
    pub(crate) fn bake(&self) {
        self.enter("bake", step_span(Step::Bake));
    }
    /// Announces the start of drawing.
    pub(crate) fn draw(&self) {
        self.enter("draw", step_span(Step::Draw));
    }
    /// Reports that a number of frames is rendered.
    pub(crate) fn frame(&self, done: usize, all: usize) {
        let (from, to) = step_span(Step::Draw);
        self.enter(&format!("frame {} of {all}", (done + 1).min(all)), (from, to));
        self.to(from + (to - from) * done as f64 / all.max(1) as f64);
    }
    /// Announces the start of writing.
    pub(crate) fn write(&self) {
        self.enter("write", step_span(Step::Write));
    }
    /// Announces the end of the file, successful or not.
    pub(crate) fn end(&self) {
        self.to(1.0);
    }

    fn enter(&self, what: &str, span: Span) {
        let message = if self.whole.files == 1 { what.to_owned() } else { format!("{}: {what}", self.name) };
        self.whole.bar.set_message(escaped(&message).into_owned());
        self.to(span.0);
    }

    fn to(&self, part: f64) {
        let steps = (part * BAR_STEPS) as u64;
        let before = self.done.fetch_max(steps, Ordering::Relaxed);
        if steps > before {
            self.whole.bar.inc(steps - before);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fault C9: a search for an error bound made many runs, and the bar did not show it.
    #[test]
    fn repeated_runs_are_counted() {
        let whole = Progress { bar: ProgressBar::hidden(), files: 1 };
        let file = whole.file("a.obj");
        for (stage, message) in [
            (Stage::Prepare, "prepare"),
            (Stage::Collapse, "simplify"),
            (Stage::Measure, "measure"),
            (Stage::Collapse, "simplify, run 2"),
            (Stage::Measure, "measure, run 2"),
            (Stage::Collapse, "simplify, run 3"),
        ] {
            file.stage(stage);
            assert_eq!(whole.bar.message(), message);
        }
    }

    #[test]
    fn the_bar_of_a_file_never_goes_back_and_ends_full() {
        let whole = Progress { bar: ProgressBar::hidden(), files: 2 };
        whole.bar.set_length(2000);
        let file = whole.file("a.obj");
        file.read();
        file.stage(Stage::Fit);
        file.within(Stage::Collapse, 0.1);
        assert_eq!(whole.bar.position(), 700);
        file.end();
        assert_eq!(whole.bar.position(), 1000);
    }
}
