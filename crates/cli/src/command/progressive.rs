//! `lodsmith progressive`: writes and reads files with all levels of a mesh.

use std::time::Instant;

use lodsmith::core::Splits;
use lodsmith::{Control, Input, Progressive};
use lodsmith_asset::memory_need::{self, Size};
use lodsmith_asset::report_json::measured_json;
use lodsmith_asset::warnings::texts;
use lodsmith_asset::{Destination, Job, Sink, Step, constraints, orient, paths};
use lodsmith_io::lpm::LpmSizes;
use lodsmith_io::{Format, Warning};
use serde_json::{Map, Value, json};

use crate::args::{self, ExtractArgs, LpmBuildArgs, LpmInfoArgs};
use crate::file;
use crate::numbers::{counted, grouped, micros, seconds, short};
use crate::output::Output;
use crate::progress::Progress;
use crate::run_control::{BarWatch, not_interrupted};
use crate::status::{Status, usage};
use crate::warnings::{show_not_reached, show_warnings};
use crate::{in_order, memory};

/// Runs the subcommand.
pub(super) fn run(action: &args::Progressive) -> anyhow::Result<Status> {
    match action {
        args::Progressive::Build(args) => build(args),
        args::Progressive::Extract(args) => extract(args),
        args::Progressive::Info(args) => info(args),
    }
}

fn build(args: &LpmBuildArgs) -> anyhow::Result<Status> {
    paths::refuse_folder(&args.output, "")?;
    paths::refuse_inputs(&args.output, [&args.input], args.force)?;
    let hint = match &args.output {
        Sink::Path(path) => lodsmith_io::sniff::hint_of(path),
        Sink::Stream => None,
    };
    if let Some(other) = hint.filter(|&f| f != Format::Lpm) {
        let text = format!("{}: the extension means {}, but the file is LPM", args.output, other.title());
        return Err(usage(text));
    }
    let is_taken = args.output == Sink::Stream;
    if is_taken && args.ending.json {
        return Err(usage("standard output cannot have both the file and --json: write to a file"));
    }
    let requested = args.options()?;
    let out = Output::new(args.run.loudness, args.ending.json, is_taken);
    let progress = Progress::new(1, args.run.loudness.quiet);
    let path = args.input.to_string();
    let start = Instant::now();
    let built = in_order::pool(args.run.threads())?.install(|| {
        let bar = progress.file(&path);
        let mut watch = BarWatch::new(&bar);
        let mut job = Job::new(&mut watch, None, memory::limit());
        job.enter(Step::Read);
        let names = args.engine.names.clone();
        let loaded = file::read_with(&args.input, &args.reading, constraints::properties(&names))?;
        let mut options = requested.clone();
        // Measured afterwards, like the levels of `extract`.
        let limit = options.stop.error.take();
        let data = constraints::of_mesh(&names, &loaded)?;
        let mut warnings = loaded.warnings;
        if loaded.format.is_scene() && loaded.contents.meshes > 1 {
            warnings.push(Warning::lost("all meshes of the scene were merged: nodes are not kept"));
        }
        job.enter(Step::Prepare);
        memory::check("progressive build", memory_need::progressive(Size::of(&loaded.mesh), &options))?;
        let input = Input::new(&loaded.mesh).with(data.view());
        let mut levels = not_interrupted(Progressive::build(&input, &options, &mut job))?;
        if let Some(limit) = limit {
            let diagonal = levels.positions().bounds().map_or(0.0, |b| b.diagonal());
            let found = levels.level_of_deviation(limit.in_units(diagonal), true, &mut job);
            levels = levels.without_below(not_interrupted(found)?);
        }
        job.enter(Step::Write);
        let splits = levels.into_splits();
        let written = file::write_lpm(&splits, &loaded.regions, &args.output, &args.writing(), &mut job)?;
        warnings.extend(written.warnings.iter().cloned());
        Ok((splits, loaded.format, written.sizes, warnings, job.times()))
    });
    progress.finish();
    let (splits, from, sizes, warnings, clock) = built.map_err(|e: anyhow::Error| e.context(path.clone()))?;
    let (base, full) = ends(&splits);
    let mut report = json!({
        "input": { "path": path, "format": from.name(), "faces": full[0], "vertices": full[1] },
        "output": { "path": args.output.to_string(), "format": "lpm", "bytes": sizes.total() },
        "method": requested.method.kind().name(),
        "target": lodsmith_asset::report_json::target(&args.target.stop()),
    });
    merge(&mut report, describe(&splits, &sizes, args.bits));
    report["warnings"] = texts(&warnings).into();
    report["threads"] = args.run.threads().into();
    let seconds_of = |(name, s): &(&str, f64)| ((*name).to_owned(), Value::from(micros(*s)));
    report["seconds"] = Value::Object(clock.stages.iter().map(seconds_of).collect::<Map<_, _>>());
    out.object(&report);
    out.line(&format!(
        "{path} → {}: {} ↔ {}, {}, {}",
        args.output,
        grouped(base[0]),
        counted(full[0], "face", "faces"),
        bytes_text(&splits, &sizes),
        seconds(start.elapsed().as_secs_f64())
    ));
    let is_lossy = show_warnings(&out, &path, &warnings, args.ending.strict);
    out.finish(if is_lossy { Status::Strict } else { Status::Done })
}

