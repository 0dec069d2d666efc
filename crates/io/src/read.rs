//! Reading of meshes and scenes from paths and bytes.

use std::borrow::Cow;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::drive::{self, File};
use crate::error::{ReadError, Warning};
use crate::format::Format;
use crate::gltf::Scene;
use crate::limits::{Limits, out_of_memory};
use crate::lines::utf8_of;
pub use crate::loaded::{Contents, Loaded};
pub use crate::options::{ReadOptions, SharedProgress};

use crate::sizes::Sizes;
use crate::sniff::{self, hint_of, is_binary_stl, looks_like_text, sniff};

/// Reads a file; gzip is decompressed automatically, and the content decides the format.
///
/// The file is read once and held in memory besides the mesh; a large OBJ is streamed. The path may also name
/// a pipe or a device; a folder is refused. If content and extension disagree, the content counts, and there
/// is a warning.
///
/// # Errors
/// [`ReadError::File`] with the path and the reason. A mesh without faces is [`ReadError::NoFaces`].
pub fn read_path(path: &Path, options: &ReadOptions) -> Result<Loaded, ReadError> {
    let read = || {
        let folder = options.folder.clone().or_else(|| Some(folder_of(path)));
        let options = &ReadOptions { folder, ..options.clone() };
        if let Some(loaded) = read_in_pieces(path, options)? {
            return with_hint(loaded, hint_of(path), options);
        }
        let bytes = bytes_of(path, options.limits)?;
        read_hinted(&bytes, hint_of(path), options)
    };
    read().map_err(|e| e.at(path))
}

/// Reads bytes; gzip is decompressed automatically, and the content decides the format.
///
/// # Errors
/// Like [`read_path`], without a path.
pub fn read_bytes(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    check_size("the input", bytes.len() as u64, options.limits)?;
    options.limits.check_memory("reading the input", bytes.len() as u64)?;
    read_hinted(bytes, None, options)
}

/// Reads a file as a whole scene, if its format has scenes ([`Format::is_scene`]); returns `None` for other content, of
/// which only as much is read as needed to detect that.
///
/// Otherwise like [`read_path`], but a scene without faces is not an error.
///
/// # Errors
/// [`ReadError::File`] with the path and the reason.
pub fn read_scene_path(path: &Path, options: &ReadOptions) -> Result<Option<Scene>, ReadError> {
    let read = || {
        // A pipe can be read only once, so its content cannot be examined first; its name has to suffice.
        let is_file = drive::metadata(path).is_ok_and(|about| about.is_file());
        let mut front = Vec::new();
        if is_file {
            File::open(path)?.take(sniff::SNIFFED_BYTES as u64).read_to_end(&mut front)?;
        }
        let is_packed = front.starts_with(&GZIP_MAGIC);
        let guess = if is_file && !is_packed { sniff(&front, hint_of(path)) } else { hint_of(path) };
        if !options.format.or(guess).is_some_and(Format::is_scene) {
            return Ok(None);
        }
        let bytes = bytes_of(path, options.limits)?;
        let folder = options.folder.clone().or_else(|| Some(folder_of(path)));
        scene_hinted(&bytes, hint_of(path), &ReadOptions { folder, ..options.clone() })
    };
    read().map_err(|e: ReadError| e.at(path))
}

/// Returns the sizes of a glTF file; for other files, only the bytes of the file. `None` if the path is not a
/// file, or cannot be read. No geometry is decoded.
pub fn sizes_of_path(path: &Path, options: &ReadOptions) -> Option<Sizes> {
    let about = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?;
    let of_file = Sizes { file_bytes: Some(about.len()), ..Sizes::default() };
    let mut front = Vec::new();
    File::open(path).ok()?.take(sniff::SNIFFED_BYTES as u64).read_to_end(&mut front).ok()?;
    let guess = if front.starts_with(&GZIP_MAGIC) { hint_of(path) } else { sniff(&front, hint_of(path)) };
    if !matches!(options.format.or(guess), Some(Format::Gltf | Format::Glb)) {
        return Some(of_file);
    }
    let bytes = bytes_of(path, options.limits).ok()?;
    let bytes = unpacked(&bytes, options.limits).ok()?;
    let folder = options.folder.clone().or_else(|| Some(folder_of(path)));
    let sizes = crate::gltf::sizes(&bytes, &ReadOptions { folder, ..options.clone() }).ok()?;
    Some(Sizes { file_bytes: of_file.file_bytes, ..sizes })
}

