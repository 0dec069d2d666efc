//! Decoding of the images of a file.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt;
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use image::codecs::tga::TgaDecoder;
use image::{DynamicImage, ImageFormat};
use lodsmith_core::Image;
use lodsmith_core::model::{Material, TextureRef};
use rayon::prelude::*;

use crate::error::Warning;
use crate::excerpt::excerpt;
use crate::limits::Limits;

/// Maximum pixels along an edge. Guessed: twice the limit of graphics cards.
const MAX_EDGE_PIXELS: u32 = 1 << 15;

/// The images that materials use, numbered in the order of their first use.
#[derive(Default)]
pub(crate) struct ImageQueue {
    registered: Vec<usize>,
    number_of: HashMap<usize, usize>,
}

/// The encoded bytes of an image and its name, whose extension may give its type; or the reason why it is
/// missing.
pub(crate) type EncodedImage<'a> = Result<(Cow<'a, [u8]>, String), String>;

impl ImageQueue {
    /// Registers an image of the file and returns its index in the model.
    pub(crate) fn register(&mut self, image: usize) -> usize {
        *self.number_of.entry(image).or_insert_with(|| {
            self.registered.push(image);
            self.registered.len() - 1
        })
    }

    /// Returns the index in the file of a registered image.
    pub(crate) fn in_file(&self, number: usize) -> usize {
        self.registered[number]
    }

    /// Decodes the registered images for display. Textures whose images cannot be decoded are removed from the materials:
    /// what is made from the model, such as a picture or baked maps, lacks them.
    ///
    /// `fits` may refuse an image for a slot, by the index of the slot in [`Material::textures_mut`].
    pub(crate) fn decode<'a>(
        self,
        materials: &mut [Material],
        limits: Limits,
        encoded: impl Fn(usize) -> EncodedImage<'a>,
        fits: impl Fn(usize, &Image) -> bool,
    ) -> (Vec<Arc<Image>>, Vec<Warning>) {
        let (images, missing) = self.decode_within(max_pixels(limits), materials, encoded, fits);
        let text = |Missing { number, why }| format!("image {number} {why}: surfaces are shown without it");
        (images, summarize_warnings(missing.into_iter().map(text).collect(), Warning::lost))
    }

    /// Decodes the registered images for a run, which keeps their colours in place. Warns of images that are too large
    /// for that; images that cannot be decoded have no colours in any case.
    pub(crate) fn decode_colors<'a>(
        self,
        materials: &mut [Material],
        limits: Limits,
        encoded: impl Fn(usize) -> EncodedImage<'a>,
    ) -> (Vec<Arc<Image>>, Vec<Warning>) {
        // Guessed: they may take an eighth of the memory, beside the meshes and the run.
        let most = max_pixels(Limits { memory: limits.memory / 4, ..limits });
        let (images, missing) = self.decode_within(most, materials, encoded, |_, _| true);
        let too_large = |m: &Missing| matches!(m.why, NoImage::TooLarge(..));
        let text =
            |Missing { number, why }| format!("image {number} {why}: its colors are not kept in place");
        (images, summarize_warnings(missing.into_iter().filter(too_large).map(text).collect(), Warning::note))
    }

    fn decode_within<'a>(
        self,
        mut left: u64,
        materials: &mut [Material],
        encoded: impl Fn(usize) -> EncodedImage<'a>,
        fits: impl Fn(usize, &Image) -> bool,
    ) -> (Vec<Arc<Image>>, Vec<Missing>) {
        let ready: Vec<_> = self.registered.iter().map(|&i| check_image(encoded(i), &mut left)).collect();
        let decoded: Vec<Result<Arc<Image>, NoImage>> =
            ready.into_par_iter().map(|ready| ready.and_then(CheckedImage::decode).map(Arc::new)).collect();

        let mut images = Vec::new();
        let mut place_of: Vec<Option<usize>> = Vec::new();
        let mut missing = Vec::new();
        for (&number, image) in self.registered.iter().zip(decoded) {
            place_of.push(image.as_ref().ok().map(|_| images.len()));
            match image {
                Ok(image) => images.push(image),
                Err(why) => missing.push(Missing { number, why }),
            }
        }
        for material in materials {
            for (slot, texture) in material.textures_mut().into_iter().enumerate() {
                *texture = texture.and_then(|t| {
                    let image = place_of[t.image].filter(|&at| fits(slot, &images[at]))?;
                    Some(TextureRef { image, ..t })
                });
            }
        }
        (images, missing)
    }
}

