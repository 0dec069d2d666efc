//! The progressive mesh from which the slider previews.

use std::time::Instant;

use lodsmith::SimplifyError;

use super::{Document, Outcome};
use crate::content::Original;
use crate::job::{JobKind, Progress};
use crate::numbers::{grouped, seconds};
use crate::option_words::Simplification;
use crate::shown::ShownModel;
use crate::slider_preview::{self, SliderPreview};

impl Document {
    /// Returns true if the slider can preview any level at once.
    pub fn has_preview(&self) -> bool {
        self.preview.is_some() && self.requested_preview == self.level_source()
    }

    /// Returns the progress of the progressive mesh while it is being made.
    pub fn preview_progress(&self) -> Option<Progress> {
        self.builder.progress()
    }

    /// Shows the preview level for a target; returns false if there is none.
    pub(super) fn show_preview_level(&mut self, how: &Simplification) -> bool {
        if !self.has_preview() {
            return false;
        }
        match self.preview.as_mut().map(|preview| preview.show(how)) {
            Some(Ok(Some(level))) => {
                self.worker.cancel(&[JobKind::Simplify, JobKind::Measure, JobKind::Inspect]);
                self.lighter = Some(level);
                true
            }
            Some(Err(why)) => {
                self.fail(why.to_string());
                false
            }
            Some(Ok(None)) | None => false,
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
        let (context, original) = (self.context.clone(), original.content.clone());
        self.builder.submit(JobKind::Preview, move |watch| {
            let begin = Instant::now();
            let result = SliderPreview::build(&original, &of.1, context.as_ref(), watch).map(Box::new);
            Some(Outcome::Preview { of, secs: begin.elapsed().as_secs_f64(), result })
        });
    }

    pub(super) fn take_preview(
        &mut self,
        of: &(usize, Simplification),
        secs: f64,
        result: Result<Box<SliderPreview>, SimplifyError>,
    ) {
        if self.requested_preview.as_ref() != Some(of) {
            return;
        }
        match result {
            Ok(mut road) => {
                self.log.note(format!(
                    "the slider shows results immediately: progressive mesh of {} levels built in {}",
                    grouped(road.levels()),
                    seconds(secs)
                ));
                self.lighter.iter().for_each(|l| road.learn_peak_ratio(&l.content));
                self.preview = Some(*road);
            }
            Err(SimplifyError::Cancelled) => {}
            Err(why) => self.log.note(format!("the slider runs the method for each value ({why})")),
        }
    }

    pub(super) fn drop_preview(&mut self) {
        (self.preview, self.requested_preview, self.needs_exact_run) = (None, None, false);
        self.builder.cancel(&[JobKind::Preview]);
    }
}
