//! Writing of meshes and scenes to paths and streams.

use std::borrow::Cow;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use lodsmith_core::TriMesh;

use crate::error::{Warning, WriteError};
use crate::files::BUFFER;
pub use crate::files::write_file;
use crate::finite::NonFinite;
use crate::format::Format;
use crate::gltf::{CopiedImages, Scene, SceneFormat, SceneLevels, Written};
use crate::losses::{losses, not_packed_warning};
use crate::material::{self, Textures};
pub use crate::options::WriteOptions;
use crate::sniff::hint_of;

/// Writes a mesh to a file, by way of a temporary file in the same folder, which is then renamed. After an
/// error an existing file is unchanged.
///
/// The output is compressed if the path ends in `.gz`. A link is followed, even if its target does not exist
/// yet; a device or a pipe is written directly. A new file has default permissions, an overwritten one keeps
/// its own. There is no sync to disk. Returns warnings about what the format cannot carry.
///
/// If the regions of an OBJ have materials, a library `NAME.mtl` is written beside it, and textures are
/// copied according to the options; images that were embedded in another file are written even if textures
/// are linked. An existing file with other content is left alone, and the new one gets a number; only a
/// library written by Lodsmith is replaced.
///
/// # Errors
/// [`WriteError`], which names the path; no partial output is left.
pub fn write_path(mesh: &TriMesh, path: &Path, options: &WriteOptions) -> Result<Written, WriteError> {
    let format = format_of(path, options)?;
    let mut beside = None;
    if let (Format::Obj, Some(regions)) = (format, &options.regions)
        && !material::drops_materials(mesh, regions)
    {
        let target = options.beside.as_deref().unwrap_or(path);
        beside = Some(material::write_sidecar_files(regions, target, options.textures)?);
    }
    let libraries = beside.as_ref().map(|beside| &*beside.libraries);
    let written =
        write_path_with(path, options.force, |out| write_format(mesh, format, options, libraries, out));
    match (written, beside) {
        (written, None) => written,
        (Ok(written), Some(mut beside)) => {
            beside.warnings.extend(written);
            Ok(Written::new(beside.warnings))
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

/// Writes a whole scene to a file, with some meshes replaced; see [`Scene::write`]. Otherwise like [`write_path`]. The
/// format is glTF, GLB or 3MF; 3MF gets an object for each mesh, and the nodes become components and items.
///
/// With [`Textures::Copy`], separate images of a `.gltf` are copied beside it if they may be read; `relink`
/// is for the other files.
///
/// # Errors
/// [`WriteError`], which names the path; no partial output is left.
pub fn write_scene_path(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    path: &Path,
    options: &WriteOptions,
    relink: &dyn Fn(&str) -> Option<String>,
) -> Result<Written, WriteError> {
    let format = format_of(path, options)?;
    let mut to = SceneFormat::new(format, options.packing);
    to.textures = options.textures;
    let write = |relink: &dyn Fn(&str) -> Option<String>, out: &mut dyn Write| {
        write_scene(scene, replaced, to, relink, out)
    };
    write_with_images(scene, path, format, options, relink, write)
}

/// Writes a whole scene with levels of detail to a file; see [`Scene::write_levels`]. Otherwise like
/// [`write_scene_path`].
///
/// # Errors
/// [`WriteError`], which names the path; no partial output is left.
pub fn write_levels_path(
    scene: &Scene,
    levels: &SceneLevels,
    path: &Path,
    options: &WriteOptions,
    relink: &dyn Fn(&str) -> Option<String>,
) -> Result<Written, WriteError> {
    let format = format_of(path, options)?;
    let write = |relink: &dyn Fn(&str) -> Option<String>, out: &mut dyn Write| {
        write_levels(scene, levels, SceneFormat::new(format, options.packing), relink, out)
    };
    write_with_images(scene, path, format, options, relink, write)
}

/// Writes a scene to a file, with its separate images copied beside it if the options request that.
fn write_with_images(
    scene: &Scene,
    path: &Path,
    format: Format,
    options: &WriteOptions,
    relink: &dyn Fn(&str) -> Option<String>,
    write: impl FnOnce(&dyn Fn(&str) -> Option<String>, &mut dyn Write) -> io::Result<Written>,
) -> Result<Written, WriteError> {
    let copied = match (format, options.textures) {
        (Format::Gltf, Textures::Copy) => CopiedImages::new(scene, path)?,
        _ => CopiedImages::default(),
    };
    let written = write_path_with(path, options.force, |out| {
        let written = write(&|uri| copied.uri(uri).or_else(|| relink(uri)), out)?;
        out.flush()?;
        Ok(written)
    });
    match written {
        Ok(mut written) => {
            written.warnings.splice(0..0, copied.into_warnings());
            Ok(written)
        }
        Err(error) => {
            copied.remove();
            Err(error)
        }
    }
}

fn write_path_with(
    path: &Path,
    force: bool,
    write: impl FnOnce(&mut dyn Write) -> io::Result<Written>,
) -> Result<Written, WriteError> {
    write_file(path, force, |out| {
        if !is_gz(path) {
            return write(out);
        }
        // The header has no time stamp, so that the same mesh gives the same bytes.
        let mut gz = GzEncoder::new(out, COMPRESSION);
        let written = write(&mut BufWriter::with_capacity(BUFFER, &mut gz))?;
        gz.finish()?;
        Ok(written)
    })
    .map_err(|e| named(e, path))
}

/// Writes a mesh to a stream in a format. Returns warnings about what the format cannot carry.
///
/// The stream is written in large chunks and flushed at the end.
///
/// # Errors
/// [`WriteError`].
pub fn write_to(
    mesh: &TriMesh,
    format: Format,
    options: &WriteOptions,
    out: &mut dyn Write,
) -> Result<Written, WriteError> {
    write_stream(out, |out| write_format(mesh, format, options, None, out))
}

/// Writes a whole scene to a stream, with some meshes replaced; see [`Scene::write`].
///
/// The stream is written in large chunks and flushed at the end.
///
/// # Errors
/// [`WriteError`].
pub fn write_scene_to(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    to: impl Into<SceneFormat>,
    relink: &dyn Fn(&str) -> Option<String>,
    out: &mut dyn Write,
) -> Result<Written, WriteError> {
    write_stream(out, |out| {
        let written = write_scene(scene, replaced, to.into(), relink, out)?;
        out.flush()?;
        Ok(written)
    })
}

/// Writes a whole scene to a format that can hold one.
fn write_scene(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    to: SceneFormat,
    relink: &dyn Fn(&str) -> Option<String>,
    out: &mut dyn Write,
) -> io::Result<Written> {
    let (replaced, removed) = finite_meshes(scene, replaced, to.format);
    let mut written = if to.format == Format::ThreeMf {
        let mut written = crate::three_mf::write_scene(scene, &replaced, to.textures, out)?;
        written.warnings.extend(not_packed_warning(to.format, to.packing));
        written
    } else {
        scene.write(&replaced, to, relink, out)?
    };
    written.warnings.splice(0..0, removed);
    Ok(written)
}

/// Writes a whole scene with levels of detail.
fn write_levels(
    scene: &Scene,
    levels: &SceneLevels,
    to: SceneFormat,
    relink: &dyn Fn(&str) -> Option<String>,
    out: &mut dyn Write,
) -> io::Result<Written> {
    let kept = levels.replaced.first().map_or(&[][..], Vec::as_slice);
    let (first, removed) = finite_meshes(scene, kept, to.format);
    let mut levels = Cow::Borrowed(levels);
    if let Cow::Owned(first) = first {
        let all = &mut levels.to_mut().replaced;
        all.resize(all.len().max(1), Vec::new());
        all[0] = first;
    }
    let mut written = scene.write_levels(&levels, to, relink, out)?;
    written.warnings.splice(0..0, removed);
    Ok(written)
}

/// Returns the replacements of a scene, with further ones for meshes that have numbers that are not finite, and warnings
/// about these.
fn finite_meshes<'r>(
    scene: &Scene,
    replaced: &'r [Option<TriMesh>],
    format: Format,
) -> (Cow<'r, [Option<TriMesh>]>, Vec<Warning>) {
    let mut removed = NonFinite::default();
    let mut all = Cow::Borrowed(replaced);
    for (i, own) in scene.meshes().iter().enumerate() {
        let mesh = replaced.get(i).and_then(Option::as_ref).unwrap_or(&own.mesh);
        if let Cow::Owned(made) = removed.removed_from(mesh, format) {
            let all = all.to_mut();
            all.resize(all.len().max(i + 1), None);
            all[i] = Some(made);
        }
    }
    (all, removed.warnings(format))
}

/// Writes a whole scene with levels of detail to a stream; see [`Scene::write_levels`].
///
/// The stream is written in large chunks and flushed at the end.
///
/// # Errors
/// [`WriteError`].
pub fn write_levels_to(
    scene: &Scene,
    levels: &SceneLevels,
    to: impl Into<SceneFormat>,
    relink: &dyn Fn(&str) -> Option<String>,
    out: &mut dyn Write,
) -> Result<Written, WriteError> {
    write_stream(out, |out| {
        let written = write_levels(scene, levels, to.into(), relink, out)?;
        out.flush()?;
        Ok(written)
    })
}

fn write_stream(
    out: &mut dyn Write,
    write: impl FnOnce(&mut dyn Write) -> io::Result<Written>,
) -> Result<Written, WriteError> {
    let mut out = BufWriter::with_capacity(BUFFER, out);
    let result = write(&mut out);
    if result.is_err() {
        // Discards the rest of the buffer, since the output is invalid.
        let _ = out.into_parts();
    }
    result.map_err(|e| named(e, Path::new("output stream")))
}

/// Compression level. Measured on an OBJ of 2 million triangles (73 MB): 0.8 s for 16 MB; the default level 6
/// takes 6.2 s for 15 MB.
const COMPRESSION: Compression = Compression::new(3);

fn write_format(
    mesh: &TriMesh,
    format: Format,
    options: &WriteOptions,
    libraries: Option<&[Vec<u8>]>,
    out: &mut dyn Write,
) -> io::Result<Written> {
    let mut removed = NonFinite::default();
    let finite = removed.removed_from(mesh, format);
    if finite.face_count() == 0 && mesh.face_count() > 0 {
        let what = "positions that are not finite, which all faces have".to_owned();
        return Err(io::Error::other(WriteError::TooLarge { format: format.title(), what }));
    }
    let mesh = &*finite;
    let mut written = match format {
        Format::Obj => crate::obj::write_with_libraries(mesh, options, libraries, out).map(Written::new),
        Format::Off => crate::off::write(mesh, options, out).map(Written::new),
        Format::Ply => crate::ply::write(mesh, options, out).map(Written::new),
        Format::Stl => crate::stl::write(mesh, options, out).map(Written::new),
        Format::Gltf | Format::Glb => {
            // The module distinguishes the two by this option.
            crate::gltf::write(mesh, &WriteOptions { format: Some(format), ..options.clone() }, out)
        }
        Format::ThreeMf => crate::three_mf::write(mesh, options, out).map(Written::new),
        Format::Dae | Format::Fbx => Err(io::Error::other(WriteError::ReadOnly { format: format.title() })),
        Format::Lpm => Err(io::Error::other(WriteError::NeedsSplits)),
    }?;
    out.flush()?;
    written.warnings.splice(0..0, removed.warnings(format));
    written.warnings.extend(losses(mesh, format, options));
    Ok(written)
}

fn is_gz(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"))
}

/// Converts an I/O error; a format that cannot hold the mesh wraps a [`WriteError`] in it.
fn named(error: io::Error, path: &Path) -> WriteError {
    error.downcast::<WriteError>().unwrap_or_else(|source| WriteError::Io { path: path.to_owned(), source })
}
