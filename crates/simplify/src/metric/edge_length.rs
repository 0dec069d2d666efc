//! The shortest edge first.

use glam::{DVec3, Vec3};

use super::{Around, Form, Judge, Metric, PartSize, Place};
use crate::tensor::Tensor;

#[derive(Clone)]
pub(crate) struct EdgeLength;

impl Metric for EdgeLength {
    type Memory = Tensor;
    const MEMORYLESS: bool = false;
    const JUDGE: Judge = Judge::Ends;
    /// Squared lengths fall as the density of triangles rises.
    const PRICE_POWER: f32 = 0.4;
    /// (0.7 to 3.4, more at fewer faces.)
    const KEPT_LOSS: f64 = 1.6;

    fn tensor_of(memory: &Tensor) -> &Tensor {
        memory
    }
    fn tensor(memory: &mut Tensor) -> &mut Tensor {
        memory
    }
    fn form(_: &Tensor, _: &Tensor, _: Vec3) -> Form {
        Form::default()
    }
    fn merged(_: &Form, _: Vec3) -> Tensor {
        Tensor::default()
    }

    /// The squared length. A vertex off the feature edges goes onto one that lies on them, not halfway.
    fn judge(around: &Around, _: f32) -> Option<(f32, Vec3)> {
        let d = around.d;
        let onto_line = match around.on_lines {
            [true, false] => Some(DVec3::ZERO),
            [false, true] => Some(d),
            _ => None,
        };
        let step = match around.place {
            Place::Kept => DVec3::ZERO,
            Place::Removed => d,
            Place::Ends => onto_line.unwrap_or(DVec3::ZERO),
            Place::Middle | Place::Anywhere => onto_line.unwrap_or(d * 0.5),
        };
        Some((d.length_squared() as f32, step.as_vec3()))
    }

    /// Squared lengths.
    fn common_cost(size: f64, _: f64) -> f64 {
        size * size
    }
    /// A part goes when edges as long as itself would.
    fn part_rate(_: f32, part: &PartSize, _: f32) -> f32 {
        part.price * part.size_sq
    }
}
