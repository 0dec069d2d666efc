//! The normal equations of the fit, face by face: sums over the samples of a final triangle.

use glam::{Vec3, Vec3A, Vec4};
use wide::f32x4;

use crate::cost::lanes::max;
use crate::cost::tensor::Tensor;

/// Sums over the samples of a final triangle, and its normal and lifts for the solve: one cache line, four
/// rows of three numbers plus one. b: barycentric coordinates, r: height over the plane.
///
/// ```text
/// b0 b0  b1 b1  b2 b2    lift of corner 0: how far it goes along the normal
/// b1 b2  b0 b2  b0 b1    lift of corner 1
/// r b0   r b1   r b2     lift of corner 2
/// unit normal            largest squared distance
/// ```
#[derive(Clone, Copy, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub(super) struct FaceNormalEquations(pub(super) [f32x4; 4]);

/// For each corner, the indices in a [`FaceNormalEquations`] of its product with another corner, that corner's lift, and the
/// same for the third corner.
const PRODUCT_INDICES: [[usize; 4]; 4] = [[6, 7, 5, 11], [6, 3, 4, 11], [5, 3, 4, 7], [0; 4]];

impl FaceNormalEquations {
    #[inline(always)]
    pub(super) fn numbers(&self) -> &[f32; 16] {
        bytemuck::cast_ref(&self.0)
    }

    #[inline(always)]
    pub(super) fn numbers_mut(&mut self) -> &mut [f32; 16] {
        bytemuck::cast_mut(&mut self.0)
    }

    /// Returns the normal with a zero in the fourth lane: the square of the value there may be subnormal, and
    /// subnormal numbers are a hundred times slower.
    #[inline(always)]
    pub(super) fn row_of_normal(&self) -> f32x4 {
        let all = f32::from_bits(!0);
        self.0[3] & f32x4::new([all, all, all, 0.0])
    }

    #[inline(always)]
    pub(super) fn normal(&self) -> Vec3A {
        Vec3A::from_vec4(Vec4::from_array(self.row_of_normal().to_array()))
    }

    #[inline(always)]
    pub(super) fn max_distance_sq(&self) -> f32 {
        self.numbers()[15]
    }

    /// Returns the coefficient of the square of corner `k`'s lift.
    #[inline(always)]
    pub(super) fn weight(&self, k: usize) -> f32 {
        self.numbers()[k]
    }

    /// Returns the weighted lift that corner `k` still lacks, given the lifts of the others. (By a table: a
    /// branch on k is unpredictable.)
    #[inline(always)]
    pub(super) fn missing_lift(&self, k: usize) -> f32 {
        let (n, [a, b, c, d]) = (self.numbers(), PRODUCT_INDICES[k]);
        n[8 + k] - n[a] * n[b] - n[c] * n[d]
    }

    /// Returns the reduction of the sum of squares by the lifts.
    #[inline(always)]
    pub(super) fn gain(&self) -> f32 {
        let n = self.numbers();
        let lift = Vec3::new(n[3], n[7], n[11]);
        let bb = Tensor([n[0], n[1], n[2], n[6], n[5], n[4]]);
        lift.dot(2.0 * Vec3::new(n[8], n[9], n[10]) - bb.times(lift))
    }

    /// Adds a sample.
    #[inline(always)]
    pub(super) fn add(&mut self, b: f32x4, weight: f32, height: f32, distance_sq: f32) {
        let weighted = b * weight;
        let ([x, y, _, none], [_, v, w, _]) = (weighted.to_array(), b.to_array());
        self.0[0] += weighted * b;
        self.0[1] += f32x4::new([y, x, x, none]) * f32x4::new([w, w, v, none]);
        self.0[2] += b * (weight * height);
        let worst = &mut self.numbers_mut()[15];
        *worst = max(*worst, distance_sq);
    }
}
