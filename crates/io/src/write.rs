//! From a mesh to a path or a stream.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;
use lodsmith_core::TriMesh;

use crate::error::{Warning, WriteError};
use crate::format::Format;
use crate::gltf::Scene;
use crate::sniff::hint_of;

/// How to write.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// The format, where the ending of the path should not decide.
    pub format: Option<Format>,
    /// Text instead of binary, for the formats that have both (PLY, STL).
    pub ascii: bool,
}

/// Writes a mesh to a file: to a temporary one beside it, which is then renamed. An existing file survives a failure.
///
/// A path that ends in `.gz` is compressed. A link is followed; a device or a pipe is written to as it is. A new file
/// has the permissions of any new file, an overwritten one keeps its own. Data are handed to the system, which may put
/// them on the disk later. Returns what the format could not carry.
///
/// # Errors
/// [`WriteError`], which names the path; nothing is left behind.
pub fn write_path(mesh: &TriMesh, path: &Path, options: &WriteOptions) -> Result<Vec<Warning>, WriteError> {
    write_path_with(path, options, |format, out| write_format(mesh, format, options, out))
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
    write_path_with(path, options, |format, out| {
        let warnings = scene.write(replaced, format, relink, out)?;
        out.flush()?;
        Ok(warnings)
    })
}

fn write_path_with(
    path: &Path,
    options: &WriteOptions,
    write: impl FnOnce(Format, &mut dyn Write) -> io::Result<Vec<Warning>>,
) -> Result<Vec<Warning>, WriteError> {
    let format = options
        .format
        .or_else(|| hint_of(path))
        .ok_or_else(|| WriteError::UnknownFormat { path: path.to_owned() })?;
    write_file(path, |out| {
        if !is_gz(path) {
            return write(format, out);
        }
        // The header holds no time, so that the same mesh gives the same bytes.
        let mut gz = GzEncoder::new(out, COMPRESSION);
        let warnings = write(format, &mut BufWriter::with_capacity(BUFFER, &mut gz))?;
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
    write_stream(out, |out| write_format(mesh, format, options, out))
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
    out: &mut dyn Write,
) -> io::Result<Vec<Warning>> {
    let warnings = match format {
        Format::Obj => crate::obj::write(mesh, options, out),
        Format::Off => crate::off::write(mesh, options, out),
        Format::Ply => crate::ply::write(mesh, options, out),
        Format::Stl => crate::stl::write(mesh, options, out),
        Format::Gltf | Format::Glb => {
            // The module tells the two apart by this.
            crate::gltf::write(mesh, &WriteOptions { format: Some(format), ..options.clone() }, out)
        }
    }?;
    out.flush()?;
    Ok(warnings)
}

/// Makes the file at `path` hold what `write` writes, or leaves things as they were.
fn write_file<T>(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<T>) -> io::Result<T> {
    // A link stays a link: what it points to is replaced.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let existing = match fs::metadata(&target) {
        Ok(about) => Some(about),
        Err(e) if e.kind() == io::ErrorKind::NotFound => None,
        Err(e) => return Err(e),
    };
    if let Some(about) = &existing {
        if about.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
        }
        if about.permissions().readonly() {
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
    let mut builder = tempfile::Builder::new();
    builder.prefix(".lodsmith-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What a new file has before the user's mask is taken off.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let temporary = builder.tempfile_in(&folder)?;
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

fn is_gz(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"))
}

/// A format that cannot hold the mesh says so with a [`WriteError`] inside the error of the stream.
fn named(error: io::Error, path: &Path) -> WriteError {
    error.downcast::<WriteError>().unwrap_or_else(|source| WriteError::Io { path: path.to_owned(), source })
}
