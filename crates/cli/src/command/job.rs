//! Jobs on files: `simplify`, `lod`, `convert`, `clean`, `bake`, `info`. Several inputs are processed in parallel, each
//! with its own result.

use std::fs;

use anyhow::Context as _;
use lodsmith_asset::plan::Assignment;
use lodsmith_asset::request::{Done, Note, PlannedJob, Verb};
use lodsmith_asset::{BakeOutcome, ConvertOutcome, Destination, Sink};

use super::{clean, info, lod, simplify};
use crate::args::{JobArgs, threads};
use crate::exit;
use crate::in_order::{self, Turn};
use crate::numbers::{counted, seconds};
use crate::output::{self, Output};
use crate::progress::Progress;
use crate::run_control::BarWatch;
use crate::sizes;
use crate::status::{Interrupted, Status};

/// Does the job on every input, and shows the outcomes in the order of the inputs.
pub(super) fn run(args: &JobArgs<'_>) -> anyhow::Result<Status> {
    let request = args.request()?;
    let job = request.plan(&args.places())?;
    // (The plan of levels has created its folder.)
    if let (Some(folder), false, true) = (args.out_dir, args.options.dry_run, args.verb != Verb::Lod) {
        fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot create the folder", folder.display()))?;
    }
    let uses_stdout = |to: &Destination| to.sink == Sink::Stream && !to.dry_run;
    let is_stdout_taken = job.files.iter().any(|file| file.output.as_ref().is_some_and(uses_stdout));
    let out = Output::new(args.printing.loudness, args.printing.json, is_stdout_taken);
    let progress = Progress::new(job.files.len(), args.printing.loudness.quiet);
    let work = |file: &Assignment, turn: &Turn<'_>| {
        if exit::interrupted() {
            return Err(Interrupted.into());
        }
        let name = file.source.to_string();
        let bar = progress.file(&name);
        let mut watch = BarWatch::in_turn(&bar, turn, args.options.time_limit);
        let outcome = exit::guarded(|| Ok(job.run(file, &mut job.begin(&mut watch))?));
        bar.end();
        outcome
    };
    let mut status = Status::Done;
    in_order::process_in_order(&job.files, threads(args.options), work, |i, outcome| {
        let file_status = progress.with_bar_hidden(|| match outcome {
            Ok(done) => show(&out, args, &job, &job.files[i], &done),
            Err(e) => out.failure(&job.files[i].source.to_string(), &e),
        });
        status = status.or_worse(file_status);
    })?;
    progress.finish();
    out.finish(status)
}

/// Prints the outcome of one input. Returns the exit status for this input alone.
fn show(out: &Output, args: &JobArgs<'_>, job: &PlannedJob<'_>, file: &Assignment, done: &Done) -> Status {
    let path = file.source.to_string();
    out.object(&job.report(file, done));
    match (done, &file.output) {
        (Done::Simplify(done), _) => simplify::show(out, &path, done),
        (Done::Lod(done), _) => lod::show(out, &path, done),
        (Done::Convert(done), Some(to)) => show_converted(out, &path, to, done),
        (Done::Clean(done), _) => clean::show(out, &path, done),
        (Done::Bake(done), Some(to)) => show_baked(out, &args.inputs[0].to_string(), to, done),
        (Done::Info(done), _) => info::show(out, &path, done),
        // (`render` makes one image of all files.)
        (Done::Convert(_) | Done::Bake(_), None) | (Done::Render(_), _) => {}
    }
    let mut status = Status::Done;
    for Note { about, text, is_loss } in done.notes(&path) {
        let text = format!("{about}: {text}");
        if is_loss && args.options.strict {
            output::error(&text);
            status = Status::Strict;
        } else {
            out.warning(&text);
        }
    }
    status
}

fn show_converted(out: &Output, path: &str, to: &Destination, done: &ConvertOutcome) {
    out.line(&format!(
        "{path} → {}: {}, {} → {}, {}",
        to.sink,
        counted(done.faces, "face", "faces"),
        done.input_format.name(),
        to.format.name(),
        seconds(done.clock.total())
    ));
    sizes::line(done.sizes_before, done.written.sizes).iter().for_each(|line| out.line(line));
    done.written.packed.iter().for_each(|packed| out.detail(&sizes::packed_line(packed)));
}

fn show_baked(out: &Output, high: &str, to: &Destination, done: &BakeOutcome) {
    let (faces, time) = (counted(done.faces, "face", "faces"), seconds(done.clock.total()));
    out.line(&format!("{high} → {}: {} of {faces}, {time}", to.sink, done.summary));
}
