//! Access to the ordered input during and after a run: for samples in the late phase, for the removal of
//! parts, and for the fit. Depending on the number of faces, an ordered copy of the input is kept, made again
//! each time, or looked up face by face.

use std::ops::Range;

use glam::Vec3;
use lodsmith_core::{PositionsView, Surface, VertexId};
use prefetch_index::prefetch_index;

use crate::collapse::order::{Ordered, TIME_OVER_MEMORY_MAX_FACES, single_unit};

/// Inputs with no more faces than this keep an ordered copy of themselves; larger ones are ordered again for
/// the fit, which takes a few percent more time and 18 bytes less per face.
pub(crate) const INPUT_COPY_MAX_FACES: usize = 1_000_000;
/// If at least the input divided by this remains, the fit needs more memory than the sweeps.
const SHRINK_DIVISOR: usize = 3;
/// Number of faces per block. (Guessed: 24 bytes each, so that they stay in the nearest cache.)
const FACES_PER_BLOCK: usize = 256;

/// The input of a run, and its order.
pub(crate) struct OriginalInput<'a> {
    pub(crate) surface: &'a Surface<'a>,
    pub(crate) ordered: &'a Ordered,
    /// True if `ordered` still has its points and faces.
    pub(crate) is_kept: bool,
}

impl<'a> OriginalInput<'a> {
    /// Calls `look` with the positions in the unit frame and the faces.
    pub(crate) fn visit<R>(&self, look: impl FnOnce(&[Vec3], &[[VertexId; 3]]) -> R) -> R {
        if self.is_kept {
            look(&self.ordered.points, &self.ordered.faces)
        } else {
            look(&self.ordered.remake_points(self.surface), &self.ordered.remake_faces(self.surface))
        }
    }

    /// Returns access to positions one by one, if the input is too large for a copy in addition to a result
    /// of `faces` faces: it takes 14 bytes less per face, but a sixth more time if the file is unordered.
    pub(crate) fn looked_up(&self, faces: usize) -> Option<RemadeInput<'a>> {
        let given = self.surface.triangles().len();
        let is_large = given > TIME_OVER_MEMORY_MAX_FACES && SHRINK_DIVISOR * faces >= given;
        (!self.is_kept && is_large).then(|| RemadeInput::new(self.ordered, self.surface))
    }
}

/// The ordered input, for sampling.
pub(crate) trait OrderedInput: Sync {
    fn point_count(&self) -> usize;
    fn face_count(&self) -> usize;
    /// Returns access to the faces in ascending order, from any of them on.
    fn in_order(&self) -> impl FacesInOrder;
    /// Returns all points and faces, if they are kept in memory.
    fn kept(&self) -> Option<KeptInput<'_>>;
    /// Switches from faces in order to random access: from now on, single positions and all faces are read.
    fn start_random_access(&mut self);
    fn position(&self, v: VertexId) -> Vec3;
    /// Number of the faces that [`Self::visit_faces`] counts.
    fn all_faces(&self) -> usize;
    /// Visits all faces with numbers in a range: any numbers, but always the same ones.
    fn visit_faces(&self, range: Range<usize>, visit: impl FnMut([VertexId; 3]));
}

/// Faces of the ordered input, read in ascending order.
pub(crate) trait FacesInOrder {
    /// Returns the vertices of a face.
    fn face(&mut self, face: usize) -> [VertexId; 3];
    /// Returns the positions of a face's vertices, in the unit frame.
    fn positions(&mut self, face: usize, t: [VertexId; 3]) -> [Vec3; 3];
    /// Prefetches the positions of a face that will be read soon.
    fn prefetch(&self, face: usize);
}

/// The ordered input, kept in memory.
#[derive(Clone, Copy)]
pub(crate) struct KeptInput<'a> {
    pub(crate) points: &'a [Vec3],
    pub(crate) faces: &'a [[VertexId; 3]],
}

impl OrderedInput for KeptInput<'_> {
    fn point_count(&self) -> usize {
        self.points.len()
    }
    fn face_count(&self) -> usize {
        self.faces.len()
    }
    fn in_order(&self) -> impl FacesInOrder {
        *self
    }
    fn kept(&self) -> Option<KeptInput<'_>> {
        Some(*self)
    }
    fn start_random_access(&mut self) {}
    #[inline(always)]
    fn position(&self, v: VertexId) -> Vec3 {
        self.points[v.index()]
    }
    fn all_faces(&self) -> usize {
        self.faces.len()
    }
    #[inline(always)]
    fn visit_faces(&self, range: Range<usize>, visit: impl FnMut([VertexId; 3])) {
        self.faces[range].iter().copied().for_each(visit);
    }
}

impl FacesInOrder for KeptInput<'_> {
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
}

/// The ordered input, computed from the original surface on access, bit for bit the same.
pub(crate) struct RemadeInput<'a> {
    ordered: &'a Ordered,
    surface: &'a Surface<'a>,
    /// Index of each face in the surface, in order.
    faces: Vec<u32>,
    /// The first vertex of the surface at each position, after random access by vertex has started.
    first: Vec<VertexId>,
}

