//! Background jobs: one worker thread with a queue; jobs can be cancelled at any collapse.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

use lodsmith::{Control, Stage, Verdict};
use lodsmith_asset::AssetError;
use lodsmith_asset::warnings::Spelling;
use web_time::Instant;

/// Kind of a job. A new job replaces an older one of the same kind that waits or runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobKind {
    /// Read a file.
    Load,
    /// Simplify the model.
    Simplify,
    /// Count the topology of a model.
    Inspect,
    /// Find borders and defects.
    Flaws,
    /// Measure the distances between result and original.
    Measure,
    /// Write a file.
    Export,
    /// Make the automatic levels.
    Levels,
    /// Benchmark levels.
    Benchmark,
    /// Make the progressive mesh for the slider.
    Preview,
    /// Bake maps for the result.
    Bake,
    /// Draw the difference of the two sides.
    Difference,
    /// Go to a level of a progressive mesh that a worker holds.
    Level,
    /// Shade the edges of the shown models.
    Shade,
}

impl JobKind {
    /// All kinds, in order of priority.
    pub const ALL: [Self; 13] = [
        Self::Load,
        Self::Shade,
        Self::Simplify,
        Self::Export,
        Self::Bake,
        Self::Levels,
        Self::Difference,
        Self::Measure,
        Self::Inspect,
        Self::Flaws,
        Self::Level,
        Self::Preview,
        Self::Benchmark,
    ];

    /// Returns the name that the progress display shows.
    pub fn title(self) -> &'static str {
        match self {
            Self::Load => "Opening",
            Self::Simplify => "Simplifying",
            Self::Inspect => "Inspecting",
            Self::Flaws => "Finding defects",
            Self::Measure => "Measuring",
            Self::Export => "Writing",
            Self::Levels => "Making levels",
            Self::Benchmark => "Running benchmark",
            Self::Preview => "Making the slider instant",
            Self::Bake => "Baking",
            Self::Difference => "Comparing pictures",
            Self::Level => "Showing a level",
            Self::Shade => "Shading edges",
        }
    }

    /// Returns true if a newer job of another kind makes a job of this kind obsolete.
    pub(crate) fn is_obsoleted_by(self, newer: Self) -> bool {
        match newer {
            Self::Load => self != Self::Export,
            // A moved slider does not wait for a benchmark.
            Self::Simplify => {
                matches!(self, Self::Simplify | Self::Bake | Self::Measure | Self::Benchmark)
            }
            _ => self == newer,
        }
    }
}

/// Handle of a running job: reports progress and checks for cancellation.
pub struct JobControl {
    /// Takes progress and the name of the stage; returns false if the job was cancelled.
    report: Box<dyn FnMut(Option<f64>, &'static str) -> bool>,
    last_update: Instant,
    stage: &'static str,
}

/// Time between two progress updates: twelve a second look smooth.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(80);

impl JobControl {
    /// Makes one that calls `report` with the name of the stage and, from time to time, with the progress
    /// from 0 to 1. The job is cancelled once it returns false.
    pub(crate) fn new(report: impl FnMut(Option<f64>, &'static str) -> bool + 'static) -> Self {
        Self { report: Box::new(report), last_update: Instant::now(), stage: "" }
    }

    /// Reports progress from 0 to 1; returns false if the job was cancelled.
    pub fn report(&mut self, done: f64) -> bool {
        let is_due = self.last_update.elapsed() >= PROGRESS_INTERVAL;
        if is_due {
            self.last_update = Instant::now();
        }
        (self.report)(is_due.then_some(done.clamp(0.0, 1.0)), self.stage)
    }
}

impl JobControl {
    /// Names the present step.
    pub fn enter_stage(&mut self, stage: &'static str) {
        self.stage = stage;
        let _ = (self.report)(Some(0.0), stage);
    }
}

impl Control for JobControl {
    fn stage(&mut self, stage: Stage) {
        self.stage = stage.name();
        let _ = self.report(0.0);
    }

