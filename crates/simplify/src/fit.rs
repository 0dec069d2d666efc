//! The last step: the vertices of the result move to the least squares of the original surface.
//!
//! Every original vertex knows the final vertex that it was merged into, its home. Samples of the original (centres and
//! corners of faces) take the nearest triangle of the star of their home. Of the samples of a triangle only nine sums
//! are kept, because a vertex moves the surface at barycentric coordinates b by b_k n·delta; then a few Gauss-Seidel
//! sweeps of 3×3 systems. (docs/decisions/0006)

mod values;

use glam::Vec3;
use lodsmith_core::VertexId;
use wide::{f32x4, f32x8};

use crate::collapse::kind::Kind;
use crate::collapse::order::NONE;
use crate::collapse::store::{Corner, Store};
use crate::lanes::{self, Four, cross, dot, splat, sub};
use crate::metric::Memory;
use crate::tensor::Tensor;
use crate::triangle;
pub(crate) use values::{Originals, Values};

/// Samples for a final triangle, at most. (More brings less than 1 %.)
const SAMPLES: usize = 16;
/// Share of the trace that damps the moves.
const DAMPING: f32 = 0.01;
/// Least cosine between the normals of a sample and of its triangle.
const FACING: f32 = 0.3;
/// A sample beside its star counts only up to this share of its height, both squared.
const BESIDE: f32 = 0.01;
/// Farthest that a vertex may end from the original, in RMS heights of the samples.
const TETHER: f32 = 6.0;
/// Share of the tether's square that a sample must lie from a face of a vertex for the tether to be looked at.
const SUSPECT: f32 = 0.25;
/// Squared height, over the mean square that the costs foretell, from which a sample counts by its height rather than by
/// its square, at one sample for each final triangle; it grows with the square of their number. (Measured at 50 %, where
/// there are three and some lie on the wrong triangle: means 1.5 to 3 % lower, RMS equal. Of many samples the square is
/// the better judge: cow and bunny to 100 have 5 to 10 % less RMS by it.)
const ROBUST: f64 = 0.017;
/// Square of the cosine of the largest turn of a face: 60 degrees.
const MAX_TURN: f32 = 0.25;
/// Share of the height of a face, squared, that all its corners may move without a turn of 60 degrees: 11, 17 and 30
/// degrees, one after the other.
const LEEWAY: f32 = 0.04;
/// Weight of a border edge's line against the samples, so that borders stay on their curve.
const BORDER: f32 = 1.0;
/// Least determinant that is divided by: that of faces with edges of a millionth of the box, which single precision
/// hardly tells from points.
const MIN_DET: f32 = 1e-36;
/// Stars kept ready. Samples come in Morton order, so a home is almost always among the last hundred. (64 to 1024 are
/// equal.)
const READY: usize = 128;

/// Up to eight triangles of a vertex' star side by side, for vector instructions, each from that vertex on: unit normal,
/// gradients of the barycentric coordinates of the two corners after it, heights over the three edges.
#[derive(Clone, Copy)]
struct Fan {
    normal: [f32x8; 3],
    second: [f32x8; 3],
    third: [f32x8; 3],
    high: [f32x8; 3],
    corner: [Corner; 8],
}

/// The samples of a final triangle, summed, and what the solve needs beside them: one cache line.
/// b: barycentric coordinates, r: height over the plane.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Load {
    bb: Tensor,
    rb: [f32; 3],
    /// Unit normal of the triangle.
    normal: Vec3,
    /// How far the corners go along the normal.
    lift: [f32; 3],
    /// Largest squared distance.
    worst: f32,
}

impl Load {
    fn of(normal: Vec3) -> Self {
        let (bb, none) = (Tensor::default(), [0.0; 3]);
        Self { bb, rb: none, normal, lift: none, worst: 0.0 }
    }

    /// How far corner `k` ought to go along the normal, weighted, where the others have gone already. (By sums: a branch
    /// on k could not be foretold, and a table needs its bounds checked.)
    #[inline(always)]
    fn wanted(&self, k: usize) -> f32 {
        let (is_first, is_last) = (usize::from(k == 0), usize::from(k == 2));
        // The other two corners; xy, xz, yz of the tensor stand at 3, 4, 5.
        let (i, j) = (is_first, 2 - is_last);
        self.rb[k] - self.bb.0[3 + is_last] * self.lift[i] - self.bb.0[5 - is_first] * self.lift[j]
    }
}

