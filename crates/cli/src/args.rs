//! What can be typed. Options become [`lodsmith::SimplifyOptions`]; defaults come from there and stand nowhere else.

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
use lodsmith_io::{AssetScope, Format, ReadOptions};

pub(crate) use choice::{BorderChoice, PlacementChoice, TexturesChoice, TopologyChoice};
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
    /// Make it lighter
    Simplify(Box<SimplifyArgs>),
    /// A chain of levels of detail
    Lod(Box<LodArgs>),
    /// What is in this file, and what is wrong with it
    Info(InfoArgs),
    /// How far is one from the other
    Compare(CompareArgs),
    /// Change the format, lose nothing that fits
    Convert(ConvertArgs),
    /// Weld, orient, drop what is broken, and say what was done
    Clean(Box<CleanArgs>),
    /// Every method on one model: time, error, validity
    Methods(Box<MethodsArgs>),
    /// A mesh that runs between all levels, in one file
    #[command(subcommand)]
    Progressive(Progressive),
    /// A picture, without a window
    Render(Box<RenderArgs>),
    /// A window: original and result side by side, live while you drag
    View(ViewArgs),
    /// Versions, adapters, the display, and what is missing
    Doctor(DoctorArgs),
    /// Print what a shell needs to complete commands
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print a manual page
    Man {
        /// The page of this command, such as simplify or "progressive build"; without it, the one that lists them all
        command: Option<String>,
    },
}

impl Command {
    /// The options of a run (threads, limits, what is printed), which commands that read files have; `None` for the others.
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

    /// Seconds after which the process ends, for commands that have nothing to show for part of their work. (The others take
    /// the best they have by then.)
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
    /// Threads; the result is the same with any number [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroU16>,
    /// Stop after S seconds: simplify, lod and methods keep the best they have by then, for each input; all others end with
    /// an error and write nothing
    #[arg(long, value_name = "S", value_parser = values::seconds)]
    pub(crate) time_limit: Option<f64>,
    /// Memory that the process may take, such as 512M or 2G (by 1024): what would take more is refused [default: three
    /// quarters of what the machine or the container has]
    #[arg(long, value_name = "SIZE", value_parser = values::memory)]
    pub(crate) max_memory: Option<u64>,
    /// Print nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Print more
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
    /// Format of the inputs, whatever their content
    #[arg(long, value_name = "FORMAT", value_parser = values::format())]
    pub(crate) from: Option<Format>,
    #[command(flatten)]
    assets: AssetArgs,
}

impl Reading {
    /// These options as `lodsmith_io` takes them.
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
    /// Let models name files in DIR and below (materials, textures, buffers), not only in their own folder and below
    #[arg(long, value_name = "DIR")]
    asset_root: Option<PathBuf>,
    /// Let models name any file; only for models that you trust
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
    /// Format of the output, whatever its ending
    #[arg(long, value_name = "FORMAT", value_parser = values::written_format())]
    pub(crate) to: Option<Format>,
    /// Text instead of binary (PLY, STL)
    #[arg(long)]
    pub(crate) ascii: bool,
    /// Files of materials and textures (OBJ): copied beside the output, linked from there, or dropped
    #[arg(long, value_name = "WHAT", value_enum, default_value_t)]
    pub(crate) textures: TexturesChoice,
    /// Multiply every coordinate of the output
    #[arg(long, value_name = "F", value_parser = values::above_zero)]
    pub(crate) scale: Option<f64>,
    /// Turn the output about x so that this axis is up, where the other one was
    #[arg(long, value_name = "AXIS")]
    pub(crate) up: Option<Up>,
    /// Write over an input or a write-protected file; a folder is never overwritten
    #[arg(long)]
    pub(crate) force: bool,
}

/// How a command that writes tells what it did.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Run")]
pub(crate) struct Ending {
    /// One JSON object for each input, on a line
    #[arg(long)]
    pub(crate) json: bool,
    /// End with status 3 if a target is not reached or data are dropped
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
    /// Files to look into; `-` is standard input
    #[arg(value_name = "IN", required = true)]
    pub(crate) inputs: Vec<Source>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// One JSON object a line for each input
    #[arg(long, help_heading = "Run")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: Run,
}

#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// What it should look like
    #[arg(value_name = "REFERENCE")]
    pub(crate) reference: Source,
    /// What it does look like
    #[arg(value_name = "CANDIDATE")]
    pub(crate) candidate: Source,
    /// Write the reference with its distance to the candidate as colours, blue for none and red for the largest: as a mesh
    /// (.ply), or as a picture (.png, .jpg, .webp)
    #[arg(long, value_name = "OUT")]
    pub(crate) heatmap: Option<PathBuf>,
    /// Draw both from so many sides, the same every time, and measure how much the pictures differ to the eye
    #[arg(long, value_name = "N", value_parser = values::count)]
    pub(crate) views: Option<usize>,
    /// Pixels of these pictures
    #[arg(long, value_name = "WxH", value_parser = values::size, default_value = "512x512", requires = "views")]
    pub(crate) size: [usize; 2],
    /// Write these pictures in pairs, the reference first (.png, .jpg, .webp)
    #[arg(long, value_name = "OUT", requires = "views")]
    pub(crate) views_sheet: Option<PathBuf>,
    /// Write over an input or a write-protected file; a folder is never overwritten
    #[arg(long)]
    pub(crate) force: bool,
    /// Samples each way, spread by area; all vertices come on top
    #[arg(long, value_name = "N", default_value_t = lodsmith::core::measure::CompareOptions::default().samples)]
    pub(crate) samples: usize,
    /// Equal seeds give equal figures
    #[arg(long, value_name = "N", default_value_t = lodsmith::core::measure::CompareOptions::default().seed)]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// One JSON object
    #[arg(long, help_heading = "Run")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: Run,
}

#[derive(Args, Debug)]
pub(crate) struct ViewArgs {
    /// Files to open, or a session; without any, the window says what to do
    #[arg(value_name = "IN")]
    pub(crate) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) assets: AssetArgs,
}

#[derive(Args, Debug)]
pub(crate) struct DoctorArgs {
    /// One JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ConvertArgs {
    /// The file to read; `-` is standard input
    #[arg(value_name = "IN")]
    pub(crate) input: Source,
    /// The file to write; `-` is standard output
    #[arg(value_name = "OUT")]
    pub(crate) output: Sink,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) writing: Writing,
    /// End with status 3 if data are dropped
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
