//! The difference picture of the two sides.

use std::sync::Arc;

use super::jobs::Job;
use super::{DifferenceState, Document};
use crate::content::difference::{DifferencePicture, DifferenceView};
use crate::job::JobKind;
use crate::settings::Sides;

impl Document {
    /// Returns the last difference picture, which may show another view than the present one; `None` if it is of
    /// another file.
    pub fn difference(&self) -> Option<&Arc<DifferencePicture>> {
        let original = &self.original.as_ref()?.content;
        self.difference.last.as_ref().filter(|d| Arc::ptr_eq(&d.of.original, original))
    }

    /// Starts drawing a difference picture, unless it is complete. If another one is being drawn, that one is shown
    /// first, so that pictures follow a moving camera.
    pub fn want_difference(&mut self, view: DifferenceView) {
        let is_busy = self.worker.is_busy(JobKind::Difference) || self.worker.is_busy(JobKind::Simplify);
        if is_busy || self.difference.asked.as_ref() == Some(&view) || !self.has_difference_view() {
            return;
        }
        // A worker of a page makes the exact result that follows.
        if self.worker.is_elsewhere() && view.lighter.report.is_none() {
            return;
        }
        self.difference.asked = Some(view.clone());
        let prepared = self.difference.prepared.clone();
        self.worker.submit(Job::Difference { view: Box::new(view), prepared });
    }

    /// Keeps a difference picture, unless another one was requested since then.
    pub(super) fn take_difference(&mut self, picture: Arc<DifferencePicture>) {
        if self.difference.asked.as_ref() == Some(&picture.of) {
            self.difference.last = Some(picture);
        }
    }

    /// Forgets the difference picture and the models prepared for it when it is not shown: they take as much
    /// memory as the models.
    pub(super) fn drop_unseen_difference(&mut self) {
        if self.difference.asked.is_some() && !self.has_difference_view() {
            self.worker.cancel(&[JobKind::Difference]);
            self.difference = DifferenceState::default();
        }
    }

    fn has_difference_view(&self) -> bool {
        self.settings.layout.sides == Sides::Difference
    }
}
