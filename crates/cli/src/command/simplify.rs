//! `lodsmith simplify`: reads, simplifies, writes, and reports the result.

use std::time::{Duration, Instant};

use lodsmith::core::TriMesh;
use lodsmith::{MeshCounts, Report, Simplified, SimplifiedScene};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, Loaded, Textures, Warning};
use serde_json::{Map, Value, json};

use super::batch;
use crate::args::SimplifyArgs;
use crate::exit;
use crate::file::{self, Input};
use crate::in_order::Turn;
use crate::normals::set_normals;
use crate::numbers::{counted, grouped, micros, seconds, short};
use crate::orient::orient;
use crate::output::Output;
use crate::paths::Sink;
use crate::plan::Job;
use crate::progress::Progress;
use crate::report_json::{error_json, mesh_json};
use crate::run_control::{RunControl, StageClock, not_interrupted};
use crate::scene_parts::{self, parts_of};
use crate::status::{Interrupted, Status, usage};
use crate::warnings::{not_reached, refusals, show_not_reached, show_warnings, texts, warnings_of};
use crate::{constraints, images, memory, memory_need, palettes, proposals};

/// Simplifies every input.
pub(super) fn run(args: &SimplifyArgs) -> anyhow::Result<Status> {
    if !args.has_end() {
        return Err(usage(
            "a target is needed: --faces, --vertices, --ratio, --error, or what the method ends by",
        ));
    }
    batch::run(
        &args.wanted(),
        &args.run,
        |job, progress, turn| simplify_one(job, args, progress, turn),
        |out, path, outcome, job| show(out, path, outcome, job, args),
    )
}

/// Outcome of one input.
struct SimplifyOutcome {
    input_format: Format,
    report: Report,
    /// The reason why the target was not reached.
    not_reached: Option<String>,
    warnings: Vec<Warning>,
    /// For a scene that was written as a scene, its meshes by name.
    meshes: Vec<(String, MeshCounts)>,
    threads: usize,
    clock: StageClock,
}

/// Report data of a result.
struct ReportData {
    report: Report,
    not_reached: Option<String>,
    warnings: Vec<Warning>,
    meshes: Vec<(String, MeshCounts)>,
}

fn simplify_one(
    job: &Job,
    args: &SimplifyArgs,
    progress: &Progress,
    turn: &Turn<'_>,
) -> anyhow::Result<SimplifyOutcome> {
    if exit::interrupted() {
        return Err(Interrupted.into());
    }
    let name = job.source.to_string();
    let bar = progress.file(&name);
    let mut clock = StageClock::new();
    let deadline = args.run.time_limit.map(|s| Instant::now() + Duration::from_secs_f64(s));

    bar.read();
    clock.enter("read");
    // A scene is kept if both formats support one. Rotating or scaling it would need changes of its nodes.
    let whole = job.output.as_ref().filter(|(_, format)| {
        matches!(format, Format::Gltf | Format::Glb)
            && args.writing.scale.is_none()
            && args.writing.up.is_none()
    });
    let done = |mut clock: StageClock, input_format, told: ReportData| {
        clock.end();
        bar.end();
        let ReportData { report, not_reached, warnings, meshes } = told;
        SimplifyOutcome {
            input_format,
            report,
            not_reached,
            warnings,
            meshes,
            threads: rayon::current_num_threads(),
            clock,
        }
    };
    let loaded = match whole {
        None => {
            Box::new(file::read_with(&job.source, &args.reading, constraints::properties(&args.engine.how))?)
        }
        Some((sink, format)) => {
            match file::read_scene(&job.source, &args.reading, constraints::properties(&args.engine.how))? {
                Input::Mesh(loaded) => loaded,
                Input::Scene(scene) => {
                    let from = scene.format();
                    let mut watch = RunControl::new(&mut clock, &bar, deadline);
                    let told = simplify_scene(*scene, job, (sink, *format), args, &mut watch)?;
                    return Ok(done(clock, from, told));
                }
            }
        }
    };
    let from = loaded.format;
    let told = simplify_mesh(*loaded, job, args, &mut RunControl::new(&mut clock, &bar, deadline), turn)?;
    Ok(done(clock, from, told))
}

