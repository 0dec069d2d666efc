//! Marks of vertices, for walks that test whether a vertex was visited before.
//!
//! The marks are stored outside the mesh, so that a walk does not modify it: in a hash table with room for
//! the vertices of one star. Clearing it only increments the number of the walk.

use lodsmith_core::VertexId;

/// Reusable map from vertices to small numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Marks {
    /// At least twice as many as there are vertices; a power of two.
    slots: Vec<Slot>,
    /// Number of the walk. Slots of earlier walks are free.
    walk: u32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    vertex: VertexId,
    walk: u32,
    mark: u32,
}

impl Marks {
    /// Clears all marks and makes room for the marks of `count` vertices.
    #[inline(always)]
    pub(super) fn clear(&mut self, count: usize) {
        self.walk = self.walk.wrapping_add(1);
        if self.slots.len() < 2 * count || self.walk == 0 {
            self.grow(count);
        }
    }

    #[cold]
    #[inline(never)]
    fn grow(&mut self, count: usize) {
        let slots = self.slots.len().max((2 * count).next_power_of_two()).max(64);
        self.slots.clear();
        self.slots.resize(slots, Slot::default());
        self.walk = 1;
    }

    /// Returns the slot of a vertex, or the free one that it would get.
    #[inline(always)]
    fn slot(&self, vertex: VertexId) -> usize {
        let mask = self.slots.len() - 1;
        // (Neighbours in the mesh have close numbers, in one or two runs.)
        let mut at = vertex.index() & mask;
        while self.slots[at].walk == self.walk && self.slots[at].vertex != vertex {
            at = (at + 1) & mask;
        }
        at
    }

    /// Returns the mark of a vertex, if it has one.
    #[inline(always)]
    pub(super) fn get(&self, vertex: VertexId) -> Option<u32> {
        let slot = &self.slots[self.slot(vertex)];
        (slot.walk == self.walk).then_some(slot.mark)
    }

    /// Marks a vertex. Returns the mark that it had.
    #[inline(always)]
    pub(super) fn set(&mut self, vertex: VertexId, mark: u32) -> Option<u32> {
        let (at, walk) = (self.slot(vertex), self.walk);
        let slot = &mut self.slots[at];
        let before = (slot.walk == walk).then_some(slot.mark);
        *slot = Slot { vertex, walk, mark };
        before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_last_for_one_walk() {
        let mut marks = Marks::default();
        // Vertices that hash to the same slot.
        let vertices = [3u32, 67, 131, 195, 4].map(VertexId);
        for walk in 0..200u32 {
            marks.clear(5 + walk as usize);
            for (i, &v) in vertices.iter().enumerate() {
                assert_eq!((marks.get(v), marks.set(v, walk)), (None, None), "vertex {v} in walk {walk}");
                assert_eq!(marks.set(v, i as u32), Some(walk));
            }
            let found = vertices.map(|v| marks.get(v));
            assert_eq!(found, [0, 1, 2, 3, 4].map(Some));
        }
        marks.walk = u32::MAX;
        marks.clear(1);
        assert_eq!(marks.get(vertices[0]), None, "the numbers of walks start again");
    }
}
