//! The pull-back of outliers: moved vertices that are too far from the original.

use glam::{Vec3, Vec3A};
use lodsmith_core::VertexId;

use super::MoveGuards;
use super::normal_equations::FaceNormalEquations;
use super::solve::keeps_orientation;
use crate::collapse::order::NONE;
use crate::collapse::ordered_input::OrderedInput;
use crate::collapse::store::Store;
use crate::collapse::triangle;
use crate::cost::lanes::{dots, in_register, max};
use crate::cost::metric::VertexMemory;

/// Distance from the original that is always permitted, in units of the largest distance of a sample of the
/// vertex's faces, squared. A flat part has an RMS height near zero, and vertices on its fillets lie farther
/// out. (Measured: docs/decisions/0006.)
const MAX_OUTLIER_STAR_SQ: f32 = 2.0;

/// Returns true if the projection of a point lies inside a face, no farther away than the root of `limit`.
#[inline(always)]
fn is_above(p: Vec3A, [a, b, c]: [Vec3A; 3], limit: f32) -> bool {
    let (q, first, second) = (p - a, b - a, c - a);
    let normal = first.cross(second);
    // The triangles between the point and two sides have its barycentric coordinates times the face's area as
    // areas.
    let [area_sq, v, w, height] = dots(normal, [normal, q.cross(second), first.cross(q), q]);
    (height * height <= limit * area_sq) & (v >= 0.0) & (w >= 0.0) & (v + w <= area_sq)
}

/// A possible outlier: a vertex that may be too far off the original.
struct Outlier {
    vertex: VertexId,
    /// The nearest of the points merged into it, and its squared distance.
    point: VertexId,
    distance_sq: f32,
    /// True if it projects into a face there and is not far from it.
    is_near: bool,
    /// The nearest point of the faces there and its squared distance, if computed.
    found: (f32, Vec3),
}

/// Moves outliers back: vertices that are farther off the original than the root of `limit`. The surface
/// below an outlier is far from its faces, so only the `suspects` are checked. Searching around the nearest
/// of the points merged into a vertex is enough: an exact pass over all faces doubles the time of the fit.
#[inline(never)]
pub(super) fn pull_in_outliers<Q: VertexMemory>(
    store: &mut Store<Q>,
    loads: &[FaceNormalEquations],
    suspects: Vec<VertexId>,
    given: &mut impl OrderedInput,
    home: &[VertexId],
    (limit, guards): (f32, Option<&MoveGuards>),
) {
    // (The mark of a vertex is free for scratch: here one more than its index among the suspects.)
    store.v.iter_mut().for_each(|x| x.mark = 0);
    let mut suspects: Vec<Outlier> = suspects
        .into_iter()
        .map(|vertex| Outlier {
            vertex,
            point: NONE,
            distance_sq: f32::INFINITY,
            is_near: false,
            found: (f32::INFINITY, Vec3::ZERO),
        })
        .collect();
    for (i, suspect) in suspects.iter().enumerate() {
        store.v[suspect.vertex.index()].mark = i as u32 + 1;
    }
    find_merged_points(store, &mut suspects, given, home);
    let mut look = vec![false; given.point_count()];
    let mut any = false;
    for suspect in &suspects {
        if suspect.distance_sq > limit && suspect.point != NONE {
            (look[suspect.point.index()], any) = (true, true);
        }
    }
    if !any {
        return;
    }
    check_faces_at_points(store, &mut suspects, &look, given, home, limit);
    suspects.retain(|s| s.found.0 > limit && s.found.0.is_finite());
    find_nearest(store, given, home, &mut suspects);
    for outlier in &suspects {
        move_back(store, loads, outlier, limit, guards);
    }
}

/// Finds the nearest of the points of the original that were merged into each suspect.
fn find_merged_points<Q: VertexMemory>(
    store: &Store<Q>,
    suspects: &mut [Outlier],
    given: &mut impl OrderedInput,
    home: &[VertexId],
) {
    given.start_random_access();
    for (i, &h) in home.iter().enumerate().take(given.point_count()) {
        if h == NONE {
            continue;
        }
        let x = &store.v[h.index()];
        if x.mark > 0 {
            let suspect = &mut suspects[x.mark as usize - 1];
            let point = VertexId(i as u32);
            let d2 = (given.position(point) - x.p).length_squared();
            if d2 < suspect.distance_sq {
                (suspect.point, suspect.distance_sq) = (point, d2);
            }
        }
    }
}

