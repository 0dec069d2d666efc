//! The stage of a document: its levels, timeline and export.

use std::path::PathBuf;
use std::sync::Arc;

use lodsmith_core::Model;

use super::{Document, Job};
use crate::content::Lighter;
use crate::gpu::shown::Drawing;
use crate::job::JobKind;
use crate::stage::export::{StageExport, ViewingConditions};
use crate::stage::levels::LodLevel;
use crate::stage::{Copies, ModelBase, Stage};

/// A level that copies can be drawn in.
pub struct StageLevel<'a> {
    /// Error and face count.
    pub level: LodLevel,
    /// The model.
    pub model: &'a Model,
    /// GPU buffers; `None` without an adapter.
    pub draw: Option<&'a Drawing>,
}

impl Document {
    /// Returns the stage, if it is on and a file is open.
    pub fn stage(&self) -> Option<&Stage> {
        let stage = &self.settings.stage;
        (stage.is_on && self.original.is_some()).then_some(stage)
    }

    /// Returns the length of the timeline in seconds: of the clip, or of all motion on the stage.
    pub fn timeline_secs(&self) -> f64 {
        let clip = self.original.as_ref().map_or(0.0, |o| self.settings.playback.length(o.content.model()));
        self.stage().map_or(clip, |stage| stage.motion.length(clip))
    }

    /// Returns the current time within the timeline.
    pub fn moment(&self) -> f64 {
        self.settings.playback.moment(self.timeline_secs())
    }

    /// Returns the placements of the copies at the current time.
    pub fn current_placements(&self) -> Copies {
        self.settings.stage.copies_at(self.moment())
    }

    /// Returns the base of the model: how it is placed on a ground.
    pub fn stage_base(&self) -> Option<ModelBase> {
        let original = self.original.as_ref()?;
        Some(ModelBase::new(&original.content.bounds, self.rotation()))
    }

    /// Returns the original and its levels, from the finest.
    pub fn stage_levels(&self) -> Vec<StageLevel<'_>> {
        let Some(original) = &self.original else { return Vec::new() };
        let first = StageLevel {
            level: LodLevel { error: 0.0, faces: original.content.faces as u64 },
            model: original.content.model(),
            draw: original.draw.as_ref(),
        };
        let lighter = self.levels_made().iter().map(|l| StageLevel {
            level: LodLevel { error: l.content.error(), faces: l.content.faces as u64 },
            model: &l.content.model,
            draw: l.draw.as_ref(),
        });
        std::iter::once(first).chain(lighter).collect()
    }

    /// Returns true while the levels of the stage are being made.
    pub fn awaits_levels(&self) -> bool {
        self.levels_made().is_empty() && self.worker.is_busy(JobKind::Levels)
    }

    /// Exports the stage as one file: copies that share the model and its levels. `fov_y_rad` is the vertical
    /// field of view for which the switching distances are written.
    pub fn export_stage(&mut self, path: PathBuf, fov_y_rad: f64) {
        let (Some(original), Some(base)) =
            (self.original.as_ref().map(|o| o.content.clone()), self.stage_base())
        else {
            return;
        };
        let levels: Vec<Arc<Lighter>> = self.levels_made().iter().map(|l| l.content.clone()).collect();
        let Some((_, how)) = self.level_source() else { return };
        let stage = &self.settings.stage;
        let export = StageExport {
            path,
            copies: stage.copies.clone(),
            motion: stage.motion.clone(),
            base,
            viewing: ViewingConditions { pixels: stage.view.pixels, fov_y_rad },
        };
        self.worker.submit(Job::ExportStage { original, levels, how, export: Box::new(export) });
    }
}
