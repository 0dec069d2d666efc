//! The engine in a worker of a page: does the jobs of a document whose window is elsewhere.

use std::sync::Arc;

use lodsmith_io::{AssetScope, SharedProgress};

use super::jobs::{Job, Outcome, PreviewMade};
use super::wire::{Answer, ExportSource, Request, Task, WrittenFile};
use crate::content::difference::{DifferenceView, SharedSides};
use crate::content::parts::{LighterParts, OriginalParts};
use crate::content::slider_preview::SliderPreview;
use crate::content::{Lighter, Original, level_ratios};
use crate::gpu::shown::ShownModel;
use crate::job::{Failure, JobControl};
use crate::settings::simplification::Simplification;

/// Does the jobs of a document whose window is elsewhere. It keeps the original and its results, and computes again
/// what it does not have; a run always gives the same result.
#[derive(Default)]
pub struct Engine {
    original: Option<Arc<Original>>,
    lighter: Option<Arc<Lighter>>,
    levels: Option<(Simplification, Vec<Arc<Lighter>>)>,
    preview: Option<HeldPreview>,
    /// Models prepared for difference pictures, while these are asked for.
    prepared: SharedSides,
}

struct HeldPreview {
    preview: Box<SliderPreview>,
    /// True if the window has all meshes of the present level.
    has_all_meshes: bool,
}

/// Folder of written files, which are handed to the window.
const OUTPUTS: &str = ".lodsmith-written";

impl Engine {
    /// Returns true if the files of the original have to be there before this request is run.
    pub fn needs_files(&self, request: &str) -> bool {
        let Ok(request) = serde_json::from_str::<Request>(request) else { return false };
        // Textures are copied when a model is written.
        matches!(*request.task, Task::Open | Task::Export { .. } | Task::ExportStage { .. })
            || !self.has_original(&request)
    }

