//! Looser topology, step by step, while the target is out of reach.

use crate::care::Held;
use crate::options::{SimplifyOptions, TopologyPolicy};
use crate::proposal::Change;
use crate::report::StoppedBy;
use crate::{Simplified, SimplifyError};

/// A step of an escalation, and what came of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Escalation {
    /// What was changed.
    pub change: Change,
    /// Triangles of the run before.
    pub before: usize,
    /// Triangles of the run with the change.
    pub after: usize,
}

/// What may be tried when these options do not reach their target, in turn. Seams give way by themselves, within a run;
/// borders and guards are their owner's will, and stay.
fn steps(options: &SimplifyOptions) -> &'static [TopologyPolicy] {
    match options.topology {
        TopologyPolicy::Preserve => &[TopologyPolicy::Relaxed, TopologyPolicy::Free],
        TopologyPolicy::Relaxed => &[TopologyPolicy::Free],
        TopologyPolicy::Free => &[],
    }
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
    for &topology in steps(options) {
        if best.0.report.reached || best.0.report.stopped_by != StoppedBy::Refusals {
            break;
        }
        let change = Change::Topology(topology);
        let done = run(&change.applied(options))?;
        let (before, after) = (best.0.report.faces, done.0.report.faces);
        tried.push(Escalation { change, before, after });
        if done.0.report.reached || after < before {
            best = done;
        }
    }
    best.0.report.escalated = tried;
    Ok(best)
}
