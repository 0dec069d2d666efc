//! The pull-back of outliers: moved vertices that are too far from the original.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use glam::{Vec3, Vec3A};
use lodsmith_core::VertexId;

use super::MoveGuards;
use super::normal_equations::FaceNormalEquations;
use super::solve::keeps_orientation;
use crate::chunks;
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
    /// The nearest point of the faces there and its squared distance, if computed.
    found: (f32, Vec3),
}

impl Outlier {
    fn take_if_nearer(&mut self, found: (f32, Vec3)) {
        if found.0 < self.found.0 {
            self.found = found;
        }
    }
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
    let mut suspects: Vec<Outlier> = suspects
        .into_iter()
        .map(|vertex| Outlier {
            vertex,
            point: NONE,
            distance_sq: f32::INFINITY,
            found: (f32::INFINITY, Vec3::ZERO),
        })
        .collect();
    // For each vertex its number among the suspects, from 1 on.
    let mut numbers = vec![0u32; store.v.len()];
    for (i, suspect) in suspects.iter().enumerate() {
        numbers[suspect.vertex.index()] = i as u32 + 1;
    }
    find_merged_points(store, (&mut suspects, &numbers), given, home);
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
    check_faces_at_points(store, (&mut suspects, &numbers), &look, given, home, limit);
    suspects.retain(|s| s.found.0 > limit && s.found.0.is_finite());
    find_nearest(store, given, home, &mut suspects);
    for outlier in &suspects {
        move_back(store, loads, outlier, limit, guards);
    }
}

/// Finds the nearest of the points of the original that were merged into each suspect.
fn find_merged_points<Q: VertexMemory>(
    store: &Store<Q>,
    (suspects, numbers): (&mut [Outlier], &[u32]),
    given: &mut impl OrderedInput,
    home: &[VertexId],
) {
    given.start_random_access();
    let given = &*given;
    let found = chunks::map(home.len().min(given.point_count()), |range| {
        let mut found = Vec::new();
        for i in range {
            // (None is beyond all vertices.)
            if let Some(&number @ 1..) = numbers.get(home[i].index()) {
                let (suspect, point) = (number as usize - 1, VertexId::new(i));
                let at = store.p(suspects[suspect].vertex);
                found.push((suspect, point, (given.position(point) - at).length_squared()));
            }
        }
        found
    });
    for (suspect, point, d2) in found.into_iter().flatten() {
        let suspect = &mut suspects[suspect];
        if d2 < suspect.distance_sq {
            (suspect.point, suspect.distance_sq) = (point, d2);
        }
    }
}

/// Measures the suspects against the faces at these points of the original.
fn check_faces_at_points<Q: VertexMemory>(
    store: &Store<Q>,
    (suspects, numbers): (&mut [Outlier], &[u32]),
    look: &[bool],
    given: &impl OrderedInput,
    home: &[VertexId],
    limit: f32,
) {
    // Nearly all suspects project into one of the faces there; the distances of the others are computed.
    let is_near = chunks::list(suspects.len(), |_| AtomicBool::new(false));
    let others = chunks::map(given.all_faces(), |range| {
        let mut others = Vec::new();
        given.visit_faces(range, |t| {
            // (Few faces are checked.)
            let [a, b, c] = t.map(|w| look[w.index()]);
            if !(a | b | c) {
                return;
            }
            for w in t.into_iter().filter(|w| look[w.index()]) {
                let suspect = numbers[home[w.index()].index()] as usize - 1;
                if is_near[suspect].load(Relaxed) {
                    continue;
                }
                let p = in_register(store.p(suspects[suspect].vertex));
                if is_above(p, t.map(|w| in_register(given.position(w))), limit) {
                    is_near[suspect].store(true, Relaxed);
                } else {
                    others.push((suspect, t));
                }
            }
        });
        others
    });
    for (suspect, t) in others.into_iter().flatten() {
        let at = &mut suspects[suspect];
        if !is_near[suspect].load(Relaxed) && at.found.0 > limit {
            at.take_if_nearer(nearest(store, at.vertex, t, given));
        }
    }
}

/// Returns the point of a face of the original that is nearest to a vertex, and its squared distance.
fn nearest<Q: VertexMemory>(
    store: &Store<Q>,
    vertex: VertexId,
    t: [VertexId; 3],
    given: &impl OrderedInput,
) -> (f32, Vec3) {
    let [a, b, c] = t.map(|w| given.position(w));
    triangle::closest(store.p(vertex), a, b, c)
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
    // The suspects that have each vertex in their star, by vertex, and the ends of these lists.
    let mut ends = vec![0u32; store.v.len()];
    each_of_stars(store, suspects, |w, _| ends[w.index()] += 1);
    let mut count = 0;
    for end in &mut ends {
        count += std::mem::replace(end, count);
    }
    let mut stars = vec![0u32; count as usize];
    each_of_stars(store, suspects, |w, suspect| {
        let end = &mut ends[w.index()];
        stars[*end as usize] = suspect;
        *end += 1;
    });
    let found = chunks::map(given.all_faces(), |range| {
        let mut nearer = Vec::new();
        // The last face that was compared with each suspect: several of its corners may be in one star.
        let (mut compared, mut face) = (vec![0u32; suspects.len()], 0);
        given.visit_faces(range, |t| {
            face += 1;
            for w in t {
                let home = home[w.index()].index();
                // (None is beyond all vertices.)
                let Some(&end) = ends.get(home) else { continue };
                let first = home.checked_sub(1).map_or(0, |before| ends[before]);
                for &i in &stars[first as usize..end as usize] {
                    let i = i as usize;
                    if std::mem::replace(&mut compared[i], face) == face {
                        continue;
                    }
                    let found = nearest(store, suspects[i].vertex, t, given);
                    if found.0 < suspects[i].found.0 {
                        nearer.push((i, found));
                    }
                }
            }
        });
        nearer
    });
    for (suspect, found) in found.into_iter().flatten() {
        suspects[suspect].take_if_nearer(found);
    }
}

/// Visits each vertex of the star of each suspect, once for each, with the number of the suspect.
fn each_of_stars<Q: VertexMemory>(
    store: &Store<Q>,
    suspects: &[Outlier],
    mut visit: impl FnMut(VertexId, u32),
) {
    let mut last = vec![u32::MAX; store.v.len()];
    for (i, suspect) in (0..).zip(suspects) {
        for w in store.listed(suspect.vertex).iter().flat_map(|c| store.t[c.face()]) {
            if std::mem::replace(&mut last[w.index()], i) != i {
                visit(w, i);
            }
        }
    }
}
