//! Fit of attribute values at a level, as at the end of a single run.

use glam::Vec3;
use lodsmith_core::WedgeId;
use lodsmith_core::splits::Checkpoint;

use super::Progressive;
use crate::attributes::{RowPlaces, Rows};
use crate::collapse::attributes::Attributes;
use crate::fit::{Originals, Values};

/// Inputs of the fit of values.
pub(super) struct ValueFitter {
    pub(super) rows: Rows,
    pub(super) places: RowPlaces,
    pub(super) originals: Originals,
    /// The engine's attributes, in the engine's numbering of wedges.
    pub(super) attributes: Attributes,
    /// Weights of the values for several counts of faces, descending.
    pub(super) weights: Vec<(usize, Vec<f32>)>,
    /// The engine's number of each wedge, if it has one.
    pub(super) numbers: Vec<WedgeId>,
}

impl ValueFitter {
    /// Takes over the values of the current level and prepares the samples of its fit. `faces` has the faces
    /// of the store, with their positions.
    pub(super) fn begin(
        &mut self,
        progressive: &Progressive,
        faces: impl Iterator<Item = (usize, [Vec3; 3])>,
        away: f64,
    ) -> Values<'_> {
        let width = progressive.layout().width();
        for (w, row) in progressive.values().chunks_exact(width).enumerate() {
            let number = self.numbers[w];
            if number.index() < self.attributes.count() {
                self.rows.read(&mut self.attributes, number, &self.places, row);
            }
        }
        let known = self.weights.iter().find(|w| w.0 <= progressive.face_count()).or(self.weights.last());
        if let Some((_, weights)) = known {
            self.attributes.weights_mut().copy_from_slice(weights);
        }
        self.rows.clear_weights_without_place(self.attributes.weights_mut(), &self.places);
        let wedges = |f: usize| progressive.faces()[f].map(|w| self.numbers[w.index()]);
        let faces: Vec<_> = faces.map(|(f, points)| (points, wedges(f))).collect();
        self.attributes.recompute_sums(&faces);
        let wedges = faces.into_iter().map(|f| f.1).collect();
        Values::new(&self.originals, &mut self.attributes, wedges, away)
    }

    /// Stores the changes made by the fit.
    pub(super) fn store_changes(&self, progressive: &Progressive, checkpoint: &mut Checkpoint) {
        let width = progressive.layout().width();
        let mut wedges: Vec<WedgeId> = progressive.faces().as_flattened().to_vec();
        wedges.sort_unstable();
        wedges.dedup();
        for w in wedges {
            let row = &progressive.values()[w.index() * width..][..width];
            let number = self.numbers[w.index()];
            if let Some(change) = self.rows.change(&self.attributes, number, &self.places, row) {
                checkpoint.wedges.push(w);
                checkpoint.changes.extend(change);
            }
        }
    }
}
