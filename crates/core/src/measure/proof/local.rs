//! Proofs of single faces, while a mesh is being changed.

use std::sync::atomic::AtomicBool;

use glam::DVec3;

pub use super::target::BoxedFace;
use super::target::{Few, Target};
use super::{Piece, PieceSearch, Prepared, ProofLimits};

/// Maximum number of steps of the proof of one face, after which the answer is no. (Guessed: scans take a
/// few, and a face far larger than those below it some hundreds.)
const MAX_STEPS: usize = 4096;

/// Tests single faces; keeps its buffers from one test to the next.
#[derive(Clone, Default)]
pub struct FaceTest {
    pieces: Vec<Piece>,
}

impl FaceTest {
    /// True if all of a face is proven to lie within a distance of a surface; positions and distance are in the
    /// units of the surface. False also if the work limit is reached.
    ///
    /// `near` is a face of the surface's tree that is likely to be near, and is updated. Cost: some steps of O(log n)
    /// for each face of the surface below the face.
    pub fn is_within(&mut self, face: [[f64; 3]; 3], to: &Prepared, distance: f64, near: &mut u32) -> bool {
        let frame = to.tree().frame();
        let face = face.map(|p| frame.unit_from_user(p));
        self.is_proven(face, to.tree(), frame.unit_length(distance), near)
    }

    /// As [`Self::is_within`], for a list of faces in place of a surface; all in the same units, `near` is an index in
    /// the list. Cost: O(n) for each of the n faces that lies below the face.
    pub fn is_within_few(
        &mut self,
        face: [DVec3; 3],
        to: &[BoxedFace],
        distance: f64,
        near: &mut u32,
    ) -> bool {
        self.is_proven(face, &Few(to), distance, near)
    }

    fn is_proven<T: Target>(&mut self, face: [DVec3; 3], to: &T, limit: f64, near: &mut u32) -> bool {
        let is_over = AtomicBool::new(false);
        let mut search = PieceSearch::new(to, ProofLimits { limit, tolerance: None, is_over: &is_over });
        search.pieces = std::mem::take(&mut self.pieces);
        search.pieces.clear();
        search.pieces.push(Piece::of_face(face, *near));
        *near = search.run(MAX_STEPS);
        let is_within = search.pieces.is_empty() && search.seen <= limit && search.bound <= limit;
        self.pieces = search.pieces;
        is_within
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::triangle::nearest;
    use crate::measure::proof::{WithinResult, prove_within};
    use crate::{PositionsView, Surface, VertexId, shapes};

    #[test]
    fn single_faces_are_judged_like_whole_surfaces() {
        let mesh = shapes::blob(3, 1);
        let to = Prepared::new(&mesh.surface()).expect("there are faces");
        let corners = |f: usize| mesh.triangles()[f].map(|w| mesh.positions().view().get(mesh.vertex_of(w)));
        let few: Vec<BoxedFace> =
            (0..mesh.face_count()).map(|f| BoxedFace::new(corners(f).map(DVec3::from))).collect();
        let mut test = FaceTest::default();
        let (mut near, mut near_few) = (u32::MAX, u32::MAX);
        let (mut within, mut beyond) = (0, 0);
        for f in (0..mesh.face_count()).step_by(7) {
            // A face that spans several: its corners come from different faces.
            let [a, b, c] =
                [f, (f + 9) % mesh.face_count(), (f + 31) % mesh.face_count()].map(|f| corners(f)[0]);
            let triangles = [[0, 1, 2].map(VertexId)];
            let alone = [a, b, c];
            let surface = Surface::new(PositionsView::F64(&alone), &triangles).expect("a face");
            let Ok(from) = Prepared::new(&surface) else { continue };
            for distance in [0.01, 0.05, 0.2] {
                let whole = matches!(prove_within(&from, &to, distance), WithinResult::Yes(_));
                assert_eq!(test.is_within(alone, &to, distance, &mut near), whole, "{f} {distance}");
                let of_few = test.is_within_few(alone.map(DVec3::from), &few, distance, &mut near_few);
                assert_eq!(of_few, whole, "{f} {distance} in a list");
                if whole {
                    within += 1
                } else {
                    beyond += 1
                }
                // The middle is one of the places that have to be within.
                let middle = (DVec3::from(a) + DVec3::from(b) + DVec3::from(c)) / 3.0;
                let off =
                    (0..mesh.face_count()).map(|f| nearest(middle, corners(f).map(DVec3::from)).distance_sq);
                assert!(!whole || off.fold(f64::INFINITY, f64::min).sqrt() <= distance);
            }
        }
        assert!(within > 20 && beyond > 20, "{within} {beyond}");
    }

    #[test]
    fn nothing_is_within_a_distance_of_no_face() {
        assert!(!FaceTest::default().is_within_few([DVec3::ZERO, DVec3::X, DVec3::Y], &[], 1.0, &mut 0));
    }
}
