//! Arguments that many commands have: reading, writing, and how a command runs.

use std::num::NonZeroU16;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use lodsmith_io::{AssetScope, Format, ReadOptions};

use super::choice::TexturesChoice;
use super::values;
use crate::in_order::available_threads;
use crate::memory;

/// Options of a run: threads, limits, verbosity.
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

/// Files that a model may name.
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

/// Options for writing a result.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Writing")]
pub(crate) struct Writing {
    /// Format of the output [default: from its file name]
    #[arg(long, value_name = "FORMAT", value_parser = values::written_format())]
    pub(crate) to: Option<Format>,
    /// Write text instead of binary (PLY, STL)
    #[arg(long)]
    pub(crate) ascii: bool,
    /// Copy material and image files beside the output (OBJ, .gltf), link to them, or write none (OBJ)
    #[arg(long, value_name = "POLICY", value_enum, default_value_t)]
    pub(crate) textures: TexturesChoice,
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

/// Reporting of a command that writes.
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
