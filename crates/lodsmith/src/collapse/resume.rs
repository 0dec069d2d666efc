//! Resuming an engine to a lower goal, after its sweeps ended or from a snapshot.

use lodsmith_core::VertexId;

use super::attributes::Slopes;
use super::{Engine, Goal, LiveMesh, Sweeps};
use crate::cost::metric::Metric;

impl<M: Metric> Engine<M> {
    /// Returns a copy that continues exactly like this one.
    pub(crate) fn branch(&self) -> Self {
        let mut copy = self.clone();
        copy.mesh.store.make_room_of(&self.mesh.store);
        copy
    }

    /// Prepares a finished engine for more sweeps, with new attribute weights.
    pub(crate) fn reopen(&mut self, weights: Option<&[f32]>) {
        self.mesh.store.reopen();
        self.mesh.set_attribute_weights(weights);
    }

    /// Continues paused sweeps to a lower goal, with new attribute weights.
    pub(crate) fn lower_goal(&mut self, sweeps: &mut Sweeps, goal: &Goal, weights: Option<&[f32]>) {
        if self.mesh.values.attributes.is_some() && weights.is_some() {
            // Tensors are computed from live elements only.
            self.mesh.store.compact();
            if self.mesh.set_attribute_weights(weights) && sweeps.awaits_threshold() {
                if sweeps.has_swept {
                    sweeps.set_bounds(self.mesh.bounds());
                } else {
                    *sweeps = self.begin_sweeps(goal);
                }
            }
        }
        sweeps.needed_at_start = self.mesh.needed(goal).unwrap_or(self.mesh.store.live_faces / 2).max(1);
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Sets the attribute weights of a compact store; returns true if they changed.
    fn set_attribute_weights(&mut self, weights: Option<&[f32]>) -> bool {
        let Some((attributes, weights)) = self.values.attributes.as_mut().zip(weights) else { return false };
        let own = attributes.weights_mut();
        let is_other = *own != *weights;
        own.copy_from_slice(weights);
        if is_other {
            attributes.invalidate_reductions();
        }
        if is_other && self.cost.metric.is_memoryless() {
            self.recompute_quadrics();
        }
        is_other
    }

    /// Recomputes the tensors of all vertices from the current surface; data from the input is kept.
    fn recompute_quadrics(&mut self) {
        let facings: Vec<_> = self.store.v.iter().map(|x| x.facing).collect();
        let of_input = (self.cost.total_area, self.cost.mean_face);
        self.store.reset_quadrics();
        self.init_quadrics();
        (self.cost.total_area, self.cost.mean_face) = of_input;
        for (x, facing) in self.store.v.iter_mut().zip(facings) {
            x.facing = facing;
        }
        if let (Some(attributes), Some(wedges)) = (&self.values.attributes, &self.store.wedges) {
            for (t, w) in self.store.t.iter().zip(wedges) {
                let s = Slopes::new(t.map(|v| self.store.v[v.index()].p));
                let sum = attributes.tensor(attributes.lanes(), &s, w.map(|w| attributes.values(w)));
                for v in t {
                    M::tensor(&mut self.store.v[v.index()].q).add(&sum);
                }
            }
        }
        self.init_lines((0..self.store.v.len()).map(VertexId::new));
    }
}
