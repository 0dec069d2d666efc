//! Levels that are chosen by distance.

use super::{Document, Job};
use crate::content::{Lighter, Original};
use crate::gpu::shown::ShownModel;
use crate::settings::simplification::Simplification;

impl Document {
    /// Returns the automatic levels, from the finest; none while they are off or not made yet.
    pub fn levels(&self) -> &[ShownModel<Lighter>] {
        if self.settings.auto_lod.is_on { self.levels_made() } else { &[] }
    }

    /// Returns the levels of the open file for the present options; none if they are not made.
    pub(super) fn levels_made(&self) -> &[ShownModel<Lighter>] {
        let of = self.level_source();
        self.levels.as_ref().filter(|set| Some(&set.of) == of.as_ref()).map_or(&[], |set| &set.levels)
    }

    /// Returns the number and the coarsest level whose error is at most this, in the units of the model.
    /// Levels count from 1; 0 is the original.
    pub fn level_for(&self, error: f64) -> (usize, Option<&ShownModel<Lighter>>) {
        let levels = self.levels();
        let number = levels.iter().take_while(|l| l.content.error() <= error).count();
        (number, number.checked_sub(1).map(|i| &levels[i]))
    }

    pub(super) fn level_source(&self) -> Option<(usize, Simplification)> {
        let mut how = self.settings.simplify.clone();
        how.options.stop = lodsmith::Stop::default();
        Some((self.original.as_ref()?.key(), how))
    }

    /// Starts the job for the automatic levels, if they are needed.
    pub(super) fn make_levels(&mut self, original: &ShownModel<Original>) {
        let is_wanted = self.settings.auto_lod.is_on || self.settings.stage.is_on;
        let Some(of) = self.level_source().filter(|_| is_wanted) else { return };
        if self.requested_levels.as_ref() == Some(&of) {
            return;
        }
        self.requested_levels = Some(of.clone());
        self.worker.submit(Job::Levels { original: original.clone(), of });
    }
}
