//! Sheets whose sides are up to a millionth of the diagonal apart, for example because each was computed
//! separately.

use std::collections::HashMap;

use glam::Vec3;
use lodsmith_core::mesh::weld::weld_within;
use lodsmith_core::{DisjointSets, Surface, VertexId};

use super::pairs::{self, FacePair, edges};
use crate::chunks;
use crate::collapse::order::{NONE, Ordered, order};
use crate::pipeline::borders::MIN_EDGE_RATIO;

/// Largest distance between the sides of a sheet, as a share of the diagonal.
const MAX_GAP_SHARE: f64 = 1e-6;
/// Number of next points in the order that are checked for closeness: vertices of two sides are mostly in one
/// cell of the curve.
const NEXT_POINTS: usize = 3;

/// A surface whose close sides use the same vertices.
pub(super) struct NearSides<'a> {
    pub(super) surface: Surface<'a>,
    pub(super) ordered: Ordered,
    /// The vertex that stands for each vertex: itself, unless it was joined with others.
    pub(super) to: Vec<VertexId>,
}

/// Joins the vertices of sheets whose sides are apart, if a surface has any; all other vertices are
/// unchanged. `ordered` is the order of the surface, and `own` has the faces as given, before anything was
/// joined: sides that share vertices there belong to a thin solid. `may_pair` decides from the places of the
/// corners whether faces may be the front of others; `max_bent_gap` is as in [`pairs::find`]. Cost: two
/// passes over the ordered points and faces; O(n log n) if there may be such sheets.
pub(super) fn joined<'a>(
    surface: &Surface<'a>,
    ordered: &Ordered,
    own: &[[VertexId; 3]],
    max_bent_gap: f32,
    may_pair: impl Fn(&FacePair, &dyn Fn(u32) -> [VertexId; 3]) -> bool,
) -> Option<NearSides<'a>> {
    let gap = MAX_GAP_SHARE * ordered.diagonal;
    let unit_gap = ordered.frame.unit_length(gap) as f32;
    let (positions, triangles) = (surface.positions(), surface.triangles());
    let places = |f: &u32| triangles[*f as usize].map(|v| ordered.rank[v.index()]);
    let near = first_near(&ordered.points, unit_gap)?;
    let mut parts = DisjointSets::new(positions.len());
    for [a, b, c] in own {
        parts.join(a.0, b.0);
        parts.join(b.0, c.0);
    }
    let mut part = |f: u32| parts.find(own[f as usize][0].0);
    let faces = (0..triangles.len() as u32).map(|f| (f, places(&f)));
    if !may_have_near_sides(&near, faces, &mut part) {
        return None;
    }
    let weld = weld_within(positions, gap);
    let moved = |to: &dyn Fn(VertexId) -> VertexId| {
        let triangles = triangles.iter().map(|t| t.map(to)).collect();
        let surface = Surface::with_triangles(positions, triangles).ok()?;
        let ordered = order(&surface);
        Some((surface, ordered))
    };
    let (merged, merged_order) = moved(&|v| weld.of(v))?;
    let merged_places = |f: u32| merged.triangles()[f as usize].map(|v| merged_order.rank[v.index()]);
    let found = pairs::find(&merged, &merged_order, max_bent_gap, &|pair| may_pair(pair, &merged_places))?;
    // (A face with edges of the size of the gap is no sheet.)
    let is_wide = |f: &u32| {
        let at = places(f);
        at.iter().all(|p| *p != NONE) && {
            let p = at.map(|p| ordered.points[p.index()]);
            (0..3).all(|k| p[k].distance(p[(k + 1) % 3]) > MIN_EDGE_RATIO as f32 * unit_gap)
        }
    };
    // The places of pairs that result from joining.
    let mut is_joined = vec![false; ordered.point_count];
    for pair in &found.pairs {
        let all = || pair.fronts().iter().chain(pair.backs());
        let fronts: Vec<VertexId> = pair.fronts().iter().flat_map(places).collect();
        let is_apart = pair.backs().iter().flat_map(places).any(|p| !fronts.contains(&p));
        let [front, back] = [pair.fronts()[0], pair.backs()[0]].map(&mut part);
        if is_apart && front != back && all().all(is_wide) {
            all().flat_map(places).for_each(|p| is_joined[p.index()] = true);
        }
    }
    if !is_joined.contains(&true) {
        return None;
    }
    let mut first: HashMap<VertexId, VertexId> = HashMap::new();
    let to: Vec<VertexId> = (0..positions.len())
        .map(VertexId::new)
        .map(|v| match ordered.rank[v.index()] {
            rank if rank != NONE && is_joined[rank.index()] => *first.entry(weld.of(v)).or_insert(v),
            _ => v,
        })
        .collect();
    let (surface, ordered) = moved(&|v| to[v.index()])?;
    Some(NearSides { surface, ordered, to })
}

/// For each point, the first point close to it, found only among points next to each other in the order;
/// `None` if no points are close.
fn first_near(points: &[Vec3], gap: f32) -> Option<Vec<VertexId>> {
    let near_pairs = chunks::map(points.len(), |range| {
        let mut found = Vec::new();
        for i in range {
            for j in i + 1..points.len().min(i + 1 + NEXT_POINTS) {
                if points[i].distance_squared(points[j]) <= gap * gap {
                    found.push((i, j));
                }
            }
        }
        found
    });
    if near_pairs.iter().all(Vec::is_empty) {
        return None;
    }
    let mut near: Vec<VertexId> = (0..points.len()).map(VertexId::new).collect();
    for (i, j) in near_pairs.into_iter().flatten() {
        near[j] = near[i];
    }
    Some(near)
}

/// True if a face may lie on faces of another part when close points count as one: another part shares two of
/// its edges, or all three unless the sides are cut along different diagonals. `faces` have their places
/// among the points.
fn may_have_near_sides(
    near: &[VertexId],
    faces: impl Iterator<Item = (u32, [VertexId; 3])>,
    part: &mut impl FnMut(u32) -> u32,
) -> bool {
    let mut has_near = vec![false; near.len()];
    for (v, first) in near.iter().enumerate().filter(|(v, first)| first.index() != *v) {
        (has_near[v], has_near[first.index()]) = (true, true);
    }
    // (Where borders have been joined, not all corners are close to others: the outlines of both sides are on
    // the same points.)
    let is_near = |t: &[VertexId; 3]| t.iter().all(|p| *p != NONE) && t.iter().any(|p| has_near[p.index()]);
    let mut candidates: Vec<[VertexId; 3]> = Vec::new();
    // The part of the faces at each edge, if they belong to only one.
    let mut part_at: HashMap<[VertexId; 2], Option<u32>> = HashMap::new();
    for (f, t) in faces.filter(|(_, t)| is_near(t)) {
        let t = t.map(|p| near[p.index()]);
        // (Faces as small as the gap shrink to edges.)
        if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
            continue;
        }
        let own = Some(part(f));
        for (edge, _) in edges(t) {
            let known = part_at.entry(edge).or_insert(own);
            *known = known.filter(|_| *known == own);
        }
        candidates.push(t);
    }
    let shared = |t: &[VertexId; 3]| edges(*t).iter().filter(|(edge, _)| part_at[edge].is_none()).count();
    candidates.iter().any(|t| shared(t) > 1)
}
