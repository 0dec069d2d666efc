//! Where meshes come from and go to: paths, standard input and output.

use std::ffi::OsString;
use std::fmt;
use std::fs;
use std::io::{self, ErrorKind, Read as _};
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
use crate::exit;

/// What is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// Standard input, typed as `-`.
    Stdin,
    /// A file.
    Path(PathBuf),
}

/// Where a result goes.
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

/// The same, with these properties of vertices beside the mesh.
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
            let mut bytes = Vec::new();
            io::stdin().lock().read_to_end(&mut bytes)?;
            lodsmith_io::read_bytes(&bytes, &options)
        }
    };
    loaded.map_err(unnamed)
}

/// Reads a file as a model, as it is to be seen. The error does not name the source.
pub(crate) fn read_model(source: &Source, reading: &Reading) -> anyhow::Result<ModelFile> {
    let options = reading.options();
    let model = match source {
        Source::Path(path) => lodsmith_io::read_model_path(path, &options),
        Source::Stdin => {
            let mut bytes = Vec::new();
            io::stdin().lock().read_to_end(&mut bytes)?;
            lodsmith_io::read_model_bytes(&bytes, &options)
        }
    };
    model.map_err(unnamed)
}

/// What a file is read as.
pub(crate) enum Input {
    /// One mesh of all that is placed.
    Mesh(Box<Loaded>),
    /// All of a glTF file.
    Scene(Box<Scene>),
}

/// Reads a glTF file as a scene, and any other as a mesh with these properties of vertices beside it. The error does not
/// name the source.
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
            let mut bytes = Vec::new();
            io::stdin().lock().read_to_end(&mut bytes)?;
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

/// The error without the name of the file, which the caller has.
pub(crate) fn unnamed(error: ReadError) -> anyhow::Error {
    match error {
        ReadError::File { source, .. } => told(*source),
        e => told(e),
    }
}

/// An error whose words already hold those of its cause: the chain of causes would say them twice.
fn told(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("{error}")
}

/// Two sources that both want standard input cannot have it.
pub(crate) fn at_most_one_stdin<'a>(sources: impl IntoIterator<Item = &'a Source>) -> anyhow::Result<()> {
    if sources.into_iter().filter(|s| **s == Source::Stdin).count() > 1 {
        return Err(exit::usage("standard input can be read only once: one `-` is enough"));
    }
    Ok(())
}

/// How a mesh is written whose regions stand for these.
pub(crate) fn options(writing: &Writing, format: Format, regions: Regions) -> WriteOptions {
    let mut options = WriteOptions::default();
    options.format = Some(format);
    options.ascii = writing.ascii;
    options.textures = writing.textures.into();
    options.regions = Some(Arc::new(regions));
    options
}

/// The format that a sink is written in: the one asked for, or that of its ending.
pub(crate) fn format_of(sink: &Sink, to: Option<Format>) -> anyhow::Result<Format> {
    let hint = match sink {
        Sink::Path(path) => hint_of(path),
        Sink::Stdout => None,
    };
    match (to.or(hint), sink) {
        (Some(Format::Lpm), _) => Err(exit::usage(WriteError::NeedsSplits.to_string())),
        (Some(format), _) => Ok(format),
        (None, Sink::Stdout) => Err(exit::usage("standard output has no ending: say the format with --to")),
        (None, Sink::Path(path)) => {
            Err(exit::usage(WriteError::UnknownFormat { path: path.clone() }.to_string()))
        }
    }
}

/// A sink that is a folder is a fault of the command line.
pub(crate) fn refuse_folder(sink: &Sink, hint: &str) -> anyhow::Result<()> {
    match sink {
        Sink::Path(path) if path.is_dir() => {
            Err(exit::usage(format!("{}: is a folder, which is never overwritten{hint}", path.display())))
        }
        _ => Ok(()),
    }
}

/// Writes a mesh; returns what the format could not carry. No half file stays behind.
///
/// A write-protected file is replaced with `force` only. Whoever closed the pipe behind standard output had what it
/// wanted.
pub(crate) fn write(
    mesh: &TriMesh,
    sink: &Sink,
    format: Format,
    options: &WriteOptions,
    force: bool,
) -> anyhow::Result<Vec<Warning>> {
    write_with(
        sink,
        force,
        |out| lodsmith_io::write_to(mesh, format, options, out),
        |path, beside| {
            let mut options = options.clone();
            options.beside = beside.map(Path::to_owned);
            lodsmith_io::write_path(mesh, path, &options)
        },
    )
}

/// Writes a scene with some meshes replaced, and other names for the files that it refers to; in all else as
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
    options.format = Some(format);
    write_with(
        sink,
        force,
        |out| lodsmith_io::write_scene_to(scene, replaced, format, relink, out),
        |path, _| lodsmith_io::write_scene_path(scene, replaced, path, &options, relink),
    )
}

/// Writes a scene with levels of detail; in all else as [`write_scene`].
pub(crate) fn write_levels(
    scene: &Scene,
    levels: &SceneLevels,
    relink: &dyn Fn(&str) -> Option<String>,
    sink: &Sink,
    format: Format,
    force: bool,
) -> anyhow::Result<Vec<Warning>> {
    let mut options = WriteOptions::default();
    options.format = Some(format);
    write_with(
        sink,
        force,
        |out| lodsmith_io::write_levels_to(scene, levels, format, relink, out),
        |path, _| lodsmith_io::write_levels_path(scene, levels, path, &options, relink),
    )
}

