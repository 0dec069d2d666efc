//! Queues of the jobs of a document.

use std::path::PathBuf;

use web_time::Duration;

use super::jobs::{Job, Outcome};
use crate::gpu::Context;
use crate::job::{JobKind, Message, Progress, Worker};

/// A queue of jobs that run one after another, outside the thread of the window.
pub(super) trait JobQueue {
    /// Queues a job. Obsolete jobs are removed, or cancelled if they run.
    fn submit(&self, job: Job);
    /// Cancels running and waiting jobs of these kinds.
    fn cancel(&self, kinds: &[JobKind]);
    /// Cancels jobs at the user's request, even if a worker and its models are lost.
    fn stop(&self, kinds: &[JobKind]) {
        self.cancel(kinds);
    }
    /// Ends a worker of a page, which holds the model of a file that is no longer open.
    fn end_worker(&self) {}
    /// Watches these files: a change sends [`Message::Changed`]. Files of a page do not change.
    fn watch(&self, _files: Vec<PathBuf>) {}
    /// Returns the next message, if there is one.
    fn poll(&self) -> Option<Message<Outcome>>;
    /// Waits for the next message. (A page cannot wait.)
    fn wait(&self, _at_most: Duration) -> Option<Message<Outcome>> {
        self.poll()
    }
    /// Returns the progress of the running job.
    fn progress(&self) -> Option<Progress>;
    /// Returns true if a job of this kind waits or runs.
    fn is_busy(&self, kind: JobKind) -> bool;
    /// Returns true if no job waits or runs.
    fn is_idle(&self) -> bool;
    /// Returns true if jobs run in another process, which does not have the levels of the slider.
    fn is_elsewhere(&self) -> bool {
        false
    }
}

/// A queue on a thread.
pub(super) struct ThreadQueue {
    worker: Worker<Outcome>,
    context: Option<Context>,
}

impl ThreadQueue {
    /// Starts the thread. `wake` is called when there is a message or progress.
    pub(super) fn new(context: Option<Context>, wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self { worker: Worker::new(wake), context }
    }
}

impl JobQueue for ThreadQueue {
    fn submit(&self, job: Job) {
        let context = self.context.clone();
        self.worker.submit(job.kind(), move |watch| job.run(context.as_ref(), watch));
    }
    fn cancel(&self, kinds: &[JobKind]) {
        self.worker.cancel(kinds);
    }
    fn watch(&self, files: Vec<PathBuf>) {
        self.worker.watch(files);
    }
    fn poll(&self) -> Option<Message<Outcome>> {
        self.worker.poll()
    }
    fn wait(&self, at_most: Duration) -> Option<Message<Outcome>> {
        self.worker.wait(at_most)
    }
    fn progress(&self) -> Option<Progress> {
        self.worker.progress()
    }
    fn is_busy(&self, kind: JobKind) -> bool {
        self.worker.is_busy(kind)
    }
    fn is_idle(&self) -> bool {
        self.worker.is_idle()
    }
}
