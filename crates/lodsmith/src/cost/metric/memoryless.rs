//! Memoryless metric: star tensors of the current surface.
//!
//! A vertex carries the sum of area · n nᵀ over the triangles of its *current* star, plus the tensors of the
//! lines of its border edges. All those planes pass through the vertex, so the tensor is its whole quadric:
//! there is no linear or constant term, nothing to merge, and single precision is enough. [Lindstrom-Turk
//! 1998] found that costs without memory lead to closer meshes; their volume constraint adds nothing to that
//! (measured) and is left out.

use glam::Vec3;

use super::{CostSource, Form, Metric};
use crate::cost::tensor::Tensor;

#[derive(Clone, Copy)]
pub(crate) struct Memoryless;

impl Metric for Memoryless {
    type Memory = Tensor;

    #[inline(always)]
    fn tensor_of(memory: &Tensor) -> &Tensor {
        memory
    }
    #[inline(always)]
    fn tensor(memory: &mut Tensor) -> &mut Tensor {
        memory
    }
    #[inline(always)]
    fn is_memoryless(&self) -> bool {
        true
    }
    #[inline(always)]
    fn cost_source(&self) -> CostSource {
        CostSource::Engine
    }
    #[inline(always)]
    fn form(&self, kept: &Tensor, removed: &Tensor, d: Vec3) -> Form {
        let mut a = *kept;
        a.add(removed);
        let h = removed.times(d);
        Form { a, h, c: d.dot(h) }
    }
    #[inline(always)]
    fn merged(&self, form: &Form, _: Vec3) -> Tensor {
        form.a
    }
}
