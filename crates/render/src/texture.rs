//! Textures with mipmaps, trilinear and anisotropic filtering.

use std::sync::{Arc, OnceLock};

use lodsmith_core::Image;
use lodsmith_core::model::{Sampler, TextureRef, Wrap};
use rayon::prelude::*;

use crate::linear;

/// Maximum number of anisotropic samples. (Guessed: more make hardly a visible difference.)
const MAX_ANISOTROPY: f32 = 4.0;

/// Interpretation of an image's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelKind {
    /// Colours in sRGB.
    Colors,
    /// Linear values: normals, roughness.
    Numbers,
}

/// The textures of a model. They are built by [`prepare`](Self::prepare), before the parallel work that reads them.
///
/// Reading never builds a texture: a thread that builds a texture waits for other threads of its pool, and could
/// meanwhile start other work that waits for the same texture: a deadlock.
#[derive(Debug)]
pub struct TextureSet {
    images: Vec<Arc<Image>>,
    /// For each image, as colours and as numbers.
    slots: Vec<[OnceLock<Texture>; 2]>,
}

impl TextureSet {
    /// Makes a set for these images; no texture is prepared yet.
    pub fn new(images: &[Arc<Image>]) -> Self {
        Self { images: images.to_vec(), slots: images.iter().map(|_| Default::default()).collect() }
    }

    /// Builds the textures that these references need and that do not exist yet. References to images that do not exist
    /// are ignored.
    ///
    /// Deterministic at any number of threads; uses the caller's thread pool. Several threads may call it at once; then
    /// a texture may be built twice. Cost: O(pixels).
    pub fn prepare<'r>(&self, used: impl IntoIterator<Item = (&'r TextureRef, TexelKind)>) {
        let is_missing = |&(image, kind): &(usize, TexelKind)| {
            self.slots.get(image).is_some_and(|slots| slots[kind.slot()].get().is_none())
        };
        let mut missing: Vec<(usize, TexelKind)> =
            used.into_iter().map(|(reference, kind)| (reference.image, kind)).filter(is_missing).collect();
        missing.sort_unstable_by_key(|&(image, kind)| (image, kind.slot()));
        missing.dedup();
        missing.par_iter().for_each(|&(image, kind)| {
            let made = Texture::new(&self.images[image], kind);
            // If another thread was faster, its texture is the same.
            let _ = self.slots[image][kind.slot()].set(made);
        });
    }

    /// Returns the texture of a reference; `None` if its image does not exist or was not prepared.
    #[inline]
    pub fn get(&self, reference: &TextureRef, kind: TexelKind) -> Option<&Texture> {
        let texture = self.slots.get(reference.image)?[kind.slot()].get();
        debug_assert!(texture.is_some(), "a texture is prepared before it is read");
        texture
    }
}

impl TexelKind {
    /// Index of its texture among the textures of an image.
    fn slot(self) -> usize {
        usize::from(self == Self::Numbers)
    }
}

/// An image and its mipmaps, each half as large as the previous one.
#[derive(Debug)]
pub struct Texture {
    levels: Vec<MipLevel>,
    meaning: TexelKind,
}

#[derive(Debug)]
struct MipLevel {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 4]>,
}

impl Texture {
    /// Builds the mipmaps. Cost: O(pixels).
    pub fn new(image: &Image, meaning: TexelKind) -> Self {
        let first =
            MipLevel { width: image.width(), height: image.height(), pixels: image.pixels().to_vec() };
        let mut levels = vec![first];
        while let Some(last) = levels.last().filter(|l| l.width.max(l.height) > 1 && !l.pixels.is_empty()) {
            levels.push(halved(last, meaning));
        }
        Self { levels, meaning }
    }

