//! Random meshes for property tests (feature `proptest`).

use proptest::collection::vec;
use proptest::prelude::*;

use crate::ids::VertexId;
use crate::mesh::{Positions, TriMesh};
use crate::shapes;

/// Coordinates that random soups may contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Coordinates {
    /// Numbers around one, many of them equal.
    Tame,
    /// Numbers from 1e-30 to 1e30 of both signs, many of them equal.
    Wild,
    /// As `Wild`, plus infinities and NaN.
    NotFinite,
}

/// Strategy for one coordinate. A few values are likely, so that positions coincide.
pub fn coordinate(coordinates: Coordinates) -> BoxedStrategy<f64> {
    let tame = prop_oneof![
        4 => (-2i8..=2).prop_map(f64::from),
        1 => Just(-0.0),
        2 => -2.0..2.0f64,
    ];
    let wild = prop_oneof![4 => tame.clone(), 1 => (-30i32..30).prop_map(|e| 10f64.powi(e)),
        1 => (-30i32..30, -1.0..1.0f64).prop_map(|(e, x)| x * 10f64.powi(e))];
    match coordinates {
        Coordinates::Tame => tame.boxed(),
        Coordinates::Wild => wild.boxed(),
        Coordinates::NotFinite => prop_oneof![
            12 => wild,
            1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY)],
        ]
        .boxed(),
    }
}

/// Strategy for up to `faces` triangles over up to 24 vertices: any indices, so also degenerate, duplicate
/// and non-manifold ones; single or double precision.
pub fn soup(faces: usize, coordinates: Coordinates) -> impl Strategy<Value = TriMesh> {
    let points = vec([coordinate(coordinates), coordinate(coordinates), coordinate(coordinates)], 1..24);
    (points, any::<bool>()).prop_flat_map(move |(points, is_double)| {
        let count = points.len() as u32;
        let positions = if is_double {
            Positions::F64(points)
        } else {
            Positions::F32(points.iter().map(|p| p.map(|x| x as f32)).collect())
        };
        vec([0..count, 0..count, 0..count], 0..=faces).prop_map(move |triangles| {
            let triangles = triangles.into_iter().map(|t| t.map(VertexId)).collect();
            TriMesh::new(positions.clone(), triangles).expect("indices are below the count")
        })
    })
}

/// Strategy for one of [`shapes::all`], scaled by a power of ten between 1e-12 and 1e12, with its vertices
/// displaced by up to `noise` of their size, and some faces flipped or left out.
pub fn perturbed_shape(noise: f64) -> impl Strategy<Value = TriMesh> {
    let damage = prop_oneof![2 => Just(0u64), 1 => 1..20u64];
    (0..shapes::all().len(), -12..=12i32, any::<u64>(), damage.clone(), damage).prop_map(
        move |(shape, exponent, seed, turned, dropped)| {
            let (_, mesh) = shapes::all().swap_remove(shape);
            let scale = 10f64.powi(exponent);
            let mut random = seed;
            let mut roll = move |sides: u64| {
                // Constants of Knuth's MMIX generator; its high bits are good.
                random =
                    random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (random >> 33) % sides
            };
            let points = mesh.positions().view().iter().collect::<Vec<_>>();
            let points = points
                .iter()
                .map(|p| p.map(|x| (x + noise * (roll(2001) as f64 / 1000.0 - 1.0)) * scale))
                .collect();
            let mut triangles = Vec::new();
            for &[a, b, c] in mesh.triangles() {
                // `dropped` and `turned` are probabilities in percent.
                if roll(100) >= dropped {
                    let (b, c) = if roll(100) < turned { (c, b) } else { (b, c) };
                    triangles.push([a, b, c].map(|w| VertexId(w.0)));
                }
            }
            TriMesh::new(Positions::F64(points), triangles).expect("faces of a shape use its vertices")
        },
    )
}
