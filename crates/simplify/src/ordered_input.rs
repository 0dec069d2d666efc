//! Access to the ordered input during and after a run.

use glam::Vec3;
use lodsmith_core::VertexId;

/// The ordered input, for sampling.
pub(crate) trait OrderedInput {
    fn point_count(&self) -> usize;
    fn face_count(&self) -> usize;
    /// Returns the vertices of a face. (Called for faces in ascending order.)
    fn face(&mut self, face: usize) -> [VertexId; 3];
    /// Returns the positions of a face's vertices, in the unit frame.
    fn positions(&mut self, face: usize, t: [VertexId; 3]) -> [Vec3; 3];
    /// Prefetches the positions of a face that is read soon.
    fn prefetch(&self, face: usize);
    /// Switches from faces in order to random access: from here on single positions and all faces are read.
    fn start_random_access(&mut self);
    fn position(&self, v: VertexId) -> Vec3;
    fn each_face(&self, visit: impl FnMut([VertexId; 3]));
}

/// The ordered input, kept in memory.
pub(crate) struct KeptInput<'a> {
    pub(crate) points: &'a [Vec3],
    pub(crate) faces: &'a [[VertexId; 3]],
}

impl OrderedInput for KeptInput<'_> {
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
    fn positions(&mut self, _: usize, t: [VertexId; 3]) -> [Vec3; 3] {
        t.map(|w| self.points[w.index()])
    }
    #[inline(always)]
    fn prefetch(&self, _: usize) {}
    #[inline(always)]
    fn start_random_access(&mut self) {}
    #[inline(always)]
    fn position(&self, v: VertexId) -> Vec3 {
        self.points[v.index()]
    }
    #[inline(always)]
    fn each_face(&self, visit: impl FnMut([VertexId; 3])) {
        self.faces.iter().copied().for_each(visit);
    }
}