fn extract(args: &ExtractArgs) -> anyhow::Result<Status> {
    let format = paths::format_of(&args.output, args.writing.to)?;
    paths::refuse_folder(&args.output, "")?;
    paths::refuse_inputs(&args.output, [&args.input], args.writing.writing.force)?;
    let is_taken = args.output == Sink::Stream;
    if is_taken && args.ending.json {
        return Err(usage("standard output cannot have both the mesh and --json: write the mesh to a file"));
    }
    let out = Output::new(args.run.loudness, args.ending.json, is_taken);
    let progress = Progress::new(1, args.run.loudness.quiet);
    let path = args.input.to_string();
    let start = Instant::now();
    let extracted = in_order::pool(args.run.threads())?.install(|| {
        let bar = progress.file(&path);
        bar.read();
        let lpm = file::read_lpm(&args.input)?;
        let full = lpm.announced.1.faces as usize;
        let diagonal = lpm.splits.positions.view().bounds().map_or(0.0, |b| b.diagonal());
        memory::check("progressive extract", memory_need::extract(&lpm.splits))?;
        let mut levels = Progressive::new(lpm.splits);
        let is_reached = go_to(&mut levels, args, full, diagonal, &mut BarWatch::new(&bar))?;
        let measured = match args.stop().error {
            Some(_) => levels.deviation(!args.no_fit)?,
            None => None,
        };
        let mut mesh = if args.no_fit { levels.mesh() } else { levels.fitted_mesh() }?;
        let counts = [mesh.face_count(), mesh.vertex_count()];
        bar.write();
        let writing = args.writing.writing;
        orient(&mut mesh, &writing);
        let mut warnings = lpm.warnings;
        if !lpm.is_complete && args.stop().error.is_some() {
            let text = "--error is measured from the finest level in this incomplete file";
            warnings.push(Warning::note(text));
        }
        let to = Destination { sink: args.output.clone(), format, writing, dry_run: false };
        warnings.extend(file::writer(|job| to.write(&mesh, lpm.regions, job))?.warnings);
        Ok((levels, counts, full, (is_reached, measured), warnings))
    });
    progress.finish();
    let (levels, [faces, vertices], full, (is_reached, measured), warnings) =
        extracted.map_err(|e: anyhow::Error| e.context(path.clone()))?;
    let secs = start.elapsed().as_secs_f64();
    out.object(&json!({
        "input": { "path": path, "format": "lpm", "faces": full, "levels": levels.levels() },
        "output": {
            "path": args.output.to_string(), "format": format.name(), "faces": faces, "vertices": vertices,
        },
        "target": args.target_json(),
        "reached": is_reached,
        "level": levels.level(),
        "error": {
            "estimate": levels.error(), "measured": measured.as_ref().map(measured_json), "unit": "model",
        },
        "warnings": texts(&warnings),
        "seconds": micros(secs),
    }));
    let error = match &measured {
        Some(m) => format!("rms {}, max {}", short(m.rms.symmetric), short(m.hausdorff.symmetric)),
        None => format!("rms about {}", short(levels.error())),
    };
    out.line(&format!(
        "{path} → {}: level {} of {}, {} of {} faces, {error}, {}",
        args.output,
        grouped(levels.level()),
        grouped(levels.top()),
        grouped(faces),
        grouped(full),
        seconds(secs)
    ));
    let mut is_fault = show_warnings(&out, &path, &warnings, args.ending.strict);
    if !is_reached {
        let why = format!("target not reached, the base has {}", counted(faces, "face", "faces"));
        is_fault |= show_not_reached(&out, &path, &why, args.ending.strict);
    }
    out.finish(if is_fault { Status::Strict } else { Status::Done })
}

/// Moves to the finest level that meets one of the targets. Returns `false` if no level does.
fn go_to(
    levels: &mut Progressive,
    args: &ExtractArgs,
    full: usize,
    diagonal: f64,
    control: &mut dyn Control,
) -> anyhow::Result<bool> {
    let stop = args.stop();
    let share = stop.ratio.map(|r| (r * full as f64).round() as usize);
    let by_faces = stop.faces.into_iter().chain(share).map(|n| levels.level_of_faces(n));
    let by_vertices = stop.vertices.map(|n| levels.level_of_vertices(n));
    let by_error = match stop.error {
        Some(e) => {
            Some(not_interrupted(levels.level_of_deviation(e.in_units(diagonal), !args.no_fit, control))?)
        }
        None => None,
    };
    let Some(level) = by_faces.chain(by_vertices).chain(by_error).max() else { return Ok(true) };
    levels.to_level(level);
    let is_met = |target: Option<usize>, count: usize| target.is_some_and(|n| count <= n);
    Ok(stop.error.is_some()
        || is_met(stop.faces, levels.face_count())
        || is_met(share, levels.face_count())
        || is_met(stop.vertices, levels.vertex_count()))
}