/// An image that was not decoded, by its number in the file.
struct Missing {
    number: usize,
    why: NoImage,
}

/// Why an image was not decoded; shown as the end of a sentence that begins with its name.
enum NoImage {
    TooLarge(u32, u32),
    Other(String),
}

impl fmt::Display for NoImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLarge(width, height) => {
                write!(f, "has {width} x {height} pixels, which is above the limits")
            }
            Self::Other(why) => f.write_str(why),
        }
    }
}

impl From<String> for NoImage {
    fn from(why: String) -> Self {
        Self::Other(why)
    }
}

impl From<&str> for NoImage {
    fn from(why: &str) -> Self {
        Self::Other(why.to_owned())
    }
}

/// Returns the largest number of pixels of all images together: four bytes each, and as many again during decoding.
fn max_pixels(limits: Limits) -> u64 {
    limits.pixels.min(limits.memory / 8)
}

/// Decodes an image within the limits.
///
/// # Errors
/// The end of a sentence that begins with its name.
pub(crate) fn decode_image(encoded: EncodedImage<'_>, limits: Limits) -> Result<Image, String> {
    let image = check_image(encoded, &mut max_pixels(limits)).and_then(CheckedImage::decode);
    image.map_err(|why| why.to_string())
}

/// Returns the first few texts as warnings, and a count of the others.
fn summarize_warnings(mut texts: Vec<String>, warning: fn(String) -> Warning) -> Vec<Warning> {
    // A longer list would not help. Guessed.
    const MAX_WARNINGS: usize = 16;
    let more = texts.len().saturating_sub(MAX_WARNINGS);
    texts.truncate(MAX_WARNINGS);
    if more > 0 {
        texts.push(format!("{more} more images cannot be shown"));
    }
    texts.into_iter().map(warning).collect()
}

/// An image whose size fits the limits.
struct CheckedImage<'a> {
    bytes: Cow<'a, [u8]>,
    format: ImageFormat,
    size: (u32, u32),
}

fn check_image<'a>(encoded: EncodedImage<'a>, left: &mut u64) -> Result<CheckedImage<'a>, NoImage> {
    let (bytes, name) = encoded?;
    // A type without a signature is recognised by the extension.
    let by_name = || ImageFormat::from_path(Path::new(&name)).ok().filter(|f| *f == ImageFormat::Tga);
    let format = image::guess_format(&bytes).ok().or_else(by_name);
    let format = format.ok_or("has an unsupported type (PNG, JPEG, WebP, BMP and TGA are supported)")?;
    let (width, height) = size_of(&bytes, format).ok_or("cannot be decoded: its header is damaged")?;
    let pixels = u64::from(width) * u64::from(height);
    if width.max(height) > MAX_EDGE_PIXELS || pixels > *left {
        return Err(NoImage::TooLarge(width, height));
    }
    *left -= pixels;
    Ok(CheckedImage { bytes, format, size: (width, height) })
}

/// Returns the width and height in the header.
fn size_of(bytes: &[u8], format: ImageFormat) -> Option<(u32, u32)> {
    if format == ImageFormat::Tga {
        let at = |k: usize| Some(u32::from(u16::from_le_bytes([*bytes.get(k)?, *bytes.get(k + 1)?])));
        return at(12).zip(at(14));
    }
    let size = imagesize::blob_size(bytes).ok()?;
    u32::try_from(size.width).ok().zip(u32::try_from(size.height).ok())
}

impl CheckedImage<'_> {
    fn decode(self) -> Result<Image, NoImage> {
        // (Not with a reader that has its own limits, which would compile all decoders a second time:
        // docs/decisions/0019. An image may take half a gigabyte while it is decoded.)
        let decoded = match self.format {
            ImageFormat::Tga => {
                TgaDecoder::new(Cursor::new(&*self.bytes)).and_then(DynamicImage::from_decoder)
            }
            _ => image::load_from_memory(&self.bytes),
        };
        let decoded = decoded.map_err(|e| cannot_decode(&e))?.into_rgba8();
        if decoded.dimensions() != self.size {
            return Err("cannot be decoded: its header is damaged".into());
        }
        let (width, height) = (decoded.width() as usize, decoded.height() as usize);
        Ok(Image::new(width, height, decoded.into_raw().as_chunks().0.to_vec()))
    }
}

fn cannot_decode(error: &image::ImageError) -> String {
    format!("cannot be decoded: {}", excerpt(&error.to_string()))
}
