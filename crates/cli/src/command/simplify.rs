//! `lodsmith simplify`: reads, simplifies, writes, and reports the result.

use std::time::{Duration, Instant};

use lodsmith::core::TriMesh;
use lodsmith::core::measure::{Comparison, TwoWay};
use lodsmith::{MeshCounts, Part, Report, Simplified, SimplifiedScene, SimplifyOptions};
use lodsmith_io::gltf::{Scene, SceneMesh};
use lodsmith_io::{Format, Loaded, Textures, Warning};
use serde_json::{Map, Value, json};

use super::{batch, show_warnings, texts};
use crate::args::{Normals, SimplifyArgs};
use crate::exit::{self, Interrupted, Status, usage};
use crate::file::{self, Input, Sink};
use crate::in_order::Turn;
use crate::numbers::{counted, grouped, micros, seconds, short};
use crate::orient::orient;
use crate::output::{self, Output};
use crate::plan::Job;
use crate::progress::Progress;
use crate::run_control::{RunControl, StageClock, not_interrupted};
use crate::{constraints, images, memory, memory_need, normals, palettes, proposals};

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
    warnings: Vec<Warning>,
    /// For a scene that was written as a scene, its meshes by name.
    meshes: Vec<(String, MeshCounts)>,
    threads: usize,
    clock: StageClock,
}

/// Report data of a result.
struct ReportData {
    report: Report,
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
        let ReportData { report, warnings, meshes } = told;
        SimplifyOutcome {
            input_format,
            report,
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
    Ok(ReportData { report, warnings, meshes: Vec::new() })
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
    let SimplifiedScene { meshes: mut lighter, report, counts } = not_interrupted(done)?;

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
    warnings.extend(if format == Format::Glb {
        images.embed(&mut scene)
    } else {
        images.external_file_warnings(&scene)
    });
    let relink = |uri: &str| images.uri(uri);
    warnings.extend(match args.dry_run {
        true => file::scene_losses(&scene, &replaced, &relink, format)?,
        false => file::write_scene(&scene, &replaced, &relink, sink, format, args.writing.force)?,
    });
    let meshes = taken.iter().map(|&i| meshes[i].name.clone()).zip(counts).collect();
    Ok(ReportData { report, warnings, meshes })
}

/// Returns the meshes of a scene to simplify, as numbers and as parts.
pub(super) fn parts_of(meshes: &[SceneMesh]) -> (Vec<usize>, Vec<Part<'_>>) {
    let mut systems = Vec::new();
    let mut system_of = |m: &SceneMesh| {
        let matrix = m.world_from_mesh?;
        // Equal up to rounding: products of the same matrices in another order.
        let size = matrix.as_flattened().iter().fold(0f64, |m, x| m.max(x.abs()));
        let near = |s: &[[f64; 4]; 3]| {
            let pairs = s.as_flattened().iter().zip(matrix.as_flattened());
            pairs.into_iter().all(|(a, b)| (a - b).abs() <= 1e-6 * size)
        };
        let known = systems.iter().position(near);
        Some(known.unwrap_or_else(|| {
            systems.push(matrix);
            systems.len() - 1
        }))
    };
    // A mesh without instances in the scene is not changed, unless none has any.
    let is_placed = meshes.iter().any(|m| m.instances > 0);
    let taken: Vec<usize> = (0..meshes.len()).filter(|&i| !is_placed || meshes[i].instances > 0).collect();
    let part = |m: &SceneMesh| {
        let system = system_of(m);
        (m.instances, m.scale, system)
    };
    let said: Vec<_> = taken.iter().map(|&i| &meshes[i]).map(part).collect();
    let parts = taken.iter().zip(said).map(|(&i, (instances, scale, system))| Part {
        mesh: &meshes[i].mesh,
        instances,
        scale,
        system,
    });
    let parts = parts.collect();
    (taken, parts)
}

pub(super) fn set_normals(mesh: &mut TriMesh, wanted: Normals) -> anyhow::Result<()> {
    match wanted {
        Normals::Keep => {}
        Normals::Recompute => normals::recompute(mesh),
        Normals::None => mesh.set_normals(None)?,
    }
    Ok(())
}

/// Returns the warnings of a run.
pub(super) fn warnings_of(report: &Report) -> Vec<Warning> {
    let mut warnings: Vec<_> = dropped(report).collect();
    if report.seams_relaxed {
        warnings.push(Warning::note("seams were moved off their lines to come nearer to the target"));
    }
    if report.sharp_relaxed {
        warnings.push(Warning::note("sharp edges were not all kept, to come nearer to the target"));
    }
    warnings.extend(report.escalated.iter().map(|step| Warning::note(proposals::step_text(step))));
    if report.pruned.largest_kept {
        warnings.push(Warning::note("all parts are smaller than --prune: the largest was kept"));
    }
    warnings
}

/// Returns warnings about attributes that the engine drops.
fn dropped(report: &Report) -> impl Iterator<Item = Warning> {
    let lost =
        |name: &&str| Warning::lost(format!("{name} dropped: a skin has joints and weights, or nothing"));
    report.dropped.iter().map(lost)
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
        Err(e) if e.is::<Interrupted>() => return Status::Interrupted,
        Err(e) => {
            out.failure(path, &format!("{e:#}"));
            return Status::Failed;
        }
    };
    out.object(&done.to_json(path, job, args));
    out.line(&done.line(path));
    for line in done.details() {
        out.detail(&line);
    }
    let mut is_fault = show_warnings(out, path, &done.warnings, args.ending.strict);
    if !done.report.reached {
        let why = not_reached(&done.report, &args.options(), args.run.time_limit);
        is_fault |= show_not_reached(out, path, &why, args.ending.strict);
    }
    if is_fault { Status::Strict } else { Status::Done }
}

