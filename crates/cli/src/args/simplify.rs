//! What can be typed after `lodsmith simplify`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use lodsmith::{AttributeWeights, Guards, Measure, SimplifyOptions, Stop};
use lodsmith_io::Format;
use serde_json::{Map, Value};

use super::choice::{BorderChoice, FitChoice, MethodChoice, PlacementChoice, PresetChoice, TopologyChoice};
use super::of_method::OfMethod;
use super::scope::Scope;
use super::{Run, TypedLength, Writing, values};
use crate::file::{Sink, Source};
use crate::plan::Wanted;

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
  auto        the least distance
  scan        noisy surfaces: normals have no say, vertices that rounding parted are joined
  cad         machine parts: --border slide --topology preserve
  visual      for the eye: normals count more, also where the file has none
  print       --topology preserve, attributes have no say

Examples:
  lodsmith simplify bunny.obj -o small.glb --ratio 0.1
  lodsmith simplify part.stl -o part.ply --error 0.1% --json
  lodsmith simplify *.ply -O low --faces 5000 --name '{stem}.{ext}'";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
pub(crate) struct SimplifyArgs {
    /// Files to make lighter; `-` is standard input
    #[arg(value_name = "IN", required = true)]
    pub(crate) inputs: Vec<Source>,
    /// Where the result goes; `-` is standard output
    #[arg(short, long, value_name = "OUT", conflicts_with = "out_dir",
          required_unless_present_any = ["out_dir", "dry_run"])]
    pub(crate) output: Option<Sink>,
    /// Folder for the results of several inputs; it is made if need be
    #[arg(short = 'O', long, value_name = "DIR")]
    pub(crate) out_dir: Option<PathBuf>,
    /// Names of the results in the folder
    #[arg(long, value_name = "TEMPLATE", default_value = "{stem}_low.{ext}", requires = "out_dir")]
    pub(crate) name: String,
    #[command(
        flatten,
        next_help_heading = "Target (the first one met stops; one at least, unless the method ends by itself)"
    )]
    pub(crate) target: Target,
    #[command(flatten)]
    pub(crate) how: How,
    #[command(flatten)]
    of_method: OfMethod,
    #[command(flatten)]
    scope: Scope,
    #[command(flatten)]
    guards: GuardArgs,
    #[command(flatten)]
    deviation: Deviation,
    /// Format of the inputs, whatever their content
    #[arg(long, value_name = "FORMAT", value_parser = values::format(), help_heading = "Writing")]
    pub(crate) from: Option<Format>,
    #[command(flatten)]
    pub(crate) writing: Writing,
    /// Normals of the result: the input's, blended with their vertices; new ones; or none
    #[arg(long, value_name = "NORMALS", value_enum, default_value = "keep", help_heading = "Writing")]
    pub(crate) normals: Normals,
    /// Report without writing
    #[arg(long, help_heading = "Writing")]
    pub(crate) dry_run: bool,
    /// Overwrite a write-protected output too; a folder is never overwritten
    #[arg(long, help_heading = "Writing")]
    pub(crate) force: bool,
    /// One JSON object a line for each input
    #[arg(long, help_heading = "Run")]
    pub(crate) json: bool,
    /// End with status 3 if a target is not reached or data are dropped
    #[arg(long, help_heading = "Run")]
    pub(crate) strict: bool,
    /// Write the best mesh reached in so many seconds, for each input
    #[arg(long, value_name = "S", value_parser = values::seconds, help_heading = "Run")]
    pub(crate) time_limit: Option<f64>,
    /// Equal seeds give equal results
    #[arg(long, value_name = "N", default_value_t = SimplifyOptions::default().seed, help_heading = "Run")]
    seed: u64,
    #[command(flatten)]
    pub(crate) run: Run,
}

/// When to stop.
#[derive(Args, Debug)]
pub(crate) struct Target {
    /// So many triangles
    #[arg(long, value_name = "N", value_parser = values::count)]
    faces: Option<usize>,
    /// So many vertices
    #[arg(long, value_name = "N", value_parser = values::count)]
    vertices: Option<usize>,
    /// This part of the triangles, above 0 and up to 1
    #[arg(long, value_name = "R", value_parser = values::ratio)]
    ratio: Option<f64>,
    /// Largest deviation, in the units of the file or of the diagonal (0.1%)
    #[arg(long, value_name = "D")]
    error: Option<TypedLength>,
}

