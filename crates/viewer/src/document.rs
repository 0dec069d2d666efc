//! The document: open file, results and background work. Does not depend on the window.

mod baking;
mod creases;
mod difference;
mod engine;
mod findings;
mod jobs;
mod levels;
pub mod log;
mod measured;
mod page_queue;
mod preview;
mod queue;
mod stage;
pub mod target_scale;
mod wire;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use glam::DQuat;
use lodsmith_core::mesh::creases::Creases;
use lodsmith_core::model::Pose;
use lodsmith_io::{AssetScope, SharedProgress};
use lodsmith_render::Shading;
use web_time::{Duration, Instant};

use crate::command::{Command, History};
use crate::content::benchmark::{BenchmarkTable, SharedTable};
use crate::content::difference::{DifferencePicture, DifferenceView, SharedSides};
use crate::content::export::Export;
use crate::content::flaws::Flaws;
use crate::content::slider_preview::Preview;
use crate::content::{Lighter, Original, TopologySummary};
use crate::document::log::Log;
use crate::document::target_scale::{OriginalSize, ResultSize};
use crate::gpu::Context;
use crate::gpu::shown::ShownModel;
use crate::job::{Failure, JobKind, Message, Progress};
use crate::numbers::{grouped, seconds};
use crate::page::BrowserPage;
use crate::settings::Settings;
use crate::settings::simplification::Simplification;
use crate::settings::up_axis::UpAxis;

pub use engine::Engine;
use jobs::{Job, Measured, Outcome, READING};
use page_queue::PageQueue;
use queue::{JobQueue, ThreadQueue};
pub use stage::StageLevel;

/// The last difference picture, and models prepared for the next.
#[derive(Default)]
struct DifferenceState {
    last: Option<Arc<DifferencePicture>>,
    prepared: SharedSides,
    /// View of the last job, so that a cancelled or failed one is not begun again.
    asked: Option<DifferenceView>,
}

/// Levels for automatic selection by distance, from the finest, and what they were made from.
struct LevelSet {
    of: (usize, Simplification),
    levels: Vec<ShownModel<Lighter>>,
}

/// A finding about the original and about the result, each with the key of its model.
type OfSides<T> = [Option<(usize, T)>; 2];

/// The document. Only commands change its settings.
pub struct Document {
    settings: Settings,
    history: History,
    worker: Box<dyn JobQueue>,
    /// A second worker for progressive meshes, so that other jobs do not wait for them.
    builder: Box<dyn JobQueue>,
    context: Option<Context>,
    original: Option<ShownModel<Original>>,
    lighter: Option<ShownModel<Lighter>>,
    measured: Option<Measured>,
    /// The last difference picture, and models prepared for the next.
    difference: DifferenceState,
    /// The result without its baked maps.
    without_maps: Option<ShownModel<Lighter>>,
    /// Topology counts of the original and of the result.
    topologies: OfSides<TopologySummary>,
    /// Options of the last job to simplify.
    requested: Option<Simplification>,
    /// The file that is being read, and why.
    opening: Option<Opening>,
    /// Files that could not be read when they were last opened, with the errors.
    broken: BTreeMap<PathBuf, String>,
    /// True if a panel shows distances.
    wants_distances: bool,
    /// Borders and defects of the original and of the result.
    flaws: OfSides<Arc<Flaws>>,
    /// True if borders or defects are shown.
    wants_flaws: bool,
    /// True if a panel shows components and borders.
    wants_topology: bool,
    /// The folder that limits which files a model or a session may name.
    pub assets: AssetScope,
    /// The last error, until a later job succeeds.
    pub problem: Option<String>,
    /// An open file that changed on disk.
    pub changed: Option<PathBuf>,
    /// True if a file changed that the appearance refers to.
    pub own_files_changed: bool,
    /// Log messages.
    pub log: Log,
    watched: Vec<PathBuf>,
    levels: Option<LevelSet>,
    /// Options of the last job to make levels.
    requested_levels: Option<(usize, Simplification)>,
    is_playing: bool,
    /// Benchmark table, and the original it belongs to.
    benchmark: Option<(usize, SharedTable)>,
    /// Progressive mesh that the slider previews from.
    preview: Option<Preview>,
    /// Options of the last job to make a progressive mesh.
    requested_preview: Option<(usize, Simplification)>,
    /// Which edges of the shown models are sharp, or will be once a job is done.
    shaded: Creases,
    /// True while a preview level is shown and the exact run has not been started.
    needs_exact_run: bool,
}

