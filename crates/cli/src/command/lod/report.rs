//! Report of a chain of levels.

use lodsmith::lod::error_of;
use lodsmith::{MeshCounts, Report};
use lodsmith_io::{Format, Sizes, Warning};
use serde_json::{Map, Value, json};

use super::files::Plan;
use crate::numbers::{counted, grouped, micros, seconds, short};
use crate::output::Output;
use crate::paths::Sink;
use crate::report_json::{error_json, mesh_json};
use crate::run_control::StageClock;
use crate::sizes::{self, WriteOutcome};
use crate::status::Status;
use crate::warnings::{show_not_reached, show_warnings, texts, warnings_of};

/// Result of a run.
pub(super) struct LodResult {
    pub(super) format: Format,
    /// Faces and vertices of level 0.
    pub(super) counts: [usize; 2],
    pub(super) levels: Vec<Level>,
    /// Those of level 0 and of the others, if anything is written.
    pub(super) outputs: Vec<Sink>,
    /// `None` if they are not known.
    pub(super) sizes_before: Option<Sizes>,
    /// Outcomes of writing: one file for all levels, or one for each, from level 0 on; without their warnings.
    pub(super) written: Vec<WriteOutcome>,
    pub(super) diagonal: f64,
    pub(super) warnings: Vec<Warning>,
    pub(super) threads: usize,
    pub(super) clock: StageClock,
}

/// Report data of a level below the original.
pub(super) struct Level {
    pub(super) report: Report,
    /// The reason why its target was not reached.
    pub(super) not_reached: Option<String>,
    pub(super) meshes: Vec<(String, MeshCounts)>,
}

/// Returns the distance from which on a level looks like the original, at the scale of the output.
pub(super) fn distance(report: &Report, plan: &Plan) -> f64 {
    plan.screen.distance(error_of(report)) * plan.scale
}

/// Prints the outcome. Returns the exit status.
pub(super) fn show(
    out: &Output,
    path: &str,
    made: anyhow::Result<LodResult>,
    plan: &Plan,
    strict: bool,
) -> Status {
    let made = match made {
        Ok(made) => made,
        Err(e) => return out.failure(path, &e),
    };
    out.object(&to_json(&made, path, plan));
    for line in lines(&made, path, plan) {
        out.line(&line);
    }
    for (k, file) in made.written.iter().enumerate() {
        if let Some(line) = sizes::line(made.sizes_before, file.sizes) {
            out.detail(&if made.written.len() > 1 { format!("  {k}:{line}") } else { line });
        }
        if let Some(packed) = &file.packed {
            out.detail(&sizes::packed_line(packed));
        }
    }
    let times: Vec<String> =
        made.clock.stages.iter().map(|(name, secs)| format!("{name} {secs:.3} s")).collect();
    out.detail(&format!("  {}, {}", times.join(", "), counted(made.threads, "thread", "threads")));
    let mut is_fault = show_warnings(out, path, &made.warnings, strict);
    for (k, level) in made.levels.iter().enumerate() {
        let name = format!("{path}: level {}", k + 1);
        is_fault |= show_warnings(out, &name, &warnings_of(&level.report), strict);
        if let Some(why) = &level.not_reached {
            is_fault |= show_not_reached(out, &name, why, strict);
        }
    }
    if is_fault { Status::Strict } else { Status::Done }
}

/// Returns a line for the whole and one for each level.
fn lines(made: &LodResult, path: &str, plan: &Plan) -> Vec<String> {
    let mut lines = vec![format!(
        "{path}: {}, {}, {}",
        counted(made.counts[0], "face", "faces"),
        counted(made.levels.len(), "level", "levels"),
        seconds(made.clock.total())
    )];
    for (k, level) in made.levels.iter().enumerate() {
        let r = &level.report;
        let percent = 100.0 * r.faces as f64 / made.counts[0].max(1) as f64;
        let share = |d: f64| short(if made.diagonal > 0.0 { 100.0 * d / made.diagonal } else { 0.0 });
        let error = match &r.error.measured {
            None => format!("rms {} %", share(r.error.estimate)),
            Some(m) => format!("rms {} %, max {} %", share(m.rms.symmetric), share(m.hausdorff.symmetric)),
        };
        let from = short(distance(r, plan));
        lines.push(format!(
            "  {}: {} faces ({percent:.1} %), {error} of the diagonal, from a distance of {from}",
            k + 1,
            grouped(r.faces)
        ));
    }
    lines
}

