//! Estimate of the number of faces that a grid leaves, by counting without building them.

use glam::Vec4;
use lodsmith_core::VertexId;

use super::grid::ClusterGrid;
use super::model::{ClusterInput, ClusterPosition};
use crate::chunks;

/// Faces sampled in the first tries: one in `SAMPLE_STRIDE`, within bounds.
const SAMPLE_STRIDE: usize = 10;
const MIN_SAMPLES: usize = 8192;
const MAX_SAMPLES: usize = 100_000;
/// Number of faces sampled for the area.
const AREA_SAMPLES: usize = 512;
/// Relative tolerance below which one more step along the slope is enough; for samples the standard error
/// counts if it is larger. At most `MAX_TRIES` tries are made.
const COUNT_TOLERANCE: f64 = 0.03;
const SAMPLED_TOLERANCE: f64 = 0.06;
const MAX_TRIES: usize = 3;

/// An estimated resolution for a count.
#[derive(Clone, Copy)]
pub(super) struct Guess {
    pub(super) resolution: f64,
    /// Slope of log(count) over log(resolution): about 2, lower near the full count.
    pub(super) slope: f64,
}

/// Counter of faces with corners in three cells.
pub(super) struct Counter<'m, 'a, P> {
    model: &'m ClusterInput<'a, P>,
    keys: Vec<u32>,
}

impl<'m, 'a, P: ClusterPosition> Counter<'m, 'a, P> {
    pub(super) fn new(model: &'m ClusterInput<'a, P>) -> Self {
        Self { model, keys: vec![0; model.frame.len()] }
    }

    /// Counts them in a grid with `resolution` cells along the longest edge of the box.
    fn count_all(&mut self, resolution: f64) -> f64 {
        ClusterGrid::new(self.model, resolution).keys(self.model, &mut self.keys);
        let (faces, keys) = (&self.model.faces, &self.keys);
        let is_left = |t: &[VertexId; 3]| {
            let [a, b, c] = t.map(|v| keys[v.index()]);
            (a != b) & (b != c) & (c != a)
        };
        let left = chunks::map(faces.len(), |range| faces[range].iter().filter(|t| is_left(t)).count());
        left.iter().sum::<usize>() as f64
    }

    /// Estimates this count from one of `stride` faces.
    fn count_sampled(&self, resolution: f64, stride: usize) -> f64 {
        let (faces, frame) = (&self.model.faces, &self.model.frame);
        let grid = ClusterGrid::new(self.model, resolution);
        let (scale, half) = grid.places();
        let is_left = |t: &[VertexId; 3]| {
            let [a, b, c] = t.map(|v| ClusterGrid::cell_in(Vec4::from(frame[v.index()]) * scale + half));
            !(a.cmpeq(b).all() | b.cmpeq(c).all() | c.cmpeq(a).all())
        };
        let samples = faces.len() / stride;
        let left = chunks::map(samples, |range| {
            range.filter(|&k| is_left(&faces[k * stride + spread(k, stride)])).count()
        });
        left.iter().sum::<usize>() as f64 * faces.len() as f64 / samples as f64
    }

    /// Estimates the resolution that leaves `faces` faces, from the area of a sample.
    fn resolution_by_area(&self, faces: f64) -> f64 {
        let model = self.model;
        let stride = (model.faces.len() / AREA_SAMPLES).max(1);
        let samples = model.faces.len() / stride;
        let longest = model.extent().max_element();
        let doubled = |k: usize| {
            let [a, b, c] = model.faces[k * stride + spread(k, stride)].map(|v| model.place(v) / longest);
            (b - a).cross(c - a).length()
        };
        let area = 0.5 * (0..samples).map(doubled).sum::<f64>() * model.faces.len() as f64 / samples as f64;
        // Cell squares per face. (Measured: from .34 to .38 at 1 % to .46 at 50 % of dense meshes.)
        let squares = 0.36 + 0.2 * faces / model.faces.len() as f64;
        (squares * faces / area).sqrt()
    }

    /// Searches for the grid that leaves about `wanted` faces, from `coarsest` to `finest`.
    pub(super) fn guess(&mut self, wanted: f64, [coarsest, finest]: [f64; 2]) -> Guess {
        let all = self.model.faces.len();
        let stride = all / (all / SAMPLE_STRIDE).clamp(MIN_SAMPLES, MAX_SAMPLES).min(all);
        let first = self.resolution_by_area(wanted);
        let resolution = if first.is_finite() { first.clamp(coarsest, finest) } else { coarsest };
        let mut guess = Guess { resolution, slope: 2.0 };
        if stride > 1 {
            self.approach(&mut guess, wanted, [coarsest, finest], stride);
        }
        self.approach(&mut guess, wanted, [coarsest, finest], 1);
        guess
    }

    fn approach(&mut self, guess: &mut Guess, wanted: f64, bounds: [f64; 2], stride: usize) {
        let near = match stride {
            1 => COUNT_TOLERANCE,
            _ => SAMPLED_TOLERANCE.max(1.5 * (stride as f64 / wanted).sqrt()),
        };
        let [mut low, mut high] = bounds;
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..MAX_TRIES {
            let here = guess.resolution;
            let got = if stride == 1 { self.count_all(here) } else { self.count_sampled(here, stride) };
            if got <= wanted {
                low = here;
            } else {
                high = here;
            }
            if let Some((there, had)) = before.filter(|b| b.1 > 0.0 && got > 0.0) {
                let slope = libm::log(got / had) / libm::log(here / there);
                if slope.is_finite() {
                    guess.slope = slope.clamp(0.5, 3.0);
                }
            }
            before = Some((here, got));
            let next = here * libm::pow(wanted / got.max(0.1 * wanted), 1.0 / guess.slope);
            guess.resolution = if next > low && next < high { next } else { (low * high).sqrt() };
            if (got / wanted - 1.0).abs() < near || high <= low * 1.001 {
                break;
            }
        }
    }
}

/// Varies the sampled element of each stretch: rows of a mesh may be as long as the stretch.
fn spread(k: usize, stride: usize) -> usize {
    // 64 bits on every platform: with the 32-bit `usize` of WebAssembly the mesh would be a different one.
    (((k as u64).wrapping_mul(0x9E37_79B9) >> 7) % stride as u64) as usize
}
