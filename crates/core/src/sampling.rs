//! Seeded samples of a surface, distributed evenly by area.
//!
//! The faces are laid out on a line, with lengths proportional to their areas, and the line is cut into as
//! many equal intervals as there are samples; each interval gives one. Within a face the line is folded into
//! a space-filling curve of the triangle (each half of the line is one half of the triangle, recursively), so
//! neighbours on the line are neighbours on the surface, and equal intervals of the line are patches of equal
//! area:
//!
//! ```text
//!        c                   c
//!       / \                 /|\
//!      /   \               / | \
//!     /     \      →      / 1|2 \      → …
//!    a ───── b           a ──m── b
//! ```
//!
//! Every sample is a function of seed, number and count alone: any subset can be drawn in any order, by any
//! thread.

use std::ops::Range;

use glam::DVec3;

use crate::geometry::UnitFrame;
use crate::geometry::triangle::double_area_normal;
use crate::ids::FaceId;
use crate::mesh::{Bounds, Surface};

/// A point on a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The face.
    pub face: FaceId,
    /// Barycentric weight of each corner; none negative, sum 1.
    pub weights: [f64; 3],
}

impl Sample {
    /// Returns the position of the sample on a face with these corners.
    #[inline]
    pub fn point(&self, corners: [DVec3; 3]) -> DVec3 {
        corners[0] * self.weights[0] + corners[1] * self.weights[1] + corners[2] * self.weights[2]
    }
}

/// A small seeded random generator: the same numbers on every machine.
///
/// Source: SplitMix64 [Steele 2014].
#[derive(Clone, Debug)]
pub struct Random(u64);

/// Increment of SplitMix64.
const GOLDEN_GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

impl Random {
    /// Makes a generator. Equal seeds give equal numbers.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns a random number, uniform over all values.
    #[inline]
    pub fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN_GAMMA);
        mix(self.0)
    }

    /// Returns a random number, uniform from zero to below one.
    #[inline]
    pub fn unit(&mut self) -> f64 {
        unit(self.next_u64())
    }
}

/// Faces laid out on a line, ready to be sampled.
#[derive(Clone, Debug)]
pub struct SurfaceSampler {
    /// End of each face on the line.
    ends: Vec<f64>,
}

impl SurfaceSampler {
    /// Lays out the faces of a surface in their order; `None` if no face has finite corners.
    ///
    /// Faces with a non-finite corner get no samples. If no face has an area, faces are weighted by their
    /// perimeter; if all are single points, equally. Cost: O(n) for n faces.
    pub fn new(surface: &Surface<'_>) -> Option<Self> {
        let positions = surface.positions();
        let of_faces = || surface.triangles().iter().map(|t| t.map(|v| positions.get(v)));
        let is_finite = |t: &[[f64; 3]; 3]| t.iter().flatten().all(|x| x.is_finite());
        let first = of_faces().find(is_finite)?[0];
        let mut bounds = Bounds { min: first, max: first };
        for p in of_faces().filter(is_finite).flatten() {
            for (k, x) in p.into_iter().enumerate() {
                bounds.min[k] = bounds.min[k].min(x);
                bounds.max[k] = bounds.max[k].max(x);
            }
        }
        let frame = UnitFrame::of(&bounds);
        Some(Self::over(|| {
            of_faces().map(|t| if is_finite(&t) { Some(t.map(|p| frame.unit_from_user(p))) } else { None })
        }))
    }

    /// Lays out triangles of a unit frame; `None` leaves a face out. At least one is not left out.
    pub(crate) fn over<I: Iterator<Item = Option<[DVec3; 3]>>>(faces: impl Fn() -> I) -> Self {
        let perimeter = |[a, b, c]: [DVec3; 3]| a.distance(b) + b.distance(c) + c.distance(a);
        let mut sampler = Self::by(faces(), |t| double_area_normal(t).length());
        if sampler.total() <= 0.0 {
            sampler = Self::by(faces(), perimeter);
        }
        if sampler.total() <= 0.0 {
            sampler = Self::by(faces(), |_| 1.0);
        }
        sampler
    }