/// What the fit found.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fitted {
    /// RMS distance of the samples to the result, in the unit frame.
    pub(crate) rms: f64,
}

/// The nearest triangle of a star.
#[derive(Clone, Copy)]
struct Nearest {
    distance_sq: f32,
    beside: f32,
    height: f32,
    /// Barycentric coordinates of the two corners after `corner`.
    second: f32,
    third: f32,
    corner: Corner,
}

/// Four final triangles side by side, from one of their corners on.
struct FourFaces {
    /// Unit normals.
    normal: Four,
    /// Gradients of the barycentric coordinates of the second and third corner.
    second: Four,
    third: Four,
    /// Squared heights over the edges opposite to the corners.
    high_sq: [f32x4; 3],
}

impl FourFaces {
    #[inline(always)]
    fn new([a, b, c]: [Four; 3]) -> Self {
        let edges = [sub(&c, &b), sub(&a, &c), sub(&b, &a)];
        let least = f32x4::splat(1e-36);
        let normal = cross(&edges[2], &sub(&c, &a));
        let area_sq = dot(&normal, &normal).fast_max(least);
        let per_area = f32x4::ONE / area_sq.sqrt();
        let normal = normal.map(|x| x * per_area);
        let slope = normal.map(|x| x * per_area);
        let high_sq = [0, 1, 2].map(|k| area_sq / dot(&edges[k], &edges[k]).fast_max(least));
        Self { normal, second: cross(&slope, &edges[1]), third: cross(&slope, &edges[2]), high_sq }
    }

    /// Which of them are no slivers and face as the input did there (`facing`), within 30 degrees: no turn that is allowed
    /// turns their back.
    #[inline(always)]
    fn are_sound(&self, facing: &Four) -> f32x4 {
        let [x, y, z] = self.high_sq;
        let d = dot(&self.normal, facing);
        // The least height stands on the longest edge: height² = area · height / edge.
        let (least, most) = (x.fast_min(y).fast_min(z), x.fast_max(y).fast_max(z));
        d.simd_gt(f32x4::ZERO) & (d * d).simd_gt(dot(facing, facing) * 0.75) & least.simd_gt(most * 1e-4)
    }
}

/// Where a sample came to count.
#[derive(Clone, Copy)]
struct Placed {
    face: usize,
    /// Barycentric coordinates.
    b: Vec3,
    weight: f32,
}

struct Sampler<'a, Q: Memory> {
    store: &'a Store<Q>,
    ready: Vec<(VertexId, Vec<Fan>)>,
    loads: Vec<Load>,
    /// Squared height above which samples count less.
    usual: f32,
    rr: f64,
    weight: f64,
}

