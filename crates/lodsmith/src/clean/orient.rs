//! Consistent face orientation: neighbours agree, and closed components face outward.

use lodsmith_core::topology::Topology;
use lodsmith_core::{Bounds, FaceId, HalfEdgeId, Surface};

/// A closed component whose volume is below this share of its area, to the power of 3/2, has no meaningful
/// inside: rounding of single precision on flat components. A sphere has 0.094.
const MIN_VOLUME_SHARE: f64 = 1e-7;

/// Faces connected across edges with two faces.
struct OrientedPatch {
    faces: Vec<FaceId>,
    is_closed: bool,
    /// Signed volume, and the area, in the present orientation.
    volume: f64,
    area: f64,
    bounds: Bounds,
}

/// Returns for each face whether it has to be flipped.
pub(crate) fn faces_to_flip(surface: &Surface<'_>) -> Vec<bool> {
    let topology = Topology::unwelded(surface);
    let count = surface.triangles().len();
    let mut turned = vec![false; count];
    let mut patch_of = vec![usize::MAX; count];
    let mut patches: Vec<OrientedPatch> = Vec::new();
    let none = vec![false; count];
    for first in (0..count).map(FaceId::new) {
        if patch_of[first.index()] != usize::MAX {
            continue;
        }
        let number = patches.len();
        patch_of[first.index()] = number;
        let mut faces = vec![first];
        let mut next = 0;
        while let Some(&face) = faces.get(next) {
            next += 1;
            for h in (0..3).map(|k| HalfEdgeId::of(face, k)) {
                let Some(g) = topology.twin(h) else { continue };
                let other = g.face();
                if patch_of[other.index()] == usize::MAX {
                    patch_of[other.index()] = number;
                    let disagree = topology.origin(h) == topology.origin(g);
                    turned[other.index()] = turned[face.index()] ^ disagree;
                    faces.push(other);
                }
            }
        }
        let disagreements = |turned: &[bool]| {
            let edges = faces.iter().flat_map(|&f| (0..3).map(move |k| HalfEdgeId::of(f, k)));
            let twins = edges.filter_map(|h| Some((h, topology.twin(h)?)));
            let wrong = twins.filter(|&(h, g)| {
                let flips = turned[h.face().index()] ^ turned[g.face().index()];
                (topology.origin(h) == topology.origin(g)) ^ flips
            });
            wrong.count()
        };
        let left = disagreements(&turned);
        if left > 0 && left >= disagreements(&none) {
            // One-sided, and no better than before.
            faces.iter().for_each(|f| turned[f.index()] = false);
        }
        if faces.iter().filter(|f| turned[f.index()]).count() * 2 > faces.len() {
            faces.iter().for_each(|f| turned[f.index()] ^= true);
        }
        patches.push(measured(surface, faces, &turned));
    }
    find_closed(&topology, &turned, &patch_of, &mut patches);
    let looks_inward =
        |p: &OrientedPatch| p.is_closed && p.volume < -MIN_VOLUME_SHARE * libm::pow(p.area, 1.5);
    let doubtful: Vec<usize> = (0..patches.len()).filter(|&i| looks_inward(&patches[i])).collect();
    for (&i, is_inside) in doubtful.iter().zip(inside_others(surface, &patches, &patch_of, &doubtful)) {
        // A patch inside another may be a cavity.
        if !is_inside {
            patches[i].faces.iter().for_each(|f| turned[f.index()] ^= true);
        }
    }
    turned
}

fn measured(surface: &Surface<'_>, faces: Vec<FaceId>, turned: &[bool]) -> OrientedPatch {
    let positions = surface.positions();
    let corners = |f: FaceId| surface.triangles()[f.index()].map(|v| positions.get(v));
    let bounds = faces.iter().flat_map(|&f| corners(f)).fold(Bounds::EMPTY, Bounds::with);
    // Relative to the centre and size of the patch: no cancellation far from the origin, no overflow of
    // squares.
    let size = (0..3).map(|k| bounds.max[k] - bounds.min[k]).fold(f64::MIN_POSITIVE, f64::max);
    let middle = [0, 1, 2].map(|k| bounds.min[k] / 2.0 + bounds.max[k] / 2.0);
    let (mut volume, mut area) = (0.0, 0.0);
    for &f in &faces {
        let [a, b, c] = corners(f).map(|p| glam::DVec3::from([0, 1, 2].map(|k| (p[k] - middle[k]) / size)));
        let normal = (b - a).cross(c - a);
        let sign = if turned[f.index()] { -1.0 } else { 1.0 };
        volume += sign * a.dot(normal) / 6.0;
        area += normal.length() / 2.0;
    }
    OrientedPatch { faces, is_closed: true, volume, area, bounds }
}