/// Returns the report as JSON.
fn to_json(made: &LodResult, path: &str, plan: &Plan) -> Value {
    let (screen, folder, to) = (&plan.screen, plan.folder.as_ref(), plan.job.output.as_ref());
    let refusals = |r: &Report| -> Map<String, Value> {
        r.refusals.iter().map(|(why, n)| (why.name().to_owned(), (*n).into())).collect()
    };
    let level = |(k, level): (usize, &Level)| {
        let r = &level.report;
        let mut object = json!({
            "level": k + 1,
            "path": made.outputs.get(k + 1).map(Sink::to_string),
            "faces": r.faces, "vertices": r.vertices,
            "reached": r.reached, "stopped_by": r.stopped_by.name(),
            "error": error_json(r),
            "distance": distance(r, plan),
            "refusals": refusals(r),
            "warnings": texts(&warnings_of(r)),
            "collapses": r.collapses, "parts_removed": r.parts_removed, "necks_cut": r.necks_cut,
            "two_sided_pairs": r.two_sided_pairs,
            "unpaired_sheets": r.unpaired_sheets,
            "seams_relaxed": r.seams_relaxed,
            "sharp_relaxed": r.sharp_relaxed,
        });
        if let Some(file) = made.written.get(k + 1) {
            set_written(&mut object, file);
        }
        if !level.meshes.is_empty() {
            object["meshes"] = level.meshes.iter().map(mesh_json).collect();
        }
        object
    };
    let seconds: Map<_, _> =
        made.clock.stages.iter().map(|(name, s)| ((*name).to_owned(), micros(*s).into())).collect();
    let mut report = json!({
        "input": { "path": path, "format": made.format.name(), "faces": made.counts[0], "vertices": made.counts[1],
            "sizes": sizes::to_json(made.sizes_before) },
        "output": {
            "path": to.filter(|_| folder.is_none()).map(|to| to.sink.to_string()),
            "folder": folder.map(|folder| folder.path.display().to_string()),
            "format": to.map(|to| to.format.name()),
        },
        "method": plan.method.name(),
        "target": plan.target,
        "reached": made.levels.iter().all(|l| l.report.reached),
        "screen": { "pixels": screen.pixels, "fov_deg": screen.fov_deg, "height_px": screen.height_px },
        "levels": made.levels.iter().enumerate().map(level).collect::<Vec<_>>(),
        "warnings": texts(&made.warnings),
        "threads": made.threads,
        "seconds": seconds,
    });
    if let Some(file) = made.written.first() {
        set_written(&mut report["output"], file);
    }
    if to.is_none_or(|to| to.dry_run) {
        report["dry_run"] = true.into();
    }
    report
}

/// Adds the sizes of a file and what packing did.
fn set_written(object: &mut Value, file: &WriteOutcome) {
    object["sizes"] = sizes::to_json(file.sizes);
    if let Some(packed) = &file.packed {
        object["packing"] = sizes::packed_json(packed);
    }
}

/// Returns the content of `lods.json`.
pub(super) fn list(made: &LodResult, plan: &Plan) -> Value {
    let screen = &plan.screen;
    let file = |level: usize| match made.outputs.get(level) {
        Some(Sink::Path(path)) => path.file_name().map(|name| name.to_string_lossy()),
        _ => None,
    };
    let first = json!({
        "level": 0, "file": file(0), "faces": made.counts[0], "vertices": made.counts[1],
        "error": 0.0, "rms": 0.0, "distance": 0.0,
    });
    let others = made.levels.iter().enumerate().map(|(k, level)| {
        let r = &level.report;
        let rms = r.error.measured.as_ref().map_or(r.error.estimate, |m| m.rms.symmetric);
        json!({
            "level": k + 1, "file": file(k + 1), "faces": r.faces, "vertices": r.vertices,
            "error": error_of(r) * plan.scale, "rms": rms * plan.scale, "distance": distance(r, plan),
        })
    });
    json!({
        "input": plan.job.source.to_string(),
        "unit": "model",
        "diagonal": made.diagonal * plan.scale,
        "screen": { "pixels": screen.pixels, "fov_deg": screen.fov_deg, "height_px": screen.height_px },
        "levels": std::iter::once(first).chain(others).collect::<Vec<_>>(),
    })
}