/// Returns the reason why the target was not reached, and the proposals.
pub(super) fn not_reached(report: &Report, options: &SimplifyOptions, time_limit: Option<f64>) -> String {
    let mut text = format!("target not reached, stopped by {}", report.stopped_by.name().replace('_', " "));
    let refusals = refusals(report);
    if !refusals.is_empty() {
        text += &format!("; refused: {refusals}");
    }
    if let Some(help) = proposals::text(report, options, time_limit) {
        text += &format!("; {help}");
    }
    text
}

/// Prints that a target was not reached, with the reason. Returns true if that is a fault, with `--strict`.
pub(super) fn show_not_reached(out: &Output, name: &str, why: &str, strict: bool) -> bool {
    let text = format!("{name}: {why}");
    if strict {
        output::error(&text);
    } else {
        out.warning(&text);
    }
    strict
}

/// Returns the refusals and their counts, in words.
pub(super) fn refusals(report: &Report) -> String {
    let of = |(r, n): &(lodsmith::Refusal, u64)| {
        format!("{} {}", r.name().replace('_', " "), grouped(usize::try_from(*n).unwrap_or(usize::MAX)))
    };
    report.refusals.iter().map(of).collect::<Vec<_>>().join(", ")
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
        let measured = r.error.measured.as_ref();
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
            "error": {
                "estimate": r.error.estimate, "bound": r.error.bound, "measured": measured.map(measured_json),
                "unit": "model", "diagonal": r.error.diagonal,
            },
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

pub(super) fn mesh_json((name, m): &(String, MeshCounts)) -> Value {
    json!({
        "name": name, "instances": m.instances, "reached": m.reached,
        "input": { "faces": m.input_faces, "vertices": m.input_vertices },
        "output": { "faces": m.faces, "vertices": m.vertices },
    })
}

/// Returns the measured distances as JSON.
pub(super) fn measured_json(m: &Comparison) -> Value {
    json!({ "hausdorff": both_ways(&m.hausdorff), "mean": both_ways(&m.mean), "rms": both_ways(&m.rms) })
}

/// Returns a figure for each direction and for both.
pub(super) fn both_ways(x: &TwoWay) -> Value {
    json!({ "forward": x.forward, "backward": x.backward, "symmetric": x.symmetric })
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