/// Marks patches as open unless each of their edges is used equally often in both directions.
fn find_closed(topology: &Topology, turned: &[bool], patch_of: &[usize], patches: &mut [OrientedPatch]) {
    let mut sums: Vec<(usize, i32)> = Vec::new();
    for first in topology.edges() {
        sums.clear();
        for h in topology.edge(first) {
            let face = h.face().index();
            let is_along = (topology.origin(h) == topology.origin(first)) ^ turned[face];
            sums.push((patch_of[face], if is_along { 1 } else { -1 }));
        }
        sums.sort_unstable();
        for of_patch in sums.chunk_by(|a, b| a.0 == b.0) {
            if of_patch.iter().map(|s| s.1).sum::<i32>() != 0 {
                patches[of_patch[0].0].is_closed = false;
            }
        }
    }
}

/// Returns for some patches whether each lies inside an odd number of other closed ones.
///
/// A ray upwards from a point of each patch is tested against the faces in its cell of a grid in x and y.
fn inside_others(
    surface: &Surface<'_>,
    patches: &[OrientedPatch],
    patch_of: &[usize],
    asked: &[usize],
) -> Vec<bool> {
    let holds = |outer: &Bounds, inner: &Bounds| {
        (0..3).all(|k| outer.min[k] <= inner.min[k] && outer.max[k] >= inner.max[k])
    };
    if asked.is_empty() {
        return Vec::new();
    }
    let boxes = asked.iter().map(|&i| &patches[i].bounds);
    let all = boxes.fold(Bounds::EMPTY, |all, own| all.with(own.min).with(own.max));
    let meets =
        |p: &OrientedPatch| (0..3).all(|k| p.bounds.min[k] <= all.max[k] && p.bounds.max[k] >= all.min[k]);
    let positions = surface.positions();
    let corners = |f: FaceId| surface.triangles()[f.index()].map(|v| positions.get(v));
    let faces: Vec<FaceId> =
        patches.iter().filter(|p| p.is_closed && meets(p)).flat_map(|p| p.faces.iter().copied()).collect();
    let side = ((faces.len() as f64).sqrt().ceil() as usize).clamp(1, 2048);
    let cell = |x: f64, k: usize| {
        let width = all.max[k] - all.min[k];
        let part = if width > 0.0 { (x - all.min[k]) / width } else { 0.0 };
        ((part * side as f64).max(0.0) as usize).min(side - 1)
    };
    // Only cells with a query point are filled.
    let point = |i: usize| {
        let [a, b, c] = corners(patches[i].faces[0]);
        // Off any symmetry plane of the shape.
        [0, 1, 2].map(|k| a[k] * 0.381 + b[k] * 0.327 + c[k] * 0.292)
    };
    let mut slot = vec![usize::MAX; side * side];
    let mut over: Vec<Vec<FaceId>> = Vec::new();
    for &i in asked {
        let p = point(i);
        let slot = &mut slot[cell(p[1], 1) * side + cell(p[0], 0)];
        if *slot == usize::MAX {
            *slot = over.len();
            over.push(Vec::new());
        }
    }
    for &f in &faces {
        let p = corners(f);
        let range = |k: usize| {
            let low = p[0][k].min(p[1][k]).min(p[2][k]);
            let high = p[0][k].max(p[1][k]).max(p[2][k]);
            if high < all.min[k] || low > all.max[k] { 0..0 } else { cell(low, k)..cell(high, k) + 1 }
        };
        for y in range(1) {
            for x in range(0) {
                if let Some(list) = over.get_mut(slot[y * side + x]) {
                    list.push(f);
                }
            }
        }
    }
    let mut crossed: Vec<usize> = Vec::new();
    asked
        .iter()
        .map(|&i| {
            let p = point(i);
            crossed.clear();
            for &f in &over[slot[cell(p[1], 1) * side + cell(p[0], 0)]] {
                let other = patch_of[f.index()];
                if other != i && holds(&patches[other].bounds, &patches[i].bounds) && is_below(p, corners(f))
                {
                    crossed.push(other);
                }
            }
            crossed.sort_unstable();
            // It is inside each patch that the ray crosses an odd number of times.
            crossed.chunk_by(|a, b| a == b).filter(|c| c.len() % 2 == 1).count() % 2 == 1
        })
        .collect()
}

/// True if a ray upwards from a point crosses a triangle. A point below an edge counts for one of its two
/// faces.
fn is_below(p: [f64; 3], corners: [[f64; 3]; 3]) -> bool {
    let side = |a: [f64; 3], b: [f64; 3]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let mut is_in = false;
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if (a[1] > p[1]) != (b[1] > p[1]) {
            // Evaluated in the same order from either face of the edge.
            let (low, high) = if a[1] < b[1] { (a, b) } else { (b, a) };
            is_in ^= side(low, high) > 0.0;
        }
    }
    if !is_in {
        return false;
    }
    let [a, b, c] = corners.map(|q| [0, 1, 2].map(|k| q[k] - p[k]));
    let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    // Height of the plane over the point.
    n[2] != 0.0 && (n[0] * a[0] + n[1] * a[1] + n[2] * a[2]) / n[2] > 0.0
}
