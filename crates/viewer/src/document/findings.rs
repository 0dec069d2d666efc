//! Findings about the shown models: topology counts, open borders and defects.

use std::sync::Arc;

use super::{Document, Job, OfSides};
use crate::content::flaws::Flaws;
use crate::content::{Lighter, Original, TopologySummary};
use crate::gpu::shown::ShownModel;
use crate::job::JobKind;

impl Document {
    /// Returns the topology counts of the original and of the result, as far as they are known.
    pub fn topologies(&self) -> [Option<&TopologySummary>; 2] {
        self.of_shown(&self.topologies)
    }

    /// Returns the borders and defects of the original and of the result, as far as they are known.
    pub fn flaws(&self) -> [Option<&Arc<Flaws>>; 2] {
        self.of_shown(&self.flaws)
    }

    /// Returns the findings that are of the shown models.
    fn of_shown<'a, T>(&'a self, all: &'a OfSides<T>) -> [Option<&'a T>; 2] {
        let keys = [self.original.as_ref().map(ShownModel::key), self.lighter.as_ref().map(ShownModel::key)];
        std::array::from_fn(|side| {
            all[side].as_ref().filter(|known| Some(known.0) == keys[side]).map(|known| &known.1)
        })
    }

    /// Sets whether borders or defects are shown, so that they have to be found.
    pub fn set_wanted_flaws(&mut self, are_wanted: bool) {
        if std::mem::replace(&mut self.wants_flaws, are_wanted) != are_wanted {
            self.sync();
        }
    }

    /// Starts the jobs that count the topology of a side and find its borders and defects, if they are needed.
    pub(super) fn find(&mut self, original: &ShownModel<Original>) {
        if self.is_outdated() {
            return;
        }
        if self.wants_topology && !self.worker.is_busy(JobKind::Inspect) {
            let known = self.topologies().map(|topology| topology.is_some());
            if let Some(result) = self.next_side(known) {
                self.worker.submit(Job::Inspect { original: original.clone(), result });
            }
        }
        if self.wants_flaws && !self.worker.is_busy(JobKind::Flaws) {
            let known = self.flaws().map(|flaws| flaws.is_some());
            if let Some(result) = self.next_side(known) {
                self.worker.submit(Job::Flaws { original: original.clone(), result });
            }
        }
    }

    /// Returns the first side without a finding: no result for the original, else the exact result.
    fn next_side(&self, known: [bool; 2]) -> Option<Option<ShownModel<Lighter>>> {
        if !known[0] {
            return Some(None);
        }
        let exact = self.lighter.as_ref().filter(|l| l.content.report.is_some());
        exact.filter(|_| !known[1]).cloned().map(Some)
    }
}
