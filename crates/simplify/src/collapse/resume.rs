//! Going on from where sweeps ended or forked, to a lower goal.

use lodsmith_core::VertexId;

use super::attributes::Slopes;
use super::{Engine, Goal, LiveMesh, Sweeps};
use crate::metric::Metric;

impl<M: Metric> Engine<M> {
    /// A copy that goes on just as this one would.
    pub(crate) fn branch(&self) -> Self {
        let mut copy = self.clone();
        copy.mesh.store.make_room_of(&self.mesh.store);
        copy
    }

    /// Makes a finished engine ready for more sweeps, with attributes that count `weights` from here on.
    pub(crate) fn reopen(&mut self, weights: Option<&[f32]>) {
        self.mesh.store.reopen();
        self.mesh.count(weights);
    }

    /// Lets sweeps that forked go on to a lower goal, with attributes that count `weights` from here on.
    pub(crate) fn go_on_to(&mut self, sweeps: &mut Sweeps, goal: &Goal, weights: Option<&[f32]>) {
        if self.mesh.values.attributes.is_some() && weights.is_some() {
            // Tensors are made of what lives.
            self.mesh.store.compact();
            if self.mesh.count(weights) && sweeps.awaits_threshold() {
                if sweeps.has_swept {
                    sweeps.set_bounds(self.mesh.bounds());
                } else {
                    *sweeps = self.begin_sweeps(goal);
                }
            }
        }
        sweeps.begun_with = self.mesh.needed(goal).unwrap_or(self.mesh.store.live_faces / 2).max(1);
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Lets attributes of a compact store count differently; whether that changed anything.
    fn count(&mut self, weights: Option<&[f32]>) -> bool {
        let Some((attributes, weights)) = self.values.attributes.as_mut().zip(weights) else { return false };
        let own = attributes.weights_mut();
        let is_other = *own != *weights;
        own.copy_from_slice(weights);
        if is_other {
            attributes.forget();
        }
        if is_other && self.cost.metric.is_memoryless() {
            self.weigh_again();
        }
        is_other
    }

    /// Tensors of all vertices from the present surface; what is known of the input's stays.
    fn weigh_again(&mut self) {
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
