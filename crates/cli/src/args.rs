//! Command-line arguments. Options of jobs on files and of simplification, and their defaults, come from tables in the
//! libraries.

mod bake;
mod batch_files;
mod choice;
mod clean;
mod lod;
mod methods;
mod progressive;
mod render;
mod simplify;
mod table;

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand};
use lodsmith_asset::picture::words;
use lodsmith_asset::request::{FileOptions, Places, Request, Verb};
use lodsmith_asset::values::count;
use lodsmith_asset::{Sink, Source};

use bake::BakeArgs;
use batch_files::BatchFiles;
use choice::choice;
use clean::CleanArgs;
use lod::LodArgs;
pub(crate) use methods::MethodsArgs;
pub(crate) use progressive::{ExtractArgs, LpmBuildArgs, LpmInfoArgs, Progressive};
pub(crate) use render::RenderArgs;
use simplify::SimplifyArgs;
use table::{InScope, OfConvert, OfInfo, Options, Part};
pub(crate) use table::{Loudness, Printing, Reading, Run, threads};

const STATUSES: &str = "\
Exit status: 0 success; 1 error in a file, a mesh or the system; 2 error in the command line;
3 only with --strict: target not reached or data dropped.";

/// Simplify triangle meshes: the closest mesh for a given number of triangles.
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
    /// Bake the detail of a high-poly model into textures of a low-poly model
    Bake(Box<BakeArgs>),
    /// Compare all methods on one model: time, error, validity
    Methods(Box<MethodsArgs>),
    /// Store all levels of a mesh in one file, and extract any of them
    #[command(subcommand)]
    Progressive(Progressive),
    /// Render an image without opening a window
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

/// The arguments of a job on files.
pub(crate) struct JobArgs<'a> {
    pub(crate) verb: Verb,
    pub(crate) options: &'a FileOptions,
    pub(crate) printing: Printing,
    pub(crate) inputs: Vec<Source>,
    pub(crate) output: Option<&'a Sink>,
    pub(crate) out_dir: Option<&'a Path>,
    /// Template of file names in the folder.
    name: &'a str,
}

impl<'a> JobArgs<'a> {
    fn new<P: Part>(options: &'a Options<P>, printing: Printing, inputs: Vec<Source>) -> Self {
        Self { verb: P::VERB, options, printing, inputs, output: None, out_dir: None, name: "" }
    }

    fn of_files<P: Part>(files: &'a BatchFiles, options: &'a Options<P>, printing: Printing) -> Self {
        let BatchFiles { inputs, output, out_dir, name } = files;
        let (output, out_dir) = (output.as_ref(), out_dir.as_deref());
        Self { output, out_dir, name, ..Self::new(options, printing, inputs.clone()) }
    }

    /// Returns the job with its options.
    ///
    /// # Errors
    /// A usage error for options that exclude each other.
    pub(crate) fn request(&self) -> anyhow::Result<Request> {
        Ok(Request::of(self.verb, self.options.clone())?)
    }

    /// Returns the inputs and outputs.
    pub(crate) fn places(&self) -> Places<'_> {
        let Self { output, out_dir, name, .. } = *self;
        Places { inputs: &self.inputs, output, out_dir, name, json: self.printing.json }
    }
}

impl Command {
    /// Returns the arguments of the job, if the command is a job on files.
    pub(crate) fn job(&self) -> Option<JobArgs<'_>> {
        Some(match self {
            Self::Simplify(args) => JobArgs::of_files(&args.files, &args.options, args.printing),
            Self::Clean(args) => JobArgs::of_files(&args.files, &args.options, args.printing),
            Self::Lod(args) => JobArgs {
                output: args.output.as_ref(),
                out_dir: args.out_dir.as_deref(),
                ..JobArgs::new(&args.options, args.printing, vec![args.input.clone()])
            },
            Self::Convert(args) => JobArgs {
                output: Some(&args.output),
                ..JobArgs::new(&args.options, args.printing, vec![args.input.clone()])
            },
            Self::Bake(args) => JobArgs {
                output: Some(&args.output),
                ..JobArgs::new(&args.options, args.printing, vec![args.high.clone(), args.low.clone()])
            },
            Self::Info(args) => JobArgs::new(&args.options, args.printing, args.inputs.clone()),
            _ => return None,
        })
    }

    /// Returns the limits of a run, if the command reads files.
    pub(crate) fn limits(&self) -> Option<&FileOptions> {
        let run = match self {
            Self::Compare(args) => &args.run,
            Self::Methods(args) => &args.run,
            Self::Render(args) => return Some(&args.options),
            Self::Progressive(Progressive::Build(args)) => &args.run,
            Self::Progressive(Progressive::Extract(args)) => &args.run,
            Self::Progressive(Progressive::Info(args)) => &args.run,
            _ => return self.job().map(|job| job.options),
        };
        Some(&run.limits)
    }

    /// Returns the seconds after which the process ends, for commands without a partial result. (The other
    /// commands write their best result so far; for them the process ends only if reading takes longer.)
    pub(crate) fn hard_limit_secs(&self) -> Option<f64> {
        match self {
            Self::Simplify(_) | Self::Lod(_) | Self::Methods(_) => None,
            _ => self.limits()?.time_limit,
        }
    }
}

#[derive(Args, Debug)]
pub(crate) struct InfoArgs {
    /// Files to inspect; `-` is standard input
    #[arg(value_name = "IN", required = true)]
    inputs: Vec<Source>,
    #[command(flatten)]
    options: Options<OfInfo>,
    #[command(flatten)]
    printing: Printing,
}

#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// The reference, such as the original
    #[arg(value_name = "REFERENCE")]
    pub(crate) reference: Source,
    /// The mesh to compare with it
    #[arg(value_name = "CANDIDATE")]
    pub(crate) candidate: Source,
    /// Write a heat map of the distances on the reference, from blue (0) to red (largest), as a mesh (.ply) or an
    /// image (.png, .jpg, .webp)
    #[arg(long, value_name = "OUT")]
    pub(crate) heatmap: Option<PathBuf>,
    /// Also render both meshes from N directions and measure how different the images look
    #[arg(long, value_name = "N", value_parser = count)]
    pub(crate) views: Option<usize>,
    /// Size of these images
    #[arg(long, value_name = "WxH", value_parser = words::size, default_value = "512x512", requires = "views")]
    pub(crate) size: [usize; 2],
    /// Write these images as one contact sheet, the reference first in each pair (.png, .jpg, .webp)
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
    /// Files to open, or a session; without files, the window opens empty
    #[arg(value_name = "IN")]
    pub(crate) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) assets: Options<InScope>,
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
    input: Source,
    /// File to write; `-` is standard output
    #[arg(value_name = "OUT")]
    output: Sink,
    #[command(flatten)]
    options: Options<OfConvert>,
    #[command(flatten)]
    printing: Printing,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_argument_definitions_are_valid() {
        Cli::command().debug_assert();
    }
}
