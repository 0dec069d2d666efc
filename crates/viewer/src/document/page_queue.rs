//! A queue whose jobs are done by a worker of a page.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::path::Path;
use std::rc::Rc;

use lodsmith::Stage;
use web_time::{Duration, Instant};

use super::jobs::{Job, Outcome, PREPARING, READING};
use super::queue::JobQueue;
use super::wire::WrittenFile;
use crate::gpu::Context;
use crate::job::{JobControl, JobKind, Message, Progress};
use crate::page::{BrowserPage, PageWorker, WorkerMessage};

/// The queue.
pub(super) struct PageQueue {
    page: Rc<dyn BrowserPage>,
    context: Option<Context>,
    wake: Rc<dyn Fn()>,
    state: RefCell<State>,
}

#[derive(Default)]
struct State {
    worker: Option<Box<dyn PageWorker>>,
    waiting: Vec<Job>,
    running: Option<Running>,
    ready: VecDeque<Message<Outcome>>,
}

struct Running {
    job: Job,
    /// True if its outcome will be discarded.
    is_dropped: bool,
    since: Instant,
    progress: Progress,
}

/// Time after which a discarded job is ended together with its worker. Before that the queue waits for it, since a
/// new worker has to read the file again. Guessed.
const PATIENCE: Duration = Duration::from_millis(1500);

impl PageQueue {
    /// Makes a queue; its worker is started with the first job. `wake` is called when there is a message or
    /// progress.
    pub(super) fn new(page: Rc<dyn BrowserPage>, context: Option<Context>, wake: Rc<dyn Fn()>) -> Self {
        Self { page, context, wake, state: RefCell::default() }
    }

    /// Does a job at once, without a worker.
    fn do_here(&self, job: Job) {
        let outcome = job.run(self.context.as_ref(), &mut JobControl::new(|_, _| true));
        self.state.borrow_mut().ready.extend(outcome.map(Message::Done));
    }

    /// Starts the next job if none runs.
    fn go_on(&self, state: &mut State) {
        let is_too_slow = |r: &Running| r.is_dropped && r.since.elapsed() > PATIENCE;
        if !state.waiting.is_empty() && state.running.as_ref().is_some_and(is_too_slow) {
            state.end_worker();
        }
        while state.running.is_none() {
            let first = |kind| state.waiting.iter().position(|job| job.kind() == kind);
            let Some(at) = JobKind::ALL.into_iter().find_map(first) else { return };
            let job = state.waiting.remove(at);
            let has_light = self.context.as_ref().is_some_and(Context::is_software);
            let Some(text) = job.request(has_light).and_then(|request| serde_json::to_string(&request).ok())
            else {
                let why = "it is not available in a browser".to_owned();
                state.ready.push_back(Message::Failed(job.kind(), why));
                continue;
            };
            let wake = self.wake.clone();
            let worker = state.worker.get_or_insert_with(|| self.page.start_worker(Box::new(move || wake())));
            worker.post(&text);
            let progress = Progress { kind: job.kind(), done: 0.0, stage: "" };
            state.running = Some(Running { job, is_dropped: false, since: Instant::now(), progress });
        }
    }

    /// Offers the files of an export: one as it is, several in one folder.
    fn save(&self, path: &Path, files: Vec<WrittenFile>) {
        match files.as_slice() {
            [file] => self.page.save(&file.name, &file.bytes),
            files => {
                let stem = path.file_stem().map_or("lodsmith".into(), |s| s.to_string_lossy());
                let all: Vec<_> = files.iter().map(|f| (f.name.as_str(), f.bytes.as_slice())).collect();
                self.page.save_all(&stem, &all);
            }
        }
    }
}

impl JobQueue for PageQueue {
    fn submit(&self, job: Job) {
        // The buffers are in this process.
        if matches!(job, Job::Shade { .. }) {
            return self.do_here(job);
        }
        let kind = job.kind();
        let mut state = self.state.borrow_mut();
        state.waiting.retain(|old| !old.kind().is_obsoleted_by(kind));
        if let Some(running) = state.running.as_mut().filter(|r| r.job.kind().is_obsoleted_by(kind)) {
            // Each change of level builds on the one before.
            running.is_dropped |= kind != JobKind::Level;
        }
        state.waiting.push(job);
        self.go_on(&mut state);
    }

    fn cancel(&self, kinds: &[JobKind]) {
        let mut state = self.state.borrow_mut();
        state.waiting.retain(|job| !kinds.contains(&job.kind()));
        if let Some(running) = state.running.as_mut().filter(|r| kinds.contains(&r.job.kind())) {
            running.is_dropped = true;
        }
        self.go_on(&mut state);
    }

    fn stop(&self, kinds: &[JobKind]) {
        self.cancel(kinds);
        let mut state = self.state.borrow_mut();
        if state.running.as_ref().is_some_and(|r| kinds.contains(&r.job.kind())) {
            state.end_worker();
        }
        self.go_on(&mut state);
    }

    fn end_worker(&self) {
        self.state.borrow_mut().end_worker();
    }

    fn poll(&self) -> Option<Message<Outcome>> {
        let mut state = self.state.borrow_mut();
        while let Some(message) = state.worker.as_ref().and_then(|worker| worker.poll()) {
            match message {
                WorkerMessage::Progress(done, stage) => {
                    if let Some(running) = &mut state.running {
                        (running.progress.done, running.progress.stage) = (done as f32, stage_named(&stage));
                    }
                }
                WorkerMessage::Answer(bytes) => {
                    let Some(running) = state.running.take() else { continue };
                    // Each change of level builds on the one before, so none is left out.
                    if !running.is_dropped || running.job.kind() == JobKind::Level {
                        let kind = running.job.kind();
                        let save = |path: &Path, files| self.save(path, files);
                        match running.job.outcome(&bytes, self.context.as_ref(), &save) {
                            Ok(outcome) => state.ready.extend(outcome.map(Message::Done)),
                            Err(why) => state.ready.push_back(Message::Failed(kind, why)),
                        }
                    }
                }
                WorkerMessage::Failed(why) => {
                    state.worker = None;
                    if let Some(running) = state.running.take() {
                        state.ready.push_back(Message::Failed(running.job.kind(), why));
                    }
                }
            }
        }
        self.go_on(&mut state);
        state.ready.pop_front()
    }

    fn progress(&self) -> Option<Progress> {
        self.state.borrow().running.as_ref().filter(|r| !r.is_dropped).map(|r| r.progress)
    }

    fn is_busy(&self, kind: JobKind) -> bool {
        let state = self.state.borrow();
        state.waiting.iter().any(|job| job.kind() == kind)
            || state.running.as_ref().is_some_and(|r| r.job.kind() == kind && !r.is_dropped)
    }

    fn is_idle(&self) -> bool {
        let state = self.state.borrow();
        state.waiting.is_empty() && state.running.is_none() && state.ready.is_empty()
    }

    fn is_elsewhere(&self) -> bool {
        true
    }
}

impl State {
    fn end_worker(&mut self) {
        (self.worker, self.running) = (None, None);
    }
}

/// Returns the name of a stage as a constant; empty if there is none of this name.
fn stage_named(name: &str) -> &'static str {
    let all = [Stage::Prepare, Stage::Collapse, Stage::Fit, Stage::Measure].map(Stage::name);
    all.into_iter().chain([READING, PREPARING]).find(|known| *known == name).unwrap_or("")
}
