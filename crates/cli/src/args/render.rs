//! Arguments of `lodsmith render`.

use std::path::PathBuf;

use clap::Args;
use lodsmith_asset::{Sink, Source};

use super::table::{Loudness, OfRender, Options};

const AFTER: &str = "\
Shadings:
  smooth         one colour, normals blended: the file's own, or those of the shape
  flat           one colour, one normal for each face
  textured       materials with their images
  vertex-colors  colours of vertices
  normals        normals as colours
  matcap         a picture of a lit ball, looked up by the normal
  heat           distance from the reference, with --compare or --levels

Backgrounds: transparent; #rrggbb; #rrggbb,#rrggbb from top to bottom; gradient, the default;
surroundings, the environment (--environment); blurred, the same out of focus.
Lights, in radii of the model from its centre, x to the right, y up, z towards the eye:
  sun:X,Y,Z    from that direction
  point:X,Y,Z  from that place to all sides
  spot:X,Y,Z   from that place to the centre
  each with =STRENGTH behind it, if not 1; they take the place of the usual two.

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
    /// Picture to write: .png, .jpg or .webp; `-` is standard output, as PNG
    #[arg(short, long, value_name = "OUT", required_unless_present = "out_dir", conflicts_with = "out_dir")]
    pub(crate) output: Option<Sink>,
    #[command(flatten)]
    pub(crate) options: Options<OfRender>,
    /// Folder for the pictures; created if missing
    #[arg(short = 'O', long, value_name = "DIR", requires = "turntable", help_heading = "Turntable")]
    pub(crate) out_dir: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long, help_heading = "Run", display_order = 0)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) loudness: Loudness,
}