/// Simplifies a mesh and writes it. Returns the report data.
fn simplify_mesh(
    loaded: Loaded,
    job: &Job,
    args: &SimplifyArgs,
    watch: &mut RunControl<'_>,
    turn: &Turn<'_>,
) -> anyhow::Result<ReportData> {
    let mut options = args.options();
    constraints::of_mesh(&args.engine.how, &loaded, &mut options)?;
    options.textures = palettes::of_mesh(&loaded);
    let Loaded { mut mesh, regions, contents, mut warnings, format: from, .. } = loaded;
    let carries = |to: Format| matches!(to, Format::Obj | Format::Gltf | Format::Glb);
    let is_wanted = !matches!(args.writing.textures, Textures::None);
    let is_kept = is_wanted && job.output.as_ref().is_some_and(|(_, to)| carries(*to));
    if matches!(from, Format::Gltf | Format::Glb) && !is_kept {
        // If materials are not written, their borders need not be preserved.
        mesh.set_regions(None)?;
    }
    if args.engine.is_per_mesh() && contents.meshes > 1 {
        let text = "--per-mesh: the meshes become one on this way, and share the target";
        warnings.push(Warning::note(text));
    }
    memory::check("simplify", memory_need::simplify(&mesh, &options))?;
    let done = lodsmith::simplify(&mesh, &options, watch);
    let Simplified { mesh: mut lighter, report } = not_interrupted(done)?;
    drop(mesh);
    let not_reached = not_reached(&report, &options, args.run.time_limit, [&lighter]);
    warnings.extend(warnings_of(&report));

    watch.write();
    orient(&mut lighter, &args.writing);
    set_normals(&mut lighter, args.normals)?;
    if let Some((sink, format)) = &job.output {
        // If two textures have one name, that of the earlier input keeps it.
        if *format == Format::Obj && !regions.libraries().is_empty() && !args.dry_run {
            turn.wait();
        }
        let options = file::options(&args.writing, *format, regions);
        warnings.extend(match args.dry_run {
            true => file::losses(&lighter, sink, *format, &options)?,
            false => file::write(&lighter, sink, *format, &options)?,
        });
    }
    Ok(ReportData { report, not_reached, warnings, meshes: Vec::new() })
}

/// Simplifies all meshes of a scene under one budget; the rest of the scene is not changed.
fn simplify_scene(
    mut scene: Scene,
    job: &Job,
    (sink, format): (&Sink, Format),
    args: &SimplifyArgs,
    watch: &mut RunControl<'_>,
) -> anyhow::Result<ReportData> {
    let meshes = scene.meshes().to_vec();
    let (taken, parts) = parts_of(&meshes);
    let diagonal = scene.bounds().map_or(0.0, |b| b.diagonal());
    let mut options = args.options();
    constraints::of_scene(&args.engine.how, &scene, &taken, &mut options)?;
    options.textures = palettes::of_scene(&scene, &taken);
    memory::check("simplify", memory_need::simplify_scene(&meshes, scene.buffer_bytes(), &options))?;
    let done = lodsmith::simplify_scene(&parts, diagonal, &options, watch);
    let SimplifiedScene { meshes: mut lighter, mut report, mut counts } = not_interrupted(done)?;
    // As in the file: the reader merges vertices at one place.
    report.input_vertices = scene_parts::count(&parts, TriMesh::wedge_count);
    for (counts, part) in counts.iter_mut().zip(&parts) {
        counts.input_vertices = part.mesh.wedge_count();
    }
    let not_reached = not_reached(&report, &options, args.run.time_limit, &lighter);

    watch.write();
    for mesh in &mut lighter {
        set_normals(mesh, args.normals)?;
    }
    let mut replaced = vec![None; meshes.len()];
    for (&i, mesh) in taken.iter().zip(lighter) {
        // A mesh without faces in the input is not changed.
        replaced[i] = (meshes[i].mesh.face_count() > 0).then_some(mesh);
    }
    let images = images::FolderMove::new(&job.source, sink);
    let mut warnings: Vec<_> = scene.warnings().to_vec();
    warnings.extend(warnings_of(&report));
    warnings.extend(images.bring(&mut scene, format, args.writing.textures));
    let relink = |uri: &str| images.uri(uri);
    warnings.extend(match args.dry_run {
        true => file::scene_losses(&scene, &replaced, &relink, format)?,
        false => file::write_scene(&scene, &replaced, &relink, sink, format, &args.writing)?,
    });
    let meshes = taken.iter().map(|&i| meshes[i].name.clone()).zip(counts).collect();
    Ok(ReportData { report, not_reached, warnings, meshes })
}

