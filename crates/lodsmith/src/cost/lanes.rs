//! Vectors in structure-of-arrays form for SIMD: x, y and z of four vectors in three registers; and single
//! vectors in one register.

use glam::{Vec3, Vec3A, Vec4};
use wide::f32x4;

use crate::cost::tensor::Tensor;

/// Four vectors, one in each lane.
pub(crate) type Four = [f32x4; 3];

/// Returns the same vector in all four lanes.
#[inline(always)]
pub(crate) fn splat(v: Vec3) -> Four {
    v.to_array().map(f32x4::splat)
}

/// Transposes four vectors into lanes.
#[inline(always)]
pub(crate) fn four(v: [Vec3; 4]) -> Four {
    let [x, y, z, _] = f32x4::transpose(v.map(|v| f32x4::new([v.x, v.y, v.z, 0.0])));
    [x, y, z]
}

/// Transposes back into four vectors, each padded with a zero: the inverse of [`four`].
#[inline(always)]
pub(crate) fn rows(v: &Four) -> [f32x4; 4] {
    f32x4::transpose([v[0], v[1], v[2], f32x4::ZERO])
}

#[inline(always)]
pub(crate) fn sub(a: &Four, b: &Four) -> Four {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn dot(a: &Four, b: &Four) -> f32x4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: &Four, b: &Four) -> Four {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

/// Returns `weight` · n nᵀ, component by component: [`Tensor::outer`] of four vectors.
#[inline(always)]
pub(crate) fn outer(n: &Four, weight: f32x4) -> [f32x4; 6] {
    let w = n.map(|x| x * weight);
    [w[0] * n[0], w[1] * n[1], w[2] * n[2], w[0] * n[1], w[0] * n[2], w[1] * n[2]]
}

/// Transposes four tensors into lanes, component by component.
#[inline(always)]
pub(crate) fn side_by_side(t: [&Tensor; 4]) -> [f32x4; 6] {
    let [a, b, c, d] = f32x4::transpose(t.map(|t| f32x4::new([t.0[0], t.0[1], t.0[2], t.0[3]])));
    let [e, f, ..] = f32x4::transpose(t.map(|t| f32x4::new([t.0[4], t.0[5], 0.0, 0.0])));
    [a, b, c, d, e, f]
}

/// Returns the sum of each of four registers: [`f32x4::reduce_add`] of each, to the bit.
#[inline(always)]
pub(crate) fn sums(of: [f32x4; 4]) -> f32x4 {
    let [a, b, c, d] = f32x4::transpose(of);
    a + b + c + d
}

/// Transposes back into four tensors: the inverse of [`side_by_side`].
#[inline(always)]
pub(crate) fn tensors(t: [f32x4; 6]) -> [Tensor; 4] {
    let first = f32x4::transpose([t[0], t[1], t[2], t[3]]).map(f32x4::to_array);
    let last = f32x4::transpose([t[4], t[5], f32x4::ZERO, f32x4::ZERO]).map(f32x4::to_array);
    std::array::from_fn(|i| {
        let ([a, b, c, d], [e, f, ..]) = (first[i], last[i]);
        Tensor([a, b, c, d, e, f])
    })
}

/// Returns a vector in one register.
#[inline(always)]
pub(crate) fn in_register(v: Vec3) -> Vec3A {
    Vec3A::from_vec4(v.extend(0.0))
}

/// Returns the dot products of one vector with four others.
#[inline(always)]
pub(crate) fn dots(a: Vec3A, others: [Vec3A; 4]) -> [f32; 4] {
    let [x, y, z, _] = f32x4::transpose(others.map(|b| f32x4::new(Vec4::from((a * b, 0.0)).to_array())));
    (x + y + z).to_array()
}

/// Returns the smaller of two, without the NaN handling that costs `f32::min` a few instructions.
#[inline(always)]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Returns the larger of two, without NaN handling too.
#[inline(always)]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::test_support::{bits, four_vectors, vector};

    /// Returns one lane.
    fn lane(v: &Four, i: usize) -> Vec3 {
        Vec3::from(v.map(|x| x.to_array()[i]))
    }

    fn same(a: Vec3, b: Vec3) -> bool {
        bits(a.to_array()) == bits(b.to_array())
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(512) })]

        #[test]
        fn operations_on_four_vectors_equal_those_on_each_alone(
            v in four_vectors(),
            w in four_vectors(),
            one in vector(),
            weights in [-2.0..2.0f32, 0.0..1e-20f32, 0.0..f32::MIN_POSITIVE, 1.0..1e9f32],
        ) {
            let (a, b) = (four(v), four(w));
            let (tensors, products) = (tensors(outer(&a, f32x4::new(weights))), dot(&a, &b).to_array());
            for i in 0..4 {
                prop_assert!(same(lane(&a, i), v[i]) && same(lane(&splat(one), i), one));
                prop_assert!(same(lane(&sub(&a, &b), i), v[i] - w[i]));
                prop_assert!(same(lane(&cross(&a, &b), i), v[i].cross(w[i])));
                prop_assert_eq!(bits([products[i]]), bits([v[i].dot(w[i])]));
                prop_assert_eq!(bits(tensors[i].0), bits(Tensor::outer(v[i], weights[i]).0));
                let row = rows(&a)[i].to_array();
                prop_assert_eq!(bits(row), bits(v[i].extend(0.0).to_array()));
            }
            let back = super::tensors(side_by_side(tensors.each_ref()));
            prop_assert_eq!(back.map(|t| bits(t.0)), tensors.map(|t| bits(t.0)));
        }
    }

    #[test]
    fn four_sums_equal_the_sum_of_each() {
        // (Numbers whose sum depends on the order.)
        let rows =
            [[1e8, 1.0, -1e8, 1.0], [0.1, 0.2, 0.3, 0.4], [3.0, -1e-7, 2.0, 1e-7], [1e-3, 1e3, 1e-3, 1e3]];
        let rows = rows.map(f32x4::new);
        assert_eq!(sums(rows).to_array(), rows.map(f32x4::reduce_add));
    }
}