/// Reads bytes as a whole scene, if their format has scenes ([`Format::is_scene`]).
///
/// # Errors
/// Like [`read_scene_path`], without a path.
pub fn read_scene_bytes(bytes: &[u8], options: &ReadOptions) -> Result<Option<Scene>, ReadError> {
    check_size("the input", bytes.len() as u64, options.limits)?;
    options.limits.check_memory("reading the input", bytes.len() as u64)?;
    scene_hinted(bytes, None, options)
}

fn scene_hinted(
    bytes: &[u8],
    hint: Option<Format>,
    options: &ReadOptions,
) -> Result<Option<Scene>, ReadError> {
    let bytes = unpacked(bytes, options.limits)?;
    let text = utf8_of(&bytes);
    let format = options.format.or_else(|| sniff(&bytes, hint)).or_else(|| sniff(&text, hint));
    let Some(format) = format.filter(|f| f.is_scene()) else { return Ok(None) };
    check_parsing(format, &bytes, options.limits)?;
    let mut scene = match format {
        Format::ThreeMf => Scene::of_built(crate::three_mf::scene(&bytes, options)?, bytes.len(), options),
        Format::Dae => Scene::of_built(crate::dae::scene(&bytes, options)?, bytes.len(), options),
        #[cfg(feature = "fbx")]
        Format::Fbx => Scene::of_built(crate::fbx::scene(&bytes, options)?, bytes.len(), options),
        #[cfg(not(feature = "fbx"))]
        Format::Fbx => Err(without_fbx()),
        Format::Gltf => Scene::read(&text, options),
        _ => Scene::read(&bytes, options),
    }?;
    if let Some(warning) = extension_mismatch_warning(scene.format(), hint, options) {
        scene.warn(warning);
    }
    Ok(Some(scene))
}

/// Streams a large OBJ without holding it in memory; returns `None` for all other files, and for invalid
/// ones.
fn read_in_pieces(path: &Path, options: &ReadOptions) -> Result<Option<Loaded>, ReadError> {
    // Guessed: smaller files gain nothing.
    const MIN_STREAMED_BYTES: u64 = 1 << 20;
    let Ok(about) = drive::metadata(path) else { return Ok(None) };
    if !about.is_file() || !(MIN_STREAMED_BYTES..=options.limits.bytes).contains(&about.len()) {
        return Ok(None);
    }
    let mut front = Vec::new();
    File::open(path)?.take(sniff::SNIFFED_BYTES as u64).read_to_end(&mut front)?;
    let is_obj = match options.format {
        Some(format) => format == Format::Obj,
        None => sniff::sniff(&front, hint_of(path)) == Some(Format::Obj),
    };
    // No byte order mark, and no old Macintosh line ends: the text needs no conversion.
    let is_plain = sniff::looks_like_text(&front)
        && front.first().is_some_and(u8::is_ascii)
        && front.contains(&b'\n')
        && !front.starts_with(&GZIP_MAGIC);
    if !is_obj || !is_plain {
        return Ok(None);
    }
    options.limits.check_memory("reading OBJ", text_mesh_bytes(about.len()))?;
    crate::obj::read_file(path, about.len(), options)
}

