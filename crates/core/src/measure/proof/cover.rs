//! A quick proof that a surface is near all of a face: because it lies straight above or below all of it.
//!
//! ```text
//! seed ── walk ──► face of the surface over the middle ── all faces over the face, from side to side
//!                                                           ├─ one is farther away than the limit: not proven
//!                                                           └─ a border lies over the face: not proven
//! ```
//!
//! Seen along the normal of the face, the faces found have no border over it. So each of its points is covered by an odd
//! number of them, or each by an even one, and to count at one point suffices.

use glam::{DVec3, DVec4, Vec3};

use crate::{FaceId, HalfEdgeId, Surface, Topology, VertexId};

/// Largest number of steps from the seed to the middle. (Guessed: mostly there are none to ten.)
const MAX_WALK: usize = 64;
/// Largest number of faces over one face.
const MAX_COVER: usize = 4096;
/// Faces lower than this, in the unit frame, are not tested: their coordinates would be too coarse.
const MIN_HEIGHT: f64 = 1e-7;
/// The border of a face is left out, no point of it farther from the rest than this share of the distance: walls and
/// borders of the surface often lie over it.
const BORDER_SHARE: f64 = 0.2;
/// Largest width of the border, in barycentric coordinates.
const MAX_BORDER: f64 = 0.2;
/// Rounding of a doubled area, as a share of the square of the coordinates.
const ROUNDING: f64 = 1e-12;
/// Barycentric coordinates of the point that is counted at. (Not the centre, since that lies on edges of regular
/// grids.)
const MIDDLE: [f64; 2] = [0.3487, 0.3209];

/// A surface whose faces know their neighbours, in single precision.
#[derive(Clone, Debug)]
pub struct Cover {
    points: Vec<Vec3>,
    topology: Topology,
}

/// Scratch buffers of a test.
#[derive(Clone, Debug, Default)]
pub struct CoverScratch {
    run: u32,
    /// By face: the last run that found it.
    seen: Vec<u32>,
    found: Vec<FaceId>,
}

/// A view along the normal of a face: three barycentric coordinates, and the height.
struct View {
    origin: DVec3,
    /// Change of the coordinates and the height along the x, y and z axes, per unit of length.
    axes: [DVec4; 3],
    /// Length of the longest side.
    longest: f64,
}

impl View {
    /// Returns `None` if the face is too narrow.
    fn new([a, b, c]: [DVec3; 3]) -> Option<Self> {
        let (u, v) = (b - a, c - a);
        let normal = u.cross(v);
        let size_sq = normal.length_squared();
        let longest_sq = u.length_squared().max(v.length_squared()).max(b.distance_squared(c));
        let is_wide = size_sq > MIN_HEIGHT * MIN_HEIGHT * longest_sq;
        if !is_wide {
            return None;
        }
        let (u, v) = (v.cross(normal) / size_sq, normal.cross(u) / size_sq);
        let normal = normal / size_sq.sqrt();
        let axis = |k: usize| DVec4::new(-u[k] - v[k], u[k], v[k], normal[k]);
        Some(Self { origin: a, axes: [axis(0), axis(1), axis(2)], longest: longest_sq.sqrt() })
    }

    #[inline(always)]
    fn see(&self, p: Vec3) -> DVec4 {
        let d = p.as_dvec3() - self.origin;
        let [x, y, z] = self.axes;
        DVec4::X + x * d.x + y * d.y + z * d.z
    }
}

/// Returns the doubled areas of the triangles between the middle and the sides of a face.
#[inline(always)]
fn areas([a, b, c]: &[DVec4; 3]) -> [f64; 3] {
    let [a, b, c] = [(a.y, a.z), (b.y, b.z), (c.y, c.z)].map(|(y, z)| (y - MIDDLE[0], z - MIDDLE[1]));
    [a.0 * b.1 - a.1 * b.0, b.0 * c.1 - b.1 * c.0, c.0 * a.1 - c.1 * a.0]
}

/// True if the middle lies inside of a face; `None` if it is too close to call.
#[inline(always)]
fn has_middle(corners: &[DVec4; 3]) -> Option<bool> {
    let [a, b, c] = areas(corners);
    let size = corners[0].abs().max(corners[1].abs()).max(corners[2].abs());
    let size = size.y.max(size.z).max(1.0);
    let margin = ROUNDING * size * size;
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    match () {
        () if least < -margin && most > margin => Some(false),
        () if least > margin || most < -margin => Some(true),
        () => None,
    }
}

/// True if the part of a face that is seen over the other, farther than `border` from its sides, is at most this high.
fn is_low(corners: &[DVec4; 3], border: f64, limit: f64) -> bool {
    let mut polygon = [DVec4::ZERO; 8];
    polygon[..3].copy_from_slice(corners);
    let mut count = 3;
    for k in 0..3 {
        let (old, n) = (polygon, count);
        count = 0;
        for i in 0..n {
            let (p, q) = (old[i], old[(i + 1) % n]);
            let (a, b) = (p[k] - border, q[k] - border);
            if a >= 0.0 {
                polygon[count] = p;
                count += 1;
            }
            if (a >= 0.0) != (b >= 0.0) {
                polygon[count] = p + (q - p) * (a / (a - b));
                count += 1;
            }
        }
    }
    polygon[..count].iter().all(|p| p.w.abs() <= limit)
}

