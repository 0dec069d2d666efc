//! Processing of several inputs, in sequence or in parallel, each with a result of its own.

use std::fs;

use anyhow::Context as _;

use crate::args::Run;
use crate::exit;
use crate::file::Destination;
use crate::in_order::{self, Turn};
use crate::output::Output;
use crate::paths::Sink;
use crate::plan::{self, Job, OutputArgs};
use crate::progress::Progress;
use crate::run_control::RunControl;
use crate::status::{Interrupted, Status};

/// Plans the outputs, processes every input and shows the outcomes, as [`run_jobs`] does.
pub(super) fn run<T: Send>(
    wanted: &OutputArgs<'_>,
    run: &Run,
    work: impl Fn(&Job, RunControl<'_>, &Turn<'_>) -> anyhow::Result<T> + Sync,
    show: impl Fn(&Output, &str, anyhow::Result<T>, &Job) -> Status,
) -> anyhow::Result<Status> {
    let jobs = plan::jobs(wanted)?;
    if let (Some(folder), false) = (wanted.out_dir, wanted.dry_run) {
        fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
    }
    run_jobs(&jobs, wanted.json, run, work, show)
}

/// Processes every input and shows the outcomes in the order of the inputs; `show` returns the status that
/// each alone would end with.
pub(super) fn run_jobs<T: Send>(
    jobs: &[Job],
    json: bool,
    run: &Run,
    work: impl Fn(&Job, RunControl<'_>, &Turn<'_>) -> anyhow::Result<T> + Sync,
    show: impl Fn(&Output, &str, anyhow::Result<T>, &Job) -> Status,
) -> anyhow::Result<Status> {
    let takes_stdout = |to: &Destination| to.sink == Sink::Stdout && !to.dry_run;
    let is_stdout_taken = jobs.iter().any(|j| j.output.as_ref().is_some_and(takes_stdout));
    let out = Output::new(run, json, is_stdout_taken);
    let progress = Progress::new(jobs.len(), run.quiet);
    let work = |job: &Job, turn: &Turn<'_>| {
        if exit::interrupted() {
            return Err(Interrupted.into());
        }
        let name = job.source.to_string();
        let bar = progress.file(&name);
        let outcome = exit::guarded(|| work(job, RunControl::new(&bar, run.time_limit), turn));
        bar.end();
        outcome
    };
    let mut status = Status::Done;
    in_order::process_in_order(jobs, run.threads(), work, |i, outcome| {
        let path = jobs[i].source.to_string();
        let own = progress.with_bar_hidden(|| show(&out, &path, outcome, &jobs[i]));
        status = status.or_worse(own);
    })?;
    progress.finish();
    out.finish(status)
}
