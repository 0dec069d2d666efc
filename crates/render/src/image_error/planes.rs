//! Image planes of floats, and separable filters.

use lodsmith_core::Image;
use rayon::prelude::*;

/// One number for each pixel, row after row from the top.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) values: Vec<f32>,
}

/// Red, green and blue.
pub(super) type Rgb = [Plane; 3];

impl Plane {
    pub(super) fn map(&self, f: impl Fn(f32) -> f32 + Sync) -> Self {
        Self { width: self.width, values: self.values.par_iter().map(|&x| f(x)).collect() }
    }

    /// Separable filter with horizontal and vertical weights, of odd lengths with the pixel itself in the
    /// middle. Borders are clamped.
    pub(super) fn filtered(&self, across: &[f32], down: &[f32]) -> Self {
        let width = self.width;
        let height = self.values.len() / width;
        let mut rows = vec![0f32; self.values.len()];
        let radius = across.len() / 2;
        rows.par_chunks_mut(width).zip(self.values.par_chunks(width)).for_each(|(out, row)| {
            for (x, out) in out.iter_mut().enumerate() {
                let at = |k: usize| row[(x + k).saturating_sub(radius).min(width - 1)];
                *out = across.iter().enumerate().map(|(k, weight)| weight * at(k)).sum();
            }
        });
        let mut values = vec![0f32; rows.len()];
        let radius = down.len() / 2;
        values.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            for (k, weight) in down.iter().enumerate() {
                let from = (y + k).saturating_sub(radius).min(height - 1);
                let row = &rows[from * width..][..width];
                out.iter_mut().zip(row).for_each(|(out, x)| *out += weight * x);
            }
        });
        Self { width, values }
    }
}

/// Converts an image to linear light from 0 to 1, blended over mid-grey.
pub(super) fn linear_of(image: &Image) -> Rgb {
    let table: Vec<f32> = (0..=255u8).map(|x| decoded(f32::from(x) / 255.0)).collect();
    let behind = decoded(0.5);
    [0, 1, 2].map(|k| {
        let light = |p: &[u8; 4]| {
            let opacity = f32::from(p[3]) / 255.0;
            if p[3] == 255 {
                table[p[k] as usize]
            } else {
                opacity * table[p[k] as usize] + (1.0 - opacity) * behind
            }
        };
        Plane { width: image.width(), values: image.pixels().iter().map(light).collect() }
    })
}

/// sRGB to linear light.
fn decoded(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// Linear light to sRGB.
pub(super) fn encoded(x: f32) -> f32 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// Luma of encoded colours, with the weights of ITU-R BT.601.
pub(super) fn grey_level(rgb: &Rgb) -> Plane {
    let [r, g, b] = rgb;
    let level = |i: usize| 0.299 * r.values[i] + 0.587 * g.values[i] + 0.114 * b.values[i];
    Plane { width: r.width, values: (0..r.values.len()).map(level).collect() }
}
