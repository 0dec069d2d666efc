//! Arguments of `lodsmith lod`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use lodsmith_asset::{Sink, Source};

use super::table::{OfLod, Options, Printing};

const AFTER: &str = "\
Levels are written together with the original, which is level 0 and is not changed. Levels by counts come from one \
run, and each is fitted separately; levels by errors, and levels of methods that do not collapse edges, are made one \
by one.

Each level is measured against the original in both directions. lods.json in the folder has the distance from which on \
the largest deviation of a level covers at most --pixels, on a screen of --height pixels with a vertical field of view \
of --fov degrees: error * height / (2 * tan(fov / 2) * pixels).

Names:
  plain   NAME_lod0.glb, NAME_lod1.glb and so on; meshes and nodes of a single file are NAME, NAME_lod1
  unity   NAME_LOD0, NAME_LOD1: Unity makes a LOD group of meshes with such names
  unreal, godot: as unity; assign the levels by hand, or by a script that reads lods.json

Examples:
  lodsmith lod bunny.obj -o bunny.glb --levels 0.5,0.25,0.1
  lodsmith lod tower.glb -O levels --count 4 --factor 0.4 --naming unity
  lodsmith lod statue.ply -O levels --errors 0.05%,0.2%,1% --geomorph
  lodsmith lod hero.glb -o out.glb --levels 0.5,0.2,0.05 --bake normal,color --texture-size 2048";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
#[command(group(ArgGroup::new("made").args(["levels", "faces", "count", "errors"]).required(true)))]
pub(crate) struct LodArgs {
    /// File to read; `-` is standard input
    #[arg(value_name = "IN")]
    pub(super) input: Source,
    /// GLB or glTF file to write, with all levels (extension MSFT_lod); `-` is standard output
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
