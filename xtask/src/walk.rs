//! Checks that errors grow steadily: simplifies each model in steps, from 90 % of its triangles down to 200, with a
//! ratio of 0.85 between steps.
//!
//! A step is a *spike* if its RMS distance is more than [`MAX_SPIKE_RATIO`] times the distance of any step with fewer
//! triangles: a smaller target then gives a more accurate mesh, so the collapses took a bad path. Distances below
//! [`MIN_DISTANCE`] of the diagonal count as [`MIN_DISTANCE`]. A growing error is not a violation.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::{release_command, shared_models};

/// The ratio of triangles between a step and the previous step; the first step keeps [`FIRST_RATIO`] of the model.
const STEP_RATIO: f64 = 0.85;
const FIRST_RATIO: f64 = 0.9;
/// Minimum number of triangles of a step.
const MIN_FACES: usize = 200;
/// Maximum ratio between the distances of a step and of a step with fewer triangles. (Measured: equally good collapse
/// orders differ by less, and runs with random variation stay below.)
const MAX_SPIKE_RATIO: f64 = 1.5;
/// A fraction of the diagonal: sixteen times the rounding error of a coordinate in single precision.
const MIN_DISTANCE: f64 = 1e-6;
/// Models with fewer or more triangles are skipped: fewer leave no steps down to 200; more take minutes.
const FACE_RANGE: std::ops::RangeInclusive<u64> = 400..=60_000;
const PRESETS: &[&str] = &["auto", "scan", "cad", "visual", "print"];
/// Extensions of model files.
const MODELS: &[&str] = &["obj", "off", "ply", "stl", "gltf", "glb"];

/// One step: the remaining triangles, and the RMS distance as a fraction of the diagonal.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ReductionStep {
    faces: u64,
    rms: f64,
}

/// Returns the target triangle counts, in order.
fn targets(faces: u64) -> Vec<usize> {
    let sizes = std::iter::successors(Some(FIRST_RATIO * faces as f64), |n| Some(n * STEP_RATIO));
    sizes.map(|n| n.round() as usize).take_while(|n| *n >= MIN_FACES).collect()
}

/// Returns the indices of the steps that are spikes.
fn spikes(steps: &[ReductionStep]) -> Vec<usize> {
    let of = |step: &ReductionStep| step.rms.max(MIN_DISTANCE);
    let is_spike = |&i: &usize| {
        let smaller = steps.iter().filter(|s| s.faces < steps[i].faces).map(of);
        of(&steps[i]) > MAX_SPIKE_RATIO * smaller.fold(f64::INFINITY, f64::min)
    };
    (0..steps.len()).filter(is_spike).collect()
}

/// Checks the models `MODEL...` (default: the shared models) with each `--preset NAME` (default: all).
pub(crate) fn run(args: &[String]) -> Result<()> {
    let (mut models, mut presets) = (Vec::new(), Vec::new());
    let mut rest = args.iter();
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--preset" => presets.push(rest.next().context("--preset needs a name")?.as_str()),
            option if option.starts_with('-') => bail!("no option {option}"),
            path => models.push(PathBuf::from(path)),
        }
    }
    if let Some(unknown) = presets.iter().find(|p| !PRESETS.contains(p)) {
        bail!("no preset {unknown}; known presets: {}", PRESETS.join(", "));
    }
    let presets = if presets.is_empty() { PRESETS.to_vec() } else { presets };
    if models.is_empty() {
        let folder = shared_models().context("no models: name files (../shared/models does not exist)")?;
        list(&folder, &mut models)?;
    }
    let program = release_command()?;
    println!("| model | preset | triangles → RMS, % of the diagonal | spikes |\n|---|---|---|--:|");
    let mut found = Vec::new();
    for model in &models {
        for preset in presets.iter().copied() {
            let Some(steps) = walk(&program, model, preset)? else { break };
            let name = model.file_name().unwrap_or_default().to_string_lossy();
            let describe = |s: &ReductionStep| format!("{} → {:.5}", s.faces, 100.0 * s.rms);
            let all: Vec<String> = steps.iter().map(describe).collect();
            let bad = spikes(&steps);
            println!("| {name} | {preset} | {} | {} |", all.join(", "), bad.len());
            found.extend(bad.into_iter().map(|i| format!("{name}, {preset}: {} %", describe(&steps[i]))));
        }
    }
    found.iter().for_each(|spike| eprintln!("spike: {spike}"));
    ensure!(
        found.is_empty(),
        "{} steps have more than {MAX_SPIKE_RATIO} times the error of a step with fewer triangles",
        found.len()
    );
    Ok(())
}

/// Returns all models of a folder, sorted by path.
fn list(folder: &Path, models: &mut Vec<PathBuf>) -> Result<()> {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder)?.map(|e| Ok(e?.path())).collect::<Result<_>>()?;
    entries.sort();
    for path in entries {
        if path.is_dir() {
            list(&path, models)?;
        } else if path.extension().is_some_and(|e| MODELS.iter().any(|m| e.eq_ignore_ascii_case(m))) {
            models.push(path);
        }
    }
    Ok(())
}

