//! `lodsmith convert`: converts to another format without loss where the format permits.

use std::time::Instant;

use serde_json::json;

use crate::args::ConvertArgs;
use crate::file::{self, Destination, Input};
use crate::images;
use crate::in_order;
use crate::numbers::{counted, micros, seconds};
use crate::orient::orient;
use crate::output::Output;
use crate::paths::{self, Sink};
use crate::progress::Progress;
use crate::sizes;
use crate::status::{Status, usage};
use crate::warnings::{show_warnings, texts};

/// Reads, rotates or scales if asked for, and writes.
pub(super) fn run(args: &ConvertArgs) -> anyhow::Result<Status> {
    let writing = &args.writing;
    let format = paths::format_of(&args.output, writing.to)?;
    paths::refuse_folder(&args.output, "")?;
    paths::refuse_inputs(&args.output, [&args.input], writing.force)?;
    if args.json && args.output == Sink::Stdout {
        return Err(usage("the mesh and --json both want standard output: give the mesh a file"));
    }
    let out = Output::new(&args.run, args.json, args.output == Sink::Stdout);
    let progress = Progress::new(1, args.run.quiet);
    let path = args.input.to_string();
    let begin = Instant::now();
    let to = Destination { sink: args.output.clone(), format, writing: *writing, dry_run: false };
    let converted = in_order::pool(args.run.threads())?.install(|| {
        let bar = progress.file(&path);
        bar.read();
        let input = file::read_input(&args.input, &args.reading, Vec::new(), to.keeps_scenes())?;
        bar.write();
        let before = match &input {
            Input::Mesh(loaded) => sizes::of_loaded(loaded),
            Input::Scene(scene) => scene.sizes(),
        };
        let before = sizes::of_input(&args.input, &args.reading, before);
        match input {
            Input::Mesh(mut loaded) => {
                orient(&mut loaded.mesh, writing);
                let mut made = to.write(&loaded.mesh, std::mem::take(&mut loaded.regions))?;
                made.warnings.splice(0..0, loaded.warnings);
                Ok((loaded.mesh.face_count(), loaded.format, before, made))
            }
            Input::Scene(mut scene) => {
                let images = images::FolderMove::new(&args.input, &args.output);
                let mut warnings = images.bring(&mut scene, format, writing.textures);
                let relink = |uri: &str| images.uri(uri);
                warnings.splice(0..0, scene.warnings().iter().cloned());
                let mut made = to.write_scene(&scene, &[], &relink)?;
                made.warnings.splice(0..0, warnings);
                Ok((scene.contents().polygons, scene.format(), before, made))
            }
        }
    });
    progress.finish();
    let (faces, from, before, made) = converted.map_err(|e: anyhow::Error| e.context(path.clone()))?;
    let mut report = json!({
        "input": { "path": path, "format": from.name(), "faces": faces, "sizes": sizes::to_json(before) },
        "output": {
            "path": args.output.to_string(), "format": format.name(), "sizes": sizes::to_json(made.sizes),
        },
        "warnings": texts(&made.warnings),
        "seconds": micros(begin.elapsed().as_secs_f64()),
    });
    if let Some(packed) = &made.packed {
        report["output"]["packing"] = sizes::packed_json(packed);
    }
    out.object(&report);
    let is_lossy = show_warnings(&out, &path, &made.warnings, args.strict);
    out.line(&format!(
        "{path} → {}: {}, {} → {}, {}",
        args.output,
        counted(faces, "face", "faces"),
        from.name(),
        format.name(),
        seconds(begin.elapsed().as_secs_f64())
    ));
    if let Some(line) = sizes::line(before, made.sizes) {
        out.line(&line);
    }
    if let Some(packed) = &made.packed {
        out.detail(&sizes::packed_line(packed));
    }
    out.finish(if is_lossy { Status::Strict } else { Status::Done })
}
