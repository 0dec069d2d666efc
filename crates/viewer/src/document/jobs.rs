//! The background jobs of a document as data, and their outcomes.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use lodsmith_core::Model;
use lodsmith_io::{AssetScope, SharedProgress};
use web_time::Instant;

use crate::content::baking::bake_result;
use crate::content::benchmark::SharedTable;
use crate::content::difference::{DifferencePicture, DifferenceView, SharedSides};
use crate::content::export::{Export, Written};
use crate::content::flaws::Flaws;
use crate::content::slider_preview::{LevelChange, SliderPreview};
use crate::content::{Distances, Lighter, Original, TopologySummary, level_ratios};
use crate::gpu::Context;
use crate::gpu::preview_mesh;
use crate::gpu::shown::{Drawing, ShownModel};
use crate::job::{Failure, JobControl, JobKind};
use crate::settings::bake::BakeSettings;
use crate::settings::simplification::Simplification;
use crate::settings::{HeatOf, Settings};
use crate::stage::export::StageExport;

/// Steps of opening a file.
pub(crate) const READING: &str = "reading";
pub(crate) const PREPARING: &str = "loading textures";

/// A job for a worker.
pub(crate) enum Job {
    /// Reads a file.
    Open { path: PathBuf, assets: AssetScope, progress: SharedProgress },
    /// Simplifies the original.
    Simplify { original: ShownModel<Original>, how: Simplification },
    /// Counts the topology of the original, or of a result.
    Inspect { original: ShownModel<Original>, result: Option<ShownModel<Lighter>> },
    /// Finds the borders and defects of the original, or of a result.
    Flaws { original: ShownModel<Original>, result: Option<ShownModel<Lighter>> },
    /// Measures the differences between a result and the original.
    Measure { original: ShownModel<Original>, lighter: ShownModel<Lighter>, quantity: HeatOf },
    /// Bakes maps of a result; its surface has this colour if its file has none.
    Bake { original: Arc<Original>, lighter: ShownModel<Lighter>, settings: BakeSettings, surface: [f32; 3] },
    /// Draws the difference of the two sides.
    Difference { view: Box<DifferenceView>, prepared: SharedSides },
    /// Makes the levels that are chosen by distance.
    Levels { original: ShownModel<Original>, of: (usize, Simplification) },
    /// Writes a model: the automatic level with this index, else the result, else the original.
    Export {
        original: Arc<Original>,
        lighter: Option<Arc<Lighter>>,
        level: Option<usize>,
        how: Simplification,
        export: Export,
    },
    /// Writes the stage.
    ExportStage {
        original: Arc<Original>,
        levels: Vec<Arc<Lighter>>,
        how: Simplification,
        export: Box<StageExport>,
    },
    /// Fills a benchmark table.
    Benchmark { original: Arc<Original>, settings: Box<Settings>, filling: SharedTable },
    /// Makes the progressive mesh of the slider.
    Preview { original: Arc<Original>, of: (usize, Simplification) },
    /// Uploads shown models again, after it changed which of their edges are sharp.
    Shade { shown: Vec<(Drawing, Model)> },
    /// Goes to a level of a progressive mesh that a worker holds.
    Level { original: Arc<Original>, how: Simplification },
}

/// The outcome of a job.
pub(crate) enum Outcome {
    Opened { path: PathBuf, result: Result<ShownModel<Original>, String> },
    Lighter { how: Simplification, result: Result<ShownModel<Lighter>, Failure> },
    Inspected { which: usize, key: usize, topology: TopologySummary },
    Flaws { which: usize, key: usize, flaws: Arc<Flaws> },
    Measured(Measured),
    Baked { before: ShownModel<Lighter>, result: Result<ShownModel<Lighter>, Failure> },
    Difference(Arc<DifferencePicture>),
    Levels { of: (usize, Simplification), result: Result<Vec<ShownModel<Lighter>>, Failure> },
    Exported { path: PathBuf, result: Result<Written, String> },
    Benchmarked { is_whole: bool },
    Preview { of: (usize, Simplification), secs: f64, result: Result<PreviewMade, Failure> },
    Level { how: Simplification, change: LevelChange },
    Shaded,
}

