//! Arguments of `lodsmith lod`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use lodsmith_asset::{Sink, Source};

use super::table::{OfLod, Options, Printing};

const AFTER: &str = "\
Levels stand beside the original, which is level 0 and stays as it is. Levels by counts come out of one run, each \
fitted by itself; levels by errors, and those of methods that do not collapse edges, are made one by one.

Each level is measured against the original, both ways. lods.json in the folder says from which distance on its largest \
deviation is no higher than --pixels, on a screen of --height pixels with a vertical field of view of --fov degrees: \
error * height / (2 * tan(fov / 2) * pixels).

Names:
  plain   NAME_lod0.glb, NAME_lod1.glb and so on; meshes and nodes of a single file NAME, NAME_lod1
  unity   NAME_LOD0, NAME_LOD1: Unity makes a LOD group of meshes with such names
  unreal, godot: the same; there the levels are assigned by hand, or by script from lods.json

Examples:
  lodsmith lod bunny.obj -o bunny.glb --levels 0.5,0.25,0.1
  lodsmith lod tower.glb -O levels --count 4 --factor 0.4 --naming unity
  lodsmith lod statue.ply -O levels --errors 0.05%,0.2%,1% --geomorph
  lodsmith lod hero.glb -o out.glb --levels 0.5,0.2,0.05 --bake normal,color --texture-size 2048";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
#[command(group(ArgGroup::new("made").args(["levels", "faces", "count", "errors"]).required(true)))]
pub(crate) struct LodArgs {
    /// File to make levels of; `-` is standard input
    #[arg(value_name = "IN")]
    pub(super) input: Source,
    /// Write all levels to one GLB or glTF file (extension MSFT_lod); `-` is standard output
    #[arg(short, long, value_name = "OUT", conflicts_with = "out_dir",
          required_unless_present_any = ["out_dir", "dry-run"])]
    pub(super) output: Option<Sink>,
    /// Folder for one file per level, and lods.json; created if missing
    #[arg(short = 'O', long, value_name = "DIR")]
    pub(super) out_dir: Option<PathBuf>,
    #[command(flatten)]
    pub(super) options: Options<OfLod>,
    #[command(flatten)]
    pub(super) printing: Printing,
}
