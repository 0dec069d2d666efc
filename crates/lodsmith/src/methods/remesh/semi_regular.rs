//! Semi-regular meshes: a base mesh, and levels of 4:1 subdivision projected onto the original. After the
//! idea of [Eck et al. 1995]; where that paper uses harmonic maps over patches, vertices here are relaxed
//! until they are evenly spaced.
//!
//! ```text
//!        2                 face f becomes faces 4f … 4f+3; child k has corner k of its parent as its own corner k,
//!       / \                and the last one is the middle. New vertices come after the old ones, so a coarser
//!      /4f+2\              level is read off a finer one.
//!     5 ---- 4
//!    / \4f+3/ \
//!   /4f \  /4f+1\
//!  0 ---- 3 ---- 1
//! ```

use std::collections::HashMap;

use glam::DVec3;
use lodsmith_core::{HalfEdgeId, VertexId};

use super::half_edges::{HalfEdges, LineKind};
use super::isotropic;
use super::least_squares::fit_vertices;
use super::reference::{self, ReferenceSurface};
use super::relax::{self, Hints};
use crate::SimplifyError;
use crate::collapse::order::NONE;
use crate::control::{Control, Verdict};
use crate::methods::task::{Ending, RebuiltSurface, Task};
use crate::options::Fit;

/// Relaxation rounds of the new vertices of each level. (A guess.)
const ROUNDS: usize = 3;
/// Relaxation rounds of all vertices of the last level. (A guess.)
const LAST_ROUNDS: usize = 5;

type EdgeKey = [VertexId; 2];
type Lines = HashMap<EdgeKey, LineKind>;

pub(super) fn make(
    task: &Task<'_>,
    levels: usize,
    control: &mut dyn Control,
) -> Result<RebuiltSurface, SimplifyError> {
    let prepared = task.input;
    let share = |n: usize| n.checked_shr(2 * levels as u32).unwrap_or(0).max(1);
    // A closed surface has about twice as many faces as vertices.
    let by_vertices = task.goal.vertices.map(|n| share(2 * n));
    let wanted = task.goal.faces.map(share).into_iter().chain(by_vertices).max();
    let wanted = wanted.unwrap_or(usize::MAX).min(share(prepared.faces.len()));
    let (reference, _) = ReferenceSurface::new(task);
    let base = reference.simplified(task, wanted, task.options.topology, control)?;
    let mut made = isotropic::made(&base.mesh);
    (made.parts_removed, made.necks_cut) = (base.parts_removed, base.necks_cut);
    (made.steps, made.end) = (base.steps, Ending::Goal);
    let finest = made.faces.len().saturating_mul(1usize.checked_shl(2 * levels as u32).unwrap_or(usize::MAX));
    if base.is_finished {
        return Ok(RebuiltSurface { end: Ending::Finish, ..made });
    }
    if made.faces.len() > wanted || finest > prepared.faces.len() {
        return match task.options.stop.error {
            // The search for an error tries other counts.
            Some(_) => Ok(RebuiltSurface { end: Ending::Stuck, ..made }),
            None => Err(SimplifyError::BadOption {
                option: "subdivisions",
                wanted: "fewer: no base of this shape is light enough for so many and this count",
                got: levels as f64,
            }),
        };
    }
    let mut lines = reference.lines_of(&made.points, &made.faces);
    for level in 1..=levels {
        let fresh = made.points.len();
        made.faces = subdivided(&mut made.points, &made.faces, &mut lines);
        made.kept.resize(made.points.len(), NONE);
        made.steps += (made.points.len() - fresh) as u64;
        project_level(task, &reference, &mut made, &lines, fresh, level == levels);
        match control.progress(level as f64 / levels as f64) {
            Verdict::Cancel => return Err(SimplifyError::Cancelled),
            Verdict::Finish => return Ok(RebuiltSurface { end: Ending::Finish, ..made }),
            Verdict::Continue => {}
        }
    }
    let met = |count: usize, n: Option<usize>| n.is_some_and(|n| count <= n);
    if !met(made.faces.len(), task.goal.faces) && !met(made.points.len(), task.goal.vertices) {
        made.end = Ending::Stuck;
    }
    Ok(made)
}

