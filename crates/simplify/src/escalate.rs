//! Escalation: pairs and looser topology policies, step by step, while the target is out of reach.

use crate::SimplifyError;
use crate::constraints::HeldWedges;
use crate::options::{SimplifyOptions, TopologyPolicy};
use crate::proposal::Change;
use crate::report::{Escalation, Simplified, StoppedBy};
use lodsmith_core::{Topology, TriMesh};

/// Returns the changes to try in turn if these options do not reach their target. Seams are relaxed within a
/// run without it; borders and guards are the user's choice and stay. Pairs stay on for later steps if they
/// helped.
fn steps(options: &SimplifyOptions) -> Vec<Change> {
    let looser: &[TopologyPolicy] = match options.topology {
        TopologyPolicy::Preserve => &[TopologyPolicy::Relaxed, TopologyPolicy::Free],
        TopologyPolicy::Relaxed => &[TopologyPolicy::Free],
        TopologyPolicy::Free => &[],
    };
    Change::pairs_change(options).into_iter().chain(looser.iter().map(|t| Change::Topology(*t))).collect()
}

/// Returns true if pairs have nothing to join.
fn has_one_part(mesh: &TriMesh) -> bool {
    Topology::new(&mesh.surface()).components().count() <= 1
}

/// Runs, and repeats the run with one step after the other while refusals keep the result above its target.
/// Returns the lightest result, the first of equals; its report lists all steps.
pub(crate) fn run_escalating(
    options: &SimplifyOptions,
    mut run: impl FnMut(&SimplifyOptions) -> Result<(Simplified, HeldWedges), SimplifyError>,
) -> Result<(Simplified, HeldWedges), SimplifyError> {
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
        let changed = change.apply(&options);
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
