//! Voxel remeshing: a closed surface around any input, from an inside test at grid points.
//!
//! ```text
//! flip faces so that neighbours agree, closed components outward
//! for each component: does the winding number jump across its faces like across the faces of a solid?
//!     yes: a point is inside if its winding number is above 0.5
//!     no (open sheets, soup): thicken the faces; a point is inside if a flood fill from outside does not reach it
//! starting from the cells at the faces, follow the boundary of the inside; add points where it is ambiguous
//! one vertex per cell, placed by the planes of the nearest faces, clamped to its cell
//! more faces than wanted: collapse, preserving the topology if possible
//! ```

mod extract;
mod winding;

use std::collections::{HashMap, HashSet};

use glam::{DMat3, DVec3};
use lodsmith_core::geometry::triangle::nearest;
use lodsmith_core::measure::chunks;
use lodsmith_core::spatial::Bvh;
use lodsmith_core::spatial::bvh::Hint;
use lodsmith_core::topology::Topology;
use lodsmith_core::{FaceId, Positions, PositionsView, Surface, TriMesh, VertexId};

use self::extract::{CORNERS, GridCoord, SIDES, disambiguating_corners, plus, quads};
use self::winding::WindingTree;
use crate::SimplifyError;
use crate::clean::orient;
use crate::collapse::order::NONE;
use crate::control::{Control, Verdict};
use crate::input::Input;
use crate::methods::task::{Ending, RebuiltSurface, Task};
use crate::options::{Length, SimplifyOptions, Stop, TopologyPolicy};
use crate::report::StoppedBy;
use crate::run::run_collapses;

/// Maximum number of cells that the surface may pass through: about 400 bytes each at the peak.
const MAX_CELLS: f64 = 8e6;
/// Maximum number of grid points of the flood fill: two bits each.
const MAX_POINTS: f64 = 4e9;
/// Maximum number of faces sampled to classify a component as solid.
const MAX_SOLID_SAMPLES: usize = 4000;
/// A component is solid if the winding number in front of this share of its area is near an integer.
const MIN_SOLID_SHARE: f64 = 0.9;
/// Tolerance of that. In the middle of a flat sheet the winding number is off by a half, near a hole as wide
/// as it is far away by about 0.15.
const INTEGER_TOLERANCE: f64 = 0.25;
/// Sheets are thickened by this many voxels on each side: more than a half, so that the flood fill cannot
/// pass through; holes up to one and a half voxels wide are closed.
const SHEET_THICKNESS: f64 = 0.75;
/// Vertices keep this distance, in voxels, from the sides of their cells, so that no two coincide.
const CELL_MARGIN: f64 = 0.02;
/// Weight of the mean position relative to each plane. Guessed.
const MEAN_WEIGHT: f64 = 0.05;

/// The voxel grid, in the unit frame.
struct VoxelGrid {
    origin: DVec3,
    h: f64,
    size: GridCoord,
}

impl VoxelGrid {
    fn point(&self, at: GridCoord) -> DVec3 {
        self.origin + self.h * DVec3::new(f64::from(at[0]), f64::from(at[1]), f64::from(at[2]))
    }
    fn cell(&self, p: DVec3) -> GridCoord {
        ((p - self.origin) / self.h).floor().to_array().map(|x| x as i32)
    }
}

type FaceCorners = [DVec3; 3];

