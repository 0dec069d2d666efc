//! Assignment of samples of the original to the final triangles.

use glam::{Vec3, Vec3A};
use lodsmith_core::VertexId;
use wide::f32x4;

use super::normal_equations::FaceNormalEquations;
use super::stars::{CachedStar, MIN_FACING_COS, Nearest};
use super::values::{PartOfValues, ValueSurfaces, Values};
use crate::chunks;
use crate::collapse::order::{NONE, TIME_OVER_MEMORY_MAX_FACES};
use crate::collapse::ordered_input::{FacesInOrder, KeptInput, OrderedInput};
use crate::collapse::ring::Corner;
use crate::collapse::store::Store;
use crate::collapse::vertex::Vertex;
use crate::cost::lanes::{dots, in_register, max};
use crate::cost::metric::VertexMemory;
use crate::pieces::{PIECE_LEN, Pieces};

/// Number of stars in the cache. Samples come in Morton order, so a home is nearly always among the last
/// hundred. (64 to 1024 are equally fast.)
const STAR_CACHE_SIZE: usize = 128;
/// Largest lateral distance of a sample outside its triangle, relative to its height, both squared.
const MAX_LATERAL_SQ: f32 = 0.01;
/// Largest number of samples for each final triangle. (More samples gain less than 1 %.)
const MAX_SAMPLES_PER_FACE: usize = 16;
/// Steps of the walk to the nearest triangle of a sample that lies outside the triangles of its star.
/// (Guessed: long triangles of CAD parts are a few stars away.)
const MAX_WALKED_STARS: usize = 16;
/// Number of faces of the original whose samples are placed together.
const CHUNK_LEN: usize = 1 << 13;
/// Samples on so many consecutive final faces are added together.
const PART_LEN: usize = 1 << 14;
/// Chunks of each thread that are in memory together.
const CHUNKS_PER_THREAD: usize = 4;

/// A sample of the original.
#[derive(Clone, Copy)]
struct InputSample {
    /// Four times the face of the original, plus its corner, or 3 for its centre.
    of: u32,
    weight: f32,
}

/// Place of a sample on a final triangle.
#[derive(Clone, Copy)]
struct OnFace {
    face: usize,
    /// Barycentric coordinates; zero in the fourth lane.
    b: f32x4,
    height: f32,
    distance_sq: f32,
}

/// Sums over samples.
#[derive(Clone, Copy, Default)]
pub(super) struct SampleSums {
    pub(super) height_sq: f64,
    pub(super) weight: f64,
    /// Squared distances and weights of samples that project into no triangle: beyond a border that moved.
    pub(super) beside_sq: f64,
    pub(super) beside_weight: f64,
}

impl SampleSums {
    /// Sum of all weights.
    pub(super) fn total_weight(&self) -> f64 {
        self.weight + self.beside_weight
    }

    fn add(&mut self, other: &Self) {
        self.height_sq += other.height_sq;
        self.weight += other.weight;
        self.beside_sq += other.beside_sq;
        self.beside_weight += other.beside_weight;
    }
}

/// Parameters of the samples of the original.
#[derive(Clone, Copy)]
pub(super) struct SampleParameters<'a> {
    /// The final vertex that each vertex of the original was merged into, or [`NONE`].
    pub(super) home: &'a [VertexId],
    /// Number of points and faces of the original for each final triangle.
    pub(super) per_face: f64,
    /// Squared height above which samples count less.
    pub(super) robust_height_sq: f32,
}

