//! Open borders and defects of the shown models.

use std::sync::{Arc, PoisonError};

use lodsmith_core::Model;

use super::{Document, Outcome};
use crate::content::Original;
use crate::flaws::Flaws;
use crate::job::{JobControl, JobKind};
use crate::shown::{Drawing, ShownModel};

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
        if !one {
            let (of, key) = (original.clone(), original.key());
            self.worker.submit(JobKind::Flaws, move |_: &mut JobControl| {
                Some(found(0, key, of.content.model(), of.draw.as_ref()))
            });
        } else if let Some(lighter) = self.lighter.clone().filter(|l| !two && l.content.report.is_some()) {
            let key = lighter.key();
            self.worker.submit(JobKind::Flaws, move |_: &mut JobControl| {
                Some(found(1, key, &lighter.content.model, lighter.draw.as_ref()))
            });
        }
    }
}

/// Finds the borders and defects of a model, and writes their lines into its buffers.
fn found(which: usize, key: usize, model: &Model, drawing: Option<&Drawing>) -> Outcome {
    let flaws = Arc::new(Flaws::of(model));
    if let Some(drawing) = drawing {
        for (i, marks) in flaws.marks.iter().enumerate() {
            drawing.lock().unwrap_or_else(PoisonError::into_inner).set_marks(i, marks);
        }
    }
    Outcome::Flaws { which, key, flaws }
}
