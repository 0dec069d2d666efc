//! Arguments of `lodsmith bake`, and of baking within other commands.

use clap::Args;
use lodsmith_asset::{Baking, Sink, Source};
use lodsmith_bake::{AtlasMode, BakeOptions, MapKind};

use super::{Reading, Run, Writing, choice, values};
use crate::status::usage;

const AFTER: &str = "\
Maps:
  normal              normals in the tangent frame of LOW (MikkTSpace)
  color               base colour and opacity: textures, factors and vertex colours of HIGH
  metallic-roughness  roughness in green, metallic in blue
  emissive            emitted light
  ao                  ambient occlusion by rays
  vertex-color        vertex colours of HIGH alone
  height              distance of HIGH from LOW, 16 bits
  object-normal       normals in coordinates of the mesh
  curvature           mean curvature of HIGH

The first five go into the materials of GLB, glTF and OBJ. The others are written beside OUT, as OUT_height.png and so \
on; with --map-files all of them are.

Examples:
  lodsmith bake statue.ply statue_low.obj -o statue.glb --maps normal,ao
  lodsmith bake high.glb low.glb -o baked.glb --maps normal,color --texture-size 2048";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
pub(crate) struct BakeCommandArgs {
    /// Detailed model
    #[arg(value_name = "HIGH")]
    pub(crate) high: Source,
    /// Lighter model, in the same place
    #[arg(value_name = "LOW")]
    pub(crate) low: Source,
    /// Output; `-` is standard output
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Sink,
    /// Maps to bake
    #[arg(long, value_name = "MAPS", value_delimiter = ',', default_value = "normal,color,ao",
          value_parser = choice(MapKind::ALL, MapKind::name), help_heading = "Baking")]
    pub(crate) maps: Vec<MapKind>,
    #[command(flatten)]
    pub(crate) texture: TextureArgs,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) writing: Writing,
    /// Print the report as JSON
    #[arg(long, help_heading = "Run")]
    pub(crate) json: bool,
    /// Exit with status 3 if data was dropped
    #[arg(long, help_heading = "Run")]
    pub(crate) strict: bool,
    #[command(flatten)]
    pub(crate) run: Run,
}

/// Options of the maps.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Baking")]
pub(crate) struct TextureArgs {
    /// Width and height of the maps, in texels [default: by the detail of the source, 256 to 4096]
    #[arg(long, value_name = "N", value_parser = values::texture_size)]
    pub(crate) texture_size: Option<usize>,
    /// Texture coordinates: keep those that do not overlap, or make a new atlas with one material
    #[arg(long, value_name = "ATLAS", default_value = AtlasMode::Keep.name(),
          value_parser = choice(AtlasMode::ALL, AtlasMode::name))]
    pub(crate) atlas: AtlasMode,
    /// Rays per texel for ambient occlusion
    #[arg(long, value_name = "N", value_parser = values::rays, default_value_t = BakeOptions::new([]).rays)]
    pub(crate) ao_rays: usize,
    /// Ignore faces farther than D for ambient occlusion, in units of the model [default: no limit]
    #[arg(long, value_name = "D", value_parser = values::above_zero)]
    pub(crate) ao_distance: Option<f64>,
    /// Write every map as a PNG file beside the output too
    #[arg(long)]
    pub(crate) map_files: bool,
}

/// Baking within a command that makes a mesh lighter.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Baking")]
pub(crate) struct BakeArgs {
    /// Bake what is lost into textures: normal, color, metallic-roughness, emissive, ao, vertex-color, height,
    /// object-normal, curvature (see `lodsmith bake --help`) [default: none]
    #[arg(long, value_name = "MAPS", value_delimiter = ',', hide_possible_values = true,
          value_parser = choice(MapKind::ALL, MapKind::name))]
    pub(crate) bake: Vec<MapKind>,
    #[command(flatten)]
    pub(crate) texture: TextureArgs,
}

impl BakeArgs {
    /// Returns the maps to bake; `None` if nothing is baked.
    ///
    /// # Errors
    /// A usage error for options of a bake without maps.
    pub(crate) fn baking(&self) -> anyhow::Result<Option<Baking>> {
        let texture = &self.texture;
        let is_set = texture.texture_size.is_some() || texture.ao_distance.is_some() || texture.map_files;
        if self.bake.is_empty() {
            return if is_set {
                Err(usage("--texture-size, --ao-distance and --map-files need --bake"))
            } else {
                Ok(None)
            };
        }
        Ok(Some(Baking { options: texture.options(&self.bake), map_files: texture.map_files }))
    }
}

impl TextureArgs {
    /// Converts the arguments to options of a bake.
    pub(crate) fn options(&self, maps: &[MapKind]) -> BakeOptions {
        let mut options = BakeOptions::new(maps.iter().copied());
        options.size = self.texture_size;
        options.atlas = self.atlas;
        options.rays = self.ao_rays;
        options.occlusion_distance = self.ao_distance;
        options
    }
}