/// Prints the outcome of one input. Returns the status that it alone would end with.
fn show(
    out: &Output,
    path: &str,
    outcome: anyhow::Result<SimplifyOutcome>,
    job: &Job,
    args: &SimplifyArgs,
) -> Status {
    let done = match outcome {
        Ok(done) => done,
        Err(e) => return out.failure(path, &e),
    };
    out.object(&done.to_json(path, job, args));
    out.line(&done.line(path));
    for line in done.details() {
        out.detail(&line);
    }
    let mut is_fault = show_warnings(out, path, &done.warnings, args.ending.strict);
    if let Some(why) = &done.not_reached {
        is_fault |= show_not_reached(out, path, why, args.ending.strict);
    }
    if is_fault { Status::Strict } else { Status::Done }
}

impl SimplifyOutcome {
    /// Returns the summary line.
    fn line(&self, path: &str) -> String {
        let r = &self.report;
        let percent = 100.0 * r.faces as f64 / r.input_faces.max(1) as f64;
        let share = |d: f64| short(if r.error.diagonal > 0.0 { 100.0 * d / r.error.diagonal } else { 0.0 });
        let error = match &r.error.measured {
            None => format!("rms {} %", share(r.error.estimate)),
            Some(m) => format!("rms {} %, max {} %", share(m.rms.symmetric), share(m.hausdorff.symmetric)),
        };
        let error = match r.error.bound {
            Some(bound) => format!("{error} (proven: {} %)", share(bound)),
            None => error,
        };
        format!(
            "{path}: {} → {} faces ({percent:.1} %), {error} of the diagonal, {}",
            grouped(r.input_faces),
            grouped(r.faces),
            seconds(self.clock.total())
        )
    }

    /// Returns the details for `-v`.
    fn details(&self) -> Vec<String> {
        let r = &self.report;
        let times: Vec<String> =
            self.clock.stages.iter().map(|(name, secs)| format!("{name} {secs:.3} s")).collect();
        let mut lines =
            vec![format!("  {}, {}", times.join(", "), counted(self.threads, "thread", "threads"))];
        let refusals = refusals(r);
        if !refusals.is_empty() {
            lines.push(format!("  refused: {refusals}"));
        }
        let mended: Vec<String> = cleanup(r)
            .into_iter()
            .filter(|(_, n)| *n > 0)
            .map(|(name, n)| format!("{name} {}", grouped(n)))
            .collect();
        if !mended.is_empty() {
            lines.push(format!("  mended first: {}", mended.join(", ").replace('_', " ")));
        }
        if r.locked_vertices > 0 {
            let faces = counted(r.locked_faces, "face", "faces");
            lines.push(format!("  locked: {}, {faces}", counted(r.locked_vertices, "vertex", "vertices")));
        }
        if r.parts_removed > 0 {
            lines.push(format!("  {} removed whole", counted(r.parts_removed, "part", "parts")));
        }
        if r.necks_cut > 0 {
            lines.push(format!("  {} cut", counted(r.necks_cut, "neck", "necks")));
        }
        if r.pairs_contracted > 0 {
            lines.push(format!("  {} contracted", counted(r.pairs_contracted, "pair", "pairs")));
        }
        if let Some(c) = r.clustered.filter(|c| c.cell > 0.0) {
            let faces = counted(c.faces, "face", "faces");
            let edges = counted(c.non_manifold_edges, "edge", "edges");
            lines
                .push(format!("  {faces} by cells of {}; {edges} with more than two of them", short(c.cell)));
        }
        if r.pruned.parts > 0 {
            let parts = counted(r.pruned.parts, "small part", "small parts");
            lines.push(format!("  {parts} pruned first, of {}", counted(r.pruned.faces, "face", "faces")));
        }
        if self.meshes.len() > 1 {
            lines.extend(self.meshes.iter().map(|(name, m)| {
                let times = counted(m.instances, "instance", "instances");
                format!("  {name}: {} → {} faces, {times}", grouped(m.input_faces), grouped(m.faces))
            }));
        }
        lines
    }

