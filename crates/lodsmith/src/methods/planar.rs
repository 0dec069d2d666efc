//! Planar decimation: re-triangulates regions of coplanar faces with as few triangles as their outline needs.
//!
//! ```text
//! regions: grown from large faces over manifold edges, while all faces are on one plane and attributes are linear
//! chains:  the borders of regions, from corner to corner; collinear vertices are dropped, for both sides at once
//! fill:    a constrained Delaunay triangulation of each region, from the rest of its outline
//! ```
//!
//! Regions as in [Hinker-Hansen 1993], with the bounds of [Kalvin-Taylor 1996]; chains by [Douglas-Peucker
//! 1973]; filling by [Chew 1989]. New here: shared borders, attributes as a criterion, and the fallbacks when
//! filling fails.
//!
//! If filling fails (the outline is not simple in its plane, an edge would be duplicated), a region keeps its
//! outline, and if that is not enough, all of its faces. The surface stays connected in any case: chains lose
//! vertices only if all regions along them are re-triangulated.

mod chains;
mod channels;
mod fill;
mod merge;
mod regions;

use glam::DVec3;
use lodsmith_core::{PositionsView, Surface, Topology, VertexId};

use crate::SimplifyError;
use crate::collapse::order::NONE;
use crate::control::Control;
use crate::methods::task::{Ending, PreparedInput, RebuiltSurface, Task};
use crate::options::{BorderPolicy, Length, Method, TopologyPolicy};
use chains::Chains;
use channels::Channels;
use merge::{Count, MergeInput, RegionMerge};
use regions::{RegionInput, Tolerance};

/// Default flatness tolerance, as a share of the diagonal: three times the rounding of single precision.
/// (Measured on ten models of machine parts: at a third of it, rounding splits the faces of one plane; at ten
/// times as much, curved sides start to merge.)
const DEFAULT_FLATNESS: f64 = 2e-7;
/// Far from the origin, where single precision rounds by more than that, the tolerance is this multiple of
/// the largest displacement of a vertex by rounding. (Measured on four machine parts, rotated, 0 to 10
/// diagonals from the origin, unchanged and subdivided three times with midpoints in single precision: at 2,
/// rounding still splits faces of one plane on two of them; from 3 on, on none.)
const ROUNDING_FACTOR: f64 = 3.0;
/// Default angle, as in Blender's limited dissolve.
const DEFAULT_ANGLE_DEG: f64 = 5.0;
/// Lower limit of the tolerance: the rounding of double precision, in the unit frame.
const MIN_FLATNESS: f64 = 1e-13;

/// Merges coplanar regions, largest savings first, until the goal is met or none is left.
///
/// The vertices of the result are vertices of the input. Distances both ways are at most about twice the
/// tolerance. In the last region before the goal, as many inner vertices are kept as the goal allows. Cost:
/// O(n log n).
pub(crate) fn make(task: &Task<'_>, control: &mut dyn Control) -> Result<RebuiltSurface, SimplifyError> {
    let prepared = task.input;
    let faces = &prepared.faces;
    let count = |n: Option<usize>| n.map_or(0, |n| i64::try_from(n).unwrap_or(i64::MAX));
    let goal = Count { faces: count(task.goal.faces), vertices: count(task.goal.vertices) };
    let all = Count { faces: faces.len() as i64, vertices: prepared.points.len() as i64 };
    if all.meets(goal) {
        let made = used(&prepared.points, faces.clone());
        return Ok(RebuiltSurface {
            stands_for: Some((0..faces.len()).collect()),
            end: Ending::Goal,
            ..made
        });
    }
    let positions = PositionsView::F64(bytemuck::cast_slice(&prepared.points));
    let topology = Topology::unwelded(&Surface::with_triangles(positions, faces.clone())?);
    let tolerance = tolerance(task);
    let flat = prepared.frame.user_length(tolerance.flat);
    let channels = Channels::new(task.mesh, prepared, &task.options.weights, flat);
    let is_locked = |v: VertexId| prepared.locked.as_ref().is_some_and(|l| l[v.index()]);
    let field = RegionInput {
        points: &prepared.points,
        faces,
        topology: &topology,
        channels: &channels,
        given: prepared.regions.as_deref(),
        is_fixed: &|f| faces[f].iter().all(|&v| is_locked(v)),
        tolerance,
    };
    let regions = regions::grow(&field, control)?;
    let keeps_border = task.options.border == BorderPolicy::Lock;
    let is_held = |v: VertexId| is_locked(v) || keeps_border && topology.vertex(v).is_on_border();
    let (chains, places) = Chains::new(&topology, &regions, &prepared.points, is_held, tolerance.flat);
    let before = MergeInput {
        points: &prepared.points,
        faces,
        topology: &topology,
        regions: &regions,
        chains: &chains,
        places: &places,
        is_locked: &is_locked,
        noise: tolerance.noise,
        may_close: task.options.topology != TopologyPolicy::Preserve,
    };
    let merged = RegionMerge::new(before).run(goal, all, control)?;
    let made = used(&prepared.points, merged.faces);
    let left = Count { faces: made.faces.len() as i64, vertices: made.points.len() as i64 };
    let end = match () {
        () if left.meets(goal) => Ending::Goal,
        () if merged.is_over || regions.is_over => Ending::Finish,
        () => Ending::Exhausted,
    };
    Ok(RebuiltSurface {
        stands_for: Some(merged.stands_for),
        end,
        steps: merged.filled,
        refusals: merged.refusals,
        ..made
    })
}

