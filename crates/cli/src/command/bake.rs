//! `lodsmith bake`: bakes the detail of one model into textures of another.

use lodsmith_asset::{Baking, Destination, Sink, bake, paths};

use super::batch::single;
use crate::args::BakeCommandArgs;
use crate::numbers::{counted, seconds};
use crate::output::Output;
use crate::status::{Status, usage};
use crate::warnings::show_warnings;

/// Reads both models, bakes, and writes the lighter one with its maps.
pub(super) fn run(args: &BakeCommandArgs) -> anyhow::Result<Status> {
    let writing = args.writing.options();
    let format = paths::format_of(&args.output, args.writing.to)?;
    paths::refuse_folder(&args.output, "")?;
    paths::at_most_one_stream([&args.high, &args.low])?;
    paths::refuse_inputs(&args.output, [&args.high, &args.low], writing.force)?;
    let baking = Baking { options: args.texture.options(&args.maps), map_files: args.texture.map_files };
    baking.refuse_streams(&args.output)?;
    if args.json && args.output == Sink::Stream {
        return Err(usage("the mesh and --json both want standard output: give the mesh a file"));
    }
    if writing.moves() {
        return Err(usage("bake keeps the coordinates of LOW: use `lodsmith convert` for --scale and --up"));
    }
    let out = Output::new(&args.run, args.json, args.output == Sink::Stream);
    let path = args.low.to_string();
    let to = Destination { sink: args.output.clone(), format, writing, dry_run: false };
    let done = single(&path, &args.run, |job| {
        Ok(bake(&args.high, &args.low, &args.reading.options(), &baking, &to, job)?)
    })?;
    let is_lossy = show_warnings(&out, &path, &done.warnings, args.strict);
    out.line(&format!(
        "{} → {}: {} of {}, {}",
        args.high,
        args.output,
        done.summary,
        counted(done.faces, "face", "faces"),
        seconds(done.clock.total())
    ));
    out.object(&done.to_json(&args.high.to_string(), &path, &to));
    out.finish(if is_lossy { Status::Strict } else { Status::Done })
}
