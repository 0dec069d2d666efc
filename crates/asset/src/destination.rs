//! Outputs, and options of writing them.

use std::io;
use std::path::Path;
use std::sync::Arc;

use lodsmith_core::TriMesh;
use lodsmith_io::gltf::{Packing, Scene, SceneFormat, SceneLevels, Written};
use lodsmith_io::{Format, Frame, Regions, Sizes, Textures, WriteError, WriteOptions};

use crate::error::AssetError;
use crate::job::Job;
use crate::paths::Sink;
use crate::sizes::{self, WriteOutcome};

/// The axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// y, as in glTF.
    Y,
    /// z, as in STL and 3MF.
    Z,
}

impl Up {
    /// All axes.
    pub const ALL: [Self; 2] = [Self::Y, Self::Z];

    /// Returns the name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Y => "y",
            Self::Z => "z",
        }
    }
}

/// Options of writing a result.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Writing {
    /// Write text instead of binary (PLY, STL).
    pub ascii: bool,
    /// Treatment of material and texture files.
    pub textures: Textures,
    /// Compression of glTF and GLB.
    pub packing: Packing,
    /// Factor for all coordinates.
    pub scale: Option<f64>,
    /// The axis that points up in the output, after a rotation about x.
    pub up: Option<Up>,
    /// Also replace inputs and write-protected files.
    pub force: bool,
}

impl Writing {
    /// True if coordinates are changed.
    pub const fn moves(&self) -> bool {
        self.scale.is_some() || self.up.is_some()
    }

    /// Returns the options of a writer of scenes.
    fn options(&self, format: Format) -> WriteOptions {
        let mut options = WriteOptions::default();
        options.format = Some(format);
        options.force = self.force;
        options.textures = self.textures;
        options.packing = self.packing;
        options
    }

    /// Returns the options of a writer of meshes.
    pub(crate) fn mesh_options(&self, format: Format, regions: Regions) -> WriteOptions {
        let mut options = self.options(format);
        options.ascii = self.ascii;
        // After --up, the mesh has the requested axes: the format must not rotate it again.
        let axes = |f: Frame| if self.up.is_some() { format == Format::ThreeMf } else { f.z_up };
        let frame = regions.frame().map(|f| Frame::new(f.unit, axes(f)));
        options.regions = Some(Arc::new(frame.into_iter().fold(regions, Regions::with_frame)));
        options
    }
}

/// The output for an input: its place, format and options of writing.
#[derive(Clone, Debug)]
pub struct Destination {
    /// The file or standard output.
    pub sink: Sink,
    /// The format.
    pub format: Format,
    /// Options of writing.
    pub writing: Writing,
    /// Write nothing; losses are reported nevertheless.
    pub dry_run: bool,
}

impl Destination {
    /// Returns true if a scene stays a scene: the format has scenes, and the scene is not rotated or scaled, which
    /// would need changes of nodes, animations and skins in glTF. In 3MF, the items of the build are moved.
    pub fn keeps_scenes(&self) -> bool {
        self.format == Format::ThreeMf || (self.format.keeps_scenes() && !self.writing.moves())
    }

    /// Returns true if materials are written.
    pub(crate) fn keeps_materials(&self) -> bool {
        matches!(self.format, Format::Obj | Format::Gltf | Format::Glb | Format::ThreeMf)
            && self.writing.textures != Textures::None
    }

    /// Returns true if files with names from the input are written beside the output: other results may have files with
    /// the same names.
    fn shares_names(&self, regions: &Regions) -> bool {
        self.format == Format::Obj && !regions.libraries().is_empty() && !self.dry_run
    }

    /// Writes a mesh; returns warnings about data that the format cannot store, and sizes. Never leaves a partial file.
    ///
    /// # Errors
    /// [`AssetError::Write`], [`AssetError::Stream`]; [`AssetError::Cancelled`] if the caller ends.
    pub fn write(
        &self,
        mesh: &TriMesh,
        regions: Regions,
        job: &mut Job<'_>,
    ) -> Result<WriteOutcome, AssetError> {
        // If two textures have the same name, the texture of the earlier input keeps it.
        if self.shares_names(&regions) {
            job.wait_for_earlier();
        }
        let of_mesh = sizes::of_mesh(mesh, &regions, self.keeps_materials());
        let mut options = self.writing.mesh_options(self.format, regions);
        if let (true, Sink::Path(path)) = (self.dry_run, &self.sink) {
            options.beside = Some(path.clone());
        }
        let written = self.put(
            job,
            |out| lodsmith_io::write_to(mesh, self.format, &options, out),
            |path| lodsmith_io::write_path(mesh, path, &options),
        )?;
        Ok(self.outcome(written, Some(of_mesh)))
    }

    fn outcome(&self, written: Written, of_mesh: Option<Sizes>) -> WriteOutcome {
        let of_mesh = of_mesh.or(written.sizes);
        WriteOutcome::new(written, Some(&self.sink).filter(|_| !self.dry_run), of_mesh)
    }

    /// Like [`write`](Self::write), for a scene with some meshes replaced, and with other names for the files that it
    /// refers to.
    pub(crate) fn write_scene(
        &self,
        scene: &Scene,
        replaced: &[Option<TriMesh>],
        relink: &dyn Fn(&str) -> Option<String>,
        job: &mut Job<'_>,
    ) -> Result<WriteOutcome, AssetError> {
        let mut to = SceneFormat::new(self.format, self.writing.packing);
        to.textures = self.writing.textures;
        let written = self.put(
            job,
            |out| lodsmith_io::write_scene_to(scene, replaced, to, relink, out),
            |path| {
                lodsmith_io::write_scene_path(
                    scene,
                    replaced,
                    path,
                    &self.writing.options(self.format),
                    relink,
                )
            },
        )?;
        Ok(self.outcome(written, None))
    }

    /// Like [`write_scene`](Self::write_scene), with levels of detail.
    pub(crate) fn write_levels(
        &self,
        scene: &Scene,
        levels: &SceneLevels,
        relink: &dyn Fn(&str) -> Option<String>,
        job: &mut Job<'_>,
    ) -> Result<WriteOutcome, AssetError> {
        let to = SceneFormat::new(self.format, self.writing.packing);
        let written = self.put(
            job,
            |out| lodsmith_io::write_levels_to(scene, levels, to, relink, out),
            |path| {
                lodsmith_io::write_levels_path(
                    scene,
                    levels,
                    path,
                    &self.writing.options(self.format),
                    relink,
                )
            },
        )?;
        Ok(self.outcome(written, None))
    }

    fn put<T>(
        &self,
        job: &mut Job<'_>,
        to_stream: impl FnOnce(&mut dyn io::Write) -> Result<T, WriteError>,
        to_path: impl FnOnce(&Path) -> Result<T, WriteError>,
    ) -> Result<T, AssetError> {
        if self.dry_run {
            return Ok(to_stream(&mut io::sink())?);
        }
        job.put(&self.sink, to_stream, to_path)
    }
}
