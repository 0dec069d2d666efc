//! Geometry of the final triangles, four at a time.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use wide::f32x4;

use super::normal_equations::FaceNormalEquations;
use crate::chunks;
use crate::collapse::store::Store;
use crate::cost::lanes::{Four, cross, dot, sub};
use crate::cost::metric::VertexMemory;

/// Square of the fraction of a face's height by which all its corners may move without rotating it by 60
/// degrees: 11, 17 and 30 degrees, one after the other.
const FREE_MOVE_SHARE_SQ: f32 = 0.04;

/// Four final triangles in SIMD lanes, each starting at one of its corners.
pub(super) struct FourFaces {
    /// Unit normals.
    pub(super) normal: Four,
    /// Gradients of the barycentric coordinates of the second and third corner.
    pub(super) second: Four,
    pub(super) third: Four,
    /// Squared heights over the edges opposite to the corners.
    pub(super) high_sq: [f32x4; 3],
}

impl FourFaces {
    #[inline(always)]
    pub(super) fn new([a, b, c]: [Four; 3]) -> Self {
        let edges = [sub(&c, &b), sub(&a, &c), sub(&b, &a)];
        let least = f32x4::splat(1e-36);
        let normal = cross(&edges[2], &sub(&c, &a));
        let area_sq = dot(&normal, &normal).fast_max(least);
        let per_area = f32x4::ONE / area_sq.sqrt();
        let normal = normal.map(|x| x * per_area);
        let slope = normal.map(|x| x * per_area);
        let high_sq = [0, 1, 2].map(|k| area_sq / dot(&edges[k], &edges[k]).fast_max(least));
        Self { normal, second: cross(&slope, &edges[1]), third: cross(&slope, &edges[2]), high_sq }
    }

    /// Returns a mask of the triangles that are no slivers and face within 30 degrees of the input's
    /// direction there (`facing`): no permitted rotation turns these over.
    #[inline(always)]
    pub(super) fn are_sound(&self, facing: &Four) -> f32x4 {
        let [x, y, z] = self.high_sq;
        let d = dot(&self.normal, facing);
        // The least height belongs to the longest edge: height² = area · height / edge.
        let (least, most) = (x.fast_min(y).fast_min(z), x.fast_max(y).fast_max(z));
        d.simd_gt(f32x4::ZERO) & (d * d).simd_gt(dot(facing, facing) * 0.75) & least.simd_gt(most * 1e-4)
    }
}

/// Data of the final triangles before sampling.
pub(super) struct FaceData {
    pub(super) loads: Vec<FaceNormalEquations>,
    /// For each vertex the square of a move that rotates no face too far, even if all its corners move as
    /// far; 0 unless all faces are oriented as the input was.
    pub(super) leeway: Vec<f32>,
}

#[inline(never)]
pub(super) fn face_data<Q: VertexMemory>(store: &Store<Q>) -> FaceData {
    // (Numbers that are not negative have the order of their bits.)
    let leeways = chunks::list(store.v.len(), |_| AtomicU32::new(f32::INFINITY.to_bits()));
    let mut loads = bytemuck::zeroed_vec::<FaceNormalEquations>(store.t.len());
    chunks::fill(&mut loads, |start, loads| {
        for (few, loads) in store.t[start..][..loads.len()].chunks(4).zip(loads.chunks_mut(4)) {
            let t = [0, 1, 2, 3].map(|i: usize| few[i.min(few.len() - 1)]);
            let four = FourFaces::new([0, 1, 2].map(|k| store.four(t.map(|t| t[k]))));
            let is_sound = four.are_sound(&store.four_facings(t));
            let leeway = four.high_sq.map(|high_sq| (is_sound & (high_sq * FREE_MOVE_SHARE_SQ)).to_array());
            let [x, y, z] = four.normal;
            let normals = f32x4::transpose([x, y, z, f32x4::ZERO]);
            for (i, (t, load)) in few.iter().zip(loads).enumerate() {
                for k in 0..3 {
                    let (of, leeway) = (&leeways[t[k].index()], leeway[k][i % 4].to_bits());
                    if leeway < of.load(Relaxed) {
                        of.fetch_min(leeway, Relaxed);
                    }
                }
                load.0[3] = normals[i % 4];
            }
        }
    });
    let leeway = leeways.into_iter().map(|bits| f32::from_bits(bits.into_inner())).collect();
    FaceData { loads, leeway }
}
