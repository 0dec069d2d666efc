//! `lodsmith clean`: repairs meshes, writes them, and reports what was done.

use std::time::Instant;

use lodsmith::{CleanOptions, CleanReport, Cleaned, Control, Length, SimplifyError, Stage, Verdict};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, Loaded, Sizes, Warning};
use serde_json::{Map, Value, json};

use super::batch;
use crate::args::CleanArgs;
use crate::exit;
use crate::file::{self, Destination, Input};
use crate::images;
use crate::in_order::Turn;
use crate::memory_need::Size;
use crate::numbers::{counted, grouped, micros, seconds};
use crate::orient::orient;
use crate::output::Output;
use crate::paths::Source;
use crate::plan::Job;
use crate::progress::FileProgress;
use crate::run_control::not_interrupted;
use crate::sizes::{self, WriteOutcome};
use crate::status::Status;
use crate::warnings::{show_warnings, texts};
use crate::{memory, memory_need};

/// Cleans every input.
pub(super) fn run(args: &CleanArgs) -> anyhow::Result<Status> {
    batch::run(
        &args.wanted(),
        &args.run,
        |job, watch, turn| clean_one(job, args, watch.bar, turn),
        |out, path, outcome, job| show(out, path, outcome, job, args),
    )
}

/// Outcome of one input.
struct CleanOutcome {
    input_format: Format,
    report: CleanReport,
    /// For a scene that was written as a scene, its meshes by name.
    meshes: Vec<(String, CleanReport)>,
    warnings: Vec<Warning>,
    sizes_before: Option<Sizes>,
    /// Without its warnings.
    written: WriteOutcome,
    seconds: [(&'static str, f64); 3],
}

/// Seconds of reading, cleaning and writing.
struct CleanTimes {
    seconds: [(&'static str, f64); 3],
    since: Instant,
}

impl CleanTimes {
    fn end(&mut self, stage: usize) {
        self.seconds[stage].1 = self.since.elapsed().as_secs_f64();
        self.since = Instant::now();
    }
}

fn clean_one(
    job: &Job,
    args: &CleanArgs,
    bar: &FileProgress<'_>,
    turn: &Turn<'_>,
) -> anyhow::Result<CleanOutcome> {
    let names = ["read", "clean", "write"];
    let mut clock = CleanTimes { seconds: names.map(|s| (s, 0.0)), since: Instant::now() };
    bar.read();
    let input = file::read_input(&job.source, &args.reading, Vec::new(), job.keeps_scenes())?;
    clock.end(0);
    let read = match &input {
        Input::Mesh(loaded) => sizes::of_loaded(loaded),
        Input::Scene(scene) => scene.sizes(),
    };
    let sizes_before = sizes::of_input(&job.source, &args.reading, read);
    let done = match (input, &job.output) {
        (Input::Scene(scene), Some(to)) => {
            clean_scene(*scene, &job.source, to, args.options(), bar, &mut clock)?
        }
        (Input::Scene(_), None) => unreachable!("a scene is read where it can stay one"),
        (Input::Mesh(loaded), to) => {
            clean_mesh(*loaded, to.as_ref(), &args.options(), bar, &mut clock, turn)?
        }
    };
    Ok(CleanOutcome { sizes_before, seconds: clock.seconds, ..done })
}

fn clean_mesh(
    loaded: Loaded,
    to: Option<&Destination>,
    options: &CleanOptions,
    bar: &FileProgress<'_>,
    clock: &mut CleanTimes,
    turn: &Turn<'_>,
) -> anyhow::Result<CleanOutcome> {
    let Loaded { mesh, regions, mut warnings, format: input_format, .. } = loaded;
    memory::check("clean", memory_need::clean(Size::of(&mesh)))?;
    let cleaned = lodsmith::clean(&mesh, options, &mut CleanControl { bar });
    let Cleaned { mesh: mut cleaned, report, single_sided } = not_interrupted(cleaned)?;
    drop(mesh);
    warnings.extend(warnings_of(&report));
    if !single_sided.is_empty() {
        warnings.push(Warning::note(
            "faces back to back are single now: this format cannot say that they are seen from both sides",
        ));
    }
    clock.end(1);
    bar.write();
    let mut written = WriteOutcome::default();
    if let Some(to) = to {
        orient(&mut cleaned, &to.writing);
        // If two textures have one name, that of the earlier input keeps it.
        if to.shares_names(&regions) {
            turn.wait();
        }
        if to.format == Format::Stl && report.parted_vertices > 0 {
            warnings.push(Warning::note(
                "STL has no numbers of vertices: who reads it joins again what was cut apart",
            ));
        }
        written = to.write(&cleaned, regions)?;
        warnings.append(&mut written.warnings);
    }
    clock.end(2);
    let (meshes, sizes_before, seconds) = (Vec::new(), None, clock.seconds);
    Ok(CleanOutcome { input_format, report, meshes, warnings, sizes_before, written, seconds })
}

/// Cleans each mesh of a scene separately; the rest of the scene is not changed.
fn clean_scene(
    mut scene: Scene,
    source: &Source,
    to: &Destination,
    options: CleanOptions,
    bar: &FileProgress<'_>,
    clock: &mut CleanTimes,
) -> anyhow::Result<CleanOutcome> {
    let diagonal = scene.bounds().map_or(0.0, |b| b.diagonal());
    let mut report = CleanReport::default();
    let size = Size::of_all(scene.meshes().iter().map(|m| &*m.mesh));
    memory::check("clean", memory_need::clean(size).saturating_add(scene.buffer_bytes()))?;
    let (mut meshes, mut replaced) = (Vec::new(), Vec::new());
    let mut notes = Vec::new();
    // Primitives that lost one of their sides: mesh and primitive.
    let mut double_sided = Vec::new();
    for m in scene.meshes() {
        if m.mesh.face_count() == 0 {
            replaced.push(None);
            continue;
        }
        let options = in_mesh(options, diagonal, m.scale);
        match lodsmith::clean(&m.mesh, &options, &mut CleanControl { bar }) {
            Err(SimplifyError::NoFaces { .. }) => {
                let text = format!("mesh {}: no face would be left, so it stays as it is", m.name);
                notes.push(Warning::note(text));
                replaced.push(None);
            }
            cleaned => {
                let cleaned = not_interrupted(cleaned)?;
                notes.extend(
                    warnings_of(&cleaned.report).map(|w| Warning::note(format!("mesh {}: {w}", m.name))),
                );
                add(&mut report, &cleaned.report);
                double_sided
                    .extend(cleaned.single_sided.iter().map(|region| (replaced.len(), region.index())));
                meshes.push((m.name.clone(), cleaned.report));
                replaced.push(Some(cleaned.mesh));
            }
        }
    }
    for (mesh, primitive) in double_sided {
        scene.set_double_sided(mesh, primitive);
    }
    clock.end(1);
    bar.write();
    let images = images::FolderMove::new(source, &to.sink);
    let mut warnings: Vec<_> = scene.warnings().to_vec();
    warnings.extend(notes);
    warnings.extend(images.bring(&mut scene, to.format, to.writing.textures));
    let relink = |uri: &str| images.uri(uri);
    let mut written = to.write_scene(&scene, &replaced, &relink)?;
    warnings.append(&mut written.warnings);
    clock.end(2);
    let input_format = scene.format();
    let (sizes_before, seconds) = (None, clock.seconds);
    Ok(CleanOutcome { input_format, report, meshes, warnings, sizes_before, written, seconds })
}

/// Converts options with lengths in a scene to those of a mesh that is scaled by `scale` there.
fn in_mesh(mut options: CleanOptions, diagonal: f64, scale: f64) -> CleanOptions {
    let scale = if scale.is_finite() && scale > 0.0 { scale } else { 1.0 };
    let units = |length: Length| Length::Units(length.in_units(diagonal) / scale);
    options.weld = options.weld.map(units);
    options.prune = options.prune.map(units);
    options
}

/// Returns the warnings of a clean-up.
fn warnings_of(report: &CleanReport) -> impl Iterator<Item = Warning> {
    let left = &report.remaining;
    let edges = |n: usize| counted(n, "edge", "edges");
    let faces = |n: usize| counted(n, "face", "faces");
    let all = [
        (
            left.non_manifold_edges > 0,
            format!(
                "{} with more than two faces: --non-manifold cut parts them",
                edges(left.non_manifold_edges)
            ),
        ),
        (
            left.misoriented_edges > 0,
            format!(
                "{} where no side is outside: the surface is one-sided, --non-manifold cut opens it there",
                edges(left.misoriented_edges)
            ),
        ),
        (
            left.zero_area_faces > 0,
            format!("{} without area left, on seams or needles", faces(left.zero_area_faces)),
        ),
        (report.pruned.largest_kept, "all parts are smaller than --prune: the largest was kept".to_owned()),
    ];
    all.into_iter().filter(|x| x.0).map(|x| Warning::note(x.1))
}

/// A name and a count.
type Count = (&'static str, usize);

/// Returns the counts of a report by name: first the repairs, then the remaining defects.
fn counts(r: &CleanReport) -> ([Count; 12], [Count; 6]) {
    let done = [
        ("welded_vertices", r.welded_vertices),
        ("non_finite_faces", r.non_finite_faces),
        ("degenerate_faces", r.degenerate_faces),
        ("duplicate_faces", r.duplicate_faces),
        ("back_faces", r.back_faces),
        ("pruned_parts", r.pruned.parts),
        ("pruned_faces", r.pruned.faces),
        ("flipped_faces", r.flipped_faces),
        ("zero_area_faces", r.zero_area_faces),
        ("parted_vertices", r.parted_vertices),
        ("sewn_edges", r.sewn_edges),
        ("unused_vertices", r.unused_vertices),
    ];
    let left = [
        ("border_edges", r.remaining.border_edges),
        ("non_manifold_edges", r.remaining.non_manifold_edges),
        ("non_manifold_vertices", r.remaining.non_manifold_vertices),
        ("misoriented_edges", r.remaining.misoriented_edges),
        ("opposite_faces", r.remaining.opposite_faces),
        ("zero_area_faces", r.remaining.zero_area_faces),
    ];
    (done, left)
}

/// Adds the counts of one mesh to those of others.
fn add(sum: &mut CleanReport, r: &CleanReport) {
    let both = |a: &mut usize, b: usize| *a += b;
    both(&mut sum.input_faces, r.input_faces);
    both(&mut sum.input_vertices, r.input_vertices);
    both(&mut sum.faces, r.faces);
    both(&mut sum.vertices, r.vertices);
    both(&mut sum.welded_vertices, r.welded_vertices);
    both(&mut sum.non_finite_faces, r.non_finite_faces);
    both(&mut sum.degenerate_faces, r.degenerate_faces);
    both(&mut sum.duplicate_faces, r.duplicate_faces);
    both(&mut sum.back_faces, r.back_faces);
    both(&mut sum.pruned.parts, r.pruned.parts);
    both(&mut sum.pruned.faces, r.pruned.faces);
    both(&mut sum.flipped_faces, r.flipped_faces);
    both(&mut sum.zero_area_faces, r.zero_area_faces);
    both(&mut sum.parted_vertices, r.parted_vertices);
    both(&mut sum.sewn_edges, r.sewn_edges);
    both(&mut sum.unused_vertices, r.unused_vertices);
    both(&mut sum.remaining.border_edges, r.remaining.border_edges);
    both(&mut sum.remaining.non_manifold_edges, r.remaining.non_manifold_edges);
    both(&mut sum.remaining.non_manifold_vertices, r.remaining.non_manifold_vertices);
    both(&mut sum.remaining.misoriented_edges, r.remaining.misoriented_edges);
    both(&mut sum.remaining.opposite_faces, r.remaining.opposite_faces);
    both(&mut sum.remaining.zero_area_faces, r.remaining.zero_area_faces);
}

/// Prints the outcome of one input. Returns the status that it alone would end with.
fn show(
    out: &Output,
    path: &str,
    outcome: anyhow::Result<CleanOutcome>,
    job: &Job,
    args: &CleanArgs,
) -> Status {
    let done = match outcome {
        Ok(done) => done,
        Err(e) => return out.failure(path, &e),
    };
    out.object(&done.to_json(path, job, args));
    for line in done.table(path) {
        out.line(&line);
    }
    let details = sizes::line(done.sizes_before, done.written.sizes).into_iter();
    for line in details.chain(done.written.packed.as_ref().map(sizes::packed_line)) {
        out.detail(&line);
    }
    for (name, r) in done.meshes.iter().filter(|_| done.meshes.len() > 1) {
        out.detail(&format!("  mesh {name}: {} → {} faces", grouped(r.input_faces), grouped(r.faces)));
    }
    match show_warnings(out, path, &done.warnings, args.ending.strict) {
        true => Status::Strict,
        false => Status::Done,
    }
}

impl CleanOutcome {
    /// Returns a summary line, and a line for each step that changed something.
    fn table(&self, path: &str) -> Vec<String> {
        let r = &self.report;
        let total = self.seconds.iter().map(|s| s.1).sum::<f64>();
        let mut lines = vec![format!(
            "{path}: {} → {} faces, {} → {} vertices, {}",
            grouped(r.input_faces),
            grouped(r.faces),
            grouped(r.input_vertices),
            grouped(r.vertices),
            seconds(total)
        )];
        let (done, left) = counts(r);
        let mut rows = |title: &str, counts: &[(&str, usize)]| {
            let told: Vec<String> = counts
                .iter()
                .filter(|c| c.1 > 0)
                .map(|(name, n)| format!("{} {}", grouped(*n), name.replace('_', " ")))
                .collect();
            if !told.is_empty() {
                lines.push(format!("  {title:<6}{}", told.join(", ")));
            }
        };
        rows("done", &done);
        rows("left", &left);
        lines
    }

    /// Returns the report as JSON.
    fn to_json(&self, path: &str, job: &Job, args: &CleanArgs) -> Value {
        let r = &self.report;
        let to = job.output.as_ref();
        let named = |all: &[(&str, usize)]| -> Map<String, Value> {
            all.iter().map(|&(name, n)| (name.to_owned(), n.into())).collect()
        };
        let (done, left) = counts(r);
        let seconds: Map<_, _> =
            self.seconds.iter().map(|(name, s)| ((*name).to_owned(), micros(*s).into())).collect();
        let mut report = json!({
            "input": {
                "path": path, "format": self.input_format.name(),
                "faces": r.input_faces, "vertices": r.input_vertices, "sizes": sizes::to_json(self.sizes_before),
            },
            "output": {
                "path": to.map(|to| to.sink.to_string()), "format": to.map(|to| to.format.name()),
                "faces": r.faces, "vertices": r.vertices, "sizes": sizes::to_json(self.written.sizes),
            },
            "done": named(&done),
            "left": named(&left),
            "warnings": texts(&self.warnings),
            "seconds": seconds,
        });
        if let Some(packed) = &self.written.packed {
            report["output"]["packing"] = sizes::packed_json(packed);
        }
        if !self.meshes.is_empty() {
            let mesh = |(name, r): &(String, CleanReport)| {
                let (done, left) = counts(r);
                json!({
                    "name": name, "done": named(&done), "left": named(&left),
                    "input": { "faces": r.input_faces, "vertices": r.input_vertices },
                    "output": { "faces": r.faces, "vertices": r.vertices },
                })
            };
            report["meshes"] = self.meshes.iter().map(mesh).collect();
        }
        if args.dry_run {
            report["dry_run"] = true.into();
        }
        report
    }
}

/// Control of a clean-up: moves the progress bar, and cancels after an interrupt.
struct CleanControl<'a> {
    bar: &'a FileProgress<'a>,
}

impl Control for CleanControl<'_> {
    fn stage(&mut self, stage: Stage) {
        self.bar.stage(stage);
    }
    fn progress(&mut self, done: f64) -> Verdict {
        self.bar.within(Stage::Prepare, done);
        if exit::interrupted() { Verdict::Cancel } else { Verdict::Continue }
    }
}