    fn progress(&mut self, done: f64) -> Verdict {
        if self.report(done) { Verdict::Continue } else { Verdict::Cancel }
    }
}

/// Progress of the running job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Kind of the job.
    pub kind: JobKind,
    /// Progress of the present stage, from 0 to 1.
    pub done: f32,
    /// Name of the stage, or empty.
    pub stage: &'static str,
}

/// The reason for a run without a result.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) enum Failure {
    /// It was cancelled.
    Cancelled,
    /// An error.
    Error(String),
}

impl lodsmith_asset::Watch for JobControl {}

impl From<AssetError> for Failure {
    fn from(why: AssetError) -> Self {
        match why {
            AssetError::Cancelled => Self::Cancelled,
            why => Self::Error(Spelling::Words.apply(&why.to_string())),
        }
    }
}

struct Shared<M> {
    queue: Mutex<Queue<M>>,
    ready: Condvar,
    done: AtomicU32,
    stage: Mutex<&'static str>,
    wake: Box<dyn Fn() + Send + Sync>,
}

type Work<M> = Box<dyn FnOnce(&mut JobControl) -> Option<M> + Send>;

struct Queue<M> {
    waiting: VecDeque<(JobKind, Work<M>)>,
    running: Option<(JobKind, Arc<AtomicBool>)>,
    watched: Vec<(PathBuf, Option<SystemTime>)>,
    is_ending: bool,
}

impl<M> Queue<M> {
    /// Removes waiting jobs of some kinds, and cancels the running one.
    fn cancel(&mut self, is_cancelled: impl Fn(JobKind) -> bool) {
        self.waiting.retain(|(kind, _)| !is_cancelled(*kind));
        if let Some((_, stop)) = self.running.as_ref().filter(|(kind, _)| is_cancelled(*kind)) {
            stop.store(true, Ordering::Relaxed);
        }
    }
}

/// Worker thread with its queue and the channel of its results.
pub struct Worker<M> {
    shared: Arc<Shared<M>>,
    results: Receiver<Message<M>>,
    thread: Option<JoinHandle<()>>,
}

/// Message of the worker.
pub enum Message<M> {
    /// A job finished.
    Done(M),
    /// A job panicked: a bug.
    Panicked(JobKind),
    /// A job failed: its message.
    Failed(JobKind, String),
    /// A watched file changed on disk.
    Changed(PathBuf),
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // After a panic the data is still consistent: each holder changes it in one step.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Time between two checks of the watched files.
const FILE_CHECK_INTERVAL: Duration = Duration::from_millis(1000);

impl<M: Send + 'static> Worker<M> {
    /// Starts the thread. `wake` is called when there is a message or progress.
    pub fn new(wake: impl Fn() + Send + Sync + 'static) -> Self {
        let queue = Queue { waiting: VecDeque::new(), running: None, watched: Vec::new(), is_ending: false };
        let shared = Arc::new(Shared {
            queue: Mutex::new(queue),
            ready: Condvar::new(),
            done: AtomicU32::new(0),
            stage: Mutex::new(""),
            wake: Box::new(wake),
        });
        let (sender, results) = channel();
        let its_shared = shared.clone();
        let thread = std::thread::Builder::new()
            .name("worker".to_owned())
            .spawn(move || run(&its_shared, &sender))
            .ok();
        Self { shared, results, thread }
    }

    /// Queues a job. Obsolete jobs are removed, or cancelled if they run.
    pub fn submit(&self, kind: JobKind, work: impl FnOnce(&mut JobControl) -> Option<M> + Send + 'static) {
        let mut queue = lock(&self.shared.queue);
        queue.cancel(|old| old.is_obsoleted_by(kind));
        queue.waiting.push_back((kind, Box::new(work)));
        self.shared.ready.notify_one();
    }

    /// Cancels running and waiting jobs of these kinds.
    pub fn cancel(&self, kinds: &[JobKind]) {
        lock(&self.shared.queue).cancel(|kind| kinds.contains(&kind));
    }

