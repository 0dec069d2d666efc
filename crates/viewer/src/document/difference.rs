//! The difference picture of the two sides.

use std::sync::Arc;

use super::jobs::Job;
use super::{DifferenceState, Document};
use crate::difference::{DifferencePicture, DifferenceView};
use crate::job::JobKind;

impl Document {
    /// Returns the last difference picture, which may show another view than the present one; `None` if it is of
    /// another file.
    pub fn difference(&self) -> Option<&Arc<DifferencePicture>> {
        let original = &self.original.as_ref()?.content;
        self.difference.last.as_ref().filter(|d| Arc::ptr_eq(&d.of.original, original))
    }

    /// Starts drawing a difference picture, unless it is there or another one is being drawn: that is shown
    /// first, so that a moving camera gives pictures all the time.
    pub fn want_difference(&mut self, view: DifferenceView) {
        let is_busy = self.worker.is_busy(JobKind::Difference);
        if is_busy || self.worker.is_busy(JobKind::Simplify) || self.difference.asked.as_ref() == Some(&view)
        {
            return;
        }
        self.difference.asked = Some(view.clone());
        let prepared = self.difference.prepared.clone();
        self.worker.submit(Job::Difference { view: Box::new(view), prepared });
    }

    /// Forgets the difference picture and the models prepared for it: they take as much memory as the models.
    pub fn drop_difference(&mut self) {
        if self.difference.asked.is_some() {
            self.worker.cancel(&[JobKind::Difference]);
            self.difference = DifferenceState::default();
        }
    }
}
