//! Screen-space ambient occlusion from the depth of the picture alone.
//!
//! Compares each pixel with pairs of opposite points around it: if it lies deeper than their middle, the
//! surface is concave there. On a plane the middle is at the same depth as the pixel, so flat parts do not
//! change.

use rayon::prelude::*;

use crate::projection::Projection;

/// Distances of the points, as fractions of the height of the picture. (By eye.)
const SAMPLE_RADII: [f32; 3] = [0.006, 0.014, 0.028];
/// Maximum darkening. (By eye.)
const STRENGTH: f32 = 0.75;
/// Directions of the pairs.
const DIRECTIONS: usize = 6;

/// Returns the fraction of light that each pixel gets; `near` is as from [`Projection::screen`].
pub(crate) fn ambient_occlusion(
    near: &[f32],
    width: usize,
    height: usize,
    projection: &Projection,
) -> Vec<f32> {
    let scale = height as f32;
    let mut offsets = Vec::new();
    for (ring, reach) in SAMPLE_RADII.iter().enumerate() {
        for i in 0..DIRECTIONS {
            let turn = (i as f32 + 0.33 * ring as f32) / DIRECTIONS as f32 * std::f32::consts::PI;
            let r = (reach * scale).max(1.0 + ring as f32);
            offsets.push(((r * turn.cos()).round() as i64, (r * turn.sin()).round() as i64, r));
        }
    }
    // Length in the view that one pixel covers at distance 1.
    let pixel = 2.0 * projection.half[1] as f32 / scale;
    let at = |x: i64, y: i64| {
        let is_in = x >= 0 && y >= 0 && x < width as i64 && y < height as i64;
        if is_in { near[y as usize * width + x as usize] } else { f32::NEG_INFINITY }
    };
    let mut raw = vec![1f32; near.len()];
    raw.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, light) in row.iter_mut().enumerate() {
            let own = near[y * width + x];
            if own == f32::NEG_INFINITY {
                continue;
            }
            let distance = projection.distance(own);
            let mut dark = 0.0;
            for &(dx, dy, r) in &offsets {
                let (x, y) = (x as i64, y as i64);
                let pair = [at(x + dx, y + dy), at(x - dx, y - dy)];
                if pair.contains(&f32::NEG_INFINITY) {
                    continue;
                }
                let length = r * pixel * if projection.is_perspective { distance } else { 1.0 };
                let deeper = |n: f32| distance - projection.distance(n);
                // Points far in front belong to another part, and count no more than an edge.
                let depth = 0.5
                    * (deeper(pair[0]).clamp(-2.0 * length, 2.0 * length)
                        + deeper(pair[1]).clamp(-2.0 * length, 2.0 * length));
                dark += (depth / length - 0.04).clamp(0.0, 1.0);
            }
            *light = 1.0 - STRENGTH * (2.0 * dark / offsets.len() as f32).min(1.0);
        }
    });
    // Blur, but not across edges.
    let mut soft = raw.clone();
    soft.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, light) in row.iter_mut().enumerate() {
            let own = near[y * width + x];
            if own == f32::NEG_INFINITY {
                continue;
            }
            let (mut sum, mut count) = (0.0, 0.0);
            for (i, j) in (-2..=2).flat_map(|j| (-2..=2).map(move |i| (i, j))) {
                let (x, y) = (x as i64 + i, y as i64 + j);
                if (at(x, y) - own).abs() < 0.02 * own.abs().max(0.1) {
                    sum += raw[y as usize * width + x as usize];
                    count += 1.0;
                }
            }
            *light = if count > 0.0 { sum / count } else { *light };
        }
    });
    soft
}
