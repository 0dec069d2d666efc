//! Writing of the material library of an OBJ, with its textures copied beside it or linked.

use std::collections::{BTreeSet, HashMap};
use std::ffi::{OsStr, OsString};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use super::library::{Library, Texture, lines_of, path_of, texture_in, with_slashes};
use super::regions::Regions;
use crate::assets::MAX_IMAGE_BYTES;
use crate::drive::{self, File};
use crate::error::{Warning, WriteError};
use crate::excerpt::excerpt_of_bytes;
use crate::files::{write_file, write_new_file};

/// Treatment of materials and textures that are separate files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Textures {
    /// Write a material library beside an OBJ, and copy the textures there. Copy the separate images of a scene
    /// beside its `.gltf`.
    #[default]
    Copy,
    /// Write a material library beside an OBJ; it refers to the textures where they are, and so does a scene.
    Link,
    /// Write neither materials nor textures; a scene keeps them as with `Link`.
    None,
}

impl Textures {
    /// All values, in the order of lists.
    pub const ALL: [Self; 3] = [Self::Copy, Self::Link, Self::None];

    /// Returns the name of the value.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Copy => "copy",
            Self::Link => "link",
            Self::None => "none",
        }
    }
}

/// A library with more missing textures than this was crafted to keep the system busy. Guessed.
const MAX_MISSING_TEXTURES: usize = 10_000;

/// The files written beside an OBJ or a scene.
#[derive(Debug, Default)]
pub(crate) struct SidecarFiles {
    /// The names of libraries for the OBJ.
    pub(crate) libraries: Vec<Vec<u8>>,
    pub(crate) warnings: Vec<Warning>,
    created: Vec<PathBuf>,
}

impl SidecarFiles {
    /// Removes the created files, after writing the mesh or scene itself has failed.
    pub(crate) fn remove(self) {
        for path in self.created {
            // A remaining file does no harm.
            let _ = drive::remove_file(path);
        }
    }
}

/// Writes all libraries as one file beside the OBJ at `target`, under its name, and copies or links the
/// textures. Images in memory are written as files with both of these policies.
///
/// Every statement is copied unchanged except for the paths of textures. Libraries that were not read keep
/// their names.
///
/// # Errors
/// If the system cannot write; the created files are removed then. Missing textures are warnings.
pub(crate) fn write_sidecar_files(
    regions: &Regions,
    target: &Path,
    policy: Textures,
) -> Result<SidecarFiles, WriteError> {
    let mut beside = SidecarFiles::default();
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if policy == Textures::None || !regions.libraries.iter().any(|l| l.text().is_some()) {
        beside.libraries = names_of(regions);
        return Ok(beside);
    }
    // The later error of writing the OBJ describes the problem with the folder better.
    if !drive::is_folder(folder) || drive::metadata(target).is_ok_and(|about| !about.is_file()) {
        return Ok(beside);
    }
    let written = library_text(regions, folder, policy, &mut beside)
        .and_then(|text| write_library(&text, target, folder, &mut beside));
    match written {
        Ok(name) => {
            beside.libraries.push(name);
            let unread = regions.libraries.iter().filter(|l| l.text().is_none());
            beside.libraries.extend(unread.map(|l| l.name().to_vec()));
            Ok(beside)
        }
        Err(error) => {
            beside.remove();
            Err(error)
        }
    }
}

/// Returns the names of the libraries that are files, as in the source.
pub(crate) fn names_of(regions: &Regions) -> Vec<Vec<u8>> {
    regions.libraries.iter().filter(|l| !l.is_generated()).map(|l| l.name().to_vec()).collect()
}

/// Joins all libraries in one text, with paths relative to `folder`.
fn library_text(
    regions: &Regions,
    folder: &Path,
    policy: Textures,
    beside: &mut SidecarFiles,
) -> Result<Vec<u8>, WriteError> {
    let mut missing = MissingTextures::default();
    let mut unusual = BTreeSet::new();
    let mut left = MAX_IMAGE_BYTES;
    let mut text = Vec::new();
    for library in &regions.libraries {
        // Several materials often share a texture.
        let mut paths: HashMap<&[u8], Vec<u8>> = HashMap::new();
        if !text.is_empty() && !text.ends_with(b"\n") {
            text.push(b'\n');
        }
        for line in lines_of(library.text().unwrap_or_default()) {
            let Some(range) = texture_in(line) else {
                text.extend_from_slice(line);
                continue;
            };
            let old = &line[range.clone()];
            if !paths.contains_key(old) {
                let new = path_from(folder, library, old, policy, &mut left, &mut missing, beside)?;
                unusual.extend(unusual_image_type(&new));
                paths.insert(old, new);
            }
            text.extend_from_slice(&line[..range.start]);
            text.extend_from_slice(&paths[old]);
            text.extend_from_slice(&line[range.end..]);
        }
    }
    beside.warnings.extend(missing.warnings());
    if !unusual.is_empty() {
        let kinds = unusual.into_iter().collect::<Vec<_>>().join(" and ");
        let problem = format!(
            "the material library names {kinds} images, which few programs read there: convert them to PNG"
        );
        beside.warnings.push(Warning::note(problem));
    }
    Ok(text)
}

