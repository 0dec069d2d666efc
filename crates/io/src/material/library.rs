//! Material libraries of an OBJ (MTL): finding and reading them, and locating the textures that they refer
//! to.
//!
//! Nothing else in a library is parsed; writers copy every other byte. For a format with its own materials a
//! library is generated from them, with its images in memory ([`Library::generated`]).

use std::borrow::Cow;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use crate::assets::{Asset, Assets, Refusal};
use crate::error::Warning;
use crate::excerpt::excerpt_of_bytes;
use crate::limits::Limits;
use crate::lines::utf8_of;

/// Maximum total bytes of the libraries of one file. Guessed: some hundred thousand materials.
const MAX_LIBRARY_BYTES: u64 = 64 << 20;

/// A library of materials that an OBJ names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Library {
    name: Arc<[u8]>,
    text: Option<Arc<[u8]>>,
    /// The folders searched for its textures: its own, then the folder of the OBJ.
    assets: Assets,
    /// The data of a library that is not a file.
    generated: Option<Arc<GeneratedLibrary>>,
}

/// The data of a library that was generated from another format.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct GeneratedLibrary {
    /// Images in memory that it names; sorted by name once the library has them.
    pub(crate) images: Vec<Image>,
    /// Features that it cannot represent, as text for users.
    pub(crate) unsupported: Vec<String>,
    /// Images that could not be carried over, and why.
    pub(crate) missing: Vec<String>,
    /// True if colours also apply where there is an image.
    pub(crate) tints_images: bool,
}

/// An image in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Image {
    /// The name by which the library refers to it.
    pub(crate) name: String,
    /// Its media type.
    pub(crate) kind: &'static str,
    pub(crate) bytes: Vec<u8>,
}

/// The location of a texture of a library.
pub(crate) enum Texture<'l> {
    File(Asset),
    Embedded(&'l Image),
}

impl Library {
    pub(crate) fn named(name: Arc<[u8]>) -> Self {
        Self { name, text: None, assets: Assets::default(), generated: None }
    }
    /// Creates a library that is not a file; textures not among its images are searched for in the files of
    /// the model.
    pub(crate) fn generated(text: String, assets: Assets, made: GeneratedLibrary) -> Self {
        Self { assets, ..Self::packed(text.as_bytes(), made) }
    }
    /// Creates a library that is not a file and has all its textures in memory.
    pub(crate) fn packed(text: &[u8], mut made: GeneratedLibrary) -> Self {
        made.images.sort_by(|a, b| a.name.cmp(&b.name));
        Self {
            name: Arc::default(),
            text: Some(text.into()),
            assets: Assets::default(),
            generated: Some(Arc::new(made)),
        }
    }
    /// Its name, as in the OBJ; empty if it is not a file.
    pub fn name(&self) -> &[u8] {
        &self.name
    }
    /// Its text; `None` if it was not found or not searched for.
    pub fn text(&self) -> Option<&[u8]> {
        self.text.as_deref()
    }

    /// Returns true if it is not a file.
    pub(crate) fn is_generated(&self) -> bool {
        self.generated.is_some()
    }

    /// Returns true if its colours also apply where there is an image; in files of many programs they do not.
    pub(crate) fn is_tinted(&self) -> bool {
        self.generated.as_ref().is_some_and(|made| made.tints_images)
    }

    /// Returns the losses of its conversion from another format.
    pub(crate) fn losses(&self) -> Vec<Warning> {
        let Some(made) = &self.generated else { return Vec::new() };
        let mut warnings = left_out_warnings(&made.missing);
        if !made.unsupported.is_empty() {
            let text = format!("dropped from the materials: {}", made.unsupported.join(", "));
            warnings.push(Warning::lost(text));
        }
        warnings
    }

    /// Finds a texture that it names.
    ///
    /// # Errors
    /// The reason why it was not found: the end of a sentence for users.
    pub(crate) fn find_texture(&self, path: &[u8]) -> Result<Texture<'_>, &'static str> {
        if let Some(made) = &self.generated
            && let Ok(at) = made.images.binary_search_by(|image| image.name.as_bytes().cmp(path))
        {
            return Ok(Texture::Embedded(&made.images[at]));
        }
        find(&self.assets, path).map(Texture::File).map_err(Refusal::reason)
    }
}

/// Reads the libraries that an OBJ names, if they exist; returns warnings about the others.
pub(crate) fn read_libraries(libraries: &mut [Library], assets: &Assets, limits: Limits) -> Vec<Warning> {
    if !assets.has_folder() {
        return Vec::new();
    }
    let mut left = limits.max_bytes().min(MAX_LIBRARY_BYTES);
    let mut read = |library: &mut Library| {
        let why = read_library(library, assets, &mut left).err()?;
        let name = excerpt_of_bytes(&library.name);
        Some(Warning::note(format!("material library {name} {why}: its materials are unknown")))
    };
    libraries.iter_mut().filter_map(&mut read).collect()
}

