//! FLIP: the difference perceived when flipping between two pictures.
//!
//! Colours are blurred as the eye does at the viewing distance, and compared in a perceptually uniform space;
//! edges and points are compared separately, and a difference in these amplifies the colour difference.

use lodsmith_core::Image;
use rayon::prelude::*;

use super::planes::{Plane, Rgb, linear_of};
use super::size::{SizeError, check_sizes};

/// Pixels per degree of visual angle: a screen of 0.7 m and 3840 pixels, seen from 0.7 m. As in the paper.
pub const PIXELS_PER_DEGREE: f32 = 67.020_645;

/// Exponents and limits from the paper.
const COLOR_EXPONENT: f32 = 0.7;
const FEATURE_EXPONENT: f32 = 0.5;
/// Differences below this fraction of the largest are mapped linearly to 0 to [`LOWER_SHARE`].
const LOWER_PART: f32 = 0.4;
const LOWER_SHARE: f32 = 0.95;
/// Width of the edge and point filters, in degrees.
const FEATURE_WIDTH: f32 = 0.082;

/// Contrast sensitivity as Gaussians, with weight and width of each: achromatic, red-green, blue-yellow.
const SENSITIVITY: [&[[f32; 2]]; 3] = [&[[1.0, 0.0047]], &[[1.0, 0.0053]], &[[34.1, 0.04], [13.5, 0.025]]];
/// The largest width; determines the radius of all blurs.
const MAX_GAUSSIAN_WIDTH: f32 = 0.04;

/// Computes the FLIP value of each pixel, from 0 to 1, row after row; `pixels_per_degree` is usually
/// [`PIXELS_PER_DEGREE`].
///
/// Transparent parts are blended over mid-grey. Uses the caller's rayon pool. Cost: O(pixels · pixels per
/// degree).
///
/// # Errors
/// [`SizeError`] if the sizes of the pictures differ, or they are empty.
///
/// Source: [Andersson et al. 2020], for low dynamic range.
pub fn flip(reference: &Image, candidate: &Image, pixels_per_degree: f32) -> Result<Vec<f32>, SizeError> {
    check_sizes(reference, candidate)?;
    Ok(of_lights(&linear_of(reference), &linear_of(candidate), pixels_per_degree).values)
}

/// Computes FLIP from linear light.
pub(super) fn of_lights(reference: &Rgb, candidate: &Rgb, pixels_per_degree: f32) -> Plane {
    let opponents = [reference, candidate].map(opponent);
    let [a, b] = [&opponents[0], &opponents[1]].map(|o| perceived(o, pixels_per_degree));
    let [fa, fb] = [&opponents[0], &opponents[1]].map(|o| FeatureMaps::of(&o[0], pixels_per_degree));
    let largest = largest_difference();
    let value = |i: usize| {
        let color = color_difference(a[i], b[i], largest);
        let feature = (fa.edges[i] - fb.edges[i]).abs().max((fa.points[i] - fb.points[i]).abs());
        let feature = (feature * std::f32::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT);
        color.powf(1.0 - feature)
    };
    Plane { width: reference[0].width, values: (0..a.len()).into_par_iter().map(value).collect() }
}

/// Linear sRGB to XYZ (D65).
const XYZ_FROM_RGB: [[f32; 3]; 3] = [
    [0.412_390_8, 0.357_584_33, 0.180_480_8],
    [0.212_639, 0.715_168_65, 0.072_192_32],
    [0.019_330_82, 0.119_194_78, 0.950_532_15],
];
const RGB_FROM_XYZ: [[f32; 3]; 3] = [
    [3.240_97, -1.537_383_2, -0.498_610_76],
    [-0.969_243_65, 1.875_967_5, 0.041_555_06],
    [0.055_630_08, -0.203_976_96, 1.056_971_5],
];

fn times(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|[a, b, c]| a * v[0] + b * v[1] + c * v[2])
}

