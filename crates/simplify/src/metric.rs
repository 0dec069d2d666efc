//! Cost and placement together: one quadratic form answers both.

mod memoryless;
mod quadric;

use glam::Vec3;

pub(crate) use memoryless::Memoryless;
pub(crate) use quadric::Quadric;

use crate::tensor::Tensor;

/// The quadratic form of an edge, about its kept end: y·A·y − 2 h·y + c at the kept position + y.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Form {
    pub(crate) a: Tensor,
    pub(crate) h: Vec3,
    pub(crate) c: f32,
}

/// How the loss of a collapse is judged.
pub(crate) trait Metric {
    /// What a vertex carries, relative to its own position.
    type Memory: Copy + Default;
    /// Whether only the present surface counts: then the exact cost is taken from the star at the commit, and the
    /// vertices around swap old planes for new ones.
    const MEMORYLESS: bool;

    /// The tensor within.
    fn tensor(memory: &mut Self::Memory) -> &mut Tensor;
    /// The form of an edge: `d` leads from the kept to the removed end.
    fn form(kept: &Self::Memory, removed: &Self::Memory, d: Vec3) -> Form;
    /// What the merged vertex carries at the kept position + `y`, where it is not made from its star.
    fn merged(form: &Form, y: Vec3) -> Self::Memory;
}