fn read_library(library: &mut Library, assets: &Assets, left: &mut u64) -> Result<(), String> {
    let file = find(assets, &library.name).map_err(Refusal::reason)?;
    let bytes = file.read(*left)?;
    *left -= bytes.len() as u64;
    let text = utf8_of(&bytes);
    // A model could name any text file of the folder, and the library written with an output copies every
    // line of it.
    if !lines_of(&text).any(|line| material_in(line).is_some()) {
        return Err("has no line that begins with newmtl, so it is not a material library".to_owned());
    }
    library.text = Some(text.into());
    library.assets = assets.searched_from(file.folder());
    Ok(())
}

/// Returns warnings about textures that are left out; each text is a path and a reason.
pub(crate) fn left_out_warnings(textures: &[String]) -> Vec<Warning> {
    // A longer list would not help. Guessed.
    const MAX_WARNINGS: usize = 16;
    let shown = textures.iter().take(MAX_WARNINGS);
    let mut warnings: Vec<_> = shown.map(|text| Warning::lost(format!("texture {text}: left out"))).collect();
    let more = textures.len().saturating_sub(MAX_WARNINGS);
    if more > 0 {
        warnings.push(Warning::lost(format!("{more} more textures are left out")));
    }
    warnings
}

/// Returns the lines with their line ends.
pub(crate) fn lines_of(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split_inclusive(|&b| b == b'\n')
}

/// Returns the material that begins in this line.
pub(crate) fn material_in(line: &[u8]) -> Option<&[u8]> {
    let (word, rest) = next_word(line)?;
    line[word].eq_ignore_ascii_case(b"newmtl").then(|| line[rest..].trim_ascii())
}

/// Options that may come before the path of a texture: the name, and the maximum number of arguments. Options
/// with several arguments take only numbers.
const OPTIONS: [(&[u8], usize); 14] = [
    (b"-blendu", 1),
    (b"-blendv", 1),
    (b"-bm", 1),
    (b"-boost", 1),
    (b"-cc", 1),
    (b"-clamp", 1),
    (b"-colorspace", 1),
    (b"-imfchan", 1),
    (b"-mm", 2),
    (b"-o", 3),
    (b"-s", 3),
    (b"-t", 3),
    (b"-texres", 1),
    (b"-type", 1),
];

/// Returns the range of a texture path in a line, without surrounding blanks and quotation marks.
pub(crate) fn texture_in(line: &[u8]) -> Option<Range<usize>> {
    let (word, mut at) = next_word(line)?;
    let keyword = line[word].to_ascii_lowercase();
    let is_texture = (keyword.starts_with(b"map_") && keyword != b"map_aat")
        || [&b"bump"[..], b"disp", b"decal", b"refl", b"norm"].contains(&&*keyword);
    if !is_texture {
        return None;
    }
    while let Some((word, after)) = next_word(&line[at..]) {
        let name = &line[at + word.start..at + word.end];
        let Some((_, most)) = OPTIONS.iter().find(|(option, _)| name.eq_ignore_ascii_case(option)) else {
            break;
        };
        at += after;
        for _ in 0..*most {
            let Some((word, after)) = next_word(&line[at..]) else { break };
            if *most > 1 && !is_number(&line[at + word.start..at + word.end]) {
                break;
            }
            at += after;
        }
    }
    let rest = &line[at..];
    let begin = at + (rest.len() - rest.trim_ascii_start().len());
    let path = unquoted(rest.trim_ascii());
    if path.is_empty() {
        return None;
    }
    let begin = begin + usize::from(line[begin] == b'"' && path.len() < rest.trim_ascii().len());
    Some(begin..begin + path.len())
}

pub(crate) fn is_number(word: &[u8]) -> bool {
    std::str::from_utf8(word).is_ok_and(|word| word.parse::<f64>().is_ok())
}

/// Returns the range of the next word, and its end.
pub(crate) fn next_word(text: &[u8]) -> Option<(Range<usize>, usize)> {
    let begin = text.iter().position(|b| !b.is_ascii_whitespace())?;
    let length = text[begin..].iter().position(u8::is_ascii_whitespace).unwrap_or(text.len() - begin);
    Some((begin..begin + length, begin + length))
}

/// Replaces the backslashes of Windows paths by slashes, which work everywhere.
pub(crate) fn with_slashes(path: &[u8]) -> Cow<'_, [u8]> {
    if !path.contains(&b'\\') {
        return Cow::Borrowed(path);
    }
    path.iter().map(|&b| if b == b'\\' { b'/' } else { b }).collect()
}

