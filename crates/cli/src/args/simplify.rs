//! Arguments of `lodsmith simplify`.

use clap::{ArgGroup, Args};
use lodsmith::SimplifyOptions;
use lodsmith_asset::plan::Outputs;
use lodsmith_asset::{Normals, Recipe};

use super::batch_files::BatchFiles;
use super::engine::{Deviation, EngineArgs, Target};
use super::{BakeArgs, Ending, Reading, Run, Writing, choice};

const AFTER: &str = "\
Methods:
  memoryless      costs of the present surface alone, then a fit: the closest mesh [Lindstrom-Turk 1998]
  quadric         sums of plane quadrics that remember the original [Garland-Heckbert 1997]
  lindstrom-turk  keeps volume and borders, as published [Lindstrom-Turk 1998]
  melax           length times curvature, onto vertices of the input: game levels [Melax 1998]
  shortest-edge   short edges first, onto their middle: evens out
  cluster         one vertex for each cell of a grid: the fastest, for huge meshes [Lindstrom 2000]
  vertex-removal  a subset of the vertices, holes filled anew [Schroeder et al. 1992]
  planar          flat regions in few triangles, nothing else moves: CAD, voxels
  unsubdivide     undoes 4:1 subdivision where it fits [Taubin 2001]
  remesh          a new, even mesh on the old surface; closed with --voxel [Botsch-Kobbelt 2004]

Presets:
  auto        smallest distance
  scan        noisy surfaces: normals are ignored, vertices parted by rounding are merged
  cad         machine parts: --border slide --topology preserve
  visual      best appearance: normals count more, even if the file has none
  print       --topology preserve, attributes are ignored

Examples:
  lodsmith simplify bunny.obj -o small.glb --ratio 0.1
  lodsmith simplify part.stl -o part.ply --error 0.1% --json
  lodsmith simplify *.ply -O low --faces 5000 --name '{stem}.{ext}'
  lodsmith simplify statue.ply -o statue.glb --ratio 5% --bake normal,color";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
#[command(mut_arg("name", |name| name.default_value("{stem}_low.{ext}")))]
#[command(group(ArgGroup::new("result").args(["output", "out_dir", "dry_run"]).required(true).multiple(true)))]
pub(crate) struct SimplifyArgs {
    #[command(flatten)]
    files: BatchFiles,
    #[command(
        flatten,
        next_help_heading = "Target (the first one met stops; one at least, unless the method ends by itself)"
    )]
    pub(crate) target: Target,
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    #[command(flatten)]
    deviation: Deviation,
    #[command(flatten)]
    pub(crate) baking: BakeArgs,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) writing: Writing,
    /// Normals of the result: carried over from the input, computed anew, or none
    #[arg(long, value_name = "NORMALS", value_parser = choice(Normals::ALL, Normals::name),
          default_value = Normals::default().name(), help_heading = "Writing")]
    pub(crate) normals: Normals,
    /// Print the report without writing a file
    #[arg(long, help_heading = "Writing")]
    pub(crate) dry_run: bool,
    #[command(flatten)]
    pub(crate) ending: Ending,
    #[command(flatten)]
    pub(crate) run: Run,
}

impl SimplifyArgs {
    /// Returns where the results go.
    pub(crate) fn wanted(&self) -> Outputs<'_> {
        self.files.wanted(&self.reading, &self.writing, self.ending, self.dry_run)
    }

    /// Converts the arguments to options of the engine.
    pub(crate) fn options(&self) -> SimplifyOptions {
        let mut options = self.engine.options(self.target.stop());
        self.deviation.apply(&mut options);
        options
    }

    /// Returns how each input is made lighter.
    ///
    /// # Errors
    /// A usage error for arguments that do not go together.
    pub(crate) fn recipe(&self) -> anyhow::Result<Recipe> {
        let (names, baking) = (self.engine.names.names(), self.baking.baking()?);
        let recipe =
            Recipe { options: self.options(), names, normals: self.normals, baking, ..Recipe::default() };
        recipe.check(&self.writing.options(), self.wanted().output)?;
        Ok(recipe)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;
    use lodsmith::{BorderPolicy, Length, Preset, Stop, TopologyPolicy};

    use super::*;
    use crate::args::{Cli, Command};

    fn options(words: &str) -> SimplifyOptions {
        let all = ["lodsmith", "simplify", "a.ply", "--dry-run", "--faces", "9"];
        let cli = Cli::try_parse_from(all.into_iter().chain(words.split_whitespace())).unwrap();
        let Command::Simplify(args) = cli.command else { unreachable!("simplify was typed") };
        args.options()
    }

    #[test]
    fn what_is_typed_goes_before_the_preset() {
        let stop = Stop::faces(9);
        assert_eq!(options(""), SimplifyOptions::new(stop));
        assert_eq!(options("--preset auto"), SimplifyOptions::new(stop));
        for preset in Preset::ALL.into_iter().filter(|p| *p != Preset::Auto) {
            let word = preset.name();
            let wanted = SimplifyOptions::preset(preset, stop);
            assert_eq!(options(&format!("--preset {word}")), wanted, "{word}");
            assert_ne!(wanted, SimplifyOptions::new(stop), "{word}");
        }
        let mut wanted = SimplifyOptions::preset(Preset::Cad, stop);
        wanted.border = BorderPolicy::Keep;
        assert_eq!(options("--border keep --preset cad"), wanted);
        let mut wanted = SimplifyOptions::preset(Preset::Print, stop);
        (wanted.topology, wanted.weights.uv) = (TopologyPolicy::Relaxed, 2.0);
        assert_eq!(options("--preset print --topology relaxed --weight uv=2"), wanted);
        assert_eq!(options("--preset scan --weld 0.5").weld, Some(Length::Units(0.5)));
        assert_eq!(options("--preset scan --weld 0").weld, None);
    }
}
