//! Assignment of samples of the original to the final triangles.

use glam::{Vec3, Vec3A};
use lodsmith_core::VertexId;
use wide::f32x4;

use super::normal_equations::FaceNormalEquations;
use super::stars::{CachedStar, MIN_FACING_COS, Nearest};
use super::values::Values;
use crate::collapse::order::{NONE, TIME_OVER_MEMORY_MAX_FACES};
use crate::collapse::ordered_input::OrderedInput;
use crate::collapse::store::Store;
use crate::collapse::vertex::Vertex;
use crate::cost::lanes::{dots, in_register, max};
use crate::cost::metric::VertexMemory;

/// Largest lateral distance of a sample outside its triangle, relative to its height, both squared.
const MAX_LATERAL_SQ: f32 = 0.01;
/// Largest number of samples for each final triangle. (More samples gain less than 1 %.)
const MAX_SAMPLES_PER_FACE: usize = 16;
/// Steps of the walk to the nearest triangle of a sample that lies outside the triangles of its star.
/// (Guessed: long triangles of CAD parts are a few stars away.)
const MAX_WALKED_STARS: usize = 16;
/// Prefetch distance for positions, in samples. (Guessed.)
const PREFETCH_DISTANCE: usize = 8;

/// Triangle and position that a sample was assigned to.
#[derive(Clone, Copy)]
struct AssignedSample {
    face: usize,
    /// Barycentric coordinates.
    b: Vec3,
    weight: f32,
}

pub(super) struct Sampler<'a, Q: VertexMemory> {
    pub(super) store: &'a Store<Q>,
    /// The vertices of the store.
    pub(super) vertices: &'a [Vertex<Q>],
    pub(super) cache: Vec<CachedStar>,
    pub(super) loads: Vec<FaceNormalEquations>,
    /// Squared height above which samples count less.
    pub(super) robust_height_sq: f32,
    pub(super) height_sq_sum: f64,
    pub(super) weight: f64,
    /// Squared distances and weights of samples that project into no triangle: beyond a border that moved.
    pub(super) beside: Beside,
}

/// Samples that cannot be fitted: sums of their weighted squared distances and of their weights.
#[derive(Clone, Copy, Default)]
pub(super) struct Beside {
    pub(super) distance_sq_sum: f64,
    pub(super) weight: f64,
}

impl<Q: VertexMemory> Sampler<'_, Q> {
    /// Takes the samples: exact quadrature of quadratic functions, with 3/4 of the area at the centre and 1/12
    /// at each corner. `per_face` is the number of points and faces of the original for each final triangle.
    ///
    /// Each vertex is sampled once for all its faces; on CAD parts, the order of the file decides which
    /// corner of a face comes first, and some vertices never do. If samples are many or memory is scarce, one
    /// corner of every second face stands for six.
    #[inline(always)]
    pub(super) fn take_samples(
        &mut self,
        given: &mut impl OrderedInput,
        home: &[VertexId],
        per_face: f64,
        mut values: Option<&mut Values<'_>>,
    ) {
        let stride = ((per_face / MAX_SAMPLES_PER_FACE as f64) as usize).max(1);
        let (store, vertices) = (self.store, self.vertices);
        // A face that survives is found among the final ones without a search: both are in the same order,
        // and no removed face has three different homes.
        let final_faces = &store.t[..];
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
            let placed = if survives { self.assign_to_face(face, homes, centre, 9.0 * area) } else { None };
            let placed = placed.or_else(|| self.assign(centre, (normal, area), 9.0 * area, u));
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
                    self.assign_to_home(weight, homes[k]);
                    if let Some(values) = &mut values {
                        values.add_at_home((i, k), store.listed(homes[k]), weight);
                    }
                } else {
                    let placed = self.assign(p, (normal, area), weight, homes[k]);
                    if let (Some(values), Some(placed)) = (&mut values, placed) {
                        values.add_corner((i, k), placed.face, placed.b, placed.weight);
                    }
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
        if self.loads[found.corner.face()].normal().dot(normal.0) > MIN_FACING_COS * normal.1 {
            return Some(found);
        }
        star.nearest_facing(q, normal, within)
    }

    /// Counts a sample that cannot be fitted since its border moved, at its distance to the nearest triangle,
    /// whichever way that faces: it walks from star to star as long as they get nearer. (Inside a surface
    /// such a sample lies over an edge, at about the distance of others.)
    #[cold]
    fn add_beside(&mut self, p: Vec3A, weight: f32, home: VertexId) {
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
        self.beside.distance_sq_sum += f64::from(weight * distance_sq);
        self.beside.weight += f64::from(weight);
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
        let Some(mut best) = self.nearest(home, p, normal, f32::INFINITY) else {
            self.add_beside(p, weight, home);
            return None;
        };
        if best.second + best.third > 1.0 {
            let (second, third) = self.store.others_at(best.corner);
            let next = if best.second > best.third { second } else { third };
            if let Some(nearer) = self.nearest(next, p, normal, best.distance_sq) {
                best = nearer;
            }
        }
        if best.lateral * best.lateral > MAX_LATERAL_SQ * best.height * best.height {
            self.add_beside(p, weight, home);
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
        let (ready, normals) = (vec![CachedStar::NONE; 4], [Vec3A::Z, -Vec3A::Z, Vec3A::Y]);
        let mut sampler = Sampler {
            store: &store,
            vertices: &store.v,
            cache: ready,
            loads,
            robust_height_sq: 1.0,
            height_sq_sum: 0.0,
            weight: 0.0,
            beside: Beside::default(),
        };
        // Nearer to the lower side.
        let sample = Vec3A::new(0.6, 0.1, -0.03);
        let mut side =
            |normal| sampler.assign(sample, (normal, 1.0), 1.0, VertexId(0)).map(|placed| placed.face);
        assert_eq!(normals.map(&mut side), [Some(0), Some(1), None]);
        let taken = |l: &FaceNormalEquations| l.numbers()[8..11].iter().sum::<f32>();
        assert!(sampler.loads.iter().all(|l| taken(l) != 0.0), "each side has its sample");
    }
}