/// Takes the samples: exact quadrature of quadratic functions, with 3/4 of the area at the centre and 1/12
/// at each corner. Adds them to the `loads` of the final triangles, and to `values` if given. Chunks of the original
/// are placed side by side, and each load adds its samples in order.
///
/// Each vertex is sampled once for all its faces; on CAD parts, the order of the file decides which
/// corner of a face comes first, and some vertices never do. If samples are many or memory is scarce, one
/// corner of every second face stands for six.
pub(super) fn take_samples<Q: VertexMemory>(
    store: &Store<Q>,
    loads: &mut [FaceNormalEquations],
    given: &impl OrderedInput,
    &SampleParameters { home, per_face, robust_height_sq: robust }: &SampleParameters<'_>,
    mut values: Option<&mut Values<'_>>,
) -> SampleSums {
    let stride = ((per_face / MAX_SAMPLES_PER_FACE as f64) as usize).max(1);
    let kept = given.kept().filter(|_| stride == 1 && given.face_count() <= TIME_OVER_MEMORY_MAX_FACES);
    let areas = kept.map_or_else(Vec::new, |kept| areas_at_vertices(kept, home));
    let count = given.face_count().div_ceil(CHUNK_LEN);
    let faces = |k: usize| given.faces(k * CHUNK_LEN..given.face_count().min((k + 1) * CHUNK_LEN), stride);
    let (mut sums, mut survivors) = (SampleSums::default(), Survivors::default());
    if chunks::threads(given.face_count()) == 1 {
        let values = values.and_then(|values| values.parts(store.t.len()).pop());
        let mut placer = Placer::new(store, Direct { loads, values, store, robust });
        for k in 0..count {
            placer.place(&faces(k), stride, &mut survivors, home, &areas);
            sums.add(&std::mem::take(&mut placer.sums));
        }
        return sums;
    }
    let most = CHUNKS_PER_THREAD * chunks::threads(given.face_count());
    let (mut first, mut together) = (0, most);
    while first < count {
        together = together.min(count - first);
        let counted = chunks::each(together, |k| {
            let faces = faces(first + k);
            let survives = |t: [VertexId; 3]| are_different(&t.map(|w| home[w.index()]));
            let count = faces.numbered().filter(|(_, t)| survives(*t)).count();
            (faces, count)
        });
        let mut placed = chunks::each(together, |k| {
            let next = survivors.next + counted[..k].iter().map(|(_, count)| count).sum::<usize>();
            let mut survivors = Survivors { next, has_all: true };
            let values = values.as_ref().map(|values| values.surfaces());
            let mut placer = Placer::new(store, Stored { loads, values, store, parts: Vec::new() });
            placer.place(&counted[k].0, stride, &mut survivors, home, &areas);
            (placer.to.parts, placer.sums, survivors)
        });
        // (The first one that lacks a survivor is right; those after it began at the wrong one.)
        placed.truncate(placed.iter().position(|(.., found)| !found.has_all).map_or(together, |k| k + 1));
        first += placed.len();
        survivors = placed[placed.len() - 1].2;
        together = if survivors.has_all { (2 * together).clamp(1, most) } else { 1 };
        placed.iter().for_each(|(_, more, _)| sums.add(more));
        let mut parts: Vec<PartOfSamples<'_, '_>> =
            loads.chunks_mut(PART_LEN).map(PartOfSamples::new).collect();
        let of_values = values.iter_mut().flat_map(|values| values.parts(PART_LEN));
        parts.iter_mut().zip(of_values).for_each(|(part, values)| part.values = Some(values));
        for (part, samples) in placed.iter().flat_map(|(placed, ..)| placed) {
            parts[*part].samples.push(samples);
        }
        parts.retain(|part| !part.samples.is_empty());
        chunks::over(parts, |_, part| part.add_all(robust));
    }
    sums
}

/// Faces of the input that survive, while these are visited in order. They are found among the final ones without a
/// search: both are in the same order, and no removed face has three different homes.
#[derive(Clone, Copy, Default)]
struct Survivors {
    /// The next final face.
    next: usize,
    /// False if a face with three different homes was not found: a removed duplicate, or one at a cut.
    has_all: bool,
}

impl Survivors {
    /// Returns the final face that a face with these homes became, if it is the next one.
    #[inline(always)]
    fn find(&mut self, homes: &[VertexId; 3], final_faces: &[[VertexId; 3]]) -> Option<usize> {
        let face = self.next;
        if final_faces.get(face).is_some_and(|t| is_same(t, homes)) {
            self.next += 1;
            return Some(face);
        }
        self.has_all &= !are_different(homes);
        None
    }
}

/// True if a face with these homes should survive.
#[inline(always)]
fn are_different(&[a, b, c]: &[VertexId; 3]) -> bool {
    (a != b) & (b != c) & (a != c)
}

impl InputSample {
    /// Returns the weight, which is less if the sample is high above its triangle.
    #[inline(always)]
    fn robust_weight(&self, height: f32, robust_height_sq: f32) -> f32 {
        self.weight * (robust_height_sq / (robust_height_sq + height * height)).sqrt()
    }

    /// Adds it to the load of its triangle.
    #[inline(always)]
    fn add_on_face(&self, on: &OnFace, load: &mut FaceNormalEquations, robust: f32) {
        load.add(on.b, self.robust_weight(on.height, robust), on.height, on.distance_sq);
    }

    /// Adds it to the load at the corner of a vertex, which it holds in place.
    #[inline(always)]
    fn add_at_vertex(&self, at: Corner, load: &mut FaceNormalEquations) {
        load.numbers_mut()[at.k()] += self.weight;
    }

