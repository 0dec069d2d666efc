//! Simplification of each mesh of a scene separately.

use lodsmith_core::TriMesh;
use lodsmith_core::measure::{Comparison, TwoWay};

use super::farthest::move_to_scene;
use super::joined::JoinedScene;
use super::part::{MeshCounts, Part, SimplifiedScene};
use super::touching::Touching;
use crate::SimplifyError;
use crate::control::{Control, ProgressShare};
use crate::options::SimplifyOptions;
use crate::report::{Escalation, Refusal, Report, StoppedBy};

/// A run and its weight in the sum of all.
struct WeightedReport {
    report: Report,
    /// The part that it is of.
    part: usize,
    /// Number of instances of its mesh.
    instances: usize,
    /// Area of the mesh in the scene, all instances together.
    area: f64,
}

/// Simplifies each mesh under the stop separately. A mesh in which no face has an area is unchanged.
pub(super) fn simplify_each(
    parts: &[Part<'_>],
    diagonal: f64,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<SimplifiedScene, SimplifyError> {
    let is_placed = parts.iter().any(|p| p.instances > 0);
    let all: usize = parts.iter().map(|p| p.mesh.face_count()).sum();
    let (mut meshes, mut counts, mut runs) = (Vec::new(), Vec::new(), Vec::new());
    let mut begun = 0usize;
    for (i, part) in parts.iter().enumerate() {
        let alone = Part { instances: 1, system: None, places: &[], ..*part };
        let share = |n: usize| n as f64 / all.max(1) as f64;
        let mut own = ProgressShare { control, begin: share(begun), length: share(part.mesh.face_count()) };
        begun += part.mesh.face_count();
        let alone = [alone];
        let joined = JoinedScene::new(&alone, diagonal, options)?;
        let (mesh, reached) = match joined.run_to(&options.stop, &mut own) {
            Ok(SimplifiedScene { mut meshes, report, .. }) => {
                let times = if is_placed { part.instances } else { 1 };
                let area = part.area() * times as f64;
                let reached = report.reached;
                runs.push(WeightedReport { report, part: i, instances: times, area });
                (meshes.swap_remove(0), reached)
            }
            Err(SimplifyError::NoFaces { .. }) => (part.mesh.clone(), true),
            Err(other) => return Err(other),
        };
        counts.push(MeshCounts::new(part, &mesh, reached));
        meshes.push(mesh);
    }
    let faces = || parts.iter().map(|p| p.mesh.face_count()).sum();
    let mut report = sum(runs, diagonal).ok_or_else(|| SimplifyError::NoFaces { faces: faces() })?;
    let times = |p: &Part<'_>| if is_placed { p.instances } else { 1 };
    let count =
        |of: &dyn Fn(usize) -> usize| (0..parts.len()).map(|i| of(i).saturating_mul(times(&parts[i]))).sum();
    report.input_faces = count(&|i| parts[i].mesh.face_count());
    report.input_vertices = count(&|i| parts[i].mesh.vertex_count());
    report.faces = count(&|i| TriMesh::face_count(&meshes[i]));
    report.vertices = count(&|i| TriMesh::vertex_count(&meshes[i]));
    let error = &mut report.error;
    if let (Some(part), Some(measured)) = (error.farthest_part, &mut error.measured) {
        measured.farthest.iter_mut().for_each(|farthest| move_to_scene(farthest, parts[part].places));
    }
    report.gaps = Touching::find(parts, true).map_or(0, |touching| touching.gaps(parts, &meshes));
    Ok(SimplifiedScene { meshes, report, counts })
}

/// Combines the reports of all runs: sums, means over the area, and the reason of the first run that missed
/// its target.
fn sum(runs: Vec<WeightedReport>, diagonal: f64) -> Option<Report> {
    let total: f64 = runs.iter().map(|r| r.area).sum();
    let weight = |r: &WeightedReport| if total > 0.0 { r.area / total } else { 1.0 / runs.len() as f64 };
    let squares = runs.iter().map(|r| weight(r) * r.report.error.estimate.powi(2)).sum::<f64>();
    let measured: Option<Vec<(f64, &Comparison)>> =
        runs.iter().map(|r| Some((weight(r), r.report.error.measured.as_ref()?))).collect();
    let farthest = measured.as_ref().and_then(|all| farthest(all));
    let mut measured = measured.and_then(|all| mean(&all, diagonal));
    if let Some(measured) = &mut measured {
        measured.farthest = farthest.and_then(|run| runs[run].report.error.measured.as_ref()?.farthest);
    }
    let lead = runs.iter().position(|r| !r.report.reached).unwrap_or(0);
    let mut report = runs.get(lead)?.report.clone();
    report.error.estimate = squares.sqrt();
    report.error.measured = measured;
    report.error.farthest_part = farthest.map(|run| runs[run].part);
    report.error.is_incomplete = runs.iter().any(|r| r.report.error.is_incomplete);
    report.error.bound = runs.iter().map(|r| r.report.error.bound).reduce(|a, b| Some(a?.max(b?))).flatten();
    report.error.diagonal = diagonal;
    let refused = |why: Refusal| {
        let of =
            |r: &WeightedReport| r.report.refusals.iter().filter(|x| x.0 == why).map(|x| x.1).sum::<u64>();
        runs.iter().map(of).sum::<u64>()
    };
    report.refusals = Refusal::ALL.into_iter().map(|r| (r, refused(r))).filter(|r| r.1 > 0).collect();
    report.reached = runs.iter().all(|r| r.report.reached);
    if report.reached && report.stopped_by == StoppedBy::Nothing {
        // The reason of a mesh that was light enough already does not apply to the others.
        let other = runs.iter().map(|r| r.report.stopped_by).find(|s| *s != StoppedBy::Nothing);
        report.stopped_by = other.unwrap_or(StoppedBy::Nothing);
    }
    report.cleanup = Default::default();
    report.pruned = Default::default();
    (report.collapses, report.parts_removed) = (0, 0);
    (report.necks_cut, report.pairs_contracted) = (0, 0);
    (report.two_sided_pairs, report.unpaired_sheets) = (0, 0);
    (report.seams_relaxed, report.sharp_relaxed, report.fitted) = (false, false, false);
    report.dropped.clear();
    report.escalated.clear();
    for run in &runs {
        let (r, times) = (&run.report, run.instances);
        report.collapses += r.collapses;
        report.parts_removed += r.parts_removed;
        report.necks_cut += r.necks_cut;
        report.pairs_contracted += r.pairs_contracted;
        report.two_sided_pairs += times * r.two_sided_pairs;
        report.unpaired_sheets += times * r.unpaired_sheets;
        report.seams_relaxed |= r.seams_relaxed;
        report.sharp_relaxed |= r.sharp_relaxed;
        report.fitted |= r.fitted;
        report.pruned.parts += times * r.pruned.parts;
        report.pruned.faces += times * r.pruned.faces;
        report.pruned.largest_kept |= r.pruned.largest_kept;
        let (all, own) = (&mut report.cleanup, &r.cleanup);
        all.welded_vertices += own.welded_vertices;
        all.degenerate_faces += own.degenerate_faces;
        all.duplicate_faces += own.duplicate_faces;
        all.non_finite_faces += own.non_finite_faces;
        all.unused_vertices += own.unused_vertices;
        for step in &r.escalated {
            let Escalation { change, before, after } = *step;
            match report.escalated.iter_mut().find(|s| s.change == change) {
                Some(all) => {
                    (all.before, all.after) = (all.before + times * before, all.after + times * after)
                }
                None => {
                    let step = Escalation { change, before: times * before, after: times * after };
                    report.escalated.push(step);
                }
            }
        }
        for &name in &r.dropped {
            if !report.dropped.contains(&name) {
                report.dropped.push(name);
            }
        }
    }
    Some(report)
}

/// Returns the index of the comparison with the largest distance, the first among equals; `None` if none has one.
fn farthest(all: &[(f64, &Comparison)]) -> Option<usize> {
    let farther = |best: usize, i: usize| {
        if all[i].1.hausdorff.symmetric > all[best].1.hausdorff.symmetric { i } else { best }
    };
    (0..all.len()).reduce(farther).filter(|i| all[*i].1.farthest.is_some())
}

/// Returns the maximum of maxima and the weighted mean of means.
fn mean(all: &[(f64, &Comparison)], diagonal: f64) -> Option<Comparison> {
    let mut sum = *all.first()?.1;
    let largest = |of: fn(&Comparison) -> &TwoWay| {
        let most = |of_way: fn(&TwoWay) -> f64| all.iter().map(|c| of_way(of(c.1))).fold(0f64, f64::max);
        TwoWay {
            forward: most(|t| t.forward),
            backward: most(|t| t.backward),
            symmetric: most(|t| t.symmetric),
        }
    };
    let power = |of: fn(&Comparison) -> &TwoWay, p: i32| {
        let mean = |of_way: fn(&TwoWay) -> f64| {
            let sum = all.iter().map(|(w, c)| w * of_way(of(c)).powi(p)).sum::<f64>();
            libm::pow(sum, 1.0 / f64::from(p))
        };
        TwoWay {
            forward: mean(|t| t.forward),
            backward: mean(|t| t.backward),
            symmetric: mean(|t| t.symmetric),
        }
    };
    (sum.hausdorff, sum.p99) = (largest(|c| &c.hausdorff), largest(|c| &c.p99));
    (sum.mean, sum.rms) = (power(|c| &c.mean, 1), power(|c| &c.rms, 2));
    sum.normal_mean_deg = all.iter().map(|(w, c)| w * c.normal_mean_deg).sum();
    sum.normal_p95_deg = all.iter().map(|c| c.1.normal_p95_deg).fold(0f64, f64::max);
    sum.samples = all.iter().map(|c| c.1.samples).sum();
    sum.diagonal = diagonal;
    Some(sum)
}
