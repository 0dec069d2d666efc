//! Final least-squares fit: moves the vertices of the result towards the original surface.
//!
//! Each original vertex knows the final vertex that it was merged into, its home. Samples of the original
//! (centres and corners of faces) are assigned to the nearest triangle of the star of their home. A vertex
//! displaced by delta moves the surface at barycentric coordinates b by b_k n·delta, so nine sums for each
//! triangle stand for its samples. Then a few Gauss-Seidel sweeps of 3×3 systems are done.
//! (docs/decisions/0006)

mod move_guards;
#[cfg(test)]
mod simd_tests;
mod values;

use glam::{Vec3, Vec3A, Vec4};
use lodsmith_core::VertexId;
use wide::{f32x4, f32x8};

use crate::collapse::kind::Kind;
use crate::collapse::order::{NONE, TIME_OVER_MEMORY_MAX_FACES};
use crate::collapse::ring::Corner;
use crate::collapse::store::Store;
use crate::collapse::vertex::Vertex;
use crate::lanes::{Four, cross, dot, splat, sub};
use crate::metric::VertexMemory;
use crate::ordered_input::OrderedInput;
use crate::tensor::Tensor;
use crate::triangle;
pub(crate) use move_guards::MoveGuards;
pub(crate) use values::{Originals, Values};

/// Largest number of samples for each final triangle. (More brings less than 1 %.)
const MAX_SAMPLES_PER_FACE: usize = 16;
/// Fraction of the trace added to the diagonal, to damp the moves.
const DAMPING: f32 = 0.01;
/// Least cosine between the normals of a sample and its triangle.
const MIN_FACING_COS: f32 = 0.3;
/// Largest lateral distance of a sample outside its triangle, relative to its height, both squared.
const MAX_LATERAL_SQ: f32 = 0.01;
/// Largest distance of a vertex from the original, in RMS heights of the samples.
const MAX_OUTLIER_RMS: f32 = 6.0;
/// Distance from the original that is always permitted, in units of the largest distance of a sample of the
/// vertex' faces, squared. A flat part has an RMS height near zero, and vertices on its fillets lie farther
/// out. (Measured: docs/decisions/0006.)
const MAX_OUTLIER_STAR_SQ: f32 = 2.0;
/// Fraction of the squared limit that a sample must lie from a face of a vertex for the vertex to be checked
/// as an outlier.
const OUTLIER_CHECK_SHARE: f32 = 0.25;
/// Squared height, over the mean square predicted by the costs, above which a sample counts by its height
/// instead of its square, at one sample for each final triangle; it grows with the square of their number.
/// (Measured at 50 %, where there are three and some lie on the wrong triangle: means 1.5 to 3 % lower, RMS
/// equal. With many samples the square is better: cow and bunny to 100 have 5 to 10 % less RMS by it.)
const ROBUST_HEIGHT_SQ: f64 = 0.017;
/// Squared cosine of the largest rotation of a face: 60 degrees.
const MAX_TURN: f32 = 0.25;
/// Fraction of the height of a face, squared, that all its corners may move without a rotation of 60 degrees:
/// 11, 17 and 30 degrees, one after the other.
const FREE_MOVE_SHARE_SQ: f32 = 0.04;
/// Weight of a border edge's line relative to the samples, so that borders stay on their curve.
const BORDER_LINE_WEIGHT: f32 = 1.0;
/// Least determinant that is inverted: that of faces with edges of a millionth of the box, which single
/// precision hardly distinguishes from points.
const MIN_DET: f32 = 1e-36;
/// Number of stars in the cache. Samples come in Morton order, so a home is nearly always among the last
/// hundred. (64 to 1024 are equal.)
const STAR_CACHE_SIZE: usize = 128;

/// Prefetch distance for positions, in samples. (Guessed.)
const PREFETCH_DISTANCE: usize = 8;

/// Up to eight triangles of a vertex' star in SIMD lanes, each starting at that vertex: unit normal,
/// gradients of the barycentric coordinates of the two corners after it, heights over the three edges.
#[derive(Clone, Copy)]
struct Fan {
    normal: [f32x8; 3],
    second: [f32x8; 3],
    third: [f32x8; 3],
    high: [f32x8; 3],
    corner: [Corner; 8],
}

