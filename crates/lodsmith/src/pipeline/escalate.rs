//! Escalation: pairs and looser topology policies, step by step, while the target is out of reach.

use lodsmith_core::{Topology, TriMesh};

use crate::options::{SimplifyOptions, TopologyPolicy};
use crate::proposal::Change;
use crate::report::{Escalation, StoppedBy};
use crate::run::Done;

/// Returns the changes to try in turn if these options do not reach their target. Seams are not among them,
/// since every run relaxes them by itself; borders and guards are the user's choice and stay. Pairs stay on
/// for later steps if they helped.
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

/// Results of one input with ever looser options, while refusals keep them above their target.
pub(crate) struct Attempts {
    /// The lightest result; of equally light ones, the first.
    best: Done,
    tried: Vec<Escalation>,
    /// Options with the changes that are kept.
    options: SimplifyOptions,
    left: std::vec::IntoIter<Change>,
}

impl Attempts {
    /// Starts with the result of the unchanged options.
    pub(crate) fn new(options: &SimplifyOptions, first: Done) -> Self {
        let left = if options.escalate { steps(options) } else { Vec::new() };
        Self { best: first, tried: Vec::new(), options: options.clone(), left: left.into_iter() }
    }

    /// Returns the next change to try; `None` if the target is reached or nothing is left.
    pub(crate) fn next_change(&mut self) -> Option<Change> {
        let report = &self.best.0.report;
        if report.reached || report.stopped_by != StoppedBy::Refusals {
            return None;
        }
        let best = &self.best.0.mesh;
        self.left.find(|change| !(matches!(change, Change::Pairs(_)) && has_one_part(best)))
    }

    pub(crate) fn changed_options(&self, change: Change) -> SimplifyOptions {
        change.apply(&self.options)
    }

    /// Adds the result of [`Attempts::changed_options`].
    pub(crate) fn add(&mut self, change: Change, done: Done) {
        let (before, after) = (self.best.0.report.faces, done.0.report.faces);
        self.tried.push(Escalation { change, before, after });
        if done.0.report.stopped_by == StoppedBy::Caller {
            self.left = Vec::new().into_iter();
        }
        let is_better = done.0.report.reached || after < before;
        if is_better {
            self.best = done;
        }
        if is_better || !matches!(change, Change::Pairs(_)) {
            self.options = self.changed_options(change);
        }
    }

    /// Returns the best result; its report lists all changes that were tried.
    pub(crate) fn into_best(self) -> Done {
        let mut best = self.best;
        best.0.report.escalated = self.tried;
        best
    }
}