    /// Watches these files: a change sends [`Message::Changed`].
    pub fn watch(&self, files: Vec<PathBuf>) {
        let watched = files.into_iter().map(|file| (modified_at(&file), file)).map(|(t, f)| (f, t)).collect();
        lock(&self.shared.queue).watched = watched;
        self.shared.ready.notify_one();
    }

    /// Returns the next message, if there is one.
    pub fn poll(&self) -> Option<Message<M>> {
        self.results.try_recv().ok()
    }

    /// Waits for the next message.
    pub fn wait(&self, at_most: Duration) -> Option<Message<M>> {
        self.results.recv_timeout(at_most).ok()
    }

    /// Returns the progress of the running job.
    pub fn progress(&self) -> Option<Progress> {
        let kind = lock(&self.shared.queue).running.as_ref().map(|r| r.0)?;
        let done = self.shared.done.load(Ordering::Relaxed) as f32 / 1000.0;
        Some(Progress { kind, done, stage: *lock(&self.shared.stage) })
    }

    /// Returns true if a job of this kind waits or runs.
    pub fn is_busy(&self, kind: JobKind) -> bool {
        let queue = lock(&self.shared.queue);
        queue.waiting.iter().any(|w| w.0 == kind)
            || queue
                .running
                .as_ref()
                .is_some_and(|(running, stop)| *running == kind && !stop.load(Ordering::Relaxed))
    }

    /// Returns true if no job waits or runs.
    pub fn is_idle(&self) -> bool {
        let queue = lock(&self.shared.queue);
        queue.waiting.is_empty() && queue.running.is_none()
    }
}

impl<M> Drop for Worker<M> {
    fn drop(&mut self) {
        let mut queue = lock(&self.shared.queue);
        queue.is_ending = true;
        queue.cancel(|_| true);
        drop(queue);
        self.shared.ready.notify_all();
        // File readers cannot be cancelled, so the window does not wait for them.
        if let Some(thread) = self.thread.take().filter(JoinHandle::is_finished) {
            let _ = thread.join();
        }
    }
}

fn run<M: Send + 'static>(shared: &Arc<Shared<M>>, results: &Sender<Message<M>>) {
    loop {
        let mut queue = lock(&shared.queue);
        let next = loop {
            if queue.is_ending {
                return;
            }
            let first = |kind: JobKind| queue.waiting.iter().position(|w| w.0 == kind);
            if let Some(at) = JobKind::ALL.into_iter().find_map(first) {
                break queue.waiting.remove(at);
            }
            queue = if queue.watched.is_empty() {
                shared.ready.wait(queue).unwrap_or_else(PoisonError::into_inner)
            } else {
                let waited = shared.ready.wait_timeout(queue, FILE_CHECK_INTERVAL);
                let (queue, timeout) = waited.unwrap_or_else(PoisonError::into_inner);
                if timeout.timed_out() { check_watched_files(shared, queue, results) } else { queue }
            };
        };
        let Some((kind, job)) = next else { continue };
        let is_stopped = Arc::new(AtomicBool::new(false));
        queue.running = Some((kind, is_stopped.clone()));
        drop(queue);

        shared.done.store(0, Ordering::Relaxed);
        *lock(&shared.stage) = "";
        (shared.wake)();
        let its = shared.clone();
        let mut watch = JobControl::new(move |done, stage| {
            if let Some(done) = done {
                its.done.store((done * 1000.0) as u32, Ordering::Relaxed);
                *lock(&its.stage) = stage;
                (its.wake)();
            }
            !is_stopped.load(Ordering::Relaxed)
        });
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| job(&mut watch)));
        let message = match outcome {
            Ok(done) => done.map(Message::Done),
            Err(_) => Some(Message::Panicked(kind)),
        };
        let mut queue = lock(&shared.queue);
        queue.running = None;
        // While the queue is locked: whoever sees no job finds its message.
        let is_heard = message.is_none_or(|message| results.send(message).is_ok());
        drop(queue);
        if !is_heard {
            return;
        }
        (shared.wake)();
    }
}

