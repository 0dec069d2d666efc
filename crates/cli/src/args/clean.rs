//! Arguments of `lodsmith clean`.

use clap::{ArgGroup, Args};

use super::batch_files::BatchFiles;
use super::table::{OfClean, Options, Printing};

const AFTER: &str = "\
Steps, in this order; each is counted in the report:
  weld          merge vertices at equal positions, or closer than --weld; attribute seams are kept
  drop          remove faces with positions that are not finite, with a position twice, and duplicate faces
  sheets        with --sheets single: remove one of two faces back to back, and make the materials two-sided
  prune         remove connected parts smaller than --prune
  orient        make neighbours agree and closed parts face outward (a part inside another is kept: it may be a cavity)
  zero area     remove faces without area, unless that opens a hole
  non-manifold  see below
  unused        remove vertices without a face

Non-manifold:
  keep   leave edges with more than two faces as they are
  cut    cut the surface there, into sheets that each bound one inside [Gueziec et al. 2001]; the copies of a vertex
         have equal positions, so a file without vertex indices (STL) cannot tell them apart
  merge  keep the vertices of the file separate, then join borders at equal positions, two faces to an edge

Examples:
  lodsmith clean scan.stl -o scan.ply --prune 1%
  lodsmith clean *.obj -O cleaned --weld 0.01% --non-manifold cut --json";

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
