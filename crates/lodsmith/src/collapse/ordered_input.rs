//! Access to the ordered input during and after a run: for samples in the late phase, for the removal of
//! parts, and for the fit. Depending on the number of faces, an ordered copy of the input is kept, made again
//! each time, or looked up face by face.

use std::borrow::Cow;
use std::ops::Range;

use glam::Vec3;
use lodsmith_core::{Surface, VertexId};

use crate::chunks;
use crate::collapse::order::{Ordered, TIME_OVER_MEMORY_MAX_FACES, single_unit};

/// Inputs with no more faces than this keep an ordered copy of themselves; larger ones are ordered again for
/// the fit, which takes a few percent more time and 18 bytes less per face.
pub(crate) const INPUT_COPY_MAX_FACES: usize = 1_000_000;
/// If at least the input divided by this remains, the fit needs more memory than the sweeps.
const SHRINK_DIVISOR: usize = 3;

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
    /// of `faces` faces: it takes 14 bytes less per face, but a sixth more time if the file is unordered. (Not in
    /// modules of WebAssembly, whose code it would make larger.)
    pub(crate) fn looked_up(&self, faces: usize) -> Option<RemadeInput<'a>> {
        let given = self.surface.triangles().len();
        let is_large = given > TIME_OVER_MEMORY_MAX_FACES && SHRINK_DIVISOR * faces >= given;
        (chunks::HAS_THREADS && !self.is_kept && is_large)
            .then(|| RemadeInput::new(self.ordered, self.surface))
    }
}

/// The ordered input, for sampling.
pub(crate) trait OrderedInput: Sync {
    fn point_count(&self) -> usize;
    fn face_count(&self) -> usize;
    /// Returns some faces in order, with the positions of one in every `stride` (by its number among all).
    fn faces(&self, range: Range<usize>, stride: usize) -> FacesInOrder<'_>;
    /// Returns all points and faces, if they are kept in memory.
    fn kept(&self) -> Option<KeptInput<'_>>;
    /// Switches from faces in order to random access: from now on, single positions and all faces are read.
    fn start_random_access(&mut self);
    fn position(&self, v: VertexId) -> Vec3;
    /// End of the numbers of [`Self::visit_faces`].
    fn all_faces(&self) -> usize;
    /// Visits the faces with numbers in a range. (The numbers need not be those of the order.)
    fn visit_faces(&self, range: Range<usize>, visit: impl FnMut([VertexId; 3]));
}

/// Faces of the ordered input that follow each other.
pub(crate) struct FacesInOrder<'a> {
    /// Number of the first.
    first: usize,
    faces: Cow<'a, [[VertexId; 3]]>,
    /// All points, or the positions of the faces' vertices.
    points: &'a [Vec3],
    corners: Vec<[Vec3; 3]>,
}

impl FacesInOrder<'_> {
    /// Returns each face with its number.
    pub(crate) fn numbered(&self) -> impl Iterator<Item = (usize, [VertexId; 3])> {
        (self.first..).zip(self.faces.iter().copied())
    }
    /// Returns the positions of a face's vertices, in the unit frame.
    #[inline(always)]
    pub(crate) fn positions(&self, face: usize, t: [VertexId; 3]) -> [Vec3; 3] {
        match self.corners.get(face - self.first) {
            Some(corners) => *corners,
            None => t.map(|w| self.points[w.index()]),
        }
    }
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
    fn faces(&self, range: Range<usize>, _: usize) -> FacesInOrder<'_> {
        let (first, faces) = (range.start, Cow::Borrowed(&self.faces[range]));
        FacesInOrder { first, faces, points: self.points, corners: Vec::new() }
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
    fn faces(&self, range: Range<usize>, stride: usize) -> FacesInOrder<'_> {
        let triangles = self.surface.triangles();
        let there: Vec<[VertexId; 3]> =
            self.faces[range.clone()].iter().map(|&i| triangles[i as usize]).collect();
        let here = there.iter().map(|t| t.map(|v| self.ordered.rank[v.index()])).collect();
        let corners = |(i, t): (usize, &[VertexId; 3])| match i.is_multiple_of(stride) {
            true => t.map(|v| self.place_there(v)),
            false => [Vec3::ZERO; 3],
        };
        let corners = range.clone().zip(&there).map(corners).collect();
        FacesInOrder { first: range.start, faces: Cow::Owned(here), points: &[], corners }
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

#[cfg(test)]
mod tests {
    use lodsmith_core::PositionsView;

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
        let faces = again.faces(100..200, 1);
        assert_eq!(faces.numbered().count(), 100);
        for (i, t) in faces.numbered() {
            assert_eq!(t, o.faces[i]);
            assert_eq!(faces.positions(i, t), t.map(|v| o.points[v.index()]));
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
