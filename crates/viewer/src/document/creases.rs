//! Which edges of the shown models are sharp.

use lodsmith_core::mesh::creases::Creases;

use super::Document;
use super::jobs::{Job, show_heat};
use crate::content::Original;
use crate::gpu::shown::ShownModel;

impl Document {
    /// Returns which edges are sharp where the open file has no normals.
    pub fn creases(&self) -> Creases {
        let chosen = self.settings.look.creases;
        self.original.as_ref().map_or(chosen, |original| original.content.creases(chosen))
    }

    /// Tells the workers how to shade a file that is being opened.
    pub(super) fn shade_new_file(&self) {
        if let Some(context) = &self.context {
            context.set_creases(self.settings.look.creases);
        }
    }

    /// Starts the job that shades the shown models again, if other edges are sharp now.
    pub(super) fn shade_edges(&mut self, original: &ShownModel<Original>) {
        let Some(context) = &self.context else { return };
        let wanted = self.creases();
        context.set_creases(wanted);
        if std::mem::replace(&mut self.shaded, wanted) == wanted {
            return;
        }
        let mut shown = Vec::new();
        shown.extend(original.draw.clone().map(|draw| (draw, original.content.model().clone())));
        let levels = self.levels.iter().flat_map(|set| &set.levels);
        for result in self.lighter.iter().chain(&self.without_maps).chain(levels) {
            shown.extend(result.draw.clone().map(|draw| (draw, result.content.model.clone())));
        }
        self.worker.submit(Job::Shade { shown });
        // It is built again, with buffers of its own.
        self.drop_preview();
    }

    /// Writes heat map values and marks into the new buffers.
    pub(super) fn take_shaded(&mut self) {
        let Some(original) = &self.original else { return };
        let drawings = [original.draw.as_ref(), self.lighter.as_ref().and_then(|l| l.draw.as_ref())];
        if let (Some(distances), Some(lighter)) = (self.distances(), &self.lighter) {
            let quantity = distances.quantity;
            show_heat(drawings[0], original.content.model(), &distances.of_original, quantity);
            show_heat(drawings[1], &lighter.content.model, &distances.of_result, quantity);
        }
        for (flaws, drawing) in self.flaws().into_iter().zip(drawings) {
            if let (Some(flaws), Some(drawing)) = (flaws, drawing) {
                flaws.show_in(drawing);
            }
        }
    }
}
