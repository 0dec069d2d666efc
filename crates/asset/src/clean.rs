//! Repair of files.

use lodsmith::{CleanOptions, CleanReport, Length, SimplifyError};
use lodsmith_core::numbers::counted;
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ReadOptions, Sizes, Warning};
use serde_json::{Value, json};

use crate::asset::{Asset, Edit};
use crate::destination::Destination;
use crate::error::AssetError;
use crate::job::{Job, StageClock, Step};
use crate::memory_need::{self, Size};
use crate::paths::Source;
use crate::report_json::{self, seconds};
use crate::sizes::WriteOutcome;
use crate::warnings::texts;

/// Outcome of a repair.
#[derive(Debug)]
pub struct CleanOutcome {
    /// Format of the input.
    pub input_format: Format,
    /// The counts of all meshes.
    pub report: CleanReport,
    /// The reports of the meshes of a scene, by name.
    pub meshes: Vec<(String, CleanReport)>,
    /// Warnings of reading, of the repair and of writing.
    pub warnings: Vec<Warning>,
    /// Sizes of the input; `None` if they are not known.
    pub sizes_before: Option<Sizes>,
    /// The outcome of writing, without its warnings.
    pub written: WriteOutcome,
    /// Seconds by stage.
    pub clock: StageClock,
}

/// Reads a file, repairs each of its meshes separately, and writes it.
///
/// # Errors
/// Those of [`Asset::read`], of [`lodsmith::clean()`] and of [`Asset::write`].
pub fn clean(
    source: &Source,
    reading: &ReadOptions,
    options: &CleanOptions,
    to: Option<&Destination>,
    job: &mut Job<'_>,
) -> Result<CleanOutcome, AssetError> {
    job.set_stages(&[Step::Read, Step::Clean, Step::Write]);
    job.enter(Step::Read);
    let asset = Asset::read(source, reading, to.is_some_and(Destination::keeps_scenes), job)?;
    let sizes_before = asset.sizes();
    job.enter(Step::Clean);
    let mut done = Cleaning { warnings: asset.warnings().to_vec(), ..Cleaning::default() };
    match asset.scene() {
        Some(scene) => done.clean_scene(scene, options, job)?,
        None => done.clean_mesh(&asset, options, to, job)?,
    }
    job.enter(Step::Write);
    let Cleaning { edit, report, meshes, mut warnings } = done;
    let mut written = match to {
        Some(to) => asset.write(edit, to, job)?,
        None => WriteOutcome::default(),
    };
    warnings.append(&mut written.warnings);
    let (input_format, clock) = (asset.format(), job.times());
    Ok(CleanOutcome { input_format, report, meshes, warnings, sizes_before, written, clock })
}

/// The changes and counts of a repair so far.
#[derive(Default)]
struct Cleaning {
    edit: Edit,
    report: CleanReport,
    meshes: Vec<(String, CleanReport)>,
    warnings: Vec<Warning>,
}

impl Cleaning {
    fn clean_mesh(
        &mut self,
        asset: &Asset,
        options: &CleanOptions,
        to: Option<&Destination>,
        job: &mut Job<'_>,
    ) -> Result<(), AssetError> {
        let mesh = asset.meshes()[0];
        job.check_memory("clean", memory_need::clean(Size::of(mesh)))?;
        let cleaned = lodsmith::clean(mesh, options, job)?;
        self.warnings.extend(warnings_of(&cleaned.report));
        if !cleaned.single_sided.is_empty() {
            self.warnings.push(Warning::note(
                "one of each two faces back to back was removed, but this format has no two-sided materials",
            ));
        }
        if to.is_some_and(|to| to.format == Format::Stl) && cleaned.report.parted_vertices > 0 {
            self.warnings.push(Warning::note(
                "STL has no vertex indices: readers merge again the vertices that --non-manifold cut separated",
            ));
        }
        (self.edit.meshes, self.report) = (vec![Some(cleaned.mesh)], cleaned.report);
        Ok(())
    }

    fn clean_scene(
        &mut self,
        scene: &Scene,
        options: &CleanOptions,
        job: &mut Job<'_>,
    ) -> Result<(), AssetError> {
        let diagonal = scene.bounds().map_or(0.0, |b| b.diagonal());
        let size = Size::of_all(scene.meshes().iter().map(|m| &*m.mesh));
        job.check_memory("clean", memory_need::clean(size).saturating_add(scene.buffer_bytes()))?;
        // Mesh and primitive of the surfaces that lost one of their two sides.
        let mut single_sided = Vec::new();
        for m in scene.meshes() {
            if m.mesh.face_count() == 0 {
                self.edit.meshes.push(None);
                continue;
            }
            let made = match lodsmith::clean(&m.mesh, &in_mesh(*options, diagonal, m.scale), job) {
                Err(SimplifyError::NoFaces { .. }) => {
                    let text = format!("mesh {}: not changed, because no face would be left", m.name);
                    self.warnings.push(Warning::note(text));
                    None
                }
                cleaned => {
                    let cleaned = cleaned?;
                    let named = |w| Warning::note(format!("mesh {}: {w}", m.name));
                    self.warnings.extend(warnings_of(&cleaned.report).map(named));
                    add(&mut self.report, &cleaned.report);
                    let mesh = self.edit.meshes.len();
                    single_sided.extend(cleaned.single_sided.iter().map(|region| (mesh, region.index())));
                    self.meshes.push((m.name.clone(), cleaned.report));
                    Some(cleaned.mesh)
                }
            };
            self.edit.meshes.push(made);
        }
        if !single_sided.is_empty() {
            let mut scene = scene.clone();
            for (mesh, primitive) in single_sided {
                scene.set_double_sided(mesh, primitive);
            }
            self.edit.scene = Some(Box::new(scene));
        }
        Ok(())
    }
}

/// Converts lengths in units of a scene to units of a mesh that the scene scales by `scale`.
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
                "{} with more than two faces: --non-manifold cut separates them",
                edges(left.non_manifold_edges)
            ),
        ),
        (
            left.misoriented_edges > 0,
            format!(
                "{} on a non-orientable surface: --non-manifold cut opens it there",
                edges(left.misoriented_edges)
            ),
        ),
        (
            left.zero_area_faces > 0,
            format!("{} without area left, on seams or slivers", faces(left.zero_area_faces)),
        ),
        (report.pruned.largest_kept, "all parts are smaller than --prune: the largest was kept".to_owned()),
    ];
    all.into_iter().filter(|x| x.0).map(|x| Warning::note(x.1))
}

/// Adds the counts of one mesh to a sum.
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

impl CleanOutcome {
    /// Returns the report, with this path of the input.
    pub fn to_json(&self, path: &str, to: Option<&Destination>, dry_run: bool) -> Value {
        let r = &self.report;
        let input = [r.input_faces, r.input_vertices];
        let mut report = report_json::cleaned(r);
        report["input"] = report_json::file(path.into(), Some(self.input_format), input, self.sizes_before);
        report["output"] = report_json::output(to, [r.faces, r.vertices], &self.written);
        report["warnings"] = texts(&self.warnings).into();
        report["seconds"] = seconds(&self.clock);
        if !self.meshes.is_empty() {
            let mesh = |(name, r): &(String, CleanReport)| {
                let mut mesh = json!({ "name": name });
                report_json::extend(&mut mesh, report_json::cleaned(r));
                mesh
            };
            report["meshes"] = self.meshes.iter().map(mesh).collect();
        }
        if dry_run {
            report["dry_run"] = true.into();
        }
        report
    }
}
