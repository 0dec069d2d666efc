//! Metrics: cost and placement of a collapse, from one quadratic form or from the stars of both ends.
//!
//! # Adding a metric
//!
//! A metric is a file here and a row in the table of [`with_metric`]:
//!
//! - A metric that evaluates the neighbourhood of an edge is a [`NeighbourhoodMetric`]: a constant with its
//!   formula. `edge_length.rs` is the smallest.
//! - A metric that is a quadratic form is a type of its own that implements [`Metric`], as in
//!   `memoryless.rs`. The engine is compiled once more for it.
//!
//! Its method is a value of [`Method`](crate::Method), whose options are checked by the lists in
//! `options/shared.rs`.

mod edge_length;
mod lindstrom_turk;
mod melax;
mod memoryless;
mod neighbourhood;
mod quadric;

use glam::{DVec3, Vec3};
use wide::f32x4;

pub(crate) use edge_length::EDGE_LENGTH;
pub(crate) use lindstrom_turk::LINDSTROM_TURK;
pub(crate) use melax::MELAX;
pub(crate) use memoryless::Memoryless;
pub(crate) use neighbourhood::NeighbourhoodMetric;
pub(crate) use quadric::Quadric;

use crate::cost::tensor::Tensor;

/// `with_metric!(method, METRIC => code)`: runs code with the metric of a method as the constant `METRIC`;
/// `None` if the method has no metric. The code is compiled for each metric.
macro_rules! with_metric {
    ($method:expr, $name:ident => $code:expr) => {
        $crate::cost::metric::with_metric!(@rows $method, $name, $code;
            Memoryless: Memoryless = Memoryless,
            Quadric: Quadric = Quadric,
            LindstromTurk: NeighbourhoodMetric = LINDSTROM_TURK,
            Melax: NeighbourhoodMetric = MELAX,
            ShortestEdge: NeighbourhoodMetric = EDGE_LENGTH,
        )
    };
    (@rows $method:expr, $name:ident, $code:expr; $($of:ident: $type:ident = $metric:ident,)+) => {
        match $method {
            $($crate::options::MethodKind::$of => {
                const $name: $crate::cost::metric::$type = $crate::cost::metric::$metric;
                Some($code)
            })+
            _ => None,
        }
    };
}
pub(crate) use with_metric;

/// The quadratic form of an edge, relative to its kept end: y·A·y − 2 h·y + c at the kept position + y.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Form {
    pub(crate) a: Tensor,
    pub(crate) h: Vec3,
    pub(crate) c: f32,
}

/// Source of the cost of an edge and of the placement of its vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CostSource {
    /// The form, and the engine at the commit: exact cost of the star, largest distance, attributes.
    Engine,
    /// Only the form.
    Form,
    /// The form selects the edges to evaluate; [`Metric::evaluate`] decides.
    FormThenStars,
    /// [`Metric::evaluate`], from the stars.
    Stars,
    /// [`Metric::evaluate`], only from the ends.
    Ends,
}

impl CostSource {
    /// True if [`Metric::evaluate`] decides. Then its result is the cost, and nothing is added to it.
    pub(crate) const fn is_decided_by_metric(self) -> bool {
        matches!(self, Self::FormThenStars | Self::Stars | Self::Ends)
    }
}

/// Data that a vertex carries for the cost.
pub(crate) trait VertexMemory: Copy + Default + Send + Sync {}
impl<T: Copy + Default + Send + Sync> VertexMemory for T {}

/// Dimension of a cost: a power of a length, times a power of the mean doubled area of a face of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Dimension {
    pub(crate) length: i32,
    pub(crate) face: i32,
}

impl Dimension {
    /// Returns the factor that converts costs of one of several meshes to a common scale: the unit frame of
    /// the mesh is `size` common units wide, and `mean` is the mean doubled area of its faces in that frame.
    pub(crate) fn of(self, size: f64, mean: f64) -> f64 {
        size.powi(self.length) * mean.powi(self.face)
    }
}

/// Cost metric of collapses. The engine is compiled once for each type that implements it.
pub(crate) trait Metric: Copy + Send + Sync {
    /// Data that a vertex carries, relative to its own position.
    type Memory: VertexMemory;

    /// Returns the tensor of the memory.
    fn tensor_of(memory: &Self::Memory) -> &Tensor;
    /// Returns the tensor of the memory, mutable.
    fn tensor(memory: &mut Self::Memory) -> &mut Tensor;

    /// True if the tensor belongs to the current star: then a collapse replaces old planes by new ones at the
    /// vertices around it.
    fn is_memoryless(&self) -> bool;
    /// Returns the source of cost and placement.
    fn cost_source(&self) -> CostSource;
    /// Returns the form of an edge: `d` leads from the kept to the removed end.
    fn form(&self, kept: &Self::Memory, removed: &Self::Memory, d: Vec3) -> Form;
    /// Returns the memory of the merged vertex at the kept position + `y`, if it is not computed from its
    /// star.
    fn merged(&self, form: &Form, y: Vec3) -> Self::Memory;

