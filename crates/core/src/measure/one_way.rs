//! Distances from one surface to another.

use glam::DVec3;

use crate::geometry::triangle::double_area_normal;
use crate::spatial::Hint;

use super::{Prepared, chunks};

/// What was seen on the way from one surface to another; distances in the units of the positions.
pub(super) struct OneWay {
    pub(super) max: f64,
    pub(super) mean: f64,
    pub(super) rms: f64,
    pub(super) p99: f64,
    /// Between the normals of the two faces, for each sample where both have one.
    pub(super) angles_deg: Vec<f64>,
}

#[derive(Default)]
struct Part {
    /// In the frame of the surface that the way goes to.
    distances: Vec<f64>,
    angles_deg: Vec<f64>,
}

impl OneWay {
    pub(super) fn measure(from: &Prepared, to: &Prepared, samples: usize, seed: u64) -> Self {
        let (source, target) = (from.tree(), to.tree());
        let into_target = |p: DVec3| source.frame().to(target.frame(), p);
        let nearest = |p: DVec3, hint: &mut Hint| target.closest_slot(into_target(p), f64::INFINITY, hint);

        let parts = chunks::map(samples, |range| {
            let mut part = Part { distances: Vec::with_capacity(range.len()), ..Part::default() };
            let mut hint = Hint::default();
            for sample in from.sampler().samples(range, samples, seed) {
                let corners = source.slot_corners(sample.face.0);
                let Some(hit) = nearest(sample.point(corners), &mut hint) else {
                    // Farther than a double can square; the surfaces have nothing to do with each other.
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
        });
        let vertices = source.vertices();
        let at_vertices = chunks::map(vertices.len(), |range| {
            let mut hint = Hint::default();
            let far = |p: &DVec3| nearest(*p, &mut hint).map_or(f64::INFINITY, |hit| hit.distance_sq.sqrt());
            vertices[range].iter().map(far).fold(0.0, f64::max)
        });

        let mut distances = Vec::with_capacity(samples);
        let mut angles_deg = Vec::with_capacity(samples);
        for mut part in parts {
            distances.append(&mut part.distances);
            angles_deg.append(&mut part.angles_deg);
        }
        let max = distances.iter().chain(&at_vertices).copied().fold(0.0, f64::max);
        let mean = chunks::mean(&distances);
        let p99 = quantile(&mut distances, 0.99);
        // Over the largest first: distances of 1e-170 have no square.
        let largest = if max > 0.0 && max.is_finite() { max } else { 1.0 };
        distances.iter_mut().for_each(|d| *d = (*d / largest) * (*d / largest));
        let rms = largest * chunks::mean(&distances).sqrt();
        let user = |length| target.frame().user_length(length);
        Self { max: user(max), mean: user(mean), rms: user(rms), p99: user(p99), angles_deg }
    }
}

/// The angle between two directions of any length, in degrees; `None` if one of them has no length.
fn angle_deg(a: DVec3, b: DVec3) -> Option<f64> {
    let (a, b) = (a.try_normalize()?, b.try_normalize()?);
    // By the half angle: an arc cosine loses half the digits of a small angle.
    Some(2.0 * (a - b).length().atan2((a + b).length()).to_degrees())
}

/// The number that this part of all numbers does not exceed; 0 of none. Changes their order.
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
        assert!(angle_deg(DVec3::ONE * 3.0, DVec3::ONE * 1e-9).unwrap() < 1e-13);
        assert!((angle_deg(DVec3::X, -DVec3::X).unwrap() - 180.0).abs() < 1e-12);
        let small = angle_deg(DVec3::X, DVec3::new(1.0, 1e-9, 0.0)).unwrap();
        assert!((small.to_radians() / 1e-9 - 1.0).abs() < 1e-6);
    }
}
