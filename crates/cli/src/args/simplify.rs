//! Arguments of `lodsmith simplify`.

use clap::{ArgGroup, Args};

use super::batch_files::BatchFiles;
use super::table::{OfSimplify, Options, Printing, TARGET};

const AFTER: &str = "\
Methods:
  memoryless      cost from the current surface only, then a final fit: the closest mesh [Lindstrom-Turk 1998]
  quadric         accumulated quadrics of the original planes [Garland-Heckbert 1997]
  lindstrom-turk  preserves volume and borders, as published [Lindstrom-Turk 1998]
  melax           length times curvature, keeps a subset of the vertices: for games [Melax 1998]
  shortest-edge   shortest edges first, to their midpoint: evens out the sizes of triangles
  cluster         one vertex for each cell of a grid: the fastest, for huge meshes [Lindstrom 2000]
  vertex-removal  keeps a subset of the vertices, retriangulates the holes [Schroeder et al. 1992]
  planar          few triangles for flat regions, the rest unchanged: CAD, voxels
  unsubdivide     reverses 4:1 subdivision where the mesh has its pattern [Taubin 2001]
  remesh          a new, even mesh on the same surface; closed with --voxel [Botsch-Kobbelt 2004]

Presets:
  auto        smallest distance
  scan        noisy surfaces: ignore normals, merge vertices that differ by rounding
  cad         machine parts: --border slide --topology preserve
  visual      best appearance: more weight on normals, even if the file has none
  print       3D printing: --topology preserve, ignore attributes

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

    fn options(arguments: &str) -> SimplifyOptions {
        let all = ["lodsmith", "simplify", "a.ply", "--dry-run", "--faces", "9"];
        let cli = Cli::try_parse_from(all.into_iter().chain(arguments.split_whitespace())).unwrap();
        cli.command.job().expect("simplify is a job").options.engine().unwrap()
    }

    #[test]
    fn explicit_options_override_the_preset() {
        let stop = Stop::faces(9);
        assert_eq!(options(""), SimplifyOptions::new(stop));
        assert_eq!(options("--preset auto"), SimplifyOptions::new(stop));
        for preset in Preset::ALL.into_iter().filter(|p| *p != Preset::Auto) {
            let name = preset.name();
            let expected = SimplifyOptions::preset(preset, stop);
            assert_eq!(options(&format!("--preset {name}")), expected, "{name}");
            assert_ne!(expected, SimplifyOptions::new(stop), "{name}");
        }
        let mut expected = SimplifyOptions::preset(Preset::Cad, stop);
        expected.border = BorderPolicy::Keep;
        assert_eq!(options("--border keep --preset cad"), expected);
        let mut expected = SimplifyOptions::preset(Preset::Print, stop);
        (expected.topology, expected.weights.uv) = (TopologyPolicy::Relaxed, 2.0);
        assert_eq!(options("--preset print --topology relaxed --weight uv=2"), expected);
        assert_eq!(options("--preset scan --weld 0.5").weld, Some(Length::Units(0.5)));
        assert_eq!(options("--preset scan --weld 0").weld, None);
    }
}