    /// Adds the values of the original there, on a triangle.
    fn add_values_on_face(&self, on: &OnFace, values: &mut PartOfValues<'_, '_>, robust: f32) {
        let [u, v, w, _] = on.b.to_array();
        let (b, weight) = (Vec3::new(u, v, w), self.robust_weight(on.height, robust));
        match (self.of as usize / 4, self.of as usize % 4) {
            (i, 3) => values.add_centre(i, on.face, b, weight),
            corner => values.add_corner(corner, on.face, b, weight),
        }
    }

    /// Returns the corner of a triangle that takes the values of the original there, at the vertex of `at`.
    fn corner_for_values<Q: VertexMemory>(
        &self,
        at: Corner,
        values: &ValueSurfaces<'_>,
        store: &Store<Q>,
    ) -> Option<Corner> {
        let around = store.listed(store.t[at.face()][at.k()]);
        values.corner_at_home((self.of as usize / 4, self.of as usize % 4), around)
    }

    /// Adds the values of the original there, at a corner of a triangle.
    fn add_values_at_corner(&self, corner: Corner, values: &mut PartOfValues<'_, '_>) {
        values.add_at_corner((self.of as usize / 4, self.of as usize % 4), corner, self.weight);
    }
}

/// Receiver of placed samples, and the normals of the final triangles.
trait Samples {
    fn normal(&self, face: usize) -> Vec3A;
    fn put_on_face(&mut self, sample: InputSample, on: OnFace);
    fn put_at_vertex(&mut self, sample: InputSample, at: Corner);
}

/// Adds samples at once.
struct Direct<'a, 'v, Q: VertexMemory> {
    loads: &'a mut [FaceNormalEquations],
    values: Option<PartOfValues<'a, 'v>>,
    store: &'a Store<Q>,
    robust: f32,
}

impl<Q: VertexMemory> Samples for Direct<'_, '_, Q> {
    #[inline(always)]
    fn normal(&self, face: usize) -> Vec3A {
        self.loads[face].normal()
    }
    #[inline(always)]
    fn put_on_face(&mut self, sample: InputSample, on: OnFace) {
        sample.add_on_face(&on, &mut self.loads[on.face], self.robust);
        if let Some(values) = &mut self.values {
            sample.add_values_on_face(&on, values, self.robust);
        }
    }
    #[inline(always)]
    fn put_at_vertex(&mut self, sample: InputSample, at: Corner) {
        sample.add_at_vertex(at, &mut self.loads[at.face()]);
        if let Some(values) = &mut self.values
            && let Some(corner) = sample.corner_for_values(at, values.surfaces(), self.store)
        {
            sample.add_values_at_corner(corner, values);
        }
    }
}

/// In place of a squared distance: a sample at a vertex, and the values of one, at the corner that takes them.
const AT_VERTEX: f32 = -1.0;
const VALUES_AT_CORNER: f32 = -2.0;

/// A sample and its place.
#[derive(Clone, Copy)]
struct PlacedSample {
    sample: InputSample,
    at: Corner,
    height: f32,
    /// Barycentric coordinates, and the squared distance or one of the marks above.
    b: f32x4,
}

impl PlacedSample {
    /// Adds it to its load, or its values to theirs, in a part of all.
    #[inline(always)]
    fn add_to(
        &self,
        loads: &mut [FaceNormalEquations],
        values: Option<&mut PartOfValues<'_, '_>>,
        robust: f32,
    ) {
        let face = self.at.face();
        let [u, v, w, distance_sq] = self.b.to_array();
        if distance_sq == AT_VERTEX {
            self.sample.add_at_vertex(self.at, &mut loads[face % PART_LEN]);
        } else if distance_sq == VALUES_AT_CORNER {
            values.into_iter().for_each(|values| self.sample.add_values_at_corner(self.at, values));
        } else {
            let on = OnFace { face, b: f32x4::new([u, v, w, 0.0]), height: self.height, distance_sq };
            self.sample.add_on_face(&on, &mut loads[face % PART_LEN], robust);
            values.into_iter().for_each(|values| self.sample.add_values_on_face(&on, values, robust));
        }
    }
}

/// Consecutive final triangles, and all samples on them, in order.
struct PartOfSamples<'a, 'v> {
    loads: &'a mut [FaceNormalEquations],
    values: Option<PartOfValues<'a, 'v>>,
    samples: Vec<&'a [PlacedSample]>,
}

