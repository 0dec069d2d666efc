//! Recording of a run: what the engine writes into the record of its changes.

use lodsmith_core::{FaceId, VertexId};

use super::Engine;
use super::record::Record;
use crate::cost::metric::Metric;

impl<M: Metric> Engine<M> {
    /// Logs the differences between the initial mesh of the engine and the input, as the first change.
    pub(crate) fn log_start(&mut self, mut record: Box<Record>) {
        let mut is_alive = vec![false; record.copy.faces.len()];
        for &n in self.mesh.store.names.iter().flatten() {
            is_alive[record.names.faces[n as usize].index()] = true;
        }
        for (f, t) in record.copy.faces.iter().enumerate().filter(|f| !is_alive[f.0]) {
            record.log.dead.push((FaceId::new(f), *t));
        }
        let all: Vec<usize> = (0..self.mesh.store.t.len()).collect();
        record.log_change(
            &self.mesh.store,
            self.mesh.values.attributes.as_ref(),
            (&all, &[]),
            (f32::NEG_INFINITY, 0.0, 0.0),
        );
        record.keys.fill(f32::NEG_INFINITY);
        self.record = Some(record);
    }

    /// Logs a change of these faces, if there is a record.
    #[inline(always)]
    pub(super) fn log_change(&mut self, faces: impl Iterator<Item = usize>, moved: &[VertexId], cost: f32) {
        if self.record.is_some() {
            let mut faces: Vec<usize> = faces.collect();
            faces.sort_unstable();
            faces.dedup();
            self.log_faces(&faces, moved, cost);
        }
    }

    #[inline(never)]
    fn log_faces(&mut self, faces: &[usize], moved: &[VertexId], cost: f32) {
        let Some(mut record) = self.record.take() else { return };
        let moved: Vec<VertexId> =
            moved.iter().copied().filter(|w| !self.mesh.store.v[w.index()].kind.is_locked()).collect();
        let paid = (cost, self.tally.collapse_cost, self.tally.removed_part_cost);
        record.log_change(&self.mesh.store, self.mesh.values.attributes.as_ref(), (faces, &moved), paid);
        self.record = Some(record);
    }

    /// Prepares a stuck engine for more sweeps, in which whole parts may be removed.
    pub(crate) fn resume(&mut self, cuts_necks: bool) {
        self.mesh.store.bound = vec![super::bound::UNKNOWN; self.mesh.store.v.len()];
        self.mesh.store.link();
        self.mesh.constraints.cuts_necks = cuts_necks;
        self.mesh.constraints.keeps_parts = false;
        self.enable_part_removal();
        if let Some(record) = &mut self.record {
            record.raise_floor();
        }
    }
}
