//! `lodsmith bake`: bakes the detail of one model into textures of another.

use std::time::Instant;

use lodsmith_io::Warning;
use serde_json::json;

use crate::args::BakeCommandArgs;
use crate::baking::{self, BakedScene};
use crate::file::{self, Destination, Input};
use crate::images;
use crate::in_order;
use crate::numbers::{counted, seconds};
use crate::output::Output;
use crate::paths::{self, Sink};
use crate::progress::Progress;
use crate::run_control::RunControl;
use crate::status::{Status, usage};
use crate::warnings::{show_warnings, texts};

/// Reads both models, bakes, and writes the lighter one with its maps.
pub(super) fn run(args: &BakeCommandArgs) -> anyhow::Result<Status> {
    let writing = &args.writing;
    let format = paths::format_of(&args.output, writing.to)?;
    paths::refuse_folder(&args.output, "")?;
    paths::at_most_one_stdin([&args.high, &args.low])?;
    paths::refuse_inputs(&args.output, [&args.high, &args.low], writing.force)?;
    baking::refuse_streams(&args.output, &args.maps, &args.texture)?;
    if args.json && args.output == Sink::Stdout {
        return Err(usage("the mesh and --json both want standard output: give the mesh a file"));
    }
    if writing.scale.is_some() || writing.up.is_some() {
        return Err(usage("bake keeps the coordinates of LOW: use `lodsmith convert` for --scale and --up"));
    }
    let out = Output::new(&args.run, args.json, args.output == Sink::Stdout);
    let progress = Progress::new(1, args.run.quiet);
    let path = args.low.to_string();
    let begin = Instant::now();
    let to = Destination { sink: args.output.clone(), format, writing: *writing, dry_run: false };
    let pool = in_order::pool(args.run.threads())?;
    let done = pool.install(|| bake_one(args, &to, &progress, &path));
    progress.finish();
    let (baked, faces) = done.map_err(|e: anyhow::Error| e.context(path.clone()))?;
    let is_lossy = show_warnings(&out, &path, &baked.warnings, args.strict);
    let elapsed = begin.elapsed().as_secs_f64();
    out.line(&format!(
        "{} → {}: {} of {}, {}",
        args.high,
        args.output,
        baked.summary,
        counted(faces, "face", "faces"),
        seconds(elapsed)
    ));
    let mut report = json!({
        "high": args.high.to_string(),
        "low": path,
        "output": args.output.to_string(),
        "seconds": elapsed,
        "warnings": texts(&baked.warnings),
    });
    report["baked"] = baked.report;
    out.object(&report);
    out.finish(if is_lossy { Status::Strict } else { Status::Done })
}

fn bake_one(
    args: &BakeCommandArgs,
    to: &Destination,
    progress: &Progress,
    path: &str,
) -> anyhow::Result<(BakedScene, usize)> {
    let bar = progress.file(path);
    let mut watch = RunControl::new(&bar, args.run.time_limit);
    watch.read();
    let high = file::read_model(&args.high, &args.reading).map_err(|e| e.context(args.high.to_string()))?;
    let (mut scene, mut warnings) = match file::read_input(&args.low, &args.reading, Vec::new(), true)? {
        Input::Scene(scene) => (*scene, Vec::new()),
        Input::Mesh(loaded) => to.as_scene(&loaded.mesh, loaded.regions)?,
    };
    let low = baking::model_of(&scene);
    watch.prepare();
    let options = args.texture.options(&args.maps);
    let mut baked =
        baking::bake_scene(&high.model, &low.model, &mut scene, &options, &args.texture, &mut watch)?;
    watch.write();
    lodsmith_bake::set_materials(&mut scene, &baked.materials);
    scene.drop_unused_materials();
    let images = images::FolderMove::new(&args.low, &to.sink);
    let of_bake: Vec<Warning> = std::mem::take(&mut baked.warnings);
    warnings.extend(scene.warnings().iter().cloned());
    warnings.extend(of_bake);
    warnings.extend(images.bring(&mut scene, to.format, to.writing.textures));
    warnings.extend(baking::write_baked(to, &scene, &baked.replaced, &|uri| images.uri(uri))?.warnings);
    baking::forgive_colors(&mut warnings, baked.has_color);
    baking::write_files(&baked.files, "", to)?;
    baked.warnings = warnings;
    let faces = baked.replaced.iter().flatten().map(|m| m.face_count()).sum();
    Ok((baked, faces))
}
