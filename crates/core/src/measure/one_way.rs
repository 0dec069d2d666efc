//! Distances from one surface to another.

use glam::DVec3;

use crate::geometry::triangle::double_area_normal;
use crate::spatial::Hint;

use super::{Prepared, chunks};

/// Distances from one surface to another, in the units of the positions.
pub(super) struct OneWay {
    pub(super) max: f64,
    pub(super) mean: f64,
    pub(super) rms: f64,
    pub(super) p99: f64,
    /// Angles between the normals of the two faces, for each sample where both faces have one.
    pub(super) angles_deg: Vec<f64>,
    /// The place with the largest distance, in the units of the positions.
    pub(super) farthest: [f64; 3],
}

/// A place of the measured surface, in its frame, and its distance in the frame of the other surface.
#[derive(Clone, Copy)]
struct Place {
    distance: f64,
    point: DVec3,
}

impl Place {
    /// Returns the farther of two places; the first if they are equally far.
    fn farther(self, other: Self) -> Self {
        if other.distance > self.distance { other } else { self }
    }
}

#[derive(Default)]
struct ChunkDistances {
    /// In the frame of the target surface.
    distances: Vec<f64>,
    angles_deg: Vec<f64>,
}

impl OneWay {
    /// Measures, or returns `None` once `is_over` has returned true.
    pub(super) fn measure(
        from: &Prepared,
        to: &Prepared,
        samples: usize,
        seed: u64,
        is_over: &mut dyn FnMut() -> bool,
    ) -> Option<Self> {
        let (source, target) = (from.tree(), to.tree());
        let into_target = |p: DVec3| source.frame().to(target.frame(), p);
        let nearest = |p: DVec3, hint: &mut Hint| target.closest_slot(into_target(p), f64::INFINITY, hint);

        let parts = chunks::map_until(chunks::CHUNK_LENGTH, samples, is_over, |range| {
            let mut part =
                ChunkDistances { distances: Vec::with_capacity(range.len()), ..ChunkDistances::default() };
            let mut hint = Hint::default();
            for sample in from.sampler().samples(range, samples, seed) {
                let corners = source.slot_corners(sample.face.0);
                let Some(hit) = nearest(sample.point(corners), &mut hint) else {
                    // Too far away for the square to fit a double; the surfaces are unrelated.
                    part.distances.push(f64::INFINITY);
                    continue;
                };
                part.distances.push(hit.distance_sq.sqrt());
                part.angles_deg.extend(angle_deg(
                    double_area_normal(corners),
                    double_area_normal(target.slot_corners(hit.slot)),
                ));
            }
            part
        })?;
        let vertices = source.vertices();
        let at_vertices = chunks::map_until(chunks::CHUNK_LENGTH, vertices.len(), is_over, |range| {
            let mut hint = Hint::default();
            let far = |&point: &DVec3| {
                let hit = nearest(point, &mut hint);
                Place { point, distance: hit.map_or(f64::INFINITY, |hit| hit.distance_sq.sqrt()) }
            };
            vertices[range].iter().map(far).reduce(Place::farther)
        })?;

        let taken = parts.iter().map(|part| part.distances.len()).sum();
        let mut distances = Vec::with_capacity(taken);
        let mut angles_deg = Vec::with_capacity(taken);
        for mut part in parts {
            distances.append(&mut part.distances);
            angles_deg.append(&mut part.angles_deg);
        }
        let sampled = farthest_sample(from, &distances, seed);
        let climbed = climb_to_farthest(from, to, &distances, seed);
        let places = at_vertices.into_iter().flatten().chain(sampled).chain(climbed);
        let none = Place { distance: 0.0, point: DVec3::ZERO };
        let Place { distance: max, point } = places.reduce(Place::farther).unwrap_or(none);
        let mean = chunks::mean(&distances);
        let p99 = quantile(&mut distances, 0.99);
        let rms = rms_of(&mut distances, max);
        let user = |length| target.frame().user_length(length);
        let farthest = source.frame().user_from_unit(point);
        Some(Self { max: user(max), mean: user(mean), rms: user(rms), p99: user(p99), angles_deg, farthest })
    }
}

/// An RMS distance, and how exactly the samples determine it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatedRms {
    /// The distance, in the units of the positions.
    pub rms: f64,
    /// Standard deviation of the distance as an estimate, relative to it, as if samples were independent: it is too large
    /// for distances that change slowly over a surface.
    pub relative_deviation: f64,
}

