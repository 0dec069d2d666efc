//! Report of `lodsmith simplify`.

use lodsmith::{MeshCounts, Report};
use lodsmith_io::{Format, Sizes, Warning};
use serde_json::{Map, Value, json};

use crate::args::SimplifyArgs;
use crate::numbers::{counted, grouped, micros, seconds, short};
use crate::output::Output;
use crate::plan::Job;
use crate::proposals;
use crate::report_json::{error_json, mesh_json};
use crate::run_control::StageClock;
use crate::sizes::{self, WriteOutcome};
use crate::status::Status;
use crate::warnings::{refusals, show_not_reached, show_warnings, texts};

/// Outcome of one input.
pub(super) struct SimplifyOutcome {
    pub(super) input_format: Format,
    pub(super) report: Report,
    /// The reason why the target was not reached.
    pub(super) not_reached: Option<String>,
    pub(super) warnings: Vec<Warning>,
    /// For a scene that was written as a scene, its meshes by name.
    pub(super) meshes: Vec<(String, MeshCounts)>,
    /// Report of the bake.
    pub(super) baked: Option<Value>,
    /// `None` if they are not known.
    pub(super) sizes_before: Option<Sizes>,
    /// The outcome of writing, without its warnings.
    pub(super) written: WriteOutcome,
    pub(super) threads: usize,
    pub(super) clock: StageClock,
}

/// Prints the outcome of one input. Returns the status that it alone would end with.
pub(super) fn show(
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
    if let Some(line) = sizes::line(done.sizes_before, done.written.sizes) {
        out.detail(&line);
    }
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
        lines.extend(self.written.packed.as_ref().map(sizes::packed_line));
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
        if r.two_sided_pairs > 0 {
            let pairs = counted(r.two_sided_pairs, "pair", "pairs");
            lines.push(format!("  {pairs} of faces back to back reduced as one side and written as both"));
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
        let (r, options) = (&self.report, args.options());
        let to = job.output.as_ref();
        let count = |(name, n): (&str, Value)| (name.to_owned(), n);
        let refusals: Map<_, _> = r.refusals.iter().map(|(r, n)| count((r.name(), (*n).into()))).collect();
        let seconds: Map<_, _> =
            self.clock.stages.iter().map(|(name, s)| count((name, micros(*s).into()))).collect();
        let cleanup: Map<_, _> = cleanup(r).into_iter().map(|(name, n)| count((name, n.into()))).collect();
        let mut report = json!({
            "input": {
                "path": path, "format": self.input_format.name(),
                "faces": r.input_faces, "vertices": r.input_vertices, "sizes": sizes::to_json(self.sizes_before),
            },
            "output": {
                "path": to.map(|to| to.sink.to_string()), "format": to.map(|to| to.format.name()),
                "faces": r.faces, "vertices": r.vertices, "sizes": sizes::to_json(self.written.sizes),
            },
            "method": options.method.name(),
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
            "two_sided_pairs": r.two_sided_pairs,
            "unpaired_sheets": r.unpaired_sheets,
            "pruned": { "parts": r.pruned.parts, "faces": r.pruned.faces },
            "seams_relaxed": r.seams_relaxed,
            "sharp_relaxed": r.sharp_relaxed,
            "proposals": proposals::to_json(r, &options),
            "escalated": proposals::steps_json(r),
            "cleanup": cleanup,
        });
        if !self.meshes.is_empty() {
            report["meshes"] = self.meshes.iter().map(mesh_json).collect();
        }
        if let Some(packed) = &self.written.packed {
            report["output"]["packing"] = sizes::packed_json(packed);
        }
        if let Some(c) = &r.clustered {
            report["clustered"] = json!({
                "cell": c.cell, "faces": c.faces, "vertices": c.vertices, "non_manifold_edges": c.non_manifold_edges,
            });
        }
        if !args.engine.names.lock.is_empty() {
            report["locked"] = json!({ "vertices": r.locked_vertices, "faces": r.locked_faces });
        }
        if let Some(baked) = &self.baked {
            report["baked"] = baked.clone();
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
