//! Originals and results as another process receives them.

use std::path::PathBuf;
use std::sync::Arc;

use lodsmith::{MeshCounts, Report};
use lodsmith_core::{Model, TriMesh};
use lodsmith_io::model::ModelFile;
use lodsmith_io::read::Contents;
use lodsmith_io::{AssetScope, Format, Warning};
use serde::{Deserialize, Serialize};

use super::{Lighter, Original, PreparedMeshes};
use crate::gpu::preview_mesh;
use crate::settings::simplification::Simplification;

/// The parts of an original that are shown.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct OriginalParts {
    model: Model,
    format: Format,
    contents: Contents,
    warnings: Vec<Warning>,
    read_secs: f64,
    /// Its preview mesh.
    light: Option<Model>,
}

impl OriginalParts {
    /// Returns the parts of an original, with its preview mesh if that is wanted; meshes and images are shared.
    pub(crate) fn of(original: &Original, has_light: bool) -> Self {
        let file = &original.file;
        Self {
            model: file.model.clone(),
            format: file.format,
            contents: file.contents.clone(),
            warnings: file.warnings.clone(),
            read_secs: original.read_secs,
            light: if has_light { preview_mesh::preview_of(original.model()) } else { None },
        }
    }

    /// Returns an original that can be shown, and its preview mesh.
    pub(crate) fn into_original(self, path: PathBuf, assets: AssetScope) -> (Original, Option<Model>) {
        let file = ModelFile::for_display(self.model, self.format, self.contents, self.warnings);
        (Original { assets, ..Original::of_file(path, file, self.read_secs) }, self.light)
    }
}

/// The parts of a result that differ from its original.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct LighterParts {
    /// The meshes that differ from those of the original.
    meshes: Vec<OwnMesh>,
    faces: usize,
    vertices: usize,
    report: Option<Report>,
    counts: Vec<MeshCounts>,
    seconds: f64,
    warnings: Vec<String>,
    estimate: f64,
    /// All meshes of its preview mesh.
    light: Vec<OwnMesh>,
}

/// A mesh of a result.
#[derive(Debug, Serialize, Deserialize)]
struct OwnMesh {
    /// Its index in the model.
    number: usize,
    #[serde(with = "lodsmith_core::wire::shared")]
    mesh: Arc<TriMesh>,
}

impl LighterParts {
    /// Returns the parts of a result, with its preview mesh if that is wanted; meshes are shared.
    pub(crate) fn of(lighter: &Lighter, original: &Original, has_light: bool) -> Self {
        let light = if has_light { preview_mesh::preview_of(&lighter.model) } else { None };
        let light = light.into_iter().flat_map(|light| light.meshes).enumerate();
        let all = lighter.model.meshes.iter().zip(&original.model().meshes).enumerate();
        let own = all.filter(|(_, (own, old))| !Arc::ptr_eq(&own.mesh, &old.mesh));
        Self {
            meshes: own.map(|(number, (own, _))| OwnMesh { number, mesh: own.mesh.clone() }).collect(),
            faces: lighter.faces,
            vertices: lighter.vertices,
            report: lighter.report.clone(),
            counts: lighter.counts.clone(),
            seconds: lighter.seconds,
            warnings: lighter.warnings.clone(),
            estimate: lighter.estimate,
            light: light.map(|(number, light)| OwnMesh { number, mesh: light.mesh }).collect(),
        }
    }

    /// Returns the result for an original with as many meshes, and its preview mesh.
    pub(crate) fn into_lighter(self, original: &Original, how: Simplification) -> (Lighter, Option<Model>) {
        let light = if self.light.is_empty() { None } else { Some(with_own(original, self.light)) };
        let model = with_own(original, self.meshes);
        let lighter = Lighter {
            prepared: PreparedMeshes::of(&model),
            baked: None,
            largest_estimate: None,
            model,
            faces: self.faces,
            vertices: self.vertices,
            report: self.report,
            counts: self.counts,
            how,
            seconds: self.seconds,
            warnings: self.warnings,
            estimate: self.estimate,
        };
        (lighter, light)
    }
}

/// Returns the model of an original with some meshes replaced.
fn with_own(original: &Original, own: Vec<OwnMesh>) -> Model {
    let mut meshes: Vec<Arc<TriMesh>> = original.model().meshes.iter().map(|m| m.mesh.clone()).collect();
    for own in own {
        if let Some(mesh) = meshes.get_mut(own.number) {
            *mesh = own.mesh;
        }
    }
    original.model().with_meshes(meshes)
}
