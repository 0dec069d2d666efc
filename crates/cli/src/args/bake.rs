//! Arguments of `lodsmith bake`.

use clap::Args;
use lodsmith_asset::{Sink, Source};

use super::table::{OfBake, Options, Printing};

const AFTER: &str = "\
Maps:
  normal              normals in the tangent frame of LOW (MikkTSpace)
  color               base colour and opacity: textures, factors and vertex colours of HIGH
  metallic-roughness  roughness in green, metallic in blue
  emissive            emitted light
  ao                  ambient occlusion by rays
  vertex-color        vertex colours of HIGH alone
  height              distance of HIGH from LOW, 16 bits
  object-normal       normals in coordinates of the mesh
  curvature           mean curvature of HIGH

The first five maps become part of the materials of GLB, glTF and OBJ. The others are written to files beside OUT: \
OUT_height.png and so on. With --map-files, every map is.

Examples:
  lodsmith bake statue.ply statue_low.obj -o statue.glb --maps normal,ao
  lodsmith bake high.glb low.glb -o baked.glb --maps normal,color --texture-size 2048";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
pub(crate) struct BakeArgs {
    /// High-poly model
    #[arg(value_name = "HIGH")]
    pub(super) high: Source,
    /// Low-poly model, at the same position
    #[arg(value_name = "LOW")]
    pub(super) low: Source,
    /// Output; `-` is standard output
    #[arg(short, long, value_name = "OUT")]
    pub(super) output: Sink,
    #[command(flatten)]
    pub(super) options: Options<OfBake>,
    #[command(flatten)]
    pub(super) printing: Printing,
}