/// A file that is being read, and the action that follows.
struct Opening {
    path: PathBuf,
    then: OpenReason,
    since: Instant,
    read: SharedProgress,
    /// Files that were tried before it, with the errors.
    failed: Vec<(PathBuf, String)>,
}

/// Shadings that are replaced by the intended shading of a newly opened file.
const PLAIN_SHADINGS: [Shading; 3] = [Shading::Smooth, Shading::Textured, Shading::VertexColors];

enum OpenReason {
    Run(Box<Command>),
    Undone,
    Redone,
    Reloaded,
}

impl Document {
    /// Creates an empty document. `wake` is called when there is a new result or progress.
    pub fn new(context: Option<Context>, wake: impl Fn() + Send + Sync + 'static) -> Self {
        let wake = Arc::new(wake);
        let [one, two] = [wake.clone(), wake];
        let worker = ThreadQueue::new(context.clone(), move || one());
        let builder = ThreadQueue::new(context.clone(), move || two());
        Self::with(context, Box::new(worker), Box::new(builder))
    }

    /// Creates an empty document whose work is done by workers of a page. `wake` is called when there is a new
    /// result or progress.
    pub fn on_page(context: Option<Context>, page: &Rc<dyn BrowserPage>, wake: impl Fn() + 'static) -> Self {
        let wake: Rc<dyn Fn()> = Rc::new(wake);
        let queue = || Box::new(PageQueue::new(page.clone(), context.clone(), wake.clone()));
        let (worker, builder) = (queue(), queue());
        let mut new = Self::with(context, worker, builder);
        // Only files that the user handed over are there.
        new.assets = AssetScope::Anywhere;
        new
    }

    fn with(context: Option<Context>, worker: Box<dyn JobQueue>, builder: Box<dyn JobQueue>) -> Self {
        Self {
            settings: Settings::default(),
            history: History::default(),
            worker,
            builder,
            context,
            original: None,
            lighter: None,
            measured: None,
            difference: DifferenceState::default(),
            without_maps: None,
            topologies: [None, None],
            flaws: [None, None],
            wants_flaws: false,
            requested: None,
            opening: None,
            broken: BTreeMap::new(),
            wants_distances: false,
            wants_topology: false,
            assets: AssetScope::Folder,
            problem: None,
            changed: None,
            own_files_changed: false,
            watched: Vec::new(),
            levels: None,
            requested_levels: None,
            is_playing: false,
            benchmark: None,
            preview: None,
            requested_preview: None,
            needs_exact_run: false,
            shaded: Creases::default(),
            log: Log::default(),
        }
    }

    /// Returns the settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
    /// Returns the device, if there is one.
    pub fn context(&self) -> Option<&Context> {
        self.context.as_ref()
    }
    /// Returns the original.
    pub fn original(&self) -> Option<&ShownModel<Original>> {
        self.original.as_ref()
    }
    /// Returns the size of the original.
    pub fn original_size(&self) -> Option<OriginalSize> {
        self.original.as_ref().map(|o| OriginalSize {
            faces: o.content.faces,
            vertices: o.content.vertices,
            diagonal: o.content.bounds.diagonal(),
        })
    }
    /// Returns the size of the latest result.
    pub fn result_size(&self) -> Option<ResultSize> {
        let (whole, result) = (self.original_size()?, &self.lighter.as_ref()?.content);
        let largest = result.measured().map(|m| m.hausdorff.symmetric / whole.diagonal.max(1e-300));
        Some(ResultSize { faces: result.faces, vertices: result.vertices, largest })
    }
    /// Returns the latest result; `None` while the original is requested.
    pub fn lighter(&self) -> Option<&ShownModel<Lighter>> {
        self.lighter.as_ref()
    }
    /// Returns the axis of the model that points up.
    pub fn up(&self) -> UpAxis {
        match self.settings.up {
            UpAxis::Auto => self.original.as_ref().map_or(UpAxis::Y, |o| o.content.guessed_up),
            chosen => chosen,
        }
    }
    /// Sets the axis that was remembered for the open file; this is not an undo step.
    pub fn restore_up(&mut self, up: UpAxis) {
        self.settings.up = up;
    }
    /// Returns the rotation in which the model is shown.
    pub fn rotation(&self) -> DQuat {
        self.settings.turn.rotation() * self.up().rotation()
    }

