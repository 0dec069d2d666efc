//! Jobs as requests to a worker of a page, and its answers.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use lodsmith_io::AssetScope;
use serde::{Deserialize, Serialize};

use super::jobs::{Job, Outcome, PreviewMade, found, inspected, measured, shown_level};
use crate::content::difference::{DifferencePicture, DifferenceSettings, DrawnDifference};
use crate::content::export::{Export, Written};
use crate::content::flaws::Flaws;
use crate::content::parts::{LighterParts, OriginalParts};
use crate::content::slider_preview::LevelChange;
use crate::content::{Distances, Original, TopologySummary};
use crate::gpu::Context;
use crate::gpu::preview_mesh::upload_both;
use crate::gpu::shown::ShownModel;
use crate::job::Failure;
use crate::settings::HeatOf;
use crate::settings::simplification::Simplification;
use crate::stage::export::StageExport;

/// A job without its models, which the worker has or makes.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Request {
    /// The original.
    pub(super) path: PathBuf,
    pub(super) assets: AssetScope,
    /// True if large models come with a preview mesh.
    pub(super) has_light: bool,
    pub(super) task: Box<Task>,
}

/// The work of a request.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Task {
    Open,
    Simplify(Simplification),
    /// Inspects the original, or the result of these options.
    Inspect(Option<Simplification>),
    /// Finds borders and defects of the original, or of the result of these options.
    Flaws(Option<Simplification>),
    Measure(Simplification, HeatOf),
    Difference(Simplification, Box<DifferenceSettings>),
    Levels(Simplification),
    Export {
        how: Simplification,
        source: ExportSource,
        export: Export,
    },
    ExportStage {
        how: Simplification,
        export: Box<StageExport>,
    },
    Preview(Simplification),
    Level(Simplification),
}

/// The model that is exported.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum ExportSource {
    Original,
    /// The result of the options of the task.
    Result,
    /// An automatic level.
    Level(usize),
}

/// The answer to a request.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Answer {
    Opened(Result<Box<OriginalParts>, String>),
    Lighter(Result<Box<LighterParts>, Failure>),
    Topology(TopologySummary),
    Flaws(Flaws),
    Distances(Distances),
    Difference(DrawnDifference),
    Levels(Result<Vec<LighterParts>, Failure>),
    Exported(Result<(Written, Vec<WrittenFile>), String>),
    /// Number of levels of a progressive mesh, and the time to make it in seconds.
    Preview(Result<usize, Failure>, f64),
    Level(LevelChange),
    /// There is no result.
    Nothing,
    /// The original is no longer held.
    Lost(String),
}

/// A file for download.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct WrittenFile {
    pub(super) name: String,
    #[serde(with = "lodsmith_core::wire::plain")]
    pub(super) bytes: Vec<u8>,
}

impl Job {
    /// Returns the request for this job; `None` if workers of a page do not do it. Large models come with a
    /// preview mesh if that is wanted.
    pub(super) fn request(&self, has_light: bool) -> Option<Request> {
        let of = |original: &Original, task| Request {
            path: original.path.clone(),
            assets: original.assets.clone(),
            has_light,
            task: Box::new(task),
        };
        Some(match self {
            Self::Open { path, assets, .. } => {
                Request { path: path.clone(), assets: assets.clone(), has_light, task: Box::new(Task::Open) }
            }
            Self::Simplify { original, how } => of(&original.content, Task::Simplify(how.clone())),
            Self::Inspect { original, result } => {
                of(&original.content, Task::Inspect(result.as_ref().map(|r| r.content.how.clone())))
            }
            Self::Flaws { original, result } => {
                of(&original.content, Task::Flaws(result.as_ref().map(|r| r.content.how.clone())))
            }
            Self::Measure { original, lighter, quantity } => {
                of(&original.content, Task::Measure(lighter.content.how.clone(), *quantity))
            }
            Self::Levels { original, of: (_, how) } => of(&original.content, Task::Levels(how.clone())),
            Self::Export { original, lighter, level, how, export } => {
                let source = match (level, lighter) {
                    (Some(level), _) => ExportSource::Level(*level),
                    (None, Some(_)) => ExportSource::Result,
                    (None, None) => ExportSource::Original,
                };
                let shown = lighter.as_ref().filter(|_| level.is_none());
                let how = shown.map_or(how, |lighter| &lighter.how).clone();
                of(original, Task::Export { how, source, export: export.clone() })
            }
            Self::ExportStage { original, how, export, .. } => {
                of(original, Task::ExportStage { how: how.clone(), export: export.clone() })
            }
            Self::Preview { original, of: (_, how) } => of(original, Task::Preview(how.clone())),
            Self::Level { original, how } => of(original, Task::Level(how.clone())),
            Self::Difference { view, .. } => {
                of(&view.original, Task::Difference(view.lighter.how.clone(), Box::new(view.seen.clone())))
            }
            Self::Benchmark { .. } | Self::Bake { .. } | Self::Shade { .. } => return None,
        })
    }

