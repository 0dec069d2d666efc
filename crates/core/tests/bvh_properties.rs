//! Property tests of the tree: it finds the same result as testing every face.

use glam::DVec3;
use lodsmith_core::geometry::triangle;
use lodsmith_core::spatial::{Bvh, Hint};
use lodsmith_core::{PositionsView, Surface, VertexId};
use proptest::prelude::*;

fn coordinate() -> impl Strategy<Value = f64> {
    // Integers give faces without area, equal corners and equal distances.
    prop_oneof![4 => -1.0..1.0, 2 => (-2..3).prop_map(f64::from), 1 => -1e-6..1e-6]
}

fn position() -> impl Strategy<Value = [f64; 3]> {
    [coordinate(), coordinate(), coordinate()]
}

/// Strategy for positions, some of them not finite, and triangles over them.
fn soup() -> impl Strategy<Value = (Vec<[f64; 3]>, Vec<[u32; 3]>)> {
    let any =
        prop_oneof![40 => position(), 1 => Just([f64::NAN, 0.0, 0.0]), 1 => Just([0.0, f64::INFINITY, 0.0])];
    proptest::collection::vec(any, 1..60).prop_flat_map(|positions| {
        let index = 0..positions.len() as u32;
        let triangle = [index.clone(), index.clone(), index];
        (Just(positions), proptest::collection::vec(triangle, 0..300))
    })
}

/// Smallest squared distance over all faces with finite corners, in the units of the positions.
fn by_every_face(p: [f64; 3], positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Option<f64> {
    triangles
        .iter()
        .map(|t| t.map(|v| DVec3::from(positions[v as usize])))
        .filter(|corners| corners.iter().all(|c| c.is_finite()))
        .map(|corners| triangle::nearest(p.into(), corners).distance_sq)
        .min_by(f64::total_cmp)
}

proptest! {
    #[test]
    fn the_tree_finds_what_every_face_finds(
        (positions, triangles) in soup(),
        queries in proptest::collection::vec(position(), 1..40),
        scale in prop_oneof![Just(1.0), Just(1e-3), Just(1e6)],
        shift in prop_oneof![Just(0.0), Just(4e6)],
    ) {
        let place = |p: &[f64; 3]| p.map(|x| x * scale + shift);
        let positions: Vec<_> = positions.iter().map(place).collect();
        let faces: &[[VertexId; 3]] = bytemuck::cast_slice(&triangles);
        let tree = Bvh::new(&Surface::new(PositionsView::F64(&positions), faces).unwrap());
        let mut hint = Hint::default();
        for p in queries.iter().map(place) {
            let wanted = by_every_face(p, &positions, &triangles).map(f64::sqrt);
            let plain = tree.closest(p);
            prop_assert_eq!(plain.is_some(), wanted.is_some());
            let (Some(hit), Some(wanted)) = (plain, wanted) else { continue };
            // Both sides round; the reference computation here uses full coordinates.
            let tolerance = (scale + shift) * 1e-14;
            prop_assert!((hit.distance - wanted).abs() <= tolerance, "{:?} instead of {}", hit, wanted);
            let (point, query) = (DVec3::from(hit.point), DVec3::from(p));
            prop_assert!((point.distance(query) - hit.distance).abs() <= tolerance);
            // The point lies on the returned face.
            let corners = triangles[hit.face.index()].map(|v| DVec3::from(positions[v as usize]));
            prop_assert!(triangle::nearest(point, corners).distance_sq.sqrt() <= tolerance);
            // A hint changes the speed, not the distance.
            let hinted = tree.closest_from(p, &mut hint).unwrap();
            prop_assert_eq!(hinted.distance, hit.distance);
            // A bound just above the distance finds the point, one just below does not.
            let mut other = hint;
            prop_assert!(tree.closest_within(p, hit.distance * 1.001 + tolerance, &mut other).is_some());
            prop_assert!(tree.closest_within(p, hit.distance * 0.999, &mut other).is_none());
        }
    }
}
