//! Arguments of `lodsmith progressive`.

use clap::{Args, Subcommand};
use lodsmith::{SimplifyOptions, Stop};
use lodsmith_asset::{AssetError, Sink, Source};
use lodsmith_io::Textures;
use lodsmith_io::lpm::{LpmOptions, MAX_BITS, MIN_BITS};
use serde_json::Value;

use super::table::{Engine, Options, Target, Writing};
use super::{Reading, Run, choice};

const AFTER_BUILD: &str = "\
The file has the base mesh and every vertex split that leads back to the input. Without --bits, the input is restored
exactly, in its order; with it, positions and attributes are rounded and the order of vertices and faces is not kept.

For methods and presets, see `lodsmith simplify --help`; methods that make a new mesh in one step cannot be recorded.

Examples:
  lodsmith progressive build bunny.obj -o bunny.lpm
  lodsmith progressive build scan.ply -o scan.lpm --bits 16 --ratio 0.01";

const AFTER_EXTRACT: &str = "\
Without a target, the finest level is written. From an incomplete file, the finest level that it has is written, with
a warning. With --error, levels are measured against the finest level in both directions, until one is within D.

Examples:
  lodsmith progressive extract bunny.lpm -o low.glb --faces 2000
  head -c 100000 bunny.lpm | lodsmith progressive extract - -o preview.ply";

/// Reporting options of commands that write.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Run")]
pub(crate) struct Ending {
    /// Print one line of JSON for each input
    #[arg(long)]
    pub(crate) json: bool,
    /// Exit with status 3 if a target is not reached or data are dropped
    #[arg(long)]
    pub(crate) strict: bool,
}

/// Subcommands of `progressive`.
#[derive(Debug, Subcommand)]
pub(crate) enum Progressive {
    /// Simplify as far as possible and store every step
    Build(Box<LpmBuildArgs>),
    /// Extract one level
    Extract(Box<ExtractArgs>),
    /// Show what a file contains
    Info(LpmInfoArgs),
}

#[derive(Args, Debug)]
#[command(after_help = AFTER_BUILD)]
pub(crate) struct LpmBuildArgs {
    /// File to read; `-` is standard input
    #[arg(value_name = "IN")]
    pub(crate) input: Source,
    /// File to write; `-` is standard output
    #[arg(short, long, value_name = "OUT.lpm")]
    pub(crate) output: Sink,
    /// Quantize coordinates to this many bits [default: exact]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8)
          .range(i64::from(MIN_BITS)..=i64::from(MAX_BITS)), help_heading = "Writing")]
    pub(crate) bits: Option<u8>,
    #[command(
        flatten,
        next_help_heading = "Base (the first target met stops; without one, as far as possible)"
    )]
    pub(crate) target: Target,
    #[command(flatten)]
    pub(crate) engine: Options<Engine>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// Store the images of materials in the file (copy, link), or leave them out (none)
    #[arg(long, value_name = "POLICY", value_parser = choice(Textures::ALL, Textures::name),
          default_value = Textures::default().name(), help_heading = "Writing")]
    textures: Textures,
    /// Overwrite inputs and write-protected files (never folders)
    #[arg(long, help_heading = "Writing")]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) ending: Ending,
    #[command(flatten)]
    pub(crate) run: Run,
}

impl LpmBuildArgs {
    /// Converts the arguments to options of the engine.
    ///
    /// # Errors
    /// For options that the method does not have, or that exclude each other.
    pub(crate) fn options(&self) -> Result<SimplifyOptions, AssetError> {
        let mut options = self.engine.engine()?;
        options.stop = self.target.stop();
        Ok(options)
    }
    /// Converts the arguments to options of the writer.
    pub(crate) fn writing(&self) -> LpmOptions {
        let mut options = LpmOptions::default();
        options.bits = self.bits;
        options.force = self.force;
        options.with_textures = !matches!(self.textures, Textures::None);
        options
    }
}

#[derive(Args, Debug)]
#[command(after_help = AFTER_EXTRACT)]
pub(crate) struct ExtractArgs {
    /// File to read; `-` is standard input
    #[arg(value_name = "IN.lpm")]
    pub(crate) input: Source,
    /// File to write; `-` is standard output
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Sink,
    #[command(
        flatten,
        next_help_heading = "Level (the finest that meets one of these targets; without one, the finest)"
    )]
    pub(crate) target: Target,
    /// Extract the level as recorded, without the fit stored at checkpoints
    #[arg(long)]
    pub(crate) no_fit: bool,
    #[command(flatten)]
    pub(crate) writing: Writing,
    #[command(flatten)]
    pub(crate) ending: Ending,
    #[command(flatten)]
    pub(crate) run: Run,
}

impl ExtractArgs {
    /// Returns the stop of the level to extract.
    pub(crate) fn stop(&self) -> Stop {
        self.target.stop()
    }
    /// Returns the target by name, for reports.
    pub(crate) fn target_json(&self) -> Value {
        lodsmith_asset::report_json::target(&self.target.stop())
    }
}

#[derive(Args, Debug)]
pub(crate) struct LpmInfoArgs {
    /// File to inspect; `-` is standard input
    #[arg(value_name = "IN.lpm")]
    pub(crate) input: Source,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: Run,
}
