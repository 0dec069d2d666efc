//! Input and output of meshes: paths, standard input and standard output.

use std::ffi::OsString;
use std::fmt;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::anyhow;
use lodsmith::core::{Splits, TriMesh};
use lodsmith_io::gltf::{Scene, SceneLevels};
use lodsmith_io::lpm::{self, LpmWritten};
use lodsmith_io::sniff::hint_of;
use lodsmith_io::{
    Format, Loaded, Lpm, LpmOptions, ModelFile, ReadError, ReadOptions, Regions, Warning, WriteError,
    WriteOptions,
};

use crate::args::{Reading, Writing};
use crate::{exit, memory, plan};

/// Source of an input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// Standard input, typed as `-`.
    Stdin,
    /// A file.
    Path(PathBuf),
}

/// Destination of a result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Sink {
    /// Standard output, typed as `-`.
    Stdout,
    /// A file.
    Path(PathBuf),
}

impl From<OsString> for Source {
    fn from(typed: OsString) -> Self {
        if typed == "-" { Self::Stdin } else { Self::Path(typed.into()) }
    }
}

impl From<OsString> for Sink {
    fn from(typed: OsString) -> Self {
        if typed == "-" { Self::Stdout } else { Self::Path(typed.into()) }
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stdin => f.write_str("-"),
            Self::Path(path) => path.display().fmt(f),
        }
    }
}

impl fmt::Display for Sink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stdout => f.write_str("-"),
            Self::Path(path) => path.display().fmt(f),
        }
    }
}

/// Reads a mesh. The error does not name the source.
pub(crate) fn read(source: &Source, reading: &Reading) -> anyhow::Result<Loaded> {
    read_with(source, reading, Vec::new())
}

/// Reads a mesh and, in addition, these properties of vertices. The error does not name the source.
pub(crate) fn read_with(
    source: &Source,
    reading: &Reading,
    properties: Vec<String>,
) -> anyhow::Result<Loaded> {
    let mut options = reading.options();
    options.properties = properties;
    let loaded = match source {
        Source::Path(path) => lodsmith_io::read_path(path, &options),
        Source::Stdin => {
            let bytes = stdin(&options)?;
            lodsmith_io::read_bytes(&bytes, &options)
        }
    };
    loaded.map_err(unnamed)
}

/// Reads a file as a model for rendering. The error does not name the source.
pub(crate) fn read_model(source: &Source, reading: &Reading) -> anyhow::Result<ModelFile> {
    let options = reading.options();
    let model = match source {
        Source::Path(path) => lodsmith_io::read_model_path(path, &options),
        Source::Stdin => {
            let bytes = stdin(&options)?;
            lodsmith_io::read_model_bytes(&bytes, &options)
        }
    };
    model.map_err(unnamed)
}

/// Reads all of standard input, within the limits.
fn stdin(options: &ReadOptions) -> anyhow::Result<Vec<u8>> {
    lodsmith_io::read_stream(&mut io::stdin().lock(), Vec::new(), options.limits).map_err(unnamed)
}

/// Content of a file.
pub(crate) enum Input {
    /// One mesh of all instances.
    Mesh(Box<Loaded>),
    /// A complete glTF file.
    Scene(Box<Scene>),
}

/// Reads a glTF file as a scene, and any other as a mesh with these properties of vertices in addition. The
/// error does not name the source.
pub(crate) fn read_scene(
    source: &Source,
    reading: &Reading,
    properties: Vec<String>,
) -> anyhow::Result<Input> {
    let mut options = reading.options();
    options.properties = properties.clone();
    let scene = match source {
        Source::Path(path) => lodsmith_io::read_scene_path(path, &options).map_err(unnamed)?,
        Source::Stdin => {
            let bytes = stdin(&options)?;
            let scene = lodsmith_io::read_scene_bytes(&bytes, &options).map_err(unnamed)?;
            if scene.is_none() {
                let mesh = lodsmith_io::read_bytes(&bytes, &options).map_err(unnamed)?;
                return Ok(Input::Mesh(Box::new(mesh)));
            }
            scene
        }
    };
    Ok(match scene {
        Some(scene) => Input::Scene(Box::new(scene)),
        None => Input::Mesh(Box::new(read_with(source, reading, properties)?)),
    })
}

/// Returns the error without the name of the file, which the caller adds.
pub(crate) fn unnamed(error: ReadError) -> anyhow::Error {
    match error {
        ReadError::File { source, .. } => flattened_error(*source),
        e => flattened_error(e),
    }
}

/// Returns an error without its chain of causes, whose messages it already contains.
fn flattened_error(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("{error}")
}

/// Returns an error if two sources are standard input.
pub(crate) fn at_most_one_stdin<'a>(sources: impl IntoIterator<Item = &'a Source>) -> anyhow::Result<()> {
    if sources.into_iter().filter(|s| **s == Source::Stdin).count() > 1 {
        return Err(exit::usage("standard input can be read only once: one `-` is enough"));
    }
    Ok(())
}