    /// Returns the pose of the model at the current time.
    pub fn pose(&self) -> Pose {
        let Some(original) = &self.original else { return Pose::default() };
        let playback = self.settings.playback;
        playback.at(self.timeline_secs(), playback.seconds).pose(original.content.model())
    }
    /// Returns true while the animation plays.
    pub fn is_playing(&self) -> bool {
        self.is_playing
    }

    /// Starts or pauses the animation; starts over if it was at its end. Does nothing if there is no
    /// animation.
    pub fn play(&mut self, goes_on: bool) {
        let Some(model) = self.original.as_ref().map(|o| o.content.model()) else { return };
        let has_clips = !model.animations.is_empty();
        let moves_on_stage = self.stage().is_some_and(|s| !s.motion.is_empty());
        if goes_on {
            // No clip is selected: the first one plays.
            let clip = self.settings.playback.clip.filter(|c| *c < model.animations.len());
            self.settings.playback.clip = if moves_on_stage { clip } else { clip.or(Some(0)) };
            self.settings.playback = self.settings.playback.rewound_if_over(self.timeline_secs());
        }
        self.is_playing = goes_on && (moves_on_stage || has_clips);
    }

    /// Advances the animation by the elapsed time.
    pub fn advance_playback(&mut self, elapsed_secs: f64) {
        if self.is_playing {
            let (then, is_over) = self.settings.playback.advanced(self.timeline_secs(), elapsed_secs);
            self.settings.playback = then;
            self.is_playing = !is_over;
        }
    }

    /// Returns the progress of the current job, if there is one.
    pub fn progress(&self) -> Option<Progress> {
        self.worker.progress()
    }
    /// Returns the file that is being read.
    pub fn opening(&self) -> Option<&Path> {
        self.opening.as_ref().map(|o| o.path.as_path())
    }
    /// Returns why a file could not be read when it was last opened; `None` if it could, or was not opened.
    pub fn fault_of(&self, file: &Path) -> Option<&str> {
        self.broken.get(file).map(String::as_str)
    }
    /// Returns for how many seconds a file is being opened, the present step, and the part of it that is done, if that
    /// is known.
    pub fn opening_progress(&self) -> Option<(f64, &'static str, Option<f64>)> {
        let opening = self.opening.as_ref()?;
        let stage = self.progress().map_or("", |p| p.stage);
        let done = opening.read.done().filter(|_| stage == READING);
        Some((opening.since.elapsed().as_secs_f64(), stage, done))
    }
    /// Returns true while the result is older than the settings.
    pub fn is_outdated(&self) -> bool {
        self.needs_exact_run || self.worker.is_busy(JobKind::Simplify)
    }
    /// Returns true if a job of this kind waits or runs.
    pub fn is_busy(&self, kind: JobKind) -> bool {
        self.worker.is_busy(kind)
    }
    /// Returns true if no job waits or runs.
    pub fn is_idle(&self) -> bool {
        !self.needs_exact_run && self.worker.is_idle() && self.builder.is_idle()
    }
    /// Returns the names of the next undo step and the next redo step.
    pub fn history(&self) -> (Option<&'static str>, Option<&'static str>) {
        self.history.names()
    }

    /// Sets which further results are needed: distances, and topology counts.
    pub fn set_wanted_results(&mut self, distances: bool, topology: bool) {
        let before = (self.wants_distances, self.wants_topology);
        (self.wants_distances, self.wants_topology) = (distances, topology);
        if before != (distances, topology) {
            self.sync();
        }
    }

    /// Runs a command. A command that needs another file runs after the file was read. If reading fails, the next of
    /// several files is shown instead; if none can be read, nothing changes.
    pub fn run(&mut self, command: Command) {
        let mut after = self.settings.clone();
        command.apply(&mut after);
        let is_other = after.file() != self.settings.file();
        match after.file().filter(|_| is_other || matches!(command, Command::Open(_))) {
            Some(path) => self.open(path.to_owned(), OpenReason::Run(Box::new(command))),
            None => {
                self.history.run(&command, &mut self.settings);
                self.sync();
            }
        }
    }

    /// Ends a drag: the next command is an undo step of its own, and an exact run replaces a preview level.
    pub fn seal(&mut self) {
        self.history.seal();
        self.start_exact_run();
    }

    /// Starts the exact run for the target if a preview level is shown.
    pub fn start_exact_run(&mut self) {
        if let (true, Some(original), Some(how)) =
            (self.needs_exact_run, self.original.clone(), self.requested.clone())
        {
            self.needs_exact_run = false;
            self.simplify(original, how);
        }
    }

