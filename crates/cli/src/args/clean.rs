//! Arguments of `lodsmith clean`.

use clap::{ArgGroup, Args};

use super::batch_files::BatchFiles;
use super::table::{OfClean, Options, Printing};

const AFTER: &str = "\
Steps, in this order; each is counted in the report:
  weld          vertices at one place, or closer than --weld, become one; seams of attributes stay
  drop          faces that are not finite, name a place twice, or stand there already
  sheets        with --sheets single, of faces back to back one side goes, and materials are drawn from both sides
  prune         parts smaller than --prune
  orient        neighbours agree, closed parts look outward (one inside another keeps its side: it may be a cavity)
  zero area     faces without area go where that opens nothing
  non-manifold  by --non-manifold
  unused        vertices without a face go

Non-manifold:
  keep   edges with more than two faces stay as they are
  cut    the surface is parted there, into sheets that each bound one inside [Gueziec et al. 2001]; the copies of a
         vertex stand at one place, so a file without numbers of vertices (STL) cannot tell them apart
  merge  vertices stay apart as the file has them; borders at the same places are sewn, two faces to an edge

Examples:
  lodsmith clean scan.stl -o scan.ply --prune 1%
  lodsmith clean *.obj -O mended --weld 0.01% --non-manifold cut --json";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
#[command(mut_arg("name", |name| name.default_value("{stem}_clean.{ext}")))]
#[command(group(ArgGroup::new("result").args(["output", "out_dir", "dry-run"]).required(true).multiple(true)))]
pub(crate) struct CleanArgs {
    #[command(flatten)]
    pub(super) files: BatchFiles,
    #[command(flatten)]
    pub(super) options: Options<OfClean>,
    #[command(flatten)]
    pub(super) printing: Printing,
}