impl Target {
    /// Whether there is any.
    pub(crate) fn is_given(&self) -> bool {
        self.faces.is_some() || self.vertices.is_some() || self.ratio.is_some() || self.error.is_some()
    }

    /// For the engine.
    pub(super) fn stop(&self) -> Stop {
        Stop {
            faces: self.faces,
            vertices: self.vertices,
            ratio: self.ratio,
            error: self.error.as_ref().map(|e| e.length),
        }
    }

    /// What was asked for, by name.
    pub(crate) fn to_json(&self) -> Value {
        let all = [
            ("faces", self.faces.map(Value::from)),
            ("vertices", self.vertices.map(Value::from)),
            ("ratio", self.ratio.map(Value::from)),
            ("error", self.error.as_ref().map(TypedLength::to_json)),
        ];
        Value::Object(all.into_iter().filter_map(|(k, v)| Some((k.to_owned(), v?))).collect::<Map<_, _>>())
    }
}

#[derive(Args, Debug)]
#[command(next_help_heading = "How")]
pub(crate) struct How {
    /// Options for a purpose, see below; what is typed beside it goes before it
    #[arg(long, value_name = "PURPOSE", value_enum, default_value_t)]
    preset: PresetChoice,
    /// Method, see below
    #[arg(long, value_name = "METHOD", value_enum, default_value_t)]
    method: MethodChoice,
    /// Last least-squares step towards the original
    #[arg(long, value_name = "WHEN", value_enum, default_value_t)]
    fit: FitChoice,
    /// Where a merged vertex goes; `endpoint` keeps a subset of the vertices
    #[arg(long, value_name = "WHERE", value_enum, default_value_t)]
    placement: PlacementChoice,
    /// Open borders: held in place, moved along themselves, untouched, no care [default: keep, or by preset]
    #[arg(long, value_name = "CARE", value_enum)]
    border: Option<BorderChoice>,
    /// Topology: no new defects; nothing changes at all; handles are cut and parts go where that is cheapest [default:
    /// relaxed, or by preset]
    #[arg(long, value_name = "CARE", value_enum)]
    topology: Option<TopologyChoice>,
    /// How much an attribute counts, times what it counts by itself: normal, uv, color, morph, other; or the
    /// lines of open borders: border; may be repeated
    #[arg(long, value_name = "NAME=W", value_parser = values::weight)]
    weight: Vec<(AttributeName, f64)>,
    /// Leave this alone, to the bit: a material, group, object, mesh or node, or the vertices where this attribute is
    /// not zero; may be repeated
    #[arg(long, value_name = "NAME")]
    pub(crate) lock: Vec<String>,
    /// Keep more triangles where this attribute of vertices is large: at 1, or at the largest value if that is above 1,
    /// STRENGTH times as many per area as at 0 [default STRENGTH: 4]
    #[arg(long, value_name = "NAME[=STRENGTH]", value_parser = values::importance)]
    pub(crate) importance: Option<Importance>,
    /// Join vertices closer than this first; equal ones always are
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    weld: Option<TypedLength>,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Guards of the result")]
pub(super) struct GuardArgs {
    /// Largest turn of a face in one step
    #[arg(long, value_name = "DEG", value_parser = values::turn_deg)]
    max_normal: Option<f64>,
    /// Least shape of a new face, from 0 to 1 (equilateral)
    #[arg(long, value_name = "Q", value_parser = values::quality)]
    min_quality: Option<f64>,
    /// Most edges at a vertex
    #[arg(long, value_name = "N", value_parser = values::valence)]
    max_valence: Option<usize>,
    /// Longest edge
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    max_edge: Option<TypedLength>,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Deviation")]
struct Deviation {
    /// Measure the result against the input, both ways; always done with --error
    #[arg(long)]
    measure: bool,
    /// What is promised of the deviation [default: two-sided with --error, else estimate]
    #[arg(long, value_name = "BOUND", value_enum)]
    bound: Option<Bound>,
}

/// What is promised of the deviation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Bound {
    Estimate,
    TwoSided,
}

/// An attribute, or else, that `--weight` names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AttributeName {
    Normal,
    Uv,
    Color,
    Morph,
    Other,
    Border,
}

