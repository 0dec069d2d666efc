//! Arguments that only some methods have.

use clap::Args;
use lodsmith::MethodOptions;

use super::{TypedLength, values};

#[derive(Args, Debug)]
#[command(next_help_heading = "Of single methods")]
pub(super) struct OfMethod {
    /// memoryless, quadric: also merge vertices closer than D that share no edge, so that parts can grow together
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    pairs: Option<TypedLength>,
    /// cluster: size of a cell
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    cell: Option<TypedLength>,
    /// cluster: cluster to a multiple of the target first, then continue with memoryless
    #[arg(long)]
    two_stage: bool,
    /// shortest-edge: collapse edges up to this length; remesh: length of the new edges
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    edge_length: Option<TypedLength>,
    /// planar: largest angle between a face and the plane of its region [default: 5]; vertex-removal, remesh: edges bent
    /// by more are creases
    #[arg(long, value_name = "DEG", value_parser = values::angle_deg)]
    angle: Option<f64>,
    /// planar: largest distance from the plane of a region [default: 0.00002%, or --error]
    #[arg(long, value_name = "D")]
    flat: Option<TypedLength>,
    /// unsubdivide: maximum number of levels to undo; remesh: number of rounds
    #[arg(long, value_name = "N", value_parser = values::count)]
    iterations: Option<usize>,
    /// remesh: size of a voxel; makes a closed surface around any input
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    voxel: Option<TypedLength>,
    /// remesh: subdivide a base mesh N times
    #[arg(long, value_name = "N", value_parser = values::count)]
    subdivisions: Option<usize>,
    /// remesh: use shorter edges where the surface is curved
    #[arg(long)]
    adaptive: bool,
}

impl OfMethod {
    /// Converts the arguments to options of the library.
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
