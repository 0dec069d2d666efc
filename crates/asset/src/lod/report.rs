//! Reports of levels.

use lodsmith::Report;
use lodsmith::lod::error_of;
use serde_json::{Value, json};

use super::{Level, LevelOutputs, LodOutcome, LodRecipe};
use crate::paths::{Sink, Source};
use crate::report_json::{self, error_json, mesh_json, refusals, seconds};
use crate::sizes::{self, WriteOutcome};
use crate::warnings::{texts, warnings_of};

impl LodOutcome {
    /// Returns the report, with this path of the input and this target.
    pub fn to_json(&self, path: &str, target: &Value, recipe: &LodRecipe, outputs: &LevelOutputs) -> Value {
        let (screen, folder, to) = (&recipe.screen, outputs.folder.as_ref(), outputs.first.as_ref());
        let level = |(k, level): (usize, &Level)| {
            let r = &level.report;
            let mut object = json!({
                "level": k + 1,
                "path": self.outputs.get(k + 1).map(Sink::to_string),
                "faces": r.faces, "vertices": r.vertices,
                "reached": r.reached, "stopped_by": r.stopped_by.name(),
                "error": error_json(r),
                "distance": level.distance,
                "refusals": refusals(r),
                "warnings": texts(&warnings_of(r)),
                "collapses": r.collapses, "parts_removed": r.parts_removed, "necks_cut": r.necks_cut,
                "two_sided_pairs": r.two_sided_pairs,
                "unpaired_sheets": r.unpaired_sheets,
                "seams_relaxed": r.seams_relaxed,
                "sharp_relaxed": r.sharp_relaxed,
            });
            if let Some(file) = self.written.get(k + 1) {
                set_written(&mut object, file);
            }
            if !level.meshes.is_empty() {
                object["meshes"] = level.meshes.iter().map(mesh_json).collect();
            }
            object
        };
        let mut report = json!({
            "input": report_json::file(path.into(), Some(self.input_format), self.counts, self.sizes_before),
            "output": {
                "path": to.filter(|_| folder.is_none()).map(|to| to.sink.to_string()),
                "folder": folder.map(|folder| folder.path.display().to_string()),
                "format": to.map(|to| to.format.name()),
            },
            "method": recipe.options.simplify.method.name(),
            "target": target,
            "reached": self.levels.iter().all(|l| l.report.reached),
            "screen": { "pixels": screen.pixels, "fov_deg": screen.fov_deg, "height_px": screen.height_px },
            "levels": self.levels.iter().enumerate().map(level).collect::<Vec<_>>(),
            "warnings": texts(&self.warnings),
            "threads": self.threads,
            "seconds": seconds(&self.clock),
        });
        if let Some(file) = self.written.first() {
            set_written(&mut report["output"], file);
        }
        if to.is_none_or(|to| to.dry_run) {
            report["dry_run"] = true.into();
        }
        report
    }

    /// Returns the list of levels for the folder of the outputs, with lengths at the scale of the output.
    pub(super) fn list(&self, source: &Source, recipe: &LodRecipe, scale: f64) -> Value {
        let screen = &recipe.screen;
        let file = |level: usize| match self.outputs.get(level) {
            Some(Sink::Path(path)) => path.file_name().map(|name| name.to_string_lossy()),
            _ => None,
        };
        let first = json!({
            "level": 0, "file": file(0), "faces": self.counts[0], "vertices": self.counts[1],
            "error": 0.0, "rms": 0.0, "distance": 0.0,
        });
        let others = self.levels.iter().enumerate().map(|(k, level)| {
            let r: &Report = &level.report;
            // Without an error, there is no RMS distance that was measured either.
            let error = error_of(r);
            let rms = error.map(|_| r.error.measured.as_ref().map_or(r.error.estimate, |m| m.rms.symmetric));
            json!({
                "level": k + 1, "file": file(k + 1), "faces": r.faces, "vertices": r.vertices,
                "error": error.map(|error| error * scale), "rms": rms.map(|rms| rms * scale),
                "distance": level.distance,
            })
        });
        json!({
            "input": source.to_string(),
            "unit": "model",
            "diagonal": self.diagonal * scale,
            "screen": { "pixels": screen.pixels, "fov_deg": screen.fov_deg, "height_px": screen.height_px },
            "levels": std::iter::once(first).chain(others).collect::<Vec<_>>(),
        })
    }
}

/// Adds the sizes of a file and the results of compression.
fn set_written(object: &mut Value, file: &WriteOutcome) {
    object["sizes"] = sizes::to_json(file.sizes);
    if let Some(packed) = &file.packed {
        object["packing"] = sizes::packed_json(packed);
    }
}