    /// Undoes the last step.
    pub fn undo(&mut self) {
        if self.opening.is_none() && self.history.undo(&mut self.settings) {
            self.follow(OpenReason::Undone);
        }
    }

    /// Redoes the last undone step.
    pub fn redo(&mut self) {
        if self.opening.is_none() && self.history.redo(&mut self.settings) {
            self.follow(OpenReason::Redone);
        }
    }

    /// Rereads the present file.
    pub fn reload(&mut self) {
        self.changed = None;
        if let Some(path) = self.settings.file().map(Path::to_owned) {
            self.open(path, OpenReason::Reloaded);
        }
    }

    /// Exports a model: the automatic level for this error if levels are on, else the result. If only a
    /// preview level is shown, the exact run is made first. If the result has baked maps, a list of levels has them too.
    pub fn export(&mut self, export: Export, level_error: f64) {
        let Some(original) = self.original.as_ref().map(|o| o.content.clone()) else { return };
        let (level, lighter) = match self.levels().is_empty() || !export.levels.is_empty() {
            true => (None, self.lighter.as_ref().map(|l| l.content.clone())),
            false => {
                let (number, level) = self.level_for(level_error);
                (number.checked_sub(1), level.map(|l| l.content.clone()))
            }
        };
        let has_maps = lighter.as_ref().is_some_and(|lighter| lighter.baked.is_some());
        if self.baked().is_some() && !has_maps {
            self.log.warn("the level is written without the baked maps");
        }
        let how = self.settings.simplify.clone();
        self.worker.submit(Job::Export { original, lighter, level, how, export });
    }

    /// Starts a benchmark of the present file, with the present method and shading. Rows are added as they
    /// are measured.
    pub fn benchmark(&mut self) {
        let Some(original) = &self.original else { return };
        let filling = SharedTable::default();
        self.benchmark = Some((original.key(), filling.clone()));
        let (original, settings) = (original.content.clone(), Box::new(self.settings.clone()));
        self.worker.submit(Job::Benchmark { original, settings, filling });
    }

    /// Returns the benchmark table of the present file, as far as it is filled.
    pub fn benchmark_table(&self) -> Option<BenchmarkTable> {
        let of = self.original.as_ref()?.key();
        self.benchmark.as_ref().filter(|b| b.0 == of).map(|b| b.1.table())
    }

    /// Cancels running jobs; the shown result stays.
    pub fn cancel(&mut self) {
        self.worker.stop(&[
            JobKind::Load,
            JobKind::Simplify,
            JobKind::Measure,
            JobKind::Export,
            JobKind::Levels,
            JobKind::Benchmark,
            JobKind::Difference,
            JobKind::Bake,
        ]);
        if self.builder.is_busy(JobKind::Preview) {
            self.builder.stop(&[JobKind::Preview]);
            self.log.note(
                "the slider runs the method for each value: building its progressive mesh was cancelled",
            );
        }
        if self.opening.take().is_some() {
            self.log.note("opening was cancelled");
        }
    }

    /// Takes the results of the workers. Returns true if there were any.
    pub fn poll(&mut self) -> bool {
        let mut is_new = false;
        while let Some(message) = self.worker.poll().or_else(|| self.builder.poll()) {
            self.take(message);
            is_new = true;
        }
        self.drop_unseen_difference();
        self.without_maps.take_if(|_| self.lighter.as_ref().is_none_or(|l| l.content.baked.is_none()));
        if is_new {
            self.sync();
        }
        is_new
    }

    /// Takes results until no job is left or the time is over; returns true if none is left.
    pub fn settle(&mut self, at_most: Duration) -> bool {
        let end = Instant::now() + at_most;
        loop {
            self.poll();
            self.sync();
            self.start_exact_run();
            let left = end.saturating_duration_since(Instant::now());
            if self.is_idle() {
                // Messages sent before the workers became idle.
                if !self.poll() && self.is_idle() {
                    return true;
                }
                continue;
            }
            if left.is_zero() {
                return false;
            }
            let at_work = if self.worker.is_idle() { &self.builder } else { &self.worker };
            if let Some(message) = at_work.wait(left.min(Duration::from_millis(20))) {
                self.take(message);
            }
        }
    }

    fn follow(&mut self, then: OpenReason) {
        let open = self.original.as_ref().map(|o| o.content.path.as_path());
        match self.settings.file() {
            Some(path) if Some(path) != open => self.open(path.to_owned(), then),
            _ => self.sync(),
        }
    }

