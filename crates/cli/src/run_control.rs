//! The command as the caller of jobs: it updates the progress bar, ends runs on an interrupt, and provides the standard
//! streams.

use std::fs;
use std::io::{self, Read, Write};
use std::path::Path;

use lodsmith::{Control, SimplifyError, Stage, Verdict};
use lodsmith_asset::{Step, Watch};

use crate::exit::{self, Alarm};
use crate::in_order::Turn;
use crate::progress::FileProgress;
use crate::status::Interrupted;

/// Converts the result of a run: a run that an interrupt cancelled becomes [`Interrupted`].
pub(crate) fn not_interrupted<T>(result: Result<T, SimplifyError>) -> anyhow::Result<T> {
    match result {
        Err(SimplifyError::Cancelled) if exit::interrupted() => Err(Interrupted.into()),
        result => Ok(result?),
    }
}

/// The caller of a job on one file.
pub(crate) struct BarWatch<'a> {
    bar: &'a FileProgress<'a>,
    stage: Stage,
    /// Position of the file among several.
    turn: Option<&'a Turn<'a>>,
    /// Seconds that reading may take.
    reading_limit: Option<f64>,
    /// Ends the process while there is nothing to write.
    alarm: Option<Alarm>,
}

impl<'a> BarWatch<'a> {
    pub(crate) fn new(bar: &'a FileProgress<'a>) -> Self {
        Self { bar, stage: Stage::Prepare, turn: None, reading_limit: None, alarm: None }
    }
    /// Takes the position of the file, and the seconds that reading it may take.
    pub(crate) fn in_turn(bar: &'a FileProgress<'a>, turn: &'a Turn<'a>, reading_limit: Option<f64>) -> Self {
        Self { turn: Some(turn), reading_limit, ..Self::new(bar) }
    }
}

impl Control for BarWatch<'_> {
    fn stage(&mut self, stage: Stage) {
        self.bar.stage(stage);
        self.stage = stage;
    }
    fn progress(&mut self, done: f64) -> Verdict {
        self.bar.within(self.stage, done);
        if exit::interrupted() { Verdict::Cancel } else { Verdict::Continue }
    }
}

impl Watch for BarWatch<'_> {
    fn enter(&mut self, step: Step) {
        self.alarm = None;
        match step {
            Step::Read => {
                self.bar.read();
                // (Without a thread for the alarm, the limit is kept from the next step on.)
                self.alarm = self.reading_limit.and_then(|secs| exit::end_after(secs).ok());
            }
            Step::Inspect => self.bar.stage(Stage::Measure),
            Step::Bake => self.bar.bake(),
            Step::Draw => self.bar.draw(),
            Step::Write => self.bar.write(),
            _ => {}
        }
    }
    fn frame(&mut self, done: usize, all: usize) {
        self.bar.frame(done, all);
    }
    fn input(&mut self) -> Box<dyn Read + '_> {
        Box::new(io::stdin().lock())
    }
    fn output(&mut self) -> Box<dyn Write + '_> {
        Box::new(io::stdout().lock())
    }
    fn wait_for_earlier(&mut self) {
        if let Some(turn) = self.turn {
            turn.wait();
        }
    }
    fn while_writing(&mut self, path: &Path, write: &mut dyn FnMut()) -> bool {
        let metadata = fs::metadata(path).ok();
        // A pipe may block its writer forever, and Ctrl-C must end that; it cannot leave a partial file.
        let is_file = metadata.as_ref().is_none_or(fs::Metadata::is_file);
        let guard = is_file.then(exit::writing).transpose();
        let may_write = guard.is_ok();
        if may_write {
            write();
        }
        may_write
    }
}
