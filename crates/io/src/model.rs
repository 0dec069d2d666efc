//! A whole file as what is to be seen: [`lodsmith_core::Model`].
//!
//! glTF keeps its nodes, materials, skins and animations; a mesh of another format is a model of one node. Images are
//! decoded. What hinders only the looks (a broken image, a strange animation) is a warning, not an error.

mod decode;
mod plain;

use std::path::Path;
use std::sync::Arc;

use lodsmith_core::Model;

pub use plain::BaseColor;

use crate::error::{ReadError, Warning};
use crate::format::Format;
use crate::gltf::Scene;
use crate::limits::Limits;
use crate::loaded::{Contents, Loaded};
use crate::material::Regions;
use crate::options::ReadOptions;
use crate::read::{read_bytes, read_path, read_scene_bytes, read_scene_path};

pub(crate) use decode::Pictures;

/// A file as a model, with what it takes to write its meshes back.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ModelFile {
    /// What is to be seen. Its meshes are those of the source, in their order.
    pub model: Model,
    /// The format that it was in.
    pub format: Format,
    /// What the file holds.
    pub contents: Contents,
    /// What the user should know, of the file and of its looks.
    pub warnings: Vec<Warning>,
    /// Where the model comes from.
    pub source: ModelSource,
}

/// What a model was made from.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum ModelSource {
    /// A whole glTF file. Lighter meshes go back by [`Scene::write`], in the order of the model's.
    Scene(Box<Scene>),
    /// One mesh: what its regions stand for, for [`WriteOptions::regions`](crate::WriteOptions::regions).
    Mesh(Arc<Regions>),
}

impl Loaded {
    /// The images that give the regions of the mesh their colours (one, where it has none), as materials of its libraries
    /// name them.
    ///
    /// Only base colours are decoded, up to so many pixels together; what is beyond, or cannot be decoded, is left out.
    /// Cost: O(bytes of all images + pixels).
    pub fn base_colors(&self, pixels: u64) -> Vec<Option<BaseColor>> {
        let limits = Limits { pixels: pixels.min(self.limits.pixels), ..self.limits };
        plain::base_colors(&self.mesh, &self.regions, limits)
    }
}

/// Reads a file as a model.
///
/// As [`read_path`] in all else; of glTF and GLB as [`read_scene_path`]. Images that are files are looked for in the folder
/// of the options, else in that of the file. Cost: O(bytes + triangles + pixels).
///
/// # Errors
/// [`ReadError::File`] with the path and the reason. A file without faces is [`ReadError::NoFaces`]; one whose nodes place
/// more faces than a file of its size may is [`ReadError::Limit`], as when it is read as one mesh.
pub fn read_model_path(path: &Path, options: &ReadOptions) -> Result<ModelFile, ReadError> {
    match read_scene_path(path, options)? {
        Some(scene) => of_scene(scene).map_err(|e| e.at(path)),
        None => Ok(read_path(path, options)?.into()),
    }
}

/// Reads bytes as a model.
///
/// # Errors
/// As [`read_model_path`], without a path.
pub fn read_model_bytes(bytes: &[u8], options: &ReadOptions) -> Result<ModelFile, ReadError> {
    match read_scene_bytes(bytes, options)? {
        Some(scene) => of_scene(scene),
        None => Ok(read_bytes(bytes, options)?.into()),
    }
}

fn of_scene(scene: Scene) -> Result<ModelFile, ReadError> {
    scene.check_placed()?;
    let file = ModelFile::from(scene);
    let meshes = || file.model.meshes.iter().map(|m| &m.mesh);
    if meshes().all(|m| m.face_count() == 0) {
        return Err(ReadError::NoFaces { vertices: meshes().map(|m| m.vertex_count()).sum() });
    }
    Ok(file)
}

impl From<Scene> for ModelFile {
    fn from(scene: Scene) -> Self {
        let (model, looks) = scene.model();
        let mut warnings = scene.warnings().to_vec();
        warnings.extend(looks);
        let (format, contents) = (scene.format(), scene.contents().clone());
        Self { model, format, contents, warnings, source: ModelSource::Scene(Box::new(scene)) }
    }
}

impl From<Loaded> for ModelFile {
    fn from(loaded: Loaded) -> Self {
        let Loaded { mesh, format, contents, mut warnings, regions, limits, .. } = loaded;
        let (model, looks) = plain::model(mesh, &regions, limits);
        warnings.extend(looks);
        Self { model, format, contents, warnings, source: ModelSource::Mesh(Arc::new(regions)) }
    }
}