/// Returns the options for writing a mesh with these regions.
pub(crate) fn options(writing: &Writing, format: Format, regions: Regions) -> WriteOptions {
    let mut options = WriteOptions::default();
    options.format = Some(format);
    options.ascii = writing.ascii;
    options.force = writing.force;
    options.textures = writing.textures;
    options.regions = Some(Arc::new(regions));
    options
}

/// Returns the format of an output: the one asked for, or that of its file extension.
pub(crate) fn format_of(sink: &Sink, to: Option<Format>) -> anyhow::Result<Format> {
    let hint = match sink {
        Sink::Path(path) => hint_of(path),
        Sink::Stdout => None,
    };
    match (to.or(hint), sink) {
        (Some(Format::Lpm), _) => Err(exit::usage(WriteError::NeedsSplits.to_string())),
        (Some(format), _) => Ok(format),
        (None, Sink::Stdout) => Err(exit::usage("standard output has no ending: say the format with --to")),
        (None, Sink::Path(path)) if path.is_dir() => {
            Err(exit::usage(format!("{}: is a folder: name a file in it", path.display())))
        }
        (None, Sink::Path(path)) => {
            Err(exit::usage(WriteError::UnknownFormat { path: path.clone() }.to_string()))
        }
    }
}

/// Returns a usage error if the output is a folder.
pub(crate) fn refuse_folder(sink: &Sink, hint: &str) -> anyhow::Result<()> {
    match sink {
        Sink::Path(path) if path.is_dir() => {
            Err(exit::usage(format!("{}: is a folder, which is never overwritten{hint}", path.display())))
        }
        _ => Ok(()),
    }
}

/// Refuses to overwrite an input unless asked for: it may be the only copy.
///
/// # Errors
/// A usage error if the output is an input.
pub(crate) fn refuse_inputs<'a>(
    sink: &Sink,
    inputs: impl IntoIterator<Item = &'a Source>,
    force: bool,
) -> anyhow::Result<()> {
    let Sink::Path(path) = sink else { return Ok(()) };
    // A device or a pipe cannot be overwritten.
    if force || !fs::metadata(path).is_ok_and(|about| about.is_file()) {
        return Ok(());
    }
    let place = plan::identity(path);
    for input in inputs {
        if matches!(input, Source::Path(input) if plan::identity(input) == place) {
            return Err(exit::usage(format!("{sink}: is an input; --force writes over it")));
        }
    }
    Ok(())
}

/// Writes a mesh and returns the data that the format cannot hold. Never leaves a partial file.
pub(crate) fn write(
    mesh: &TriMesh,
    sink: &Sink,
    format: Format,
    options: &WriteOptions,
) -> anyhow::Result<Vec<Warning>> {
    write_with(
        sink,
        |out| lodsmith_io::write_to(mesh, format, options, out),
        |path| lodsmith_io::write_path(mesh, path, options),
    )
}

/// Writes a scene with some meshes replaced, and other names for the files that it refers to; otherwise like
/// [`write()`].
pub(crate) fn write_scene(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    relink: &dyn Fn(&str) -> Option<String>,
    sink: &Sink,
    format: Format,
    force: bool,
) -> anyhow::Result<Vec<Warning>> {
    let mut options = WriteOptions::default();
    (options.format, options.force) = (Some(format), force);
    write_with(
        sink,
        |out| lodsmith_io::write_scene_to(scene, replaced, format, relink, out),
        |path| lodsmith_io::write_scene_path(scene, replaced, path, &options, relink),
    )
}

/// Writes a scene with levels of detail; otherwise like [`write_scene`].
pub(crate) fn write_levels(
    scene: &Scene,
    levels: &SceneLevels,
    relink: &dyn Fn(&str) -> Option<String>,
    sink: &Sink,
    format: Format,
    force: bool,
) -> anyhow::Result<Vec<Warning>> {
    let mut options = WriteOptions::default();
    (options.format, options.force) = (Some(format), force);
    write_with(
        sink,
        |out| lodsmith_io::write_levels_to(scene, levels, format, relink, out),
        |path| lodsmith_io::write_levels_path(scene, levels, path, &options, relink),
    )
}

/// Returns the losses of a scene with levels of detail, without writing anything.
pub(crate) fn levels_losses(
    scene: &Scene,
    levels: &SceneLevels,
    relink: &dyn Fn(&str) -> Option<String>,
    format: Format,
) -> anyhow::Result<Vec<Warning>> {
    lodsmith_io::write_levels_to(scene, levels, format, relink, &mut io::sink()).map_err(flattened_error)
}

