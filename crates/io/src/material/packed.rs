//! Serialisation of regions, libraries and images into one block of bytes, for formats that embed them.

use std::collections::{HashMap, HashSet};
use std::io::{self, Read, Write};
use std::sync::Arc;

use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;

use super::image_type::image_type;
use super::library::{GeneratedLibrary, Image, Library, Texture, left_out_warnings, lines_of, texture_in};
use super::regions::{Regions, counts};
use crate::assets::MAX_IMAGE_BYTES;
use crate::error::{ReadError, Warning};
use crate::limits::Limits;

impl Regions {
    /// Returns the number of materials and of textures.
    pub(crate) fn counts(&self) -> (usize, usize) {
        counts(self)
    }

    /// Serialises everything, images from their files. Returns warnings about images that were left out.
    pub(crate) fn pack(&self, with_textures: bool) -> io::Result<(Vec<u8>, Vec<Warning>)> {
        let mut packer =
            Packer { out: Vec::new(), images: Vec::new(), names: HashSet::new(), left: MAX_IMAGE_BYTES };
        let (mut missing, mut warnings) = (Vec::new(), Vec::new());
        packer.number(self.names.len());
        self.names.iter().for_each(|name| packer.bytes(name));
        packer.number(self.entries.len());
        self.entries.as_flattened().iter().for_each(|&name| packer.number(name as usize));
        packer.number(self.materials.len());
        self.materials.iter().for_each(|&name| packer.number(name as usize));
        packer.number(self.libraries.len());
        for library in &self.libraries {
            packer.bytes(library.name());
            let Some(text) = library.text() else {
                packer.out.push(0);
                continue;
            };
            packer.out.push(if library.is_tinted() { 2 } else { 1 });
            let text = packer.library(library, text, with_textures, &mut missing);
            packer.bytes(&text);
            packer.number(packer.images.len());
            for image in std::mem::take(&mut packer.images) {
                packer.bytes(image.name.as_bytes());
                packer.bytes(&image.bytes);
            }
            warnings.extend(library.losses());
        }
        if !with_textures && !missing.is_empty() {
            warnings.push(Warning::note("images dropped: --textures none"));
        } else {
            warnings.extend(left_out_warnings(&missing));
        }
        let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
        zlib.write_all(&packer.out)?;
        Ok((zlib.finish()?, warnings))
    }

    /// Deserialises untrusted bytes.
    pub(crate) fn unpack(bytes: &[u8], limits: Limits) -> Result<(Self, Vec<Warning>), ReadError> {
        let bad = |what: &str| ReadError::element("the materials", what);
        let most = limits.max_unpacked_bytes(bytes.len()).min(2 * MAX_IMAGE_BYTES);
        let mut plain = Vec::new();
        ZlibDecoder::new(bytes)
            .take(most.saturating_add(1))
            .read_to_end(&mut plain)
            .map_err(|_| bad("their bytes are damaged"))?;
        if plain.len() as u64 > most {
            return Err(ReadError::Limit { what: "the materials", size: plain.len() as u64, limit: most });
        }
        let mut rest = Unpacker(&plain);
        let mut regions = Self::default();
        let mut warnings = Vec::new();
        let short = || bad("they are too short");
        for _ in 0..rest.number().ok_or_else(short)? {
            regions.names.push(rest.bytes().ok_or_else(short)?.into());
        }
        let known = regions.names.len() as u32;
        for _ in 0..rest.number().ok_or_else(short)? {
            let mut entry = [0; 4];
            for name in &mut entry {
                *name = rest.number().ok_or_else(short)?;
            }
            if entry.iter().any(|&name| name >= known && name != super::regions::NONE) {
                return Err(bad("a region refers to a name that does not exist"));
            }
            regions.entries.push(entry);
        }
        for _ in 0..rest.number().ok_or_else(short)? {
            let name = rest.number().ok_or_else(short)?;
            if name >= known {
                return Err(bad("a material refers to a name that does not exist"));
            }
            regions.materials.push(name);
        }
        for _ in 0..rest.number().ok_or_else(short)? {
            let name: Arc<[u8]> = rest.bytes().ok_or_else(short)?.into();
            let kind = rest.byte().ok_or_else(short)?;
            if kind == 0 {
                regions.libraries.push(Library::named(name));
                continue;
            }
            let text = rest.bytes().ok_or_else(short)?;
            let mut made = GeneratedLibrary { tints_images: kind == 2, ..GeneratedLibrary::default() };
            for _ in 0..rest.number().ok_or_else(short)? {
                let name = rest.bytes().ok_or_else(short)?;
                let bytes = rest.bytes().ok_or_else(short)?.to_vec();
                let Some(name) = plain_name(name) else {
                    // Another name could be written outside the target folder.
                    warnings.push(Warning::lost("an image of the file has an unsafe name: left out"));
                    continue;
                };
                let kind = image_type(&bytes).unwrap_or("application/octet-stream");
                made.images.push(Image { name, kind, bytes });
            }
            regions.libraries.push(Library::packed(text, made));
        }
        Ok((regions, warnings))
    }
}

