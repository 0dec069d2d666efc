//! Image-based lighting: light from all directions, from an image or a built-in studio.

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;

use glam::Vec3;
use image::{DynamicImage, ImageFormat};
use rayon::prelude::*;

use crate::file::{PictureError, decode};
use crate::linear;

/// Pixels per row of a map: enough for reflections on surfaces. (By eye.)
pub const MAP_WIDTH: usize = 128;
/// Rows of a map.
pub const MAP_HEIGHT: usize = 64;
/// Number of maps, from a mirror to the roughest surface.
pub const MAP_COUNT: usize = 6;
/// Number of directions averaged for one pixel of a rougher map. (By eye: with fewer, lamps leave a pattern.)
const PREFILTER_SAMPLES: u32 = 64;

/// Maximum width and height of the image seen behind a model. (By eye: a window shows a fifth of a row.)
const MAX_SKY_SIZE: [usize; 2] = [2048, 1024];
/// Size of the studio image behind a model.
const STUDIO_SIZE: [usize; 2] = [512, 256];
/// Roughness of the map that is shown as a blurred background. (By eye.)
const BLUR_ROUGHNESS: f32 = 0.4;

/// Light from all directions, as if from infinity. Fixed in the world, whose up is +y.
#[derive(Clone, PartialEq)]
pub struct Environment {
    /// Prefiltered maps of increasing roughness.
    maps: Vec<Vec<Vec3>>,
    /// Diffuse light as spherical harmonics: constant, linear and quadratic terms.
    matt: [Vec3; 9],
    /// The image seen directly, not as a reflection.
    sky: LightMap,
}

/// An image of all directions (equirectangular), rows from straight up to straight down.
#[derive(Clone, PartialEq)]
struct LightMap {
    size: [usize; 2],
    pixels: Vec<Vec3>,
}

impl fmt::Debug for Environment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Environment").field("mean", &self.matt[0]).finish_non_exhaustive()
    }
}

impl Environment {
    /// Decodes an equirectangular image: rows from straight up to straight down, twice as wide as high.
    /// Radiance HDR keeps light brighter than white; in other formats white is 1.
    ///
    /// # Errors
    /// [`PictureError::Codec`] if it is damaged, in no known format, or larger than half a gigabyte when unpacked.
    pub fn decode(bytes: &[u8]) -> Result<Self, PictureError> {
        if image::guess_format(bytes)? != ImageFormat::Hdr {
            let picture = decode(bytes)?;
            let light = |&[r, g, b, _]: &[u8; 4]| Vec3::from([r, g, b].map(linear::of_byte));
            let pixels: Vec<Vec3> = picture.pixels().iter().map(light).collect();
            return Ok(Self::of_light(picture.width(), picture.height(), &pixels));
        }
        let DynamicImage::ImageRgb32F(picture) = image::load_from_memory(bytes)? else {
            unreachable!("this format has one kind of pixels");
        };
        let (width, height) = picture.dimensions();
        let pixels: Vec<Vec3> = picture.pixels().map(|p| Vec3::from(p.0)).collect();
        Ok(Self::of_light(width as usize, height as usize, &pixels))
    }

    /// Makes an environment from an image of linear light, with rows from straight up to straight down. NaN
    /// and negative values count as dark.
    ///
    /// # Panics
    /// If there are not `width * height` pixels, or none.
    pub fn of_light(width: usize, height: usize, pixels: &[Vec3]) -> Self {
        assert!(width > 0 && height > 0 && pixels.len() == width * height, "{width} by {height} pixels");
        let sound = |v: Vec3| Vec3::from(v.to_array().map(|x| if x > 0.0 { x.min(1e4) } else { 0.0 }));
        let span = |i: usize, n: usize, of: usize| {
            let first = i * of / n;
            first..((i + 1) * of).div_ceil(n).clamp(first + 1, of.max(first + 1))
        };
        let scaled = |size: [usize; 2]| {
            let mean = |i: usize| {
                let (columns, rows) = (span(i % size[0], size[0], width), span(i / size[0], size[1], height));
                let count = (columns.len() * rows.len()) as f32;
                let all = rows.flat_map(|y| columns.clone().map(move |x| y * width + x));
                all.fold(Vec3::ZERO, |sum, at| sum + sound(pixels[at])) / count
            };
            LightMap { size, pixels: (0..size[0] * size[1]).into_par_iter().map(mean).collect() }
        };
        Self::of_map(
            scaled([MAP_WIDTH, MAP_HEIGHT]).pixels,
            scaled([width.min(MAX_SKY_SIZE[0]), height.min(MAX_SKY_SIZE[1])]),
        )
    }