/// Returns a mesh as a glTF scene, as writing and reading it would give, and the data that glTF cannot hold.
pub(crate) fn as_scene(mesh: &TriMesh, options: &WriteOptions) -> anyhow::Result<(Scene, Vec<Warning>)> {
    let mut bytes = Vec::new();
    let warnings = lodsmith_io::write_to(mesh, Format::Glb, options, &mut bytes).map_err(flattened_error)?;
    let scene = Scene::read(&bytes, &ReadOptions::default()).map_err(unnamed)?;
    Ok((scene, warnings))
}

/// Writes bytes to a file.
pub(crate) fn write_bytes(bytes: &[u8], path: &Path, force: bool) -> anyhow::Result<()> {
    write_with(
        &Sink::Path(path.to_owned()),
        |_| Ok(()),
        |path| {
            let written = lodsmith_io::write::write_file(path, force, |out| out.write_all(bytes));
            written.map_err(|source| WriteError::Io { path: path.to_owned(), source })
        },
    )
}

/// Writes a progressive mesh; otherwise like [`write()`].
pub(crate) fn write_lpm(
    splits: &Splits,
    regions: &Regions,
    sink: &Sink,
    options: &LpmOptions,
) -> anyhow::Result<LpmWritten> {
    let stream = |source| WriteError::Io { path: "output stream".into(), source };
    write_with(
        sink,
        |out| lpm::write(splits, Some(regions), options, &mut io::BufWriter::new(out)).map_err(stream),
        |path| lpm::write_path(splits, Some(regions), options, path),
    )
}

/// Reads a progressive mesh, or a prefix of one. The error does not name the source.
pub(crate) fn read_lpm(source: &Source) -> anyhow::Result<Lpm> {
    let mut options = ReadOptions::default();
    options.limits = memory::limits();
    match source {
        Source::Path(path) => {
            let file = fs::File::open(path).map_err(|e| match e.kind() {
                ErrorKind::NotFound => anyhow!("cannot read: there is no such file"),
                _ => anyhow!("cannot read: {e}"),
            })?;
            lpm::read(io::BufReader::new(file), &options)
        }
        Source::Stdin => lpm::read(io::stdin().lock(), &options),
    }
    .map_err(unnamed)
}

fn write_with<T>(
    sink: &Sink,
    to_stream: impl FnOnce(&mut dyn io::Write) -> Result<T, WriteError>,
    to_path: impl FnOnce(&Path) -> Result<T, WriteError>,
) -> anyhow::Result<T> {
    match sink {
        Sink::Stdout => match to_stream(&mut io::stdout().lock()) {
            Err(WriteError::Io { source, .. }) => Err(stdout_failed(&source)),
            result => result.map_err(flattened_error),
        },
        Sink::Path(path) => {
            let about = fs::metadata(path).ok();
            // A pipe may block its writer for ever, and Ctrl-C must end that; it cannot leave a partial file.
            let _guard =
                if about.as_ref().is_none_or(fs::Metadata::is_file) { Some(exit::writing()?) } else { None };
            to_path(path).map_err(flattened_error)
        }
    }
}

/// Returns the error for a file that standard output did not accept completely. A reader that closes the pipe
/// early gets it too, since its file is truncated.
pub(crate) fn stdout_failed(error: &io::Error) -> anyhow::Error {
    match error.kind() {
        ErrorKind::BrokenPipe => anyhow!("standard output was closed before all was written"),
        _ => anyhow!("cannot write to standard output: {error}"),
    }
}

/// Returns the data that the format cannot hold, without writing anything.
pub(crate) fn losses(
    mesh: &TriMesh,
    sink: &Sink,
    format: Format,
    options: &WriteOptions,
) -> anyhow::Result<Vec<Warning>> {
    let mut options = options.clone();
    if let Sink::Path(path) = sink {
        options.beside = Some(path.clone());
    }
    lodsmith_io::write_to(mesh, format, &options, &mut io::sink()).map_err(flattened_error)
}

/// Returns the losses of a scene, without writing anything.
pub(crate) fn scene_losses(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    relink: &dyn Fn(&str) -> Option<String>,
    format: Format,
) -> anyhow::Result<Vec<Warning>> {
    lodsmith_io::write_scene_to(scene, replaced, format, relink, &mut io::sink()).map_err(flattened_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dash_is_a_stream() {
        assert_eq!(Source::from(OsString::from("-")), Source::Stdin);
        assert_eq!(Source::from(OsString::from("./-")).to_string(), "./-");
        assert!(at_most_one_stdin([&Source::Stdin, &Source::Stdin]).is_err());
    }

    #[test]
    fn the_ending_names_the_format_unless_told() {
        let sink = |s: &str| Sink::from(OsString::from(s));
        assert_eq!(format_of(&sink("a.stl.gz"), None).unwrap(), Format::Stl);
        assert_eq!(format_of(&sink("a.stl"), Some(Format::Ply)).unwrap(), Format::Ply);
        assert_eq!(exit::status_of(&format_of(&sink("-"), None).unwrap_err()), exit::Status::Usage);
    }
}
