//! Symmetric 3×3 tensors in single precision, from which the cost of a collapse is computed.

use glam::Vec3;

/// A symmetric matrix: xx, yy, zz, xy, xz, yz.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(transparent)]
pub(crate) struct Tensor(pub(crate) [f32; 6]);

impl Tensor {
    /// Returns `weight` · n nᵀ.
    #[inline(always)]
    pub(crate) fn outer(n: Vec3, weight: f32) -> Self {
        let w = n * weight;
        Self([w.x * n.x, w.y * n.y, w.z * n.z, w.x * n.y, w.x * n.z, w.y * n.z])
    }
    /// Returns the squared distance to a line along `edge`, times `weight` · |edge|².
    #[inline(always)]
    pub(crate) fn line(edge: Vec3, weight: f32) -> Self {
        let (mut s, l2) = (Self::outer(edge, -weight), weight * edge.length_squared());
        for k in 0..3 {
            s.0[k] += l2;
        }
        s
    }
    #[inline(always)]
    pub(crate) fn add(&mut self, other: &Self) {
        for k in 0..6 {
            self.0[k] += other.0[k];
        }
    }
    #[inline(always)]
    pub(crate) fn sub(&mut self, other: &Self) {
        for k in 0..6 {
            self.0[k] -= other.0[k];
        }
    }
    /// Subtracts another tensor.
    #[inline(always)]
    pub(crate) fn less(mut self, other: &Self) -> Self {
        self.sub(other);
        self
    }
    #[inline(always)]
    pub(crate) fn trace(&self) -> f32 {
        self.0[0] + self.0[1] + self.0[2]
    }
    /// Adds `r` to the diagonal.
    #[inline(always)]
    pub(crate) fn damped(mut self, r: f32) -> Self {
        for k in 0..3 {
            self.0[k] += r;
        }
        self
    }
    #[inline(always)]
    pub(crate) fn times(&self, d: Vec3) -> Vec3 {
        let a = &self.0;
        Vec3::new(
            a[0] * d.x + a[3] * d.y + a[4] * d.z,
            a[3] * d.x + a[1] * d.y + a[5] * d.z,
            a[4] * d.x + a[5] * d.y + a[2] * d.z,
        )
    }
    /// Returns adjugate and determinant.
    #[inline(always)]
    pub(crate) fn adjugate(&self) -> (Self, f32) {
        let a = &self.0;
        let (xx, xy, xz) = (a[1] * a[2] - a[5] * a[5], a[5] * a[4] - a[3] * a[2], a[3] * a[5] - a[1] * a[4]);
        let c = [xx, a[0] * a[2] - a[4] * a[4], a[0] * a[1] - a[3] * a[3], xy, xz, a[3] * a[4] - a[0] * a[5]];
        (Self(c), a[0] * xx + a[3] * xy + a[4] * xz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_adjugate_solves() {
        let mut a = Tensor::outer(Vec3::new(1.0, 2.0, 3.0), 0.5);
        a.add(&Tensor::line(Vec3::new(-1.0, 0.5, 2.0), 1.0));
        let (c, det) = a.adjugate();
        let x = Vec3::new(0.3, -0.7, 1.1);
        assert!((c.times(a.times(x)) / det - x).length() < 1e-4);
    }

    #[test]
    fn a_line_costs_nothing_along_itself() {
        let edge = Vec3::new(2.0, -1.0, 0.5);
        assert!(Tensor::line(edge, 10.0).times(edge).length() < 1e-4);
    }
}
