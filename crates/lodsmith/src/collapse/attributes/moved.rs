//! Wedges that move from one set of attributes to another with the same layout: to blocks, and back.

use bytemuck::allocation::zeroed_vec;
use lodsmith_core::WedgeId;

use super::{Attributes, Head, NO_WEDGE};
use crate::cost::tensor::Tensor;

impl Attributes {
    /// Returns attributes with the same layout and weights, and room for so many wedges.
    pub(in crate::collapse) fn without_wedges(&self, room: usize) -> Self {
        let room_if = |is_used: bool| if is_used { room } else { 0 };
        Self {
            lanes: self.lanes,
            weights: self.weights.clone(),
            directions: self.directions.clone(),
            textures: self.textures.clone(),
            joint_weights: Vec::with_capacity(room_if(!self.joint_weights.is_empty())),
            labels: Vec::with_capacity(room_if(!self.labels.is_empty())),
            heads: Vec::with_capacity(room),
            reductions: Vec::with_capacity(room),
            copied: Vec::new(),
            rows: Vec::with_capacity(room * 4 * self.lanes),
        }
    }

    /// Adds copies of all wedges of a vertex. Returns the first of them.
    pub(in crate::collapse) fn add_chain(&mut self, from: &Self, first: WedgeId) -> WedgeId {
        let start = self.count();
        for w in from.chain(first) {
            let next = WedgeId::new(self.count() + 1);
            self.heads.push(Head { next, ..from.heads[w.index()] });
            self.reductions.push(from.reductions[w.index()]);
            self.rows.extend_from_slice(from.row(w));
            self.joint_weights.extend(from.joint_weights.get(w.index()).cloned());
            self.labels.extend(from.labels.get(w.index()).copied());
        }
        match self.heads.last_mut() {
            Some(last) if start < last.next.index() => {
                last.next = NO_WEDGE;
                WedgeId::new(start)
            }
            _ => NO_WEDGE,
        }
    }

    /// Releases the rows, which are elsewhere; the number of wedges stays.
    pub(in crate::collapse) fn take_rows(&mut self) {
        (self.rows, self.reductions) = (Vec::new(), Vec::new());
    }

    /// Makes room for the rows again.
    pub(in crate::collapse) fn make_room(&mut self) {
        self.rows = zeroed_vec(self.count() * 4 * self.lanes);
        self.reductions = vec![Tensor::default(); self.count()];
    }

    /// Takes a wedge back; `numbers` are those of all wedges of `from`.
    pub(in crate::collapse) fn put(&mut self, from: &Self, w: WedgeId, numbers: &[WedgeId]) {
        let (n, head) = (4 * self.lanes, from.heads[w.index()]);
        let own = numbers[w.index()].index();
        self.rows[own * n..][..n].copy_from_slice(from.row(w));
        self.reductions[own] = from.reductions[w.index()];
        let next = numbers.get(head.next.index()).copied().unwrap_or(NO_WEDGE);
        self.heads[own] = Head { next, ..head };
        if let Some(joint_weights) = from.joint_weights.get(w.index()) {
            self.joint_weights[own].clone_from(joint_weights);
        }
        if let Some(&label) = from.labels.get(w.index()) {
            self.labels[own] = label;
        }
    }
}
