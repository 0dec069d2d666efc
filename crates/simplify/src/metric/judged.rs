//! Metrics that evaluate an edge from its neighbourhood. One type, so that the engine is compiled once for
//! all of them.

use glam::Vec3;
use wide::f32x4;

use super::{
    CostSource, Dimension, EdgeNeighbourhood, Form, Memoryless, Metric, PartSize, edge_length,
    lindstrom_turk, melax,
};
use crate::tensor::Tensor;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NeighbourhoodMetric {
    /// [Lindstrom-Turk 1998]
    Volume,
    /// [Melax 1998]
    Turn,
    /// The shortest edge first.
    Length,
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
        *self == Self::Volume
    }
    #[inline(always)]
    fn cost_source(&self) -> CostSource {
        match self {
            Self::Volume => CostSource::FormThenStars,
            Self::Turn => CostSource::Stars,
            Self::Length => CostSource::Ends,
        }
    }
    #[inline(always)]
    fn form(&self, kept: &Tensor, removed: &Tensor, d: Vec3) -> Form {
        match self {
            Self::Volume => Memoryless.form(kept, removed, d),
            Self::Turn | Self::Length => Form::default(),
        }
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
    #[inline(always)]
    fn line(&self, edge: Vec3, weight: f32, mean: f32) -> Tensor {
        lindstrom_turk::line(edge, weight, mean)
    }
    #[inline(never)]
    fn evaluate(&self, around: &EdgeNeighbourhood, mean: f32) -> Option<(f32, Vec3)> {
        match self {
            Self::Volume => Some(lindstrom_turk::evaluate(around, mean)),
            Self::Turn => melax::evaluate(around),
            Self::Length => Some(edge_length::evaluate(around)),
        }
    }

    fn cost_factor_exponent(&self) -> f32 {
        match self {
            // One area more than the memoryless tensors have.
            Self::Volume => 1.4,
            // On a smooth surface the cost falls as the density of triangles to the power 1.5, on a rough
            // one 0.5.
            Self::Turn => 0.4,
            // Squared lengths fall as the density of triangles rises.
            Self::Length => 0.4,
        }
    }
    fn squared_rms_factor(&self) -> f64 {
        match self {
            // (0.32 to 0.49: positions between the removed faces halve the distances.)
            Self::Volume => 0.42,
            Self::Turn => 1.0,
            // (0.7 to 3.4, larger at fewer faces.)
            Self::Length => 1.6,
        }
    }
    fn dimension(&self) -> Dimension {
        match self {
            // Squared volumes, divided by an area.
            Self::Volume => Dimension { length: 6, face: 1 },
            Self::Turn => Dimension { length: 1, face: 0 },
            Self::Length => Dimension { length: 2, face: 0 },
        }
    }
    fn part_cost_per_face_pair(&self, rate: f32, part: &PartSize, mean: f32) -> f32 {
        match self {
            Self::Volume => rate * part.face / mean,
            // Like the collapse of an edge as long as the part itself, between faces at right angles.
            Self::Turn => 0.5 * part.cost_factor * part.size_sq.sqrt(),
            // Like edges as long as the part itself.
            Self::Length => part.cost_factor * part.size_sq,
        }
    }
}
