//! Open borders and defects of the shown models.

use std::sync::Arc;

use super::{Document, Job};
use crate::content::Original;
use crate::content::flaws::Flaws;
use crate::gpu::shown::ShownModel;
use crate::job::JobKind;

impl Document {
    /// Returns the borders and defects of the original and of the result, as far as they are known.
    pub fn flaws(&self) -> [Option<&Arc<Flaws>>; 2] {
        let keys = [self.original.as_ref().map(ShownModel::key), self.lighter.as_ref().map(ShownModel::key)];
        let known = |which: usize| {
            self.flaws[which].as_ref().filter(|known| Some(known.0) == keys[which]).map(|known| &known.1)
        };
        [known(0), known(1)]
    }

    /// Sets whether borders or defects are shown, so that they have to be found.
    pub fn set_wanted_flaws(&mut self, are_wanted: bool) {
        if std::mem::replace(&mut self.wants_flaws, are_wanted) != are_wanted {
            self.sync();
        }
    }

    /// Starts the job that finds borders and defects of a side, if they are needed.
    pub(super) fn find_flaws(&mut self, original: &ShownModel<Original>) {
        if !self.wants_flaws || self.worker.is_busy(JobKind::Flaws) || self.is_outdated() {
            return;
        }
        let [one, two] = self.flaws().map(|f| f.is_some());
        let result = self.lighter.clone().filter(|l| !two && l.content.report.is_some());
        if !one {
            self.worker.submit(Job::Flaws { original: original.clone(), result: None });
        } else if result.is_some() {
            self.worker.submit(Job::Flaws { original: original.clone(), result });
        }
    }
}