fn info(args: &LpmInfoArgs) -> anyhow::Result<Status> {
    let out = Output::new(args.run.loudness, args.json, false);
    let path = args.input.to_string();
    let lpm = file::read_lpm(&args.input).map_err(|e| e.context(path.clone()))?;
    let (base, full) = ends(&lpm.splits);
    let layout = &lpm.splits.layout;
    let first = [(layout.has_normals, "normals"), (layout.has_uvs, "uvs"), (layout.has_colors, "colors")];
    let mut attributes: Vec<&str> = first.iter().filter(|x| x.0).map(|x| x.1).collect();
    attributes.extend(layout.further.iter().map(|f| f.0.title()));
    let mut report = json!({
        "path": path, "format": "lpm", "complete": lpm.is_complete,
        "announced": { "splits": lpm.announced.0, "faces": lpm.announced.1.faces },
    });
    merge(&mut report, describe(&lpm.splits, &lpm.sizes, lpm.bits));
    report["attributes"] = attributes.clone().into();
    report["materials"] = lpm.regions.materials().len().into();
    report["warnings"] = texts(&lpm.warnings).into();
    out.object(&report);
    out.line(&format!(
        "{path}: {} ↔ {}, {}",
        grouped(base[0]),
        counted(full[0], "face", "faces"),
        bytes_text(&lpm.splits, &lpm.sizes)
    ));
    let kept = match lpm.bits {
        None => "lossless".to_owned(),
        Some(bits) => format!("positions in {bits} bits"),
    };
    let chunks = counted(lpm.sizes.chunks as usize, "chunk", "chunks");
    out.line(&format!("  {kept}; {chunks}; {}", if lpm.is_complete { "complete" } else { "incomplete" }));
    if !attributes.is_empty() {
        out.line(&format!("  attributes: {}", attributes.join(", ")));
    }
    if lpm.regions.materials().len() > 0 {
        out.line(&format!("  {}", counted(lpm.regions.materials().len(), "material", "materials")));
    }
    for c in &lpm.splits.checkpoints {
        let faces = lpm.splits.counts[c.level as usize].faces as usize;
        out.line(&format!("  {} faces: rms about {}", grouped(faces), short(c.error)));
    }
    show_warnings(&out, &path, &lpm.warnings, false);
    out.finish(Status::Done)
}

/// Returns the counts of faces and vertices of the base and of the finest level, including holes.
fn ends(splits: &Splits) -> ([usize; 2], [usize; 2]) {
    let of = |level: usize| {
        let counts = splits.counts[level];
        [counts.faces as usize, counts.vertices as usize]
    };
    (of(0), of(splits.len()))
}

fn per_split(bytes: u64, splits: &Splits) -> f64 {
    bytes as f64 / splits.len().max(1) as f64
}

fn bytes_text(splits: &Splits, sizes: &LpmSizes) -> String {
    let total = usize::try_from(sizes.total()).unwrap_or(usize::MAX);
    format!(
        "{}, {} ({:.1} for each of {} splits)",
        counted(splits.checkpoints.len(), "checkpoint", "checkpoints"),
        counted(total, "byte", "bytes"),
        per_split(sizes.splits, splits),
        grouped(splits.len())
    )
}

/// Returns the description of a file for reports.
fn describe(splits: &Splits, sizes: &LpmSizes, bits: Option<u8>) -> Value {
    let (base, full) = ends(splits);
    let checkpoint = |c: &lodsmith::core::splits::Checkpoint| {
        json!({
            "level": c.level, "faces": splits.counts[c.level as usize].faces, "error": c.error,
        })
    };
    json!({
        "bits": bits,
        "base": { "faces": base[0], "vertices": base[1] },
        "full": { "faces": full[0], "vertices": full[1] },
        "splits": splits.len(),
        "chunks": sizes.chunks,
        "bytes": {
            "total": sizes.total(), "head": sizes.head, "materials": sizes.materials, "base": sizes.base,
            "splits": sizes.splits, "checkpoints": sizes.checkpoints, "original": sizes.original,
            "per_split": per_split(sizes.splits, splits),
        },
        "checkpoints": splits.checkpoints.iter().map(checkpoint).collect::<Vec<_>>(),
    })
}

fn merge(into: &mut Value, more: Value) {
    if let (Value::Object(into), Value::Object(more)) = (into, more) {
        into.extend(more);
    }
}
