//! Command-line arguments. Options are converted to [`lodsmith::SimplifyOptions`], which is also the only
//! place of their defaults.

mod bake;
mod batch_files;
mod choice;
mod clean;
mod engine;
mod lod;
mod methods;
mod progressive;
mod reading;
mod render;
mod run;
mod simplify;
mod values;
mod writing;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use lodsmith_asset::{Sink, Source};

pub(crate) use bake::{BakeArgs, BakeCommandArgs};
use choice::choice;
pub(crate) use clean::CleanArgs;
pub(crate) use lod::LodArgs;
pub(crate) use methods::MethodsArgs;
pub(crate) use progressive::{ExtractArgs, LpmBuildArgs, LpmInfoArgs, Progressive};
pub(crate) use reading::{AssetArgs, Reading};
pub(crate) use render::{LookArgs, MomentArgs, PlaceArgs, RenderArgs, Surroundings};
pub(crate) use run::{Ending, Run};
pub(crate) use simplify::SimplifyArgs;
pub(crate) use writing::Writing;

const STATUSES: &str = "\
Exit status: 0 done; 1 the file, the mesh or the system is at fault; 2 the command line is at fault;
3 only with --strict: target not reached or data dropped.";

/// Makes triangle meshes lighter: the closest mesh for the count.
#[derive(Debug, Parser)]
#[command(name = "lodsmith", version, max_term_width = 110, after_help = STATUSES)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Reduce the number of triangles
    Simplify(Box<SimplifyArgs>),
    /// Make levels of detail
    Lod(Box<LodArgs>),
    /// Show what a file contains and what is wrong with it
    Info(InfoArgs),
    /// Measure the distance between two meshes
    Compare(CompareArgs),
    /// Convert between formats
    Convert(ConvertArgs),
    /// Repair a mesh: merge vertices, orient faces, remove broken ones
    Clean(Box<CleanArgs>),
    /// Bake the detail of one model into textures of a lighter one
    Bake(Box<BakeCommandArgs>),
    /// Compare all methods on one model: time, error, validity
    Methods(Box<MethodsArgs>),
    /// Store all levels of a mesh in one file, and extract any of them
    #[command(subcommand)]
    Progressive(Progressive),
    /// Render a picture without opening a window
    Render(Box<RenderArgs>),
    /// Open a window with the original and the result side by side
    View(ViewArgs),
    /// Check the system: versions, graphics adapters, display, missing libraries
    Doctor(DoctorArgs),
    /// Print the completion script of a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print a manual page
    Man {
        /// Command to describe, such as simplify or "progressive build" [default: the overview]
        command: Option<String>,
    },
}

impl Command {
    /// Returns the options of a run (threads, limits, output), if the command reads files.
    pub(crate) fn run(&self) -> Option<&Run> {
        Some(match self {
            Self::Simplify(args) => &args.run,
            Self::Lod(args) => &args.run,
            Self::Info(args) => &args.run,
            Self::Compare(args) => &args.run,
            Self::Convert(args) => &args.run,
            Self::Clean(args) => &args.run,
            Self::Bake(args) => &args.run,
            Self::Methods(args) => &args.run,
            Self::Render(args) => &args.run,
            Self::Progressive(Progressive::Build(args)) => &args.run,
            Self::Progressive(Progressive::Extract(args)) => &args.run,
            Self::Progressive(Progressive::Info(args)) => &args.run,
            Self::View(_) | Self::Doctor(_) | Self::Completions { .. } | Self::Man { .. } => return None,
        })
    }

    /// Returns an error if options of simplification do not go together.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        match self {
            Self::Simplify(args) => args.engine.check(),
            Self::Lod(args) => args.engine.check(),
            Self::Progressive(Progressive::Build(args)) => args.engine.check(),
            _ => Ok(()),
        }
    }

    /// Returns the seconds after which the process ends, for commands without a partial result. (The others
    /// return the best result they have by then.)
    pub(crate) fn hard_limit_secs(&self) -> Option<f64> {
        match self {
            Self::Simplify(_) | Self::Lod(_) | Self::Methods(_) => None,
            _ => self.run()?.time_limit,
        }
    }
}

#[derive(Args, Debug)]
pub(crate) struct InfoArgs {
    /// Files to inspect; `-` is standard input
    #[arg(value_name = "IN", required = true)]
    pub(crate) inputs: Vec<Source>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// Print one line of JSON for each input
    #[arg(long, help_heading = "Run")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: Run,
}

#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// The reference, such as the original
    #[arg(value_name = "REFERENCE")]
    pub(crate) reference: Source,
    /// The mesh to compare with it
    #[arg(value_name = "CANDIDATE")]
    pub(crate) candidate: Source,
    /// Write a heat map of the distances on the reference, from blue (none) to red (largest), as a mesh (.ply) or a
    /// picture (.png, .jpg, .webp)
    #[arg(long, value_name = "OUT")]
    pub(crate) heatmap: Option<PathBuf>,
    /// Also render both from N sides and measure how different the pictures look
    #[arg(long, value_name = "N", value_parser = values::count)]
    pub(crate) views: Option<usize>,
    /// Size of these pictures
    #[arg(long, value_name = "WxH", value_parser = values::size, default_value = "512x512", requires = "views")]
    pub(crate) size: [usize; 2],
    /// Write these pictures, the reference first in each pair (.png, .jpg, .webp)
    #[arg(long, value_name = "OUT", requires = "views")]
    pub(crate) views_sheet: Option<PathBuf>,
    /// Overwrite inputs and write-protected files (never folders)
    #[arg(long)]
    pub(crate) force: bool,
    /// Number of samples in each direction, spread by area, in addition to all vertices
    #[arg(long, value_name = "N", default_value_t = lodsmith::core::measure::CompareOptions::default().samples)]
    pub(crate) samples: usize,
    /// Seed of the samples; equal seeds give equal figures
    #[arg(long, value_name = "N", default_value_t = lodsmith::core::measure::CompareOptions::default().seed)]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// Print one JSON object
    #[arg(long, help_heading = "Run")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: Run,
}

#[derive(Args, Debug)]
pub(crate) struct ViewArgs {
    /// Files to open, or a session; without any, the window opens empty
    #[arg(value_name = "IN")]
    pub(crate) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) assets: AssetArgs,
}

#[derive(Args, Debug)]
pub(crate) struct DoctorArgs {
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ConvertArgs {
    /// File to read; `-` is standard input
    #[arg(value_name = "IN")]
    pub(crate) input: Source,
    /// File to write; `-` is standard output
    #[arg(value_name = "OUT")]
    pub(crate) output: Sink,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) writing: Writing,
    /// Exit with status 3 if data are dropped
    #[arg(long)]
    pub(crate) strict: bool,
    /// Print one JSON object
    #[arg(long, help_heading = "Run")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: Run,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_grammar_is_sound() {
        Cli::command().debug_assert();
    }
}
