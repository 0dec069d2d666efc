//! Reading of a whole file for display, as [`lodsmith_core::Model`].
//!
//! glTF keeps its nodes, materials, skins and animations; a mesh of another format is a model of one node.
//! Images are decoded. A problem that affects only the appearance (a broken image, an invalid animation) is a
//! warning, not an error.

mod decode;
mod plain;

use std::path::Path;
use std::sync::Arc;

use lodsmith_core::Model;

pub use plain::BaseColor;

use crate::error::{ReadError, Warning};
use crate::format::Format;
use crate::gltf::Scene;
use crate::loaded::{Contents, Loaded};
use crate::options::ReadOptions;
use crate::read::{read_bytes, read_path, read_scene_bytes, read_scene_path};

pub(crate) use decode::{ImageQueue, decode_image};

/// A file read as a model, with the source data for writing its meshes back.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ModelFile {
    /// The model, with the meshes of the source in their order.
    pub model: Model,
    /// The format of the file.
    pub format: Format,
    /// The contents of the file.
    pub contents: Contents,
    /// Warnings for the user, about the file and about its appearance.
    pub warnings: Vec<Warning>,
    /// The source of the model.
    pub source: ModelSource,
}

/// The source of a model.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum ModelSource {
    /// A whole glTF file. Simplified meshes are written by [`Scene::write`], in the order of the model's
    /// meshes.
    Scene(Arc<Scene>),
    /// One mesh.
    Mesh(Arc<Loaded>),
    /// None here: another process has the source, and writes the files. See [`ModelFile::for_display`].
    Elsewhere,
}

impl ModelFile {
    /// Wraps a model that another process has read. It can be shown but not written.
    pub fn for_display(model: Model, format: Format, contents: Contents, warnings: Vec<Warning>) -> Self {
        Self { model, format, contents, warnings, source: ModelSource::Elsewhere }
    }
}

impl Loaded {
    /// Returns the base colour images of the regions of the mesh (one if it has no regions), as named by the
    /// materials of its libraries.
    ///
    /// Only base colours are decoded. Images that cannot be decoded are left out; so are images that exceed what the
    /// reading limits leave for them (an eighth of the memory), with a warning. Cost: O(bytes of all images + pixels).
    pub fn base_colors(&self) -> (Vec<Option<BaseColor>>, Vec<Warning>) {
        plain::base_colors(&self.mesh, &self.regions, self.limits)
    }
}

/// Reads a file as a model.
///
/// Otherwise like [`read_path`]; for glTF and GLB like [`read_scene_path`]. Image files are searched for in
/// the folder of the options, else in the folder of the file. Cost: O(bytes + triangles + pixels).
///
/// # Errors
/// [`ReadError::File`] with the path and the reason. A file without faces is [`ReadError::NoFaces`]; one
/// whose nodes instantiate more faces than allowed for a file of its size is [`ReadError::Limit`], as when it
/// is read as one mesh.
pub fn read_model_path(path: &Path, options: &ReadOptions) -> Result<ModelFile, ReadError> {
    match read_scene_path(path, options)? {
        Some(scene) => of_scene(scene).map_err(|e| e.at(path)),
        None => Ok(read_path(path, options)?.into()),
    }
}

/// Reads bytes as a model.
///
/// # Errors
/// Like [`read_model_path`], without a path.
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
        let (model, appearance_warnings) = scene.model();
        let mut warnings = scene.warnings().to_vec();
        warnings.extend(appearance_warnings);
        let (format, contents) = (scene.format(), scene.contents().clone());
        Self { model, format, contents, warnings, source: ModelSource::Scene(Arc::new(scene)) }
    }
}

impl From<Loaded> for ModelFile {
    fn from(loaded: Loaded) -> Self {
        let (model, appearance_warnings) = plain::model(loaded.mesh.clone(), &loaded.regions, loaded.limits);
        let (format, contents) = (loaded.format, loaded.contents.clone());
        let warnings = loaded.warnings.iter().cloned().chain(appearance_warnings).collect();
        Self { model, format, contents, warnings, source: ModelSource::Mesh(Arc::new(loaded)) }
    }
}
