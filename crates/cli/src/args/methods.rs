//! Arguments of `lodsmith methods`.

use std::path::PathBuf;

use clap::Args;
use lodsmith::{MethodKind, SimplifyOptions};
use lodsmith_asset::Source;

use super::table::{TARGET, Target, Writing};
use super::{Reading, Run, choice};

const AFTER: &str = "\
The table shows for each method: faces of the result; time (without reading and measuring); mean, RMS and largest \
distance from the input (in both directions, in percent of the diagonal); what ended the run; defects that the input \
does not have; and the attributes that the result kept. Methods run one after the other. For the purpose of each, see \
lodsmith simplify --help.

Examples:
  lodsmith methods bunny.obj --faces 5000
  lodsmith methods part.stl --ratio 0.1 --method planar --method memoryless -O results
  lodsmith methods scan.ply --error 0.5% --json";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
pub(crate) struct MethodsArgs {
    /// File to simplify; `-` is standard input
    #[arg(value_name = "IN")]
    pub(crate) input: Source,
    #[command(flatten, next_help_heading = TARGET)]
    pub(crate) target: Target,
    /// Run only this method; may be repeated [default: all]
    #[arg(long, value_name = "METHOD", value_parser = choice(MethodKind::ALL, MethodKind::name), help_heading = "Comparison")]
    method: Vec<MethodKind>,
    /// Number of samples in each direction, spread by area, in addition to all vertices
    #[arg(long, value_name = "N", help_heading = "Comparison",
          default_value_t = lodsmith::core::measure::CompareOptions::default().samples)]
    pub(crate) samples: usize,
    /// Folder for the results, named STEM_METHOD.EXT; created if missing
    #[arg(short = 'O', long, value_name = "DIR", help_heading = "Writing")]
    pub(crate) out_dir: Option<PathBuf>,
    /// Write an image of all results side by side (.png, .jpg, .webp)
    #[arg(long, value_name = "OUT", help_heading = "Writing")]
    pub(crate) sheet: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) writing: Writing,
    /// Print one JSON object
    #[arg(long, help_heading = "Run")]
    pub(crate) json: bool,
    /// Seed of the samples; equal seeds give equal results and figures
    #[arg(long, value_name = "N", default_value_t = SimplifyOptions::default().seed, help_heading = "Run")]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) run: Run,
}

impl MethodsArgs {
    /// Returns the methods to run, each once, in the order of [`MethodKind::ALL`].
    pub(crate) fn methods(&self) -> Vec<MethodKind> {
        let is_selected = |m: &MethodKind| self.method.is_empty() || self.method.contains(m);
        MethodKind::ALL.into_iter().filter(is_selected).collect()
    }

    /// Returns the engine's options for one method: the target, and the method's defaults.
    pub(crate) fn options(&self, method: MethodKind) -> SimplifyOptions {
        let mut options = SimplifyOptions::new(self.target.stop());
        options.method = method.into();
        options.seed = self.seed;
        options
    }
}