impl<Q: Memory> Sampler<'_, Q> {
    /// Which slot holds the star of `u`, made if need be.
    #[inline(always)]
    fn star(&mut self, u: VertexId) -> usize {
        // (A power of two of them: no division.)
        let slot = u.index() & (self.ready.len() - 1);
        if self.ready[slot].0 != u {
            self.make_star(u, slot);
        }
        slot
    }

    #[inline(never)]
    fn make_star(&mut self, u: VertexId, slot: usize) {
        let store = self.store;
        let (name, fans) = &mut self.ready[slot];
        *name = u;
        fans.clear();
        let list = store.listed(u);
        fans.reserve_exact(list.len().div_ceil(8));
        let at = splat(store.p(u));
        for corners in list.chunks(8) {
            // Lanes that are not used repeat the last triangle: the first of equals is taken.
            let corner: [Corner; 8] = std::array::from_fn(|i| corners[i.min(corners.len() - 1)]);
            let others = corner.map(|c| store.others_at(c));
            let four = |few: [(VertexId, VertexId); 4]| {
                FourFaces::new([at, store.four(few.map(|o| o.0)), store.four(few.map(|o| o.1))])
            };
            let [a, b, c, d, e, f, g, h] = others;
            let (low, high) = (four([a, b, c, d]), four([e, f, g, h]));
            let join = |low: Four, high: Four| [0, 1, 2].map(|i| bytemuck::cast([low[i], high[i]]));
            fans.push(Fan {
                normal: join(low.normal, high.normal),
                second: join(low.second, high.second),
                third: join(low.third, high.third),
                high: join(low.high_sq, high.high_sq).map(f32x8::sqrt),
                corner,
            });
        }
    }

    /// Finds the nearest triangle of a star that faces a sample's way, if one is nearer than what was found.
    #[inline(always)]
    fn nearest(&self, slot: usize, q: Vec3, normal: Vec3, best: &mut Nearest) {
        let mut found = *best;
        for fan in &self.ready[slot].1 {
            fan.nearest(q, |d2| d2, &mut found);
        }
        // That it does not face the sample's way is rare, and looked at afterwards.
        if found.distance_sq < best.distance_sq {
            if self.loads[found.corner.face()].normal.dot(normal) > FACING {
                *best = found;
            } else {
                self.nearest_facing(slot, q, normal, best);
            }
        }
    }

    #[inline(never)]
    fn nearest_facing(&self, slot: usize, q: Vec3, normal: Vec3, best: &mut Nearest) {
        for fan in &self.ready[slot].1 {
            let [x, y, z] = fan.normal;
            let faces = (x * normal.x + y * normal.y + z * normal.z).simd_gt(f32x8::splat(FACING));
            fan.nearest(q, |d2| faces.bitselect(d2, f32x8::splat(f32::INFINITY)), best);
        }
    }

    /// A sample that is the place of a final vertex: it holds it where it is.
    #[inline(always)]
    fn place_at_home(&mut self, weight: f32, home: VertexId) {
        if let Some(corner) = self.store.listed(home).first() {
            self.loads[corner.face()].bb.0[corner.k()] += weight;
            self.weight += f64::from(weight);
        }
    }

    /// Gives a sample to a face if it lies above or below it.
    #[inline(always)]
    fn place_on(&mut self, face: usize, p: Vec3, weight: f32) -> Option<Placed> {
        let [a, b, c] = self.store.t[face].map(|w| self.store.p(w));
        let (q, first, second, normal) = (p - a, b - a, c - a, self.loads[face].normal);
        let per_area = 1.0 / max(first.cross(second).dot(normal), 1e-18);
        let [v, w] = shares(q, first, second, normal).map(|x| x * per_area);
        let u = 1.0 - v - w;
        if u < 0.0 || v < 0.0 || w < 0.0 {
            return None;
        }
        let height = normal.dot(q);
        Some(self.add(face, Vec3::new(u, v, w), height, height * height, weight))
    }

    #[inline(always)]
    fn add(&mut self, face: usize, b: Vec3, height: f32, distance_sq: f32, weight: f32) -> Placed {
        let load = &mut self.loads[face];
        let height_sq = height * height;
        self.rr += f64::from(weight * height_sq);
        self.weight += f64::from(weight);
        let weight = weight * (self.usual / (self.usual + height_sq)).sqrt();
        load.bb.add(&Tensor::outer(b, weight));
        load.rb = (Vec3::from(load.rb) + b * (weight * height)).to_array();
        load.worst = max(load.worst, distance_sq);
        Placed { face, b, weight }
    }

    /// Gives a sample to the nearest triangle that faces its way: in the star of its home, then, if it lies beyond the rim
    /// of that star, in the star of the nearer corner of the triangle found. (Beside an edge within the star the other
    /// triangle there was looked at too.)
    #[inline(always)]
    fn place(&mut self, p: Vec3, normal: Vec3, weight: f32, home: VertexId) -> Option<Placed> {
        let mut best = Nearest {
            distance_sq: f32::INFINITY,
            beside: 0.0,
            height: 0.0,
            second: 0.0,
            third: 0.0,
            corner: Corner::default(),
        };
        let slot = self.star(home);
        self.nearest(slot, p - self.store.p(home), normal, &mut best);
        if best.distance_sq == f32::INFINITY {
            return None;
        }
        if best.second + best.third > 1.0 {
            let (second, third) = self.store.others_at(best.corner);
            let next = if best.second > best.third { second } else { third };
            let slot = self.star(next);
            self.nearest(slot, p - self.store.p(next), normal, &mut best);
        }
        if best.beside * best.beside > BESIDE * best.height * best.height {
            return None;
        }
        let (v, w) = (max(best.second, 0.0), max(best.third, 0.0));
        let scale = 1.0 / max(v + w, 1.0);
        let (v, w) = (v * scale, w * scale);
        let (k, mut b) = (best.corner.k(), [0.0; 4]);
        (b[k], b[NEXT[k]], b[PREV[k]]) = (1.0 - v - w, v, w);
        Some(self.add(best.corner.face(), Vec3::new(b[0], b[1], b[2]), best.height, best.distance_sq, weight))
    }
}

