//! Construction of the report of a run.

use lodsmith_core::{Attribute, TriMesh};

use super::context::{Done, Finished};
use super::goal::{goal, share};
use crate::Simplified;
use crate::collapse::StopReason;
use crate::collapse::order::Ordered;
use crate::constraints::Constraints;
use crate::deviation::ROUNDING;
use crate::input::Input;
use crate::options::SimplifyOptions;
use crate::prune::Pruned;
use crate::report::{ErrorReport, Refusal, Report, StoppedBy};

/// Builds the result and its report.
pub(super) fn build_report(
    input: &Input<'_>,
    options: &SimplifyOptions,
    ordered: &Ordered,
    constraints: &Constraints,
    (outcome, deviation, by_error): Finished,
) -> Done {
    let surface = &input.surface;
    let input_faces = surface.triangles().len();
    let goal = goal(options, input_faces);
    let limit = options.stop.error.map(|e| e.in_units(ordered.diagonal));
    let mut cleanup = ordered.cleanup;
    cleanup.duplicate_faces = outcome.duplicate_faces;
    let met = |n: Option<usize>, count: usize| n.is_some_and(|n| count <= n);
    let (faces, vertices) = (outcome.mesh.face_count(), outcome.mesh.vertex_count());
    let stop = &options.stop;
    let stopped_by = match outcome.end {
        StopReason::Finish => StoppedBy::Caller,
        _ if met(stop.faces, faces) => StoppedBy::Faces,
        _ if met(stop.vertices, vertices) => StoppedBy::Vertices,
        _ if met(stop.ratio.map(|r| share(r, input_faces)), faces) => StoppedBy::Ratio,
        _ if by_error => StoppedBy::Error,
        StopReason::Exhausted => StoppedBy::Exhausted,
        _ if goal.is_none() && limit.is_none() && outcome.end != StopReason::Stuck => StoppedBy::Nothing,
        _ => StoppedBy::Refusals,
    };
    // If there is only an error limit, any result within it reaches it.
    let rounding = ROUNDING * ordered.diagonal;
    let within = |l: f64| deviation.largest().is_some_and(|d| d <= l + rounding);
    let reached = match stopped_by {
        StoppedBy::Caller => false,
        StoppedBy::Error => limit.is_some_and(within),
        StoppedBy::Exhausted => goal.is_none(),
        StoppedBy::Refusals => goal.is_none() && limit.is_some_and(within),
        _ => true,
    };
    let dropped = input.mesh.map_or_else(Vec::new, |mesh| names_of_dropped(mesh, &outcome.mesh));
    let report = Report {
        input_faces,
        input_vertices: surface.positions().len(),
        faces,
        vertices,
        reached,
        stopped_by,
        // Costs along borders are not areas: on needles they can exceed the area without limit.
        error: ErrorReport {
            estimate: outcome.estimate.min(ordered.diagonal),
            measured: deviation.measured,
            farthest_part: None,
            bound: deviation.bound,
            is_incomplete: deviation.is_incomplete,
            diagonal: ordered.diagonal,
        },
        refusals: Refusal::ALL.into_iter().zip(outcome.tally.refusals).filter(|r| r.1 > 0).collect(),
        collapses: outcome.tally.collapses,
        parts_removed: outcome.tally.parts_removed,
        necks_cut: outcome.tally.necks_cut,
        pairs_contracted: outcome.tally.pairs_contracted,
        locked_vertices: constraints.locked_vertices(),
        locked_faces: constraints.locked_faces(),
        seams_relaxed: outcome.relaxed.seams,
        sharp_relaxed: outcome.relaxed.sharp_edges,
        cleanup,
        dropped,
        fitted: outcome.engine.fitted,
        proposals: outcome.engine.proposals,
        escalated: Vec::new(),
        pruned: Pruned::default(),
        gaps: 0,
        two_sided_pairs: 0,
        unpaired_sheets: 0,
        clustered: None,
        faces_visited: outcome.tally.faces_visited,
    };
    (Simplified { mesh: outcome.mesh, report }, outcome.held)
}

/// Returns the names of attributes missing in the result: joints without weights of the same set, or
/// weights without joints.
pub(crate) fn names_of_dropped(input: &TriMesh, result: &TriMesh) -> Vec<&'static str> {
    let is_there = |a: &&Attribute| {
        result.further_attributes().iter().any(|b| (&b.semantic, b.width) == (&a.semantic, a.width))
    };
    let gone = input.further_attributes().iter().filter(|a| !is_there(a));
    let mut names: Vec<_> = gone.map(|a| a.semantic.title()).collect();
    names.dedup();
    names
}
