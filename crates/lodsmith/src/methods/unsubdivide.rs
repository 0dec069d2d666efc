//! Un-subdivision: replaces every four triangles that result from a midpoint subdivision by the original one.
//!
//! A component, connected across edges, is undone as a whole or not at all. Even vertices keep their
//! positions: midpoint subdivision is inverted exactly; for a smoothing scheme (Loop's) the connectivity is
//! restored, with vertices on the smooth surface.
//!
//! Source: [Taubin 2001]. There a mesh has one component; where several covers fit, as on regular grids, we
//! take the cover whose odd vertices lie nearest to the midpoints of their edges.

mod cover;

use glam::DVec3;
use lodsmith_core::geometry::triangle;
use lodsmith_core::mesh::defects::is_zero_area;
use lodsmith_core::topology::EdgeKind;
use lodsmith_core::{FaceId, HalfEdgeId, PositionsView, Surface, Topology, VertexId};

use crate::SimplifyError;
use crate::collapse::order::NONE;
use crate::control::{Control, Verdict};
use crate::methods::task::{Ending, PreparedInput, RebuiltSurface, Task};
use crate::options::{BorderPolicy, Method};
use crate::report::Refusal;
use cover::{Cover, CoverSearch};

/// Minimum number of faces processed between two progress calls.
const PROGRESS_EVERY: usize = 4096;

/// Undoes levels until the goal is met, the iterations are used up, or no component fits.
pub(crate) fn make(task: &Task<'_>, control: &mut dyn Control) -> Result<RebuiltSurface, SimplifyError> {
    let Method::Unsubdivide { levels } = task.options.method else {
        unreachable!("the method is unsubdivide")
    };
    let prepared = task.input;
    let mut level = SubdivisionLevel {
        faces: prepared.faces.clone(),
        // Each face represents itself at first.
        stands_for: (0..prepared.faces.len()).collect(),
    };
    let mut made = RebuiltSurface { end: Ending::Exhausted, ..RebuiltSurface::default() };
    for round in 0.. {
        if is_met(task, &level) {
            made.end = Ending::Goal;
            break;
        }
        if levels.is_some_and(|max| round == max) {
            break;
        }
        let undone = match level.undo(task, control)? {
            UndoResult::Undone(undone) => undone,
            UndoResult::Finish => {
                made.end = Ending::Finish;
                break;
            }
        };
        if round == 0 {
            made.refusals = undone.refusals;
        }
        made.steps += undone.tiles as u64;
        match undone.level {
            Some(next) => level = next,
            None => break,
        }
    }
    let mut number = vec![NONE; prepared.points.len()];
    level.faces.iter().flatten().for_each(|v| number[v.index()] = VertexId(0));
    for v in (0..number.len()).map(VertexId::new) {
        if number[v.index()] != NONE {
            number[v.index()] = VertexId::new(made.points.len());
            made.points.push(prepared.points[v.index()]);
            made.kept.push(v);
        }
    }
    made.faces = level.faces.iter().map(|t| t.map(|v| number[v.index()])).collect();
    made.stands_for = Some(level.stands_for);
    Ok(made)
}

fn is_met(task: &Task<'_>, level: &SubdivisionLevel) -> bool {
    let vertices = || {
        let mut is_used = vec![false; task.input.points.len()];
        level.faces.iter().flatten().for_each(|v| is_used[v.index()] = true);
        is_used.into_iter().filter(|u| *u).count()
    };
    task.goal.faces.is_some_and(|n| level.faces.len() <= n)
        || task.goal.vertices.is_some_and(|n| vertices() <= n)
}

/// Faces over the vertices of the prepared input.
struct SubdivisionLevel {
    faces: Vec<[VertexId; 3]>,
    stands_for: Vec<usize>,
}

enum UndoResult {
    Undone(Undone),
    /// The caller wants the result so far.
    Finish,
}

#[derive(Default)]
struct Undone {
    /// The coarser level, if any component fits.
    level: Option<SubdivisionLevel>,
    tiles: usize,
    /// Numbers of components left unchanged, by reason.
    refusals: [u64; Refusal::ALL.len()],
}

impl SubdivisionLevel {
    /// Returns the next coarser level, with every fitting component undone.
    fn undo(&self, task: &Task<'_>, control: &mut dyn Control) -> Result<UndoResult, SimplifyError> {
        let prepared = task.input;
        let points: Vec<[f64; 3]> = prepared.points.iter().map(|p| p.to_array()).collect();
        let surface = Surface::with_triangles(PositionsView::F64(&points), self.faces.clone())?;
        let topology = Topology::unwelded(&surface);
        let mut search = CoverSearch::new(&topology);
        let mut undone = Undone::default();
        let mut coarse = SubdivisionLevel { faces: Vec::new(), stands_for: Vec::new() };
        let (mut seen, mut looked) = (0, 0);
        for part in parts(&topology) {
            seen += part.len();
            if seen >= looked + PROGRESS_EVERY || looked == 0 {
                looked = seen;
                // The progress weighs each level by its faces; the first one is most of the work.
                let left = self.faces.len() as f64 / prepared.faces.len() as f64;
                let done = 1.0 - left * (1.0 - 0.75 * seen as f64 / self.faces.len() as f64);
                match control.progress(done.clamp(0.0, 1.0)) {
                    Verdict::Cancel => return Err(SimplifyError::Cancelled),
                    Verdict::Finish => return Ok(UndoResult::Finish),
                    Verdict::Continue => {}
                }
            }
            match self.best_cover(task, &topology, &mut search, &part) {
                Ok(cover) => {
                    undone.tiles += cover.tiles.len();
                    coarse.faces.extend(cover.tiles.iter().map(|t| t.even));
                    coarse.stands_for.extend(cover.tiles.iter().map(|t| self.stands_for[t.middle.index()]));
                }
                Err(why) => {
                    undone.refusals[why as usize] += 1;
                    coarse.faces.extend(part.iter().map(|f| self.faces[f.index()]));
                    coarse.stands_for.extend(part.iter().map(|f| self.stands_for[f.index()]));
                }
            }
        }
        if undone.tiles > 0 {
            // Components that touch in two vertices may get an edge there that already exists in the other.
            let after = Surface::with_triangles(PositionsView::F64(&points), coarse.faces.clone())?;
            if crowded_edges(&Topology::unwelded(&after)) > crowded_edges(&topology) {
                undone.refusals[Refusal::LinkCondition as usize] += 1;
                undone.tiles = 0;
            } else {
                undone.level = Some(coarse);
            }
        }
        Ok(UndoResult::Undone(undone))
    }

