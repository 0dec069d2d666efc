//! Repair of normals that blending turned far from their faces, by recomputation from those faces.
//!
//! If a hard-edged part of an asset loses an edge, the remaining wedge carries the mean of unrelated
//! normals, and its face is shaded as if it faced elsewhere: a dark splinter. Such a wedge gets the normal of
//! its own faces; if those face different ways themselves, it is split.

use glam::Vec3;
use lodsmith_core::{TriMesh, WedgeId};

use crate::attributes::Rows;
use crate::collapse::attributes::Attributes;
use crate::collapse::store::Store;
use crate::metric::VertexMemory;

/// Cosine of the largest angle at which a normal still fits a face: 60 degrees. (The faces of an octahedron
/// are 55 degrees off the normals of the sphere that it approximates, and no smooth surface wants fewer
/// faces.)
const FAR_COS: f32 = 0.5;
/// If a larger share of the faces (by area) at a wedge of the input was far off its normal, this was
/// intended. (The majority: a single sliver at a wedge proves nothing.)
const INTENDED_SHARE: f32 = 0.5;

/// Repairs the wedges whose normal is far off at least one of their faces, and was not in the input. Locked
/// vertices keep theirs. Returns how many corners got another normal. Cost: O(faces of the result), and
/// O(faces of the input) if there is something to repair.
pub(crate) fn repair<Q: VertexMemory>(
    store: &mut Store<Q>,
    attributes: &mut Attributes,
    rows: &Rows,
    input: &TriMesh,
) -> usize {
    let (Some(at), Some(wedges)) = (rows.normals_at(), &store.wedges) else { return 0 };
    let faces: Vec<Vec3> = store.t.iter().map(|t| doubled_area(t.map(|v| store.v[v.index()].p))).collect();
    let mut corners: Vec<WedgeCorner> = Vec::new();
    let mut is_far = vec![false; attributes.count()];
    for (f, t) in store.t.iter().enumerate() {
        for (k, &w) in wedges[f].iter().enumerate() {
            if is_far_off(normal_of(attributes, w, at), faces[f]) && !store.v[t[k].index()].kind.is_locked() {
                is_far[w.index()] = true;
            }
        }
    }
    if !is_far.contains(&true) {
        return 0;
    }
    let was_wanted = intended_far(attributes, rows, input, at, &is_far);
    for (f, t) in wedges.iter().enumerate() {
        for (k, &wedge) in t.iter().enumerate() {
            if is_far[wedge.index()] && !was_wanted[attributes.original(wedge).index()] {
                corners.push(WedgeCorner { wedge, face: f, k });
            }
        }
    }
    corners.sort_unstable_by_key(|c| (c.wedge, c.face, c.k));
    let mut changes: Vec<(WedgeCorner, WedgeId)> = Vec::new();
    for of_wedge in corners.chunk_by(|a, b| a.wedge == b.wedge) {
        split(attributes, at, &faces, of_wedge, &mut changes);
    }
    if let Some(wedges) = &mut store.wedges {
        for (corner, wedge) in &changes {
            wedges[corner.face][corner.k] = *wedge;
        }
    }
    changes.len()
}

/// A corner of the result.
#[derive(Clone, Copy)]
struct WedgeCorner {
    wedge: WedgeId,
    face: usize,
    k: usize,
}

/// Gives the faces at a wedge whose normal is far off theirs new normals, one per group of similar
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
    let mut far: Vec<WedgeCorner> =
        corners.iter().filter(|c| is_far_off(own, faces[c.face])).copied().collect();
    // The largest face determines the direction of a group.
    far.sort_by(|a, b| {
        faces[b.face].length_squared().total_cmp(&faces[a.face].length_squared()).then(a.face.cmp(&b.face))
    });
    let mut groups: Vec<(Vec3, Vec<WedgeCorner>)> = Vec::new();
    for c in &far {
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

/// Returns the input wedges, among the origins of the far ones, that were far off most of their faces
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
    // Area of all faces, and of those that are far off.
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