    fn by(faces: impl Iterator<Item = Option<[DVec3; 3]>>, weight: impl Fn([DVec3; 3]) -> f64) -> Self {
        let mut end = 0.0;
        let step = |t: Option<[DVec3; 3]>| {
            end += t.map_or(0.0, &weight);
            end
        };
        Self { ends: faces.map(step).collect() }
    }

    fn total(&self) -> f64 {
        self.ends.last().copied().unwrap_or(0.0)
    }

    /// Draws the samples with numbers in `range` of `count` in all, in the order of the faces.
    ///
    /// Samples cover the area evenly once all `count` are drawn. Cost: O(log faces), then O(log samples in a face) each.
    pub fn samples(&self, range: Range<usize>, count: usize, seed: u64) -> impl Iterator<Item = Sample> + '_ {
        let total = self.total();
        let mut face = None;
        range.map(move |number| {
            let at = (number as f64 + random(seed, number, 0)) / count as f64 * total;
            // The first face is found by binary search, the next ones by stepping; faces without weight end
            // where they start.
            let mut f = face.unwrap_or_else(|| self.ends.partition_point(|&end| end <= at));
            while f + 1 < self.ends.len() && self.ends[f] <= at {
                f += 1;
            }
            f = f.min(self.ends.len() - 1);
            face = Some(f);
            let start = if f == 0 { 0.0 } else { self.ends[f - 1] };
            let length = self.ends[f] - start;
            // Rounding may put the last sample on a last face without weight; any position is fine there.
            let along = if length > 0.0 { ((at - start) / length).clamp(0.0, 1.0) } else { 0.5 };
            let in_face = length / total * count as f64;
            Sample { face: FaceId(f as u32), weights: fold(along, in_face, seed, number) }
        })
    }
}

/// Maps a position on the line, 0 to 1, to a point in a triangle, by folding until each patch holds about one
/// of `in_face` samples.
#[inline]
fn fold(along: f64, in_face: f64, seed: u64, number: usize) -> [f64; 3] {
    // Weights of the second and third corner; the first has the rest.
    let (mut enter, mut leave, mut apex) = ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0]);
    let mut along = along;
    let mut patches = 1.0;
    // More than 2^40 patches per face are never needed.
    while patches < in_face && patches < (1u64 << 40) as f64 {
        let middle = [(enter[0] + leave[0]) * 0.5, (enter[1] + leave[1]) * 0.5];
        along *= 2.0;
        if along < 1.0 {
            (enter, leave, apex) = (enter, apex, middle);
        } else {
            along -= 1.0;
            (enter, leave, apex) = (apex, leave, middle);
        }
        patches *= 2.0;
    }
    // A random point of the patch: a point of the parallelogram, reflected if it lies in the wrong half.
    let (mut u, mut v) = (random(seed, number, 1), random(seed, number, 2));
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    let w = 1.0 - u - v;
    let at = |k: usize| enter[k] * w + leave[k] * u + apex[k] * v;
    let (second, third) = (at(0), at(1));
    [(1.0 - second - third).max(0.0), second, third]
}

/// Returns a number from 0 to below 1 that depends on these three only.
///
/// Source: the mixing steps of SplitMix64 [Steele 2014], over a counter.
#[inline]
fn random(seed: u64, number: usize, stream: u64) -> f64 {
    let x = mix(seed).wrapping_add((number as u64 * 3 + stream).wrapping_mul(GOLDEN_GAMMA));
    unit(mix(x))
}

/// Converts the upper bits to a number from 0 to below 1.
#[inline]
fn unit(x: u64) -> f64 {
    (x >> 11) as f64 / (1u64 << 53) as f64
}

