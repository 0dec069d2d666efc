//! A guess at how many faces a grid leaves, from some of them.

use glam::{DVec3, Vec3A};

use super::model::{Model, Place};
use super::pieces;

/// One face of so many is looked at, within bounds; and one of so many of these in all tries but the last.
const ONE_OF: usize = 10;
const LEAST: usize = 4096;
const MOST: usize = 200_000;
const FIRST_ONE_OF: usize = 6;
/// A guess this near to what is wanted is good enough.
const SURE: f64 = 0.01;
/// Of faces with corners in three cells so many are left when each stands once. (Measured: 0.96 to 1.)
const DISTINCT: f64 = 0.985;
/// Grids tried on the sample, at most.
const GUESSES: usize = 6;

/// Whole numbers in single precision: what is added to it loses its fraction.
const WHOLE: f32 = (3u32 << 22) as f32;

/// Corners of faces spread over the model, from the middle of the box and in its longest edge. (Single precision is enough
/// for a guess, and three numbers side by side.)
pub(super) struct Sample {
    corners: Vec<[Vec3A; 3]>,
    /// Of the box.
    extent: DVec3,
    /// Faces that each stands for.
    each: f64,
    /// Area of the model, about, in squares of the longest edge.
    area: f64,
}

impl Sample {
    pub(super) fn new<P: Place>(model: &Model<'_, P>) -> Self {
        let faces = &model.faces;
        let wanted = (faces.len() / ONE_OF).clamp(LEAST, MOST);
        let stride = (faces.len() / wanted).max(1);
        // One out of each stretch, not always the same: rows of a mesh may be as long as the stretch.
        let inside = |k: usize| (k.wrapping_mul(0x9E37_79B9) >> 7) % stride;
        let (middle, longest) = (model.middle(), model.extent().max_element());
        let corners = pieces::map(faces.len() / stride, |range| {
            let corner = |v| ((model.place(v) - middle) / longest).as_vec3a();
            let face = |k| faces[k * stride + inside(k)].map(corner);
            range.map(face).collect::<Vec<[Vec3A; 3]>>()
        })
        .concat();
        let each = faces.len() as f64 / corners.len() as f64;
        let doubled = |&[a, b, c]: &[Vec3A; 3]| f64::from((b - a).cross(c - a).length());
        let area = 0.5 * each * corners.iter().map(doubled).sum::<f64>();
        Self { corners, extent: model.extent() / longest, each, area }
    }

    /// How many faces a grid leaves, about, with so many cells along the longest edge; by one of `step` faces of the sample.
    fn faces(&self, resolution: f64, step: usize) -> f64 {
        // The middle of the box is that of a cell, or between two.
        let is_between = |x: f64| (x * resolution) as u32 % 2 == 1;
        let shift = Vec3A::from(self.extent.to_array().map(|x| if is_between(x) { 0.5 } else { 0.0 }));
        let resolution = resolution as f32;
        let is_left = |t: &[Vec3A; 3]| {
            let [a, b, c] = t.map(|p| p * resolution + shift + WHOLE);
            !(a.cmpeq(b).all() | b.cmpeq(c).all() | c.cmpeq(a).all())
        };
        let looked_at = self.corners.len().div_ceil(step);
        let left =
            pieces::map(looked_at, |range| range.filter(|&i| is_left(&self.corners[i * step])).count());
        let left: usize = left.iter().sum();
        left as f64 * self.each * DISTINCT * self.corners.len() as f64 / looked_at as f64
    }

    /// Cells along the longest edge of the box that leave about so many faces, from `coarsest` to `finest`.
    pub(super) fn resolution(&self, faces: f64, [coarsest, finest]: [f64; 2]) -> f64 {
        // A cell of a flat surface that lies anyhow has about 1.5 times the area of a side, and two faces.
        let edge = (self.area / (0.75 * faces)).sqrt();
        let guess = 1.0 / edge;
        let mut resolution = if guess.is_finite() { guess } else { coarsest };
        let (mut low, mut high) = (coarsest, finest);
        for guess in 0..GUESSES {
            resolution = resolution.clamp(coarsest, finest);
            let got = self.faces(resolution, FIRST_ONE_OF);
            if got <= faces {
                low = resolution;
            } else {
                high = resolution;
            }
            let wish = resolution * (faces / got.max(0.1 * faces)).sqrt();
            resolution = if wish > low && wish < high { wish } else { (low * high).sqrt() };
            if guess > 0 && (got / faces - 1.0).abs() < 0.1 || high <= low * 1.001 {
                break;
            }
        }
        // With all of the sample, and along what was seen: near the full count it grows more slowly than squares do.
        let got = self.faces(resolution, 1).max(0.5 * faces);
        if (got / faces - 1.0).abs() < SURE {
            return resolution;
        }
        let nearer = (resolution * (faces / got).sqrt()).clamp(coarsest, finest);
        let then = self.faces(nearer, 1).max(0.5 * faces);
        let slope = (then / got).ln() / (nearer / resolution).ln();
        let step = (faces / then).powf(1.0 / if slope.is_finite() { slope.clamp(0.3, 3.0) } else { 2.0 });
        (nearer * step).clamp(coarsest, finest)
    }
}