/// Returns the file name if it has no path and no special characters.
fn plain_name(name: &[u8]) -> Option<String> {
    let name = std::str::from_utf8(name).ok()?;
    let is_plain = !name.is_empty()
        && !name.starts_with('.')
        && !name
            .chars()
            .any(|c| c.is_control() || matches!(c, '/' | '\\' | ':' | '*' | '?' | '"' | '<' | '>' | '|'));
    is_plain.then(|| name.to_owned())
}

struct Packer {
    out: Vec<u8>,
    images: Vec<Image>,
    names: HashSet<String>,
    left: u64,
}

impl Packer {
    fn number(&mut self, number: usize) {
        self.out.extend((number as u32).to_le_bytes());
    }
    fn bytes(&mut self, bytes: &[u8]) {
        self.number(bytes.len());
        self.out.extend_from_slice(bytes);
    }

    /// Returns the text of a library, with image paths replaced by their names in the packed file.
    fn library(
        &mut self,
        library: &Library,
        text: &[u8],
        with_textures: bool,
        missing: &mut Vec<String>,
    ) -> Vec<u8> {
        let mut known: HashMap<Vec<u8>, Vec<u8>> = HashMap::new();
        let mut out = Vec::new();
        for line in lines_of(text) {
            let Some(at) = texture_in(line) else {
                out.extend_from_slice(line);
                continue;
            };
            let old = &line[at.clone()];
            let new = known.entry(old.to_vec()).or_insert_with(|| {
                match if with_textures { self.image(library, old) } else { Err("is left out".to_owned()) } {
                    Ok(name) => name.into_bytes(),
                    Err(why) => {
                        missing.push(format!("{} {why}", crate::excerpt::excerpt_of_bytes(old)));
                        old.to_vec()
                    }
                }
            });
            out.extend_from_slice(&line[..at.start]);
            out.extend_from_slice(new);
            out.extend_from_slice(&line[at.end..]);
        }
        out
    }

    fn image(&mut self, library: &Library, path: &[u8]) -> Result<String, String> {
        let (own, bytes) = match library.find_texture(path)? {
            Texture::Embedded(image) => {
                let left = self.left.checked_sub(image.bytes.len() as u64);
                self.left = left.ok_or("is too large")?;
                (image.name.clone(), image.bytes.clone())
            }
            Texture::File(file) => {
                (file.name().to_string_lossy().into_owned(), file.read_image(&mut self.left)?)
            }
        };
        let own = plain_name(own.as_bytes()).unwrap_or_else(|| "texture".to_owned());
        if let Some(same) = self.images.iter().find(|i| i.bytes == bytes) {
            return Ok(same.name.clone());
        }
        let (stem, ending) =
            own.rsplit_once('.').map_or((&*own, String::new()), |(s, e)| (s, format!(".{e}")));
        let mut name = own.clone();
        let mut number = 1;
        while !self.names.insert(name.clone()) {
            number += 1;
            name = format!("{stem}_{number}{ending}");
        }
        self.images.push(Image { name: name.clone(), kind: "", bytes });
        Ok(name)
    }
}

struct Unpacker<'a>(&'a [u8]);

impl<'a> Unpacker<'a> {
    fn byte(&mut self) -> Option<u8> {
        let (byte, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*byte)
    }
    fn number(&mut self) -> Option<u32> {
        let (number, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(u32::from_le_bytes(*number))
    }
    fn bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.number()? as usize;
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_names_become_files() {
        for name in ["../a.png", "/a.png", "a\\b.png", "C:a.png", ".hidden", "", "..", "a\0b", "a\nb"] {
            assert_eq!(plain_name(name.as_bytes()), None, "{name}");
        }
        assert_eq!(plain_name("my wood é.png".as_bytes()).as_deref(), Some("my wood é.png"));
    }
}
