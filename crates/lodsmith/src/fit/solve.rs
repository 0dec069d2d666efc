//! The solve of the fit: displacements of the vertices from the normal equations of the faces.

use glam::{Vec3, Vec3A};
use lodsmith_core::VertexId;
use wide::f32x4;

use super::MoveGuards;
use super::normal_equations::FaceNormalEquations;
use crate::collapse::kind::Kind;
use crate::collapse::ring::Corner;
use crate::collapse::store::Store;
use crate::cost::lanes::{Four, cross, dot, max, min, splat, sub};
use crate::cost::metric::VertexMemory;
use crate::cost::tensor::Tensor;

/// Fraction of the trace added to the diagonal, to damp the moves.
const DAMPING: f32 = 0.01;
/// Squared cosine of the largest rotation of a face: 60 degrees.
const MAX_TURN: f32 = 0.25;
/// Weight of a border edge's line relative to the samples, so that borders stay on their curve.
const BORDER_LINE_WEIGHT: f32 = 1.0;
/// Smallest determinant that is inverted: faces whose edges are a millionth of the box have it, and single
/// precision hardly distinguishes them from points.
const MIN_DET: f32 = 1e-36;

/// Solves for the displacements by two Gauss-Seidel sweeps. (Measured: a third gains nothing.) A triangle
/// only sees the heights n·delta of its three vertices, their lifts. The second sweep moves the vertices, by
/// no more than the largest distance seen, and only if no triangle rotates far and no guard is broken.
/// Returns the moved vertices that have a sample farther away than the root of `far`.
#[inline(never)]
pub(super) fn solve<Q: VertexMemory>(
    store: &mut Store<Q>,
    loads: &mut [FaceNormalEquations],
    leeway: Vec<f32>,
    far: f32,
    guards: Option<&MoveGuards>,
    tensor: fn(&mut Q) -> &mut Tensor,
) -> Vec<VertexId> {
    for u in 0..store.v.len() {
        let kind = store.v[u].kind;
        if !may_move(kind) {
            continue;
        }
        let id = VertexId(u as u32);
        let corners = store.listed(id);
        let (mut squares, mut products, mut g) = (f32x4::ZERO, f32x4::ZERO, f32x4::ZERO);
        for corner in corners {
            let (load, k) = (&loads[corner.face()], corner.k());
            let n = load.row_of_normal();
            let weighted = n * load.weight(k);
            let ([x, y, _, _], [_, v, w, _]) = (weighted.to_array(), n.to_array());
            squares += weighted * n;
            products += f32x4::new([x, x, y, 0.0]) * f32x4::new([v, w, w, 0.0]);
            g += n * load.missing_lift(k);
        }
        let ([xx, yy, zz, _], [xy, xz, yz, _]) = (squares.to_array(), products.to_array());
        let mut a = Tensor([xx, yy, zz, xy, xz, yz]);
        if kind.is_border() {
            for w in border_neighbours(store, id) {
                a.add(&Tensor::line(store.p(w) - store.v[u].p, BORDER_LINE_WEIGHT));
            }
        }
        let trace = a.trace();
        let (c, det) = a.damped(DAMPING * trace).adjugate();
        let mut inverse = Tensor::default();
        if det > (1e-9 * trace * trace * trace).max(MIN_DET) {
            inverse = Tensor(c.0.map(|x| x * (1.0 / det)));
            lift(corners, loads, inverse.times(first_three(g)));
        }
        *tensor(&mut store.v[u].q) = inverse;
    }
    let mut suspects = Vec::new();
    for (u, leeway) in leeway.into_iter().enumerate() {
        if !may_move(store.v[u].kind) {
            continue;
        }
        let inverse = *tensor(&mut store.v[u].q);
        let id = VertexId(u as u32);
        let corners = store.listed(id);
        let (mut g, mut worst) = (f32x4::ZERO, 0f32);
        for corner in corners {
            let load = &loads[corner.face()];
            g += load.row_of_normal() * load.missing_lift(corner.k());
            worst = max(worst, load.max_distance_sq());
        }
        if inverse.0[0] != 0.0 {
            let delta = inverse.times(first_three(g));
            lift(corners, loads, delta);
            let step = delta.length_squared();
            let p = store.v[u].p + delta * if step > worst { (worst / step).sqrt() } else { 1.0 };
            let is_fine =
                |p| min(step, worst) <= leeway || keeps_orientation(store, loads, id, p, leeway == 0.0);
            let place = match guards {
                _ if step <= 0.0 => None,
                None => is_fine(p).then_some(p),
                Some(guards) => guards.farthest(store, id, p, is_fine),
            };
            if let Some(p) = place {
                let x = &mut store.v[u];
                (x.p, x.kind) = (p, x.kind.moved(true));
            }
        }
        if worst > far && store.v[u].kind.is_moved() {
            suspects.push(id);
        }
    }
    suspects
}

