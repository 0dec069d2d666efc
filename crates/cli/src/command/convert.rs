//! `lodsmith convert`: converts to another format without loss where the format permits.

use std::time::Instant;

use crate::args::ConvertArgs;
use crate::file::{self, Destination, Input};
use crate::images;
use crate::in_order;
use crate::numbers::{counted, seconds};
use crate::orient::orient;
use crate::output::Output;
use crate::paths::{self, Sink};
use crate::progress::Progress;
use crate::status::Status;
use crate::warnings::show_warnings;

/// Reads, rotates or scales if asked for, and writes.
pub(super) fn run(args: &ConvertArgs) -> anyhow::Result<Status> {
    let writing = &args.writing;
    let format = paths::format_of(&args.output, writing.to)?;
    paths::refuse_folder(&args.output, "")?;
    paths::refuse_inputs(&args.output, [&args.input], writing.force)?;
    let out = Output::new(&args.run, false, args.output == Sink::Stdout);
    let progress = Progress::new(1, args.run.quiet);
    let path = args.input.to_string();
    let begin = Instant::now();
    let to = Destination { sink: args.output.clone(), format, writing: *writing, dry_run: false };
    let converted = in_order::pool(args.run.threads())?.install(|| {
        let bar = progress.file(&path);
        bar.read();
        let input = file::read_input(&args.input, &args.reading, Vec::new(), to.keeps_scenes())?;
        bar.write();
        match input {
            Input::Mesh(mut loaded) => {
                orient(&mut loaded.mesh, writing);
                let lost = to.write(&loaded.mesh, std::mem::take(&mut loaded.regions))?;
                loaded.warnings.extend(lost);
                Ok((loaded.mesh.face_count(), loaded.format, loaded.warnings))
            }
            Input::Scene(mut scene) => {
                let images = images::FolderMove::new(&args.input, &args.output);
                let mut warnings = images.bring(&mut scene, format, writing.textures);
                let relink = |uri: &str| images.uri(uri);
                warnings.splice(0..0, scene.warnings().iter().cloned());
                warnings.extend(to.write_scene(&scene, &[], &relink)?);
                Ok((scene.contents().polygons, scene.format(), warnings))
            }
        }
    });
    progress.finish();
    let (faces, from, warnings) = converted.map_err(|e: anyhow::Error| e.context(path.clone()))?;
    let is_lossy = show_warnings(&out, &path, &warnings, args.strict);
    out.line(&format!(
        "{path} → {}: {}, {} → {}, {}",
        args.output,
        counted(faces, "face", "faces"),
        from.name(),
        format.name(),
        seconds(begin.elapsed().as_secs_f64())
    ));
    out.finish(if is_lossy { Status::Strict } else { Status::Done })
}