    /// A built-in studio: a dark room with large soft lamps above and beside, over a bright floor.
    pub fn studio() -> Self {
        // Direction, half extents as tangents, brightness. (By eye.)
        let lamps = [
            (Vec3::new(-0.55, 0.65, 0.55), [0.55, 0.40], 3.2),
            (Vec3::new(0.90, 0.25, 0.30), [0.25, 0.60], 1.6),
            (Vec3::new(0.10, 0.45, -0.90), [0.80, 0.22], 1.8),
            (Vec3::new(0.0, 1.0, 0.0), [0.60, 0.60], 0.9),
        ];
        let light = |d: Vec3| {
            let wall = 0.16 + 0.12 * d.y;
            let floor = 0.10 * (-d.y).clamp(0.0, 1.0);
            let of_lamp = |(at, half, strength): &(Vec3, [f32; 2], f32)| {
                let at = at.normalize_or(Vec3::Y);
                let along = d.dot(at);
                if along <= 0.0 {
                    return 0.0;
                }
                let right = at.cross(if at.y.abs() > 0.9 { Vec3::Z } else { Vec3::Y }).normalize_or(Vec3::X);
                let upward = right.cross(at);
                let edge = |x: f32, half: f32| (1.0 - (x.abs() - half) / 0.08).clamp(0.0, 1.0);
                strength * edge(d.dot(right) / along, half[0]) * edge(d.dot(upward) / along, half[1])
            };
            Vec3::new(1.0, 0.99, 0.97) * (wall + floor + lamps.iter().map(of_lamp).sum::<f32>())
        };
        let map = |size: [usize; 2]| (0..size[0] * size[1]).map(|i| light(direction_in(size, i))).collect();
        Self::of_map(map([MAP_WIDTH, MAP_HEIGHT]), LightMap { size: STUDIO_SIZE, pixels: map(STUDIO_SIZE) })
    }

    /// Returns the data for a shader: rows of [`MAP_WIDTH`] pixels, the maps below each other, [`MAP_HEIGHT`] rows
    /// each, and a last row that starts with the nine coefficients of diffuse light.
    pub fn table(&self) -> Vec<[f32; 4]> {
        let last = self.matt.into_iter().chain(std::iter::repeat(Vec3::ZERO)).take(MAP_WIDTH);
        self.maps.iter().flatten().copied().chain(last).map(|v| [v.x, v.y, v.z, 1.0]).collect()
    }

    /// Returns width and height of the background image, and its pixels for a shader, by rows from straight
    /// up.
    pub fn sky(&self) -> ([usize; 2], Vec<[f32; 4]>) {
        (self.sky.size, self.sky.pixels.iter().map(|v| [v.x, v.y, v.z, 1.0]).collect())
    }

    fn of_map(mirror: Vec<Vec3>, sky: LightMap) -> Self {
        let matt = harmonics(&mirror);
        let mut maps = vec![mirror];
        for level in 1..MAP_COUNT {
            let roughness = level as f32 / (MAP_COUNT - 1) as f32;
            let map = (0..MAP_WIDTH * MAP_HEIGHT)
                .into_par_iter()
                .map(|i| prefilter(&maps[0], direction(i), roughness));
            maps.push(map.collect());
        }
        Self { maps, matt, sky }
    }

    /// Diffuse irradiance on a matt surface, scaled to the brightness of white paper.
    pub(crate) fn matt(&self, n: Vec3) -> Vec3 {
        let sum = basis(n).iter().zip(&self.matt).fold(Vec3::ZERO, |sum, (b, c)| sum + *c * *b);
        sum.max(Vec3::ZERO)
    }

    /// Returns the light that a surface of a roughness reflects from a direction.
    pub(crate) fn mirrored(&self, along: Vec3, roughness: f32) -> Vec3 {
        let level = roughness.clamp(0.0, 1.0) * (MAP_COUNT - 1) as f32;
        let first = (level as usize).min(MAP_COUNT - 2);
        let [a, b] = [first, first + 1].map(|k| looked_up(&self.maps[k], [MAP_WIDTH, MAP_HEIGHT], along));
        a.lerp(b, level - first as f32)
    }

