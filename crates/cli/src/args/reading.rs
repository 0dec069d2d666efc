//! Options of every command that reads a model.

use std::path::PathBuf;

use clap::Args;
use lodsmith_io::{AssetScope, Format, ReadOptions};

use super::values;
use crate::memory;

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