/// Sums over the samples of a final triangle, and its normal and lifts for the solve: one cache line, four
/// rows of three numbers and one more each. b: barycentric coordinates, r: height over the plane.
///
/// ```text
/// b0 b0  b1 b1  b2 b2    lift of corner 0: how far it goes along the normal
/// b1 b2  b0 b2  b0 b1    lift of corner 1
/// r b0   r b1   r b2     lift of corner 2
/// unit normal            largest squared distance
/// ```
#[derive(Clone, Copy, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct FaceNormalEquations([f32x4; 4]);

/// For each corner, the indices in a [`FaceNormalEquations`] of its product with another corner, that corner's lift, and the
/// same for the third corner.
const PRODUCT_INDICES: [[usize; 4]; 4] = [[6, 7, 5, 11], [6, 3, 4, 11], [5, 3, 4, 7], [0; 4]];

impl FaceNormalEquations {
    #[inline(always)]
    fn numbers(&self) -> &[f32; 16] {
        bytemuck::cast_ref(&self.0)
    }

    #[inline(always)]
    fn numbers_mut(&mut self) -> &mut [f32; 16] {
        bytemuck::cast_mut(&mut self.0)
    }

    /// Returns the normal with a zero in the fourth lane: the square of the value there may be a subnormal
    /// number, and those are a hundred times as slow.
    #[inline(always)]
    fn row_of_normal(&self) -> f32x4 {
        let all = f32::from_bits(!0);
        self.0[3] & f32x4::new([all, all, all, 0.0])
    }

    #[inline(always)]
    fn normal(&self) -> Vec3A {
        Vec3A::from_vec4(Vec4::from_array(self.row_of_normal().to_array()))
    }

    #[inline(always)]
    fn max_distance_sq(&self) -> f32 {
        self.numbers()[15]
    }

    /// Returns the coefficient of the square of corner `k`'s lift.
    #[inline(always)]
    fn weight(&self, k: usize) -> f32 {
        self.numbers()[k]
    }

    /// Returns the weighted lift that corner `k` still lacks, given the lifts of the others. (By a table: a
    /// branch on k is unpredictable.)
    #[inline(always)]
    fn missing_lift(&self, k: usize) -> f32 {
        let (n, [a, b, c, d]) = (self.numbers(), PRODUCT_INDICES[k]);
        n[8 + k] - n[a] * n[b] - n[c] * n[d]
    }

    /// Returns the reduction of the sum of squares by the lifts.
    #[inline(always)]
    fn gain(&self) -> f32 {
        let n = self.numbers();
        let lift = Vec3::new(n[3], n[7], n[11]);
        let bb = Tensor([n[0], n[1], n[2], n[6], n[5], n[4]]);
        lift.dot(2.0 * Vec3::new(n[8], n[9], n[10]) - bb.times(lift))
    }

    /// Adds a sample.
    #[inline(always)]
    fn add(&mut self, b: f32x4, weight: f32, height: f32, distance_sq: f32) {
        let weighted = b * weight;
        let ([x, y, _, none], [_, v, w, _]) = (weighted.to_array(), b.to_array());
        self.0[0] += weighted * b;
        self.0[1] += f32x4::new([y, x, x, none]) * f32x4::new([w, w, v, none]);
        self.0[2] += b * (weight * height);
        let worst = &mut self.numbers_mut()[15];
        *worst = max(*worst, distance_sq);
    }
}

/// Result of the fit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fitted {
    /// RMS distance of the samples to the result, in the unit frame.
    pub(crate) rms: f64,
}

/// The nearest triangle of a star.
#[derive(Clone, Copy)]
struct Nearest {
    distance_sq: f32,
    lateral: f32,
    height: f32,
    /// Barycentric coordinates of the two corners after `corner`.
    second: f32,
    third: f32,
    corner: Corner,
}

/// Four final triangles in SIMD lanes, each starting at one of its corners.
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

    /// Returns a mask of the triangles that are no slivers and face within 30 degrees of the input's
    /// direction there (`facing`): no permitted rotation turns these over.
    #[inline(always)]
    fn are_sound(&self, facing: &Four) -> f32x4 {
        let [x, y, z] = self.high_sq;
        let d = dot(&self.normal, facing);
        // The least height belongs to the longest edge: height² = area · height / edge.
        let (least, most) = (x.fast_min(y).fast_min(z), x.fast_max(y).fast_max(z));
        d.simd_gt(f32x4::ZERO) & (d * d).simd_gt(dot(facing, facing) * 0.75) & least.simd_gt(most * 1e-4)
    }
}

