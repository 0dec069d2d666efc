//! Arguments of `lodsmith render`.

use std::path::PathBuf;

use clap::Args;
use lodsmith_asset::{Sink, Source};

use super::table::{Loudness, OfRender, Options};

const AFTER: &str = "\
Shadings:
  smooth         one colour, interpolated normals: from the file, or else computed from the shape
  flat           one colour, one normal for each face
  textured       materials with their images
  vertex-colors  vertex colours
  normals        normals as colours
  matcap         an image of a lit sphere, looked up by the normal
  heat           distance from the reference, with --compare or --levels

Backgrounds: transparent; #rrggbb; #rrggbb,#rrggbb from top to bottom; gradient (the default);
surroundings, the image of --environment; blurred, that image blurred.
Lights, in camera axes (x right, y up, z towards the camera) from the centre of the model, in units of its radius:
  sun:X,Y,Z    parallel light from this direction
  point:X,Y,Z  from this position in all directions
  spot:X,Y,Z   from this position towards the centre
  Append =STRENGTH if it is not 1. Lights given here replace the two default lights.

Examples:
  lodsmith render bunny.obj -o bunny.png
  lodsmith render part.stl -o part.png --up z --shading flat --wireframe --view front
  lodsmith render low.glb -o error.png --compare full.glb --shading heat
  lodsmith render fox.glb fox_low.glb -o walk.png --clip Walk --time 0.4
  lodsmith render bunny.obj -o turn.png --turntable 60 --background transparent
  lodsmith render scan.ply -o sheet.png --levels 5000,2500,1500,750,300,100 --wireframe";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
pub(crate) struct RenderArgs {
    /// Files to render, side by side if several; `-` is standard input
    #[arg(value_name = "IN", required = true)]
    pub(crate) inputs: Vec<Source>,
    /// Image to write (.png, .jpg, .webp); `-` is standard output, as PNG
    #[arg(short, long, value_name = "OUT", required_unless_present = "out_dir", conflicts_with = "out_dir")]
    pub(crate) output: Option<Sink>,
    #[command(flatten)]
    pub(crate) options: Options<OfRender>,
    /// Folder for the images; created if missing
    #[arg(short = 'O', long, value_name = "DIR", requires = "turntable", help_heading = "Turntable")]
    pub(crate) out_dir: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long, help_heading = "Run", display_order = 0)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) loudness: Loudness,
}