    /// Returns the background in a direction.
    pub(crate) fn seen(&self, along: Vec3, is_blurred: bool) -> Vec3 {
        match is_blurred {
            true => self.mirrored(along, BLUR_ROUGHNESS),
            false => looked_up(&self.sky.pixels, self.sky.size, along),
        }
    }
}

/// The direction of the centre of a pixel of a reflection map.
fn direction(pixel: usize) -> Vec3 {
    direction_in([MAP_WIDTH, MAP_HEIGHT], pixel)
}

/// The direction of the centre of a pixel.
fn direction_in([width, height]: [usize; 2], pixel: usize) -> Vec3 {
    let turn = ((pixel % width) as f32 + 0.5) / width as f32 * TAU - PI;
    let (sin, cos) = (FRAC_PI_2 - ((pixel / width) as f32 + 0.5) / height as f32 * PI).sin_cos();
    Vec3::new(turn.cos() * cos, sin, turn.sin() * cos)
}

/// Bilinear lookup of a map in a direction.
fn looked_up(map: &[Vec3], [width, height]: [usize; 2], d: Vec3) -> Vec3 {
    let x = (d.z.atan2(d.x) / TAU + 0.5) * width as f32 - 0.5;
    let y = (0.5 - d.y.clamp(-1.0, 1.0).asin() / PI) * height as f32 - 0.5;
    let (x0, y0) = (x.floor(), y.floor());
    let at = |x: f32, y: f32| {
        let column = (x as i32).rem_euclid(width as i32) as usize;
        map[(y.max(0.0) as usize).min(height - 1) * width + column]
    };
    let upper = at(x0, y0).lerp(at(x0 + 1.0, y0), x - x0);
    let lower = at(x0, y0 + 1.0).lerp(at(x0 + 1.0, y0 + 1.0), x - x0);
    upper.lerp(lower, y - y0)
}

/// Prefilters a map: the mean reflection of the facets of a rough surface, viewed along its normal.
/// [Karis 2013], the GGX lobe.
fn prefilter(map: &[Vec3], n: Vec3, roughness: f32) -> Vec3 {
    let side = n.cross(if n.y.abs() > 0.9 { Vec3::X } else { Vec3::Y }).normalize_or(Vec3::X);
    let other = n.cross(side);
    let a2 = roughness.powi(4);
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for i in 0..PREFILTER_SAMPLES {
        let u = (i as f32 + 0.5) / PREFILTER_SAMPLES as f32;
        // Bit reversal (van der Corput): evenly distributed for any number of directions.
        let (sin, cos) = (i.reverse_bits() as f32 / 4_294_967_296.0 * TAU).sin_cos();
        let cos_half = ((1.0 - u) / (1.0 + (a2 - 1.0) * u)).sqrt();
        let sin_half = (1.0 - cos_half * cos_half).max(0.0).sqrt();
        let half = side * (cos * sin_half) + other * (sin * sin_half) + n * cos_half;
        let along = half * (2.0 * n.dot(half)) - n;
        let weight = n.dot(along);
        if weight > 0.0 {
            sum += looked_up(map, [MAP_WIDTH, MAP_HEIGHT], along) * weight;
            weights += weight;
        }
    }
    if weights > 0.0 { sum / weights } else { looked_up(map, [MAP_WIDTH, MAP_HEIGHT], n) }
}

