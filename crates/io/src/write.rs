//! From a mesh to a path or a stream.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use flate2::Compression;
use flate2::write::GzEncoder;
use lodsmith_core::TriMesh;
use tempfile::NamedTempFile;

use crate::error::{Warning, WriteError};
use crate::format::Format;
use crate::gltf::{Scene, SceneLevels};
use crate::obj::{Regions, Textures};
use crate::sniff::hint_of;

/// How to write.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// The format, where the ending of the path should not decide.
    pub format: Option<Format>,
    /// Text instead of binary, for the formats that have both (PLY, STL).
    pub ascii: bool,
    /// What the regions of the mesh stand for, as its reader had it.
    pub regions: Option<Arc<Regions>>,
    /// What becomes of materials and textures, for the formats that have them in files of their own.
    pub textures: Textures,
    /// The path that such files are named after and lie beside, where it is not that of the mesh itself. A stream with
    /// one stands for a file there.
    pub beside: Option<PathBuf>,
    /// Whether a write-protected file is replaced too.
    pub force: bool,
}

/// Writes a mesh to a file: to a temporary one beside it, which is then renamed. An existing file survives a failure.
///
/// A path that ends in `.gz` is compressed. A link is followed, also to a file that is not there yet; a device or a pipe is written to as it is. A new file
/// has the permissions of any new file, an overwritten one keeps its own. Data are handed to the system, which may put
/// them on the disk later. Returns what the format could not carry.
///
/// Beside an OBJ whose table of regions has materials, a library `NAME.mtl` is written, and textures are copied, as the
/// options say; images that lay inside another file are written there in any case. A file that is there already and says something else is left alone, and the new one gets a number; only
/// a library of ours is replaced.
///
/// # Errors
/// [`WriteError`], which names the path; nothing is left behind.
pub fn write_path(mesh: &TriMesh, path: &Path, options: &WriteOptions) -> Result<Vec<Warning>, WriteError> {
    let format = format_of(path, options)?;
    let mut beside = None;
    if let (Format::Obj, Some(regions)) = (format, &options.regions)
        && !crate::obj::drops_materials(mesh, regions)
    {
        let target = options.beside.as_deref().unwrap_or(path);
        beside = Some(crate::obj::write_beside(regions, target, options.textures)?);
    }
    let libraries = beside.as_ref().map(|beside| &*beside.libraries);
    let written =
        write_path_with(path, options.force, |out| write_format(mesh, format, options, libraries, out));
    match (written, beside) {
        (written, None) => written,
        (Ok(warnings), Some(mut beside)) => {
            beside.warnings.extend(warnings);
            Ok(beside.warnings)
        }
        (Err(error), Some(beside)) => {
            beside.remove();
            Err(error)
        }
    }
}

fn format_of(path: &Path, options: &WriteOptions) -> Result<Format, WriteError> {
    let format = options.format.or_else(|| hint_of(path));
    format.ok_or_else(|| WriteError::UnknownFormat { path: path.to_owned() })
}

/// Writes a whole scene to a file, with some meshes replaced; see [`Scene::write`]. In all else as [`write_path`].
///
/// # Errors
/// [`WriteError`], which names the path; nothing is left behind.
pub fn write_scene_path(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    path: &Path,
    options: &WriteOptions,
    relink: &dyn Fn(&str) -> Option<String>,
) -> Result<Vec<Warning>, WriteError> {
    let format = format_of(path, options)?;
    write_path_with(path, options.force, |out| {
        let warnings = scene.write(replaced, format, relink, out)?;
        out.flush()?;
        Ok(warnings)
    })
}

/// Writes a whole scene with levels of detail to a file; see [`Scene::write_levels`]. In all else as [`write_path`].
///
/// # Errors
/// [`WriteError`], which names the path; nothing is left behind.
pub fn write_levels_path(
    scene: &Scene,
    levels: &SceneLevels,
    path: &Path,
    options: &WriteOptions,
    relink: &dyn Fn(&str) -> Option<String>,
) -> Result<Vec<Warning>, WriteError> {
    let format = format_of(path, options)?;
    write_path_with(path, options.force, |out| {
        let warnings = scene.write_levels(levels, format, relink, out)?;
        out.flush()?;
        Ok(warnings)
    })
}

fn write_path_with(
    path: &Path,
    force: bool,
    write: impl FnOnce(&mut dyn Write) -> io::Result<Vec<Warning>>,
) -> Result<Vec<Warning>, WriteError> {
    write_file(path, force, |out| {
        if !is_gz(path) {
            return write(out);
        }
        // The header holds no time, so that the same mesh gives the same bytes.
        let mut gz = GzEncoder::new(out, COMPRESSION);
        let warnings = write(&mut BufWriter::with_capacity(BUFFER, &mut gz))?;
        gz.finish()?;
        Ok(warnings)
    })
    .map_err(|e| named(e, path))
}

