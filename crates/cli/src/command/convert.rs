//! `lodsmith convert`: another format, losing nothing that fits.

use std::time::Instant;

use super::show_warnings;
use crate::args::ConvertArgs;
use crate::exit::Status;
use crate::file::{self, Sink};
use crate::in_order;
use crate::numbers::{counted, seconds};
use crate::orient::orient;
use crate::output::Output;
use crate::progress::Progress;

/// Reads, turns if asked, writes.
pub(super) fn run(args: &ConvertArgs) -> anyhow::Result<Status> {
    let writing = &args.writing;
    let format = file::format_of(&args.output, writing.to)?;
    file::refuse_folder(&args.output, "")?;
    let out = Output::new(&args.run, false, args.output == Sink::Stdout);
    let progress = Progress::new(1, args.run.quiet);
    let path = args.input.to_string();
    let begin = Instant::now();
    let converted = in_order::pool(args.run.threads())?.install(|| {
        let bar = progress.file(&path);
        bar.read();
        let mut loaded = file::read(&args.input, args.from)?;
        bar.write();
        orient(&mut loaded.mesh, writing);
        let options = file::options(writing, format, std::mem::take(&mut loaded.regions));
        let lost = file::write(&loaded.mesh, &args.output, format, &options, args.force)?;
        loaded.warnings.extend(lost);
        Ok(loaded)
    });
    progress.finish();
    let loaded = converted.map_err(|e: anyhow::Error| e.context(path.clone()))?;
    let is_lossy = show_warnings(&out, &path, &loaded.warnings, args.strict);
    out.line(&format!(
        "{path} → {}: {}, {} → {}, {}",
        args.output,
        counted(loaded.mesh.face_count(), "face", "faces"),
        loaded.format.name(),
        format.name(),
        seconds(begin.elapsed().as_secs_f64())
    ));
    out.finish(if is_lossy { Status::Strict } else { Status::Done })
}
