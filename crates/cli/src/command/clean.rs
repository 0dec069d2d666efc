//! `lodsmith clean`: repairs meshes, writes them, and reports what was done.

use lodsmith_asset::{CleanOutcome, clean, clean_counts};

use super::batch;
use crate::args::CleanArgs;
use crate::numbers::{grouped, seconds};
use crate::output::Output;
use crate::sizes;
use crate::status::Status;
use crate::warnings::show_warnings;

/// Cleans every input.
pub(super) fn run(args: &CleanArgs) -> anyhow::Result<Status> {
    let (options, reading) = (args.options(), args.reading.options());
    batch::run(
        &args.wanted(),
        &args.run,
        |file, job| Ok(clean(&file.source, &reading, &options, file.output.as_ref(), job)?),
        |out, path, done, file| {
            out.object(&done.to_json(path, file.output.as_ref(), args.dry_run));
            show(out, path, done, args.ending.strict)
        },
    )
}

/// Prints the outcome of one input. Returns the status that it alone would end with.
fn show(out: &Output, path: &str, done: &CleanOutcome, strict: bool) -> Status {
    for line in table(done, path) {
        out.line(&line);
    }
    let details = sizes::line(done.sizes_before, done.written.sizes).into_iter();
    for line in details.chain(done.written.packed.as_ref().map(sizes::packed_line)) {
        out.detail(&line);
    }
    for (name, r) in done.meshes.iter().filter(|_| done.meshes.len() > 1) {
        out.detail(&format!("  mesh {name}: {} → {} faces", grouped(r.input_faces), grouped(r.faces)));
    }
    match show_warnings(out, path, &done.warnings, strict) {
        true => Status::Strict,
        false => Status::Done,
    }
}

/// Returns a summary line, and a line for each step that changed something.
fn table(outcome: &CleanOutcome, path: &str) -> Vec<String> {
    let r = &outcome.report;
    let mut lines = vec![format!(
        "{path}: {} → {} faces, {} → {} vertices, {}",
        grouped(r.input_faces),
        grouped(r.faces),
        grouped(r.input_vertices),
        grouped(r.vertices),
        seconds(outcome.clock.total())
    )];
    let (done, left) = clean_counts(r);
    let mut rows = |title: &str, counts: &[(&str, usize)]| {
        let texts: Vec<String> = counts
            .iter()
            .filter(|c| c.1 > 0)
            .map(|(name, n)| format!("{} {}", grouped(*n), name.replace('_', " ")))
            .collect();
        if !texts.is_empty() {
            lines.push(format!("  {title:<6}{}", texts.join(", ")));
        }
    };
    rows("done", &done);
    rows("left", &left);
    lines
}
