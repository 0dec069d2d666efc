//! Pairs and looser topology, step by step, while the target is out of reach.

use crate::SimplifyError;
use crate::care::Held;
use crate::options::{SimplifyOptions, TopologyPolicy};
use crate::proposal::Change;
use crate::report::{Escalation, Simplified, StoppedBy};
use lodsmith_core::{Topology, TriMesh};

/// What may be tried when these options do not reach their target, in turn. Seams give way by themselves, within a run;
/// borders and guards are their owner's will, and stay. Pairs stay for the steps after them where they helped.
fn steps(options: &SimplifyOptions) -> Vec<Change> {
    let looser: &[TopologyPolicy] = match options.topology {
        TopologyPolicy::Preserve => &[TopologyPolicy::Relaxed, TopologyPolicy::Free],
        TopologyPolicy::Relaxed => &[TopologyPolicy::Free],
        TopologyPolicy::Free => &[],
    };
    Change::to_pairs(options).into_iter().chain(looser.iter().map(|t| Change::Topology(*t))).collect()
}

/// Whether pairs have nothing to join.
fn has_one_part(mesh: &TriMesh) -> bool {
    Topology::new(&mesh.surface()).components().count() <= 1
}

/// Runs, and again with one step after the other while refusals keep the result above its target. The lightest result
/// is returned, the first of equals; its report tells all steps.
pub(crate) fn escalated(
    options: &SimplifyOptions,
    mut run: impl FnMut(&SimplifyOptions) -> Result<(Simplified, Held), SimplifyError>,
) -> Result<(Simplified, Held), SimplifyError> {
    let mut best = run(options)?;
    if !options.escalate {
        return Ok(best);
    }
    let mut tried = Vec::new();
    let mut options = options.clone();
    for change in steps(&options) {
        if best.0.report.reached || best.0.report.stopped_by != StoppedBy::Refusals {
            break;
        }
        let is_pairs = matches!(change, Change::Pairs(_));
        if is_pairs && has_one_part(&best.0.mesh) {
            continue;
        }
        let changed = change.applied(&options);
        let done = run(&changed)?;
        let (before, after) = (best.0.report.faces, done.0.report.faces);
        tried.push(Escalation { change, before, after });
        let is_better = done.0.report.reached || after < before;
        if is_better {
            best = done;
        }
        if is_better || !is_pairs {
            options = changed;
        }
    }
    best.0.report.escalated = tried;
    Ok(best)
}