pub(super) fn make(
    task: &Task<'_>,
    voxel: Length,
    control: &mut dyn Control,
) -> Result<RebuiltSurface, SimplifyError> {
    let prepared = task.input;
    let h = prepared.length(voxel);
    let mut ask = |done: f64| match control.progress(done) {
        Verdict::Cancel => Err(SimplifyError::Cancelled),
        Verdict::Continue | Verdict::Finish => Ok(()),
    };
    let places: Vec<[f64; 3]> = prepared.points.iter().map(|p| p.to_array()).collect();
    let mut faces = prepared.faces.clone();
    let turned = orient::faces_to_flip(&Surface::new(PositionsView::F64(&places), &faces)?);
    faces.iter_mut().zip(turned).filter(|x| x.1).for_each(|x| x.0.swap(1, 2));
    let surface = Surface::new(PositionsView::F64(&places), &faces)?;
    let corners: Vec<FaceCorners> = faces.iter().map(|t| t.map(|v| prepared.points[v.index()])).collect();
    let area: f64 = corners.iter().map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum();
    let too_fine = |limit: &'static str| SimplifyError::BadOption {
        option: "voxel",
        wanted: limit,
        got: prepared.frame.user_length(h),
    };
    const CELLS: &str = "longer: the surface may pass through 8 million cells at most";
    const POINTS: &str = "longer: round open sheets the grid may have 4 billion points at most";
    // A surface passes through 1.5 cells per h² of its area (measured: 1 to 1.7), a thickened one through
    // twice as many.
    let perimeter: f64 = 2.0 / h;
    if area / (h * h) > MAX_CELLS || perimeter * perimeter * perimeter > 1e18 {
        return Err(too_fine(CELLS));
    }
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for p in corners.iter().flatten() {
        (min, max) = (min.min(*p), max.max(*p));
    }
    // The offset keeps grid points off axis-aligned faces: a point on a face is neither inside nor outside.
    let origin = min - DVec3::splat(3.37 * h);
    let size = ((max - origin) / h + 4.0).ceil().to_array().map(|x| x as i32);
    let grid = VoxelGrid { origin, h, size };
    ask(0.05)?;

    let is_solid = solid_faces(&surface, &corners, h);
    let pick = |solid: bool| -> Vec<FaceCorners> {
        corners.iter().zip(&is_solid).filter(|x| *x.1 == solid).map(|x| *x.0).collect()
    };
    let (solid, sheets) = (pick(true), pick(false));
    let mut seeds: Vec<GridCoord> = Vec::new();
    for_cells_near(&grid, &solid, 0.9 * h, |cell, _| seeds.push(cell));
    let flood = if sheets.is_empty() {
        Flood::none()
    } else {
        if grid.size.iter().map(|&n| f64::from(n)).product::<f64>() > MAX_POINTS {
            return Err(too_fine(POINTS));
        }
        for_cells_near(&grid, &sheets, (SHEET_THICKNESS + 0.9) * h, |cell, _| seeds.push(cell));
        Flood::new(&grid, &sheets, &mut ask)?
    };
    seeds.sort_unstable();
    seeds.dedup();
    ask(0.2)?;
    let tree = WindingTree::new(solid);
    let is_inside = |at: GridCoord| flood.holds(at) || tree.at(grid.point(at)) > 0.5;
    let (cells, signs) = follow_boundary(seeds, is_inside, || too_fine(CELLS), &mut ask)?;
    ask(0.6)?;

    let points = place_vertices(&grid, &cells, &signs, &Bvh::new(&surface), &corners);
    let quads = quads(&cells, &signs);
    let mut split = Vec::with_capacity(quads.len() * 2);
    for [a, b, c, d] in quads {
        let length = |u: VertexId, v: VertexId| points[u.index()].distance_squared(points[v.index()]);
        if length(a, c) <= length(b, d) {
            split.extend([[a, b, c], [a, c, d]]);
        } else {
            split.extend([[b, c, d], [b, d, a]]);
        }
    }
    ask(0.65)?;
    collapse_to_goal(task, voxel, points, split, control)
}

/// Returns for each face whether its component bounds a solid.
fn solid_faces(surface: &Surface<'_>, corners: &[FaceCorners], h: f64) -> Vec<bool> {
    let parts = Topology::unwelded(surface).components();
    let mut is_solid = vec![false; corners.len()];
    let mut of_part: Vec<Vec<usize>> = vec![Vec::new(); parts.count()];
    for f in 0..corners.len() {
        if let Some(part) = parts.of_face(FaceId::new(f)) {
            of_part[part].push(f);
        }
    }
    for faces in of_part {
        let tree = WindingTree::new(faces.iter().map(|&f| corners[f]).collect());
        let asked: Vec<usize> =
            faces.iter().copied().step_by(faces.len().div_ceil(MAX_SOLID_SAMPLES).max(1)).collect();
        let sums = chunks::map(asked.len(), |range| {
            let (mut good, mut all) = (0.0, 0.0);
            for &f in &asked[range] {
                let [a, b, c] = corners[f];
                let normal = (b - a).cross(c - a);
                let area = normal.length();
                let (middle, off) = ((a + b + c) / 3.0, normal.normalize_or_zero() * (1e-3 * h));
                let (front, back) = (tree.at(middle + off), tree.at(middle - off));
                all += area;
                let is_whole = (front - front.round()).abs() <= INTEGER_TOLERANCE && front.round() >= 0.0;
                // Two sheets back to back have no inside between them.
                good += if is_whole && back - front > 0.5 { area } else { 0.0 };
            }
            (good, all)
        });
        let (good, all) = sums.iter().fold((0.0, 0.0), |x, y| (x.0 + y.0, x.1 + y.1));
        if good >= MIN_SOLID_SHARE * all && all > 0.0 {
            faces.iter().for_each(|&f| is_solid[f] = true);
        }
    }
    is_solid
}

