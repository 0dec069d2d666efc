//! Reading and writing of models, from and to files and standard streams.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::Arc;

use anyhow::anyhow;
use lodsmith::core::{Splits, TriMesh};
use lodsmith_io::gltf::{Packing, Scene, SceneFormat, SceneLevels, Written};
use lodsmith_io::lpm::{self, LpmWritten};
use lodsmith_io::{
    Format, Frame, Loaded, Lpm, LpmOptions, ModelFile, ReadError, ReadOptions, Regions, Sizes, Textures,
    Warning, WriteError, WriteOptions,
};

use crate::args::{Reading, Writing};
use crate::paths::{Sink, Source};
use crate::sizes::{self, WriteOutcome};
use crate::{exit, memory};

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
    /// A complete scene.
    Scene(Box<Scene>),
}

/// Reads a file with a scene as such if `keeps_scenes` is set, and any other as a mesh with these properties of
/// vertices in addition. The error does not name the source.
pub(crate) fn read_input(
    source: &Source,
    reading: &Reading,
    properties: Vec<String>,
    keeps_scenes: bool,
) -> anyhow::Result<Input> {
    if !keeps_scenes {
        return Ok(Input::Mesh(Box::new(read_with(source, reading, properties)?)));
    }
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

/// The output for an input: where its result goes, and how it is written.
#[derive(Clone, Debug)]
pub(crate) struct Destination {
    pub(crate) sink: Sink,
    pub(crate) format: Format,
    pub(crate) writing: Writing,
    /// Nothing is written; the losses are found all the same.
    pub(crate) dry_run: bool,
}

impl Destination {
    /// Returns true if a scene stays one here: rotating or scaling it would need changes of its nodes.
    pub(crate) fn keeps_scenes(&self) -> bool {
        self.format.keeps_scenes() && self.writing.scale.is_none() && self.writing.up.is_none()
    }

    /// Returns true if materials are written.
    pub(crate) fn keeps_materials(&self) -> bool {
        matches!(self.format, Format::Obj | Format::Gltf | Format::Glb | Format::ThreeMf)
            && self.writing.textures != Textures::None
    }

    /// Returns true if files with names from the input are written beside the output: the result of another
    /// input may have the same.
    pub(crate) fn shares_names(&self, regions: &Regions) -> bool {
        self.format == Format::Obj && !regions.libraries().is_empty() && !self.dry_run
    }

    /// Writes a mesh; returns the data that the format cannot hold, and sizes. Never leaves a partial file.
    pub(crate) fn write(&self, mesh: &TriMesh, regions: Regions) -> anyhow::Result<WriteOutcome> {
        let of_mesh = sizes::of_mesh(mesh, &regions, self.keeps_materials());
        let mut options = self.mesh_options(regions);
        let written = if self.dry_run {
            if let Sink::Path(path) = &self.sink {
                options.beside = Some(path.clone());
            }
            lodsmith_io::write_to(mesh, self.format, &options, &mut io::sink()).map_err(flattened_error)
        } else {
            write_mesh(mesh, &self.sink, self.format, &options)
        }?;
        Ok(self.outcome(written, Some(of_mesh)))
    }

    fn outcome(&self, written: Written, of_mesh: Option<Sizes>) -> WriteOutcome {
        let of_mesh = of_mesh.or(written.sizes);
        WriteOutcome::new(written, Some(&self.sink).filter(|_| !self.dry_run), of_mesh)
    }

    /// Writes a scene with some meshes replaced, and other names for the files that it refers to; otherwise
    /// like [`write`](Self::write).
    pub(crate) fn write_scene(
        &self,
        scene: &Scene,
        replaced: &[Option<TriMesh>],
        relink: &dyn Fn(&str) -> Option<String>,
    ) -> anyhow::Result<WriteOutcome> {
        let mut to = SceneFormat::new(self.format, self.writing.packing());
        to.textures = self.writing.textures;
        let written = self.put(
            |out| lodsmith_io::write_scene_to(scene, replaced, to, relink, out),
            |path| lodsmith_io::write_scene_path(scene, replaced, path, &self.options(), relink),
        )?;
        Ok(self.outcome(written, None))
    }

    /// Writes a scene with levels of detail; otherwise like [`write_scene`](Self::write_scene).
    pub(crate) fn write_levels(
        &self,
        scene: &Scene,
        levels: &SceneLevels,
        relink: &dyn Fn(&str) -> Option<String>,
    ) -> anyhow::Result<WriteOutcome> {
        let to = SceneFormat::new(self.format, self.writing.packing());
        let written = self.put(
            |out| lodsmith_io::write_levels_to(scene, levels, to, relink, out),
            |path| lodsmith_io::write_levels_path(scene, levels, path, &self.options(), relink),
        )?;
        Ok(self.outcome(written, None))
    }

    /// Returns a mesh as a glTF scene, as writing and reading it would give, and the data that glTF cannot
    /// hold.
    pub(crate) fn as_scene(&self, mesh: &TriMesh, regions: Regions) -> anyhow::Result<(Scene, Vec<Warning>)> {
        let mut options = self.mesh_options(regions);
        options.format = Some(Format::Glb);
        options.packing = Packing::default();
        let mut bytes = Vec::new();
        let lost = lodsmith_io::write_to(mesh, Format::Glb, &options, &mut bytes).map_err(flattened_error)?;
        let scene = Scene::read(&bytes, &ReadOptions::default()).map_err(unnamed)?;
        Ok((scene, lost.warnings))
    }

    fn mesh_options(&self, regions: Regions) -> WriteOptions {
        let mut options = self.options();
        options.ascii = self.writing.ascii;
        // What --up rotated has the axes that were asked for: the format adds no rotation of its own.
        let is_rotated = self.writing.up.is_some();
        let axes = |f: Frame| if is_rotated { self.format == Format::ThreeMf } else { f.z_up };
        let frame = regions.frame().map(|f| Frame::new(f.unit, axes(f)));
        options.regions = Some(Arc::new(frame.into_iter().fold(regions, Regions::with_frame)));
        options
    }

    fn options(&self) -> WriteOptions {
        let mut options = WriteOptions::default();
        options.format = Some(self.format);
        options.force = self.writing.force;
        options.textures = self.writing.textures;
        options.packing = self.writing.packing();
        options
    }

    fn put<T>(
        &self,
        to_stream: impl FnOnce(&mut dyn io::Write) -> Result<T, WriteError>,
        to_path: impl FnOnce(&Path) -> Result<T, WriteError>,
    ) -> anyhow::Result<T> {
        if self.dry_run {
            return to_stream(&mut io::sink()).map_err(flattened_error);
        }
        write_with(&self.sink, to_stream, to_path)
    }
}

/// Writes a mesh with options of its own; otherwise like [`Destination::write`].
pub(crate) fn write_mesh(
    mesh: &TriMesh,
    sink: &Sink,
    format: Format,
    options: &WriteOptions,
) -> anyhow::Result<Written> {
    write_with(
        sink,
        |out| lodsmith_io::write_to(mesh, format, options, out),
        |path| lodsmith_io::write_path(mesh, path, options),
    )
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

/// Writes a progressive mesh; otherwise like [`Destination::write`].
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