#[inline]
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::PositionsView;

    fn sampler(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Option<SurfaceSampler> {
        SurfaceSampler::new(
            &Surface::new(PositionsView::F64(positions), bytemuck::cast_slice(triangles)).unwrap(),
        )
    }

    const SQUARE: [[f64; 3]; 5] =
        [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [f64::NAN, 0.0, 0.0]];

    #[test]
    fn random_numbers_match_the_reference_program() {
        // The first outputs of the reference program for the seed 1234567.
        let mut random = Random::new(1_234_567);
        let first = [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423];
        assert_eq!(first, [(); 3].map(|()| random.next_u64()));
        assert!((0..1000).map(|_| random.unit()).all(|x| (0.0..1.0).contains(&x)));
    }

    #[test]
    fn faces_get_samples_by_their_area() {
        // The second face is left out, the third has no area, the fourth has a quarter of the first.
        let mut positions = SQUARE.to_vec();
        positions.extend([[3.0, 0.0, 0.0], [3.5, 0.0, 0.0], [3.0, 0.5, 0.0]]);
        let s = sampler(&positions, &[[0, 1, 2], [0, 1, 4], [1, 3, 3], [5, 6, 7]]).unwrap();
        let mut counts = [0; 4];
        for x in s.samples(0..1000, 1000, 7) {
            counts[x.face.index()] += 1;
            assert!(
                x.weights.iter().all(|&w| w >= 0.0) && (x.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12
            );
        }
        assert_eq!(counts, [800, 0, 0, 200]);
    }

    #[test]
    fn samples_fill_a_face_evenly() {
        let s = sampler(&SQUARE, &[[0, 1, 2]]).unwrap();
        let count = 40_000;
        // Moments of the unit triangle: the mean of x is 1/3, of x² 1/6, of xy 1/12.
        let (mut x, mut xx, mut xy) = (0.0, 0.0, 0.0);
        for sample in s.samples(0..count, count, 1) {
            let [_, u, v] = sample.weights;
            x += u;
            xx += u * u;
            xy += u * v;
        }
        let n = count as f64;
        // Independent samples would be off by about 0.24 / 200 = 1e-3; stratified ones by about 1e-5.
        for (got, wanted) in [(x / n, 1.0 / 3.0), (xx / n, 1.0 / 6.0), (xy / n, 1.0 / 12.0)] {
            assert!((got - wanted).abs() < 5e-5, "{got} {wanted}");
        }
    }

    #[test]
    fn neighbours_in_order_are_neighbours_on_the_face() {
        let s = sampler(&SQUARE, &[[0, 1, 2], [1, 3, 2]]).unwrap();
        let at = |x: Sample| [x.weights[1], x.weights[2]];
        let all: Vec<_> = s.samples(0..1024, 1024, 1).collect();
        let far = all.windows(2).filter(|w| w[0].face == w[1].face).map(|w| {
            let (a, b) = (at(w[0]), at(w[1]));
            (a[0] - b[0]).hypot(a[1] - b[1])
        });
        // A patch is 1/512 of the face: its longest edge is 1/16 · √2 or less.
        assert!(far.fold(0.0, f64::max) < 0.18);
    }

    #[test]
    fn parts_join_to_the_whole_and_seeds_differ() {
        let s = sampler(&SQUARE, &[[0, 1, 2], [1, 3, 2]]).unwrap();
        let whole: Vec<_> = s.samples(0..100, 100, 3).collect();
        let parts: Vec<_> = s.samples(0..37, 100, 3).chain(s.samples(37..100, 100, 3)).collect();
        assert_eq!(whole, parts);
        assert_ne!(whole, s.samples(0..100, 100, 4).collect::<Vec<_>>());
    }

    #[test]
    fn without_area_faces_are_weighted_by_perimeter_then_equally() {
        let lines = sampler(&SQUARE, &[[0, 1, 1], [0, 0, 3], [2, 2, 2]]).unwrap();
        let mut counts = [0u32; 3];
        lines.samples(0..1000, 1000, 0).for_each(|x| counts[x.face.index()] += 1);
        assert!(counts[0].abs_diff(414) <= 1 && counts[1].abs_diff(586) <= 1 && counts[2] == 0, "{counts:?}");
        let points = sampler(&SQUARE, &[[0, 0, 0], [1, 1, 1]]).unwrap();
        assert_eq!(points.samples(0..10, 10, 0).filter(|x| x.face.0 == 1).count(), 5);
        assert!(sampler(&SQUARE, &[]).is_none() && sampler(&SQUARE, &[[0, 1, 4]]).is_none());
    }
}
