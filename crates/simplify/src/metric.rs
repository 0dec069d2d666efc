//! Cost and placement together: one quadratic form answers both, or a metric that looks at the stars of both ends.

mod edge_length;
mod judged;
mod lindstrom_turk;
mod melax;
mod memoryless;
mod quadric;

use glam::{DVec3, Vec3};
use wide::f32x4;

pub(crate) use judged::Judged;
pub(crate) use memoryless::Memoryless;
pub(crate) use quadric::Quadric;

use crate::tensor::Tensor;

/// Cost of length, a share of area · length²: decides among flat collapses only. (docs/decisions/0003)
pub(crate) const TIE: f32 = 1e-11;

/// The quadratic form of an edge, about its kept end: y·A·y − 2 h·y + c at the kept position + y.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Form {
    pub(crate) a: Tensor,
    pub(crate) h: Vec3,
    pub(crate) c: f32,
}

/// Who says what an edge costs and where its vertex goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CostSource {
    /// The form, and the engine at the commit: the exact cost of the star, its largest distance, attributes.
    Engine,
    /// The form alone.
    Form,
    /// The form says which edges are worth a look; [`Metric::judge`] has the last word.
    FormThenStars,
    /// [`Metric::judge`], from the stars.
    Stars,
    /// [`Metric::judge`], from the ends alone.
    Ends,
}

impl CostSource {
    /// Whether [`Metric::judge`] has the last word. Then what it says is the cost, and nothing is added to it.
    pub(crate) const fn is_metric(self) -> bool {
        matches!(self, Self::FormThenStars | Self::Stars | Self::Ends)
    }
}

/// What a vertex carries for the cost.
pub(crate) trait VertexMemory: Copy + Default {}
impl<T: Copy + Default> VertexMemory for T {}

/// What costs are made of: a power of a length, times a power of the doubled area of a face of the input on average.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Dimension {
    pub(crate) length: i32,
    pub(crate) face: i32,
}

impl Dimension {
    /// What a cost of one comes to among several meshes, for one whose unit frame is `size` units of theirs wide and whose
    /// faces have twice the area `mean` in it on average.
    pub(crate) fn of(self, size: f64, mean: f64) -> f64 {
        size.powi(self.length) * mean.powi(self.face)
    }
}

/// How the loss of a collapse is judged. The engine is built once for each type that says it.
pub(crate) trait Metric: Copy {
    /// What a vertex carries, relative to its own position.
    type Memory: VertexMemory;

    /// The tensor within.
    fn tensor_of(memory: &Self::Memory) -> &Tensor;
    /// The tensor within, to be changed.
    fn tensor(memory: &mut Self::Memory) -> &mut Tensor;

    /// Whether the tensor is that of the present star: then the vertices around swap old planes for new ones.
    fn is_memoryless(&self) -> bool;
    /// Who decides.
    fn cost_source(&self) -> CostSource;
    /// The form of an edge: `d` leads from the kept to the removed end.
    fn form(&self, kept: &Self::Memory, removed: &Self::Memory, d: Vec3) -> Form;
    /// What the merged vertex carries at the kept position + `y`, where it is not made from its star.
    fn merged(&self, form: &Form, y: Vec3) -> Self::Memory;

    /// What n nᵀ of a triangle counts in the tensor, with its normal n of `length` twice its area; `mean` is that length
    /// on average over the input.
    #[inline(always)]
    fn plane_weight(&self, length: f32, mean: f32) -> f32 {
        let _ = mean;
        1.0 / length.max(1e-30)
    }
    /// The same, four side by side.
    #[inline(always)]
    fn plane_weights(&self, lengths: f32x4, mean: f32) -> f32x4 {
        let _ = mean;
        f32x4::ONE / lengths.fast_max(f32x4::splat(1e-30))
    }
    /// The tensor of a feature edge.
    #[inline(always)]
    fn line(&self, edge: Vec3, weight: f32, mean: f32) -> Tensor {
        let _ = mean;
        Tensor::line(edge, weight)
    }
    /// Cost of a collapse and the step from the kept end to the merged vertex; `None` if it may not be. Only asked where
    /// [`Self::cost_source`] says so.
    fn judge(&self, around: &EdgeNeighbourhood, mean: f32) -> Option<(f32, Vec3)> {
        let _ = (around, mean);
        None
    }
    /// Costs go with this power of what they would be for [`Memoryless`], as a place of the same shape gets more
    /// triangles: prices are taken to it.
    fn price_power(&self) -> f32 {
        1.0
    }
    /// The squared RMS distance of a result over what the distances to planes, as they were at each collapse, amount to.
    /// (Measured on fandisk, bunny, nefertiti and horse at 50, 10 and 1 %, where [`Memoryless`] has it from its fit.)
    fn kept_loss(&self) -> f64 {
        1.0
    }
    /// Of costs: an area times a squared distance, unless said otherwise.
    fn dimension(&self) -> Dimension {
        Dimension { length: 4, face: 0 }
    }
    /// What two faces of a part cost that goes as a whole; `rate` is what that is for [`Memoryless`].
    fn part_rate(&self, rate: f32, part: &PartSize, mean: f32) -> f32 {
        let _ = (part, mean);
        rate
    }
}

/// A part that may go as a whole.
pub(crate) struct PartSize {
    /// What its absence counts times.
    pub(crate) price: f32,
    /// Twice the area of a face, on average.
    pub(crate) face: f32,
    /// Square of the diagonal of its box.
    pub(crate) size_sq: f32,
}

/// Where the merged vertex may go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum AllowedPlace {
    #[default]
    Anywhere,
    Middle,
    Ends,
    Kept,
    Removed,
}

/// The end of an edge that something hangs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EdgePart {
    Kept,
    Removed,
    /// On the edge itself; seen from the kept end.
    Both,
}

/// A triangle at an edge: its corners after the end that it hangs on, in order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StarTriangle {
    pub(crate) at: EdgePart,
    pub(crate) a: DVec3,
    pub(crate) b: DVec3,
}

/// A feature edge (border, non-manifold curve, seam) from an end of an edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeatureLine {
    pub(crate) at: EdgePart,
    /// Its other end.
    pub(crate) to: DVec3,
    /// What it counts; a border 1, unless the options say otherwise.
    pub(crate) weight: f64,
    /// 1 where its only face has it in the direction from the end, -1 where the other way round, 0 where it has not one
    /// face.
    pub(crate) sense: f64,
}

/// An edge and what hangs on it. The kept end is the origin. A metric that judges by ends alone is given no walls, and of
/// the lines only the edge itself.
#[derive(Clone, Debug, Default)]
pub(crate) struct EdgeNeighbourhood {
    /// The removed end.
    pub(crate) d: DVec3,
    pub(crate) place: AllowedPlace,
    pub(crate) triangles: Vec<StarTriangle>,
    pub(crate) lines: Vec<FeatureLine>,
    /// Whether the kept and the removed end lie on feature edges.
    pub(crate) on_lines: [bool; 2],
}

impl EdgeNeighbourhood {
    /// Where an end lies.
    pub(crate) fn end(&self, at: EdgePart) -> DVec3 {
        if at == EdgePart::Removed { self.d } else { DVec3::ZERO }
    }
    /// Whether the edge itself is a feature edge.
    pub(crate) fn is_line(&self) -> bool {
        self.lines.iter().any(|l| l.at == EdgePart::Both)
    }
}