    /// Samples linear red, green, blue and alpha at texture coordinates counted from the lower left corner of
    /// the image; `across` and `down` are their changes to the next pixels of the picture to the right and
    /// below.
    pub fn at(&self, uv: [f32; 2], across: [f32; 2], down: [f32; 2], sampler: Sampler) -> [f32; 4] {
        let (w, h) = (self.levels[0].width as f32, self.levels[0].height as f32);
        if w < 1.0 || h < 1.0 || !uv.iter().chain(&across).chain(&down).all(|x| x.is_finite()) {
            return [0.0, 0.0, 0.0, 1.0];
        }
        let [a, d] = [across, down].map(|[u, v]| (u * w).hypot(v * h));
        let (long, short, along) = if a >= d { (a, d, across) } else { (d, a, down) };
        if sampler.nearest && long <= 1.0 {
            let level = &self.levels[0];
            let at = |x: f32, n: usize, wrap| wrapped((wrap_near(x) * n as f32).floor() as i64, n, wrap);
            let x = at(uv[0], level.width, sampler.wrap_u);
            let y = at(1.0 - uv[1], level.height, sampler.wrap_v);
            return self.decoded(level.pixels[y * level.width + x]);
        }
        let looks = (long / short.max(1e-6)).ceil().clamp(1.0, MAX_ANISOTROPY).min(long.ceil().max(1.0));
        let lod = (long / looks).max(1e-6).log2().clamp(0.0, (self.levels.len() - 1) as f32);
        let mut sum = [0f32; 4];
        for i in 0..looks as usize {
            let t = (i as f32 + 0.5) / looks - 0.5;
            let c = self.between_levels([uv[0] + along[0] * t, uv[1] + along[1] * t], lod, sampler);
            (0..4).for_each(|k| sum[k] += c[k] / looks);
        }
        sum
    }

    fn between_levels(&self, uv: [f32; 2], lod: f32, sampler: Sampler) -> [f32; 4] {
        let low = lod as usize;
        let share = lod - low as f32;
        let a = self.between_pixels(uv, low, sampler);
        if share < 1e-3 || low + 1 >= self.levels.len() {
            return a;
        }
        let b = self.between_pixels(uv, low + 1, sampler);
        [0, 1, 2, 3].map(|k| a[k] + (b[k] - a[k]) * share)
    }

    fn between_pixels(&self, uv: [f32; 2], level: usize, sampler: Sampler) -> [f32; 4] {
        let level = &self.levels[level];
        let x = wrap_near(uv[0]) * level.width as f32 - 0.5;
        let y = wrap_near(1.0 - uv[1]) * level.height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let columns = [0, 1].map(|k| wrapped(x0 as i64 + k, level.width, sampler.wrap_u));
        let rows = [0, 1].map(|k| wrapped(y0 as i64 + k, level.height, sampler.wrap_v));
        let pixel = |i: usize, j: usize| self.decoded(level.pixels[rows[j] * level.width + columns[i]]);
        let (a, b, c, d) = (pixel(0, 0), pixel(1, 0), pixel(0, 1), pixel(1, 1));
        [0, 1, 2, 3].map(|k| {
            let (upper, lower) = (a[k] + (b[k] - a[k]) * fx, c[k] + (d[k] - c[k]) * fx);
            upper + (lower - upper) * fy
        })
    }

    #[inline]
    fn decoded(&self, p: [u8; 4]) -> [f32; 4] {
        let alpha = f32::from(p[3]) / 255.0;
        match self.meaning {
            TexelKind::Colors => [linear::of_byte(p[0]), linear::of_byte(p[1]), linear::of_byte(p[2]), alpha],
            TexelKind::Numbers => [0, 1, 2, 3].map(|k| f32::from(p[k]) / 255.0),
        }
    }
}

/// Reduces large coordinates, which repeat, so that they fit integers.
fn wrap_near(x: f32) -> f32 {
    if x.abs() > 4096.0 { x.rem_euclid(2.0) } else { x }
}

fn wrapped(i: i64, n: usize, wrap: Wrap) -> usize {
    let n = n as i64;
    let i = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Clamp => i.clamp(0, n - 1),
        Wrap::Mirror => {
            let i = i.rem_euclid(2 * n);
            if i < n { i } else { 2 * n - 1 - i }
        }
    };
    i as usize
}