impl Cover {
    /// Finds the neighbours of the faces of a surface. Vertices at one position have to be one vertex, or there is a
    /// border between them; a face that uses a vertex twice has no neighbours.
    ///
    /// Cost and panics are those of [`Topology::unwelded`].
    pub fn new(surface: &Surface<'_>) -> Self {
        let positions = surface.positions();
        let points = (0..positions.len()).map(|v| DVec3::from(positions.get(VertexId::new(v))).as_vec3());
        Self { points: points.collect(), topology: Topology::unwelded(surface) }
    }

    /// The faces and their neighbours.
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// The position of a vertex.
    #[inline]
    pub fn point(&self, vertex: VertexId) -> Vec3 {
        self.points[vertex.index()]
    }

    /// The corners of a face.
    #[inline]
    pub fn corners(&self, face: FaceId) -> [Vec3; 3] {
        let [a, b, c] = self.topology.triangle(face);
        [a, b, c].map(|v| self.point(v))
    }

    /// The faces around a vertex, without those that use it twice.
    pub fn around(&self, vertex: VertexId) -> impl Iterator<Item = FaceId> + '_ {
        self.topology.vertex(vertex).corners().iter().map(|h| h.face())
    }

    /// True for a side of a face that is not shared by exactly two faces, or at which their normals differ by more
    /// than the angle with this cosine. Of the two faces of a side, only the first answers.
    pub fn is_sharp(&self, side: HalfEdgeId, cos: f32) -> bool {
        match self.topology.twin(side) {
            None => true,
            Some(twin) if twin < side => false,
            Some(twin) => {
                let [p, q] = [side, twin].map(|h| self.normal(h.face()).normalize_or_zero());
                p.dot(q) < cos
            }
        }
    }

    /// The normal of a face, as long as twice its area.
    pub fn normal(&self, face: FaceId) -> Vec3 {
        let [a, b, c] = self.corners(face);
        (b - a).cross(c - a)
    }

    /// True if each point of a face is proven to be within a distance of the surface; both in the units of the points,
    /// for surfaces of about unit size. False means that this test cannot tell.
    ///
    /// `seed` is a face of the surface that is likely to be near, `None` if none is known; if the answer is true, it
    /// becomes the one over the middle of the face. Cost: O(n) for n faces over the face, and for the way from the seed.
    pub fn is_over(
        &self,
        face: [DVec3; 3],
        distance: f64,
        seed: &mut Option<FaceId>,
        scratch: &mut CoverScratch,
    ) -> bool {
        let Some(view) = View::new(face) else { return false };
        // The rest is the face drawn together to its centre: no point moves farther than twice the border.
        let left_out = BORDER_SHARE * distance;
        let border = (left_out / (2.0 * view.longest)).min(MAX_BORDER);
        // Sideways and upright.
        let limit = (distance * distance - left_out * left_out).sqrt();
        let Some(start) = seed.and_then(|seed| self.walk(&view, seed)) else { return false };
        let CoverScratch { run, seen, found } = scratch;
        if seen.len() != self.topology.face_count() || *run == u32::MAX {
            *run = 0;
            seen.clear();
            seen.resize(self.topology.face_count(), 0);
        }
        *run += 1;
        found.clear();
        found.push(start);
        seen[start.index()] = *run;
        let mut is_odd = false;
        let mut i = 0;
        while let Some(&face) = found.get(i) {
            i += 1;
            let corners = self.seen(&view, face);
            match has_middle(&corners) {
                None => return false,
                Some(is_over) => is_odd ^= is_over,
            }
            let highest = corners[0].w.abs().max(corners[1].w.abs()).max(corners[2].w.abs());
            let is_all_low = highest <= limit;
            if !is_all_low && !is_low(&corners, border, limit) {
                return false;
            }
            let outside = |p: DVec4| {
                u8::from(p.x < border) | (u8::from(p.y < border) << 1) | (u8::from(p.z < border) << 2)
            };
            let [a, b, c] = [outside(corners[0]), outside(corners[1]), outside(corners[2])];
            for (k, is_outside) in [a & b, b & c, c & a].into_iter().enumerate() {
                if is_outside != 0 {
                    continue;
                }
                let Some(other) = self.across(face, k) else { return false };
                if found.len() == MAX_COVER {
                    return false;
                }
                if seen[other.index()] != *run {
                    seen[other.index()] = *run;
                    found.push(other);
                }
            }
        }
        if is_odd {
            *seed = Some(start);
        }
        is_odd
    }

    #[inline(always)]
    fn seen(&self, view: &View, face: FaceId) -> [DVec4; 3] {
        self.corners(face).map(|p| view.see(p))
    }

    /// Returns the face on the other side of a side, if there is exactly one.
    #[inline]
    fn across(&self, face: FaceId, side: usize) -> Option<FaceId> {
        Some(self.topology.twin(HalfEdgeId::of(face, side as u32))?.face())
    }

    /// Walks from face to face until one is seen over the middle.
    fn walk(&self, view: &View, mut face: FaceId) -> Option<FaceId> {
        for _ in 0..MAX_WALK {
            let areas = areas(&self.seen(view, face));
            let all: f64 = areas.iter().sum();
            let outside = areas.map(|a| if all < 0.0 { a } else { -a });
            let farthest = outside.iter().enumerate().max_by(|x, y| x.1.total_cmp(y.1))?;
            if *farthest.1 <= 0.0 {
                return Some(face);
            }
            face = self.across(face, farthest.0)?;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Prepared;
    use crate::measure::proof::local::FaceTest;
    use crate::{PositionsView, TriMesh, shapes};

    #[test]
    fn what_is_over_a_face_is_also_near_all_of_it() {
        for mesh in [shapes::blob(5, 1), shapes::wavy_sheet(24), shapes::box_with_fins(true), shapes::cube(6)]
        {
            let cover = Cover::new(&mesh.surface());
            let to = Prepared::new(&mesh.surface()).expect("there are faces");
            let (mut scratch, mut test) = (CoverScratch::default(), FaceTest::default());
            let size = cover.points.iter().fold(Vec3::ZERO, |size, p| size.max(p.abs())).max_element();
            let (mut proven, mut others) = (0, 0);
            for i in (0..mesh.face_count()).map(FaceId::new) {
                // A face from here to some vertices of faces nearby, and one that is lifted from the surface.
                let mut near = i;
                for k in 0..4 {
                    near =
                        (0..3).find_map(|k| cover.across(near, k).filter(|other| *other != i)).unwrap_or(i);
                    for lift in [0.0, 0.02, 0.3] {
                        let [a, b, _] = cover.corners(i).map(Vec3::as_dvec3);
                        let c = cover.corners(near)[k % 3].as_dvec3();
                        let up = (b - a).cross(c - a).normalize_or_zero() * (lift * f64::from(size));
                        let face = [a + up, b + up, c + up];
                        let distance = 0.05 * f64::from(size);
                        let mut seed = Some(i);
                        if cover.is_over(face, distance, &mut seed, &mut scratch) {
                            assert!(lift < 0.1, "face {i:?} is not near");
                            let user = face.map(|p| p.to_array());
                            assert!(test.is_within(user, &to, distance * 1.0001, &mut u32::MAX.clone()));
                            proven += 1;
                        } else {
                            others += 1;
                        }
                    }
                }
            }
            assert!(proven > 50 && others > 50, "{proven} {others}");
        }
    }

    #[test]
    fn nothing_is_proven_beyond_a_border_or_from_a_false_seed() {
        let cover = Cover::new(&shapes::grid(4).surface());
        let mut scratch = CoverScratch::default();
        let mut is_over = |face: [[f64; 3]; 3], mut seed: Option<FaceId>| {
            if cover.is_over(face.map(DVec3::from), 0.01, &mut seed, &mut scratch) { seed } else { None }
        };
        let [a, b, c] = [0, 4, 20].map(|v| cover.points[v].as_dvec3());
        let inside = [a, b, c].map(|p| p.to_array());
        let beyond = [a, b + (b - a), c].map(|p| p.to_array());
        let far = Some(FaceId(3));
        let seed = is_over(inside, far);
        assert!(seed.is_some(), "the grid is flat");
        assert_eq!(is_over(inside, seed), seed);
        assert_eq!([is_over(beyond, far), is_over(inside, None), is_over([inside[0]; 3], far)], [None; 3]);
    }

    #[test]
    fn a_second_sheet_does_not_stand_in_for_a_hole() {
        // Two sheets, one above the other and joined at one side: counted together, each place is covered twice.
        let points = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 0.001], [0., 1., 0.001]];
        let faces = [[0, 1, 2], [4, 1, 3]].map(|t: [u32; 3]| t.map(VertexId));
        let surface = Surface::new(PositionsView::F64(&points), &faces).unwrap();
        let cover = Cover::new(&surface);
        let face = [[0.1, 0.1, 0.0], [0.5, 0.1, 0.0], [0.1, 0.5, 0.0]].map(DVec3::from);
        assert!(cover.is_over(face, 0.01, &mut Some(FaceId(0)), &mut CoverScratch::default()));
        let beyond = [[0.1, 0.1, 0.0], [1.5, 0.1, 0.0], [0.1, 0.5, 0.0]].map(DVec3::from);
        assert!(!cover.is_over(beyond, 0.01, &mut Some(FaceId(0)), &mut CoverScratch::default()));
    }

    #[test]
    fn sides_are_sharp_where_the_surface_turns_or_ends() {
        let sharp = |mesh: &TriMesh| {
            let cover = Cover::new(&mesh.surface());
            (0..3 * mesh.face_count() as u32).filter(|h| cover.is_sharp(HalfEdgeId(*h), 0.9)).count()
        };
        // Twelve edges of two sides each; and the border of a grid.
        assert_eq!(sharp(&shapes::cube(2)), 24);
        assert_eq!(sharp(&shapes::grid(5)), 20);
    }
}