    /// Returns the cover of a component with the smallest misfit, or the reason why there is none.
    fn best_cover(
        &self,
        task: &Task<'_>,
        topology: &Topology,
        search: &mut CoverSearch<'_>,
        part: &[FaceId],
    ) -> Result<Cover, Refusal> {
        let mut why = Refusal::Pattern;
        let mut best: Option<(f64, Cover)> = None;
        for cover in search.covers(part) {
            match self.misfit(task, topology, part, &cover) {
                Ok(misfit) if best.as_ref().is_none_or(|b| misfit < b.0) => best = Some((misfit, cover)),
                Ok(_) => {}
                Err(reason) => why = reason,
            }
        }
        best.map(|b| b.1).ok_or(why)
    }

    /// Returns the sum of squared distances of the odd vertices from the midpoints of their edges, or the
    /// reason why the cover is not allowed.
    fn misfit(
        &self,
        task: &Task<'_>,
        topology: &Topology,
        part: &[FaceId],
        cover: &Cover,
    ) -> Result<f64, Refusal> {
        let prepared = task.input;
        let point = |v: VertexId| prepared.points[v.index()];
        if let Some(locked) = &prepared.locked
            && cover.odd.iter().any(|x| locked[x.0.index()])
        {
            return Err(Refusal::Locked);
        }
        if task.options.border == BorderPolicy::Lock {
            let sides = || part.iter().flat_map(|f| [0, 1, 2].map(|k| HalfEdgeId::new(3 * f.index() + k)));
            if sides().any(|h| topology.kind(h) == Some(EdgeKind::Border)) {
                return Err(Refusal::Border);
            }
        }
        if let Some(regions) = &prepared.regions {
            let region = |f: FaceId| regions[self.stands_for[f.index()]];
            let is_mixed = |middle: FaceId| {
                let sides = [0, 1, 2].map(|k| HalfEdgeId::new(3 * middle.index() + k));
                sides.iter().flat_map(|&h| topology.edge(h)).any(|h| region(h.face()) != region(middle))
            };
            if cover.tiles.iter().any(|t| is_mixed(t.middle)) {
                return Err(Refusal::Seam);
            }
        }
        if let Some(step) = task.step
            && cover.tiles.iter().any(|t| self.step_of(prepared, topology, t.middle, t.even) > step)
        {
            return Err(Refusal::ErrorLimit);
        }
        let is_flat = |t: [VertexId; 3]| is_zero_area(t.map(|v| point(v).to_array()));
        let flat_before = part.iter().filter(|f| is_flat(self.faces[f.index()])).count();
        if cover.tiles.iter().filter(|t| is_flat(t.even)).count() > flat_before {
            return Err(Refusal::Quality);
        }
        let from_middle = |x: &(VertexId, [VertexId; 2])| {
            let [a, b] = x.1.map(point);
            point(x.0).distance_squared((a + b) * 0.5)
        };
        Ok(cover.odd.iter().map(from_middle).sum())
    }

    /// Largest distance of the odd vertices of a tile from the triangle that replaces it.
    fn step_of(
        &self,
        prepared: &PreparedInput,
        topology: &Topology,
        middle: FaceId,
        even: [VertexId; 3],
    ) -> f64 {
        let corners: [DVec3; 3] = even.map(|v| prepared.points[v.index()]);
        let odd = topology.triangle(middle).map(|v| prepared.points[v.index()]);
        let far = odd.map(|p| triangle::nearest(p, corners).distance_sq);
        far.into_iter().fold(0.0, f64::max).sqrt()
    }
}

/// Edges with more than two faces.
fn crowded_edges(topology: &Topology) -> usize {
    topology.edges().filter(|&h| topology.kind(h) == Some(EdgeKind::NonManifold)).count()
}

/// Returns the edge-connected components, ordered by their first face, with faces in order.
fn parts(topology: &Topology) -> Vec<Vec<FaceId>> {
    let mut is_seen = vec![false; topology.face_count()];
    let mut todo = Vec::new();
    let mut all = Vec::new();
    for first in (0..is_seen.len()).map(FaceId::new) {
        if std::mem::replace(&mut is_seen[first.index()], true) {
            continue;
        }
        let mut part = Vec::new();
        todo.push(first);
        while let Some(f) = todo.pop() {
            part.push(f);
            for h in [0, 1, 2].map(|k| HalfEdgeId::new(3 * f.index() + k)) {
                for other in topology.edge(h).map(HalfEdgeId::face) {
                    if !std::mem::replace(&mut is_seen[other.index()], true) {
                        todo.push(other);
                    }
                }
            }
        }
        part.sort_unstable();
        all.push(part);
    }
    all
}
