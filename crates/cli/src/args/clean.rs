//! Arguments of `lodsmith clean`.

use clap::{ArgGroup, Args};
use lodsmith::{CleanOptions, Length, NonManifold, Sheets};
use lodsmith_asset::plan::Outputs;

use super::batch_files::BatchFiles;
use super::{Ending, Reading, Run, Writing, choice, values};

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
#[command(group(ArgGroup::new("result").args(["output", "out_dir", "dry_run"]).required(true).multiple(true)))]
pub(crate) struct CleanArgs {
    #[command(flatten)]
    files: BatchFiles,
    /// Merge vertices closer than D, in units of the file or as a share of the diagonal (0.1%); coincident ones always are
    #[arg(long, value_name = "D", value_parser = values::some_length, help_heading = "Repair")]
    weld: Option<Length>,
    /// Treatment of edges with more than two faces, and of vertices where a surface touches itself; see below
    #[arg(long, value_name = "POLICY", value_parser = choice(NonManifold::ALL, NonManifold::name),
          default_value = NonManifold::default().name(), help_heading = "Repair")]
    non_manifold: NonManifold,
    /// Remove connected parts smaller than this (diagonal of their box, in units or as a share: 0.1%)
    #[arg(long, value_name = "SIZE", value_parser = values::some_length, help_heading = "Repair")]
    prune: Option<Length>,
    /// Keep both sides of sheets (faces back to back), or a single one; see below
    #[arg(long, value_name = "SIDES", value_parser = choice(Sheets::ALL, Sheets::name),
          default_value = Sheets::default().name(), help_heading = "Repair")]
    sheets: Sheets,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) writing: Writing,
    /// Print the report without writing a file
    #[arg(long, help_heading = "Writing")]
    pub(crate) dry_run: bool,
    #[command(flatten)]
    pub(crate) ending: Ending,
    #[command(flatten)]
    pub(crate) run: Run,
}

impl CleanArgs {
    /// Returns where the results go.
    pub(crate) fn wanted(&self) -> Outputs<'_> {
        self.files.wanted(&self.reading, &self.writing, self.ending, self.dry_run)
    }

    /// Converts the arguments to options of the library.
    pub(crate) fn options(&self) -> CleanOptions {
        let mut options = CleanOptions::default();
        options.weld = self.weld;
        options.non_manifold = self.non_manifold;
        options.sheets = self.sheets;
        options.prune = self.prune;
        options
    }
}
