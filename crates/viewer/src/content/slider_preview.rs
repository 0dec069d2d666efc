//! Preview of the slider: a progressive mesh that shows any level at once, until the exact run is done.

mod level_distances;

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use lodsmith::{Control, Effort, Length, OwnedMeshData, ProgressiveScene, Stop};
use lodsmith_asset::{AssetError, Normals};
use lodsmith_core::{MeshError, Model, TriMesh};
use serde::{Deserialize, Serialize};
use web_time::Instant;

use crate::content::slider_preview::level_distances::LevelDistances;
use crate::content::{Lighter, Original};
use crate::gpu::Context;
use crate::gpu::shown::{Drawing, ShownModel};
use crate::settings::simplification::Simplification;

/// Largest number of triangles for a preview: with more, a jump from end to end would block the window for
/// over 0.1 s. (Measured on horse: about 40 ms of processor time a jump and 0.6 GB at the most for a
/// million.)
pub const MAX_FACES: usize = 2_000_000;

/// Progressive mesh of a model, with the GPU buffers of the present level.
pub struct SliderPreview {
    scene: ProgressiveScene,
    /// Index of the model's mesh for each part.
    meshes: Vec<usize>,
    diagonal: f64,
    /// The present level, with vertices in the order of the progressive mesh.
    view: LevelView,
    /// True if the normals of the original are shown.
    keeps_normals: bool,
    distances: LevelDistances,
}

/// The present level of a progressive mesh on the screen.
pub struct LevelView {
    model: Model,
    draw: Option<Drawing>,
}

/// The step from one level of a progressive mesh to another.
#[derive(Debug, Serialize, Deserialize)]
pub struct LevelChange {
    /// The meshes that differ.
    meshes: Vec<ChangedMesh>,
    /// Number of triangles and vertices over all mesh instances.
    counts: [usize; 2],
    /// Estimates of the RMS and of the largest distance from the original.
    estimates: [f64; 2],
    /// Time to make it in seconds.
    seconds: f64,
}

/// A mesh of a level, and the ranges of its triangles and wedges that differ from the level before.
#[derive(Debug, Serialize, Deserialize)]
struct ChangedMesh {
    /// Index of the model's mesh.
    number: usize,
    #[serde(with = "lodsmith_core::wire::shared")]
    mesh: Arc<TriMesh>,
    faces: Vec<Range<usize>>,
    wedges: Vec<Range<usize>>,
}

impl SliderPreview {
    /// Builds the progressive mesh of a model and measures some of its levels; target and effort do not matter.
    ///
    /// # Errors
    /// As [`ProgressiveScene::build`]; [`AssetError::Cancelled`].
    pub fn build(
        original: &Original,
        how: &Simplification,
        context: Option<&Context>,
        control: &mut dyn Control,
    ) -> Result<Self, AssetError> {
        let mut options = how.options.clone();
        (options.stop, options.effort) = (Stop::default(), Effort::Default);
        let asset = original.asset()?;
        options.per_mesh &= asset.scene().is_some();
        let (meshes, diagonal) = (asset.simplified_meshes(), asset.diagonal());
        let data = vec![OwnedMeshData::default(); meshes.len()];
        let mut scene = ProgressiveScene::build(&asset.parts(&data), diagonal, &options, control)?;
        let distances = LevelDistances::measure(&mut scene, original, &meshes, control)?;
        let keeps_normals = how.normals == Normals::Keep;
        let mut all: Vec<Arc<TriMesh>> = original.model().meshes.iter().map(|m| m.mesh.clone()).collect();
        for (progressive, &mesh) in scene.meshes().iter().zip(&meshes) {
            all[mesh] = Arc::new(buffers(progressive, keeps_normals)?);
        }
        let model = original.model().with_meshes(all);
        let view = LevelView::new(model, context);
        Ok(Self { scene, meshes, diagonal, view, keeps_normals, distances })
    }

    /// Returns the number of levels.
    pub fn levels(&self) -> usize {
        self.scene.top() + 1
    }

