//! Arguments of `lodsmith simplify`.

use clap::{ArgGroup, Args};

use super::batch_files::BatchFiles;
use super::table::{OfSimplify, Options, Printing, TARGET};

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
#[command(group(ArgGroup::new("result").args(["output", "out_dir", "dry-run"]).required(true).multiple(true)))]
pub(crate) struct SimplifyArgs {
    #[command(flatten)]
    pub(super) files: BatchFiles,
    #[command(flatten, next_help_heading = TARGET)]
    pub(crate) options: Options<OfSimplify>,
    #[command(flatten)]
    pub(super) printing: Printing,
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;
    use lodsmith::{BorderPolicy, Length, Preset, SimplifyOptions, Stop, TopologyPolicy};

    use crate::args::Cli;

    fn options(words: &str) -> SimplifyOptions {
        let all = ["lodsmith", "simplify", "a.ply", "--dry-run", "--faces", "9"];
        let cli = Cli::try_parse_from(all.into_iter().chain(words.split_whitespace())).unwrap();
        cli.command.job().expect("simplify is a job").options.engine().unwrap()
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
