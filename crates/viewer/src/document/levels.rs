//! Levels that are chosen by distance.

use std::sync::{Arc, Mutex};

use super::{Document, Outcome};
use crate::content::{Lighter, Original};
use crate::job::JobKind;
use crate::option_words::Simplification;
use crate::shown::ShownModel;

/// Fractions of the triangles of the automatic levels.
const AUTO_LEVEL_RATIOS: [f64; 9] = [0.5, 0.25, 0.125, 0.0625, 0.03, 0.015, 0.0075, 0.0035, 0.0015];

/// Levels with fewer triangles are not made.
const MIN_LEVEL_FACES: f64 = 50.0;

/// Returns the fractions of the triangles that the levels of a model have.
pub(crate) fn level_ratios(faces: usize) -> Vec<f64> {
    let fewest = MIN_LEVEL_FACES / faces.max(1) as f64;
    AUTO_LEVEL_RATIOS.into_iter().filter(|r| *r > fewest).collect()
}

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
        let (context, original) = (self.context.clone(), original.clone());
        self.worker.submit(JobKind::Levels, move |watch| {
            let ratios = level_ratios(original.content.faces);
            let made = Lighter::chain(&original.content, &of.1, &ratios, watch);
            let shown = |level: Lighter| {
                let draw = context.as_ref().map(|c| Arc::new(Mutex::new(c.upload(&level.model))));
                ShownModel { content: Arc::new(level), draw }
            };
            let result = made.map(|levels| levels.into_iter().map(shown).collect());
            Some(Outcome::Levels { of, result })
        });
    }
}
