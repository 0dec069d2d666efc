//! Processing of several inputs, in sequence or in parallel, each with a result of its own.

use std::fs;

use anyhow::Context as _;

use crate::args::Run;
use crate::exit;
use crate::in_order::{self, Turn};
use crate::output::Output;
use crate::paths::Sink;
use crate::plan::{self, Job, OutputArgs};
use crate::progress::Progress;
use crate::status::Status;

/// Processes every input and shows the outcomes in the order of the inputs; `show` returns the status that
/// each alone would end with.
pub(super) fn run<T: Send>(
    wanted: &OutputArgs<'_>,
    run: &Run,
    work: impl Fn(&Job, &Progress, &Turn<'_>) -> anyhow::Result<T> + Sync,
    show: impl Fn(&Output, &str, anyhow::Result<T>, &Job) -> Status,
) -> anyhow::Result<Status> {
    let jobs = plan::jobs(wanted)?;
    if let (Some(folder), false) = (wanted.out_dir, wanted.dry_run) {
        fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
    }
    let is_stdout_taken = !wanted.dry_run && jobs.iter().any(|j| matches!(j.output, Some((Sink::Stdout, _))));
    let out = Output::new(run, wanted.json, is_stdout_taken);
    let progress = Progress::new(jobs.len(), run.quiet);
    let mut status = Status::Done;
    in_order::process_in_order(
        &jobs,
        run.threads(),
        |job, turn| exit::guarded(|| work(job, &progress, turn)),
        |i, outcome| {
            let path = jobs[i].source.to_string();
            let own = progress.with_bar_hidden(|| show(&out, &path, outcome, &jobs[i]));
            status = status.or_worse(own);
        },
    )?;
    progress.finish();
    out.finish(status)
}
