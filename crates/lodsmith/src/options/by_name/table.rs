//! The table of the options.

use std::borrow::Cow;

use super::entry::{NamedOption, OptionGroup, OptionKind, Range};
use super::value::{LengthRange, OptionValue};
use crate::options::{
    AttributeWeights, BorderPolicy, Bound, Effort, Fit, Measure, Method, MethodKind, Placement, Preset,
    Remesh, RemeshPattern, SimplifyOptions, Stop, TopologyPolicy,
};
use LengthRange::{FromZero, Positive, ZeroIsOff};
use OptionGroup::{Deviation, Guards, OfMethod, Simplification, Target};
use OptionKind::{Count, Degrees, Flag, Length, Number, Ratio, Seed, Weights};

/// Makes a constant list of the names of all values of an enum.
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

/// Bounds that can be given by name: [`Bound::Auto`] is the absence of one.
const BOUNDS: [Bound; 3] = [Bound::Estimate, Bound::OneSided, Bound::TwoSided];
const BOUND_NAMES: [&str; 3] = [BOUNDS[0].name(), BOUNDS[1].name(), BOUNDS[2].name()];

/// Efforts that can be given by name: [`Effort::Auto`] is that of a preset.
const EFFORTS: [Effort; 2] = [Effort::Default, Effort::Best];
const EFFORT_NAMES: [&str; 2] = [EFFORTS[0].name(), EFFORTS[1].name()];

const TURN: Range = Range {
    least: 0.0,
    most: 180.0,
    has_least: false,
    has_most: true,
    text: "above 0 and at most 180 degrees",
};
const SHARP: Range = Range {
    least: 0.0,
    most: 180.0,
    has_least: false,
    has_most: false,
    text: "above 0 and below 180 degrees",
};
const BEND: Range =
    Range { least: 0.0, most: 90.0, has_least: true, has_most: false, text: "from 0 to below 90 degrees" };
const QUALITY: Range = Range { least: 0.0, most: 1.0, has_least: true, has_most: true, text: "from 0 to 1" };

fn word(name: &'static str) -> Option<OptionValue<'static>> {
    Some(OptionValue::Text(Cow::Borrowed(name)))
}
fn count(n: Option<usize>) -> Option<OptionValue<'static>> {
    n.map(|n| OptionValue::Whole(n as u64))
}
fn number(x: Option<f64>) -> Option<OptionValue<'static>> {
    x.map(OptionValue::Number)
}
fn length(x: Option<crate::options::Length>) -> Option<OptionValue<'static>> {
    x.map(OptionValue::Length)
}
fn flag(is_on: bool) -> Option<OptionValue<'static>> {
    is_on.then_some(OptionValue::Flag(true))
}

/// Names of the attributes that have weights.
const WEIGHTS: [&str; 7] = ["normal", "uv", "color", "morph", "skin", "other", "border"];

/// Returns the weights in the order of their names.
fn weights(own: &mut AttributeWeights) -> [&mut f64; 7] {
    let AttributeWeights { normal, uv, color, morph, skin, other, border } = own;
    [normal, uv, color, morph, skin, other, border]
}

fn get_weights(options: &SimplifyOptions) -> Option<OptionValue<'static>> {
    let mut own = options.weights;
    let all = WEIGHTS.iter().zip(weights(&mut own));
    Some(OptionValue::Weights(all.map(|(name, factor)| (Cow::Borrowed(*name), *factor)).collect()))
}

fn set_weights(options: &mut SimplifyOptions, value: &OptionValue<'_>) {
    for (name, factor) in value.weights().into_iter().flatten() {
        let places = WEIGHTS.iter().zip(weights(&mut options.weights));
        places.filter(|(known, _)| **known == name).for_each(|(_, place)| *place = factor);
    }
}

/// Returns the pattern of a remesh, or the option that excludes another one.
fn pattern(
    options: &mut SimplifyOptions,
    excluded: impl Fn(&RemeshPattern) -> Option<&'static str>,
) -> Result<&mut RemeshPattern, &'static str> {
    match &mut options.method {
        Method::Remesh(Remesh::OnSurface { pattern, .. }) => excluded(pattern).map_or(Ok(pattern), Err),
        _ => Err("voxel"),
    }
}

