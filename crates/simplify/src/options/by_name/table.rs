//! The table of the options.

use super::entry::{NamedOption, OptionKind};
use super::value::OptionValue;
use crate::options::{
    AttributeWeights, BorderPolicy, Bound, Fit, Length, Measure, Method, Placement, Preset, SimplifyOptions,
    Stop, TopologyPolicy,
};

/// Returns the names of all values of an enum, for a constant.
macro_rules! names_of {
    ($choice:ident) => {{
        const NAMES: [&str; $choice::ALL.len()] = {
            let mut names = [""; $choice::ALL.len()];
            let mut i = 0;
            while i < names.len() {
                names[i] = $choice::ALL[i].name();
                i += 1;
            }
            names
        };
        OptionKind::Word(&NAMES)
    }};
}

/// Bounds that can be named: [`Bound::Auto`] is the absence of one.
const BOUNDS: [Bound; 3] = [Bound::Estimate, Bound::OneSided, Bound::TwoSided];
const BOUND_NAMES: [&str; 3] = [BOUNDS[0].name(), BOUNDS[1].name(), BOUNDS[2].name()];

fn none(_: &SimplifyOptions) -> Option<String> {
    None
}

/// Returns a length, or `None` for a length of zero, which turns the option off.
fn length_or_off(value: &OptionValue<'_>) -> Result<Option<Length>, String> {
    let is_zero = |l: &Length| matches!(l, Length::Units(0.0) | Length::OfDiagonal(0.0));
    value.length().map(|l| Some(l).filter(|l| !is_zero(l)))
}

fn set_preset(options: &mut SimplifyOptions, value: &OptionValue<'_>) -> Result<(), String> {
    *options = SimplifyOptions::preset(value.word(&Preset::ALL, Preset::name)?, Stop::default());
    Ok(())
}

fn set_weights(options: &mut SimplifyOptions, value: &OptionValue<'_>) -> Result<(), String> {
    for (name, factor) in value.weights()? {
        if !(factor.is_finite() && factor >= 0.0) {
            return Err(format!("the factor of {name} must be 0 or more, not {factor}"));
        }
        let AttributeWeights { normal, uv, color, morph, skin, other, border } = &mut options.weights;
        *match name {
            "normal" => normal,
            "uv" => uv,
            "color" => color,
            "morph" => morph,
            "skin" => skin,
            "other" => other,
            "border" => border,
            _ => {
                let names = "normal, uv, color, morph, skin, other, border";
                return Err(format!("names are {names}, not {name:?}"));
            }
        } = factor;
    }
    Ok(())
}

/// An entry whose value is stored as it is.
macro_rules! entry {
    ($name:literal, $kind:expr, $default:expr, |$o:ident, $v:ident| $place:expr => $value:expr, $help:literal) => {
        NamedOption {
            name: $name,
            kind: $kind,
            help: $help,
            default: $default,
            set: |$o, $v| {
                $place = $value;
                Ok(())
            },
        }
    };
}

