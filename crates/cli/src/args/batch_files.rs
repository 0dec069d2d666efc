//! Arguments of a command over several files.

use std::path::PathBuf;

use clap::Args;

use super::{Ending, Reading, Writing};
use crate::paths::{Sink, Source};
use crate::plan::OutputArgs;

/// Inputs, and the outputs for their results. The command sets the default of the name.
#[derive(Args, Debug)]
pub(crate) struct BatchFiles {
    /// Files to read; `-` is standard input
    #[arg(value_name = "IN", required = true)]
    inputs: Vec<Source>,
    /// File to write; `-` is standard output
    #[arg(short, long, value_name = "OUT", conflicts_with = "out_dir")]
    output: Option<Sink>,
    /// Folder for the results of several inputs; created if missing
    #[arg(short = 'O', long, value_name = "DIR")]
    out_dir: Option<PathBuf>,
    /// File names in the folder
    #[arg(long, value_name = "TEMPLATE", default_value = "{stem}.{ext}", requires = "out_dir")]
    name: String,
}

impl BatchFiles {
    /// Returns where the results go.
    pub(super) fn wanted(
        &self,
        reading: &Reading,
        writing: &Writing,
        ending: Ending,
        dry_run: bool,
    ) -> OutputArgs<'_> {
        OutputArgs {
            inputs: &self.inputs,
            output: self.output.as_ref(),
            out_dir: self.out_dir.as_deref(),
            name: &self.name,
            from: reading.from,
            writing: *writing,
            json: ending.json,
            dry_run,
        }
    }
}
