//! Accumulated plane quadrics, weighted by area. [Garland-Heckbert 1997]
//!
//! Unlike in the paper, each quadric is relative to its own vertex, so single precision is enough at any
//! distance from the origin, and planes are weighted by the area of their triangles.

use glam::Vec3;

use super::{CostSource, Form, Metric};
use crate::cost::tensor::Tensor;

#[derive(Clone, Copy)]
pub(crate) struct Quadric;

/// The form y·A·y + 2 g·y + e at the vertex + y.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PlaneQuadric {
    a: Tensor,
    g: Vec3,
    e: f32,
}

impl Metric for Quadric {
    type Memory = PlaneQuadric;

    #[inline(always)]
    fn tensor_of(memory: &PlaneQuadric) -> &Tensor {
        &memory.a
    }
    #[inline(always)]
    fn tensor(memory: &mut PlaneQuadric) -> &mut Tensor {
        &mut memory.a
    }
    #[inline(always)]
    fn is_memoryless(&self) -> bool {
        false
    }
    #[inline(always)]
    fn cost_source(&self) -> CostSource {
        CostSource::Form
    }
    #[inline(always)]
    fn form(&self, kept: &PlaneQuadric, removed: &PlaneQuadric, d: Vec3) -> Form {
        let mut a = kept.a;
        a.add(&removed.a);
        let ad = removed.a.times(d);
        let c = d.dot(ad) - 2.0 * removed.g.dot(d) + removed.e + kept.e;
        Form { a, h: ad - removed.g - kept.g, c }
    }
    #[inline(always)]
    fn merged(&self, form: &Form, y: Vec3) -> PlaneQuadric {
        let ay = form.a.times(y);
        PlaneQuadric { a: form.a, g: ay - form.h, e: (form.c - 2.0 * form.h.dot(y) + y.dot(ay)).max(0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_merged_quadric_still_measures_the_same_planes() {
        // The plane z = 0 relative to (0, 0, 0) and the plane x = 1 relative to (1, 0, 0).
        let at = |n: Vec3| PlaneQuadric { a: Tensor::outer(n, 1.0), ..PlaneQuadric::default() };
        let form = Quadric.form(&at(Vec3::Z), &at(Vec3::X), Vec3::X);
        let merged = Quadric.merged(&form, Vec3::new(0.5, 0.0, 0.25));
        let value = |m: &PlaneQuadric, y: Vec3| y.dot(m.a.times(y)) + 2.0 * m.g.dot(y) + m.e;
        let whole = |p: Vec3| p.z * p.z + (p.x - 1.0) * (p.x - 1.0);
        for p in [Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0), Vec3::new(-0.5, 0.1, 0.2)] {
            assert!((value(&merged, p - Vec3::new(0.5, 0.0, 0.25)) - whole(p)).abs() < 1e-5);
        }
    }
}
