//! Options for writing a result.

use clap::Args;
use lodsmith_asset::Up;
use lodsmith_io::gltf::{Compression, Packing};
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
    /// Compress geometry and animations without loss: none, meshopt (EXT_meshopt_compression, most programs read it),
    /// or meshopt-khr (KHR_meshopt_compression, smaller) (glTF, GLB)
    #[arg(long, value_name = "HOW", value_parser = choice(Compression::ALL, Compression::name),
          default_value = Compression::default().name())]
    pub(crate) compress: Compression,
    /// Round attributes to fewer bits: positions to 14, normals to 8; needs KHR_mesh_quantization (glTF, GLB)
    #[arg(long)]
    pub(crate) quantize: bool,
    /// Multiply every coordinate of the output
    #[arg(long, value_name = "F", value_parser = values::above_zero)]
    pub(crate) scale: Option<f64>,
    /// Rotate the output about x so that this axis points up
    #[arg(long, value_name = "AXIS", value_parser = choice(Up::ALL, Up::name))]
    pub(crate) up: Option<Up>,
    /// Overwrite inputs and write-protected files (never folders)
    #[arg(long)]
    pub(crate) force: bool,
}

impl Writing {
    /// Returns how a result is written.
    pub(crate) fn options(&self) -> lodsmith_asset::Writing {
        let &Self { ascii, textures, scale, up, force, .. } = self;
        let packing = Packing::new(self.compress, self.quantize);
        lodsmith_asset::Writing { ascii, textures, packing, scale, up, force }
    }
}