/// A progressive mesh that was made.
pub(crate) enum PreviewMade {
    /// It is here.
    Here(Box<SliderPreview>),
    /// A worker holds it, and has this number of levels.
    Elsewhere(usize),
}

/// Differences, and the two models that were compared.
pub(crate) struct Measured {
    pub(crate) of: (Arc<Original>, Arc<Lighter>),
    pub(crate) distances: Arc<Distances>,
}

impl Job {
    /// Returns the kind of the job.
    pub(crate) fn kind(&self) -> JobKind {
        match self {
            Self::Open { .. } => JobKind::Load,
            Self::Simplify { .. } => JobKind::Simplify,
            Self::Inspect { .. } => JobKind::Inspect,
            Self::Flaws { .. } => JobKind::Flaws,
            Self::Measure { .. } => JobKind::Measure,
            Self::Bake { .. } => JobKind::Bake,
            Self::Difference { .. } => JobKind::Difference,
            Self::Levels { .. } => JobKind::Levels,
            Self::Export { .. } | Self::ExportStage { .. } => JobKind::Export,
            Self::Benchmark { .. } => JobKind::Benchmark,
            Self::Preview { .. } => JobKind::Preview,
            Self::Level { .. } => JobKind::Level,
            Self::Shade { .. } => JobKind::Shade,
        }
    }

    /// Does the job. Models are uploaded to the GPU if there is a context. Returns `None` if it was cancelled and the
    /// document need not react.
    pub(crate) fn run(self, context: Option<&Context>, watch: &mut JobControl) -> Option<Outcome> {
        Some(match self {
            Self::Open { path, assets, progress } => {
                watch.enter_stage(READING);
                let result = Original::read_watched(&path, assets, progress).map_err(|e| e.to_string());
                watch.enter_stage(PREPARING);
                let result = result.map(|original| {
                    let draw = context.map(|c| preview_mesh::upload(c, original.model()));
                    ShownModel { content: Arc::new(original), draw }
                });
                return watch.report(1.0).then_some(Outcome::Opened { path, result });
            }
            Self::Simplify { original, how } => {
                let made = Lighter::make(&original.content, &how, watch);
                let shown = |lighter: Lighter| {
                    let draw = context.map(|c| preview_mesh::upload(c, &lighter.model));
                    ShownModel { content: Arc::new(lighter), draw }
                };
                let result = made.map(shown).map_err(Failure::from);
                Outcome::Lighter { how, result }
            }
            Self::Inspect { original, result } => {
                let (which, key) = inspected(&original, result.as_ref());
                let model = result.as_ref().map_or(original.content.model(), |r| &r.content.model);
                Outcome::Inspected { which, key, topology: TopologySummary::of(model) }
            }
            Self::Flaws { original, result } => {
                let model = result.as_ref().map_or(original.content.model(), |r| &r.content.model);
                let flaws = Flaws::of(model);
                found(&original, result.as_ref(), flaws)
            }
            Self::Measure { original, lighter, quantity } => {
                let (one, two) = (&original.content, &lighter.content);
                let distances = Distances::measure(one, two, quantity, &mut |done| watch.report(done))?;
                Outcome::Measured(measured(&original, &lighter, distances))
            }
            Self::Bake { original, lighter, settings, surface } => {
                let made = bake_result(&original, &lighter.content, &settings, surface, watch);
                let result = made.map(|made| shown_level(made, context));
                Outcome::Baked { before: lighter, result }
            }
            Self::Difference { view, prepared } => {
                let drawn = DifferencePicture::draw(*view, &prepared, &mut |done| watch.report(done));
                // A camera that sees nothing has no picture.
                Outcome::Difference(Arc::new(drawn.ok().flatten()?))
            }
            Self::Levels { original, of } => {
                let ratios = level_ratios(original.content.faces);
                let made = Lighter::chain(&original.content, &of.1, &ratios, watch);
                let shown =
                    |levels: Vec<Lighter>| levels.into_iter().map(|l| shown_level(l, context)).collect();
                Outcome::Levels { of, result: made.map(shown).map_err(Failure::from) }
            }
            Self::Export { original, lighter, how, export, .. } => {
                let path = export.path.clone();
                let is_level =
                    lighter.as_ref().is_some_and(|l| l.report.is_none()) && export.levels.is_empty();
                let made = is_level.then(|| Lighter::make(&original, &how, watch)).transpose();
                let result = made.map_err(|e| e.to_string()).and_then(|made| {
                    let lighter = made.as_ref().or(lighter.as_deref());
                    export.write(&original, lighter, &how, watch).map_err(|e| format!("{e:#}"))
                });
                Outcome::Exported { path, result }
            }
            Self::ExportStage { original, levels, how, export } => {
                let result = export.write(&original, &levels, &how, watch).map_err(|e| format!("{e:#}"));
                Outcome::Exported { path: export.path, result }
            }
            Self::Benchmark { original, settings, filling } => {
                let is_whole = filling.fill(&original, &settings, context.cloned(), watch);
                Outcome::Benchmarked { is_whole }
            }
            Self::Preview { original, of } => {
                let begin = Instant::now();
                let made = SliderPreview::build(&original, &of.1, context, watch);
                let result = made.map(|made| PreviewMade::Here(Box::new(made))).map_err(Failure::from);
                Outcome::Preview { of, secs: begin.elapsed().as_secs_f64(), result }
            }
            Self::Shade { shown } => {
                for (drawing, model) in shown {
                    let Some(new) = context.map(|c| preview_mesh::draw_model(c, &model)) else { continue };
                    // Locked as late as possible: the window draws it until then.
                    *drawing.lock().unwrap_or_else(PoisonError::into_inner) = new;
                }
                Outcome::Shaded
            }
            // The owner of the progressive mesh answers.
            Self::Level { .. } => return None,
        })
    }
}