/// Triangle and position that a sample was assigned to.
#[derive(Clone, Copy)]
struct AssignedSample {
    face: usize,
    /// Barycentric coordinates.
    b: Vec3,
    weight: f32,
}

/// A cached star: its first eight triangles, and the others.
#[derive(Clone)]
struct CachedStar {
    of: VertexId,
    first: Fan,
    other_fans: Vec<Fan>,
}

impl CachedStar {
    const NONE: Self = Self { of: NONE, first: Fan::NONE, other_fans: Vec::new() };

    #[inline(never)]
    fn make<Q: VertexMemory>(&mut self, store: &Store<Q>, u: VertexId) {
        self.of = u;
        self.other_fans.clear();
        let mut few = store.listed(u).chunks(8);
        match few.next() {
            Some(corners) => self.first.make(store, u, corners),
            None => self.first = Fan::NONE,
        }
        for corners in few {
            let mut fan = Fan::NONE;
            fan.make(store, u, corners);
            self.other_fans.push(fan);
        }
    }

    /// Returns the triangle nearest to a point `q` (relative to the vertex), if it is nearer than `within`,
    /// squared.
    #[inline(always)]
    fn nearest(&self, q: Vec3A, within: f32) -> Option<Nearest> {
        let mut found = self.first.nearest(q, |d2| d2, within);
        for fan in &self.other_fans {
            found = fan.nearest(q, |d2| d2, found.map_or(within, |found| found.distance_sq)).or(found);
        }
        found
    }

    /// Returns the nearest triangle among those that face the way of a sample, whose normal has this length.
    #[cold]
    #[inline(never)]
    fn nearest_facing(&self, q: Vec3A, (normal, length): (Vec3A, f32), within: f32) -> Option<Nearest> {
        let mut found: Option<Nearest> = None;
        for fan in std::iter::once(&self.first).chain(&self.other_fans) {
            let [x, y, z] = fan.normal;
            let faces =
                (x * normal.x + y * normal.y + z * normal.z).simd_gt(f32x8::splat(MIN_FACING_COS * length));
            let judged = |d2| faces.bitselect(d2, f32x8::splat(f32::INFINITY));
            found = fan.nearest(q, judged, found.map_or(within, |found| found.distance_sq)).or(found);
        }
        found
    }
}

struct Sampler<'a, Q: VertexMemory> {
    store: &'a Store<Q>,
    /// The vertices of the store.
    vertices: &'a [Vertex<Q>],
    cache: Vec<CachedStar>,
    loads: Vec<FaceNormalEquations>,
    /// Squared height above which samples count less.
    robust_height_sq: f32,
    height_sq_sum: f64,
    weight: f64,
}

