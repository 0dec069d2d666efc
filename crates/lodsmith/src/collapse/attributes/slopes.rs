//! Gradients of values over triangles, relative to one corner.

use glam::Vec3;
use wide::f32x4;

use crate::cost::lanes::{self, Four, cross, sub};
use crate::cost::tensor::Tensor;

/// Doubled area below which a triangle's gradients are unreliable, as a share of its longest edge squared.
const MIN_AREA_SHARE: f32 = 1e-3;

/// A triangle relative to one of its corners: doubled area, and the gradients of the barycentric
/// coordinates of the two other corners.
#[derive(Clone, Copy, Debug)]
pub(in crate::collapse) struct Slopes {
    pub(in crate::collapse) area: f32,
    pub(in crate::collapse) a: Vec3,
    pub(in crate::collapse) b: Vec3,
}

impl Slopes {
    #[inline(always)]
    pub(in crate::collapse) fn new([o, a, b]: [Vec3; 3]) -> Self {
        let normal = (a - o).cross(b - o);
        Self::with_normal([o, a, b], normal, normal.length())
    }

    /// Computes the slopes from the known normal of double length and its length.
    #[inline(always)]
    pub(in crate::collapse) fn with_normal([o, a, b]: [Vec3; 3], normal: Vec3, area: f32) -> Self {
        let (to_a, to_b) = (a - o, b - o);
        let longest = to_a.length_squared().max(to_b.length_squared()).max((b - a).length_squared());
        let n = normal * (1.0 / (area.max(MIN_AREA_SHARE * longest) * area.max(1e-30)).max(1e-30));
        Self { area, a: to_b.cross(n), b: n.cross(to_a) }
    }

    /// Returns the tensor of the squared gradients of values, from the weighted sums of the squares and
    /// products of their differences to the two corners.
    #[inline(always)]
    pub(super) fn tensor(&self, aa: f32, ab: f32, bb: f32) -> Tensor {
        let (p, q) = (self.a * aa + self.b * ab, self.a * ab + self.b * bb);
        let (a, b) = (self.a, self.b);
        let sum = [
            p.x * a.x + q.x * b.x,
            p.y * a.y + q.y * b.y,
            p.z * a.z + q.z * b.z,
            p.x * a.y + q.x * b.y,
            p.x * a.z + q.x * b.z,
            p.y * a.z + q.y * b.z,
        ];
        Tensor(sum.map(|x| x * self.area))
    }
}

/// Slopes of four triangles side by side.
#[derive(Clone, Copy, Debug)]
pub(in crate::collapse) struct FourSlopes {
    pub(in crate::collapse) area: f32x4,
    pub(in crate::collapse) a: Four,
    pub(in crate::collapse) b: Four,
}

impl FourSlopes {
    /// Computes the slopes relative to `o` from the normals of double length and their lengths:
    /// [`Slopes::with_normal`] four side by side.
    #[inline(always)]
    pub(in crate::collapse) fn new([o, a, b]: [&Four; 3], normal: &Four, area: f32x4) -> Self {
        let (to_a, to_b, edge) = (sub(a, o), sub(b, o), sub(b, a));
        let square = |v: &Four| lanes::dot(v, v);
        let longest = square(&to_a).fast_max(square(&to_b)).fast_max(square(&edge));
        let tiny = f32x4::splat(1e-30);
        let divisor = area.fast_max(longest * MIN_AREA_SHARE) * area.fast_max(tiny);
        let scale = f32x4::ONE / divisor.fast_max(tiny);
        let n = normal.map(|x| x * scale);
        Self { area, a: cross(&to_b, &n), b: cross(&n, &to_a) }
    }

    /// Computes the slopes relative to the first corners.
    #[inline(always)]
    pub(in crate::collapse) fn of([o, a, b]: [&Four; 3]) -> Self {
        let normal = cross(&sub(a, o), &sub(b, o));
        Self::new([o, a, b], &normal, lanes::dot(&normal, &normal).sqrt())
    }

    /// Returns the slopes of one triangle.
    #[inline(always)]
    pub(in crate::collapse) fn one(&self, i: usize) -> Slopes {
        let of = |x: &f32x4| x.to_array()[i & 3];
        let vector = |v: &Four| Vec3::new(of(&v[0]), of(&v[1]), of(&v[2]));
        Slopes { area: of(&self.area), a: vector(&self.a), b: vector(&self.b) }
    }

    /// Returns the slopes of each triangle as rows.
    #[inline(always)]
    pub(in crate::collapse) fn rows(&self) -> [SlopesRow; 4] {
        let per_area = f32x4::ONE / self.area.fast_max(f32x4::splat(1e-30));
        let [ax, ay, az] = self.a;
        let [bx, by, bz] = self.b;
        let [p, q, r, s] = f32x4::transpose([ax, ay, az, self.area]);
        let [t, u, v, w] = f32x4::transpose([bx, by, bz, per_area]);
        let row = |a, b| SlopesRow { a, b };
        [row(p, t), row(q, u), row(r, v), row(s, w)]
    }
}

/// [`Slopes`] in two rows: the last lane of `a` is the area, the last lane of `b` its reciprocal.
#[derive(Clone, Copy, Debug)]
pub(in crate::collapse) struct SlopesRow {
    a: f32x4,
    b: f32x4,
}

impl SlopesRow {
    #[inline(always)]
    pub(in crate::collapse) fn area(&self) -> f32 {
        self.a.to_array()[3]
    }
    #[inline(always)]
    pub(super) fn per_area(&self) -> f32 {
        self.b.to_array()[3]
    }
    /// Returns the gradient of a value times the area, from its differences at the two corners times the
    /// area.
    #[inline(always)]
    pub(super) fn gain(&self, a: f32x4, b: f32x4) -> [f32x4; 3] {
        let ([ax, ay, az, _], [bx, by, bz, _]) = (self.a.to_array(), self.b.to_array());
        [a * ax + b * bx, a * ay + b * by, a * az + b * bz]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_of_four_triangles_equal_those_of_each_alone() {
        // A triangle of ordinary size, a sliver, a triangle without area, and a large one.
        let triangles = [
            [[0.1, 0.2, 0.3], [0.4, 0.1, 0.2], [0.3, 0.5, 0.7]],
            [[0.0, 0.0, 0.0], [1.0, 1e-4, 0.0], [2.0, 1e-7, 1e-7]],
            [[0.5, 0.5, 0.5], [0.5, 0.5, 0.5], [0.7, 0.1, 0.2]],
            [[-1.0, 3.0, 2.0], [5.0, -4.0, 1.0], [2.0, 2.0, -6.0]],
        ]
        .map(|t| t.map(Vec3::from));
        let corner = |k: usize| [0, 1, 2].map(|axis| f32x4::new(triangles.map(|t| t[k][axis])));
        let four = FourSlopes::of([&corner(0), &corner(1), &corner(2)]);
        for (i, (triangle, row)) in triangles.into_iter().zip(four.rows()).enumerate() {
            let (own, other) = (Slopes::new(triangle), four.one(i));
            let bits =
                |s: &Slopes| [s.a.to_array(), s.b.to_array(), [s.area; 3]].map(|v| v.map(f32::to_bits));
            assert_eq!(bits(&own), bits(&other), "{i}");
            assert_eq!(row.a.to_array(), own.a.extend(own.area).to_array());
            assert_eq!(row.b.to_array(), own.b.extend(1.0 / own.area.max(1e-30)).to_array());
        }
    }
}
