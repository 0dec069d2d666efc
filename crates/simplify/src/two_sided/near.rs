//! Sides of sheets that are a hair's breadth apart: up to a millionth of the diagonal, as where each side was
//! computed for itself.

use std::collections::HashMap;

use glam::Vec3;
use lodsmith_core::mesh::weld::weld_within;
use lodsmith_core::{DisjointSets, Surface, VertexId};

use super::pairs::{self, FacePair};
use crate::borders::LEAST_EDGE;
use crate::collapse::order::{NONE, Ordered, order};

/// Largest distance between the sides of a sheet, as a share of the diagonal.
const MAX_GAP_SHARE: f64 = 1e-6;
/// Points along the order that are looked at for near ones: vertices of two sides are mostly in one cell of the curve,
/// and one such pair is enough.
const NEXT_POINTS: usize = 3;

/// A surface whose near sides are on the same vertices.
pub(super) struct NearSides<'a> {
    pub(super) surface: Surface<'a>,
    pub(super) ordered: Ordered,
    /// What each vertex was joined with.
    pub(super) to: Vec<VertexId>,
}

/// Joins the vertices of sheets whose sides are apart, if a surface has any; `ordered` is its order, and `own` are its
/// faces as they were given, before anything was joined: sides that hang together there are those of a thin solid.
/// `may_pair` decides
/// whether some faces of the input may be the front of others, from the places of the corners of faces;
/// `max_bent_gap` is that of [`pairs::find`]. Vertices that belong to no such sheet stay as they are. Cost: O(V), a
/// pass over the ordered points; O(n log n) if any are near.
pub(super) fn joined<'a>(
    surface: &Surface<'a>,
    ordered: &Ordered,
    own: &[[VertexId; 3]],
    max_bent_gap: f32,
    may_pair: impl Fn(&FacePair, &dyn Fn(u32) -> [VertexId; 3]) -> bool,
) -> Option<NearSides<'a>> {
    let gap = MAX_GAP_SHARE * ordered.diagonal;
    if !has_near(&ordered.points, ordered.frame.unit_length(gap) as f32) {
        return None;
    }
    let (positions, triangles) = (surface.positions(), surface.triangles());
    let weld = weld_within(positions, gap);
    let moved = |to: &dyn Fn(VertexId) -> VertexId| {
        let triangles = triangles.iter().map(|t| t.map(to)).collect();
        let surface = Surface::with_triangles(positions, triangles).ok()?;
        let ordered = order(&surface);
        Some((surface, ordered))
    };
    let (merged, merged_order) = moved(&|v| weld.of(v))?;
    let places = |f: u32| merged.triangles()[f as usize].map(|v| merged_order.rank[v.index()]);
    let found = pairs::find(&merged, &merged_order, max_bent_gap, |pair| may_pair(pair, &places))?;
    let mut parts = DisjointSets::new(positions.len());
    for [a, b, c] in own {
        parts.join(a.0, b.0);
        parts.join(b.0, c.0);
    }
    // Places of the given surface at pairs that come to be by joining. (Faces of the size of the gap are no sheet.)
    let mut is_joined = vec![false; ordered.point_count];
    let mut any = false;
    for pair in &found.pairs {
        let corners = || {
            let faces = pair.fronts().iter().chain(pair.backs());
            faces.flat_map(|f| triangles[*f as usize]).map(|v| ordered.rank[v.index()])
        };
        if corners().any(|rank| rank == NONE) {
            continue;
        }
        let is_wide = pair.fronts().iter().chain(pair.backs()).all(|f| {
            let p = triangles[*f as usize].map(|v| ordered.points[ordered.rank[v.index()].index()]);
            let least = LEAST_EDGE as f32 * ordered.frame.unit_length(gap) as f32;
            (0..3).all(|k| p[k].distance(p[(k + 1) % 3]) > least)
        });
        let places: Vec<VertexId> = corners().collect();
        let is_apart = {
            let mut distinct = places.clone();
            distinct.sort_unstable();
            distinct.dedup();
            distinct.len() > 2 + pair.fronts().len()
        };
        let [front, back] = [pair.fronts()[0], pair.backs()[0]].map(|f| parts.find(own[f as usize][0].0));
        if is_wide && is_apart && front != back {
            places.iter().for_each(|p| is_joined[p.index()] = true);
            any = true;
        }
    }
    if !any {
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

/// True if points that follow on each other in the order are at most `gap` apart.
fn has_near(points: &[Vec3], gap: f32) -> bool {
    let is_near = |p: &Vec3, q: &Vec3| p.distance_squared(*q) <= gap * gap;
    points.windows(1 + NEXT_POINTS).any(|few| few[1..].iter().any(|q| is_near(&few[0], q)))
}