    /// Returns the report as JSON.
    fn to_json(&self, path: &str, job: &Job, args: &SimplifyArgs) -> Value {
        let r = &self.report;
        let (out_path, out_format) = match &job.output {
            Some((sink, format)) => (Some(sink.to_string()), Some(format.name())),
            None => (None, None),
        };
        let count = |(name, n): (&str, Value)| (name.to_owned(), n);
        let refusals: Map<_, _> = r.refusals.iter().map(|(r, n)| count((r.name(), (*n).into()))).collect();
        let seconds: Map<_, _> =
            self.clock.stages.iter().map(|(name, s)| count((name, micros(*s).into()))).collect();
        let cleanup: Map<_, _> = cleanup(r).into_iter().map(|(name, n)| count((name, n.into()))).collect();
        let mut report = json!({
            "input": {
                "path": path, "format": self.input_format.name(),
                "faces": r.input_faces, "vertices": r.input_vertices,
            },
            "output": { "path": out_path, "format": out_format, "faces": r.faces, "vertices": r.vertices },
            "method": args.options().method.name(),
            "target": args.target.to_json(),
            "reached": r.reached,
            "stopped_by": r.stopped_by.name(),
            "error": error_json(r),
            "refusals": refusals,
            "warnings": texts(&self.warnings),
            "threads": self.threads,
            "seconds": seconds,
            "collapses": r.collapses,
            "parts_removed": r.parts_removed,
            "necks_cut": r.necks_cut,
            "pairs_contracted": r.pairs_contracted,
            "pruned": { "parts": r.pruned.parts, "faces": r.pruned.faces },
            "seams_relaxed": r.seams_relaxed,
            "sharp_relaxed": r.sharp_relaxed,
            "proposals": proposals::to_json(r, &args.options()),
            "escalated": proposals::steps_json(r),
            "cleanup": cleanup,
        });
        if !self.meshes.is_empty() {
            report["meshes"] = self.meshes.iter().map(mesh_json).collect();
        }
        if let Some(c) = &r.clustered {
            report["clustered"] = json!({
                "cell": c.cell, "faces": c.faces, "vertices": c.vertices, "non_manifold_edges": c.non_manifold_edges,
            });
        }
        if !args.engine.how.lock.is_empty() {
            report["locked"] = json!({ "vertices": r.locked_vertices, "faces": r.locked_faces });
        }
        if args.dry_run {
            report["dry_run"] = true.into();
        }
        report
    }
}

fn cleanup(report: &Report) -> [(&'static str, usize); 5] {
    let c = &report.cleanup;
    [
        ("welded_vertices", c.welded_vertices),
        ("degenerate_faces", c.degenerate_faces),
        ("duplicate_faces", c.duplicate_faces),
        ("non_finite_faces", c.non_finite_faces),
        ("unused_vertices", c.unused_vertices),
    ]
}
