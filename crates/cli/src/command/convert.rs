//! `lodsmith convert`: converts to another format without loss where the format permits.

use std::time::Instant;

use lodsmith_io::Format;

use crate::args::ConvertArgs;
use crate::file::{self, Input};
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
    // A scene is kept if both formats support one. Rotating or scaling it would need changes of its nodes.
    let is_whole =
        matches!(format, Format::Gltf | Format::Glb) && writing.scale.is_none() && writing.up.is_none();
    let converted = in_order::pool(args.run.threads())?.install(|| {
        let bar = progress.file(&path);
        bar.read();
        let input = if is_whole {
            file::read_scene(&args.input, &args.reading, Vec::new())?
        } else {
            Input::Mesh(Box::new(file::read(&args.input, &args.reading)?))
        };
        bar.write();
        match input {
            Input::Mesh(mut loaded) => {
                orient(&mut loaded.mesh, writing);
                let options = file::options(writing, format, std::mem::take(&mut loaded.regions));
                let lost = file::write(&loaded.mesh, &args.output, format, &options)?;
                loaded.warnings.extend(lost);
                Ok((loaded.mesh.face_count(), loaded.format, loaded.warnings))
            }
            Input::Scene(mut scene) => {
                let images = images::FolderMove::new(&args.input, &args.output);
                let mut warnings = images.bring(&mut scene, format, writing.textures);
                let relink = |uri: &str| images.uri(uri);
                warnings.splice(0..0, scene.warnings().iter().cloned());
                warnings.extend(file::write_scene(
                    &scene,
                    &[],
                    &relink,
                    &args.output,
                    format,
                    &args.writing,
                )?);
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