impl AttributeName {
    pub(crate) const ALL: [(&str, Self); 6] = [
        ("normal", Self::Normal),
        ("uv", Self::Uv),
        ("color", Self::Color),
        ("morph", Self::Morph),
        ("other", Self::Other),
        ("border", Self::Border),
    ];

    pub(super) fn of(self, weights: &mut AttributeWeights) -> &mut f64 {
        match self {
            Self::Normal => &mut weights.normal,
            Self::Uv => &mut weights.uv,
            Self::Color => &mut weights.color,
            Self::Morph => &mut weights.morph,
            Self::Other => &mut weights.other,
            Self::Border => &mut weights.border,
        }
    }
}

/// An attribute of vertices, and how much denser the result is where it is 1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Importance {
    pub(crate) name: String,
    pub(crate) strength: f32,
}

/// Normals of the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Normals {
    Keep,
    Recompute,
    None,
}

impl SimplifyArgs {
    /// Where the inputs go.
    pub(crate) fn wanted(&self) -> Wanted<'_> {
        Wanted {
            inputs: &self.inputs,
            output: self.output.as_ref(),
            out_dir: self.out_dir.as_deref(),
            name: &self.name,
            from: self.from,
            to: self.writing.to,
            json: self.json,
            dry_run: self.dry_run,
        }
    }

    /// What the engine is told.
    pub(crate) fn options(&self) -> SimplifyOptions {
        let shared = Shared {
            how: &self.how,
            of_method: &self.of_method,
            scope: &self.scope,
            guards: &self.guards,
            seed: self.seed,
        };
        let mut options = shared.options(self.target.stop());
        let is_measured = self.deviation.measure || self.is_bounded();
        options.measure = if is_measured { Measure::Always } else { Measure::default() };
        options
    }

    /// Whether a run comes to an end: by a target, or by what the method was told.
    pub(crate) fn has_end(&self) -> bool {
        let options = self.options();
        self.target.is_given() || options.of_method.ends(options.method)
    }

    /// Whether each mesh has a target of its own.
    pub(crate) fn is_per_mesh(&self) -> bool {
        self.scope.per_mesh
    }

    /// Whether the deviation is promised, not only estimated.
    pub(crate) fn is_bounded(&self) -> bool {
        match self.deviation.bound {
            Some(bound) => bound == Bound::TwoSided,
            None => self.target.error.is_some(),
        }
    }
}

/// What commands share that make meshes lighter.
pub(super) struct Shared<'a> {
    pub(super) how: &'a How,
    pub(super) of_method: &'a OfMethod,
    pub(super) scope: &'a Scope,
    pub(super) guards: &'a GuardArgs,
    pub(super) seed: u64,
}

impl Shared<'_> {
    /// What the engine is told, to come to this stop.
    pub(super) fn options(&self, stop: Stop) -> SimplifyOptions {
        let (how, guards) = (self.how, self.guards);
        let mut options = SimplifyOptions::preset(how.preset.into(), stop);
        options.method = how.method.into();
        options.of_method = self.of_method.options();
        options.fit = how.fit.into();
        options.placement = how.placement.into();
        options.border = how.border.map_or(options.border, Into::into);
        options.topology = how.topology.map_or(options.topology, Into::into);
        for (name, weight) in &how.weight {
            *name.of(&mut options.weights) = *weight;
        }
        options.weld = how.weld.as_ref().map(|d| d.length).or(options.weld);
        options.guards = Guards {
            max_normal_deg: guards.max_normal,
            min_quality: guards.min_quality,
            max_valence: guards.max_valence,
            max_edge: guards.max_edge.as_ref().map(|d| d.length),
        };
        self.scope.apply(&mut options);
        options.seed = self.seed;
        options
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;
    use lodsmith::{BorderPolicy, Length, Preset, TopologyPolicy};

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
        for (word, preset) in [
            ("scan", Preset::Scan),
            ("cad", Preset::Cad),
            ("visual", Preset::Visual),
            ("print", Preset::Print),
        ] {
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
    }

    #[test]
    fn defaults_in_the_help_are_those_of_the_engine() {
        let words = [BorderChoice::default().to_string(), TopologyChoice::default().to_string()];
        assert_eq!(words, ["keep", "relaxed"]);
    }
}