impl<'a> RemadeInput<'a> {
    fn new(ordered: &'a Ordered, surface: &'a Surface<'a>) -> Self {
        Self { ordered, surface, faces: ordered.of_faces(surface, |i| i as u32), first: Vec::new() }
    }

    fn place_there(&self, v: VertexId) -> Vec3 {
        single_unit(&self.ordered.frame, self.surface.positions().get(v))
    }
}

impl OrderedInput for RemadeInput<'_> {
    fn point_count(&self) -> usize {
        self.ordered.point_count
    }
    fn face_count(&self) -> usize {
        self.faces.len()
    }
    fn in_order(&self) -> impl FacesInOrder {
        RemadeFaces { input: self, from: 0, there: Vec::new(), here: Vec::new() }
    }
    fn kept(&self) -> Option<KeptInput<'_>> {
        None
    }
    fn start_random_access(&mut self) {
        self.faces = Vec::new();
        self.first = self.ordered.first_vertices();
    }
    fn position(&self, v: VertexId) -> Vec3 {
        self.place_there(self.first[v.index()])
    }
    fn all_faces(&self) -> usize {
        self.surface.triangles().len()
    }
    fn visit_faces(&self, range: Range<usize>, visit: impl FnMut([VertexId; 3])) {
        self.surface.triangles()[range].iter().filter_map(|t| self.ordered.face(t)).for_each(visit);
    }
}

/// Faces of a [`RemadeInput`], in blocks that are looked up together so that cache misses overlap.
struct RemadeFaces<'a> {
    input: &'a RemadeInput<'a>,
    /// Current block: index of the first face, and the vertices in the surface and in the ordered input.
    from: usize,
    there: Vec<[VertexId; 3]>,
    here: Vec<[VertexId; 3]>,
}

impl RemadeFaces<'_> {
    #[cold]
    #[inline(never)]
    fn look_up(&mut self, face: usize) {
        let RemadeInput { ordered, surface, faces, .. } = self.input;
        self.from = face - face % FACES_PER_BLOCK;
        let block = &faces[self.from..faces.len().min(self.from + FACES_PER_BLOCK)];
        self.there.clear();
        self.there.extend(block.iter().map(|&i| surface.triangles()[i as usize]));
        self.here.clear();
        self.here.extend(self.there.iter().map(|t| t.map(|v| ordered.rank[v.index()])));
    }
}

impl FacesInOrder for RemadeFaces<'_> {
    #[inline]
    fn face(&mut self, face: usize) -> [VertexId; 3] {
        // (For a face before the block, wrapping makes the difference large.)
        if face.wrapping_sub(self.from) >= self.here.len() {
            self.look_up(face);
        }
        self.here[face - self.from]
    }
    #[inline]
    fn positions(&mut self, face: usize, _: [VertexId; 3]) -> [Vec3; 3] {
        if face.wrapping_sub(self.from) >= self.there.len() {
            self.look_up(face);
        }
        self.there[face - self.from].map(|v| self.input.place_there(v))
    }
    #[inline]
    fn prefetch(&self, face: usize) {
        if let Some(t) = self.there.get(face.wrapping_sub(self.from)) {
            for v in t {
                match self.input.surface.positions() {
                    PositionsView::F32(p) => prefetch_index(p, v.index()),
                    PositionsView::F64(p) => prefetch_index(p, v.index()),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapse::order::order;

    #[test]
    fn the_looked_up_input_equals_the_kept_one() {
        // A strip of more faces than a block has, as a soup, with a face that is left out.
        let corner = |i: u32| [(i / 2) as f32 * 0.1, (i % 2) as f32, 0.0];
        let p: Vec<[f32; 3]> = (0..300).rev().flat_map(|i| [i, i + 1, i + 2].map(corner)).collect();
        let mut faces: Vec<[u32; 3]> = (0..300).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        faces.insert(7, [0, 1, 1]);
        let s = Surface::new(PositionsView::F32(&p), bytemuck::cast_slice(&faces)).unwrap();
        let o = order(&s);
        let mut again = RemadeInput::new(&o, &s);
        assert_eq!((again.point_count(), again.face_count()), (o.points.len(), 300));
        let mut faces = again.in_order();
        for (i, t) in o.faces.iter().enumerate() {
            faces.prefetch(i + 8);
            assert_eq!(faces.face(i), *t);
            assert_eq!(faces.positions(i, *t), t.map(|v| o.points[v.index()]));
        }
        drop(faces);
        again.start_random_access();
        assert!((0..).map(VertexId).zip(&o.points).all(|(v, p)| again.position(v) == *p));
        let (mut all, mut wanted) = (Vec::new(), o.faces.clone());
        again.visit_faces(0..again.all_faces(), |t| all.push(t));
        all.sort();
        wanted.sort();
        assert_eq!(all, wanted);
    }
}
