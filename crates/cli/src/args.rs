//! Command-line arguments. Options are converted to [`lodsmith::SimplifyOptions`], which is also the only
//! place of their defaults.

mod choice;
mod clean;
mod engine;
mod lod;
mod methods;
mod of_method;
mod progressive;
mod render;
mod scope;
mod simplify;
mod values;

use std::num::NonZeroU16;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use lodsmith_io::{AssetScope, Format, ReadOptions, Textures};

use choice::choice;
pub(crate) use clean::CleanArgs;
pub(crate) use engine::{How, Importance};
pub(crate) use lod::{LodArgs, Naming};
pub(crate) use methods::MethodsArgs;
pub(crate) use progressive::{ExtractArgs, LpmBuildArgs, LpmInfoArgs, Progressive};
pub(crate) use render::{LookArgs, MomentArgs, PlaceArgs, RenderArgs, Surroundings};
pub(crate) use simplify::{Normals, SimplifyArgs};
pub(crate) use values::TypedLength;

use crate::file::{Sink, Source};
use crate::in_order::available_threads;
use crate::memory;

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
            Self::Methods(args) => &args.run,
            Self::Render(args) => &args.run,
            Self::Progressive(Progressive::Build(args)) => &args.run,
            Self::Progressive(Progressive::Extract(args)) => &args.run,
            Self::Progressive(Progressive::Info(args)) => &args.run,
            Self::View(_) | Self::Doctor(_) | Self::Completions { .. } | Self::Man { .. } => return None,
        })
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

/// How a command runs.
#[derive(Args, Debug)]
#[command(next_help_heading = "Run")]
pub(crate) struct Run {
    /// Number of threads; the result is the same with any number [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroU16>,
    /// Stop after S seconds: simplify, lod and methods write the best result so far for each input; all other commands
    /// fail and write nothing
    #[arg(long, value_name = "S", value_parser = values::seconds)]
    pub(crate) time_limit: Option<f64>,
    /// Limit the memory of the process, such as 512M or 2G (powers of 1024); refuse what would take more [default:
    /// three quarters of what the machine or the container has]
    #[arg(long, value_name = "SIZE", value_parser = values::memory)]
    pub(crate) max_memory: Option<u64>,
    /// Print errors only
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Print details
    #[arg(short, long, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
}

impl Run {
    pub(crate) fn threads(&self) -> usize {
        self.threads.map_or_else(available_threads, |n| usize::from(n.get()))
    }
}

/// Options of every command that reads a model: its format, and which files it may name.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Reading")]
pub(crate) struct Reading {
    /// Format of the inputs [default: detected from the content]
    #[arg(long, value_name = "FORMAT", value_parser = values::format())]
    pub(crate) from: Option<Format>,
    #[command(flatten)]
    assets: AssetArgs,
}

impl Reading {
    /// Converts these options to those of `lodsmith_io`.
    pub(crate) fn options(&self) -> ReadOptions {
        let mut options = ReadOptions::default();
        options.format = self.from;
        options.assets = self.assets.scope();
        options.limits = memory::limits();
        options
    }
}

/// Which files a model may name.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Reading")]
pub(crate) struct AssetArgs {
    /// Allow models to refer to files in DIR and below, not only in their own folder and below
    #[arg(long, value_name = "DIR")]
    asset_root: Option<PathBuf>,
    /// Allow models to refer to any file; use it only for models that you trust
    #[arg(long, conflicts_with = "asset_root")]
    allow_outside: bool,
}

impl AssetArgs {
    pub(crate) fn scope(&self) -> AssetScope {
        match &self.asset_root {
            Some(root) => AssetScope::Root(root.clone()),
            None if self.allow_outside => AssetScope::Anywhere,
            None => AssetScope::Folder,
        }
    }
}

/// How a result is written.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Writing")]
pub(crate) struct Writing {
    /// Format of the output [default: from its file name]
    #[arg(long, value_name = "FORMAT", value_parser = values::written_format())]
    pub(crate) to: Option<Format>,
    /// Write text instead of binary (PLY, STL)
    #[arg(long)]
    pub(crate) ascii: bool,
    /// What to do with material and texture files (OBJ): copy them beside the output, link to them, or drop them
    #[arg(long, value_name = "WHAT", value_parser = choice(Textures::ALL, Textures::name),
          default_value = Textures::default().name())]
    pub(crate) textures: Textures,
    /// Multiply every coordinate of the output
    #[arg(long, value_name = "F", value_parser = values::above_zero)]
    pub(crate) scale: Option<f64>,
    /// Rotate the output about x so that this axis points up
    #[arg(long, value_name = "AXIS")]
    pub(crate) up: Option<Up>,
    /// Overwrite inputs and write-protected files (never folders)
    #[arg(long)]
    pub(crate) force: bool,
}

/// How a command that writes tells what it did.
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

/// The axis that is up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Up {
    Y,
    Z,
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