    /// Returns the weight of n nᵀ of a triangle in the tensor, for its normal n of `length` twice its area;
    /// `mean` is the mean of that length over the input.
    #[inline(always)]
    fn plane_weight(&self, length: f32, mean: f32) -> f32 {
        let _ = mean;
        1.0 / length.max(1e-30)
    }
    /// Returns [`Self::plane_weight`] of four triangles side by side.
    #[inline(always)]
    fn plane_weights(&self, lengths: f32x4, mean: f32) -> f32x4 {
        let _ = mean;
        f32x4::ONE / lengths.fast_max(f32x4::splat(1e-30))
    }
    /// Returns the tensor of a feature edge.
    #[inline(always)]
    fn line(&self, edge: Vec3, weight: f32, mean: f32) -> Tensor {
        let _ = mean;
        Tensor::line(edge, weight)
    }
    /// Returns the cost of a collapse and the displacement from the kept end to the merged vertex; `None`
    /// if it is not allowed. Only called if [`Self::cost_source`] says so.
    fn evaluate(&self, around: &EdgeNeighbourhood, mean: f32) -> Option<(f32, Vec3)> {
        let _ = (around, mean);
        None
    }
    /// Returns the exponent that relates costs to the costs of [`Memoryless`] as the density of triangles
    /// changes at a place of the same shape: weights are raised to it.
    fn cost_factor_exponent(&self) -> f32 {
        1.0
    }
    /// Returns the squared RMS distance of a result divided by the sum of squared distances to planes at
    /// each collapse. (Measured on fandisk, bunny, nefertiti and horse at 50, 10 and 1 %, where
    /// [`Memoryless`] takes it from the fit.)
    fn squared_rms_factor(&self) -> f64 {
        1.0
    }
    /// Returns the dimension of costs: an area times a squared distance by default.
    fn dimension(&self) -> Dimension {
        Dimension { length: 4, face: 0 }
    }
    /// Returns the cost per two faces of a part that is removed as a whole; `rate` is this cost with
    /// [`Memoryless`].
    fn part_cost_per_face_pair(&self, rate: f32, part: &PartSize, mean: f32) -> f32 {
        let _ = (part, mean);
        rate
    }
}

/// Size of a part that may be removed as a whole.
pub(crate) struct PartSize {
    /// Weight of its absence.
    pub(crate) cost_factor: f32,
    /// Twice the mean area of a face.
    pub(crate) face: f32,
    /// Square of the diagonal of its bounding box.
    pub(crate) size_sq: f32,
}

/// Allowed positions of the merged vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum AllowedPlace {
    #[default]
    Anywhere,
    Middle,
    Ends,
    Kept,
    Removed,
}

/// The end of an edge that a triangle or line belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EdgePart {
    Kept,
    Removed,
    /// The edge itself; relative to the kept end.
    Both,
}

/// A triangle at an edge: its other two corners, in order, after the end that it belongs to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StarTriangle {
    pub(crate) at: EdgePart,
    pub(crate) a: DVec3,
    pub(crate) b: DVec3,
}

/// A feature edge (border, non-manifold curve, seam) that starts at an end of an edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeatureLine {
    pub(crate) at: EdgePart,
    /// Its other end.
    pub(crate) to: DVec3,
    /// Its weight; 1 for a border, unless the options set another weight.
    pub(crate) weight: f64,
    /// 1 if its only face runs along it in the direction from the end, -1 if in the other direction, 0 unless
    /// it has exactly one face.
    pub(crate) sense: f64,
}

/// An edge with the triangles and feature edges around it. The kept end is the origin. For a metric that
/// uses only the ends there are no triangles, and the only line is the edge itself.
#[derive(Clone, Debug, Default)]
pub(crate) struct EdgeNeighbourhood {
    /// The removed end.
    pub(crate) d: DVec3,
    pub(crate) place: AllowedPlace,
    pub(crate) triangles: Vec<StarTriangle>,
    pub(crate) lines: Vec<FeatureLine>,
    /// Whether the kept end and the removed end lie on feature edges.
    pub(crate) on_lines: [bool; 2],
}

impl EdgeNeighbourhood {
    /// Returns the position of an end.
    pub(crate) fn end(&self, at: EdgePart) -> DVec3 {
        if at == EdgePart::Removed { self.d } else { DVec3::ZERO }
    }
    /// True if the edge itself is a feature edge.
    pub(crate) fn is_line(&self) -> bool {
        self.lines.iter().any(|l| l.at == EdgePart::Both)
    }
}
