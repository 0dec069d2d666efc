//! Options for writing a result.

use clap::{Args, ValueEnum};
use lodsmith_io::{Format, Textures};

use super::{choice, values};

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
    #[arg(long, value_name = "POLICY", value_parser = choice(Textures::ALL, Textures::name),
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

/// The axis that is up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Up {
    Y,
    Z,
}