#[inline(always)]
fn first_three(of: f32x4) -> Vec3 {
    let [x, y, z, _] = of.to_array();
    Vec3::new(x, y, z)
}

/// Stores the displacement of a vertex as lifts in the faces around it.
#[inline(always)]
fn lift(around: &[Corner], loads: &mut [FaceNormalEquations], delta: Vec3) {
    let delta = Vec3A::from(delta);
    for c in around {
        let load = &mut loads[c.face()];
        load.numbers_mut()[4 * c.k() + 3] = load.normal().dot(delta);
    }
}

fn may_move(kind: Kind) -> bool {
    kind.is_free() && !kind.is_complex()
}

/// Returns the vertices at the other ends of the border edges of `u`.
fn border_neighbours<Q: VertexMemory>(store: &Store<Q>, u: VertexId) -> impl Iterator<Item = VertexId> + '_ {
    let others = move |c: &Corner| {
        let t = store.t[c.face()];
        [t[(c.k() + 1) % 3], t[(c.k() + 2) % 3]]
    };
    let around = store.listed(u);
    around
        .iter()
        .flat_map(others)
        .filter(move |&w| around.iter().filter(|c| others(c).contains(&w)).count() == 1)
}

/// Returns true if no face of `u` turns over with `u` at `p`, relative to the face as it is and, with
/// `asks_facing`, to the input.
pub(super) fn keeps_orientation<Q: VertexMemory>(
    store: &Store<Q>,
    loads: &[FaceNormalEquations],
    u: VertexId,
    p: Vec3,
    asks_facing: bool,
) -> bool {
    let (from, at) = (splat(store.p(u)), splat(p));
    store.listed(u).chunks(4).all(|few| {
        let last = few.len() - 1;
        let corners = [few[0], few[1.min(last)], few[2.min(last)], few[3.min(last)]];
        let others = corners.map(|c| store.others_at(c));
        let (a, b) = (store.four(others.map(|o| o.0)), store.four(others.map(|o| o.1)));
        let n = normals(loads, corners);
        let (e, s, o) = (sub(&b, &a), sub(&at, &a), sub(&at, &b));
        let after = cross(&e, &s);
        let (d, after_sq) = (dot(&n, &after), dot(&after, &after));
        // Written so that NaN (from an overflow) counts as rotated too far.
        let keeps_side = d.simd_gt(f32x4::ZERO) & (d * d).simd_gt(dot(&n, &n) * MAX_TURN * after_sq);
        let around = dot(&e, &e) + dot(&s, &s) + dot(&o, &o);
        let before = cross(&e, &sub(&from, &a));
        let thins =
            (after_sq * 12.0).simd_lt(around * around * 1e-6) & after_sq.simd_lt(dot(&before, &before));
        let is_sided = || {
            let facing = store.four_facings(corners.map(|c| store.t[c.face()]));
            dot(&after, &facing).simd_ge(f32x4::ZERO) | dot(&n, &facing).simd_lt(f32x4::ZERO)
        };
        keeps_side.to_bitmask() & !thins.to_bitmask() & 0xf == 0xf && (!asks_facing || is_sided().all())
    })
}

/// Returns the normals of the faces at four corners.
#[inline(always)]
fn normals(loads: &[FaceNormalEquations], corners: [Corner; 4]) -> Four {
    let [x, y, z, _] = f32x4::transpose(corners.map(|c| loads[c.face()].0[3]));
    [x, y, z]
}
