//! Maps that are baked for the result.

use std::sync::Arc;

use super::Document;
use super::jobs::Job;
use crate::content::Lighter;
use crate::content::baked::BakedMaps;
use crate::gpu::shown::ShownModel;
use crate::job::{Failure, JobKind};

impl Document {
    /// Returns the maps of the shown result.
    pub fn baked(&self) -> Option<&Arc<BakedMaps>> {
        self.lighter.as_ref()?.content.baked.as_ref()
    }

    /// Starts baking maps for the exact result, in place of those that it has.
    pub fn bake(&mut self) {
        let settings = self.settings.bake.clone();
        let shown = self.without_maps.as_ref().or(self.lighter.as_ref());
        let exact = shown.filter(|l| l.content.report.is_some() && !settings.maps.is_empty());
        if let (Some(original), Some(lighter)) = (&self.original, exact.cloned()) {
            let original = original.content.clone();
            let surface = self.settings.look.look.surface;
            self.worker.submit(Job::Bake { original, lighter, settings, surface });
        }
    }

    /// Shows the result without maps.
    pub fn remove_maps(&mut self) {
        self.worker.cancel(&[JobKind::Bake]);
        if let Some(before) = self.without_maps.take() {
            self.lighter = Some(before);
        }
    }

    /// Shows a result with maps, unless another result is shown by now.
    pub(super) fn take_baked(
        &mut self,
        before: ShownModel<Lighter>,
        result: Result<ShownModel<Lighter>, Failure>,
    ) {
        match result {
            Ok(made) => {
                let shown = self.without_maps.as_ref().or(self.lighter.as_ref());
                if shown.is_some_and(|shown| shown.key() == before.key()) {
                    let count = made.content.baked.as_ref().map_or(0, |baked| baked.maps.len());
                    self.log.good(format!("{count} maps baked"));
                    let new = &made.content.warnings[before.content.warnings.len()..];
                    new.iter().for_each(|warning| self.log.warn(warning.clone()));
                    (self.without_maps, self.lighter) = (Some(before), Some(made));
                }
            }
            Err(Failure::Cancelled) => {}
            Err(Failure::Error(why)) => self.fail(why),
        }
    }
}