/// Calls `call` for each cell whose centre lies within a distance of a face; it may be called several times
/// for a cell.
fn for_cells_near(
    grid: &VoxelGrid,
    faces: &[FaceCorners],
    within: f64,
    mut call: impl FnMut(GridCoord, DVec3),
) {
    let half = DVec3::splat(0.5 * grid.h);
    let mut stack: Vec<FaceCorners> = Vec::new();
    for &face in faces {
        stack.push(face);
        while let Some(t) = stack.pop() {
            let [a, b, c] = t;
            let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
            if longest > 16.0 * grid.h * grid.h {
                // Bisected at the longest edge: a needle becomes a row of triangles instead of a cluster.
                let [a, b, c] = if a.distance_squared(b) == longest {
                    [a, b, c]
                } else if b.distance_squared(c) == longest {
                    [b, c, a]
                } else {
                    [c, a, b]
                };
                let m = (a + b) / 2.0;
                stack.extend([[a, m, c], [m, b, c]]);
                continue;
            }
            let low = grid.cell(a.min(b).min(c) - DVec3::splat(within) - half);
            let high = grid.cell(a.max(b).max(c) + DVec3::splat(within) - half);
            for x in low[0]..=high[0] + 1 {
                for y in low[1]..=high[1] + 1 {
                    for z in low[2]..=high[2] + 1 {
                        let middle = grid.point([x, y, z]) + half;
                        if nearest(middle, t).distance_sq <= within * within {
                            call([x, y, z], middle);
                        }
                    }
                }
            }
        }
    }
}

/// Grid points that a flood fill from outside does not reach.
struct Flood {
    size: [usize; 3],
    /// Bit set of the points that the flood fill reached.
    is_out: Vec<u64>,
}

impl Flood {
    fn none() -> Self {
        Self { size: [0; 3], is_out: Vec::new() }
    }

    fn new(
        grid: &VoxelGrid,
        sheets: &[FaceCorners],
        ask: &mut dyn FnMut(f64) -> Result<(), SimplifyError>,
    ) -> Result<Self, SimplifyError> {
        let size = grid.size.map(|n| n as usize);
        let words = (size[0] * size[1] * size[2]).div_ceil(64);
        let mut this = Self { size, is_out: vec![0; words] };
        let mut blocked = vec![0u64; words];
        // The points are the cell centres of a grid shifted by half a voxel.
        let moved = VoxelGrid { origin: grid.origin - DVec3::splat(0.5 * grid.h), ..*grid };
        for_cells_near(&moved, sheets, SHEET_THICKNESS * grid.h, |at, _| {
            if let Some(i) = this.index(at) {
                blocked[i / 64] |= 1 << (i % 64);
            }
        });
        let mut stack = vec![[0; 3]];
        this.is_out[0] |= 1;
        let mut steps = 0u64;
        while let Some(at) = stack.pop() {
            steps += 1;
            if steps.is_multiple_of(1 << 20) {
                ask(0.1)?;
            }
            for (_, step) in SIDES {
                let next = plus(at, step);
                let Some(i) = this.index(next) else { continue };
                let bit = 1 << (i % 64);
                if (blocked[i / 64] | this.is_out[i / 64]) & bit == 0 {
                    this.is_out[i / 64] |= bit;
                    stack.push(next);
                }
            }
        }
        Ok(this)
    }

    fn index(&self, at: GridCoord) -> Option<usize> {
        let is_there = (0..3).all(|k| at[k] >= 0 && (at[k] as usize) < self.size[k]);
        is_there.then(|| (at[2] as usize * self.size[1] + at[1] as usize) * self.size[0] + at[0] as usize)
    }