/// Halves an image: each pixel is the mean of four, in linear light.
fn halved(from: &MipLevel, meaning: TexelKind) -> MipLevel {
    let (width, height) = ((from.width / 2).max(1), (from.height / 2).max(1));
    let encoder = linear::Encoder::new();
    let light = linear::bytes();
    let mut pixels = vec![[0u8; 4]; width * height];
    pixels.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| {
                let (x, y) = ((2 * x + i).min(from.width - 1), (2 * y + j).min(from.height - 1));
                from.pixels[y * from.width + x]
            });
            let mean = |k: usize| ((four.iter().map(|p| u32::from(p[k])).sum::<u32>() + 2) / 4) as u8;
            *pixel = [0, 1, 2, 3].map(|k| match meaning {
                TexelKind::Colors if k < 3 => {
                    encoder.byte(four.iter().map(|p| light[usize::from(p[k])]).sum::<f32>() * 0.25)
                }
                _ => mean(k),
            });
        }
    });
    MipLevel { width, height, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker(n: usize) -> Image {
        let pixels =
            (0..n * n).map(|i| if (i % n + i / n).is_multiple_of(2) { [255; 4] } else { [0, 0, 0, 255] });
        Image::new(n, n, pixels.collect())
    }

    #[test]
    fn from_afar_a_checker_is_half_as_bright() {
        let texture = Texture::new(&checker(64), TexelKind::Colors);
        for uv in [[0.1, 0.2], [0.51, 0.99], [-7.3, 12.0]] {
            let c = texture.at(uv, [0.25, 0.0], [0.0, 0.25], Sampler::default());
            assert!((c[0] - 0.5).abs() < 0.02 && c[3] == 1.0, "{c:?}");
        }
    }

    /// All threads of the pool request a texture while this one builds it, which is parallel work: neither may wait for
    /// the other.
    #[test]
    fn a_texture_is_built_while_all_threads_of_the_pool_request_it() {
        let images = [Arc::new(checker(256))];
        let reference =
            TextureRef { image: 0, uv_set: 0, transform: TextureRef::PLAIN, sampler: Sampler::default() };
        let set = TextureSet::new(&images);
        let ask = move || {
            set.prepare([(&reference, TexelKind::Colors)]);
            assert!(set.get(&reference, TexelKind::Colors).is_some());
        };
        let (done, is_done) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let held = std::sync::Barrier::new(rayon::current_num_threads() + 1);
            std::thread::scope(|scope| {
                scope.spawn(|| {
                    rayon::broadcast(|_| {
                        held.wait();
                        std::thread::sleep(std::time::Duration::from_millis(200));
                        ask();
                    });
                });
                held.wait();
                ask();
            });
            done.send(()).unwrap();
        });
        is_done.recv_timeout(std::time::Duration::from_secs(60)).expect("there is no deadlock");
    }

    #[test]
    fn the_lower_left_corner_is_the_origin_and_edges_wrap_as_requested() {
        let red_below = Image::new(1, 2, vec![[0, 0, 0, 255], [255, 0, 0, 255]]);
        let texture = Texture::new(&red_below, TexelKind::Numbers);
        let red = |v: f32, wrap_v| {
            let sampler = Sampler { wrap_v, nearest: true, ..Sampler::default() };
            texture.at([0.5, v], [0.01, 0.0], [0.0, 0.01], sampler)[0]
        };
        assert_eq!([red(0.25, Wrap::Repeat), red(0.75, Wrap::Repeat)], [1.0, 0.0]);
        assert_eq!(
            [red(-0.25, Wrap::Repeat), red(-0.25, Wrap::Mirror), red(-9.0, Wrap::Clamp)],
            [0.0, 1.0, 1.0]
        );
        assert_eq!(red(f32::NAN, Wrap::Repeat), 0.0);
    }
}
