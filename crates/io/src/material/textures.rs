//! The library and the textures that go along with an OBJ: copied beside it, or linked from there.

use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Component, Path, PathBuf};

use super::library::{Library, Texture, lines_of, path_of, texture_in, with_slashes};
use super::regions::Regions;
use crate::assets::MOST_IMAGE_BYTES;
use crate::error::{Warning, WriteError};
use crate::excerpt::excerpt_of_bytes;
use crate::files::{temporary_in, write_file};

/// What becomes of materials and their textures where these are files of their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Textures {
    /// A library of materials is written beside the output, and textures are copied there.
    #[default]
    Copy,
    /// A library of materials is written beside the output; it leads to the textures where they are.
    Link,
    /// Neither materials nor textures.
    None,
}

/// A library that names so many textures in vain was made to keep the system busy. Guessed.
const MOST_MISSING: usize = 10_000;

/// What was written beside an OBJ.
#[derive(Debug, Default)]
pub(crate) struct Beside {
    /// What the OBJ is to name.
    pub(crate) libraries: Vec<Vec<u8>>,
    pub(crate) warnings: Vec<Warning>,
    created: Vec<PathBuf>,
}

impl Beside {
    /// Takes back what was made, where the OBJ itself came to nothing.
    pub(crate) fn remove(self) {
        for path in self.created {
            // It is in nobody's way if it stays.
            let _ = fs::remove_file(path);
        }
    }
}

/// Writes the libraries as one beside the OBJ at `target`, under its name, and brings the textures along. Images that are
/// no files become some, whatever the policy.
///
/// Every statement is kept as it stands but for the paths of textures. Libraries that were not read keep their names.
///
/// # Errors
/// Where the system cannot write; nothing is left behind then. What is missing is a warning.
pub(crate) fn write_beside(regions: &Regions, target: &Path, policy: Textures) -> Result<Beside, WriteError> {
    let mut beside = Beside::default();
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if policy == Textures::None || !regions.libraries.iter().any(|l| l.text().is_some()) {
        beside.libraries = names_of(regions);
        return Ok(beside);
    }
    // Writing the OBJ says better what is wrong with the place.
    if !folder.is_dir() || fs::metadata(target).is_ok_and(|about| !about.is_file()) {
        return Ok(beside);
    }
    let written = library_text(regions, folder, policy, &mut beside)
        .and_then(|text| put_library(&text, target, folder, &mut beside));
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

/// The libraries by the names that the source has for them; those that are files.
pub(crate) fn names_of(regions: &Regions) -> Vec<Vec<u8>> {
    regions.libraries.iter().filter(|l| !l.is_made()).map(|l| l.name().to_vec()).collect()
}

/// All libraries in one, with paths that are right in `folder`.
fn library_text(
    regions: &Regions,
    folder: &Path,
    policy: Textures,
    beside: &mut Beside,
) -> Result<Vec<u8>, WriteError> {
    let mut missing = Missing::default();
    let mut left = MOST_IMAGE_BYTES;
    let mut text = Vec::new();
    for library in &regions.libraries {
        // A texture is often named by several materials.
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
                paths.insert(old, new);
            }
            text.extend_from_slice(&line[..range.start]);
            text.extend_from_slice(&paths[old]);
            text.extend_from_slice(&line[range.end..]);
        }
    }
    beside.warnings.extend(missing.warnings());
    Ok(text)
}

/// The path that leads from `folder` to what `old` means in a library; the texture is copied there if need be.
fn path_from(
    folder: &Path,
    library: &Library,
    old: &[u8],
    policy: Textures,
    left: &mut u64,
    missing: &mut Missing,
    beside: &mut Beside,
) -> Result<Vec<u8>, WriteError> {
    if missing.count >= MOST_MISSING {
        missing.add(old, "is not looked for");
        return Ok(old.to_vec());
    }
    let found = match library.find_texture(old) {
        Ok(Texture::File(found)) => found,
        Ok(Texture::Inside(image)) => {
            let name = copy_into(folder, OsStr::new(&image.name), &image.bytes, beside)?;
            return Ok(bytes_of(Path::new(&name)));
        }
        Err(why) => {
            missing.add(old, why);
            return Ok(old.to_vec());
        }
    };
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let (source, real_folder) = (found.real(), real(folder));
    let is_right = |path: PathBuf| !path.is_absolute() && real(&folder.join(path)) == source;
    if is_right(path_of(old)) || is_right(path_of(&with_slashes(old))) {
        return Ok(old.to_vec());
    }
    if policy == Textures::Link || source.starts_with(&real_folder) {
        return Ok(bytes_of(&relative(source, &real_folder)));
    }
    let bytes = match found.read_image(left) {
        Ok(bytes) => bytes,
        Err(why) => {
            missing.add(old, &why);
            return Ok(old.to_vec());
        }
    };
    // A link is copied under its own name, not that of the file which it leads to.
    let name = copy_into(folder, found.name(), &bytes, beside)?;
    Ok(bytes_of(Path::new(&name)))
}

