//! Repair of normals that blending turned far from their faces, by recomputation from those faces.
//!
//! If a hard-edged part of an asset loses an edge, the remaining wedge carries the mean of unrelated
//! normals, and its face is shaded as if it faced elsewhere: a dark splinter. Such a wedge gets the normal of
//! its own faces; if these have different directions themselves, it is split.
//!
//! If every original vertex that was merged into a vertex had a single normal, the vertex keeps a single one:
//! splitting it would open a surface that is closed by its indices. It gets the mean normal of its faces if
//! that fits more of them.

use glam::Vec3;
use lodsmith_core::sorted::{indices_by_key, key_of};
use lodsmith_core::{TriMesh, VertexId, WedgeId};

use crate::attributes::Rows;
use crate::collapse::attributes::Attributes;
use crate::collapse::order::NONE;
use crate::collapse::store::Store;
use crate::cost::metric::VertexMemory;

/// Cosine of the largest angle at which a normal still fits a face: 60 degrees. (The faces of an octahedron
/// are 55 degrees off the normals of the sphere that it approximates, and no smooth surface has fewer faces.)
const FAR_COS: f32 = 0.5;
/// If a larger share of the faces (by area) at a wedge of the input was far off its normal, that was
/// intended. (A majority: a single sliver at a wedge proves nothing.)
const INTENDED_SHARE: f32 = 0.5;
/// Cosine of the smallest angle between two normals of one vertex that makes a hard edge: 2 degrees. (Guessed:
/// normals with a byte for each coordinate are off by up to half a degree.)
const HARD_COS: f32 = 0.9994;

/// What the vertices of the input became.
pub(crate) struct Homes<'a, P: Fn(WedgeId) -> VertexId> {
    /// The vertex of the ordered input for each wedge of the input, or [`NONE`].
    pub(crate) place: P,
    /// The vertex of the result that each vertex of the ordered input became, or [`NONE`].
    pub(crate) home: &'a [VertexId],
}

/// Repairs the wedges whose normal is far off at least one of their faces, unless it was so in the input.
/// Locked vertices keep their normals. Cost: O(faces of the result), and O(faces of the input) if there is
/// something to repair.
pub(crate) fn repair<Q: VertexMemory>(
    store: &mut Store<Q>,
    attributes: &mut Attributes,
    rows: &Rows,
    input: &TriMesh,
    homes: &Homes<'_, impl Fn(WedgeId) -> VertexId>,
) {
    let (Some(at), Some(wedges)) = (rows.normals_at(), &store.wedges) else { return };
    let faces: Vec<Vec3> = store.t.iter().map(|t| doubled_area(t.map(|v| store.v[v.index()].p))).collect();
    let mut is_far = vec![false; attributes.count()];
    for (f, t) in store.t.iter().enumerate() {
        for (k, &w) in wedges[f].iter().enumerate() {
            if is_far_off(normal_of(attributes, w, at), faces[f]) && !store.v[t[k].index()].kind.is_locked() {
                is_far[w.index()] = true;
            }
        }
    }
    if !is_far.contains(&true) {
        return;
    }
    let was_wanted = intended_far(attributes, rows, input, at, &is_far);
    let is_hard = on_hard_edges(store, input, homes);
    let mut corners: Vec<WedgeCorner> = Vec::new();
    let mut is_turned = vec![false; store.v.len()];
    for (f, t) in wedges.iter().enumerate() {
        for (k, &wedge) in t.iter().enumerate() {
            let v = store.t[f][k].index();
            if !is_far[wedge.index()] || was_wanted[attributes.original(wedge).index()] {
                continue;
            }
            if is_hard[v] {
                corners.push(WedgeCorner { wedge, face: f, k });
            } else {
                is_turned[v] = true;
            }
        }
    }
    turn(store, attributes, at, &faces, &is_turned);
    let by_wedge = indices_by_key(corners.iter().map(|c| u64::from(c.wedge.0)));
    let corners: Vec<WedgeCorner> = by_wedge.into_iter().map(|i| corners[i]).collect();
    let mut changes: Vec<(WedgeCorner, WedgeId)> = Vec::new();
    for of_wedge in corners.chunk_by(|a, b| a.wedge == b.wedge) {
        split(attributes, at, &faces, of_wedge, &mut changes);
    }
    if let Some(wedges) = &mut store.wedges {
        for (corner, wedge) in &changes {
            wedges[corner.face][corner.k] = *wedge;
        }
    }
}

/// Returns the vertices of the result that have an origin with several normals in the input.
fn on_hard_edges<Q: VertexMemory>(
    store: &Store<Q>,
    input: &TriMesh,
    homes: &Homes<'_, impl Fn(WedgeId) -> VertexId>,
) -> Vec<bool> {
    let mut is_hard = vec![false; store.v.len()];
    let Some(normals) = input.normals() else { return is_hard };
    let mut first: Vec<Option<Vec3>> = vec![None; homes.home.len()];
    let mut has_several = vec![false; homes.home.len()];
    for (w, normal) in normals.iter().enumerate() {
        let (place, normal) = ((homes.place)(WedgeId::new(w)), Vec3::from(*normal));
        if place == NONE {
            continue;
        }
        let known = *first[place.index()].get_or_insert(normal);
        if known.dot(normal) < HARD_COS * known.length() * normal.length() {
            has_several[place.index()] = true;
        }
    }
    for (place, home) in homes.home.iter().enumerate() {
        if *home != NONE && has_several[place] {
            is_hard[home.index()] = true;
        }
    }
    // Cuts add vertices; these have a place, but no vertex was merged into them.
    for (is_hard, x) in is_hard.iter_mut().zip(&store.v) {
        *is_hard |= has_several.get(store.place_of(x.origin).index()) == Some(&true);
    }
    is_hard
}