/// Returns an automatic level for display.
pub(crate) fn shown_level(level: Lighter, context: Option<&Context>) -> ShownModel<Lighter> {
    let draw = context.map(|c| Arc::new(Mutex::new(c.upload(&level.model))));
    ShownModel { content: Arc::new(level), draw }
}

/// Returns the number and the key of an inspected model.
pub(crate) fn inspected(
    original: &ShownModel<Original>,
    result: Option<&ShownModel<Lighter>>,
) -> (usize, usize) {
    result.map_or((0, original.key()), |result| (1, result.key()))
}

/// Writes the lines of borders and defects into the buffers of their model.
pub(crate) fn found(
    original: &ShownModel<Original>,
    result: Option<&ShownModel<Lighter>>,
    flaws: Flaws,
) -> Outcome {
    let (which, key) = inspected(original, result);
    if let Some(drawing) = result.map_or(&original.draw, |r| &r.draw) {
        flaws.show_in(drawing);
    }
    Outcome::Flaws { which, key, flaws: Arc::new(flaws) }
}

/// Shows differences that were measured on both models.
pub(crate) fn measured(
    original: &ShownModel<Original>,
    lighter: &ShownModel<Lighter>,
    distances: Distances,
) -> Measured {
    let quantity = distances.quantity;
    show_heat(original.draw.as_ref(), original.content.model(), &distances.of_original, quantity);
    show_heat(lighter.draw.as_ref(), &lighter.content.model, &distances.of_result, quantity);
    Measured { of: (original.content.clone(), lighter.content.clone()), distances: Arc::new(distances) }
}

/// Writes the values of the heat map into the buffers: distances of vertices, or differences at wedges.
pub(crate) fn show_heat(drawing: Option<&Drawing>, model: &Model, values: &[Vec<f32>], quantity: HeatOf) {
    let Some(drawing) = drawing else { return };
    for (i, (mesh, values)) in model.meshes.iter().zip(values).enumerate() {
        let mesh = &mesh.mesh;
        let of_wedges: Vec<f32> = match mesh.vertex_map() {
            Some(map) if quantity == HeatOf::Distance => map.iter().map(|v| values[v.index()]).collect(),
            _ => values.clone(),
        };
        drawing.lock().unwrap_or_else(PoisonError::into_inner).set_heat(i, Some(&of_wedges));
    }
}