/// Returns the file that a path in a library refers to.
///
/// Tries the path unchanged, then with slashes for backslashes and without a trailing comment, and finally
/// the bare file name: the folders of a path from another machine do not exist here, but the file is often
/// beside the model.
fn find(assets: &Assets, path: &[u8]) -> Result<Asset, Refusal> {
    let slashed = with_slashes(path);
    let before_comment = |path: &[u8]| {
        let end = path.windows(2).position(|w| w[0].is_ascii_whitespace() && w[1] == b'#');
        end.map_or(path.len(), |end| path[..end].trim_ascii_end().len())
    };
    let plain = &slashed[..before_comment(&slashed)];
    let bare = plain.rsplit(|&b| b == b'/').next().unwrap_or_default();
    let mut refusal = Refusal::Absent;
    for candidate in [path, &slashed, plain, bare].into_iter().filter(|c| !c.is_empty()) {
        match assets.find(&path_of(candidate)) {
            Ok(file) => return Ok(file),
            Err(other) => refusal = refusal.max(other),
        }
    }
    Err(refusal)
}

/// Returns the path that bytes of a file encode: the same bytes if the system allows any, else UTF-8.
pub(crate) fn path_of(bytes: &[u8]) -> PathBuf {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        std::ffi::OsStr::from_bytes(bytes).into()
    }
    #[cfg(not(unix))]
    {
        String::from_utf8_lossy(bytes).into_owned().into()
    }
}

/// Removes the quotation marks that some programs put round a name.
pub(crate) fn unquoted(name: &[u8]) -> &[u8] {
    match name {
        [b'"', inner @ .., b'"'] => inner,
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(line: &str) -> Option<&str> {
        texture_in(line.as_bytes()).map(|path| &line[path])
    }

    #[test]
    fn paths_of_textures_are_found_behind_options() {
        for (line, wanted) in [
            ("map_Kd a.png\n", "a.png"),
            ("  MAP_KD\t-s 1 1 1 -o 0.5 my wood.png \r\n", "my wood.png"),
            ("map_Bump -bm 0.5 .\\tex\\b.jpg", ".\\tex\\b.jpg"),
            ("bump -clamp on -imfchan r \"two words.png\"\n", "two words.png"),
            ("norm -mm 0 1 -s 2 2 3.png", "3.png"),
            ("map_Ks -type sphere C:\\tex\\a.png", "C:\\tex\\a.png"),
            ("disp -unknown.png", "-unknown.png"),
            ("map_Pr ../r.png # rough", "../r.png # rough"),
        ] {
            assert_eq!(texture(line), Some(wanted), "{line}");
        }
    }

    #[test]
    fn other_lines_and_broken_ones_name_no_texture() {
        for line in [
            "",
            "\n",
            "newmtl map_Kd",
            "Kd 1 1 1",
            "# map_Kd a.png",
            "map_aat on",
            "map_Kd",
            "map_Kd -s",
            "map_Kd -s 1 ",
            "map_Kd -bm 0.5\n",
            "map_Kd \"\"",
            "\u{1}",
            "bumpy a.png",
            "-s 1 1 1 a.png",
        ] {
            assert_eq!(texture(line), None, "{line}");
        }
        assert_eq!(texture("map_Kd \""), Some("\""));
        assert_eq!(material_in(b" newmtl  a b \r\n"), Some(&b"a b"[..]));
    }

    #[test]
    fn files_are_found_in_many_spellings() {
        let folder = tempfile::tempdir().unwrap();
        let assets = Assets::new(folder.path(), &crate::assets::AssetScope::Folder);
        std::fs::create_dir(folder.path().join("tex")).unwrap();
        for name in ["a b.png", "tex/c.png"] {
            std::fs::write(folder.path().join(name), name).unwrap();
        }
        let name = |path: &str| {
            let found = find(&assets, path.as_bytes())?;
            let below = found.real_path().strip_prefix(folder.path().canonicalize().unwrap()).unwrap();
            Ok(below.to_string_lossy().replace('\\', "/"))
        };
        assert_eq!(name("a b.png"), Ok("a b.png".to_owned()));
        assert_eq!(name("tex\\c.png"), Ok("tex/c.png".to_owned()));
        assert_eq!(name("D:\\old\\a b.png # mine"), Ok("a b.png".to_owned()));
        assert_eq!(name("../nowhere/a b.png"), Ok("a b.png".to_owned()));
        assert_eq!(name("../nowhere/none.png"), Err(Refusal::Outside));
        assert_eq!(name("none.png"), Err(Refusal::Absent));
        assert_eq!(name("tex"), Err(Refusal::NotAFile));
        assert_eq!(name("a\0b"), Err(Refusal::Absent));
    }
}
