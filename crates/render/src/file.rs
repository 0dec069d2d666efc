//! Image files: PNG, JPEG and WebP.

use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder as _};
use lodsmith_core::Image;

/// An image file format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PictureFormat {
    /// Lossless, with opacity.
    #[default]
    Png,
    /// Smaller, lossy, without opacity: transparent parts become white.
    Jpeg,
    /// Lossless, with opacity.
    WebP,
}

/// Errors of encoding and decoding images.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// Error of the codec.
    #[error("{0}")]
    Codec(#[from] image::ImageError),
}

/// JPEG quality: edges of a drawing stay sharp. (By eye.)
const JPEG_QUALITY: u8 = 92;

impl PictureFormat {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Png, Self::Jpeg, Self::WebP];

    /// Returns the format of a file by its extension; `None` if it is not that of a picture.
    pub fn of_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "png" => Some(Self::Png),
            "jpg" | "jpeg" => Some(Self::Jpeg),
            "webp" => Some(Self::WebP),
            _ => None,
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg => "jpeg",
            Self::WebP => "webp",
        }
    }
}

/// Encodes a picture as a file; opacity is left out if the picture is opaque.
///
/// # Errors
/// [`PictureError::Codec`] if the format does not allow so many pixels.
pub fn encode(picture: &Image, format: PictureFormat) -> Result<Vec<u8>, PictureError> {
    let (width, height) = (picture.width() as u32, picture.height() as u32);
    let is_opaque = picture.pixels().iter().all(|p| p[3] == 255);
    let plain = || picture.pixels().iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect::<Vec<u8>>();
    let whole = || picture.pixels().as_flattened().to_vec();
    let (bytes, kind) = match format {
        PictureFormat::Jpeg if !is_opaque => {
            let over_white = |&[r, g, b, a]: &[u8; 4]| {
                [r, g, b]
                    .map(|c| ((u32::from(c) * u32::from(a) + 255 * (255 - u32::from(a)) + 127) / 255) as u8)
            };
            (picture.pixels().iter().flat_map(over_white).collect(), ExtendedColorType::Rgb8)
        }
        _ if is_opaque => (plain(), ExtendedColorType::Rgb8),
        _ => (whole(), ExtendedColorType::Rgba8),
    };
    let mut file = Vec::new();
    match format {
        PictureFormat::Png => {
            PngEncoder::new_with_quality(&mut file, CompressionType::Default, FilterType::Adaptive)
                .write_image(&bytes, width, height, kind)?;
        }
        PictureFormat::Jpeg => {
            JpegEncoder::new_with_quality(&mut file, JPEG_QUALITY).write_image(&bytes, width, height, kind)?
        }
        PictureFormat::WebP => {
            WebPEncoder::new_lossless(&mut file).write_image(&bytes, width, height, kind)?;
        }
    }
    Ok(file)
}

/// Encodes heights or other single values as a PNG of 16 bits per pixel, row after row from the top.
///
/// # Errors
/// [`PictureError::Codec`] if PNG does not allow so many pixels.
///
/// # Panics
/// If there are not `width * height` values.
pub fn encode_gray16(width: usize, height: usize, values: &[u16]) -> Result<Vec<u8>, PictureError> {
    assert_eq!(values.len(), width * height, "a picture of {width} by {height} needs as many values");
    // (The encoder takes the byte order of the machine.)
    let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_ne_bytes()).collect();
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Default, FilterType::Adaptive).write_image(
        &bytes,
        width as u32,
        height as u32,
        ExtendedColorType::L16,
    )?;
    Ok(file)
}

/// Decodes an image file, whatever its extension.
///
/// # Errors
/// [`PictureError::Codec`] if it is damaged, in an unknown format, or larger than half a gigabyte when
/// decoded.
pub fn decode(bytes: &[u8]) -> Result<Image, PictureError> {
    // (A separate reader with its own limits would compile all decoders a second time: docs/decisions/0019.)
    let pixels = image::load_from_memory(bytes)?.into_rgba8();
    let (width, height) = pixels.dimensions();
    let pixels = pixels.pixels().map(|p| p.0).collect();
    Ok(Image::new(width as usize, height as usize, pixels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_come_back() {
        let pixels = (0..48u8).map(|i| [i * 5, 255 - i, 3 * i, if i % 3 == 0 { 128 } else { 255 }]).collect();
        let picture = Image::new(8, 6, pixels);
        for format in [PictureFormat::Png, PictureFormat::WebP] {
            assert_eq!(decode(&encode(&picture, format).unwrap()).unwrap(), picture, "{format:?}");
        }
        let jpeg =
            decode(&encode(&Image::filled(16, 16, [200, 100, 50, 0]), PictureFormat::Jpeg).unwrap()).unwrap();
        assert!(jpeg.pixels().iter().flatten().all(|&c| c > 250), "transparent pixels are white in a JPEG");
        for format in PictureFormat::ALL {
            assert_eq!(PictureFormat::of_path(&Path::new("a").with_extension(format.name())), Some(format));
        }
        assert!(decode(b"no picture").is_err() && decode(&[]).is_err());
    }
}
