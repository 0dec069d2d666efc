//! Sizes of the base colour images, from the first bytes of their files.

use std::collections::{HashMap, HashSet};
use std::io::Read;

use super::library::{Library, Texture, lines_of, next_word, texture_in};
use super::regions::Regions;
use crate::error::Warning;
use crate::excerpt::excerpt_of_bytes;

impl Regions {
    /// Returns the width and height, in texels, of the base colour image (`map_Kd`) of each region, by the
    /// number of the region; and a warning about images without a size. Images are not decoded: a small part
    /// of each file is read.
    pub fn image_sizes(&self) -> (Vec<Option<[u32; 2]>>, Vec<Warning>) {
        let mut warnings = Vec::new();
        let mut of_material: HashMap<&[u8], Option<[u32; 2]>> =
            self.materials().map(|material| (material, None)).collect();
        let mut described = HashSet::new();
        for library in self.libraries() {
            let mut of_path: HashMap<&[u8], Option<[u32; 2]>> = HashMap::new();
            let mut present = None;
            for line in lines_of(library.text().unwrap_or_default()) {
                let Some((word, rest)) = next_word(line) else { continue };
                let keyword = &line[word];
                if keyword.eq_ignore_ascii_case(b"newmtl") {
                    let name = line[rest..].trim_ascii();
                    // If a material is described twice, the first description counts; materials that no face
                    // uses are skipped.
                    present =
                        Some(name).filter(|name| of_material.contains_key(name) && described.insert(*name));
                } else if let (Some(name), true) = (present, keyword.eq_ignore_ascii_case(b"map_kd"))
                    && let Some(path) = texture_in(line)
                {
                    let path = &line[path];
                    let size = *of_path.entry(path).or_insert_with(|| {
                        size_in(library, path).map_err(|why| warnings.push((path, why))).ok()
                    });
                    of_material.insert(name, size);
                }
            }
        }
        let sizes = self.iter().map(|region| *of_material.get(region.material?)?).collect();
        (sizes, unknown_size_warnings(&warnings))
    }
}

impl Regions {
    /// Returns the bytes of all textures of its libraries on a GPU; those without a size count as none.
    pub(crate) fn texture_bytes(&self) -> u64 {
        let mut bytes = 0u64;
        for library in self.libraries() {
            let mut known = HashSet::new();
            for path in
                lines_of(library.text().unwrap_or_default()).filter_map(|l| texture_in(l).map(|p| &l[p]))
            {
                if known.insert(path)
                    && let Ok([width, height]) = size_in(library, path)
                {
                    bytes = bytes.saturating_add(bytes_with_mipmaps(width, height));
                }
            }
        }
        bytes
    }
}

/// Returns the bytes of a texture on a GPU, as RGBA with 8 bits per channel, with its mipmaps.
pub(crate) fn bytes_with_mipmaps(mut width: u32, mut height: u32) -> u64 {
    const BYTES_PER_TEXEL: u64 = 4;
    let mut bytes = 0;
    loop {
        bytes += u64::from(width) * u64::from(height) * BYTES_PER_TEXEL;
        if width <= 1 && height <= 1 {
            return bytes;
        }
        (width, height) = ((width / 2).max(1), (height / 2).max(1));
    }
}

/// Returns the warning about images of unknown size.
fn unknown_size_warnings(unknown: &[(&[u8], &str)]) -> Vec<Warning> {
    let Some(((path, why), others)) = unknown.split_first() else { return Vec::new() };
    let more = if others.is_empty() { String::new() } else { format!(", and {} more", others.len()) };
    let path = excerpt_of_bytes(path);
    vec![Warning::note(format!(
        "texture {path} {why}: errors in texels are not measured where it is used{more}"
    ))]
}

fn size_in(library: &Library, path: &[u8]) -> Result<[u32; 2], &'static str> {
    match library.find_texture(path)? {
        Texture::Embedded(image) => size_of(&image.bytes),
        Texture::File(file) => size_of_file(&mut file.open().map_err(|_| "cannot be read")?),
    }
}

/// Returns the size of an image from the first bytes of its file.
pub(crate) fn size_of_file(file: &mut impl Read) -> Result<[u32; 2], &'static str> {
    // Most formats have the size at the start; in a JPEG a profile and a preview may come first. Guessed.
    const FIRST_READ_BYTES: u64 = 1 << 16;
    const MAX_HEADER_BYTES: u64 = 1 << 24;
    let mut bytes = Vec::new();
    let mut read_to = |end: u64| -> Result<_, &'static str> {
        let more = end - bytes.len() as u64;
        file.take(more).read_to_end(&mut bytes).map_err(|_| "cannot be read")?;
        Ok(size_of(&bytes))
    };
    let first = read_to(FIRST_READ_BYTES)?;
    if first.is_ok() { first } else { read_to(MAX_HEADER_BYTES)? }
}

pub(crate) fn size_of(bytes: &[u8]) -> Result<[u32; 2], &'static str> {
    // No program displays an image with a longer edge than this, so the header is damaged. Guessed.
    const MAX_EDGE_TEXELS: usize = 1 << 20;
    let size = imagesize::blob_size(bytes).map_err(|_| "is not an image of a known type")?;
    let edge = |texels: usize| u32::try_from(texels).ok().filter(|_| (1..=MAX_EDGE_TEXELS).contains(&texels));
    edge(size.width).zip(edge(size.height)).map(|(w, h)| [w, h]).ok_or("has no valid size")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mipmaps_add_a_third() {
        assert_eq!(bytes_with_mipmaps(1, 1), 4);
        assert_eq!(bytes_with_mipmaps(4, 1), 4 * (4 + 2 + 1));
        assert_eq!(bytes_with_mipmaps(1024, 1024), 4 * ((1 << 22) - 1) / 3);
    }

    #[test]
    fn sizes_come_from_the_first_bytes() {
        let png = |w: u32, h: u32| {
            let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
            bytes.extend(w.to_be_bytes());
            bytes.extend(h.to_be_bytes());
            bytes
        };
        assert_eq!(size_of(&png(640, 480)), Ok([640, 480]));
        assert_eq!(size_of(&png(0, 480)), Err("has no valid size"));
        assert_eq!(size_of(&png(u32::MAX, 1)), Err("has no valid size"));
        for end in 0..23 {
            assert!(size_of(&png(640, 480)[..end]).is_err(), "{end}");
        }
        assert_eq!(size_of(b"P3 1 1"), Err("is not an image of a known type"));
        // A frame of 2 by 3 after a comment longer than the first read.
        let mut jpeg = b"\xff\xd8".to_vec();
        for _ in 0..3 {
            jpeg.extend(b"\xff\xfe\xff\xff");
            jpeg.resize(jpeg.len() + 0xfffd, 7);
        }
        jpeg.extend(b"\xff\xc0\0\x0b\x08\0\x03\0\x02\x01\x01\x11\0");
        assert_eq!(size_of(&jpeg), Ok([2, 3]));
        assert_eq!(size_of_file(&mut &*jpeg), Ok([2, 3]));
        assert!(size_of_file(&mut &jpeg[..jpeg.len() - 6]).is_err());
    }
}