/// Returns XYZ relative to white.
fn relative_to_white(rgb: [f32; 3]) -> [f32; 3] {
    let white = times(&XYZ_FROM_RGB, [1.0; 3]);
    let xyz = times(&XYZ_FROM_RGB, rgb);
    [0, 1, 2].map(|k| xyz[k] / white[k])
}

/// Converts to opponent channels, the linear form of CIELAB: YCxCz.
fn opponent(rgb: &Rgb) -> [Plane; 3] {
    let all: Vec<[f32; 3]> = (0..rgb[0].values.len())
        .map(|i| {
            let [x, y, z] = relative_to_white([0, 1, 2].map(|k| rgb[k].values[i]));
            [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
        })
        .collect();
    [0, 1, 2].map(|k| Plane { width: rgb[0].width, values: all.iter().map(|c| c[k]).collect() })
}

fn rgb_of_opponent([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    let white = times(&XYZ_FROM_RGB, [1.0; 3]);
    let y = (y + 16.0) / 116.0;
    let share = [y + cx / 500.0, y, y - cz / 200.0];
    times(&RGB_FROM_XYZ, [0, 1, 2].map(|k| share[k] * white[k]))
}

/// Perceived colours: blurred, and in CIELAB with less chroma where it is dark (Hunt effect).
fn perceived(opponent: &[Plane; 3], pixels_per_degree: f32) -> Vec<[f32; 3]> {
    use std::f32::consts::PI;
    let radius = (3.0 * (MAX_GAUSSIAN_WIDTH / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
    let blurred: Vec<Plane> = opponent
        .iter()
        .zip(SENSITIVITY)
        .map(|(plane, gaussians)| {
            let kernels: Vec<(f32, Vec<f32>)> = gaussians
                .iter()
                .map(|&[weight, width]| {
                    let degrees = |x: i32| x as f32 / pixels_per_degree;
                    let g = |x: i32| (-PI * PI * degrees(x).powi(2) / width).exp();
                    (weight * (PI / width).sqrt(), (-radius..=radius).map(g).collect())
                })
                .collect();
            // A weighted sum of squared kernels; normalized to a total weight of one.
            let total: f32 = kernels.iter().map(|(weight, k)| weight * k.iter().sum::<f32>().powi(2)).sum();
            let mut sum = Plane { width: plane.width, values: vec![0.0; plane.values.len()] };
            for (weight, kernel) in &kernels {
                let part = plane.filtered(kernel, kernel);
                let share = weight / total;
                sum.values.iter_mut().zip(part.values).for_each(|(sum, x)| *sum += share * x);
            }
            sum
        })
        .collect();
    let color = |i: usize| {
        let rgb = rgb_of_opponent([0, 1, 2].map(|k| blurred[k].values[i]));
        hunt(lab(rgb.map(|x| x.clamp(0.0, 1.0))))
    };
    (0..opponent[0].values.len()).into_par_iter().map(color).collect()
}

fn lab(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let root = |t: f32| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = relative_to_white(rgb).map(root);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn hunt([l, a, b]: [f32; 3]) -> [f32; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// HyAB distance for large differences: city-block distance of lightness and chroma.
fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// The difference that is mapped to one: from green to blue.
fn largest_difference() -> f32 {
    let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|rgb| hunt(lab(rgb)));
    hyab(green, blue).powf(COLOR_EXPONENT)
}

fn color_difference(a: [f32; 3], b: [f32; 3], largest: f32) -> f32 {
    let difference = hyab(a, b).powf(COLOR_EXPONENT);
    let bound = LOWER_PART * largest;
    if difference < bound {
        LOWER_SHARE / bound * difference
    } else {
        LOWER_SHARE + (difference - bound) / (largest - bound) * (1.0 - LOWER_SHARE)
    }
}

/// Edge and point response of each pixel.
struct FeatureMaps {
    edges: Vec<f32>,
    points: Vec<f32>,
}

impl FeatureMaps {
    fn of(achromatic: &Plane, pixels_per_degree: f32) -> Self {
        let level = achromatic.map(|y| (y + 16.0) / 116.0);
        let deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let radius = (3.0 * deviation).ceil() as i32;
        let gaussian = |x: f32| (-x * x / (2.0 * deviation * deviation)).exp();
        let kernel = |f: &dyn Fn(f32) -> f32| -> Vec<f32> {
            let values: Vec<f32> = (-radius..=radius).map(|x| f(x as f32)).collect();
            // Normalized so that positive weights sum to one, negative ones to minus one.
            let above: f32 = values.iter().filter(|x| **x > 0.0).sum();
            let below: f32 = -values.iter().filter(|x| **x < 0.0).sum::<f32>();
            values
                .into_iter()
                .map(|x| if x > 0.0 { x / above } else { x / below.max(f32::MIN_POSITIVE) })
                .collect()
        };
        let smooth = kernel(&gaussian);
        let first = kernel(&|x| -x * gaussian(x));
        let second = kernel(&|x| (x * x / (deviation * deviation) - 1.0) * gaussian(x));
        let strength = |k: &[f32]| {
            let (across, down) = (level.filtered(k, &smooth), level.filtered(&smooth, k));
            across.values.iter().zip(down.values).map(|(x, y)| x.hypot(y)).collect()
        };
        Self { edges: strength(&first), points: strength(&second) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 64;
    const HEIGHT: usize = 48;

    fn picture(color: impl Fn(usize, usize) -> [usize; 3]) -> Image {
        let mut pixels = Vec::new();
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                let [r, g, b] = color(x, y).map(|c| c as u8);
                pixels.push([r, g, b, 255]);
            }
        }
        Image::new(WIDTH, HEIGHT, pixels)
    }

    fn pattern(x: usize, y: usize) -> [usize; 3] {
        [4 * x % 256, 5 * y % 256, (x * x + 3 * y) % 256]
    }

    fn near(a: &Image, b: &Image, mean: f64, at_30_20: f32) {
        let got = flip(a, b, PIXELS_PER_DEGREE).unwrap();
        let got_mean = got.iter().map(|&x| f64::from(x)).sum::<f64>() / got.len() as f64;
        assert!((got_mean - mean).abs() < 2e-4, "{got_mean} for {mean}");
        let got = got[20 * WIDTH + 30];
        assert!((got - at_30_20).abs() < 5e-4, "{got} for {at_30_20}");
    }

    /// Reference values from the authors' program (version 1.7) for the same pictures.
    #[test]
    fn results_match_the_authors_program() {
        let reference = picture(pattern);
        let flat = |color: [usize; 3]| picture(move |_, _| color);
        near(&reference, &reference, 0.0, 0.0);
        let patch = |x: usize, y: usize| (20..40).contains(&x) && (10..30).contains(&y);
        let patched = picture(|x, y| if patch(x, y) { [255, 128, 0] } else { pattern(x, y) });
        near(&reference, &patched, 0.177_622_81, 0.969_237_9);
        let moved = picture(|x, y| {
            let [r, g, _] = pattern((x + 1) % 64, y);
            [r, g, ((x + 1) * (x + 1) + 3 * y) % 256]
        });
        near(&reference, &moved, 0.157_723_68, 0.058_896_31);
        let brighter = picture(|x, y| pattern(x, y).map(|c| (c + 10).min(255)));
        near(&reference, &brighter, 0.206_838, 0.182_090_98);
        near(&flat([0; 3]), &flat([255; 3]), 0.967_365_26, 0.967_388_33);
        near(&flat([0, 255, 0]), &flat([0, 0, 255]), 1.0, 1.0);
        let step = picture(|x, _| if x < 32 { [128; 3] } else { [200; 3] });
        near(&flat([128; 3]), &step, 0.317_404_36, 0.309_240_6);
    }
}
