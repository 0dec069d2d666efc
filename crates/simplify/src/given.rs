//! How a run looks back at its input.

use glam::Vec3;
use lodsmith_core::VertexId;

/// The ordered input, to be sampled.
pub(crate) trait Given {
    fn point_count(&self) -> usize;
    fn face_count(&self) -> usize;
    /// The vertices of a face. (They are asked for one after the other.)
    fn face(&mut self, face: usize) -> [VertexId; 3];
    /// Their places, in the unit frame.
    fn places(&mut self, face: usize, t: [VertexId; 3]) -> [Vec3; 3];
    /// Asks the memory for the places of a face that comes soon.
    fn bring(&self, face: usize);
    /// From here on no face is asked for by its number, but single places and all faces, in any order.
    fn turn(&mut self);
    fn place(&self, v: VertexId) -> Vec3;
    fn each_face(&self, look: impl FnMut([VertexId; 3]));
}

/// The ordered input as it was kept.
pub(crate) struct Kept<'a> {
    pub(crate) points: &'a [Vec3],
    pub(crate) faces: &'a [[VertexId; 3]],
}

impl Given for Kept<'_> {
    fn point_count(&self) -> usize {
        self.points.len()
    }
    #[inline(always)]
    fn face_count(&self) -> usize {
        self.faces.len()
    }
    #[inline(always)]
    fn face(&mut self, face: usize) -> [VertexId; 3] {
        self.faces[face]
    }
    #[inline(always)]
    fn places(&mut self, _: usize, t: [VertexId; 3]) -> [Vec3; 3] {
        t.map(|w| self.points[w.index()])
    }
    #[inline(always)]
    fn bring(&self, _: usize) {}
    #[inline(always)]
    fn turn(&mut self) {}
    #[inline(always)]
    fn place(&self, v: VertexId) -> Vec3 {
        self.points[v.index()]
    }
    #[inline(always)]
    fn each_face(&self, look: impl FnMut([VertexId; 3])) {
        self.faces.iter().copied().for_each(look);
    }
}
