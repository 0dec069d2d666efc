//! `lodsmith convert`: converts to another format without loss where the format permits.

use lodsmith_asset::{Destination, Sink, convert, paths};

use super::batch::single;
use crate::args::ConvertArgs;
use crate::numbers::{counted, seconds};
use crate::output::Output;
use crate::sizes;
use crate::status::{Status, usage};
use crate::warnings::show_warnings;

/// Reads, rotates or scales if asked for, and writes.
pub(super) fn run(args: &ConvertArgs) -> anyhow::Result<Status> {
    let writing = args.writing.options();
    let format = paths::format_of(&args.output, args.writing.to)?;
    paths::refuse_folder(&args.output, "")?;
    paths::refuse_inputs(&args.output, [&args.input], writing.force)?;
    if args.json && args.output == Sink::Stream {
        return Err(usage("the mesh and --json both want standard output: give the mesh a file"));
    }
    let out = Output::new(&args.run, args.json, args.output == Sink::Stream);
    let path = args.input.to_string();
    let to = Destination { sink: args.output.clone(), format, writing, dry_run: false };
    let done = single(&path, &args.run, |job| Ok(convert(&args.input, &args.reading.options(), &to, job)?))?;
    out.object(&done.to_json(&path, &to));
    let is_lossy = show_warnings(&out, &path, &done.warnings, args.strict);
    out.line(&format!(
        "{path} → {}: {}, {} → {}, {}",
        args.output,
        counted(done.faces, "face", "faces"),
        done.input_format.name(),
        format.name(),
        seconds(done.clock.total())
    ));
    if let Some(line) = sizes::line(done.sizes_before, done.written.sizes) {
        out.line(&line);
    }
    if let Some(packed) = &done.written.packed {
        out.detail(&sizes::packed_line(packed));
    }
    out.finish(if is_lossy { Status::Strict } else { Status::Done })
}
