//! Sums of quadratic forms, four values side by side.

use glam::Vec3;
use wide::f32x4;

use crate::cost::lanes;
use crate::cost::metric::Form;
use crate::cost::tensor::Tensor;

/// A quadratic form in four partial sums, one for each lane.
pub(in crate::collapse) struct Sum {
    a: [f32x4; 6],
    h: [f32x4; 3],
    c: f32x4,
}

impl Sum {
    pub(in crate::collapse) const ZERO: Self =
        Self { a: [f32x4::ZERO; 6], h: [f32x4::ZERO; 3], c: f32x4::ZERO };

    /// Adds weight · (off · y − gap)², a form in y.
    #[inline(always)]
    pub(super) fn add_square(&mut self, off: &[f32x4; 3], gap: f32x4, weight: f32x4) {
        let scaled = off.map(|x| x * weight);
        add_outer(&mut self.a, &scaled, off);
        for (h, scaled) in self.h.iter_mut().zip(scaled) {
            *h += scaled * gap;
        }
        self.c += gap * gap * weight;
    }

    /// Adds the sum to a form.
    pub(in crate::collapse) fn add_to(&self, form: &mut Form) {
        form.a.add(&Tensor(self.a.map(f32x4::reduce_add)));
        form.h += Vec3::from(self.h.map(f32x4::reduce_add));
        form.c += self.c.reduce_add();
    }
    /// Adds four sums to four forms side by side.
    #[inline(always)]
    pub(in crate::collapse) fn add_four_to(
        four: &[Self; 4],
        (a, h, c): (&mut [f32x4; 6], &mut [f32x4; 3], &mut f32x4),
    ) {
        for (k, a) in a.iter_mut().enumerate() {
            *a += lanes::sums(four.each_ref().map(|sum| sum.a[k]));
        }
        for (k, h) in h.iter_mut().enumerate() {
            *h += lanes::sums(four.each_ref().map(|sum| sum.h[k]));
        }
        *c += lanes::sums(four.each_ref().map(|sum| sum.c));
    }
}

/// Adds p qᵀ to a symmetric matrix (xx, yy, zz, xy, xz, yz).
#[inline(always)]
pub(super) fn add_outer(a: &mut [f32x4; 6], p: &[f32x4; 3], q: &[f32x4; 3]) {
    for (sum, (j, k)) in a.iter_mut().zip([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]) {
        *sum += p[j] * q[k];
    }
}
