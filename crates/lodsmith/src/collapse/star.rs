//! Squared distances to the star of a vertex, four points side by side.
//!
//! A star is set once and measured against tens of points, so its numbers are stored four times each: then an
//! operation of a vector reads them from memory, and none has to be spread first.

use glam::Vec3;
use lodsmith_core::VertexId;
use wide::f32x4;

use crate::cost::lanes::{Four, dot, splat, sub};

/// The triangles around a position, preprocessed. The nearest point is inside one of them, on an edge of
/// the rim, or on a spoke, which two triangles share.
#[derive(Clone, Debug, Default)]
pub(super) struct Star {
    centre: Four,
    triangles: Vec<Triangle>,
    /// The rim's vertices, each once if they are few.
    rim: Vec<VertexId>,
    /// From the centre to each of them.
    spokes: Vec<Segment>,
}

#[derive(Clone, Copy, Debug)]
struct Triangle {
    /// Unit normal.
    normal: Four,
    /// Gradients of the barycentric coordinates on the rim.
    a: Four,
    b: Four,
    from: Four,
    rim: Segment,
}

/// A segment from a point along a vector.
#[derive(Clone, Copy, Debug)]
struct Segment {
    along: Four,
    /// The vector over its squared length.
    per_length: Four,
}

impl Segment {
    #[inline(always)]
    fn new(along: Vec3) -> Self {
        let per_length = along * (1.0 / along.length_squared().max(1e-37));
        Self { along: splat(along), per_length: splat(per_length) }
    }

    /// Returns the squared distances of points, relative to the start of the segment.
    #[inline(always)]
    fn distance_sq(&self, q: &Four) -> f32x4 {
        let t = dot(q, &self.per_length).fast_max(f32x4::ZERO).fast_min(f32x4::ONE);
        let r = [0, 1, 2].map(|k| q[k] - t * self.along[k]);
        dot(&r, &r)
    }
}

/// Number of last spokes that are searched for duplicates. A duplicate costs time but changes no distance;
/// searching all spokes would take quadratic time around a vertex of many faces. (Guessed.)
const SEARCHED_SPOKES: usize = 64;

impl Star {
    /// Builds the star of `centre` from rim edges, each given by its two vertices and their positions.
    pub(super) fn set(&mut self, centre: Vec3, rim: impl Iterator<Item = [(VertexId, Vec3); 2]>) {
        self.centre = splat(centre);
        self.triangles.clear();
        self.rim.clear();
        self.spokes.clear();
        for [a, b] in rim {
            for (w, p) in [a, b] {
                if !self.rim.iter().rev().take(SEARCHED_SPOKES).any(|known| *known == w) {
                    self.rim.push(w);
                    self.spokes.push(Segment::new(p - centre));
                }
            }
            let (to_a, to_b) = (a.1 - centre, b.1 - centre);
            let normal = to_a.cross(to_b);
            let per_area = 1.0 / normal.length().max(1e-30);
            let normal = normal * per_area;
            let slope = normal * per_area;
            let rim = Segment::new(to_b - to_a);
            self.triangles.push(Triangle {
                normal: splat(normal),
                a: splat(to_b.cross(slope)),
                b: splat(slope.cross(to_a)),
                from: splat(to_a),
                rim,
            });
        }
    }

    /// Returns the number of triangles.
    pub(super) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Returns the squared distances of four points; infinite if there is no triangle.
    #[inline(always)]
    pub(super) fn distance_sq(&self, points: &Four) -> f32x4 {
        let q = sub(points, &self.centre);
        let mut least = f32x4::splat(f32::INFINITY);
        for spoke in &self.spokes {
            least = least.fast_min(spoke.distance_sq(&q));
        }
        for t in &self.triangles {
            least = least.fast_min(t.rim.distance_sq(&sub(&q, &t.from)));
            let (a, b, height) = (dot(&q, &t.a), dot(&q, &t.b), dot(&q, &t.normal));
            let inside = a.simd_gt(f32x4::ZERO) & b.simd_gt(f32x4::ZERO) & (a + b).simd_lt(f32x4::ONE);
            least = inside.bitselect((height * height).fast_min(least), least);
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::geometry::triangle::nearest;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::collapse::triangle;
    use crate::test_support::tame_vector;

    /// A point of a small grid: triangles between such points often have no area.
    fn on_grid() -> impl Strategy<Value = Vec3> {
        [-2i8..=2, -2i8..=2, -2i8..=2].prop_map(|p| Vec3::from(p.map(f32::from)))
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(512) })]

        #[test]
        fn triangles_without_area_are_as_near_as_their_edges(
            centre in on_grid(),
            rim in vec(on_grid(), 2..7),
            tame in [tame_vector(), tame_vector()],
            corners in [on_grid(), on_grid()],
        ) {
            let mut star = Star::default();
            let id = |i: usize| VertexId(i as u32);
            star.set(centre, rim.windows(2).enumerate().map(|(i, p)| [(id(i), p[0]), (id(i + 1), p[1])]));
            let points = [tame[0] * 2.0, tame[1] * 2.0, corners[0] * 2.0, corners[1] * 2.0];
            let found = star.distance_sq(&[0, 1, 2].map(|k| f32x4::new(points.map(|p| p[k])))).to_array();
            for (q, found) in points.into_iter().zip(found) {
                let to = |p: &[Vec3]| {
                    nearest(q.as_dvec3(), [centre, p[0], p[1]].map(Vec3::as_dvec3)).distance_sq as f32
                };
                let wanted = rim.windows(2).map(to).fold(f32::INFINITY, f32::min);
                // (Single precision resolves positions up to six units away to 4e-7.)
                prop_assert!((wanted - found).abs() <= 2e-5 * wanted.max(0.01), "{q}: {wanted} {found}");
            }
        }
    }

    #[test]
    fn distances_are_to_the_nearest_triangle() {
        let mut x = 0x9E37_79B9u32;
        let mut random = move || {
            x ^= x << 13;
            x ^= x >> 17;
            x ^= x << 5;
            x as f32 / u32::MAX as f32 - 0.5
        };
        let mut point = || Vec3::new(random(), random(), random());
        for n in [1, 3, 7] {
            let (centre, rim) = (point(), std::iter::repeat_with(&mut point).take(n + 1).collect::<Vec<_>>());
            let mut star = Star::default();
            star.set(centre, (0..n).map(|i| [i, i + 1].map(|j| (VertexId(j as u32), rim[j]))));
            for _ in 0..200 {
                let four = [point() * 3.0, point() * 3.0, point(), point()];
                let found = star.distance_sq(&[0, 1, 2].map(|k| f32x4::new(four.map(|p| p[k]))));
                for (q, found) in four.into_iter().zip(found.to_array()) {
                    let near = |i: usize| triangle::closest(q, centre, rim[i], rim[i + 1]).0;
                    let wanted = (0..n).map(near).fold(f32::INFINITY, f32::min);
                    assert!((wanted - found).abs() < 1e-5 * wanted.max(1e-2), "{q}: {wanted} {found}");
                }
            }
        }
    }
}