/// Returns the image type by the extension of a texture path, if readers of material libraries rarely support it.
fn unusual_image_type(path: &[u8]) -> Option<&'static str> {
    let extension = path.rsplit(|b| *b == b'.').next()?.to_ascii_lowercase();
    match &extension[..] {
        b"ktx2" => Some("KTX2"),
        b"webp" => Some("WebP"),
        b"basis" => Some("Basis"),
        b"avif" => Some("AVIF"),
        _ => None,
    }
}

/// Returns the path from `folder` to the texture `old` of a library; copies the texture to the folder if
/// necessary.
fn path_from(
    folder: &Path,
    library: &Library,
    old: &[u8],
    policy: Textures,
    left: &mut u64,
    missing: &mut MissingTextures,
    beside: &mut SidecarFiles,
) -> Result<Vec<u8>, WriteError> {
    if missing.count >= MAX_MISSING_TEXTURES {
        missing.add(old, "was not searched for");
        return Ok(old.to_vec());
    }
    let found = match library.find_texture(old) {
        Ok(Texture::File(found)) => found,
        Ok(Texture::Embedded(image)) => {
            let name = copy_into(folder, OsStr::new(&image.name), &image.bytes, beside)?;
            return Ok(bytes_of_path(Path::new(&name)));
        }
        Err(why) => {
            missing.add(old, why);
            return Ok(old.to_vec());
        }
    };
    let real = |path: &Path| drive::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let (source, real_folder) = (found.real_path(), real(folder));
    let is_right = |path: PathBuf| !path.is_absolute() && real(&folder.join(path)) == source;
    if is_right(path_of(old)) || is_right(path_of(&with_slashes(old))) {
        return Ok(old.to_vec());
    }
    if policy == Textures::Link || source.starts_with(&real_folder) {
        return Ok(bytes_of_path(&relative(source, &real_folder)));
    }
    let bytes = match found.read_image(left) {
        Ok(bytes) => bytes,
        Err(why) => {
            missing.add(old, &why);
            return Ok(old.to_vec());
        }
    };
    // A link is copied under its own name, not the name of its target.
    let name = copy_into(folder, found.name(), &bytes, beside)?;
    Ok(bytes_of_path(Path::new(&name)))
}

/// Writes an image into a folder under its own name, or a numbered name if that is taken; returns the name.
pub(crate) fn copy_into(
    folder: &Path,
    own: &OsStr,
    bytes: &[u8],
    beside: &mut SidecarFiles,
) -> Result<OsString, WriteError> {
    let named = |path: &Path, source: io::Error| WriteError::Io { path: path.to_owned(), source };
    for number in 0.. {
        let name = numbered(own, number);
        let target = folder.join(&name);
        if is_file_of(bytes, &target).map_err(|e| named(&target, e))? {
            return Ok(name);
        }
        if drive::symlink_metadata(&target).is_ok() {
            continue;
        }
        match write_new_file(&target, bytes) {
            Ok(()) => {
                beside.created.push(target);
                return Ok(name);
            }
            // Another process created the file in the meantime.
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {
                if is_file_of(bytes, &target).map_err(|e| named(&target, e))? {
                    return Ok(name);
                }
            }
            Err(e) => return Err(named(&target, e)),
        }
    }
    unreachable!("there is a free number")
}

