//! The progressive mesh from which the slider previews.

use super::Document;
use super::jobs::{Job, PreviewMade};
use crate::content::Original;
use crate::content::slider_preview::{self, LevelChange, LevelView, Preview};
use crate::gpu::shown::ShownModel;
use crate::job::{Failure, JobKind, Progress};
use crate::numbers::{grouped, seconds};
use crate::settings::simplification::Simplification;

impl Document {
    /// Returns true if the slider can preview any level at once.
    pub fn has_preview(&self) -> bool {
        self.preview.is_some() && self.requested_preview == self.level_source()
    }

    /// Returns true if the shown result is a preview level, for which there was no run.
    pub fn shows_preview(&self) -> bool {
        self.lighter.as_ref().is_some_and(|lighter| lighter.content.report.is_none())
    }

    /// Returns the progress of the progressive mesh while it is being made.
    pub fn preview_progress(&self) -> Option<Progress> {
        self.builder.progress().filter(|progress| progress.kind == JobKind::Preview)
    }

    /// Shows the preview level for a target, or requests it; returns false if there is none.
    pub(super) fn show_preview_level(&mut self, how: &Simplification) -> bool {
        if !self.has_preview() {
            return false;
        }
        let shown = match (&mut self.preview, &self.original) {
            (Some(Preview::Here(preview)), _) => preview.show(how),
            (Some(Preview::Elsewhere(_)), Some(original)) => {
                self.builder.submit(Job::Level { original: original.content.clone(), how: how.clone() });
                Ok(self.lighter.clone())
            }
            _ => return false,
        };
        match shown {
            Ok(Some(level)) => {
                self.worker.cancel(&[JobKind::Simplify, JobKind::Measure, JobKind::Inspect]);
                self.lighter = Some(level);
                true
            }
            Ok(None) => matches!(self.preview, Some(Preview::Elsewhere(_))),
            Err(why) => {
                self.fail(why.to_string());
                false
            }
        }
    }

    /// Shows a level that another process went to.
    pub(super) fn take_level(&mut self, how: &Simplification, change: LevelChange) {
        let Some(Preview::Elsewhere(view)) = &mut self.preview else { return };
        let level = view.apply(change, how, self.context.as_ref());
        // An exact result stays.
        if self.needs_exact_run || self.worker.is_busy(JobKind::Simplify) {
            self.lighter = Some(level);
        }
    }

    /// Starts the job for the progressive mesh, if file or method changed.
    pub(super) fn start_preview(&mut self, original: &ShownModel<Original>) {
        let Some(of) = self.level_source() else { return };
        if self.requested_preview.as_ref() == Some(&of) {
            return;
        }
        self.drop_preview();
        self.requested_preview = Some(of.clone());
        let faces = original.content.faces;
        if faces > slider_preview::MAX_FACES {
            let most = grouped(slider_preview::MAX_FACES);
            let text =
                format!("{} faces are more than {most}, the limit for a progressive mesh", grouped(faces));
            return self.log.note(format!("the slider runs the method for each value ({text})"));
        }
        self.builder.submit(Job::Preview { original: original.content.clone(), of });
    }

    pub(super) fn take_preview(
        &mut self,
        of: &(usize, Simplification),
        secs: f64,
        result: Result<PreviewMade, Failure>,
    ) {
        if self.requested_preview.as_ref() != Some(of) {
            return;
        }
        let made = match result {
            Ok(made) => made,
            Err(Failure::Cancelled) => return,
            Err(Failure::Error(why)) => {
                return self.log.note(format!("the slider runs the method for each value ({why})"));
            }
        };
        let levels = match &made {
            PreviewMade::Here(preview) => preview.levels(),
            PreviewMade::Elsewhere(levels) => *levels,
        };
        self.log.note(format!(
            "the slider shows results immediately: progressive mesh of {} levels built in {}",
            grouped(levels),
            seconds(secs)
        ));
        self.preview = match made {
            PreviewMade::Here(preview) => Some(Preview::Here(preview)),
            PreviewMade::Elsewhere(_) => self.original.as_ref().map(|original| {
                let view = LevelView::new(original.content.model().clone(), None);
                Preview::Elsewhere(view)
            }),
        };
    }

    pub(super) fn drop_preview(&mut self) {
        (self.preview, self.requested_preview, self.needs_exact_run) = (None, None, false);
        self.builder.stop(&[JobKind::Preview]);
        self.builder.cancel(&[JobKind::Level]);
    }
}