/// The two corners after each.
const NEXT: [usize; 4] = [1, 2, 0, 0];
const PREV: [usize; 4] = [2, 0, 1, 0];

impl Fan {
    /// Its triangle that is the nearest to a place `q` (from the vertex) by squared distances as `judged`, if it is nearer
    /// than what was found.
    #[inline(always)]
    fn nearest(&self, q: Vec3, judged: impl Fn(f32x8) -> f32x8, best: &mut Nearest) {
        let (n, s, t, zero) = (&self.normal, &self.second, &self.third, f32x8::ZERO);
        let h = n[0] * q.x + n[1] * q.y + n[2] * q.z;
        let v = s[0] * q.x + s[1] * q.y + s[2] * q.z;
        let w = t[0] * q.x + t[1] * q.y + t[2] * q.z;
        let beside = ((v + w - f32x8::ONE) * self.high[0]).fast_max((zero - v) * self.high[1]);
        let beside = beside.fast_max((zero - w) * self.high[2]).fast_max(zero);
        let d2 = judged(h * h + beside * beside);
        let d = d2.to_array();
        let half = |k: usize| min(d[k], d[k + 4]);
        let least = min(min(half(0), half(1)), min(half(2), half(3)));
        if least < best.distance_sq {
            let i = d2.simd_eq(f32x8::splat(least)).to_bitmask().trailing_zeros() as usize & 7;
            *best = Nearest {
                distance_sq: least,
                beside: beside.to_array()[i],
                height: h.to_array()[i],
                second: v.to_array()[i],
                third: w.to_array()[i],
                corner: self.corner[i],
            };
        }
    }
}

/// The smaller of two, without the care for NaN that costs `f32::min` a few instructions.
#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger of two, likewise.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Moves the vertices of a compact store towards the original, given as the ordered input, from which it is about `away`
/// (RMS) far. The samples are shown to `values`, if there are any.
pub(crate) fn fit<Q: Memory>(
    store: &mut Store<Q>,
    points: &[Vec3],
    faces: &[[VertexId; 3]],
    away: f64,
    mut values: Option<&mut Values<'_>>,
) -> Fitted {
    if store.t.is_empty() {
        return Fitted::default();
    }
    let home = store.homes();
    let Begun { loads, mut around } = begin(store);
    let per_face = (points.len() + faces.len()) as f64 / store.t.len() as f64;
    let mut sampler = Sampler {
        store,
        ready: vec![(NONE, Vec::new()); READY.min(store.v.len().next_power_of_two())],
        loads,
        usual: (ROBUST * (per_face * away).powi(2)).clamp(1e-30, 1e30) as f32,
        rr: 0.0,
        weight: 0.0,
    };
    // Exact quadrature of squares: 3/4 of the area at the centre, 1/12 at each corner. A vertex has six corners, about.
    let stride = ((per_face / SAMPLES as f64) as usize).max(1);
    // A face that lives on has its place among the final ones: both are in the same order, and no dead face has three
    // homes.
    let mut survivors = 0;
    let (mut faces_to_skip, mut takes_corner) = (0, false);
    for (i, t) in faces.iter().enumerate() {
        let homes = t.map(|w| home[w.index()]);
        let survivor = (store.t.get(survivors) == Some(&homes)).then_some(survivors);
        survivors += usize::from(survivor.is_some());
        if faces_to_skip > 0 {
            faces_to_skip -= 1;
            continue;
        }
        (faces_to_skip, takes_corner) = (stride - 1, !takes_corner);
        // Where two corners went to one place, the face is rather there.
        let u = if homes[1] == homes[2] { homes[1] } else { homes[0] };
        if u == NONE {
            continue;
        }
        let [a, b, c] = t.map(|w| points[w.index()]);
        let normal = (b - a).cross(c - a);
        let area = normal.length();
        let n = normal * (1.0 / max(area, 1e-30));
        let centre = (a + (b + c)) * (1.0 / 3.0);
        let placed = survivor.and_then(|face| sampler.place_on(face, centre, 9.0 * area));
        let placed = placed.or_else(|| sampler.place(centre, n, 9.0 * area, u));
        if let (Some(values), Some(placed)) = (&mut values, placed) {
            values.add_centre(i, placed.face, placed.b, placed.weight);
        }
        if takes_corner && homes[0] != NONE {
            if sampler.store.p(homes[0]) == a {
                sampler.place_at_home(6.0 * area, homes[0]);
                if let Some(values) = &mut values {
                    values.add_at_home(i, sampler.store.listed(homes[0]), 6.0 * area);
                }
            } else {
                let placed = sampler.place(a, n, 6.0 * area, homes[0]);
                if let (Some(values), Some(placed)) = (&mut values, placed) {
                    values.add_corner(i, placed.face, placed.b, placed.weight);
                }
            }
        }
    }
    let Sampler { mut loads, rr, weight, .. } = sampler;
    let delta = solve(store, &mut loads, &mut around);
    let gain = |l: &Load| {
        let lift = Vec3::from(l.lift);
        lift.dot(2.0 * Vec3::from(l.rb) - l.bb.times(lift))
    };
    let after = rr - loads.iter().map(|l| f64::from(gain(l))).sum::<f64>();
    shift(store, &loads, &around, &delta);
    let limit = TETHER * TETHER * (rr / weight.max(1e-30)) as f32;
    tether(store, &loads, &around, points, faces, &home, limit);
    Fitted { rms: (after.max(0.0) / weight.max(1e-30)).sqrt() }
}