    fn holds(&self, at: GridCoord) -> bool {
        self.index(at).is_some_and(|i| self.is_out[i / 64] >> (i % 64) & 1 == 0)
    }
}

type CellsAndSigns = (Vec<GridCoord>, HashMap<GridCoord, bool>);

/// Collects the cells through which the boundary of the inside passes, in order, and the signs of their
/// corners.
fn follow_boundary(
    seeds: Vec<GridCoord>,
    is_inside: impl Fn(GridCoord) -> bool + Sync,
    too_fine: impl Fn() -> SimplifyError,
    ask: &mut dyn FnMut(f64) -> Result<(), SimplifyError>,
) -> Result<CellsAndSigns, SimplifyError> {
    let mut signs: HashMap<GridCoord, bool> = HashMap::new();
    let mut seen: HashSet<GridCoord> = HashSet::new();
    let mut front = seeds;
    let mut mixed: Vec<GridCoord> = Vec::new();
    while !front.is_empty() {
        ask(0.3)?;
        front.sort_unstable();
        front.dedup();
        let mut corners: Vec<GridCoord> = front.iter().flat_map(|&c| CORNERS.map(|o| plus(c, o))).collect();
        corners.retain(|c| !signs.contains_key(c));
        corners.sort_unstable();
        corners.dedup();
        let found = chunks::map(corners.len(), |range| {
            corners[range].iter().map(|&c| is_inside(c)).collect::<Vec<bool>>()
        });
        signs.extend(corners.iter().copied().zip(found.into_iter().flatten()));
        let mut next = Vec::new();
        let mut at = 0;
        // The list grows during the loop: an added point changes the cells around it.
        while let Some(&cell) = front.get(at) {
            at += 1;
            seen.insert(cell);
            let mask = (0..8).fold(0u8, |m, k| m | u8::from(signs[&plus(cell, CORNERS[k])]) << k);
            let more = disambiguating_corners(mask);
            for k in (0..8).filter(|k| more >> k & 1 == 1) {
                let point = plus(cell, CORNERS[k]);
                signs.insert(point, true);
                for o in CORNERS {
                    let near = [0, 1, 2].map(|k| point[k] - o[k]);
                    let is_known = CORNERS.iter().all(|&o| signs.contains_key(&plus(near, o)));
                    if is_known { front.push(near) } else { next.push(near) }
                }
            }
            let mask = mask | more;
            if matches!(mask, 0 | 0xFF) {
                continue;
            }
            mixed.push(cell);
            for (side, step) in SIDES {
                let count: u8 = side.iter().map(|&c| mask >> c & 1).sum();
                let beyond = plus(cell, step);
                if !matches!(count, 0 | 4) && !seen.contains(&beyond) {
                    next.push(beyond);
                }
            }
            if mixed.len() as f64 > 4.0 * MAX_CELLS {
                return Err(too_fine());
            }
        }
        front = next;
    }
    mixed.sort_unstable();
    mixed.dedup();
    // Points added later may have made a cell uniform.
    mixed.retain(|&cell| {
        let inside = CORNERS.iter().filter(|&&o| signs[&plus(cell, o)]).count();
        !matches!(inside, 0 | 8)
    });
    Ok((mixed, signs))
}