    fn open(&mut self, path: PathBuf, then: OpenReason) {
        let (since, read, failed) = (Instant::now(), SharedProgress::default(), Vec::new());
        self.try_open(Opening { path, then, since, read, failed });
    }

    fn try_open(&mut self, opening: Opening) {
        let (path, progress) = (opening.path.clone(), opening.read.clone());
        self.shade_new_file();
        self.opening = Some(opening);
        self.worker.submit(Job::Open { path, assets: self.assets.clone(), progress });
    }

    fn take(&mut self, message: Message<Outcome>) {
        match message {
            Message::Done(outcome) => self.take_outcome(outcome),
            Message::Panicked(kind) => {
                self.job_failed(kind, "failed unexpectedly: this is a bug in lodsmith")
            }
            Message::Failed(kind, why) => self.job_failed(kind, &format!("failed: {why}")),
            Message::Changed(path) if self.is_of_look(&path) => self.own_files_changed = true,
            Message::Changed(path) => {
                self.log.note(format!("{} changed on disk", path.display()));
                self.changed = Some(path);
            }
        }
    }

    fn job_failed(&mut self, kind: JobKind, how: &str) {
        let text = format!("{} {how}", kind.title());
        match kind {
            JobKind::Load => self.open_failed(text),
            _ => self.fail(text),
        }
    }

