//! The measured differences of both sides: values of the heat map.

use std::sync::Arc;

use super::Document;
use super::jobs::Job;
use crate::content::{Distances, Original};
use crate::gpu::shown::ShownModel;
use crate::job::JobKind;
use crate::settings::HeatOf;

impl Document {
    /// Returns the distances between the latest result and the original, if they were measured.
    pub fn distances(&self) -> Option<&Arc<Distances>> {
        let measured = self.measured.as_ref()?;
        let fits = Arc::ptr_eq(&measured.of.1, &self.lighter.as_ref()?.content);
        self.latest_distances().filter(|_| fits)
    }

    /// Returns the distances that were measured last, of this result or of one before it; while a preview level is
    /// shown, those of the last exact result.
    pub fn latest_distances(&self) -> Option<&Arc<Distances>> {
        let measured = self.measured.as_ref()?;
        let fits = measured.distances.quantity == self.settings.look.heat_of
            && Arc::ptr_eq(&measured.of.0, &self.original.as_ref()?.content);
        fits.then_some(&measured.distances)
    }

    /// Returns the error that the target allows, in the units of the scene, if it is an error and distances are shown.
    pub fn error_limit(&self) -> Option<f64> {
        let is_shown = self.settings.look.heat_of == HeatOf::Distance;
        let error = self.settings.simplify.options.stop.error.filter(|_| is_shown)?;
        Some(error.in_units(self.original_size()?.diagonal)).filter(|limit| *limit > 0.0)
    }

    /// Returns the value in the last colour of the heat map, unless the user chose it: what the target allows, else the
    /// largest value.
    pub fn heat_end(&self, distances: &Distances) -> f64 {
        self.error_limit().unwrap_or(distances.largest)
    }

    /// Starts the job that measures the differences of both sides, if they are needed.
    pub(super) fn measure(&mut self, original: &ShownModel<Original>) {
        let Some(lighter) = self.lighter.clone().filter(|l| l.content.report.is_some()) else { return };
        let is_due = self.wants_distances && self.distances().is_none();
        if !is_due || self.worker.is_busy(JobKind::Measure) || self.is_outdated() {
            return;
        }
        let quantity = self.settings.look.heat_of;
        self.worker.submit(Job::Measure { original: original.clone(), lighter, quantity });
    }
}