/// Writes the library beside the OBJ; returns its name.
///
/// An older library written by Lodsmith is replaced; any other file with that name and other content is left
/// alone.
fn write_library(
    text: &[u8],
    target: &Path,
    folder: &Path,
    beside: &mut SidecarFiles,
) -> Result<Vec<u8>, WriteError> {
    const SIGNATURE_LINE: &[u8] = b"# Lodsmith\n";
    let is_gz = target.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let plain = if is_gz { target.with_extension("") } else { target.to_owned() };
    let own = plain.with_extension("mtl");
    let own = own.file_name().unwrap_or(OsStr::new("materials.mtl"));
    let mut whole = if text.starts_with(SIGNATURE_LINE) { Vec::new() } else { SIGNATURE_LINE.to_vec() };
    whole.extend_from_slice(text);
    for number in 0.. {
        let name = numbered(own, number);
        let path = folder.join(&name);
        let named = |source: io::Error| WriteError::Io { path: path.clone(), source };
        if path == target {
            continue;
        }
        let old = match drive::metadata(&path) {
            Ok(about) if !about.is_file() => continue,
            Ok(_) => {
                let mut old = Vec::new();
                let file = File::open(&path).map_err(named)?;
                file.take(whole.len() as u64 + 1).read_to_end(&mut old).map_err(named)?;
                Some(old)
            }
            Err(_) => None,
        };
        match old {
            Some(old) if old == text || old == whole => {}
            Some(old) if !old.starts_with(SIGNATURE_LINE) => continue,
            Some(_) => write_file(&path, false, |out| out.write_all(&whole)).map_err(named)?,
            None => {
                write_file(&path, false, |out| out.write_all(&whole)).map_err(named)?;
                beside.created.push(path.clone());
            }
        }
        return Ok(bytes_of_path(Path::new(&name)));
    }
    unreachable!("there is a free number")
}

/// Inserts a number before the extension, except for number 0.
fn numbered(name: &OsStr, number: u32) -> OsString {
    if number == 0 {
        return name.to_owned();
    }
    let name = Path::new(name);
    let mut new = name.file_stem().unwrap_or_default().to_owned();
    new.push(format!("_{number}"));
    if let Some(ending) = name.extension() {
        new.push(".");
        new.push(ending);
    }
    new
}

/// Returns true if the file has exactly these bytes.
fn is_file_of(bytes: &[u8], target: &Path) -> io::Result<bool> {
    let length = bytes.len() as u64;
    if !drive::metadata(target).is_ok_and(|about| about.is_file() && about.len() == length) {
        return Ok(false);
    }
    let mut there = Vec::new();
    File::open(target)?.take(length + 1).read_to_end(&mut there)?;
    Ok(there == bytes)
}

/// Returns the relative path from a folder to a file, both with links resolved; the absolute path if there is
/// no relative path, as between drives.
fn relative(file: &Path, folder: &Path) -> PathBuf {
    let shared = file.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return file.to_owned();
    }
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    up.chain(file.components().skip(shared)).collect()
}

/// Returns a path with slashes, for use in files.
pub(crate) fn bytes_of_path(path: &Path) -> Vec<u8> {
    let bytes = path.as_os_str().as_encoded_bytes();
    if std::path::MAIN_SEPARATOR == '\\' {
        return bytes.iter().map(|&b| if b == b'\\' { b'/' } else { b }).collect();
    }
    bytes.to_vec()
}

/// Textures that cannot be copied or referred to.
#[derive(Debug, Default)]
struct MissingTextures {
    count: usize,
    warnings: Vec<Warning>,
}

impl MissingTextures {
    fn add(&mut self, path: &[u8], why: &str) {
        self.count += 1;
        // A longer list would not help. Guessed.
        if self.warnings.len() < 16 {
            let text = format!("texture {} {why}: its name is kept", excerpt_of_bytes(path));
            self.warnings.push(Warning::note(text));
        }
    }
    fn warnings(self) -> Vec<Warning> {
        let more = self.count - self.warnings.len();
        let mut warnings = self.warnings;
        if more > 0 {
            warnings.push(Warning::note(format!("{more} more textures cannot be copied or linked")));
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn names_get_numbers_before_their_endings() {
        let name = |name: &str, number| numbered(OsStr::new(name), number).into_string().unwrap();
        assert_eq!(name("a b.png", 0), "a b.png");
        assert_eq!(name("a b.png", 2), "a b_2.png");
        assert_eq!([name("wood", 1), name(".png", 1)], ["wood_1", ".png_1"]);
    }

    #[test]
    fn relative_paths_lead_up_and_down() {
        let way = |file: &str, folder: &str| {
            bytes_of_path(&relative(Path::new(file), Path::new(folder))).escape_ascii().to_string()
        };
        assert_eq!(way("/a/b/c.png", "/a/x/y"), "../../b/c.png");
        assert_eq!(way("/a/b/c.png", "/a"), "b/c.png");
        assert_eq!(way("/c.png", "/"), "c.png");
    }

    #[test]
    fn files_are_the_same_by_content() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let long = vec![7; 100_000];
        fs::write(&path, &long).unwrap();
        assert!(is_file_of(&long, &path).unwrap());
        assert!(!is_file_of(&[&long[1..], &[8]].concat(), &path).unwrap());
        assert!(!is_file_of(&long[1..], &path).unwrap());
        assert!(!is_file_of(&long, &folder.path().join("none")).unwrap());
        assert!(!is_file_of(&[], folder.path()).unwrap());
    }
}