/// Gauss-Seidel on the displacements, two sweeps. (Measured: a third brings nothing.) A triangle only sees the heights
/// n·delta of its three vertices, its lift. Notes the worst of the samples around those that may move.
fn solve<Q: Memory>(store: &Store<Q>, loads: &mut [Load], around: &mut [Around]) -> Vec<Vec3> {
    let mut delta = vec![Vec3::ZERO; store.v.len()];
    let mut inverse = vec![Tensor::default(); store.v.len()];
    for u in 0..store.v.len() {
        if !may_move(store.v[u].kind) {
            continue;
        }
        let (mut a, mut g, mut worst) = (Tensor::default(), Vec3::ZERO, 0f32);
        let id = VertexId(u as u32);
        for &corner in store.listed(id) {
            let load = &loads[corner.face()];
            let n = load.normal;
            a.add(&Tensor::outer(n, load.bb.0[corner.k()]));
            g += n * load.wanted(corner.k());
            worst = max(worst, load.worst);
        }
        around[u].worst = worst;
        if store.v[u].kind.is_border() {
            for w in border_neighbours(store, id) {
                a.add(&Tensor::line(store.p(w) - store.v[u].p, BORDER));
            }
        }
        let trace = a.trace();
        let (c, det) = a.damped(DAMPING * trace).adjugate();
        if det > (1e-9 * trace * trace * trace).max(MIN_DET) {
            inverse[u] = Tensor(c.0.map(|x| x * (1.0 / det)));
            delta[u] = inverse[u].times(g);
            lift(store.listed(id), loads, delta[u]);
        }
    }
    for (u, inverse) in inverse.iter().enumerate().filter(|x| x.1.0[0] != 0.0) {
        let around = store.listed(VertexId(u as u32));
        let wanted = |c: &Corner| loads[c.face()].normal * loads[c.face()].wanted(c.k());
        delta[u] = inverse.times(around.iter().map(wanted).sum());
        lift(around, loads, delta[u]);
    }
    delta
}

/// Notes in the faces around a vertex where it goes.
#[inline(always)]
fn lift(around: &[Corner], loads: &mut [Load], delta: Vec3) {
    for c in around {
        let load = &mut loads[c.face()];
        load.lift[c.k()] = load.normal.dot(delta);
    }
}

fn may_move(kind: Kind) -> bool {
    kind.is_free() && !kind.is_complex()
}

/// The vertices at the other ends of the border edges of `u`.
fn border_neighbours<Q: Memory>(store: &Store<Q>, u: VertexId) -> impl Iterator<Item = VertexId> + '_ {
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