/// Spherical harmonics up to degree two.
fn basis(Vec3 { x, y, z }: Vec3) -> [f32; 9] {
    [
        0.282_094_8,
        0.488_602_5 * y,
        0.488_602_5 * z,
        0.488_602_5 * x,
        1.092_548_4 * x * y,
        1.092_548_4 * y * z,
        0.315_391_57 * (3.0 * z * z - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * (x * x - y * y),
    ]
}

/// Projects a map to spherical harmonics, convolved with the cosine lobe. [Ramamoorthi-Hanrahan 2001]
fn harmonics(map: &[Vec3]) -> [Vec3; 9] {
    let mut sums = [Vec3::ZERO; 9];
    for (i, &light) in map.iter().enumerate() {
        let row = (i / MAP_WIDTH) as f32;
        let edge = |row: f32| (row / MAP_HEIGHT as f32 * PI).cos();
        let solid = (edge(row) - edge(row + 1.0)) * TAU / MAP_WIDTH as f32;
        let along = basis(direction(i));
        sums.iter_mut().zip(along).for_each(|(sum, b)| *sum += light * (b * solid));
    }
    // Cosine lobe by degree, divided by pi.
    let share = [1.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 0.25, 0.25, 0.25, 0.25, 0.25];
    [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|k| sums[k] * share[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directions() -> impl Iterator<Item = Vec3> {
        (0..MAP_WIDTH * MAP_HEIGHT).step_by(37).map(direction)
    }

    #[test]
    fn an_even_light_stays_even() {
        let even = Environment::of_light(2, 1, &[Vec3::splat(0.7); 2]);
        for d in directions() {
            assert!((even.matt(d) - 0.7).abs().max_element() < 2e-3, "{:?}", even.matt(d));
            for roughness in [0.0, 0.1, 0.5, 1.0] {
                assert!((even.mirrored(d, roughness) - 0.7).abs().max_element() < 1e-4);
            }
        }
    }

    #[test]
    fn a_white_sky_over_black_lights_by_its_visible_share() {
        let sky: Vec<Vec3> = (0..8).map(|i| Vec3::splat(f32::from(u8::from(i < 4)))).collect();
        let half = Environment::of_light(1, 8, &sky);
        for d in directions() {
            // The known answer: (1 + cos) / 2; degree two adds nothing here, degree four is left out.
            let wanted = 0.5 + 0.5 * d.y;
            assert!((half.matt(d).x - wanted).abs() < 0.01, "{d} {}", half.matt(d));
        }
        assert!(half.mirrored(Vec3::Y, 0.0).x > 0.99 && half.mirrored(Vec3::NEG_Y, 0.0).x < 0.01);
        let slant = Vec3::new(0.8, 0.6, 0.0);
        assert!(half.mirrored(slant, 0.0).x > 0.99 && half.mirrored(slant, 1.0).x < 0.95);
    }

    #[test]
    fn directions_and_pixels_correspond() {
        let mut map = vec![Vec3::ZERO; MAP_WIDTH * MAP_HEIGHT];
        let at = 20 * MAP_WIDTH + 77;
        map[at] = Vec3::ONE;
        assert!((looked_up(&map, [MAP_WIDTH, MAP_HEIGHT], direction(at)).x - 1.0).abs() < 1e-3);
        // Continuous where the map wraps around.
        assert!(looked_up(&map, [MAP_WIDTH, MAP_HEIGHT], Vec3::new(-1.0, 0.0, -0.0)).is_finite());
    }

    #[test]
    fn the_background_has_the_resolution_of_the_image_or_is_blurred() {
        let (width, height) = (512, 256);
        let light = |i: usize| Vec3::splat(f32::from(u8::from((i % width / 8).is_multiple_of(2))));
        let stripes: Vec<Vec3> = (0..width * height).map(light).collect();
        let around = Environment::of_light(width, height, &stripes);
        for i in (0..width * height).skip(width * 128).take(width).step_by(8).map(|i| i + 4) {
            let d = direction_in([width, height], i);
            assert!((around.seen(d, false) - light(i)).abs().max_element() < 1e-3);
            assert!((around.seen(d, true).x - 0.5).abs() < 0.1, "{}", around.seen(d, true));
        }
        let (size, table) = Environment::of_light(5000, 2, &[Vec3::ONE; 10_000]).sky();
        assert_eq!((size, table.len()), ([2048, 2], 4096));
    }

    #[test]
    fn files_are_read_and_bad_ones_refused() {
        assert!(Environment::decode(b"no picture").is_err() && Environment::decode(b"#?RADIANCE\n").is_err());
        // One pixel of 2: mantissa one half, exponent 2.
        let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x80\x80\x82";
        let bright = Environment::decode(hdr).unwrap();
        assert!((bright.mirrored(Vec3::X, 0.0).x - 2.0).abs() < 0.02, "{bright:?}");
        let odd = Environment::of_light(1, 1, &[Vec3::new(f32::NAN, -1.0, f32::INFINITY)]);
        assert!(odd.matt(Vec3::Y).is_finite());
    }
}
