//! The measured differences of both sides: values of the heat map.

use std::sync::{Arc, PoisonError};

use lodsmith_core::Model;

use super::{Document, Measured, Outcome};
use crate::content::{Distances, Original};
use crate::job::JobKind;
use crate::settings::HeatOf;
use crate::shown::{Drawing, ShownModel};

impl Document {
    /// Returns the distances between the latest result and the original, if they were measured.
    pub fn distances(&self) -> Option<&Arc<Distances>> {
        let measured = self.measured.as_ref()?;
        let fits = measured.distances.quantity == self.settings.look.heat_of
            && Arc::ptr_eq(&measured.of.0, &self.original.as_ref()?.content)
            && Arc::ptr_eq(&measured.of.1, &self.lighter.as_ref()?.content);
        fits.then_some(&measured.distances)
    }

    /// Starts the job that measures the differences of both sides, if they are needed.
    pub(super) fn measure(&mut self, original: &ShownModel<Original>) {
        let Some(lighter) = self.lighter.clone().filter(|l| l.content.report.is_some()) else { return };
        let is_due = self.wants_distances && self.distances().is_none();
        if !is_due || self.worker.is_busy(JobKind::Measure) || self.is_outdated() {
            return;
        }
        let (original, quantity) = (original.clone(), self.settings.look.heat_of);
        self.worker.submit(JobKind::Measure, move |watch| {
            let (one, two) = (&original.content, &lighter.content);
            let distances = Distances::measure(one, two, quantity, &mut |done| watch.report(done))?;
            show_heat(original.draw.as_ref(), one.model(), &distances.of_original, quantity);
            show_heat(lighter.draw.as_ref(), &two.model, &distances.of_result, quantity);
            let of = (one.clone(), two.clone());
            Some(Outcome::Measured(Measured { of, distances: Arc::new(distances) }))
        });
    }
}

/// Writes the values of the heat map into the buffers: distances of vertices, or differences at wedges.
fn show_heat(drawing: Option<&Drawing>, model: &Model, values: &[Vec<f32>], quantity: HeatOf) {
    let Some(drawing) = drawing else { return };
    for (i, (mesh, values)) in model.meshes.iter().zip(values).enumerate() {
        let mesh = &mesh.mesh;
        let of_wedges: Vec<f32> = match mesh.vertex_map() {
            Some(_) if quantity != HeatOf::Distance => values.clone(),
            None => values.clone(),
            Some(map) => map.iter().map(|v| values[v.index()]).collect(),
        };
        drawing.lock().unwrap_or_else(PoisonError::into_inner).set_heat(i, Some(&of_wedges));
    }
}
