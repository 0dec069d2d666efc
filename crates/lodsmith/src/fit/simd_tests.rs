//! Tests of the SIMD triangle code against scalar code.

use glam::{Vec3, Vec3A};
use lodsmith_core::VertexId;
use proptest::collection::vec;
use proptest::prelude::*;

use super::faces::FourFaces;
use super::stars::{CachedStar, Fan, Nearest};
use crate::collapse::store::Store;
use crate::collapse::triangle::closest;
use crate::cost::lanes::four;
use crate::cost::tensor::Tensor;
use crate::test_support::{bits, tame_vector, vector};

/// [`FourFaces`] of one triangle.
struct ScalarFace {
    normal: Vec3,
    second: Vec3,
    third: Vec3,
    high_sq: [f32; 3],
}

impl ScalarFace {
    fn new([a, b, c]: [Vec3; 3]) -> Self {
        let edges = [c - b, a - c, b - a];
        let normal = edges[2].cross(c - a);
        let area_sq = normal.length_squared().max(1e-36);
        let per_area = 1.0 / area_sq.sqrt();
        let normal = normal * per_area;
        let slope = normal * per_area;
        let high_sq = edges.map(|e| area_sq / e.length_squared().max(1e-36));
        Self { normal, second: slope.cross(edges[1]), third: slope.cross(edges[2]), high_sq }
    }

    /// Returns true if the face is oriented as `facing` and is no sliver.
    fn is_sound(&self, facing: Vec3) -> bool {
        let [x, y, z] = self.high_sq;
        let d = self.normal.dot(facing);
        d > 0.0 && d * d > facing.length_squared() * 0.75 && x.min(y).min(z) > x.max(y).max(z) * 1e-4
    }

    /// Returns the squared distance of a point (relative to the first corner), its lateral distance, its
    /// height, and its coordinates.
    fn distance(&self, q: Vec3) -> [f32; 5] {
        let [h, v, w] = [self.normal, self.second, self.third].map(|n| n.x * q.x + n.y * q.y + n.z * q.z);
        let high = self.high_sq.map(f32::sqrt);
        let beside =
            [(v + w - 1.0) * high[0], -v * high[1], -w * high[2], 0.0].into_iter().fold(0.0, f32::max);
        [h * h + beside * beside, beside, h, v, w]
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(512) })]

    #[test]
    fn four_faces_at_once_equal_each_alone(
        any in [[vector(), vector(), vector()], [vector(), vector(), vector()]],
        tame in [[tame_vector(), tame_vector(), tame_vector()], [tame_vector(), tame_vector(), tame_vector()]],
        facings in [tame_vector(), tame_vector(), tame_vector(), tame_vector()],
    ) {
        let corners = [any[0], tame[0], any[1], tame[1]];
        // Few random directions agree with the normal of a face.
        let facings = [0, 1, 2, 3].map(|i| match i % 2 {
            0 => facings[i],
            _ => ScalarFace::new(corners[i]).normal + facings[i] * 0.5,
        });
        let all = FourFaces::new([0, 1, 2].map(|k| four(corners.map(|c| c[k]))));
        let sound = all.are_sound(&four(facings)).to_bitmask();
        for i in 0..4 {
            let face = ScalarFace::new(corners[i]);
            let lane = |v: &crate::cost::lanes::Four| v.map(|x| x.to_array()[i]);
            prop_assert_eq!(bits(lane(&all.normal)), bits(face.normal.to_array()));
            prop_assert_eq!(bits(lane(&all.second)), bits(face.second.to_array()));
            prop_assert_eq!(bits(lane(&all.third)), bits(face.third.to_array()));
            prop_assert_eq!(bits(lane(&all.high_sq)), bits(face.high_sq));
            prop_assert_eq!(sound & 1 << i != 0, face.is_sound(facings[i]));
        }
    }

    #[test]
    fn the_nearest_triangle_of_a_star_equals_a_scalar_search(
        centre in tame_vector(),
        rim in vec(prop_oneof![9 => tame_vector(), 1 => vector()], 3..20),
        places in vec(tame_vector(), 8),
        within in prop_oneof![Just(f32::INFINITY), 0.0..0.1f32],
    ) {
        let points: Vec<Vec3> = std::iter::once(centre).chain(rim.iter().copied()).collect();
        let n = rim.len() as u32;
        let faces: Vec<_> = (0..n).map(|i| [0, 1 + i, 1 + (i + 1) % n].map(VertexId)).collect();
        let mut store = Store::<Tensor>::new(&points, faces.clone(), None, None);
        store.link();
        let mut star = CachedStar::NONE;
        star.make(&store, VertexId(0));
        prop_assert_eq!(star.other_fans.len(), (faces.len() - 1) / 8);
        for q in places {
            let each = faces.iter().map(|t| ScalarFace::new(t.map(|w| store.p(w))).distance(q));
            let first = each.enumerate().min_by(|a, b| a.1[0].total_cmp(&b.1[0])).filter(|x| x.1[0] < within);
            let found = star.nearest(Vec3A::from(q), within).map(|f| {
                let Nearest { distance_sq, lateral, height, second, third, corner } = f;
                (corner.face(), [distance_sq, lateral, height, second, third])
            });
            prop_assert_eq!(found.map(|f| (f.0, bits(f.1))), first.map(|f| (f.0, bits(f.1))));
        }
    }

    /// The distance by heights over edges is exact, except beyond corners, where it is too small.
    #[test]
    fn distances_are_exact_except_beyond_corners(
        corners in [tame_vector(), tame_vector(), tame_vector()],
        q in tame_vector(),
    ) {
        let [a, b, c] = corners;
        let face = ScalarFace::new(corners);
        // (Gradients of slivers are mostly rounding error.)
        prop_assume!(face.high_sq.iter().all(|h| *h > 1e-3));
        let store = {
            let mut store = Store::<Tensor>::new(&corners, vec![[0, 1, 2].map(VertexId)], None, None);
            store.link();
            store
        };
        let mut fan = Fan::NONE;
        fan.make(&store, VertexId(0), store.listed(VertexId(0)));
        let found = fan.nearest(Vec3A::from(q - a), |d2| d2, f32::INFINITY).expect("there is one");
        let (distance_sq, at) = closest(q, a, b, c);
        let rounding = 1e-4 * (1.0 + distance_sq);
        prop_assert!(found.distance_sq <= distance_sq + rounding, "{} {distance_sq}", found.distance_sq);
        if corners.iter().all(|p| p.distance_squared(at) > 1e-6) {
            prop_assert!((found.distance_sq - distance_sq).abs() <= rounding, "{} {distance_sq}", found.distance_sq);
        }
    }
}