/// What a scene with levels of detail loses, without writing anything.
pub(crate) fn levels_losses(
    scene: &Scene,
    levels: &SceneLevels,
    relink: &dyn Fn(&str) -> Option<String>,
    format: Format,
) -> anyhow::Result<Vec<Warning>> {
    lodsmith_io::write_levels_to(scene, levels, format, relink, &mut io::sink()).map_err(told)
}

/// A mesh as a glTF scene of its own, as writing and reading it would make it; what that could not carry.
pub(crate) fn as_scene(mesh: &TriMesh, options: &WriteOptions) -> anyhow::Result<(Scene, Vec<Warning>)> {
    let mut bytes = Vec::new();
    let warnings = lodsmith_io::write_to(mesh, Format::Glb, options, &mut bytes).map_err(told)?;
    let scene = Scene::read(&bytes, &ReadOptions::default()).map_err(unnamed)?;
    Ok((scene, warnings))
}

/// Writes text to a file of its own.
pub(crate) fn write_text(text: &str, path: &Path, force: bool) -> anyhow::Result<()> {
    let about = fs::metadata(path).ok();
    if about.as_ref().is_some_and(fs::Metadata::is_dir) {
        return Err(anyhow!("{}: is a folder, which is never overwritten", path.display()));
    }
    if about.is_some_and(|a| a.permissions().readonly()) && !force {
        return Err(anyhow!("{}: cannot write: the file is read-only", path.display()));
    }
    let _guard = exit::writing()?;
    let mut name = OsString::from(format!(".lodsmith-{}-", std::process::id()));
    name.push(path.file_name().unwrap_or_default());
    let neighbour = path.with_file_name(name);
    let written = fs::write(&neighbour, text).and_then(|()| fs::rename(&neighbour, path));
    if written.is_err() {
        let _ = fs::remove_file(&neighbour);
    }
    written.map_err(|e| anyhow!("{}: cannot write: {e}", path.display()))
}

/// Writes a progressive mesh; in all else as [`write()`].
pub(crate) fn write_lpm(
    splits: &Splits,
    regions: &Regions,
    sink: &Sink,
    options: &LpmOptions,
    force: bool,
) -> anyhow::Result<LpmWritten> {
    let stream = |source| WriteError::Io { path: "output stream".into(), source };
    write_with(
        sink,
        force,
        |out| lpm::write(splits, Some(regions), options, &mut io::BufWriter::new(out)).map_err(stream),
        |path, _| lpm::write_path(splits, Some(regions), options, path),
    )
}

/// Reads a progressive mesh, or the beginning of one. The error does not name the source.
pub(crate) fn read_lpm(source: &Source) -> anyhow::Result<Lpm> {
    let options = ReadOptions::default();
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

fn write_with<T: Default>(
    sink: &Sink,
    force: bool,
    to_stream: impl FnOnce(&mut dyn io::Write) -> Result<T, WriteError>,
    to_path: impl FnOnce(&Path, Option<&Path>) -> Result<T, WriteError>,
) -> anyhow::Result<T> {
    match sink {
        Sink::Stdout => match to_stream(&mut io::stdout().lock()) {
            Err(WriteError::Io { source, .. }) if source.kind() == ErrorKind::BrokenPipe => Ok(T::default()),
            Err(WriteError::Io { source, .. }) => Err(anyhow!("cannot write to standard output: {source}")),
            result => result.map_err(told),
        },
        Sink::Path(path) => {
            let about = fs::metadata(path).ok();
            // A pipe may keep its writer waiting for ever; Ctrl-C must end that, and there is no half file to fear.
            let _guard =
                if about.as_ref().is_none_or(fs::Metadata::is_file) { Some(exit::writing()?) } else { None };
            if force && about.is_some_and(|a| a.is_file() && a.permissions().readonly()) {
                return replace(path, to_path);
            }
            to_path(path, None).map_err(told)
        }
    }
}

/// What the format could not carry, without writing anything.
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
    lodsmith_io::write_to(mesh, format, &options, &mut io::sink()).map_err(told)
}

/// What a scene loses, without writing anything.
pub(crate) fn scene_losses(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    relink: &dyn Fn(&str) -> Option<String>,
    format: Format,
) -> anyhow::Result<Vec<Warning>> {
    lodsmith_io::write_scene_to(scene, replaced, format, relink, &mut io::sink()).map_err(told)
}

/// Puts a new file in the place of one that may not be written to, by way of a neighbour.
fn replace<T>(
    path: &Path,
    write: impl FnOnce(&Path, Option<&Path>) -> Result<T, WriteError>,
) -> anyhow::Result<T> {
    let target = fs::canonicalize(path)?;
    let mut name = OsString::from(format!(".lodsmith-{}-", std::process::id()));
    name.push(target.file_name().unwrap_or_default());
    let neighbour = target.with_file_name(name);
    let written = write(&neighbour, Some(path)).map_err(told);
    let moved = written.and_then(|value| {
        fs::rename(&neighbour, &target).map_err(|e| anyhow!("{}: cannot write: {e}", path.display()))?;
        Ok(value)
    });
    if moved.is_err() {
        let _ = fs::remove_file(&neighbour);
    }
    moved
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
