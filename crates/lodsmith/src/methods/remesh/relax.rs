//! Tangential relaxation: vertices move along the surface towards even spacing and are projected back onto
//! the original.

use glam::DVec3;
use lodsmith_core::VertexId;
use lodsmith_core::spatial::{Bvh, Hint};

use super::half_edges::{HalfEdges, LineKind};
use super::reference::ReferenceSurface;
use crate::collapse::order::NONE;

/// Least cosine between the normals of a face before and after a vertex moves. (A guess.)
const MIN_TURN_COS: f64 = 0.3;
/// A face may become as flat as this: doubled area over the square of its longest edge. (A guess: an eighth
/// of an equilateral triangle's value.)
const MIN_SHAPE: f64 = 0.1;

/// Limit of the RMS distance between a relaxed vertex and its former face planes, in edge lengths. (A guess.)
const MAX_PLANE_DISTANCE: f64 = 0.06;

/// The last results of the closest-point queries of a vertex, from which the next ones start.
#[derive(Clone, Copy, Default)]
pub(super) struct Hints {
    pub(super) surface: Hint,
    pub(super) curve: Hint,
    pub(super) field: Hint,
}

/// True if the faces around a vertex keep their orientation and shape when it moves.
pub(super) fn may_move(mesh: &HalfEdges, v: VertexId, to: DVec3) -> bool {
    let at = mesh.at(v);
    mesh.around(v).all(|h| {
        let (a, b) = (mesh.at(mesh.to(h)), mesh.at(mesh.from(h.prev())));
        keeps_facing([at, a, b], [to, a, b], MIN_TURN_COS)
    })
}

/// True if the face `old` may become `new`: its normal turns little, and it is no sliver, or was a worse one.
pub(super) fn keeps_facing(old: [DVec3; 3], new: [DVec3; 3], turn: f64) -> bool {
    let normal = |t: [DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]);
    let longest_sq = |t: [DVec3; 3]| {
        t[0].distance_squared(t[1]).max(t[1].distance_squared(t[2])).max(t[2].distance_squared(t[0]))
    };
    let (n, m) = (normal(old), normal(new));
    let (a, b) = (n.length(), m.length());
    let shape = b / longest_sq(new).max(f64::MIN_POSITIVE);
    let was = a / longest_sq(old).max(f64::MIN_POSITIVE);
    // A face without area had no orientation.
    let faces = n.dot(m) >= turn * a * b || was < 1e-9;
    faces && b > 0.0 && (shape >= MIN_SHAPE || shape >= was)
}

/// Projects a target position onto the original; `None` if the surface there faces away from `facing`.
pub(super) fn project(
    reference: &ReferenceSurface<'_>,
    to: DVec3,
    line: LineKind,
    facing: DVec3,
    hints: &mut Hints,
) -> Option<DVec3> {
    if let Some(curve) = reference.curve(line) {
        return curve.closest_from(to.to_array(), &mut hints.curve).map(|h| DVec3::from(h.point));
    }
    let hit = reference.tree.closest_from(to.to_array(), &mut hints.surface)?;
    (reference.normal(hit.face.index()).dot(facing) >= 0.0).then(|| DVec3::from(hit.point))
}

/// Returns the evenly spaced position of a vertex among its neighbours, in its tangent plane or on its line,
/// and the surface normal there.
pub(super) fn relaxed_position(
    mesh: &HalfEdges,
    v: VertexId,
    on: &[LineKind],
    sizes: Option<&[f64]>,
) -> Option<(DVec3, DVec3)> {
    let at = mesh.at(v);
    let (mut sum, mut weight, mut facing) = (DVec3::ZERO, 0.0, DVec3::ZERO);
    for h in mesh.around(v) {
        let (i, j) = (mesh.to(h), mesh.from(h.prev()));
        let (a, b) = (mesh.at(i), mesh.at(j));
        let n = (a - at).cross(b - at);
        facing += n;
        let size = sizes.map_or(1.0, |s| (s[v.index()] + s[i.index()] + s[j.index()]) / 3.0);
        let w = n.length() / (size * size);
        sum += w * (at + a + b);
        weight += 3.0 * w;
    }
    let facing = facing.normalize_or_zero();
    if on[v.index()] != LineKind::None {
        let mut lines = Vec::with_capacity(4);
        mesh.lines_at(v, &mut lines);
        let [(_, a), (_, b)] = lines[..] else { return None };
        let (a, b) = (mesh.at(a), mesh.at(b));
        let middle = 0.5 * (a + b);
        let direction = (b - a).normalize_or_zero();
        return Some((at + direction * direction.dot(middle - at), facing));
    }
    (weight > 0.0).then(|| {
        let step = sum / weight - at;
        (at + step - facing * facing.dot(step), facing)
    })
}

/// Moves one vertex to its relaxed position on the original, or 40 % of the way if that would fold the
/// surface. Returns true if it moved.
pub(super) fn relax(
    mesh: &mut HalfEdges,
    v: VertexId,
    on: &[LineKind],
    sizes: Option<&[f64]>,
    reference: &ReferenceSurface<'_>,
    hints: &mut Hints,
) -> bool {
    let Some((target, facing)) = relaxed_position(mesh, v, on, sizes) else { return false };
    let at = mesh.at(v);
    for share in [1.0, 0.4] {
        let Some(to) = project(reference, at.lerp(target, share), on[v.index()], facing, hints) else {
            continue;
        };
        let leaves = on[v.index()] == LineKind::None && leaves_ridge(mesh, v, to);
        if !leaves && may_move(mesh, v, to) {
            mesh.points[v.index()] = to;
            mesh.kept[v.index()] = NONE;
            return true;
        }
    }
    false
}

/// True if a vertex would leave the planes of its faces by more than the curvature of a smooth surface
/// explains: on a ridge that is no crease, sliding down one side would cut the ridge off.
fn leaves_ridge(mesh: &HalfEdges, v: VertexId, to: DVec3) -> bool {
    let step = to - mesh.at(v);
    let (mut off, mut area) = (0.0, 0.0);
    for h in mesh.around(v) {
        let n = mesh.normal(h.face().index());
        let doubled = n.length();
        if doubled > 0.0 {
            off += n.dot(step).powi(2) / doubled;
            area += doubled;
        }
    }
    // Six equilateral triangles with edges of length l have a doubled area of 5.2 l².
    off > MAX_PLANE_DISTANCE * MAX_PLANE_DISTANCE * area * area / 5.2
}

/// Interpolates a field at a point: `values` at the vertices of the faces in the tree.
pub(super) fn value_at(
    tree: &Bvh,
    points: &[DVec3],
    faces: &[[VertexId; 3]],
    values: &[f64],
    at: DVec3,
    hint: &mut Hint,
) -> Option<f64> {
    let hit = tree.closest_from(at.to_array(), hint)?;
    let t = faces[hit.face.index()];
    let weights =
        lodsmith_core::geometry::triangle::weights_at(DVec3::from(hit.point), t.map(|v| points[v.index()]));
    Some((0..3).map(|k| weights[k] * values[t[k].index()]).sum())
}