/// Returns the RMS distance of samples; `None` once `is_over` has returned true. Where very many faces meet, there are
/// fewer samples.
pub(super) fn estimated_rms(
    from: &Prepared,
    to: &Prepared,
    samples: usize,
    seed: u64,
    is_over: &mut dyn FnMut() -> bool,
) -> Option<EstimatedRms> {
    let (source, target) = (from.tree(), to.tree());
    let samples = affordable_samples(from, to, samples, seed);
    let parts = chunks::map_until(chunks::CHUNK_LENGTH, samples, is_over, |range| {
        let mut hint = Hint::default();
        let of_samples = from.sampler().samples(range, samples, seed).map(|sample| {
            let p = source.frame().to(target.frame(), sample.point(source.slot_corners(sample.face.0)));
            target
                .closest_slot(p, f64::INFINITY, &mut hint)
                .map_or(f64::INFINITY, |hit| hit.distance_sq.sqrt())
        });
        of_samples.collect::<Vec<f64>>()
    })?;
    let mut distances = parts.concat();
    let largest = distances.iter().copied().fold(0.0, f64::max);
    let rms = target.frame().user_length(rms_of(&mut distances, largest));
    // (They are squares now.)
    let mean = chunks::mean(&distances);
    distances.iter_mut().for_each(|square| *square = (*square - mean) * (*square - mean));
    let of_mean = (chunks::mean(&distances) / distances.len().max(1) as f64).sqrt() / mean;
    Some(EstimatedRms { rms, relative_deviation: if mean > 0.0 { 0.5 * of_mean } else { 0.0 } })
}

/// Returns the root of the mean square of distances, of which one is the largest. Replaces them by their squares, with the
/// largest as unit.
fn rms_of(distances: &mut [f64], largest: f64) -> f64 {
    // Divided by the largest first: the square of 1e-170 underflows.
    let largest = if largest > 0.0 && largest.is_finite() { largest } else { 1.0 };
    distances.iter_mut().for_each(|d| *d = (*d / largest) * (*d / largest));
    largest * chunks::mean(distances).sqrt()
}

/// Largest number of queries that show how many faces each tests.
const MAX_PILOTS: usize = 256;
/// Number of samples for each of these queries, at least.
const SAMPLES_PER_PILOT: usize = 32;
/// Number of faces that a query may test, in the mean, without fewer samples. (Guessed.)
const TESTS_PER_SAMPLE: usize = 64;
/// Smallest number of samples because of the tests.
const FEWEST_SAMPLES: usize = 2_000;

/// Returns a number of samples up to the given one, fewer if each is near very many faces, so that the work stays
/// proportional to the given number.
pub(super) fn affordable_samples(from: &Prepared, to: &Prepared, samples: usize, seed: u64) -> usize {
    let (source, target) = (from.tree(), to.tree());
    let pilots = (samples / SAMPLES_PER_PILOT).clamp(1, MAX_PILOTS);
    let tests = from.sampler().samples(0..pilots, pilots, seed).map(|sample| {
        let p = sample.point(source.slot_corners(sample.face.0));
        target.count_near(source.frame().to(target.frame(), p))
    });
    let tests = tests.sum::<usize>() / pilots;
    if tests <= TESTS_PER_SAMPLE {
        return samples;
    }
    let affordable = (samples as u128 * TESTS_PER_SAMPLE as u128 / tests as u128) as usize;
    affordable.max(FEWEST_SAMPLES).min(samples)
}

/// Number of samples from which a hill climb searches for a farther place. The largest distance of a scan
/// rises by up to a tenth within the first few (measured on a terrain of 200,000 faces at a tenth of them);
/// this many are some 5,000 queries (calculated).
const CLIMB_SAMPLES: usize = 64;

/// Returns the place of the first of the samples with the largest distance.
fn farthest_sample(from: &Prepared, distances: &[f64], seed: u64) -> Option<Place> {
    let farther = |best: (usize, f64), other: (usize, f64)| if other.1 > best.1 { other } else { best };
    let (number, distance) = distances.iter().copied().enumerate().reduce(farther)?;
    let sample = from.sampler().samples(number..number + 1, distances.len(), seed).next()?;
    Some(Place { distance, point: sample.point(from.tree().slot_corners(sample.face.0)) })
}

