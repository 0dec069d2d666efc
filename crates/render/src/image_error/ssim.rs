//! Structural similarity.

use super::planes::Plane;

/// Radius of the window: 11 by 11 pixels, as in the paper.
const RADIUS: i32 = 5;
const DEVIATION: f32 = 1.5;
/// Constants of the paper, for levels from 0 to 1.
const C1: f32 = 0.01 * 0.01;
const C2: f32 = 0.03 * 0.03;

/// Computes the similarity around each pixel, from -1 to 1. Borders are clamped; the paper does not define
/// them.
///
/// Source: [Wang et al. 2004].
pub(super) fn map(a: &Plane, b: &Plane) -> Plane {
    let weight = |x: i32| (-((x * x) as f32) / (2.0 * DEVIATION * DEVIATION)).exp();
    let sum: f32 = (-RADIUS..=RADIUS).map(weight).sum();
    let window: Vec<f32> = (-RADIUS..=RADIUS).map(|x| weight(x) / sum).collect();
    let blurred = |f: &(dyn Fn(f32, f32) -> f32 + Sync)| {
        let values = a.values.iter().zip(&b.values).map(|(&a, &b)| f(a, b)).collect();
        Plane { width: a.width, values }.filtered(&window, &window)
    };
    let (mean_a, mean_b) = (blurred(&|a, _| a), blurred(&|_, b| b));
    let (aa, bb, ab) = (blurred(&|a, _| a * a), blurred(&|_, b| b * b), blurred(&|a, b| a * b));
    let similarity = |i: usize| {
        let (ma, mb) = (mean_a.values[i], mean_b.values[i]);
        let (va, vb) = (aa.values[i] - ma * ma, bb.values[i] - mb * mb);
        let covariance = ab.values[i] - ma * mb;
        (2.0 * ma * mb + C1) * (2.0 * covariance + C2) / ((ma * ma + mb * mb + C1) * (va + vb + C2))
    };
    Plane { width: a.width, values: (0..a.values.len()).map(similarity).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_planes_are_a_formula() {
        let flat = |x: f32| Plane { width: 16, values: vec![x; 256] };
        let got = map(&flat(0.25), &flat(0.5));
        let wanted = (2.0 * 0.125 + C1) / (0.0625 + 0.25 + C1);
        assert!(got.values.iter().all(|x| (x - wanted).abs() < 1e-4), "{:?} for {wanted}", got.values[0]);
    }

    #[test]
    fn the_opposite_is_below_zero() {
        let stripes = |sign: f32| {
            let values = (0..1024).map(|i| 0.5 + sign * if i % 4 < 2 { 0.4 } else { -0.4 }).collect();
            Plane { width: 32, values }
        };
        assert!(map(&stripes(1.0), &stripes(-1.0)).values[500] < -0.9);
        assert!((map(&stripes(1.0), &stripes(1.0)).values[500] - 1.0).abs() < 1e-5);
    }
}