impl<Q: VertexMemory> Sampler<'_, Q> {
    /// Returns the nearest triangle of the star of `u` that faces a sample's way, if it is nearer than
    /// `within`, squared. The normal of the sample comes with its length.
    #[inline(always)]
    fn nearest(&mut self, u: VertexId, p: Vec3A, normal: (Vec3A, f32), within: f32) -> Option<Nearest> {
        // (The length is a power of two: no division.)
        let slot = u.index() & (self.cache.len() - 1);
        let star = &mut self.cache[slot];
        if star.of != u {
            star.make(self.store, u);
        }
        let q = p - in_register(self.vertices[u.index()].p);
        let found = star.nearest(q, within)?;
        // That it faces away is rare, so it is checked afterwards.
        if self.loads[found.corner.face()].normal().dot(normal.0) > MIN_FACING_COS * normal.1 {
            return Some(found);
        }
        star.nearest_facing(q, normal, within)
    }

    /// Adds a sample at the position of a final vertex, which holds the vertex in place.
    #[inline(always)]
    fn assign_to_home(&mut self, weight: f32, home: VertexId) {
        if let Some(corner) = self.store.listed(home).first() {
            self.loads[corner.face()].numbers_mut()[corner.k()] += weight;
            self.weight += f64::from(weight);
        }
    }

    /// Adds a sample to a face with these corners if its projection lies inside the face.
    #[inline(always)]
    fn assign_to_face(
        &mut self,
        face: usize,
        corners: [VertexId; 3],
        p: Vec3A,
        weight: f32,
    ) -> Option<AssignedSample> {
        let [a, b, c] = corners.map(|w| in_register(self.vertices[w.index()].p));
        let (q, first, second, normal) = (p - a, b - a, c - a, self.loads[face].normal());
        let [area, v, w, height] = dots(normal, [first.cross(second), q.cross(second), first.cross(q), q]);
        let per_area = 1.0 / max(area, 1e-18);
        let (v, w) = (v * per_area, w * per_area);
        let u = 1.0 - v - w;
        if u < 0.0 || v < 0.0 || w < 0.0 {
            return None;
        }
        Some(self.add(face, f32x4::new([u, v, w, 0.0]), height, height * height, weight))
    }

    #[inline(always)]
    fn add(&mut self, face: usize, b: f32x4, height: f32, distance_sq: f32, weight: f32) -> AssignedSample {
        let height_sq = height * height;
        self.height_sq_sum += f64::from(weight * height_sq);
        self.weight += f64::from(weight);
        let weight = weight * (self.robust_height_sq / (self.robust_height_sq + height_sq)).sqrt();
        self.loads[face].add(b, weight, height, distance_sq);
        let [u, v, w, _] = b.to_array();
        AssignedSample { face, b: Vec3::new(u, v, w), weight }
    }

    /// Adds a sample to the nearest triangle that faces its way: in the star of its home or, if it lies
    /// beyond the rim of that star, in the star of the nearer corner of the triangle found. (Beside an edge
    /// inside the star, the other triangle there has been checked too.)
    #[inline(always)]
    fn assign(
        &mut self,
        p: Vec3A,
        normal: (Vec3A, f32),
        weight: f32,
        home: VertexId,
    ) -> Option<AssignedSample> {
        let mut best = self.nearest(home, p, normal, f32::INFINITY)?;
        if best.second + best.third > 1.0 {
            let (second, third) = self.store.others_at(best.corner);
            let next = if best.second > best.third { second } else { third };
            if let Some(nearer) = self.nearest(next, p, normal, best.distance_sq) {
                best = nearer;
            }
        }
        if best.lateral * best.lateral > MAX_LATERAL_SQ * best.height * best.height {
            return None;
        }
        let (v, w) = (max(best.second, 0.0), max(best.third, 0.0));
        let scale = 1.0 / max(v + w, 1.0);
        let (v, w) = (v * scale, w * scale);
        let [first, second, third] = CORNER_UNITS[best.corner.k()];
        let b = first * (1.0 - v - w) + second * v + third * w;
        Some(self.add(best.corner.face(), b, best.height, best.distance_sq, weight))
    }
}

/// For each corner, the unit vectors that move three numbers, of that corner and the two after it, to their
/// places.
const CORNER_UNITS: [[f32x4; 3]; 4] = {
    let [x, y, z] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let (x, y, z) = (f32x4::new(x), f32x4::new(y), f32x4::new(z));
    [[x, y, z], [y, z, x], [z, x, y], [f32x4::ZERO; 3]]
};

impl Fan {
    /// No triangle: comparisons with NaN are false, so it is never nearer.
    const NONE: Self = {
        let (zero, none) = ([f32x8::ZERO; 3], [f32x8::splat(f32::NAN); 3]);
        Self { normal: none, second: zero, third: zero, high: zero, corner: [Corner::new(0, 0); 8] }
    };