fn set_voxel(options: &mut SimplifyOptions, value: &OptionValue<'_>) -> Result<(), &'static str> {
    let Method::Remesh(remesh) = &mut options.method else { return Ok(()) };
    match remesh {
        Remesh::OnSurface { edge_length: Some(_), .. } => return Err("edge-length"),
        Remesh::OnSurface { crease_deg: Some(_), .. } => return Err("angle"),
        Remesh::OnSurface { rounds: Some(_), .. } => return Err("iterations"),
        Remesh::OnSurface { pattern: RemeshPattern::Adaptive, .. } => return Err("adaptive"),
        Remesh::OnSurface { pattern: RemeshPattern::SemiRegular { .. }, .. } => return Err("subdivisions"),
        _ => {}
    }
    if let Some(size) = value.length() {
        *remesh = Remesh::Voxels { size };
    }
    Ok(())
}

/// Sets an option of a method. (Only the method `remesh` has options that exclude another one, `voxel`.)
macro_rules! of_method {
    ($options:ident, $pattern:pat => $place:expr, $value:expr) => {
        match &mut $options.method {
            $pattern => $place = $value,
            _ => return Err("voxel"),
        }
    };
}

/// Makes the table: for each option its name, kind, group, placeholder and help; the methods that have it, for an
/// option of single methods; an expression that reads it from options `o`, and one that sets it to a value `v` of its
/// kind.
macro_rules! options {
    ($($name:literal ($kind:expr) $group:ident $value:literal $help:literal $([$($method:ident)+])?
        |$o:ident| $get:expr, |$v:ident| $set:expr;)+) => {
        /// All options of simplification, in the order in which they are listed. Locks and importance, which refer to
        /// vertices of a mesh, are not among them: see [`MeshData`](crate::MeshData).
        pub const OPTIONS: &[NamedOption] = &[$(NamedOption {
            name: $name,
            kind: $kind,
            group: $group,
            value_name: $value,
            help: $help,
            methods: &[$($(MethodKind::$method),+)?],
            get: |$o| $get,
            set: |$o, $v| {
                $set;
                Ok(())
            },
        }),+];
    };
}

options! {
    "faces" (Count(1)) Target "N" "Stop at N triangles"
        |o| count(o.stop.faces), |v| o.stop.faces = v.count();
    "vertices" (Count(1)) Target "N" "Stop at N vertices"
        |o| count(o.stop.vertices), |v| o.stop.vertices = v.count();
    "ratio" (Ratio) Target "R" "Keep this fraction of the triangles (0.1 or 10%)"
        |o| number(o.stop.ratio), |v| o.stop.ratio = v.ratio();
    "error" (Length(FromZero)) Target "D"
        "Keep the deviation below D, in units of the file or as a share of the diagonal (0.1%)"
        |o| length(o.stop.error), |v| o.stop.error = v.length();

    "preset" (names_of!(Preset)) Simplification "PURPOSE"
        "Set several options for a purpose, see below; explicit options override it"
        |_o| word(Preset::Auto.name()), |v| *_o = SimplifyOptions::preset(v.word(&Preset::ALL, Preset::name)
            .unwrap_or_default(), Stop::default());
    "method" (names_of!(MethodKind)) Simplification "METHOD" "Simplification method, see below"
        |o| word(o.method.name()), |v| o.method = v.word(&MethodKind::ALL, MethodKind::name).unwrap_or_default().into();
    "fit" (names_of!(Fit)) Simplification "WHEN" "Fit the result to the original by least squares at the end"
        |o| word(o.fit.name()), |v| o.fit = v.word(&Fit::ALL, Fit::name).unwrap_or_default();
    "effort" (OptionKind::Word(&EFFORT_NAMES)) Simplification "EFFORT"
        "Work at a given count: one run (default), or several that bring the largest distance down (best)"
        |o| if o.effort == Effort::Auto { None } else { word(o.effort.name()) },
        |v| o.effort = v.word(&EFFORTS, Effort::name).unwrap_or_default();
    "placement" (names_of!(Placement)) Simplification "POSITION"
        "Position of a merged vertex: the position of least error, an end of the edge (the vertices are then a subset \
         of the vertices of the input), or the midpoint of the edge"
        |o| word(o.placement.name()), |v| o.placement = v.word(&Placement::ALL, Placement::name).unwrap_or_default();
    "border" (names_of!(BorderPolicy)) Simplification "POLICY"
        "Treatment of open borders: keep their shape, slide along them, lock them, or ignore them (free)"
        |o| word(o.border.name()), |v| o.border = v.word(&BorderPolicy::ALL, BorderPolicy::name).unwrap_or_default();
    "topology" (names_of!(TopologyPolicy)) Simplification "POLICY"
        "Permitted changes of the topology: remove parts and cut handles only if the target needs it (relaxed), never \
         (preserve), or wherever it costs least (free)"
        |o| word(o.topology.name()),
        |v| o.topology = v.word(&TopologyPolicy::ALL, TopologyPolicy::name).unwrap_or_default();
    "sharp" (Degrees(SHARP)) Simplification "DEG"
        "Preserve edges whose faces meet at more than DEG degrees [default: off]"
        |o| number(o.sharp_deg), |v| o.sharp_deg = v.number();
    "weight" (Weights(&WEIGHTS)) Simplification "NAME=W"
        "Multiply the weight of an attribute in the cost (normal, uv, color, morph, skin, other), or of the lines of \
         open borders (border), by W; may be repeated"
        |o| get_weights(o), |v| set_weights(o, v);
    "weld" (Length(ZeroIsOff)) Simplification "D"
        "Merge vertices closer than D first (coincident vertices are always merged); 0 turns off the weld of a preset"
        |o| length(o.weld), |v| o.weld = v.length_or_off();
    "prune" (Length(ZeroIsOff)) Simplification "SIZE"
        "Remove connected parts smaller than SIZE first (diagonal of their bounding box, in units of the file or as a \
         share of the diagonal: 0.1%)"
        |o| length(o.prune), |v| o.prune = v.length_or_off();
    "per-mesh" (Flag) Simplification "" "Apply the target to each mesh of a scene instead of the whole scene"
        |o| flag(o.per_mesh), |v| o.per_mesh = v.is_on();
    "escalate" (Flag) Simplification "" "If the target is not reached, try looser topology: relaxed, then free"
        |o| flag(o.escalate), |v| o.escalate = v.is_on();

    "pairs" (Length(Positive)) OfMethod "D"
        "memoryless, quadric: also merge vertices closer than D that share no edge, so that parts can grow together"
        [Memoryless Quadric]
        |o| length(o.method.pairs()),
        |v| of_method!(o, Method::Memoryless { pairs } | Method::Quadric { pairs } => *pairs, v.length());
    "cell" (Length(Positive)) OfMethod "D" "cluster: size of a cell" [Cluster]
        |o| match o.method { Method::Cluster { cell, .. } => length(cell), _ => None },
        |v| of_method!(o, Method::Cluster { cell, .. } => *cell, v.length());
    "two-stage" (Flag) OfMethod ""
        "cluster: cluster only to a multiple of the target, then continue with memoryless" [Cluster]
        |o| match o.method { Method::Cluster { two_stage, .. } => flag(two_stage), _ => None },
        |v| of_method!(o, Method::Cluster { two_stage, .. } => *two_stage, v.is_on());
    "edge-length" (Length(Positive)) OfMethod "D"
        "shortest-edge: collapse edges up to this length; remesh: length of the new edges" [ShortestEdge Remesh]
        |o| length(o.method.edge_length()),
        |v| of_method!(o, Method::ShortestEdge { edge_length }
            | Method::Remesh(Remesh::OnSurface { edge_length, .. }) => *edge_length, v.length());
    "angle" (Degrees(BEND)) OfMethod "DEG"
        "planar: largest angle between a face and the plane of its region [default: 5]; vertex-removal, remesh: edges \
         with a larger dihedral angle are creases"
        [Planar VertexRemoval Remesh]
        |o| match o.method {
            Method::Planar { angle_deg, .. } => number(angle_deg),
            _ => number(o.method.crease_deg()),
        },
        |v| of_method!(o, Method::Planar { angle_deg: angle, .. } | Method::VertexRemoval { crease_deg: angle }
            | Method::Remesh(Remesh::OnSurface { crease_deg: angle, .. }) => *angle, v.number());
    "flat" (Length(FromZero)) OfMethod "D"
        "planar: largest distance from the plane of a region [default: 0.00002%, or --error]" [Planar]
        |o| match o.method { Method::Planar { flat, .. } => length(flat), _ => None },
        |v| of_method!(o, Method::Planar { flat, .. } => *flat, v.length());
    "iterations" (Count(1)) OfMethod "N"
        "unsubdivide: largest number of levels to reverse; remesh: number of iterations" [Unsubdivide Remesh]
        |o| match o.method {
            Method::Unsubdivide { levels } => count(levels),
            _ => count(o.method.rounds()),
        },
        |v| of_method!(o, Method::Unsubdivide { levels: n }
            | Method::Remesh(Remesh::OnSurface { rounds: n, .. }) => *n, v.count());
    "voxel" (Length(Positive)) OfMethod "D" "remesh: size of a voxel; makes a closed surface around any input" [Remesh]
        |o| match o.method { Method::Remesh(Remesh::Voxels { size }) => length(Some(size)), _ => None },
        |v| set_voxel(o, v)?;
    "subdivisions" (Count(1)) OfMethod "N" "remesh: subdivide a base mesh N times" [Remesh]
        |o| match o.method {
            Method::Remesh(Remesh::OnSurface { pattern: RemeshPattern::SemiRegular { subdivisions }, .. }) => {
                count(Some(subdivisions))
            }
            _ => None,
        },
        |v| {
            let place = pattern(o, |own| (*own == RemeshPattern::Adaptive).then_some("adaptive"))?;
            *place = RemeshPattern::SemiRegular { subdivisions: v.count().unwrap_or(1) };
        };
    "adaptive" (Flag) OfMethod "" "remesh: use shorter edges where the surface is curved" [Remesh]
        |o| flag(o.method.is_adaptive()),
        |v| if v.is_on() {
            let is_semi_regular = |own: &RemeshPattern| matches!(own, RemeshPattern::SemiRegular { .. });
            *pattern(o, |own| is_semi_regular(own).then_some("subdivisions"))? = RemeshPattern::Adaptive;
        } else if o.method.is_adaptive() {
            *pattern(o, |_| None)? = RemeshPattern::Even;
        };

    "max-normal" (Degrees(TURN)) Guards "DEG"
        "Reject steps that rotate a face normal by more than DEG degrees; the final fit is one step"
        |o| number(o.guards.max_normal_deg), |v| o.guards.max_normal_deg = v.number();
    "min-quality" (Number(QUALITY)) Guards "Q"
        "Reject faces of lower quality than Q, from 0 to 1 (equilateral), unless they were worse before"
        |o| number(o.guards.min_quality), |v| o.guards.min_quality = v.number();
    "max-valence" (Count(3)) Guards "N" "Reject vertices with more than N edges, unless they had more before"
        |o| count(o.guards.max_valence), |v| o.guards.max_valence = v.count();
    "max-edge" (Length(Positive)) Guards "D" "Reject edges longer than D, unless they were longer before"
        |o| length(o.guards.max_edge), |v| o.guards.max_edge = v.length();

    "seed" (Seed) Simplification "N" "Seed of the samples; equal seeds give equal results"
        |o| Some(OptionValue::Whole(o.seed)), |v| o.seed = v.whole().unwrap_or_default();

    "measure" (Flag) Deviation ""
        "Measure the distance between the result and the input in both directions; always on with --error"
        |o| flag(o.measure == Measure::Always),
        |v| o.measure = if v.is_on() { Measure::Always } else { Measure::Auto };
    "bound" (OptionKind::Word(&BOUND_NAMES)) Deviation "BOUND"
        "Prove the largest distance: in both directions, or from the result to the input only [default: two-sided with \
         --error, else estimate]"
        |o| if o.bound == Bound::Auto { None } else { word(o.bound.name()) },
        |v| o.bound = v.word(&BOUNDS, Bound::name).unwrap_or_default();
}