/// Returns the farthest place found by hill climbing from the samples with the largest distances, each within its face;
/// of equally far places, that of the first sample.
fn climb_to_farthest(from: &Prepared, to: &Prepared, distances: &[f64], seed: u64) -> Option<Place> {
    let mut order: Vec<usize> = (0..distances.len()).collect();
    let farthest_first = |a: &usize, b: &usize| distances[*b].total_cmp(&distances[*a]).then(a.cmp(b));
    if order.len() > CLIMB_SAMPLES {
        order.select_nth_unstable_by(CLIMB_SAMPLES, farthest_first);
        order.truncate(CLIMB_SAMPLES);
    }
    order.sort_unstable();
    let climb = |&number: &usize| {
        let sample = from.sampler().samples(number..number + 1, distances.len(), seed).next()?;
        let [a, b, c] = from.tree().slot_corners(sample.face.0);
        let point = |[u, v]: [f64; 2]| a * (1.0 - u - v) + b * u + c * v;
        let mut hint = Hint::default();
        let mut height = |at: [f64; 2]| {
            let p = from.tree().frame().to(to.tree().frame(), point(at));
            to.tree().closest_slot(p, f64::INFINITY, &mut hint).map_or(0.0, |hit| hit.distance_sq)
        };
        let mut at = [sample.weights[1], sample.weights[2]];
        let mut best = height(at);
        // Starts with a step of a quarter of the face, ends with one of a thousandth.
        let mut step = 0.25;
        while step > 1e-3 {
            let around = [[1.0, 0.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, -1.0]];
            let mut next = (best, at);
            for [x, y] in around {
                let u = (at[0] + x * step).clamp(0.0, 1.0);
                let v = (at[1] + y * step).clamp(0.0, 1.0 - u);
                let h = height([u, v]);
                if h > next.0 {
                    next = (h, [u, v]);
                }
            }
            if next.0 > best { (best, at) = next } else { step *= 0.5 }
        }
        Some(Place { distance: best.sqrt(), point: point(at) })
    };
    order.iter().filter_map(climb).reduce(Place::farther)
}

/// Returns the angle between two directions of any length, in degrees; `None` if one has length zero.
fn angle_deg(a: DVec3, b: DVec3) -> Option<f64> {
    // An arc cosine would lose half the digits of a small angle.
    (a != DVec3::ZERO && b != DVec3::ZERO).then(|| libm::atan2(a.cross(b).length(), a.dot(b)).to_degrees())
}

/// Returns the quantile `part` (0 to 1) of the numbers; 0 if there are none. Reorders them.
pub(super) fn quantile(numbers: &mut [f64], part: f64) -> f64 {
    if numbers.is_empty() {
        return 0.0;
    }
    let at = ((part * numbers.len() as f64).ceil() as usize).clamp(1, numbers.len()) - 1;
    *numbers.select_nth_unstable_by(at, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_near_very_many_faces_are_fewer() {
        for (mesh, least) in [(crate::shapes::blob(3, 2), 200_000), (crate::shapes::book(4_000), 2_000)] {
            let prepared = Prepared::new(&mesh.surface()).unwrap();
            let samples = affordable_samples(&prepared, &prepared, 200_000, 0);
            assert!(samples >= least && (least == 200_000 || samples < 100_000), "{samples}");
            assert_eq!(affordable_samples(&prepared, &prepared, 500, 0), 500);
        }
    }

    #[test]
    fn a_quantile_is_one_of_the_numbers() {
        let mut numbers: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(quantile(&mut numbers, 0.99), 99.0);
        assert_eq!(quantile(&mut numbers, 1.0), 100.0);
        assert_eq!(quantile(&mut [], 0.5), 0.0);
        assert_eq!(quantile(&mut [4.0], 0.01), 4.0);
    }

    #[test]
    fn angles_keep_their_digits() {
        assert_eq!(angle_deg(DVec3::X, DVec3::ZERO), None);
        assert_eq!(angle_deg(DVec3::ONE * 3.0, DVec3::ONE * 1e-9), Some(0.0));
        assert!((angle_deg(DVec3::X, -DVec3::X).unwrap() - 180.0).abs() < 1e-12);
        let small = angle_deg(DVec3::X, DVec3::new(1.0, 1e-9, 0.0)).unwrap();
        assert!((small.to_radians() / 1e-9 - 1.0).abs() < 1e-6);
    }
}