/// Checks the watched files. The queue is not locked during the check, since a disk may be slow.
fn check_watched_files<'a, M>(
    shared: &'a Shared<M>,
    queue: MutexGuard<'a, Queue<M>>,
    results: &Sender<Message<M>>,
) -> MutexGuard<'a, Queue<M>> {
    let mut watched = queue.watched.clone();
    drop(queue);
    for changed in changes(&mut watched) {
        let _ = results.send(Message::Changed(changed));
        (shared.wake)();
    }
    let mut queue = lock(&shared.queue);
    let is_same = queue.watched.iter().map(|w| &w.0).eq(watched.iter().map(|w| &w.0));
    if is_same {
        queue.watched = watched;
    }
    queue
}

fn modified_at(path: &PathBuf) -> Option<SystemTime> {
    std::fs::metadata(path).and_then(|about| about.modified()).ok()
}

/// Returns the files whose modification time changed and that still exist.
fn changes(watched: &mut [(PathBuf, Option<SystemTime>)]) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for (path, before) in watched {
        let now = modified_at(path);
        if now.is_some() && now != *before {
            *before = now;
            all.push(path.clone());
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: Duration = Duration::from_secs(20);

    /// Runs until it is cancelled.
    fn endless(watch: &mut JobControl) -> Option<u32> {
        while watch.report(0.5) {
            std::thread::sleep(Duration::from_millis(1));
        }
        None
    }

    fn done(worker: &Worker<u32>) -> Option<u32> {
        match worker.wait(TIMEOUT) {
            Some(Message::Done(n)) => Some(n),
            _ => None,
        }
    }

    #[test]
    fn the_newest_of_a_kind_wins() {
        let worker = Worker::new(|| {});
        worker.submit(JobKind::Simplify, endless);
        for n in 1..5 {
            worker.submit(JobKind::Simplify, move |_| Some(n));
        }
        // Earlier jobs may have finished; the last one comes last.
        while done(&worker) != Some(4) {}
        assert!(worker.wait(Duration::from_millis(20)).is_none());
        assert!(worker.is_idle());
    }

    /// A document was taken as settled before it had the file that it opened.
    #[test]
    fn an_idle_worker_has_sent_its_message() {
        let worker = Worker::new(|| {});
        for n in 0..20_000 {
            worker.submit(JobKind::Load, move |_| Some(n));
            while !worker.is_idle() {
                std::hint::spin_loop();
            }
            assert!(matches!(worker.poll(), Some(Message::Done(m)) if m == n), "{n}");
        }
    }

    #[test]
    fn writing_is_not_stopped_by_simplifying() {
        let worker = Worker::new(|| {});
        let (go, gate) = channel::<()>();
        worker.submit(JobKind::Export, move |watch| {
            let _ = gate.recv_timeout(TIMEOUT);
            watch.report(0.0).then_some(1)
        });
        worker.submit(JobKind::Simplify, |_| Some(2));
        go.send(()).unwrap();
        // In the order in which the thread took them.
        let mut results = [done(&worker), done(&worker)];
        results.sort_unstable();
        assert_eq!(results, [Some(1), Some(2)]);
    }

    #[test]
    fn a_panic_of_a_job_is_reported_and_other_jobs_continue() {
        let worker = Worker::<u32>::new(|| {});
        worker.submit(JobKind::Measure, |_| std::panic::resume_unwind(Box::new("on purpose")));
        assert!(matches!(worker.wait(TIMEOUT), Some(Message::Panicked(JobKind::Measure))));
        worker.submit(JobKind::Measure, |_| Some(3));
        assert_eq!(done(&worker), Some(3));
    }

    #[test]
    fn a_changed_file_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.off");
        std::fs::write(&path, "OFF").unwrap();
        let old = SystemTime::now() - Duration::from_secs(60);
        std::fs::File::options().write(true).open(&path).unwrap().set_modified(old).unwrap();
        let worker = Worker::<u32>::new(|| {});
        worker.watch(vec![path.clone()]);
        std::fs::write(&path, "OFF 2").unwrap();
        assert!(matches!(worker.wait(TIMEOUT), Some(Message::Changed(p)) if p == path));
    }
}