/// Places one vertex per cell: near the planes of the faces nearest to the crossed edges, clamped to the
/// cell.
fn place_vertices(
    grid: &VoxelGrid,
    cells: &[GridCoord],
    signs: &HashMap<GridCoord, bool>,
    tree: &Bvh,
    corners: &[FaceCorners],
) -> Vec<DVec3> {
    let reach = 2.0 * grid.h;
    let all = chunks::map(cells.len(), |range| {
        let mut hint = Hint::default();
        let mut place = |cell: GridCoord| {
            let middle = grid.point(cell) + DVec3::splat(0.5 * grid.h);
            let (mut a, mut b, mut mean, mut count) = (DMat3::ZERO, DVec3::ZERO, DVec3::ZERO, 0.0);
            for k in 0..8 {
                for axis in (0..3).filter(|axis| k >> axis & 1 == 0) {
                    let (p, q) = (plus(cell, CORNERS[k]), plus(cell, CORNERS[k | 1 << axis]));
                    if signs[&p] == signs[&q] {
                        continue;
                    }
                    let on_edge = (grid.point(p) + grid.point(q)) / 2.0;
                    count += 1.0;
                    let Some(hit) = tree.closest_within(on_edge.to_array(), reach, &mut hint) else {
                        mean += on_edge - middle;
                        continue;
                    };
                    let [x, y, z] = corners[hit.face.index()];
                    let (near, normal) = (DVec3::from(hit.point) - middle, (y - x).cross(z - x));
                    let normal = normal.normalize_or_zero();
                    mean += near;
                    a += DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
                    b += normal * normal.dot(near);
                }
            }
            mean /= f64::max(count, 1.0);
            let pull = MEAN_WEIGHT * f64::max(count, 1.0);
            let x = (a + DMat3::from_diagonal(DVec3::splat(pull))).inverse() * (b + pull * mean);
            let half = (0.5 - CELL_MARGIN) * grid.h;
            let x = if x.is_finite() { x } else { mean };
            middle + x.clamp(DVec3::splat(-half), DVec3::splat(half))
        };
        cells[range].iter().map(|&c| place(c)).collect::<Vec<_>>()
    });
    all.into_iter().flatten().collect()
}

/// Returns the surface, collapsed to the goal if needed: never more faces than the input, if a closed surface
/// with so few exists.
fn collapse_to_goal(
    task: &Task<'_>,
    voxel: Length,
    points: Vec<DVec3>,
    faces: Vec<[VertexId; 3]>,
    control: &mut dyn Control,
) -> Result<RebuiltSurface, SimplifyError> {
    let made = |points: Vec<DVec3>, faces, steps, end| RebuiltSurface {
        kept: vec![NONE; points.len()],
        points,
        faces,
        steps,
        end,
        ..RebuiltSurface::default()
    };
    if faces.is_empty() {
        return Err(SimplifyError::BadOption {
            option: "voxel",
            wanted: "shorter: all of the input fits between the points of the grid",
            got: voxel.in_units(task.input.diagonal),
        });
    }
    let max_faces = task.input.origin.len();
    let by_faces = task.goal.faces;
    let is_over = |goal: Option<usize>, count: usize| goal.is_none_or(|n| count > n);
    let has_goal = by_faces.is_some() || task.goal.vertices.is_some();
    let wants_less = has_goal && is_over(by_faces, faces.len()) && is_over(task.goal.vertices, points.len());
    if !wants_less && faces.len() <= max_faces {
        let steps = faces.len() as u64;
        let end = if has_goal { Ending::Goal } else { Ending::Exhausted };
        return Ok(made(points, faces, steps, end));
    }
    let stop = Stop {
        faces: if has_goal && wants_less { by_faces.map(|n| n.min(max_faces)) } else { Some(max_faces) },
        vertices: task.goal.vertices.filter(|_| wants_less),
        ..Stop::default()
    };
    let mut options = SimplifyOptions::new(stop);
    options.topology = TopologyPolicy::Preserve;
    let mesh = TriMesh::new(Positions::F64(points.iter().map(|p| p.to_array()).collect()), faces)?;
    let input = Input::of_surface(mesh.surface());
    let (mut done, _) = run_collapses(&input, &options, control)?;
    if !done.report.reached && done.report.stopped_by != StoppedBy::Caller {
        // Cuts handles and drops components only if necessary; no borders are created.
        options.topology = TopologyPolicy::Relaxed;
        done = run_collapses(&input, &options, control)?.0;
    }
    let end = match done.report.stopped_by {
        StoppedBy::Caller => Ending::Finish,
        StoppedBy::Faces | StoppedBy::Vertices if has_goal => Ending::Goal,
        StoppedBy::Faces | StoppedBy::Vertices => Ending::Exhausted,
        _ => Ending::Stuck,
    };
    let points = done.mesh.positions().view().iter().map(DVec3::from).collect();
    let faces = bytemuck::cast_slice(done.mesh.triangles()).to_vec();
    let parts_removed = done.report.parts_removed;
    Ok(RebuiltSurface { parts_removed, ..made(points, faces, done.report.collapses, end) })
}