impl<'a> PartOfSamples<'a, '_> {
    fn new(loads: &'a mut [FaceNormalEquations]) -> Self {
        Self { loads, values: None, samples: Vec::new() }
    }

    fn add_all(mut self, robust: f32) {
        for samples in self.samples {
            for sample in samples {
                sample.add_to(self.loads, self.values.as_mut(), robust);
            }
        }
    }
}

/// Keeps samples, by part of the final triangles and in order in each.
struct Stored<'a, 'v, Q: VertexMemory> {
    loads: &'a [FaceNormalEquations],
    values: Option<&'a ValueSurfaces<'v>>,
    store: &'a Store<Q>,
    parts: Vec<(usize, Vec<PlacedSample>)>,
}

impl<Q: VertexMemory> Samples for Stored<'_, '_, Q> {
    #[inline(always)]
    fn normal(&self, face: usize) -> Vec3A {
        self.loads[face].normal()
    }
    #[inline(always)]
    fn put_on_face(&mut self, sample: InputSample, on: OnFace) {
        let [u, v, w, _] = on.b.to_array();
        let b = f32x4::new([u, v, w, on.distance_sq]);
        self.put(PlacedSample { sample, at: Corner::new(on.face, 0), height: on.height, b });
    }
    #[inline(always)]
    fn put_at_vertex(&mut self, sample: InputSample, at: Corner) {
        self.put(PlacedSample { sample, at, height: 0.0, b: f32x4::splat(AT_VERTEX) });
        if let Some(values) = self.values
            && let Some(at) = sample.corner_for_values(at, values, self.store)
        {
            self.put(PlacedSample { sample, at, height: 0.0, b: f32x4::splat(VALUES_AT_CORNER) });
        }
    }
}

impl<Q: VertexMemory> Stored<'_, '_, Q> {
    #[inline(always)]
    fn put(&mut self, sample: PlacedSample) {
        let part = sample.at.face() / PART_LEN;
        match self.parts.last_mut() {
            Some((last, samples)) if *last == part => samples.push(sample),
            _ => self.put_elsewhere(part, sample),
        }
    }

    /// Keeps a sample of another part than the last one.
    #[cold]
    #[inline(never)]
    fn put_elsewhere(&mut self, part: usize, sample: PlacedSample) {
        let at = self.parts.iter().position(|(other, _)| *other == part).unwrap_or(self.parts.len());
        if at == self.parts.len() {
            self.parts.push((part, Vec::with_capacity(CHUNK_LEN)));
        }
        let last = self.parts.len() - 1;
        self.parts.swap(at, last);
        self.parts[last].1.push(sample);
    }
}

/// Places the samples of the original on the final triangles.
struct Placer<'a, Q: VertexMemory, S: Samples> {
    store: &'a Store<Q>,
    /// The vertices of the store.
    vertices: &'a [Vertex<Q>],
    cache: Vec<CachedStar>,
    to: S,
    sums: SampleSums,
}

impl<'a, Q: VertexMemory, S: Samples> Placer<'a, Q, S> {
    fn new(store: &'a Store<Q>, to: S) -> Self {
        let cache = vec![CachedStar::NONE; STAR_CACHE_SIZE.min(store.v.len().next_power_of_two())];
        Self { store, vertices: &store.v, cache, to, sums: SampleSums::default() }
    }

    /// Places the samples of some faces, with the `areas` at the vertices that each face samples, or none if one corner
    /// of every second face stands for six.
    #[inline(always)]
    fn place(
        &mut self,
        faces: &FacesInOrder<'_>,
        stride: usize,
        survivors: &mut Survivors,
        home: &[VertexId],
        areas: &[AreaAtVertex],
    ) {
        for (i, t) in faces.numbered() {
            let homes = t.map(|w| home[w.index()]);
            let survivor = survivors.find(&homes, &self.store.t);
            if i % stride > 0 {
                continue;
            }
            let u = deciding(&homes);
            if u == NONE {
                continue;
            }
            let [a, b, c] = faces.positions(i, t).map(in_register);
            let normal = (b - a).cross(c - a);
            let area = normal.length();
            let centre = (a + (b + c)) * (1.0 / 3.0);
            let of = 4 * i as u32;
            let sample = InputSample { of: of + 3, weight: 9.0 * area };
            let is_placed = survivor.is_some_and(|face| self.place_on(sample, face, homes, centre));
            if !is_placed {
                self.place_near(sample, centre, (normal, area), u);
            }
            for (k, p) in [a, b, c].into_iter().enumerate() {
                let nth = i / stride + 1;
                let weight = match areas.get(t[k].index()) {
                    Some(at) if at.sampler == i as u32 => at.area,
                    None if nth.is_multiple_of(2) && nth / 2 % 3 == k => 6.0 * area,
                    _ => 0.0,
                };
                if homes[k] == NONE || weight == 0.0 {
                    continue;
                }
                let sample = InputSample { of: of + k as u32, weight };
                if in_register(self.vertices[homes[k].index()].p) == p {
                    self.place_at_home(sample, homes[k]);
                } else {
                    self.place_near(sample, p, (normal, area), homes[k]);
                }
            }
        }
    }