    /// Fills it with the triangles at one to eight corners of `u`.
    #[inline(always)]
    fn make<Q: VertexMemory>(&mut self, store: &Store<Q>, u: VertexId, corners: &[Corner]) {
        let at = splat(store.p(u));
        // Unused lanes repeat the last triangle: of equal distances the first is taken.
        let corner: [Corner; 8] = std::array::from_fn(|i| corners[i.min(corners.len() - 1)]);
        let four = |few: [Corner; 4]| {
            let others = few.map(|c| store.others_at(c));
            FourFaces::new([at, store.four(others.map(|o| o.0)), store.four(others.map(|o| o.1))])
        };
        let [a, b, c, d, e, f, g, h] = corner;
        let (low, high) = (four([a, b, c, d]), four([e, f, g, h]));
        let join = |low: Four, high: Four| [0, 1, 2].map(|i| bytemuck::cast([low[i], high[i]]));
        self.normal = join(low.normal, high.normal);
        self.second = join(low.second, high.second);
        self.third = join(low.third, high.third);
        self.high = join(low.high_sq.map(f32x4::sqrt), high.high_sq.map(f32x4::sqrt));
        self.corner = corner;
    }

    /// Returns the triangle nearest to a point `q` (relative to the vertex) by squared distances as mapped by
    /// `judged`, if it is nearer than `within`.
    #[inline(always)]
    fn nearest(&self, q: Vec3A, judged: impl Fn(f32x8) -> f32x8, within: f32) -> Option<Nearest> {
        let (n, s, t, zero) = (&self.normal, &self.second, &self.third, f32x8::ZERO);
        let h = n[0] * q.x + n[1] * q.y + n[2] * q.z;
        let v = s[0] * q.x + s[1] * q.y + s[2] * q.z;
        let w = t[0] * q.x + t[1] * q.y + t[2] * q.z;
        let beside = ((v + w - f32x8::ONE) * self.high[0]).fast_max((zero - v) * self.high[1]);
        let beside = beside.fast_max((zero - w) * self.high[2]).fast_max(zero);
        let d2 = judged(h * h + beside * beside);
        let [low, high] = bytemuck::cast::<f32x8, [f32x4; 2]>(d2);
        let d = low.fast_min(high).to_array();
        let least = min(min(d[0], d[2]), min(d[1], d[3]));
        (least < within).then(|| {
            let i = d2.simd_eq(f32x8::splat(least)).to_bitmask().trailing_zeros() as usize & 7;
            Nearest {
                distance_sq: least,
                lateral: beside.to_array()[i],
                height: h.to_array()[i],
                second: v.to_array()[i],
                third: w.to_array()[i],
                corner: self.corner[i],
            }
        })
    }
}

/// Returns true if two faces have the same corners. (All are compared: a branch on each is unpredictable.)
#[inline(always)]
fn is_same(s: &[VertexId; 3], t: &[VertexId; 3]) -> bool {
    (s[0].0 ^ t[0].0) | (s[1].0 ^ t[1].0) | (s[2].0 ^ t[2].0) == 0
}