/// Gives each vertex in `is_turned` one normal, the area-weighted mean of its faces, if a smaller area of its
/// faces is far off that normal than off the present ones.
fn turn<Q: VertexMemory>(
    store: &Store<Q>,
    attributes: &mut Attributes,
    at: usize,
    faces: &[Vec3],
    is_turned: &[bool],
) {
    let Some(wedges) = &store.wedges else { return };
    let mut corners: Vec<(VertexId, WedgeId, usize)> = Vec::new();
    for (f, (t, wedges)) in store.t.iter().zip(wedges).enumerate() {
        let of_face = t.iter().zip(wedges).filter(|(v, _)| is_turned[v.index()]);
        corners.extend(of_face.map(|(&v, &w)| (v, w, f)));
    }
    corners.sort_unstable();
    for star in corners.chunk_by(|a, b| a.0 == b.0) {
        let mean = star.iter().map(|&(_, _, f)| faces[f]).sum::<Vec3>().normalize_or_zero();
        let far_area = |normal: &dyn Fn(WedgeId) -> Vec3| -> f32 {
            let far = star.iter().filter(|&&(_, w, f)| is_far_off(normal(w), faces[f]));
            far.map(|&(_, _, f)| faces[f].length()).sum()
        };
        let present = far_area(&|w| normal_of(attributes, w, at));
        if mean != Vec3::ZERO && far_area(&|_| mean) < present {
            for &(_, w, _) in star {
                attributes.values_mut(w)[at..at + 3].copy_from_slice(&mean.to_array());
            }
        }
    }
}

/// A corner of the result.
#[derive(Clone, Copy)]
struct WedgeCorner {
    wedge: WedgeId,
    face: usize,
    k: usize,
}

/// Gives new normals to the faces at a wedge that are far off its normal, one per group of similar
/// orientation.
fn split(
    attributes: &mut Attributes,
    at: usize,
    faces: &[Vec3],
    corners: &[WedgeCorner],
    changes: &mut Vec<(WedgeCorner, WedgeId)>,
) {
    let wedge = corners[0].wedge;
    let own = normal_of(attributes, wedge, at);
    let far: Vec<&WedgeCorner> = corners.iter().filter(|c| is_far_off(own, faces[c.face])).collect();
    // The largest face determines the direction of a group.
    let area = |c: &WedgeCorner| f64::from(faces[c.face].length_squared());
    let largest_first = indices_by_key(far.iter().map(|c| !key_of(area(c))));
    let mut groups: Vec<(Vec3, Vec<WedgeCorner>)> = Vec::new();
    for c in largest_first.into_iter().map(|i| far[i]) {
        let face = faces[c.face];
        match groups.iter_mut().find(|(sum, _)| !is_far_off(*sum, face)) {
            Some((sum, members)) => {
                *sum += face;
                members.push(*c);
            }
            None => groups.push((face, vec![*c])),
        }
    }
    let mut is_free = far.len() == corners.len();
    for (sum, members) in groups {
        let into = if std::mem::take(&mut is_free) { wedge } else { attributes.copy_of(wedge) };
        let normal = sum.normalize_or_zero();
        attributes.values_mut(into)[at..at + 3].copy_from_slice(&normal.to_array());
        changes.extend(members.into_iter().map(|c| (c, into)));
    }
}

/// Returns the original wedges of the far ones whose normals were far off most of their faces in the input
/// already.
fn intended_far(
    attributes: &Attributes,
    rows: &Rows,
    input: &TriMesh,
    at: usize,
    is_far: &[bool],
) -> Vec<bool> {
    let Some(normals) = input.normals() else { return vec![false; attributes.count()] };
    let mut is_asked = vec![false; attributes.count()];
    for w in (0..is_far.len()).filter(|&w| is_far[w]) {
        is_asked[attributes.original(WedgeId::new(w)).index()] = true;
    }
    debug_assert!(at + 3 <= rows.width());
    // Area of all faces, and of the faces that are far off.
    let mut areas = vec![[0f32; 2]; attributes.count()];
    let view = input.positions().view();
    for t in input.triangles() {
        let of_rows = t.map(|w| rows.wedge_rows[w.index()].index());
        if !of_rows.iter().any(|&r| is_asked.get(r) == Some(&true)) {
            continue;
        }
        let [a, b, c] = t.map(|w| glam::DVec3::from(view.get(input.vertex_of(w))));
        let face = (b - a).cross(c - a);
        let (area, face) = (face.length() as f32, face.normalize_or_zero().as_vec3());
        for (w, r) in t.iter().zip(of_rows) {
            let Some(sums) = areas.get_mut(r) else { continue };
            sums[0] += area;
            if is_far_off(Vec3::from(normals[w.index()]), face) {
                sums[1] += area;
            }
        }
    }
    areas.iter().map(|[all, far]| *far > INTENDED_SHARE * all).collect()
}

/// True if a normal is far off the direction of a face. A zero vector never is.
fn is_far_off(normal: Vec3, face: Vec3) -> bool {
    let lengths = normal.length() * face.length();
    lengths > 0.0 && lengths.is_finite() && normal.dot(face) < FAR_COS * lengths
}

fn normal_of(attributes: &Attributes, w: WedgeId, at: usize) -> Vec3 {
    Vec3::from_slice(&attributes.of(w)[at..at + 3])
}

fn doubled_area([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(c - a)
}