/// Writes an image into a folder under its own name, or a numbered one where another file has that; returns the name.
fn copy_into(folder: &Path, own: &OsStr, bytes: &[u8], beside: &mut Beside) -> Result<OsString, WriteError> {
    let named = |path: &Path, source: io::Error| WriteError::Io { path: path.to_owned(), source };
    let mut copy = None;
    for number in 0.. {
        let name = numbered(own, number);
        let target = folder.join(&name);
        if is_file_of(bytes, &target).map_err(|e| named(&target, e))? {
            return Ok(name);
        }
        if fs::symlink_metadata(&target).is_ok() {
            continue;
        }
        let ready = match copy.take() {
            Some(ready) => ready,
            None => {
                let mut new = temporary_in(folder).map_err(|e| named(&target, e))?;
                new.as_file_mut().write_all(bytes).map_err(|e| named(&target, e))?;
                new
            }
        };
        match ready.persist_noclobber(&target) {
            Ok(_) => {
                beside.created.push(target);
                return Ok(name);
            }
            // Somebody was faster.
            Err(e) if e.error.kind() == io::ErrorKind::AlreadyExists => {
                copy = Some(e.file);
                if is_file_of(bytes, &target).map_err(|e| named(&target, e))? {
                    return Ok(name);
                }
            }
            Err(e) => return Err(named(&target, e.error)),
        }
    }
    unreachable!("some number is free")
}

/// Puts the library beside the OBJ; returns its name.
///
/// An older one of ours is replaced; any other file that has the name and says something else is left alone.
fn put_library(
    text: &[u8],
    target: &Path,
    folder: &Path,
    beside: &mut Beside,
) -> Result<Vec<u8>, WriteError> {
    const OURS: &[u8] = b"# Lodsmith\n";
    let is_gz = target.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let plain = if is_gz { target.with_extension("") } else { target.to_owned() };
    let own = plain.with_extension("mtl");
    let own = own.file_name().unwrap_or(OsStr::new("materials.mtl"));
    let mut whole = if text.starts_with(OURS) { Vec::new() } else { OURS.to_vec() };
    whole.extend_from_slice(text);
    for number in 0.. {
        let name = numbered(own, number);
        let path = folder.join(&name);
        let named = |source: io::Error| WriteError::Io { path: path.clone(), source };
        if path == target {
            continue;
        }
        let old = match fs::metadata(&path) {
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
            Some(old) if !old.starts_with(OURS) => continue,
            Some(_) => write_file(&path, false, |out| out.write_all(&whole)).map_err(named)?,
            None => {
                write_file(&path, false, |out| out.write_all(&whole)).map_err(named)?;
                beside.created.push(path.clone());
            }
        }
        return Ok(bytes_of(Path::new(&name)));
    }
    unreachable!("some number is free")
}

/// A name, from the second time on with a number before its ending.
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

/// Whether these are the bytes of a file.
fn is_file_of(bytes: &[u8], target: &Path) -> io::Result<bool> {
    let length = bytes.len() as u64;
    if !fs::metadata(target).is_ok_and(|about| about.is_file() && about.len() == length) {
        return Ok(false);
    }
    let mut there = Vec::new();
    File::open(target)?.take(length + 1).read_to_end(&mut there)?;
    Ok(there == bytes)
}

/// The way from a folder to a file, both without links; the file's own path where there is none, as between drives.
fn relative(file: &Path, folder: &Path) -> PathBuf {
    let shared = file.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return file.to_owned();
    }
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    up.chain(file.components().skip(shared)).collect()
}

/// A path as files name it, with slashes.
fn bytes_of(path: &Path) -> Vec<u8> {
    let bytes = path.as_os_str().as_encoded_bytes();
    if std::path::MAIN_SEPARATOR == '\\' {
        return bytes.iter().map(|&b| if b == b'\\' { b'/' } else { b }).collect();
    }
    bytes.to_vec()
}

/// Textures that cannot be brought along.
#[derive(Debug, Default)]
struct Missing {
    count: usize,
    warnings: Vec<Warning>,
}

impl Missing {
    fn add(&mut self, path: &[u8], why: &str) {
        self.count += 1;
        // More would help nobody. Guessed.
        if self.warnings.len() < 16 {
            let text = format!("texture {} {why}: its name is kept", excerpt_of_bytes(path));
            self.warnings.push(Warning::note(text));
        }
    }
    fn warnings(self) -> Vec<Warning> {
        let more = self.count - self.warnings.len();
        let mut warnings = self.warnings;
        if more > 0 {
            warnings.push(Warning::note(format!("{more} more textures cannot be brought along")));
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_get_numbers_before_their_endings() {
        let name = |name: &str, number| numbered(OsStr::new(name), number).into_string().unwrap();
        assert_eq!(name("a b.png", 0), "a b.png");
        assert_eq!(name("a b.png", 2), "a b_2.png");
        assert_eq!([name("wood", 1), name(".png", 1)], ["wood_1", ".png_1"]);
    }

    #[test]
    fn ways_lead_up_and_down() {
        let way = |file: &str, folder: &str| {
            bytes_of(&relative(Path::new(file), Path::new(folder))).escape_ascii().to_string()
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
