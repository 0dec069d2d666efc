//! Vectors four side by side, for vector instructions: x, y and z of four in three registers.

use glam::Vec3;
use wide::f32x4;

/// Four vectors.
pub(crate) type Four = [f32x4; 3];

/// Four vectors, side by side.
#[inline(always)]
pub(crate) fn gather(v: [Vec3; 4]) -> Four {
    [0, 1, 2].map(|k| f32x4::new(v.map(|v| v[k])))
}

/// The same vector four times.
#[inline(always)]
pub(crate) fn splat(v: Vec3) -> Four {
    v.to_array().map(f32x4::splat)
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
