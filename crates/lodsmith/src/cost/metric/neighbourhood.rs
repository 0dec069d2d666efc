//! Metrics that evaluate an edge from its neighbourhood. They are values of one type, so that the engine is
//! compiled once for all of them; each is a constant in a file of its own.

use glam::Vec3;
use wide::f32x4;

use super::{CostSource, Dimension, EdgeNeighbourhood, Form, Memoryless, Metric, PartSize};
use crate::cost::tensor::Tensor;

/// Weight of squared areas at borders against squared volumes, times the squared length of the edge:
/// volumes are a sixth of n·y, areas half of e × y, and the weights of both are a half.
pub(super) const BORDER_AREA_WEIGHT: f64 = 9.0;

/// A metric that evaluates an edge from its neighbourhood. (The formula is called for each edge that its
/// lower bound does not rule out, and takes hundreds of instructions.)
#[derive(Clone, Copy, Debug)]
pub(crate) struct NeighbourhoodMetric {
    /// With [`CostSource::FormThenStars`], the form is the same as of [`Memoryless`], but with planes
    /// weighted by their squared areas.
    pub(super) cost_source: CostSource,
    /// See [`Metric::evaluate`].
    pub(super) evaluate: fn(&EdgeNeighbourhood, f32) -> Option<(f32, Vec3)>,
    /// See [`Metric::cost_factor_exponent`].
    pub(super) cost_factor_exponent: f32,
    /// See [`Metric::squared_rms_factor`].
    pub(super) squared_rms_factor: f64,
    /// See [`Metric::dimension`].
    pub(super) dimension: Dimension,
    /// See [`Metric::part_cost_per_face_pair`].
    pub(super) part_cost_per_face_pair: fn(f32, &PartSize, f32) -> f32,
}

impl Metric for NeighbourhoodMetric {
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
        matches!(self.cost_source, CostSource::FormThenStars)
    }
    #[inline(always)]
    fn cost_source(&self) -> CostSource {
        self.cost_source
    }
    #[inline(always)]
    fn form(&self, kept: &Tensor, removed: &Tensor, d: Vec3) -> Form {
        if self.is_memoryless() { Memoryless.form(kept, removed, d) } else { Form::default() }
    }
    #[inline(always)]
    fn merged(&self, form: &Form, _: Vec3) -> Tensor {
        form.a
    }
    #[inline(always)]
    fn plane_weight(&self, _: f32, mean: f32) -> f32 {
        1.0 / mean
    }
    #[inline(always)]
    fn plane_weights(&self, _: f32x4, mean: f32) -> f32x4 {
        f32x4::splat(1.0 / mean)
    }
    /// Returns the tensor of a feature edge, as if the collapsed edge were as long as this one.
    #[inline(always)]
    fn line(&self, edge: Vec3, weight: f32, mean: f32) -> Tensor {
        Tensor::line(edge, weight * BORDER_AREA_WEIGHT as f32 * 0.1 * edge.length_squared() / mean)
    }
    #[inline(always)]
    fn evaluate(&self, around: &EdgeNeighbourhood, mean: f32) -> Option<(f32, Vec3)> {
        (self.evaluate)(around, mean)
    }

    fn cost_factor_exponent(&self) -> f32 {
        self.cost_factor_exponent
    }
    fn squared_rms_factor(&self) -> f64 {
        self.squared_rms_factor
    }
    fn dimension(&self) -> Dimension {
        self.dimension
    }
    fn part_cost_per_face_pair(&self, rate: f32, part: &PartSize, mean: f32) -> f32 {
        (self.part_cost_per_face_pair)(rate, part, mean)
    }
}