    /// Returns the nearest triangle of the star of `u` that faces the same way as a sample, if it is nearer
    /// than `within`, squared. The normal of the sample is given with its length.
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
        // Few triangles face away, so this is checked afterwards.
        if self.to.normal(found.corner.face()).dot(normal.0) > MIN_FACING_COS * normal.1 {
            return Some(found);
        }
        star.nearest_facing(q, normal, within)
    }

    /// Counts a sample that cannot be fitted since its border moved, at its distance to the nearest triangle,
    /// whichever way that faces: it walks from star to star as long as they get nearer. (Inside a surface
    /// such a sample lies over an edge, at about the distance of others.)
    #[cold]
    fn put_beside(&mut self, p: Vec3A, weight: f32, home: VertexId) {
        if !self.vertices[home.index()].kind.is_border() {
            return;
        }
        let mut distance_sq = (p - in_register(self.vertices[home.index()].p)).length_squared();
        let mut open = [Some(home), None];
        for _ in 0..MAX_WALKED_STARS {
            let from = open;
            open = [None, None];
            for u in from.into_iter().flatten() {
                let slot = u.index() & (self.cache.len() - 1);
                let star = &mut self.cache[slot];
                if star.of != u {
                    star.make(self.store, u);
                }
                let q = p - in_register(self.vertices[u.index()].p);
                if let Some(found) = star.nearest(q, distance_sq) {
                    distance_sq = found.distance_sq;
                    let (second, third) = self.store.others_at(found.corner);
                    open = [Some(second), Some(third)];
                }
            }
        }
        self.sums.beside_sq += f64::from(weight * distance_sq);
        self.sums.beside_weight += f64::from(weight);
    }

    /// Puts a sample at the position of a final vertex.
    #[inline(always)]
    fn place_at_home(&mut self, sample: InputSample, home: VertexId) {
        if let Some(&at) = self.store.listed(home).first() {
            self.sums.weight += f64::from(sample.weight);
            self.to.put_at_vertex(sample, at);
        }
    }

    /// Puts a sample on a face with these corners if its projection lies inside the face. Returns true if so.
    #[inline(always)]
    fn place_on(&mut self, sample: InputSample, face: usize, corners: [VertexId; 3], p: Vec3A) -> bool {
        let [a, b, c] = corners.map(|w| in_register(self.vertices[w.index()].p));
        let (q, first, second, normal) = (p - a, b - a, c - a, self.to.normal(face));
        let [area, v, w, height] = dots(normal, [first.cross(second), q.cross(second), first.cross(q), q]);
        let per_area = 1.0 / max(area, 1e-18);
        let (v, w) = (v * per_area, w * per_area);
        let u = 1.0 - v - w;
        if u < 0.0 || v < 0.0 || w < 0.0 {
            return false;
        }
        let b = f32x4::new([u, v, w, 0.0]);
        self.put_on_face(sample, OnFace { face, b, height, distance_sq: height * height });
        true
    }

    #[inline(always)]
    fn put_on_face(&mut self, sample: InputSample, on: OnFace) {
        self.sums.height_sq += f64::from(sample.weight * (on.height * on.height));
        self.sums.weight += f64::from(sample.weight);
        self.to.put_on_face(sample, on);
    }

    /// Puts a sample on the nearest triangle that faces its way: in the star of its home or, if it lies
    /// beyond the rim of that star, in the star of the nearer corner of the triangle found. (Beside an edge
    /// inside the star, the other triangle there has been checked too.)
    #[inline(always)]
    fn place_near(&mut self, sample: InputSample, p: Vec3A, normal: (Vec3A, f32), home: VertexId) {
        let Some(mut best) = self.nearest(home, p, normal, f32::INFINITY) else {
            return self.put_beside(p, sample.weight, home);
        };
        if best.second + best.third > 1.0 {
            let (second, third) = self.store.others_at(best.corner);
            let next = if best.second > best.third { second } else { third };
            if let Some(nearer) = self.nearest(next, p, normal, best.distance_sq) {
                best = nearer;
            }
        }
        if best.lateral * best.lateral > MAX_LATERAL_SQ * best.height * best.height {
            return self.put_beside(p, sample.weight, home);
        }
        let (v, w) = (max(best.second, 0.0), max(best.third, 0.0));
        let scale = 1.0 / max(v + w, 1.0);
        let (v, w) = (v * scale, w * scale);
        let [first, second, third] = CORNER_UNITS[best.corner.k()];
        let b = first * (1.0 - v - w) + second * v + third * w;
        let (face, height, distance_sq) = (best.corner.face(), best.height, best.distance_sq);
        self.put_on_face(sample, OnFace { face, b, height, distance_sq });
    }
}