/// Writes a mesh to a stream in a format. Returns what the format could not carry.
///
/// The stream gets large pieces and is flushed at the end.
///
/// # Errors
/// [`WriteError`].
pub fn write_to(
    mesh: &TriMesh,
    format: Format,
    options: &WriteOptions,
    out: &mut dyn Write,
) -> Result<Vec<Warning>, WriteError> {
    write_stream(out, |out| write_format(mesh, format, options, None, out))
}

/// Writes a whole scene to a stream, with some meshes replaced; see [`Scene::write`].
///
/// The stream gets large pieces and is flushed at the end.
///
/// # Errors
/// [`WriteError`].
pub fn write_scene_to(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    format: Format,
    relink: &dyn Fn(&str) -> Option<String>,
    out: &mut dyn Write,
) -> Result<Vec<Warning>, WriteError> {
    write_stream(out, |out| {
        let warnings = scene.write(replaced, format, relink, out)?;
        out.flush()?;
        Ok(warnings)
    })
}

/// Writes a whole scene with levels of detail to a stream; see [`Scene::write_levels`].
///
/// The stream gets large pieces and is flushed at the end.
///
/// # Errors
/// [`WriteError`].
pub fn write_levels_to(
    scene: &Scene,
    levels: &SceneLevels,
    format: Format,
    relink: &dyn Fn(&str) -> Option<String>,
    out: &mut dyn Write,
) -> Result<Vec<Warning>, WriteError> {
    write_stream(out, |out| {
        let warnings = scene.write_levels(levels, format, relink, out)?;
        out.flush()?;
        Ok(warnings)
    })
}

fn write_stream(
    out: &mut dyn Write,
    write: impl FnOnce(&mut dyn Write) -> io::Result<Vec<Warning>>,
) -> Result<Vec<Warning>, WriteError> {
    let mut out = BufWriter::with_capacity(BUFFER, out);
    let result = write(&mut out);
    if result.is_err() {
        // What is still held back belongs to a file that failed.
        let _ = out.into_parts();
    }
    result.map_err(|e| named(e, Path::new("output stream")))
}

/// Bytes that go to the system at once. Guessed.
const BUFFER: usize = 1 << 17;

/// How hard to compress. Measured on an OBJ of 2 million triangles (73 MB): 0.8 s to 16 MB; the usual 6 takes 6.2 s to
/// get to 15 MB.
const COMPRESSION: Compression = Compression::new(3);

fn write_format(
    mesh: &TriMesh,
    format: Format,
    options: &WriteOptions,
    libraries: Option<&[Vec<u8>]>,
    out: &mut dyn Write,
) -> io::Result<Vec<Warning>> {
    let mut warnings = match format {
        Format::Obj => crate::obj::write_naming(mesh, options, libraries, out),
        Format::Off => crate::off::write(mesh, options, out),
        Format::Ply => crate::ply::write(mesh, options, out),
        Format::Stl => crate::stl::write(mesh, options, out),
        Format::Gltf | Format::Glb => {
            // The module tells the two apart by this.
            crate::gltf::write(mesh, &WriteOptions { format: Some(format), ..options.clone() }, out)
        }
        Format::Lpm => Err(io::Error::other(WriteError::NeedsSplits)),
    }?;
    out.flush()?;
    let regions = options.regions.as_deref();
    let with_materials = options.textures != Textures::None;
    if format != Format::Obj
        && let Some(lost) = regions.and_then(|regions| {
            let is_carried =
                matches!(format, Format::Gltf | Format::Glb) && !crate::obj::drops_materials(mesh, regions);
            regions.what_is_lost(with_materials && !is_carried)
        })
    {
        warnings.push(Warning::lost(format!("{} cannot carry {lost}: dropped", format.title())));
    }
    warnings.extend(lost_integers(mesh, format));
    if !with_materials && regions.is_some_and(Regions::has_materials) {
        warnings.push(Warning::note("materials dropped: --textures none"));
    }
    Ok(warnings)
}

/// What to say of integers of a name that a format has no place for.
fn lost_integers(mesh: &TriMesh, format: Format) -> Option<Warning> {
    let further = mesh.further_attributes().iter().filter(|a| a.semantic.is_discrete());
    let names: Vec<&str> = further.filter_map(|a| a.semantic.name()).collect();
    let is_lost = format != Format::Ply && !names.is_empty();
    is_lost.then(|| {
        Warning::lost(format!("{} cannot carry {} of vertices: dropped", format.title(), names.join(", ")))
    })
}