fn read_hinted(bytes: &[u8], hint: Option<Format>, options: &ReadOptions) -> Result<Loaded, ReadError> {
    let bytes = unpacked(bytes, options.limits)?;
    if bytes.is_empty() {
        return Err(ReadError::Unknown("the file is empty".to_owned()));
    }
    let text = utf8_of(&bytes);
    let format = match options.format {
        Some(format) => format,
        None => sniff(&bytes, hint).or_else(|| sniff(&text, hint)).ok_or_else(|| unknown(&text))?,
    };
    check_parsing(format, &bytes, options.limits)?;
    let loaded = match format {
        Format::Obj => crate::obj::read(&text, options),
        Format::Off => crate::off::read(&text, options),
        Format::Ply => crate::ply::read(&bytes, options),
        Format::Stl => crate::stl::read(if is_binary_stl(&bytes) { &bytes } else { &text }, options),
        Format::Gltf => crate::gltf::read(&text, options),
        Format::Glb => crate::gltf::read(&bytes, options),
        Format::Lpm => crate::lpm::read_mesh(&bytes, options),
        Format::ThreeMf => crate::three_mf::read(&bytes, options),
        Format::Dae => crate::dae::read(&bytes, options),
        #[cfg(feature = "fbx")]
        Format::Fbx => crate::fbx::read(&bytes, options),
        #[cfg(not(feature = "fbx"))]
        Format::Fbx => Err(without_fbx()),
    }?;
    with_hint(loaded, hint, options)
}

/// Returns the bytes that the mesh takes during construction from this many bytes of text; a face of 8 bytes
/// would be the worst case. (Measured: 0.9 for OBJ without attributes, 0.45 with them.)
fn text_mesh_bytes(bytes: u64) -> u64 {
    bytes
}

/// Returns an error if the mesh of these unpacked bytes would not fit in memory besides them. The other
/// formats check that themselves, by their counts.
fn check_parsing(format: Format, bytes: &[u8], limits: Limits) -> Result<(), ReadError> {
    let size = bytes.len() as u64;
    let mesh = match format {
        // Triangles, and a table of positions with capacity for half as many. (Measured: 23 bytes per facet.)
        Format::Stl if is_binary_stl(bytes) => size / 50 * 26,
        Format::Obj | Format::Off | Format::Stl => text_mesh_bytes(size),
        _ => 0,
    };
    limits.check_memory(format!("reading {}", format.title()), size + mesh)
}

#[cfg(not(feature = "fbx"))]
fn without_fbx() -> ReadError {
    let text = "it is FBX, which this build does not support: use the packaged program, or build with `--features fbx`";
    ReadError::Unsupported(text.to_owned())
}

/// Refuses a mesh without faces, and adds a warning if the extension of the path belongs to another format.
fn with_hint(mut loaded: Loaded, hint: Option<Format>, options: &ReadOptions) -> Result<Loaded, ReadError> {
    loaded.limits = options.limits;
    if loaded.mesh.face_count() == 0 {
        return Err(ReadError::NoFaces { vertices: loaded.mesh.vertex_count() });
    }
    if let Some(warning) = extension_mismatch_warning(loaded.format, hint, options) {
        loaded.warnings.insert(0, warning);
    }
    Ok(loaded)
}

/// Returns the warning that the extension of the path belongs to another format.
fn extension_mismatch_warning(
    format: Format,
    hint: Option<Format>,
    options: &ReadOptions,
) -> Option<Warning> {
    let hint = hint.filter(|&hint| options.format.is_none() && hint != format)?;
    let [hint, format] = [hint, format].map(Format::title);
    Some(Warning::note(format!("the extension says {hint}, but the content is {format}: read as {format}")))
}

/// Returns the bytes, decompressed if they are gzip.
pub(crate) fn unpacked(bytes: &[u8], limits: Limits) -> Result<Cow<'_, [u8]>, ReadError> {
    if bytes.starts_with(&GZIP_MAGIC) {
        gunzip(bytes, limits).map(Cow::Owned)
    } else {
        Ok(Cow::Borrowed(bytes))
    }
}

