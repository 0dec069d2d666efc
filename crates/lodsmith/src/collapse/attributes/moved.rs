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
        if self.count() == start {
            return NO_WEDGE;
        }
        if let Some(last) = self.heads.last_mut() {
            last.next = NO_WEDGE;
        }
        WedgeId::new(start)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_keep_their_wedges_in_order() {
        let mut all = Attributes::new(4, 1, Vec::new(), Vec::new(), &[0.0, 1.0, 2.0, 3.0], Vec::new());
        all.labels = vec![7, 8, 9, 6];
        // Of one vertex 3 and 1, and of another 2.
        all.heads[3].next = WedgeId(1);
        all.heads[1].hard = [true, false];
        let mut some = all.without_wedges(3);
        assert_eq!(some.add_chain(&all, NO_WEDGE), NO_WEDGE);
        let firsts = [WedgeId(3), NO_WEDGE, WedgeId(2)].map(|first| some.add_chain(&all, first));
        assert_eq!(firsts, [WedgeId(0), NO_WEDGE, WedgeId(2)]);
        let of = |from: &Attributes, first: WedgeId| -> Vec<(f32, u32, [bool; 2])> {
            let one = |w: WedgeId| (from.of(w)[0], from.labels[w.index()], from.heads[w.index()].hard);
            from.chain(first).map(one).collect()
        };
        assert_eq!(of(&some, WedgeId(0)), [(3.0, 6, [false; 2]), (1.0, 8, [true, false])]);
        let before = of(&all, WedgeId(3));
        all.take_rows();
        all.make_room();
        all.heads.fill(Head::default());
        (0..3).for_each(|w| all.put(&some, WedgeId(w), &[WedgeId(3), WedgeId(1), WedgeId(2)]));
        assert_eq!(of(&all, WedgeId(3)), before);
        assert_eq!(of(&all, WedgeId(2)), [(2.0, 9, [false; 2])]);
    }
}