/// Makes the file at `path` hold what `write` writes, or leaves things as they were.
///
/// What is written goes to a temporary file beside it, which takes its name when it is whole. A link stays a link: the
/// file that it leads to is replaced, or made. A write-protected file is replaced with `force` only.
///
/// # Errors
/// What the system or `write` answers.
pub fn write_file<T>(
    path: &Path,
    force: bool,
    write: impl FnOnce(&mut dyn Write) -> io::Result<T>,
) -> io::Result<T> {
    let target = target_of(path)?;
    let existing = match fs::metadata(&target) {
        Ok(about) => Some(about),
        Err(e) if e.kind() == io::ErrorKind::NotFound => None,
        Err(e) => return Err(e),
    };
    if let Some(about) = &existing {
        if about.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
        }
        if about.permissions().readonly() && !force {
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file is read-only"));
        }
        if !about.is_file() {
            let mut out = BufWriter::with_capacity(BUFFER, File::options().write(true).open(&target)?);
            let value = write(&mut out)?;
            out.flush()?;
            return Ok(value);
        }
    }
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    if !folder.is_dir() {
        let text = format!("there is no folder {}", folder.display());
        return Err(io::Error::new(io::ErrorKind::NotFound, text));
    }
    let temporary = temporary_in(&folder)?;
    let mut out = BufWriter::with_capacity(BUFFER, temporary.as_file());
    let value = write(&mut out)?;
    out.flush()?;
    drop(out);
    if let Some(about) = existing {
        temporary.as_file().set_permissions(about.permissions())?;
    }
    temporary.persist(&target).map_err(|e| e.error)?;
    Ok(value)
}

/// The file that is meant by a path, behind all links; it need not be there.
fn target_of(path: &Path) -> io::Result<PathBuf> {
    if let Ok(real) = fs::canonicalize(path) {
        return Ok(real);
    }
    // As many as Linux follows.
    const MOST_LINKS: usize = 40;
    let mut target = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Ok(next) = fs::read_link(&target) else { return Ok(target) };
        target = target.parent().unwrap_or(Path::new("")).join(next);
    }
    Err(io::Error::other("it is a link that leads through too many others"))
}

const PART_PREFIX: &str = ".lodsmith-";
const PART_SUFFIX: &str = ".part";

/// A file that goes away unless it gets a name. Those that processes left behind which were killed go away too.
pub(crate) fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    remove_stale_parts(folder);
    let mut builder = tempfile::Builder::new();
    builder.prefix(PART_PREFIX).suffix(PART_SUFFIX);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What a new file has before the user's mask is taken off.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    loop {
        let temporary = builder.tempfile_in(folder)?;
        // The lock says that this process is alive, and ends with it. Where the system has none, nothing is swept either.
        let is_locked = temporary.as_file().lock().is_ok();
        // Before it was locked, another process may have taken it for one that was left behind.
        if !is_locked || temporary.path().exists() {
            return Ok(temporary);
        }
    }
}

/// Removes temporary files that no living process holds: once for each folder and process, since a folder may be long.
fn remove_stale_parts(folder: &Path) {
    static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let real = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    if !SWEPT.lock().unwrap_or_else(PoisonError::into_inner).insert(real) {
        return;
    }
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.as_encoded_bytes();
        let is_part = name.starts_with(PART_PREFIX.as_bytes()) && name.ends_with(PART_SUFFIX.as_bytes());
        if !is_part || !entry.file_type().is_ok_and(|kind| kind.is_file()) {
            continue;
        }
        let path = entry.path();
        // (Opened for writing, since some systems lock no other files.)
        if File::options().write(true).open(&path).is_ok_and(|file| file.try_lock().is_ok()) {
            // It is in nobody's way if it stays.
            let _ = fs::remove_file(path);
        }
    }
}

fn is_gz(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"))
}

/// A format that cannot hold the mesh says so with a [`WriteError`] inside the error of the stream.
fn named(error: io::Error, path: &Path) -> WriteError {
    error.downcast::<WriteError>().unwrap_or_else(|source| WriteError::Io { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_that_nobody_holds_is_removed_and_a_held_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let [left, held, other] =
            [".lodsmith-a.part", ".lodsmith-b.part", "a.part"].map(|n| folder.path().join(n));
        for path in [&left, &held, &other] {
            fs::write(path, "half").unwrap();
        }
        let holder = File::open(&held).unwrap();
        holder.lock().unwrap();
        let out = folder.path().join("out");
        write_file(&out, false, |out| out.write_all(b"whole")).unwrap();
        assert!(!left.exists() && held.exists() && other.exists());
        assert_eq!(fs::read(&out).unwrap(), b"whole");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_file_that_is_not_there_stays_a_link() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("far")).unwrap();
        symlink("far/b", path("a")).unwrap();
        symlink("a", path("first")).unwrap();
        write_file(&path("first"), false, |out| out.write_all(b"1")).unwrap();
        assert_eq!(fs::read(path("far/b")).unwrap(), b"1");
        assert!(["a", "first"].iter().all(|name| path(name).is_symlink()));
        symlink("none/c", path("lost")).unwrap();
        assert!(
            write_file(&path("lost"), false, |_| Ok(()))
                .unwrap_err()
                .to_string()
                .contains("there is no folder")
        );
        symlink("round", path("round")).unwrap();
        assert!(write_file(&path("round"), false, |_| Ok(())).is_err());
        assert!(path("lost").is_symlink() && path("round").is_symlink());
    }
}