    /// Returns the outcome of this job for an answer. Files are passed to `save`.
    ///
    /// # Errors
    /// If the answer is not one to this job.
    pub(super) fn outcome(
        self,
        answer: &[u8],
        context: Option<&Context>,
        save: &dyn Fn(&Path, Vec<WrittenFile>),
    ) -> Result<Option<Outcome>, String> {
        let answer: Answer = rmp_serde::from_slice(answer).map_err(|e| e.to_string())?;
        Ok(Some(match (self, answer) {
            (Self::Open { path, assets, .. }, Answer::Opened(result)) => {
                let result = result.map(|parts| {
                    let (original, light) = parts.into_original(path.clone(), assets);
                    let draw = context.map(|c| upload_both(c, original.model(), light.as_ref()));
                    ShownModel { content: Arc::new(original), draw }
                });
                Outcome::Opened { path, result }
            }
            (Self::Simplify { original, how }, Answer::Lighter(result)) => {
                let result = result.map(|parts| {
                    let (lighter, light) = parts.into_lighter(&original.content, how.clone());
                    let draw = context.map(|c| upload_both(c, &lighter.model, light.as_ref()));
                    ShownModel { content: Arc::new(lighter), draw }
                });
                Outcome::Lighter { how, result }
            }
            (Self::Inspect { original, result }, Answer::Topology(topology)) => {
                let (which, key) = inspected(&original, result.as_ref());
                Outcome::Inspected { which, key, topology }
            }
            (Self::Flaws { original, result }, Answer::Flaws(flaws)) => {
                found(&original, result.as_ref(), flaws)
            }
            (Self::Measure { original, lighter, .. }, Answer::Distances(distances)) => {
                Outcome::Measured(measured(&original, &lighter, distances))
            }
            (Self::Difference { view, .. }, Answer::Difference(drawn)) => {
                Outcome::Difference(Arc::new(DifferencePicture { of: *view, drawn }))
            }
            (Self::Levels { original, of }, Answer::Levels(result)) => {
                let shown = |parts: LighterParts| {
                    shown_level(parts.into_lighter(&original.content, of.1.clone()).0, context)
                };
                let result = result.map(|levels| levels.into_iter().map(shown).collect());
                Outcome::Levels { of, result }
            }
            (Self::Export { export: Export { path, .. }, .. }, Answer::Exported(result)) => {
                Outcome::Exported { result: saved(&path, result, save), path }
            }
            (Self::ExportStage { export, .. }, Answer::Exported(result)) => {
                Outcome::Exported { result: saved(&export.path, result, save), path: export.path }
            }
            (Self::Preview { of, .. }, Answer::Preview(result, secs)) => {
                Outcome::Preview { of, secs, result: result.map(PreviewMade::Elsewhere) }
            }
            (Self::Level { how, .. }, Answer::Level(change)) => Outcome::Level { how, change },
            (Self::Open { path, .. }, Answer::Lost(why)) => Outcome::Opened { path, result: Err(why) },
            (_, Answer::Nothing) => return Ok(None),
            (_, Answer::Lost(why)) => return Err(why),
            _ => return Err("the answer of the worker does not fit its request".to_owned()),
        }))
    }
}

fn saved(
    path: &Path,
    result: Result<(Written, Vec<WrittenFile>), String>,
    save: &dyn Fn(&Path, Vec<WrittenFile>),
) -> Result<Written, String> {
    result.map(|(written, files)| {
        save(path, files);
        written
    })
}
