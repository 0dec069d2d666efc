//! Proofs of single faces, while a mesh is being changed.

use std::sync::atomic::AtomicBool;

use glam::DVec3;

use super::map::LimitMap;
use super::rule::{ByCorners, ByFace, Everywhere, Rule};
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
    /// With the values of the corners.
    valued: Vec<Piece<f64>>,
}

impl FaceTest {
    /// True if all of a face is proven to lie within a distance of a surface; positions and distance are in the
    /// units of the surface. False also if the work limit is reached.
    ///
    /// `near` is a face of the surface's tree that is likely to be near, and is updated. Cost: some steps of O(log n)
    /// for each face of the surface below the face.
    pub fn is_within(&mut self, face: [[f64; 3]; 3], to: &Prepared, distance: f64, near: &mut u32) -> bool {
        let (face, limit) = in_frame(to, face, distance);
        is_proven(&mut self.pieces, face, [(); 3], to.tree(), Everywhere, limit, near)
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
        is_proven(&mut self.pieces, face, [(); 3], &Few(to), Everywhere, distance, near)
    }

    /// As [`Self::is_within`]; the limit at a point is the distance times the value of the map at the point of the
    /// surface that is closest to it.
    pub fn is_within_map(
        &mut self,
        face: [[f64; 3]; 3],
        (to, map): (&Prepared, &LimitMap),
        distance: f64,
        near: &mut u32,
    ) -> bool {
        let (face, limit) = in_frame(to, face, distance);
        is_proven(&mut self.pieces, face, [(); 3], to.tree(), ByFace(map), limit, near)
    }

    /// As [`Self::is_within`]; the limit at a point is the distance times the value there, which is linear on the face
    /// and given at its corners, from 0 to 1.
    pub fn is_within_own(
        &mut self,
        face: [[f64; 3]; 3],
        values: [f64; 3],
        to: &Prepared,
        distance: f64,
        near: &mut u32,
    ) -> bool {
        let (face, limit) = in_frame(to, face, distance);
        is_proven(&mut self.valued, face, values, to.tree(), ByCorners, limit, near)
    }

    /// As [`Self::is_within_few`], with the limits of [`Self::is_within_own`].
    pub fn is_within_few_own(
        &mut self,
        face: [DVec3; 3],
        values: [f64; 3],
        to: &[BoxedFace],
        distance: f64,
        near: &mut u32,
    ) -> bool {
        is_proven(&mut self.valued, face, values, &Few(to), ByCorners, distance, near)
    }
}

/// Returns a face and a distance in the unit frame of a surface.
fn in_frame(of: &Prepared, face: [[f64; 3]; 3], distance: f64) -> ([DVec3; 3], f64) {
    let frame = of.tree().frame();
    (face.map(|p| frame.unit_from_user(p)), frame.unit_length(distance))
}

fn is_proven<T: Target, R: Rule>(
    pieces: &mut Vec<Piece<R::Value>>,
    face: [DVec3; 3],
    values: [R::Value; 3],
    to: &T,
    rule: R,
    limit: f64,
    near: &mut u32,
) -> bool {
    let is_found = AtomicBool::new(false);
    let mut search = PieceSearch::new(to, rule, ProofLimits { limit, tolerance: None, is_found: &is_found });
    search.pieces = std::mem::take(pieces);
    search.pieces.clear();
    search.pieces.push(Piece::of_face(face, values, *near));
    *near = search.run(MAX_STEPS);
    let is_within = search.pieces.is_empty() && search.seen <= limit && search.bound <= limit;
    *pieces = search.pieces;
    is_within
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::triangle::{nearest, weights_at};
    use crate::measure::proof::{WithinResult, prove_within};
    use crate::{PositionsView, Surface, TriMesh, VertexId, shapes};

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

    /// Barycentric coordinates of a grid of points of a face.
    fn grid() -> impl Iterator<Item = [f64; 3]> {
        const STEPS: usize = 8;
        let weights = |i, j| [i, j, STEPS - i - j].map(|n| n as f64 / STEPS as f64);
        (0..=STEPS).flat_map(move |i| (0..=STEPS - i).map(move |j| weights(i, j)))
    }

    #[test]
    fn limits_of_a_map_are_kept_by_points_of_proven_faces() {
        for mesh in [shapes::blob(3, 1), shapes::grid(16)] {
            check_map(&mesh);
        }
    }

    fn check_map(mesh: &TriMesh) {
        let to = Prepared::new(&mesh.surface()).expect("there are faces");
        let at = |f: usize| mesh.triangles()[f].map(|w| mesh.positions().view().get(mesh.vertex_of(w)));
        let value = |p: [f64; 3]| if p[0] > 0.2 { 1.0 } else { (0.5 + 0.4 * (9.0 * p[1]).sin()) as f32 };
        let map = LimitMap::new(&to, |f| at(f.index()).map(value));
        let mut test = FaceTest::default();
        let (mut near, mut near_own) = (u32::MAX, u32::MAX);
        let mut counts = [[0; 2]; 2];
        let faces = mesh.face_count();
        for (f, step) in (0..faces).step_by(3).flat_map(|f| [0, 1, 2, 5, 9].map(|step| (f, step))) {
            let lifted = |[x, y, z]: [f64; 3]| [x, y, z + 0.01 * (f % 4) as f64];
            let others = [f, f + step, f + 3 * step].map(|f| f % faces);
            let corners = [0, 1, 2].map(|k| lifted(at(others[k])[k]));
            let own = [0, 1, 2].map(|k| f64::from(value(at(others[k])[k])));
            let hits = || {
                grid().map(|w| {
                    let p = [0, 1, 2].map(|i| (0..3).map(|k| w[k] * corners[k][i]).sum::<f64>());
                    (w, to.tree().closest(p).expect("there are faces"))
                })
            };
            let check = |distance: f64, limit: f64| {
                assert!(distance <= limit + 1e-9, "{f} {step}: {distance} {limit}")
            };
            for distance in [0.02, 0.06] {
                let is_within = test.is_within_map(corners, (&to, &map), distance, &mut near);
                counts[0][usize::from(is_within)] += 1;
                for (_, hit) in hits().filter(|_| is_within) {
                    let near = at(hit.face.index());
                    let weights = weights_at(hit.point.into(), near.map(DVec3::from));
                    let share: f64 = (0..3).map(|k| weights[k] * f64::from(value(near[k]))).sum();
                    check(hit.distance, distance * share);
                }
                let is_within = test.is_within_own(corners, own, &to, distance, &mut near_own);
                counts[1][usize::from(is_within)] += 1;
                for (w, hit) in hits().filter(|_| is_within) {
                    let share: f64 = (0..3).map(|k| w[k] * own[k]).sum();
                    check(hit.distance, distance * share);
                }
            }
        }
        assert!(counts.as_flattened().iter().all(|n| *n > faces / 9), "{counts:?}");
    }

    #[test]
    fn nothing_is_within_a_distance_of_no_face() {
        assert!(!FaceTest::default().is_within_few([DVec3::ZERO, DVec3::X, DVec3::Y], &[], 1.0, &mut 0));
    }
}