/// Returns the smaller of two, without the NaN handling that costs `f32::min` a few instructions.
#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Returns the larger of two, likewise.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Moves the vertices of a compacted store towards the original; `away` is the approximate RMS distance. Each
/// vertex of the original has its `home`, or [`NONE`]. Samples are passed to `values`, if given; moves
/// respect the `guards`, if given. The quadrics of the vertices are lost: `tensor` selects the part of them
/// that the solve uses as scratch space.
pub(crate) fn fit<Q: VertexMemory>(
    store: &mut Store<Q>,
    given: &mut impl OrderedInput,
    home: &[VertexId],
    away: f64,
    mut values: Option<&mut Values<'_>>,
    guards: Option<&MoveGuards>,
    tensor: fn(&mut Q) -> &mut Tensor,
) -> Fitted {
    if store.t.is_empty() {
        return Fitted::default();
    }
    let FaceData { loads, leeway } = face_data(store);
    let per_face = (given.point_count() + given.face_count()) as f64 / store.t.len() as f64;
    let (vertices, final_faces) = (&store.v[..], &store.t[..]);
    let mut sampler = Sampler {
        store,
        vertices,
        cache: vec![CachedStar::NONE; STAR_CACHE_SIZE.min(store.v.len().next_power_of_two())],
        loads,
        robust_height_sq: (ROBUST_HEIGHT_SQ * (per_face * away).powi(2)).clamp(1e-30, 1e30) as f32,
        height_sq_sum: 0.0,
        weight: 0.0,
    };
    // Exact quadrature of quadratic functions: 3/4 of the area at the centre, 1/12 at each corner. Each
    // vertex is sampled once for all its faces; on CAD parts, which corner of a face comes first follows from
    // the order of the file, and some vertices never do. If samples are many or memory is scarce, one corner
    // of every second face stands for six.
    let stride = ((per_face / MAX_SAMPLES_PER_FACE as f64) as usize).max(1);
    // A face that survives is found among the final ones without a search: both are in the same order, and no
    // removed face has three different homes.
    let mut survivors = 0;
    let (mut faces_to_skip, mut sampled_faces) = (0, 0);
    let samples_all_vertices = stride == 1 && given.face_count() <= TIME_OVER_MEMORY_MAX_FACES;
    let mut vertex_areas = if samples_all_vertices { vertex_areas(given) } else { Vec::new() };
    for i in 0..given.face_count() {
        let t = given.face(i);
        let homes = t.map(|w| home[w.index()]);
        let face = survivors;
        let survives = final_faces.get(face).is_some_and(|t| is_same(t, &homes));
        survivors += usize::from(survives);
        if faces_to_skip > 0 {
            faces_to_skip -= 1;
            continue;
        }
        (faces_to_skip, sampled_faces) = (stride - 1, sampled_faces + 1);
        // If two corners were merged into one vertex, the face is more likely there.
        let u = if homes[1] == homes[2] { homes[1] } else { homes[0] };
        if u == NONE {
            continue;
        }
        given.prefetch(i + PREFETCH_DISTANCE * stride);
        let [a, b, c] = given.positions(i, t).map(in_register);
        let normal = (b - a).cross(c - a);
        let area = normal.length();
        let centre = (a + (b + c)) * (1.0 / 3.0);
        let placed = if survives { sampler.assign_to_face(face, homes, centre, 9.0 * area) } else { None };
        let placed = placed.or_else(|| sampler.assign(centre, (normal, area), 9.0 * area, u));
        if let (Some(values), Some(placed)) = (&mut values, placed) {
            values.add_centre(i, placed.face, placed.b, placed.weight);
        }
        for (k, p) in [a, b, c].into_iter().enumerate() {
            let weight = match vertex_areas.get_mut(t[k].index()) {
                Some(area) => std::mem::take(area),
                None if sampled_faces % 2 == 0 && sampled_faces / 2 % 3 == k => 6.0 * area,
                None => 0.0,
            };
            if homes[k] == NONE || weight == 0.0 {
                continue;
            }
            if in_register(vertices[homes[k].index()].p) == p {
                sampler.assign_to_home(weight, homes[k]);
                if let Some(values) = &mut values {
                    values.add_at_home((i, k), store.listed(homes[k]), weight);
                }
            } else {
                let placed = sampler.assign(p, (normal, area), weight, homes[k]);
                if let (Some(values), Some(placed)) = (&mut values, placed) {
                    values.add_corner((i, k), placed.face, placed.b, placed.weight);
                }
            }
        }
    }
    let Sampler { mut loads, height_sq_sum: rr, weight, .. } = sampler;
    let limit = MAX_OUTLIER_RMS * MAX_OUTLIER_RMS * (rr / weight.max(1e-30)) as f32;
    let suspects = solve(store, &mut loads, leeway, OUTLIER_CHECK_SHARE * limit, guards, tensor);
    let after = rr - loads.iter().map(|l| f64::from(l.gain())).sum::<f64>();
    pull_in_outliers(store, &loads, suspects, given, home, (limit, guards));
    // The mark still holds an index of an outlier: clear it, other code uses it as a stamp.
    store.v.iter_mut().for_each(|x| x.mark = 0);
    Fitted { rms: (after.max(0.0) / weight.max(1e-30)).sqrt() }
}

/// Returns twice the total area of the faces at each vertex of the input.
#[inline(never)]
fn vertex_areas(given: &mut impl OrderedInput) -> Vec<f32> {
    let mut areas = vec![0.0f32; given.point_count()];
    for i in 0..given.face_count() {
        let t = given.face(i);
        given.prefetch(i + PREFETCH_DISTANCE);
        let [a, b, c] = given.positions(i, t).map(in_register);
        let area = (b - a).cross(c - a).length();
        t.iter().for_each(|w| areas[w.index()] += area);
    }
    areas
}