    /// Answers a request. `report` receives progress from 0 to 1 and the stage. To cancel it, end the process.
    pub fn run(&mut self, request: &str, mut report: impl FnMut(f64, &'static str) + 'static) -> Vec<u8> {
        let mut watch = JobControl::new(move |done, stage| {
            done.into_iter().for_each(|done| report(done, stage));
            true
        });
        let answer = match serde_json::from_str(request) {
            Ok(request) => self.answer(request, &mut watch),
            Err(why) => Answer::Lost(why.to_string()),
        };
        rmp_serde::to_vec(&answer).unwrap_or_default()
    }

    fn has_original(&self, request: &Request) -> bool {
        self.original.as_ref().is_some_and(|o| o.path == request.path)
    }

    fn answer(&mut self, request: Request, watch: &mut JobControl) -> Answer {
        let is_open = matches!(*request.task, Task::Open);
        if (is_open || !self.has_original(&request))
            && let Err(why) = self.open(&request, watch)
        {
            return if is_open { Answer::Opened(Err(why)) } else { Answer::Lost(why) };
        }
        let Some(original) = self.original.clone() else { return Answer::Nothing };
        if !matches!(*request.task, Task::Difference(..)) {
            self.prepared = SharedSides::default();
        }
        match *request.task {
            Task::Open => Answer::Opened(Ok(Box::new(OriginalParts::of(&original, request.has_light)))),
            Task::Simplify(how) => {
                let made = self.lighter(&original, &how, watch);
                Answer::Lighter(
                    made.map(|lighter| Box::new(LighterParts::of(&lighter, &original, request.has_light))),
                )
            }
            Task::Level(how) => self.level(&how),
            task => match self.job(original.clone(), task, watch) {
                Ok(job) => match job.run(None, watch) {
                    Some(outcome) => self.answer_of(outcome, &original),
                    None => Answer::Nothing,
                },
                Err(Failure::Cancelled) => Answer::Nothing,
                Err(Failure::Error(why)) => Answer::Lost(why),
            },
        }
    }

    fn open(&mut self, request: &Request, watch: &mut JobControl) -> Result<(), String> {
        // The previous models are freed first.
        *self = Self::default();
        let (path, assets): (_, AssetScope) = (request.path.clone(), request.assets.clone());
        match (Job::Open { path, assets, progress: SharedProgress::default() }).run(None, watch) {
            Some(Outcome::Opened { result, .. }) => self.original = Some(result?.content),
            _ => return Err("opening was cancelled".to_owned()),
        }
        Ok(())
    }

    /// Returns the result of these options.
    fn lighter(
        &mut self,
        original: &Arc<Original>,
        how: &Simplification,
        watch: &mut JobControl,
    ) -> Result<Arc<Lighter>, Failure> {
        if let Some(lighter) = self.lighter.as_ref().filter(|lighter| lighter.how == *how) {
            return Ok(lighter.clone());
        }
        self.lighter = None;
        let made = Arc::new(Lighter::make(original, how, watch)?);
        self.lighter = Some(made.clone());
        Ok(made)
    }

    /// Returns the automatic levels of these options.
    fn levels(
        &mut self,
        original: &Arc<Original>,
        how: &Simplification,
        watch: &mut JobControl,
    ) -> Result<Vec<Arc<Lighter>>, Failure> {
        let mut of = how.clone();
        of.options.stop = lodsmith::Stop::default();
        if self.levels.as_ref().is_none_or(|levels| levels.0 != of) {
            let ratios = level_ratios(original.faces);
            let made = Lighter::chain(original, &of, &ratios, watch)?;
            self.levels = Some((of, made.into_iter().map(Arc::new).collect()));
        }
        Ok(self.levels.as_ref().map(|levels| levels.1.clone()).unwrap_or_default())
    }

    /// Returns the job for a task, with its models.
    fn job(&mut self, original: Arc<Original>, task: Task, watch: &mut JobControl) -> Result<Job, Failure> {
        let key = Arc::as_ptr(&original) as usize;
        Ok(match task {
            Task::Inspect(how) => {
                let result = how.map(|how| self.lighter(&original, &how, watch)).transpose()?;
                Job::Inspect { original: hidden(original), result: result.map(hidden) }
            }
            Task::Flaws(how) => {
                let result = how.map(|how| self.lighter(&original, &how, watch)).transpose()?;
                Job::Flaws { original: hidden(original), result: result.map(hidden) }
            }
            Task::Measure(how, quantity) => {
                let lighter = hidden(self.lighter(&original, &how, watch)?);
                Job::Measure { original: hidden(original), lighter, quantity }
            }
            Task::Difference(how, seen) => {
                let lighter = self.lighter(&original, &how, watch)?;
                let view = Box::new(DifferenceView { original, lighter, seen: *seen });
                Job::Difference { view, prepared: self.prepared.clone() }
            }
            Task::Levels(how) => {
                self.levels = None;
                Job::Levels { original: hidden(original), of: (key, how) }
            }
            Task::Export { how, source, mut export } => {
                let (level, lighter) = match source {
                    ExportSource::Original => (None, None),
                    ExportSource::Result => (None, Some(self.lighter(&original, &how, watch)?)),
                    ExportSource::Level(level) => {
                        let levels = self.levels(&original, &how, watch)?;
                        (Some(level), levels.get(level).cloned())
                    }
                };
                export.path = output_path(&export.path);
                Job::Export { original, lighter, level, how, export }
            }
            Task::ExportStage { how, mut export } => {
                export.path = output_path(&export.path);
                let levels = self.levels(&original, &how, watch)?;
                Job::ExportStage { original, levels, how, export }
            }
            Task::Preview(how) => {
                self.preview = None;
                Job::Preview { original, of: (key, how) }
            }
            Task::Open | Task::Simplify(_) | Task::Level(_) => return Err(Failure::Cancelled),
        })
    }

    /// Returns the answer for the outcome of a job, and keeps what later requests need.
    fn answer_of(&mut self, outcome: Outcome, original: &Original) -> Answer {
        match outcome {
            Outcome::Inspected { topology, .. } => Answer::Topology(topology),
            Outcome::Flaws { flaws, .. } => Arc::into_inner(flaws).map_or(Answer::Nothing, Answer::Flaws),
            Outcome::Measured(measured) => {
                Arc::into_inner(measured.distances).map_or(Answer::Nothing, Answer::Distances)
            }
            Outcome::Difference(picture) => {
                Arc::into_inner(picture).map_or(Answer::Nothing, |picture| Answer::Difference(picture.drawn))
            }
            Outcome::Levels { of, result } => Answer::Levels(result.map(|levels| {
                let parts = levels.iter().map(|l| LighterParts::of(&l.content, original, false)).collect();
                self.levels = Some((of.1, levels.into_iter().map(|l| l.content).collect()));
                parts
            })),
            Outcome::Exported { result, .. } => Answer::Exported(result.map(|written| (written, outputs()))),
            Outcome::Preview { secs, result, .. } => {
                let count = result.map(|made| match made {
                    PreviewMade::Here(preview) => {
                        let count = preview.levels();
                        self.preview = Some(HeldPreview { preview, has_all_meshes: false });
                        count
                    }
                    PreviewMade::Elsewhere(count) => count,
                });
                Answer::Preview(count, secs)
            }
            _ => Answer::Nothing,
        }
    }

    fn level(&mut self, how: &Simplification) -> Answer {
        let Some(HeldPreview { preview, has_all_meshes }) = &mut self.preview else { return Answer::Nothing };
        match preview.go_to(how, !*has_all_meshes) {
            Ok(Some(change)) => {
                *has_all_meshes = true;
                Answer::Level(change)
            }
            Ok(None) => Answer::Nothing,
            Err(why) => Answer::Lost(why.to_string()),
        }
    }
}

/// Returns a model without GPU buffers.
fn hidden<T>(content: Arc<T>) -> ShownModel<T> {
    ShownModel { content, draw: None }
}

/// Returns the path that a file is written to before it is handed to the window.
fn output_path(path: &std::path::Path) -> std::path::PathBuf {
    if !cfg!(target_arch = "wasm32") {
        return path.to_owned();
    }
    // A typed path may start at a root, or leave the folder.
    let plain = path.components().filter(|part| matches!(part, std::path::Component::Normal(_)));
    std::path::Path::new(OUTPUTS).join(plain.collect::<std::path::PathBuf>())
}

/// Removes the written files from memory and returns them. On a system with files they stay on disk.
fn outputs() -> Vec<WrittenFile> {
    #[cfg(target_arch = "wasm32")]
    {
        use lodsmith_io::drive::memory;
        let of = |path: std::path::PathBuf| {
            let name = path.strip_prefix(OUTPUTS).ok()?.to_string_lossy().into_owned();
            Some(WrittenFile { name, bytes: memory::take(&path)?.to_vec() })
        };
        memory::paths().into_iter().filter_map(of).collect()
    }
    #[cfg(not(target_arch = "wasm32"))]
    {
        debug_assert!(!OUTPUTS.is_empty());
        Vec::new()
    }
}