/// Returns the steps of a model; `None` if it cannot be read or has too few or too many triangles.
fn walk(program: &Path, model: &Path, preset: &str) -> Result<Option<Vec<ReductionStep>>> {
    let folder = tempfile::tempdir()?;
    let result = folder.path().join("result.ply");
    let simplified = |faces: usize| -> Option<Value> {
        let faces = faces.to_string();
        let args =
            ["simplify", "--json", "-q", "--force", "--measure", "--preset", preset, "--faces", &faces];
        let out = Command::new(program).args(args).arg("-o").arg(&result).arg(model).output().ok()?;
        serde_json::from_slice(&out.stdout).ok()
    };
    let Some(input) = simplified(usize::MAX >> 8) else { return Ok(None) };
    let faces = input["input"]["faces"].as_u64().unwrap_or(0);
    if !FACE_RANGE.contains(&faces) {
        return Ok(None);
    }
    let mut steps = Vec::new();
    for target in targets(faces) {
        let report = simplified(target).with_context(|| format!("{} to {target}", model.display()))?;
        let error = &report["error"];
        let rms = error["measured"]["rms"]["symmetric"].as_f64().context("no measured error")?;
        let diagonal = error["diagonal"].as_f64().filter(|d| *d > 0.0).unwrap_or(1.0);
        steps.push(ReductionStep {
            faces: report["output"]["faces"].as_u64().unwrap_or(0),
            rms: rms / diagonal,
        });
    }
    Ok(Some(steps))
}

#[cfg(test)]
mod tests {
    use lodsmith::core::measure::{CompareOptions, compare};
    use lodsmith::core::{Positions, TriMesh, VertexId, WedgeId, shapes};
    use lodsmith::{Preset, SimplifyOptions, Stop, simplify};

    use super::*;

    /// Runs all steps on a mesh in memory.
    fn walked(mesh: &TriMesh, preset: Preset) -> Vec<ReductionStep> {
        let mut options = CompareOptions::default();
        options.samples = 10_000;
        let step = |faces: usize| {
            let done = simplify(mesh, &SimplifyOptions::preset(preset, Stop::faces(faces))).unwrap();
            let off = compare(&mesh.surface(), &done.mesh.surface(), &options).unwrap();
            ReductionStep { faces: done.mesh.face_count() as u64, rms: off.rms.symmetric / off.diagonal }
        };
        targets(mesh.face_count() as u64).into_iter().map(step).collect()
    }

    fn holds(mesh: &TriMesh, presets: &[Preset]) {
        for &preset in presets {
            let steps = walked(mesh, preset);
            assert!(steps.len() > 5 && steps.last().is_some_and(|s| s.rms > MIN_DISTANCE));
            let bad: Vec<_> = spikes(&steps).into_iter().map(|i| steps[i]).collect();
            assert!(bad.is_empty(), "{preset:?}: {bad:?} among {steps:?}");
        }
    }

    #[test]
    fn a_spike_has_a_larger_error_than_a_step_with_fewer_triangles() {
        let steps = |all: &[(u64, f64)]| -> Vec<ReductionStep> {
            all.iter().map(|&(faces, rms)| ReductionStep { faces, rms }).collect()
        };
        assert_eq!(spikes(&steps(&[(900, 1e-4), (700, 2e-4), (500, 8e-4), (300, 7e-4)])), [0usize; 0]);
        assert_eq!(spikes(&steps(&[(900, 1e-4), (700, 2e-2), (500, 3e-2), (300, 3e-4)])), [1, 2]);
        // Rounding.
        assert_eq!(spikes(&steps(&[(900, 9e-7), (700, 1e-7), (500, 1e-5)])), [0usize; 0]);
        // Runs with the same final count.
        assert_eq!(spikes(&steps(&[(300, 4e-3), (300, 1e-3)])), [0usize; 0]);
    }

    #[test]
    fn targets_go_from_nine_tenths_to_two_hundred() {
        let all = targets(1000);
        assert_eq!((all[0], all[1], all.len()), (900, 765, 10));
        assert!(all.last().is_some_and(|n| (MIN_FACES..MIN_FACES * 2).contains(n)));
    }

    #[test]
    fn errors_of_a_level_of_small_parts_grow_steadily() {
        holds(&shapes::level(16, 90), &[Preset::Auto, Preset::Visual, Preset::Scan, Preset::Cad]);
    }

    #[test]
    fn errors_of_separate_shapes_grow_steadily() {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for (mesh, by) in
            [(shapes::blob(3, 1), 0.0), (shapes::torus(16, 8), 2.5), (shapes::tetrahedra(27), 4.0)]
        {
            let first = points.len() as u32;
            points.extend(mesh.positions().view().iter().map(|p| [p[0] + by, 0.4 * p[1], 0.4 * p[2]]));
            triangles
                .extend(mesh.triangles().iter().map(|t: &[WedgeId; 3]| t.map(|w| VertexId(w.0 + first))));
        }
        let mesh = TriMesh::new(Positions::F64(points), triangles).unwrap();
        holds(&mesh, &[Preset::Auto, Preset::Print, Preset::Visual]);
    }

    #[test]
    fn errors_of_a_sheet_with_holes_grow_steadily() {
        let mut sheet = shapes::grid_with_holes(24);
        sheet.map_positions(|p| [p[0], p[1], 0.1 * (7.0 * p[0]).sin() * (5.0 * p[1]).cos()]);
        holds(&sheet, &[Preset::Auto, Preset::Cad, Preset::Print]);
    }
}
