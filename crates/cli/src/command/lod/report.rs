//! Report of a chain of levels.

use lodsmith::lod::error_of;
use lodsmith::{MeshCounts, Report, SimplifyOptions};
use lodsmith_io::{Format, Warning};
use serde_json::{Map, Value, json};

use super::files::Plan;
use crate::args::LodArgs;
use crate::numbers::{counted, grouped, micros, seconds, short};
use crate::output::Output;
use crate::report_json::{error_json, mesh_json};
use crate::run_control::StageClock;
use crate::status::Status;
use crate::warnings::{show_not_reached, show_warnings, texts, warnings_of};

/// Result of a run.
pub(super) struct LodResult {
    pub(super) format: Format,
    /// Faces and vertices of level 0.
    pub(super) counts: [usize; 2],
    pub(super) levels: Vec<Level>,
    pub(super) diagonal: f64,
    pub(super) warnings: Vec<Warning>,
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
pub(super) fn distance(report: &Report, args: &LodArgs) -> f64 {
    args.screen().distance(error_of(report)) * scale(args)
}

/// Returns the factor from lengths of the engine to those of the output.
fn scale(args: &LodArgs) -> f64 {
    args.writing.scale.unwrap_or(1.0)
}

/// Prints the outcome. Returns the exit status.
pub(super) fn show(
    out: &Output,
    path: &str,
    made: anyhow::Result<LodResult>,
    plan: &Plan,
    args: &LodArgs,
) -> Status {
    let written = made.and_then(|made| {
        plan.write_list(&list(&made, path, plan, args), args)?;
        Ok(made)
    });
    let made = match written {
        Ok(made) => made,
        Err(e) => return out.failure(path, &e),
    };
    out.object(&to_json(&made, path, plan, args));
    for line in lines(&made, path, args) {
        out.line(&line);
    }
    let times: Vec<String> =
        made.clock.stages.iter().map(|(name, secs)| format!("{name} {secs:.3} s")).collect();
    out.detail(&format!("  {}, {}", times.join(", "), counted(args.run.threads(), "thread", "threads")));
    let mut is_fault = show_warnings(out, path, &made.warnings, args.ending.strict);
    for (k, level) in made.levels.iter().enumerate() {
        let name = format!("{path}: level {}", k + 1);
        is_fault |= show_warnings(out, &name, &warnings_of(&level.report), args.ending.strict);
        if let Some(why) = &level.not_reached {
            is_fault |= show_not_reached(out, &name, why, args.ending.strict);
        }
    }
    if is_fault { Status::Strict } else { Status::Done }
}

/// Returns a line for the whole and one for each level.
fn lines(made: &LodResult, path: &str, args: &LodArgs) -> Vec<String> {
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
        let from = short(distance(r, args));
        lines.push(format!(
            "  {}: {} faces ({percent:.1} %), {error} of the diagonal, from a distance of {from}",
            k + 1,
            grouped(r.faces)
        ));
    }
    lines
}

/// Returns the report as JSON.
fn to_json(made: &LodResult, path: &str, plan: &Plan, args: &LodArgs) -> Value {
    let screen = args.screen();
    let refusals = |r: &Report| -> Map<String, Value> {
        r.refusals.iter().map(|(why, n)| (why.name().to_owned(), (*n).into())).collect()
    };
    let level = |(k, level): (usize, &Level)| {
        let r = &level.report;
        let mut object = json!({
            "level": k + 1,
            "path": plan.sink(k + 1).map(|sink| sink.to_string()),
            "faces": r.faces, "vertices": r.vertices,
            "reached": r.reached, "stopped_by": r.stopped_by.name(),
            "error": error_json(r),
            "distance": distance(r, args),
            "refusals": refusals(r),
            "warnings": texts(&warnings_of(r)),
            "collapses": r.collapses, "parts_removed": r.parts_removed, "necks_cut": r.necks_cut,
            "seams_relaxed": r.seams_relaxed,
            "sharp_relaxed": r.sharp_relaxed,
        });
        if !level.meshes.is_empty() {
            object["meshes"] = level.meshes.iter().map(mesh_json).collect();
        }
        object
    };
    let seconds: Map<_, _> =
        made.clock.stages.iter().map(|(name, s)| ((*name).to_owned(), micros(*s).into())).collect();
    let options: SimplifyOptions = args.options().simplify;
    let mut report = json!({
        "input": { "path": path, "format": made.format.name(), "faces": made.counts[0], "vertices": made.counts[1] },
        "output": {
            "path": args.output.as_ref().map(ToString::to_string),
            "folder": args.out_dir.as_ref().map(|d| d.display().to_string()),
            "format": plan.format().map(Format::name),
        },
        "method": options.method.name(),
        "target": args.target(),
        "reached": made.levels.iter().all(|l| l.report.reached),
        "screen": { "pixels": screen.pixels, "fov_deg": screen.fov_deg, "height_px": screen.height_px },
        "levels": made.levels.iter().enumerate().map(level).collect::<Vec<_>>(),
        "warnings": texts(&made.warnings),
        "threads": args.run.threads(),
        "seconds": seconds,
    });
    if args.dry_run {
        report["dry_run"] = true.into();
    }
    report
}

/// Returns the content of `lods.json`.
fn list(made: &LodResult, path: &str, plan: &Plan, args: &LodArgs) -> Value {
    let screen = args.screen();
    let first = json!({
        "level": 0, "file": plan.file(0), "faces": made.counts[0], "vertices": made.counts[1],
        "error": 0.0, "rms": 0.0, "distance": 0.0,
    });
    let others = made.levels.iter().enumerate().map(|(k, level)| {
        let r = &level.report;
        let rms = r.error.measured.as_ref().map_or(r.error.estimate, |m| m.rms.symmetric);
        json!({
            "level": k + 1, "file": plan.file(k + 1), "faces": r.faces, "vertices": r.vertices,
            "error": error_of(r) * scale(args), "rms": rms * scale(args), "distance": distance(r, args),
        })
    });
    json!({
        "input": path,
        "unit": "model",
        "diagonal": made.diagonal * scale(args),
        "screen": { "pixels": screen.pixels, "fov_deg": screen.fov_deg, "height_px": screen.height_px },
        "levels": std::iter::once(first).chain(others).collect::<Vec<_>>(),
    })
}