/// All options of simplification that the command line has, in its order. Those that name parts of a file are not
/// among them: lists of vertices are [`SimplifyOptions::locked`] and [`SimplifyOptions::importance`].
pub const OPTIONS: &[NamedOption] = &[
    entry!("faces", OptionKind::Count, none, |o, v| o.stop.faces => Some(v.count(1)?),
        "Stop at this number of triangles."),
    entry!("vertices", OptionKind::Count, none, |o, v| o.stop.vertices => Some(v.count(1)?),
        "Stop at this number of vertices."),
    entry!("ratio", OptionKind::Ratio, none, |o, v| o.stop.ratio => Some(v.ratio()?),
        "Keep this fraction of the triangles."),
    entry!("error", OptionKind::Length, none, |o, v| o.stop.error => Some(v.length()?),
        "Keep the deviation below this distance."),
    NamedOption {
        name: "preset",
        kind: names_of!(Preset),
        help: "Set several options for a purpose; explicit options override it.",
        default: |_| Some(Preset::default().name().to_owned()),
        set: set_preset,
    },
    entry!("method", names_of!(Method), |o| Some(o.method.name().to_owned()),
        |o, v| o.method => v.word(&Method::ALL, Method::name)?, "Method of simplification."),
    entry!("fit", names_of!(Fit), |o| Some(o.fit.name().to_owned()),
        |o, v| o.fit => v.word(&Fit::ALL, Fit::name)?, "Fit the result to the original by least squares at the end."),
    entry!("placement", names_of!(Placement), |o| Some(o.placement.name().to_owned()),
        |o, v| o.placement => v.word(&Placement::ALL, Placement::name)?, "Position of a merged vertex."),
    entry!("border", names_of!(BorderPolicy), |o| Some(o.border.name().to_owned()),
        |o, v| o.border => v.word(&BorderPolicy::ALL, BorderPolicy::name)?, "Treatment of open borders."),
    entry!("topology", names_of!(TopologyPolicy), |o| Some(o.topology.name().to_owned()),
        |o, v| o.topology => v.word(&TopologyPolicy::ALL, TopologyPolicy::name)?,
        "Permitted changes of the topology."),
    entry!("sharp", OptionKind::Degrees, none, |o, v| o.sharp_deg => Some(v.number()?),
        "Preserve edges whose faces meet at more than this angle."),
    NamedOption {
        name: "weight",
        kind: OptionKind::Weights,
        help: "Multiply the weight of an attribute in the cost (normal, uv, color, morph, skin, other), or of open \
               borders (border).",
        default: none,
        set: set_weights,
    },
    entry!("weld", OptionKind::Length, none, |o, v| o.weld => length_or_off(v)?,
        "Merge vertices closer than this first; 0 turns off the weld of a preset."),
    entry!("prune", OptionKind::Length, none, |o, v| o.prune => length_or_off(v)?,
        "Remove connected parts smaller than this first."),
    entry!("per-mesh", OptionKind::Flag, none, |o, v| o.per_mesh => v.flag()?,
        "Apply the target to each mesh of a scene instead of the whole scene."),
    entry!("escalate", OptionKind::Flag, none, |o, v| o.escalate => v.flag()?,
        "If the target is not reached, try looser topology."),
    entry!("pairs", OptionKind::Length, none, |o, v| o.method_options.pairs => Some(v.length()?),
        "memoryless, quadric: also merge vertices closer than this that share no edge."),
    entry!("cell", OptionKind::Length, none, |o, v| o.method_options.cell => Some(v.length()?),
        "cluster: size of a cell."),
    entry!("two-stage", OptionKind::Flag, none, |o, v| o.method_options.two_stage => v.flag()?,
        "cluster: cluster to a multiple of the target first, then continue with memoryless."),
    entry!("edge-length", OptionKind::Length, none, |o, v| o.method_options.edge_length => Some(v.length()?),
        "shortest-edge: collapse edges up to this length; remesh: length of the new edges."),
    entry!("angle", OptionKind::Degrees, none, |o, v| o.method_options.angle_deg => Some(v.number()?),
        "planar: largest angle between a face and the plane of its region; vertex-removal, remesh: edges bent by \
         more are creases."),
    entry!("flat", OptionKind::Length, none, |o, v| o.method_options.flat => Some(v.length()?),
        "planar: largest distance from the plane of a region."),
    entry!("iterations", OptionKind::Count, none, |o, v| o.method_options.iterations => Some(v.count(1)?),
        "unsubdivide: maximum number of levels to undo; remesh: number of rounds."),
    entry!("voxel", OptionKind::Length, none, |o, v| o.method_options.voxel => Some(v.length()?),
        "remesh: size of a voxel; makes a closed surface around any input."),
    entry!("subdivisions", OptionKind::Count, none, |o, v| o.method_options.subdivisions => Some(v.count(1)?),
        "remesh: subdivide a base mesh this many times."),
    entry!("adaptive", OptionKind::Flag, none, |o, v| o.method_options.adaptive => v.flag()?,
        "remesh: use shorter edges where the surface is curved."),
    entry!("max-normal", OptionKind::Degrees, none, |o, v| o.guards.max_normal_deg => Some(v.number()?),
        "Reject steps that turn a face by more than this angle."),
    entry!("min-quality", OptionKind::Number, none, |o, v| o.guards.min_quality => Some(v.number()?),
        "Reject faces of lower quality than this, from 0 to 1 (equilateral), unless they were worse before."),
    entry!("max-valence", OptionKind::Count, none, |o, v| o.guards.max_valence => Some(v.count(3)?),
        "Reject vertices with more edges than this, unless they had more before."),
    entry!("max-edge", OptionKind::Length, none, |o, v| o.guards.max_edge => Some(v.length()?),
        "Reject longer edges than this, unless they were longer before."),
    entry!("seed", OptionKind::Seed, |o| Some(o.seed.to_string()), |o, v| o.seed => v.whole(0)?,
        "Seed of the samples; equal seeds give equal results."),
    entry!("measure", OptionKind::Flag, none,
        |o, v| o.measure => if v.flag()? { Measure::Always } else { Measure::Auto },
        "Measure the distance between the result and the input in both directions; always on with error."),
    entry!("bound", OptionKind::Word(&BOUND_NAMES), none, |o, v| o.bound => v.word(&BOUNDS, Bound::name)?,
        "Prove the largest distance: in both directions, or from the result to the input only; two-sided with \
         error, else estimate."),
];