/// Solves for the displacements by two Gauss-Seidel sweeps. (Measured: a third brings nothing.) A triangle
/// only sees the heights n·delta of its three vertices, their lifts. The second sweep moves the vertices, by
/// no more than the largest distance seen, and only if no triangle rotates far and no guard is broken.
/// Returns the moved vertices that have a sample farther away than the root of `far`.
#[inline(never)]
fn solve<Q: VertexMemory>(
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
fn keeps_orientation<Q: VertexMemory>(
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

/// Data of the final triangles before sampling.
struct FaceData {
    loads: Vec<FaceNormalEquations>,
    /// For each vertex the square of a move that rotates no face too far, even if all its corners move as
    /// far; 0 unless all faces are oriented as the input was.
    leeway: Vec<f32>,
}

#[inline(never)]
fn face_data<Q: VertexMemory>(store: &Store<Q>) -> FaceData {
    let mut leeways = vec![f32::INFINITY; store.v.len()];
    let mut loads = bytemuck::zeroed_vec::<FaceNormalEquations>(store.t.len());
    for (few, loads) in store.t.chunks(4).zip(loads.chunks_mut(4)) {
        let t = [0, 1, 2, 3].map(|i: usize| few[i.min(few.len() - 1)]);
        let four = FourFaces::new([0, 1, 2].map(|k| store.four(t.map(|t| t[k]))));
        let is_sound = four.are_sound(&store.four_facings(t));
        let leeway = four.high_sq.map(|high_sq| (is_sound & (high_sq * FREE_MOVE_SHARE_SQ)).to_array());
        let [x, y, z] = four.normal;
        let normals = f32x4::transpose([x, y, z, f32x4::ZERO]);
        for (i, (t, load)) in few.iter().zip(loads).enumerate() {
            for k in 0..3 {
                let of = &mut leeways[t[k].index()];
                *of = min(*of, leeway[k][i % 4]);
            }
            load.0[3] = normals[i % 4];
        }
    }
    FaceData { loads, leeway: leeways }
}

/// Returns a vector in one register.
#[inline(always)]
fn in_register(v: Vec3) -> Vec3A {
    Vec3A::from_vec4(v.extend(0.0))
}

/// Returns the dot products of one vector with four others.
#[inline(always)]
fn dots(a: Vec3A, others: [Vec3A; 4]) -> [f32; 4] {
    let [x, y, z, _] = f32x4::transpose(others.map(|b| f32x4::new(Vec4::from((a * b, 0.0)).to_array())));
    (x + y + z).to_array()
}

/// Returns true if the projection of a point lies inside a face, no farther away than the root of `limit`.
#[inline(always)]
fn is_above(p: Vec3A, [a, b, c]: [Vec3A; 3], limit: f32) -> bool {
    let (q, first, second) = (p - a, b - a, c - a);
    let normal = first.cross(second);
    // The areas of the triangles of the point and two sides are its barycentric coordinates, times that of
    // the face.
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
fn pull_in_outliers<Q: VertexMemory>(
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
    // Nearly all project into one of the faces there; the distance is computed afterwards, for those that do
    // not.
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
    suspects.retain(|s| s.found.0 > limit && s.found.0.is_finite());
    find_nearest(store, given, home, &mut suspects);
    for Outlier { vertex, found: (d, q), .. } in suspects {
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
        let FaceData { loads, .. } = face_data(&store);
        let (ready, normals) = (vec![CachedStar::NONE; 4], [Vec3A::Z, -Vec3A::Z, Vec3A::Y]);
        let mut sampler = Sampler {
            store: &store,
            vertices: &store.v,
            cache: ready,
            loads,
            robust_height_sq: 1.0,
            height_sq_sum: 0.0,
            weight: 0.0,
        };
        // Nearer to the lower side.
        let sample = Vec3A::new(0.6, 0.1, -0.03);
        let mut side =
            |normal| sampler.assign(sample, (normal, 1.0), 1.0, VertexId(0)).map(|placed| placed.face);
        assert_eq!(normals.map(&mut side), [Some(0), Some(1), None]);
        let taken = |l: &FaceNormalEquations| l.numbers()[8..11].iter().sum::<f32>();
        assert!(sampler.loads.iter().all(|l| taken(l) != 0.0), "both sides have their sample");
    }
}