/// Builds a result from faces over input vertices, with the vertices that they use.
fn used(points: &[DVec3], faces: Vec<[VertexId; 3]>) -> RebuiltSurface {
    let mut number = vec![NONE; points.len()];
    for v in faces.iter().flatten() {
        number[v.index()] = VertexId(0);
    }
    let mut made = RebuiltSurface::default();
    for (v, number) in number.iter_mut().enumerate().filter(|x| *x.1 != NONE) {
        *number = VertexId::new(made.points.len());
        made.points.push(points[v]);
        made.kept.push(VertexId::new(v));
    }
    made.faces = faces.into_iter().map(|t| t.map(|v| number[v.index()])).collect();
    made
}

fn tolerance(task: &Task<'_>) -> Tolerance {
    let Method::Planar { angle_deg, flat } = task.options.method else {
        unreachable!("the method is planar")
    };
    let of_size = task.input.length(Length::OfDiagonal(DEFAULT_FLATNESS));
    // Far from the origin, single precision rounds by more than that share of the size.
    let noise = of_size.max(ROUNDING_FACTOR * rounding(task.input));
    // An error limit is a tolerance too, and the only one if no other tolerance is given.
    let flat = match (flat.map(|l| task.input.length(l)), task.step) {
        (Some(flat), Some(step)) => flat.min(step),
        (flat, step) => flat.or(step).unwrap_or(noise),
    };
    let angle_deg = angle_deg.unwrap_or(DEFAULT_ANGLE_DEG);
    let angle_deg = task.options.guards.max_normal_deg.map_or(angle_deg, |max| angle_deg.min(max)).min(89.0);
    let flat = flat.max(MIN_FLATNESS);
    Tolerance { flat, angle_rad: angle_deg.to_radians(), noise: noise.min(flat) }
}

/// Largest displacement of a vertex by rounding to the precision of the input, in the unit frame: half a unit
/// in the last place of the largest coordinate, along all three axes. 0 for double precision, where [`DEFAULT_FLATNESS`]
/// is far above it.
fn rounding(prepared: &PreparedInput) -> f64 {
    if !prepared.is_single {
        return 0.0;
    }
    let (low, high) = prepared
        .points
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let [low, high] = [low, high].map(|p| prepared.frame.user_from_unit(p).map(f64::abs));
    let half_unit = |x: f64| {
        let exponent = (x.to_bits() >> 52) as i32 - 1023;
        2f64.powi(exponent.clamp(f32::MIN_EXP - 1, f32::MAX_EXP) - f32::MANTISSA_DIGITS as i32)
    };
    let moved = DVec3::from_array([0, 1, 2].map(|k| half_unit(low[k].max(high[k]))));
    prepared.frame.unit_length(moved.length())
}
