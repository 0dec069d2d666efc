//! Preview of the slider: a progressive mesh that shows any level at once, until the exact run is done.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use lodsmith::{Control, Length, Part, ProgressiveScene, SimplifyError, Stop};
use lodsmith_core::{MeshError, Model, TriMesh};
use lodsmith_io::ModelSource;

use crate::content::{Lighter, Original, diagonal_of, parts_of, placed_meshes};
use crate::gpu::Context;
use crate::option_words::{Normals, Simplification};
use crate::shown::{Drawing, ShownModel};

/// Largest number of triangles for a preview: with more, a jump from end to end would block the window for
/// over 0.1 s. (Measured on horse: about 40 ms of processor time a jump and 0.6 GB at the most for a
/// million.)
pub const MAX_FACES: usize = 2_000_000;

/// Ratio of largest to RMS distance, until a run has measured it for the model. (Measured: 7 to 13 on cow,
/// bunny, nefertiti and spot at errors of 0.5 and 2 % of the diagonal, 9 to 26 at 0.1 %.)
const DEFAULT_PEAK_RATIO: f64 = 8.0;

/// Progressive mesh of a model, with the GPU buffers of the present level.
pub struct SliderPreview {
    scene: ProgressiveScene,
    /// Index of the model's mesh for each part.
    meshes: Vec<usize>,
    diagonal: f64,
    /// The present level, with vertices in the order of the progressive mesh.
    model: Model,
    draw: Option<Drawing>,
    /// True if the normals of the original are shown.
    keeps_normals: bool,
    peak_ratio: f64,
}

impl SliderPreview {
    /// Builds the progressive mesh of a model; the target does not matter.
    ///
    /// # Errors
    /// As [`ProgressiveScene::build`].
    pub fn build(
        original: &Original,
        how: &Simplification,
        context: Option<&Context>,
        control: &mut dyn Control,
    ) -> Result<Self, SimplifyError> {
        let mut options = how.options.clone();
        options.stop = Stop::default();
        let (scene, meshes, diagonal) = match &original.file.source {
            ModelSource::Scene(scene) => {
                let (taken, diagonal) = (placed_meshes(scene), diagonal_of(scene));
                let parts = parts_of(scene);
                (ProgressiveScene::build(&parts, diagonal, &options, control)?, taken, diagonal)
            }
            _ => {
                options.per_mesh = false;
                let mesh: &TriMesh = &original.model().meshes[0].mesh;
                let part = Part { mesh, instances: 1, scale: 1.0, system: None };
                let diagonal = mesh.positions().view().bounds().map_or(0.0, |b| b.diagonal());
                (ProgressiveScene::build(&[part], diagonal, &options, control)?, vec![0], diagonal)
            }
        };
        let keeps_normals = how.normals == Normals::Keep;
        let mut all: Vec<Arc<TriMesh>> = original.model().meshes.iter().map(|m| m.mesh.clone()).collect();
        for (road, &mesh) in scene.meshes().iter().zip(&meshes) {
            all[mesh] = Arc::new(buffers(road, keeps_normals)?);
        }
        let model = original.model().with_meshes(all);
        let draw = context.map(|c| Arc::new(Mutex::new(c.upload(&model))));
        Ok(Self { scene, meshes, diagonal, model, draw, keeps_normals, peak_ratio: DEFAULT_PEAK_RATIO })
    }

    /// Returns the number of levels.
    pub fn levels(&self) -> usize {
        self.scene.top() + 1
    }

    /// Takes over the ratio of largest to RMS distance from a measured run.
    pub fn learn_peak_ratio(&mut self, run: &Lighter) {
        let Some(measured) = run.measured() else { return };
        let peak = measured.hausdorff.symmetric / measured.rms.symmetric;
        if peak.is_finite() && peak >= 1.0 {
            self.peak_ratio = peak;
        }
    }

    /// Goes to the level for a target. Returns `None` if the target is not valid.
    ///
    /// # Errors
    /// [`MeshError`], if a level is not a valid mesh.
    pub fn show(&mut self, how: &Simplification) -> Result<Option<ShownModel<Lighter>>, MeshError> {
        let begin = Instant::now();
        let Some(level) = self.level_for(&how.options.stop) else { return Ok(None) };
        let before: Vec<usize> = self.scene.meshes().iter().map(|r| r.level()).collect();
        let changed = self.scene.to_level(level);
        for (i, (road, changed)) in self.scene.meshes().iter().zip(&changed).enumerate() {
            if road.level() == before[i] {
                continue;
            }
            let (number, mesh) = (self.meshes[i], buffers(road, self.keeps_normals)?);
            if let Some(draw) = &self.draw {
                let mut draw = draw.lock().unwrap_or_else(PoisonError::into_inner);
                draw.patch_mesh(number, &mesh, &changed.faces, &changed.wedges);
            }
            self.model.meshes[number].mesh = Arc::new(mesh);
        }
        let counts = [self.scene.face_count(), self.scene.vertex_count()];
        let seconds = begin.elapsed().as_secs_f64();
        let level = Lighter::of_level(self.model.clone(), counts, self.scene.error(), how, seconds);
        Ok(Some(ShownModel { content: Arc::new(level), draw: self.draw.clone() }))
    }

    fn level_for(&self, stop: &Stop) -> Option<usize> {
        let is_share = |x: f64| x > 0.0 && x.is_finite();
        let error = stop.error.map(|e| e.in_units(self.diagonal) / self.peak_ratio);
        let is_sound = stop.ratio.is_none_or(is_share) && error.is_none_or(is_share);
        let mut stop = *stop;
        stop.error = error.map(Length::Units);
        is_sound.then(|| self.scene.level_of(&stop, self.diagonal))
    }
}

/// Returns the mesh of the present level for drawing.
fn buffers(road: &lodsmith::Progressive, keeps_normals: bool) -> Result<TriMesh, MeshError> {
    let mut mesh = road.fitted_buffers()?;
    if !keeps_normals {
        mesh.set_normals(None)?;
    }
    Ok(mesh)
}