/// First bytes of a gzip file: its signature, and the only compression method.
const GZIP_MAGIC: [u8; 3] = [0x1f, 0x8b, 8];

pub(crate) fn bytes_of(path: &Path, limits: Limits) -> Result<Vec<u8>, ReadError> {
    let mut file = File::open(path).map_err(|e| match e.kind() {
        io::ErrorKind::NotFound => io::Error::new(e.kind(), "there is no such file"),
        _ => e,
    })?;
    let about = file.metadata()?;
    if about.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder, not a file").into());
    }
    check_size("the file", about.len(), limits)?;
    limits.check_memory("reading the file", about.len())?;
    let mut bytes = Vec::new();
    // The size comes from the system and is real; still, a sparse file may be larger than the memory.
    let no_memory = |_| io::Error::new(io::ErrorKind::OutOfMemory, "the file is larger than the free memory");
    bytes.try_reserve_exact(usize::try_from(about.len()).unwrap_or(usize::MAX)).map_err(no_memory)?;
    read_stream(&mut file, bytes, limits)
}

/// Appends all of a stream, whose size cannot be checked before, to the bytes.
///
/// # Errors
/// [`ReadError::Limit`] and [`ReadError::Memory`] beyond the limits, [`ReadError::Io`].
pub fn read_stream(from: &mut dyn Read, mut bytes: Vec<u8>, limits: Limits) -> Result<Vec<u8>, ReadError> {
    from.take(limits.max_bytes().saturating_add(1)).read_to_end(&mut bytes)?;
    check_size("the file", bytes.len() as u64, limits)?;
    limits.check_memory("reading the file", bytes.len() as u64)?;
    Ok(bytes)
}

fn check_size(what: &'static str, size: u64, limits: Limits) -> Result<(), ReadError> {
    if size > limits.bytes { Err(ReadError::Limit { what, size, limit: limits.bytes }) } else { Ok(()) }
}

fn gunzip(bytes: &[u8], limits: Limits) -> Result<Vec<u8>, ReadError> {
    let mut unpacked = Vec::new();
    let most = limits.max_unpacked_bytes(bytes.len());
    let result =
        flate2::read::MultiGzDecoder::new(bytes).take(most.saturating_add(1)).read_to_end(&mut unpacked);
    let size = unpacked.len() as u64;
    check_size("the unpacked file", size, limits)?;
    limits.check_memory("unpacking the file", size + bytes.len() as u64)?;
    if size > most {
        return Err(ReadError::Ratio { what: "the file", limit: most, times: most / bytes.len() as u64 });
    }
    match result {
        Ok(_) => Ok(unpacked),
        Err(e) if e.kind() == io::ErrorKind::OutOfMemory => Err(out_of_memory()),
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Err(ReadError::file(format!(
            "the gzip data end too early, after {} unpacked bytes",
            unpacked.len()
        ))),
        Err(e) => Err(ReadError::file(format!(
            "the gzip data are damaged after {} unpacked bytes: {e}",
            unpacked.len()
        ))),
    }
}

fn unknown(text: &[u8]) -> ReadError {
    if let Some((name, advice)) = sniff::unsupported_format(text) {
        return ReadError::Unknown(format!("it is {name}, which is not supported; {advice}"));
    }
    let what = if text.iter().all(u8::is_ascii_whitespace) {
        "it contains only white space"
    } else if looks_like_text(text) {
        "it is text, but no line looks like a mesh format"
    } else {
        "its first bytes match none of them"
    };
    ReadError::Unknown(what.to_owned())
}

/// Returns the folder of a file; `.` for a bare name.
fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bare_name_lies_in_this_folder() {
        assert_eq!(folder_of(Path::new("a.gltf")), Path::new("."));
        assert_eq!(folder_of(Path::new("x/a.gltf")), Path::new("x"));
    }
}