/// Measures the suspects against the faces at these points of the original.
fn check_faces_at_points<Q: VertexMemory>(
    store: &Store<Q>,
    suspects: &mut [Outlier],
    look: &[bool],
    given: &impl OrderedInput,
    home: &[VertexId],
    limit: f32,
) {
    // Nearly all project into one of the faces there; for the others, the distance is computed afterwards.
    let mut others: Vec<(u32, [VertexId; 3])> = Vec::new();
    given.each_face(|t| {
        // (Few faces are checked.)
        let [a, b, c] = t.map(|w| look[w.index()]);
        if !(a | b | c) {
            return;
        }
        for w in t.into_iter().filter(|w| look[w.index()]) {
            let x = &store.v[home[w.index()].index()];
            let suspect = &mut suspects[x.mark as usize - 1];
            if !suspect.is_near {
                suspect.is_near =
                    is_above(in_register(x.p), t.map(|w| in_register(given.position(w))), limit);
                if !suspect.is_near {
                    others.push((x.mark - 1, t));
                }
            }
        }
    });
    for (number, t) in others {
        let suspect = &mut suspects[number as usize];
        if !suspect.is_near && suspect.found.0 > limit {
            let [a, b, c] = t.map(|w| given.position(w));
            let near = triangle::closest(store.p(suspect.vertex), a, b, c);
            if near.0 < suspect.found.0 {
                suspect.found = near;
            }
        }
    }
}

/// Moves an outlier towards the nearest point of the original, as far as faces keep their orientation.
fn move_back<Q: VertexMemory>(
    store: &mut Store<Q>,
    loads: &[FaceNormalEquations],
    &Outlier { vertex, found: (d, q), .. }: &Outlier,
    limit: f32,
    guards: Option<&MoveGuards>,
) {
    let worst = store.listed(vertex).iter().map(|c| loads[c.face()].max_distance_sq()).fold(0.0, max);
    let limit = max(limit, MAX_OUTLIER_STAR_SQ * worst);
    if d > limit {
        let p = q + (store.p(vertex) - q) * (limit / d).sqrt();
        let is_fine = |p| keeps_orientation(store, loads, vertex, p, true);
        let place = match guards {
            None => is_fine(p).then_some(p),
            Some(guards) => guards.farthest(store, vertex, p, is_fine),
        };
        if let Some(p) = place {
            store.v[vertex.index()].p = p;
        }
    }
}

/// Finds the nearest point for suspects that seem far: over all faces with a corner merged into their star.
/// If faces are long or large, the suspect may lie over one that does not touch the nearest point.
#[inline(never)]
fn find_nearest<Q: VertexMemory>(
    store: &Store<Q>,
    given: &impl OrderedInput,
    home: &[VertexId],
    suspects: &mut [Outlier],
) {
    if suspects.is_empty() {
        return;
    }
    // The suspects that have each vertex in their star, sorted by vertex.
    let mut stars: Vec<(VertexId, usize)> = Vec::new();
    for (i, suspect) in suspects.iter().enumerate() {
        stars.extend(store.listed(suspect.vertex).iter().flat_map(|c| store.t[c.face()]).map(|w| (w, i)));
    }
    stars.sort_unstable();
    stars.dedup();
    let mut is_in_star = vec![false; store.v.len()];
    stars.iter().for_each(|(w, _)| is_in_star[w.index()] = true);
    let is_near = |h: VertexId| h != NONE && is_in_star[h.index()];
    given.each_face(|t| {
        let homes = t.map(|w| home[w.index()]);
        if !homes.into_iter().any(is_near) {
            return;
        }
        let [a, b, c] = t.map(|w| given.position(w));
        for h in homes.into_iter().filter(|&h| is_near(h)) {
            let first = stars.partition_point(|s| s.0 < h);
            for &(_, i) in stars[first..].iter().take_while(|s| s.0 == h) {
                let suspect = &mut suspects[i];
                let near = triangle::closest(store.p(suspect.vertex), a, b, c);
                if near.0 < suspect.found.0 {
                    suspect.found = near;
                }
            }
        }
    });
}