    fn take_outcome(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Opened { path, result } => {
                if self.opening.as_ref().is_none_or(|o| o.path != path) {
                    return;
                }
                match result {
                    Ok(original) => self.opened(original),
                    Err(why) => self.open_failed(why),
                }
            }
            Outcome::Lighter { how, result } => match result {
                Ok(lighter) if self.requested.as_ref() == Some(&how) => {
                    self.problem = None;
                    for warning in &lighter.content.warnings {
                        self.log.warn(warning.clone());
                    }
                    (self.lighter, self.needs_exact_run) = (Some(lighter), false);
                }
                Ok(_) | Err(Failure::Cancelled) => {}
                Err(Failure::Error(why)) => self.fail(why),
            },
            Outcome::Flaws { which, key, flaws } => self.flaws[which] = Some((key, flaws)),
            Outcome::Inspected { which, key, topology } => self.topologies[which] = Some((key, topology)),
            Outcome::Measured(measured) => self.measured = Some(measured),
            Outcome::Baked { before, result } => self.take_baked(before, result),
            Outcome::Difference(picture) => self.take_difference(picture),
            Outcome::Levels { of, result } => match result {
                Ok(levels) => self.levels = Some(LevelSet { of, levels }),
                Err(Failure::Cancelled) => self.requested_levels = None,
                Err(Failure::Error(why)) => self.fail(why),
            },
            Outcome::Benchmarked { is_whole: true } => self.log.good("benchmark finished"),
            Outcome::Benchmarked { is_whole: false } => self.log.note("benchmark cancelled"),
            Outcome::Preview { of, secs, result } => self.take_preview(&of, secs, result),
            Outcome::Level { how, change } => self.take_level(&how, change),
            Outcome::Shaded => self.take_shaded(),
            Outcome::Exported { path, result } => match result {
                Ok(written) => {
                    for warning in &written.warnings {
                        self.log.warn(warning.clone());
                    }
                    self.log.good(format!("wrote {} ({})", path.display(), written.summary));
                    self.problem = None;
                }
                Err(why) => self.fail(why),
            },
        }
    }

    fn opened(&mut self, original: ShownModel<Original>) {
        let Some(Opening { then, path, failed, .. }) = self.opening.take() else { return };
        if let OpenReason::Run(command) = &then {
            self.history.seal();
            self.history.run(command, &mut self.settings);
            // The files before it could not be read.
            let shown = self.settings.files.iter().position(|file| *file == path);
            self.settings.shown = shown.unwrap_or(self.settings.shown);
            let shading = &mut self.settings.look.look.shading;
            // Only plain shadings follow the file; a diagnostic shading stays.
            if matches!(**command, Command::Open(_) | Command::Show(_)) && PLAIN_SHADINGS.contains(shading) {
                *shading = original.content.intended_shading();
            }
            self.history.seal();
        }
        let content = &original.content;
        self.log.good(format!(
            "opened {}: {} faces, {}",
            path.display(),
            grouped(content.faces),
            seconds(content.read_secs)
        ));
        for warning in &content.file.warnings {
            self.log.warn(warning.to_string());
        }
        self.watched.clear();
        (self.problem, self.changed) = (None, None);
        self.broken.remove(&path);
        if !failed.is_empty() {
            let all: Vec<String> = failed.into_iter().map(|(_, why)| why).collect();
            self.problem = Some(all.join("\n"));
        }
        let count = content.non_finite_vertices;
        if count > 0 {
            let text = format!(
                "{} of {} vertices have coordinates that are infinite or not a number; \
                 faces at them are not drawn, and simplifying drops them",
                grouped(count),
                grouped(content.vertices)
            );
            self.log.warn(text.clone());
            self.problem = Some(text);
        }
        self.original = Some(original);
        self.shaded = self.creases();
        self.is_playing &= matches!(then, OpenReason::Reloaded);
        (self.lighter, self.measured, self.requested) = (None, None, None);
        (self.topologies, self.flaws) = ([None, None], [None, None]);
        self.drop_preview();
        self.builder.end_worker();
    }

    /// Handles a failed read: the next file is tried, or what is open stays.
    fn open_failed(&mut self, why: String) {
        let Some(mut opening) = self.opening.take() else { return self.fail(why) };
        self.broken.insert(opening.path.clone(), why.clone());
        opening.failed.push((opening.path.clone(), why.clone()));
        match &opening.then {
            OpenReason::Undone => _ = self.history.redo(&mut self.settings),
            OpenReason::Redone => _ = self.history.undo(&mut self.settings),
            OpenReason::Reloaded => {}
            OpenReason::Run(command) => {
                let mut files = match &**command {
                    Command::Open(files) => files.clone(),
                    Command::Session(settings) => settings.files.clone(),
                    Command::CloseFile(_) => {
                        let mut after = self.settings.clone();
                        command.apply(&mut after);
                        after.files
                    }
                    _ => Vec::new(),
                };
                files.retain(|file| opening.failed.iter().all(|(tried, _)| tried != file));
                if let Some(next) = files.into_iter().next() {
                    self.log.bad(why);
                    return self.try_open(Opening { path: next, read: SharedProgress::default(), ..opening });
                }
            }
        }
        self.log.bad(why);
        if matches!(&opening.then, OpenReason::Run(command) if matches!(**command, Command::CloseFile(_))) {
            // No other file can be shown.
            self.history.run(&Command::Close, &mut self.settings);
            return self.sync();
        }
        let all: Vec<&str> = opening.failed.iter().map(|(_, why)| why.as_str()).collect();
        self.problem = Some(all.join("\n"));
    }

    fn fail(&mut self, why: String) {
        self.log.bad(why.clone());
        self.problem = Some(why);
    }

    /// Starts the jobs that the settings require and that are not done.
    fn sync(&mut self) {
        if self.opening.is_some() {
            return;
        }
        self.watch();
        if self.settings.files.is_empty() {
            (self.original, self.lighter, self.measured, self.requested) = (None, None, None, None);
            self.is_playing = false;
            self.drop_preview();
            self.builder.end_worker();
            return;
        }
        let Some(original) = self.original.clone() else { return };
        let how = &self.settings.simplify;
        if !how.has_target() {
            if self.requested.take().is_some() {
                self.worker.cancel(&[JobKind::Simplify, JobKind::Measure]);
                (self.lighter, self.measured, self.needs_exact_run) = (None, None, false);
            }
        } else if self.requested.as_ref() != Some(how) {
            let how = how.clone();
            self.requested = Some(how.clone());
            self.needs_exact_run = self.show_preview_level(&how);
            if !self.needs_exact_run {
                self.simplify(original.clone(), how);
            }
        }
        self.shade_edges(&original);
        self.start_preview(&original);
        self.make_levels(&original);
        self.find(&original);
        self.measure(&original);
    }

    /// Tells the worker which files to watch.
    fn watch(&mut self) {
        let own = self.settings.look.files();
        let files: Vec<PathBuf> = self.settings.files.iter().chain(own).cloned().collect();
        if files != self.watched {
            self.watched.clone_from(&files);
            self.worker.watch(files);
        }
    }

    fn is_of_look(&self, path: &Path) -> bool {
        self.settings.look.files().any(|own| own == path)
    }

    fn simplify(&mut self, original: ShownModel<Original>, how: Simplification) {
        self.worker.submit(Job::Simplify { original, how });
    }
}
