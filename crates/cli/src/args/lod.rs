//! Arguments of `lodsmith lod`.

use std::path::PathBuf;

use clap::Args;
use lodsmith::{Length, Levels, LodOptions, Measure, Screen, Stop};
use lodsmith_asset::plan::Outputs;
use lodsmith_asset::values::LEVEL_FACTOR;
use lodsmith_asset::{LodRecipe, Naming, Normals, Sink, Source};

use super::engine::EngineArgs;
use super::{BakeArgs, Ending, Reading, Run, Writing, choice, values};

const AFTER: &str = "\
Levels stand beside the original, which is level 0 and stays as it is. Levels by counts come out of one run, each \
fitted by itself; levels by errors, and those of methods that do not collapse edges, are made one by one.

Each level is measured against the original, both ways. lods.json in the folder says from which distance on its largest \
deviation is no higher than --pixels, on a screen of --height pixels with a vertical field of view of --fov degrees: \
error * height / (2 * tan(fov / 2) * pixels).

Names:
  plain   NAME_lod0.glb, NAME_lod1.glb and so on; meshes and nodes of a single file NAME, NAME_lod1
  unity   NAME_LOD0, NAME_LOD1: Unity makes a LOD group of meshes with such names
  unreal, godot: the same; there the levels are assigned by hand, or by script from lods.json

Examples:
  lodsmith lod bunny.obj -o bunny.glb --levels 0.5,0.25,0.1
  lodsmith lod tower.glb -O levels --count 4 --factor 0.4 --naming unity
  lodsmith lod statue.ply -O levels --errors 0.05%,0.2%,1% --geomorph
  lodsmith lod hero.glb -o out.glb --levels 0.5,0.2,0.05 --bake normal,color --texture-size 2048";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
pub(crate) struct LodArgs {
    /// File to make levels of; `-` is standard input
    #[arg(value_name = "IN")]
    pub(crate) input: Source,
    /// Write all levels to one GLB or glTF file (extension MSFT_lod); `-` is standard output
    #[arg(short, long, value_name = "OUT", conflicts_with = "out_dir",
          required_unless_present_any = ["out_dir", "dry_run"])]
    pub(crate) output: Option<Sink>,
    /// Folder for one file per level, and lods.json; created if missing
    #[arg(short = 'O', long, value_name = "DIR")]
    pub(crate) out_dir: Option<PathBuf>,
    /// File names in the folder, instead of those of --naming
    #[arg(long, value_name = "TEMPLATE", requires = "out_dir")]
    pub(crate) name: Option<String>,
    /// Naming of files, meshes and nodes, see below
    #[arg(long, value_name = "STYLE", value_parser = choice(Naming::ALL, Naming::name),
          default_value = Naming::default().name(), help_heading = "Writing")]
    pub(crate) naming: Naming,
    #[command(flatten)]
    pub(crate) levels: LevelArgs,
    /// With --count, the fraction of the triangles of the previous level that each level keeps
    #[arg(long, value_name = "F", value_parser = values::below_one, default_value_t = LEVEL_FACTOR, requires = "count",
          conflicts_with_all = ["levels", "faces", "errors"],
          help_heading = "Levels (one of these)")]
    factor: f64,
    /// Store the position of each vertex in the next coarser level: `_GEOMORPH` in GLB, `geomorph_x` and so on in PLY
    #[arg(long, help_heading = "Writing")]
    pub(crate) geomorph: bool,
    /// Largest visible deviation, in pixels
    #[arg(long, value_name = "N", value_parser = values::above_zero, default_value_t = Screen::default().pixels,
          help_heading = "Switching")]
    pixels: f64,
    /// Vertical field of view, in degrees
    #[arg(long, value_name = "DEG", value_parser = values::view_deg, default_value_t = Screen::default().fov_deg,
          help_heading = "Switching")]
    fov: f64,
    /// Height of the screen, in pixels
    #[arg(long, value_name = "PX", value_parser = values::above_zero, default_value_t = Screen::default().height_px,
          help_heading = "Switching")]
    height: f64,
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    #[command(flatten)]
    pub(crate) baking: BakeArgs,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) writing: Writing,
    /// Normals of the levels: carried over from the input, computed anew, or none
    #[arg(long, value_name = "NORMALS", value_parser = choice(Normals::ALL, Normals::name),
          default_value = Normals::default().name(), help_heading = "Writing")]
    pub(crate) normals: Normals,
    /// Print the report without writing files
    #[arg(long, help_heading = "Writing")]
    pub(crate) dry_run: bool,
    #[command(flatten)]
    pub(crate) ending: Ending,
    #[command(flatten)]
    pub(crate) run: Run,
}

/// Levels by fractions, counts or errors.
#[derive(Args, Debug)]
#[command(next_help_heading = "Levels (one of these)")]
#[group(required = true, multiple = false)]
pub(crate) struct LevelArgs {
    /// Fractions of the triangles to keep, in falling order (0.5,0.25 or 50%,25%)
    #[arg(long, value_name = "R,...", value_delimiter = ',', value_parser = values::ratio)]
    levels: Vec<f64>,
    /// Numbers of triangles, in falling order
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = values::count)]
    faces: Vec<usize>,
    /// Number of levels; each keeps --factor of the previous one
    #[arg(long, value_name = "N", value_parser = values::count)]
    count: Option<usize>,
    /// Largest deviations, in rising order, in units of the file or as shares of the diagonal (0.1%)
    #[arg(long, value_name = "D,...", value_delimiter = ',', value_parser = values::length)]
    errors: Vec<Length>,
}

impl LevelArgs {
    fn levels(&self, factor: f64) -> Levels {
        match self.count {
            Some(count) => Levels::Steps { count, factor },
            None if !self.errors.is_empty() => Levels::Errors(self.errors.clone()),
            None if !self.faces.is_empty() => Levels::Faces(self.faces.clone()),
            None => Levels::Ratios(self.levels.clone()),
        }
    }
}

impl LodArgs {
    /// Returns where the levels go.
    pub(crate) fn wanted(&self) -> Outputs<'_> {
        Outputs {
            inputs: std::slice::from_ref(&self.input),
            output: self.output.as_ref(),
            out_dir: self.out_dir.as_deref(),
            name: "",
            from: self.reading.from,
            to: self.writing.to,
            writing: self.writing.options(),
            json: self.ending.json,
            dry_run: self.dry_run,
        }
    }

    /// Converts the arguments to options of the engine.
    fn options(&self) -> LodOptions {
        let mut options = LodOptions::new(self.levels.levels(self.factor));
        options.simplify = self.engine.options(Stop::default());
        // Switching distances are no more accurate than the errors that they are computed from.
        options.simplify.measure = Measure::Always;
        options.geomorph = self.geomorph;
        options
    }

    /// Returns how the levels are made.
    ///
    /// # Errors
    /// A usage error for arguments that do not go together.
    pub(crate) fn recipe(&self) -> anyhow::Result<LodRecipe> {
        let (names, baking) = (self.engine.names.names(), self.baking.baking()?);
        let screen = Screen::new(self.fov, self.height, self.pixels).unwrap_or_default();
        let (normals, naming) = (self.normals, self.naming);
        Ok(LodRecipe { options: self.options(), names, normals, baking, screen, naming })
    }
}