    /// Goes to the level for a target. Returns `None` if the target is not valid.
    ///
    /// # Errors
    /// [`MeshError`], if a level is not a valid mesh.
    pub fn show(&mut self, how: &Simplification) -> Result<Option<ShownModel<Lighter>>, MeshError> {
        let change = self.go_to(how, false)?;
        Ok(change.map(|change| self.view.apply(change, how, None)))
    }

    /// Goes to the level for a target. Returns the change that shows it, with all meshes if `is_whole`; `None` if the
    /// target is not valid.
    ///
    /// # Errors
    /// [`MeshError`], if a level is not a valid mesh.
    pub(crate) fn go_to(
        &mut self,
        how: &Simplification,
        is_whole: bool,
    ) -> Result<Option<LevelChange>, MeshError> {
        let begin = Instant::now();
        let Some(level) = self.level_for(&how.options.stop) else { return Ok(None) };
        let before: Vec<usize> = self.scene.meshes().iter().map(|r| r.level()).collect();
        let changed = self.scene.to_level(level);
        let mut meshes = Vec::new();
        for (i, (progressive, changed)) in self.scene.meshes().iter().zip(changed).enumerate() {
            if is_whole || progressive.level() != before[i] {
                let (number, mesh) = (self.meshes[i], Arc::new(buffers(progressive, self.keeps_normals)?));
                meshes.push(ChangedMesh { number, mesh, faces: changed.faces, wedges: changed.wedges });
            }
        }
        let (counts, rms) = ([self.scene.face_count(), self.scene.vertex_count()], self.scene.error());
        let estimates = [rms, self.distances.largest_at(rms)];
        Ok(Some(LevelChange { meshes, counts, estimates, seconds: begin.elapsed().as_secs_f64() }))
    }

    fn level_for(&self, stop: &Stop) -> Option<usize> {
        let is_share = |x: f64| x > 0.0 && x.is_finite();
        let error = stop.error.map(|e| self.distances.rms_within(e.in_units(self.diagonal)));
        let is_sound = stop.ratio.is_none_or(is_share) && error.is_none_or(is_share);
        let mut stop = *stop;
        stop.error = error.map(Length::Units);
        is_sound.then(|| self.scene.level_of(&stop, self.diagonal))
    }
}

impl LevelView {
    /// Makes a view of a model.
    pub(crate) fn new(model: Model, context: Option<&Context>) -> Self {
        let draw = context.map(|c| Arc::new(Mutex::new(c.upload(&model))));
        Self { model, draw }
    }

    /// Shows the next level. If the view has not been uploaded yet and there is a context, it is now.
    pub(crate) fn apply(
        &mut self,
        change: LevelChange,
        how: &Simplification,
        context: Option<&Context>,
    ) -> ShownModel<Lighter> {
        for changed in change.meshes {
            if let Some(draw) = &self.draw {
                let mut draw = draw.lock().unwrap_or_else(PoisonError::into_inner);
                draw.patch_mesh(changed.number, &changed.mesh, &changed.faces, &changed.wedges);
            }
            self.model.meshes[changed.number].mesh = changed.mesh;
        }
        if let (None, Some(context)) = (&self.draw, context) {
            self.draw = Some(Arc::new(Mutex::new(context.upload(&self.model))));
        }
        let LevelChange { counts, estimates: [rms, largest], seconds, .. } = change;
        let mut level = Lighter::of_level(self.model.clone(), counts, rms, how, seconds);
        level.largest_estimate = Some(largest);
        ShownModel { content: Arc::new(level), draw: self.draw.clone() }
    }
}

/// The progressive mesh of the slider.
pub(crate) enum Preview {
    /// In this process: it goes to a level at once.
    Here(Box<SliderPreview>),
    /// In another process, which sends the changes.
    Elsewhere(LevelView),
}

/// Returns the mesh of the present level for drawing.
fn buffers(progressive: &lodsmith::Progressive, keeps_normals: bool) -> Result<TriMesh, MeshError> {
    let mut mesh = progressive.fitted_buffers()?;
    if !keeps_normals {
        mesh.set_normals(None)?;
    }
    Ok(mesh)
}