/// Whether every face of `u` keeps its side with `u` at `p`: of the face as it is, and, with `asks_facing`, of the input.
fn is_fine<Q: Memory>(store: &Store<Q>, loads: &[Load], u: VertexId, p: Vec3, asks_facing: bool) -> bool {
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
        // Written so that no number (an overflow) counts as turned.
        let keeps_side = d.simd_gt(f32x4::ZERO) & (d * d).simd_gt(dot(&n, &n) * MAX_TURN * after_sq);
        let around = dot(&e, &e) + dot(&s, &s) + dot(&o, &o);
        let before = cross(&e, &sub(&from, &a));
        let thins =
            (after_sq * 12.0).simd_lt(around * around * 1e-6) & after_sq.simd_lt(dot(&before, &before));
        let is_sided = || {
            corners.iter().enumerate().all(|(i, c)| {
                let facing = store.facing(&store.t[c.face()]);
                let after = Vec3::from(after.map(|x| x.to_array()[i]));
                after.dot(facing) >= 0.0 || loads[c.face()].normal.dot(facing) < 0.0
            })
        };
        keeps_side.to_bitmask() & !thins.to_bitmask() & 0xf == 0xf && (!asks_facing || is_sided())
    })
}

/// The normals of the faces at four corners.
#[inline(always)]
fn normals(loads: &[Load], corners: [Corner; 4]) -> Four {
    let row = |c: Corner| {
        let Load { normal, lift, .. } = &loads[c.face()];
        f32x4::new([normal.x, normal.y, normal.z, lift[0]])
    };
    let [x, y, z, _] = f32x4::transpose(corners.map(row));
    [x, y, z]
}

/// What the faces around a vertex say of it.
#[derive(Clone, Copy)]
struct Around {
    /// The largest squared distance of a sample.
    worst: f32,
    /// The square of a move that no face minds, even if all its corners go as far; 0 unless all face as the input did.
    leeway: f32,
}

/// What is known of the final triangles before the samples.
struct Begun {
    loads: Vec<Load>,
    around: Vec<Around>,
}

fn begin<Q: Memory>(store: &Store<Q>) -> Begun {
    let mut around = vec![Around { worst: 0.0, leeway: f32::INFINITY }; store.v.len()];
    let mut loads = Vec::with_capacity(store.t.len());
    for few in store.t.chunks(4) {
        let t = [0, 1, 2, 3].map(|i: usize| few[i.min(few.len() - 1)]);
        let four = FourFaces::new([0, 1, 2].map(|k| store.four(t.map(|t| t[k]))));
        let is_sound = four.are_sound(&lanes::four(t.map(|t| store.facing(&t))));
        let leeway = four.high_sq.map(|high_sq| (is_sound & (high_sq * LEEWAY)).to_array());
        let normals = lanes::each(&four.normal);
        for (i, t) in few.iter().enumerate() {
            for (w, leeway) in t.iter().zip(leeway) {
                let of = &mut around[w.index()].leeway;
                *of = min(*of, leeway[i % 4]);
            }
            loads.push(Load::of(normals[i % 4]));
        }
    }
    Begun { loads, around }
}

/// Moves, by no more than the largest distance seen, and only where no triangle turns far.
fn shift<Q: Memory>(store: &mut Store<Q>, loads: &[Load], around: &[Around], delta: &[Vec3]) {
    for (u, (&delta, &Around { worst, leeway })) in delta.iter().zip(around).enumerate() {
        let step = delta.length_squared();
        if step == 0.0 {
            continue;
        }
        let id = VertexId(u as u32);
        let p = store.v[u].p + delta * if step > worst { (worst / step).sqrt() } else { 1.0 };
        if min(step, worst) <= leeway || is_fine(store, loads, id, p, leeway == 0.0) {
            let x = &mut store.v[u];
            (x.p, x.kind) = (p, x.kind.moved(true));
        }
    }
}

/// Areas of the two triangles that a place `q` makes with the sides `first` and `second`, along `normal`, times its length:
/// over that of the face, the barycentric coordinates of the second and third corner. All from the first corner.
#[inline(always)]
fn shares(q: Vec3, first: Vec3, second: Vec3, normal: Vec3) -> [f32; 2] {
    [normal.dot(q.cross(second)), normal.dot(first.cross(q))]
}

/// Whether a place lies above or below a face, no farther than the root of `limit`.
#[inline(always)]
fn is_above(p: Vec3, [a, b, c]: [Vec3; 3], limit: f32) -> bool {
    let (q, first, second) = (p - a, b - a, c - a);
    let normal = first.cross(second);
    let (area_sq, height) = (normal.length_squared(), normal.dot(q));
    let [v, w] = shares(q, first, second, normal);
    (height * height <= limit * area_sq) & (v >= 0.0) & (w >= 0.0) & (v + w <= area_sq)
}