/// Returns the home at which a face is looked up: if two corners were merged into one vertex, the face is more likely
/// there.
#[inline(always)]
fn deciding(homes: &[VertexId; 3]) -> VertexId {
    if homes[1] == homes[2] { homes[1] } else { homes[0] }
}

/// For each corner, the unit vectors that move three numbers (for that corner and the two after it) to their
/// places.
const CORNER_UNITS: [[f32x4; 3]; 4] = {
    let [x, y, z] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let (x, y, z) = (f32x4::new(x), f32x4::new(y), f32x4::new(z));
    [[x, y, z], [y, z, x], [z, x, y], [f32x4::ZERO; 3]]
};

/// Returns true if two faces have the same corners. (All are compared: a branch on each is unpredictable.)
#[inline(always)]
fn is_same(s: &[VertexId; 3], t: &[VertexId; 3]) -> bool {
    (s[0].0 ^ t[0].0) | (s[1].0 ^ t[1].0) | (s[2].0 ^ t[2].0) == 0
}

/// Twice the total area of the faces at a vertex of the original, and the first face that samples it.
#[derive(Clone, Copy)]
struct AreaAtVertex {
    area: f32,
    sampler: u32,
}

/// Returns the areas at the vertices of the original.
#[inline(never)]
fn areas_at_vertices(given: KeptInput<'_>, home: &[VertexId]) -> Vec<AreaAtVertex> {
    let KeptInput { points, faces } = given;
    let pieces = Pieces::of(faces, points.len());
    let mut all = chunks::list(points.len(), |_| AreaAtVertex { area: 0.0, sampler: u32::MAX });
    chunks::shared(&mut all, PIECE_LEN, |piece, all| {
        let start = piece * PIECE_LEN;
        pieces.each_face(piece, |i| {
            let t = faces[i];
            let [a, b, c] = t.map(|w| in_register(points[w.index()]));
            let area = (b - a).cross(c - a).length();
            let samples = deciding(&t.map(|w| home[w.index()])) != NONE;
            for w in t {
                if let Some(at) = all.get_mut(w.index().wrapping_sub(start)) {
                    at.area += area;
                    if samples {
                        at.sampler = at.sampler.min(i as u32);
                    }
                }
            }
        });
    });
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::tensor::Tensor;
    use crate::fit::faces::{FaceData, face_data};

    #[test]
    fn a_sample_is_assigned_to_the_side_with_its_orientation() {
        // A sheet folded along 0-1: both sides extend to the right, one faces up and one down.
        //     0 ---- 2  (above 3)
        //      \    /
        //        1
        let points = [[0.0, 0.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.1], [1.0, 1.0, -0.1]].map(Vec3::from);
        let faces = [[0, 1, 2], [0, 3, 1]].map(|t| t.map(VertexId));
        let mut store = Store::<Tensor>::new(&points, faces.to_vec(), None, None);
        store.link();
        let FaceData { loads, .. } = face_data(&store);
        let to = Stored { loads: &loads, values: None, store: &store, parts: Vec::new() };
        let mut placer = Placer::new(&store, to);
        // Nearer to the lower side.
        let p = Vec3A::new(0.6, 0.1, -0.03);
        for normal in [Vec3A::Z, -Vec3A::Z, Vec3A::Y] {
            placer.place_near(InputSample { of: 0, weight: 1.0 }, p, (normal, 1.0), VertexId(0));
        }
        let sides = placer.to.parts.iter().flat_map(|(_, samples)| samples).map(|sample| sample.at.face());
        assert_eq!(sides.collect::<Vec<_>>(), [0, 1], "each side has its sample, and none has the third");
    }
}
