//! Processing of several inputs, in sequence or in parallel, each with a result of its own.

use std::fs;

use anyhow::Context as _;
use lodsmith_asset::plan::{self, Assignment, Outputs};
use lodsmith_asset::{Destination, Job, Sink};

use crate::args::Run;
use crate::exit;
use crate::in_order::{self, Turn};
use crate::memory;
use crate::output::Output;
use crate::progress::Progress;
use crate::run_control::BarWatch;
use crate::status::{Interrupted, Status};

/// Assigns the outputs, processes every input and shows the outcomes, as [`run_assigned`] does.
pub(super) fn run<T: Send>(
    outputs: &Outputs<'_>,
    run: &Run,
    work: impl Fn(&Assignment, &mut Job<'_>) -> anyhow::Result<T> + Sync,
    show: impl Fn(&Output, &str, &T, &Assignment) -> Status,
) -> anyhow::Result<Status> {
    let files = plan::assign(outputs)?;
    if let (Some(folder), false) = (outputs.out_dir, outputs.dry_run) {
        fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
    }
    run_assigned(&files, outputs.json, run, work, show)
}

/// Processes every input and shows the outcomes in the order of the inputs; `show` returns the status that
/// each alone would end with.
pub(super) fn run_assigned<T: Send>(
    files: &[Assignment],
    json: bool,
    run: &Run,
    work: impl Fn(&Assignment, &mut Job<'_>) -> anyhow::Result<T> + Sync,
    show: impl Fn(&Output, &str, &T, &Assignment) -> Status,
) -> anyhow::Result<Status> {
    let takes_stdout = |to: &Destination| to.sink == Sink::Stream && !to.dry_run;
    let is_stdout_taken = files.iter().any(|file| file.output.as_ref().is_some_and(takes_stdout));
    let out = Output::new(run, json, is_stdout_taken);
    let progress = Progress::new(files.len(), run.quiet);
    let work = |file: &Assignment, turn: &Turn<'_>| {
        if exit::interrupted() {
            return Err(Interrupted.into());
        }
        let name = file.source.to_string();
        let bar = progress.file(&name);
        let outcome = exit::guarded(|| {
            let mut watch = BarWatch::in_turn(&bar, turn);
            work(file, &mut Job::new(&mut watch, run.time_limit, memory::limit()))
        });
        bar.end();
        outcome
    };
    let mut status = Status::Done;
    in_order::process_in_order(files, run.threads(), work, |i, outcome| {
        let path = files[i].source.to_string();
        let own = progress.with_bar_hidden(|| match outcome {
            Ok(done) => show(&out, &path, &done, &files[i]),
            Err(e) => out.failure(&path, &e),
        });
        status = status.or_worse(own);
    })?;
    progress.finish();
    out.finish(status)
}

/// Does the job of a command with one input, named `path`, in a pool of its threads.
pub(super) fn single<T: Send>(
    path: &str,
    run: &Run,
    work: impl FnOnce(&mut Job<'_>) -> anyhow::Result<T> + Send,
) -> anyhow::Result<T> {
    let progress = Progress::new(1, run.quiet);
    let done = in_order::pool(run.threads())?.install(|| {
        let bar = progress.file(path);
        let mut watch = BarWatch::new(&bar);
        work(&mut Job::new(&mut watch, run.time_limit, memory::limit()))
    });
    progress.finish();
    done.map_err(|e| e.context(path.to_owned()))
}