/// Pulls in vertices that stick out farther than the root of `limit`. It is enough to look round the nearest of the
/// points merged into a vertex: an exact pass over all faces doubles the time of the fit.
fn tether<Q: Memory>(
    store: &mut Store<Q>,
    loads: &[Load],
    around: &[Around],
    points: &[Vec3],
    faces: &[[VertexId; 3]],
    home: &[VertexId],
    limit: f32,
) {
    // A vertex that sticks out leaves the surface below it far from its faces.
    let suspect: Vec<bool> = store
        .v
        .iter()
        .zip(around)
        .map(|(x, of)| of.worst > SUSPECT * limit && may_move(x.kind) && x.kind.is_moved())
        .collect();
    let mut nearest_point = vec![(f32::INFINITY, NONE); store.v.len()];
    for (i, (&q, &h)) in points.iter().zip(home).enumerate() {
        if h != NONE && suspect[h.index()] {
            let d2 = (q - store.p(h)).length_squared();
            let best = &mut nearest_point[h.index()];
            if d2 < best.0 {
                *best = (d2, VertexId(i as u32));
            }
        }
    }
    let mut look = vec![false; points.len()];
    let mut any = false;
    for best in &nearest_point {
        if best.0 > limit && best.1 != NONE {
            (look[best.1.index()], any) = (true, true);
        }
    }
    if !any {
        return;
    }
    drop(nearest_point);
    // Nearly all lie above one of the faces there: what is farther is asked for afterwards, of those that do not.
    let corners = |t: &[VertexId; 3]| t.map(|w| points[w.index()]);
    let mut is_near = vec![false; store.v.len()];
    let mut others: Vec<(VertexId, &[VertexId; 3])> = Vec::new();
    for t in faces {
        // (Few are looked at.)
        let [a, b, c] = t.map(|w| look[w.index()]);
        if !(a | b | c) {
            continue;
        }
        for w in t.iter().filter(|w| look[w.index()]) {
            let h = home[w.index()];
            if !is_near[h.index()] {
                is_near[h.index()] = is_above(store.p(h), corners(t), limit);
                others.push((h, t));
            }
        }
    }
    let mut found = vec![(f32::INFINITY, Vec3::ZERO); store.v.len()];
    for (h, t) in others {
        let found = &mut found[h.index()];
        if !is_near[h.index()] && found.0 > limit {
            let [a, b, c] = corners(t);
            let near = triangle::closest(store.p(h), a, b, c);
            if near.0 < found.0 {
                *found = near;
            }
        }
    }
    for (u, &(d, q)) in found.iter().enumerate() {
        if d > limit && d.is_finite() {
            let id = VertexId(u as u32);
            let p = q + (store.p(id) - q) * (limit / d).sqrt();
            if is_fine(store, loads, id, p, true) {
                store.v[u].p = p;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_takes_the_side_that_it_faces() {
        // A sheet folded along 0-1: both sides run to the right, one looks up and one down.
        //     0 ---- 2  (above 3)
        //      \    /
        //        1
        let points = [[0.0, 0.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.1], [1.0, 1.0, -0.1]].map(Vec3::from);
        let faces = [[0, 1, 2], [0, 3, 1]].map(|t| t.map(VertexId));
        let mut store = Store::<Tensor>::new(&points, faces.to_vec(), None, None);
        store.link();
        let Begun { loads, .. } = begin(&store);
        let (ready, normals) = (vec![(NONE, Vec::new()); 4], [Vec3::Z, -Vec3::Z, Vec3::Y]);
        let mut sampler = Sampler { store: &store, ready, loads, usual: 1.0, rr: 0.0, weight: 0.0 };
        // Nearer to the lower side.
        let sample = Vec3::new(0.6, 0.1, -0.03);
        let mut side = |normal| sampler.place(sample, normal, 1.0, VertexId(0)).map(|placed| placed.face);
        assert_eq!(normals.map(&mut side), [Some(0), Some(1), None]);
        let taken = |l: &Load| Vec3::from(l.rb).element_sum();
        assert!(sampler.loads.iter().all(|l| taken(l) != 0.0), "both sides have their sample");
    }
}
