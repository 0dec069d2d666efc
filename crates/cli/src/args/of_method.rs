//! What only some methods know.

use clap::Args;
use lodsmith::MethodOptions;

use super::{TypedLength, values};

#[derive(Args, Debug)]
#[command(next_help_heading = "Of single methods")]
pub(super) struct OfMethod {
    /// memoryless, quadric: contract vertices closer than this too where no edge joins them, so that parts grow together
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    pairs: Option<TypedLength>,
    /// cluster: edge of a cell
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    cell: Option<TypedLength>,
    /// cluster: only to a multiple of the target, and on with memoryless
    #[arg(long)]
    two_stage: bool,
    /// shortest-edge: edges up to this length go; remesh: length of the new edges
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    edge_length: Option<TypedLength>,
    /// planar: largest angle between a face and the plane of its region [default: 5]; vertex-removal, remesh: edges bent
    /// by more are creases
    #[arg(long, value_name = "DEG", value_parser = values::angle_deg)]
    angle: Option<f64>,
    /// planar: largest distance from the plane of a region [default: 0.00002%, or --error]
    #[arg(long, value_name = "D")]
    flat: Option<TypedLength>,
    /// unsubdivide: levels to undo, at most; remesh: rounds
    #[arg(long, value_name = "N", value_parser = values::count)]
    iterations: Option<usize>,
    /// remesh: edge of a voxel, for a closed surface around the input, whatever state it is in
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    voxel: Option<TypedLength>,
    /// remesh: a base mesh, subdivided so many times
    #[arg(long, value_name = "N", value_parser = values::count)]
    subdivisions: Option<usize>,
    /// remesh: short edges where the surface is curved
    #[arg(long)]
    adaptive: bool,
}

impl OfMethod {
    /// What the library is told.
    pub(super) fn options(&self) -> MethodOptions {
        let length = |d: &Option<TypedLength>| d.as_ref().map(|d| d.length);
        let mut own = MethodOptions::default();
        own.pairs = length(&self.pairs);
        own.cell = length(&self.cell);
        own.two_stage = self.two_stage;
        own.edge_length = length(&self.edge_length);
        own.angle_deg = self.angle;
        own.flat = length(&self.flat);
        own.iterations = self.iterations;
        own.voxel = length(&self.voxel);
        own.subdivisions = self.subdivisions;
        own.adaptive = self.adaptive;
        own
    }
}