fn edge(a: VertexId, b: VertexId) -> EdgeKey {
    [a.min(b), a.max(b)]
}

/// Replaces each face by four, with new vertices at the edge midpoints.
fn subdivided(points: &mut Vec<DVec3>, faces: &[[VertexId; 3]], lines: &mut Lines) -> Vec<[VertexId; 3]> {
    let mut middles: HashMap<EdgeKey, VertexId> = HashMap::with_capacity(faces.len() * 3 / 2);
    let mut finer_lines = Lines::new();
    let mut finer = Vec::with_capacity(4 * faces.len());
    for &t in faces {
        let m = [0, 1, 2].map(|k| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            *middles.entry(edge(a, b)).or_insert_with(|| {
                let m = VertexId::new(points.len());
                points.push(0.5 * (points[a.index()] + points[b.index()]));
                if let Some(&line) = lines.get(&edge(a, b)) {
                    finer_lines.insert(edge(a, m), line);
                    finer_lines.insert(edge(m, b), line);
                }
                m
            })
        });
        finer.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], [m[1], m[2], m[0]]]);
    }
    *lines = finer_lines;
    finer
}

/// Projects the vertices from index `fresh` onto the original and spaces them evenly; on the last level all
/// vertices are relaxed.
fn project_level(
    task: &Task<'_>,
    reference: &ReferenceSurface<'_>,
    made: &mut RebuiltSurface,
    lines: &Lines,
    fresh: usize,
    is_last: bool,
) {
    let mut mesh = HalfEdges::new(&made.points, &made.faces, None, None);
    let marked: Vec<(HalfEdgeId, LineKind)> = mesh
        .half_edges()
        .filter(|&h| mesh.is_first(h) && mesh.line[h.index()] == LineKind::None)
        .filter_map(|h| {
            let name = |v: VertexId| mesh.kept[v.index()];
            lines.get(&edge(name(mesh.from(h)), name(mesh.to(h)))).map(|line| (h, *line))
        })
        .collect();
    marked.into_iter().for_each(|(h, line)| mesh.set_line(h, line));
    let on = reference::settle_lines(&mut mesh, 0.0, task.options.border);
    let names = mesh.kept.clone();
    let locked = task.input.locked.as_deref();
    for (pinned, name) in mesh.pinned.iter_mut().zip(&names) {
        let kept = made.kept[name.index()];
        *pinned |= locked.is_some_and(|l| kept != NONE && l[kept.index()]);
    }
    let mut hints = vec![Hints::default(); mesh.points.len()];
    let all = || (0..names.len()).map(VertexId::new);
    let is_fresh = |v: VertexId| names[v.index()].index() >= fresh;
    for v in all().filter(|&v| is_fresh(v) && !mesh.pinned[v.index()]).collect::<Vec<_>>() {
        let facing: DVec3 = mesh.around(v).map(|h| mesh.normal(h.face().index())).sum();
        let to = relax::project(reference, mesh.at(v), on[v.index()], facing, &mut hints[v.index()]);
        if let Some(to) = to.filter(|to| relax::may_move(&mesh, v, *to)) {
            mesh.points[v.index()] = to;
        }
    }
    let rounds = if is_last { ROUNDS + LAST_ROUNDS } else { ROUNDS };
    for round in 0..rounds {
        if round < 2 {
            // Moves the surface towards parts that no vertex is nearest to yet, such as the tip of an ear.
            fit_vertices(&mut mesh, &on, reference);
        }
        for v in all() {
            if !mesh.pinned[v.index()] && (is_fresh(v) || round >= ROUNDS) {
                relax::relax(&mut mesh, v, &on, None, reference, &mut hints[v.index()]);
            }
        }
    }
    if is_last && task.options.fit != Fit::Off {
        fit_vertices(&mut mesh, &on, reference);
    }
    for (v, name) in names.iter().enumerate() {
        let name = name.index();
        if made.points[name] != mesh.points[v] {
            (made.points[name], made.kept[name]) = (mesh.points[v], NONE);
        }
    }
}
