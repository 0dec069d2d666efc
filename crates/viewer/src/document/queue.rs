//! Queues of the jobs of a document.

use std::path::PathBuf;

use web_time::Duration;

use super::jobs::{Job, Outcome};
use super::page_queue::PageQueue;
use crate::gpu::Context;
use crate::job::{JobKind, Message, Progress, Worker};

/// A queue of jobs that run one after another, outside the thread of the window.
pub(super) enum JobQueue {
    /// On a thread.
    Thread { worker: Worker<Outcome>, context: Option<Context> },
    /// In a worker of a page.
    Page(Box<PageQueue>),
}

impl JobQueue {
    /// Starts a thread. `wake` is called when there is a message or progress.
    pub(super) fn on_thread(context: Option<Context>, wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self::Thread { worker: Worker::new(wake), context }
    }

    /// Queues a job. Obsolete jobs are removed, or cancelled if they run.
    pub(super) fn submit(&self, job: Job) {
        match self {
            Self::Thread { worker, context } => {
                let context = context.clone();
                worker.submit(job.kind(), move |watch| job.run(context.as_ref(), watch));
            }
            // The buffers are in this process.
            Self::Page(queue) if matches!(job, Job::Shade { .. }) => queue.do_here(job),
            Self::Page(queue) => queue.submit(job),
        }
    }

    /// Cancels running and waiting jobs of these kinds.
    pub(super) fn cancel(&self, kinds: &[JobKind]) {
        match self {
            Self::Thread { worker, .. } => worker.cancel(kinds),
            Self::Page(queue) => queue.cancel(kinds),
        }
    }

    /// Cancels jobs at the user's request, even if a worker and its models are lost.
    pub(super) fn stop(&self, kinds: &[JobKind]) {
        match self {
            Self::Thread { worker, .. } => worker.cancel(kinds),
            Self::Page(queue) => queue.stop(kinds),
        }
    }

    /// Ends a worker of a page, which holds the model of a file that is no longer open.
    pub(super) fn end_worker(&self) {
        if let Self::Page(queue) = self {
            queue.end_worker();
        }
    }

    /// Watches these files: a change sends [`Message::Changed`]. Files of a page do not change.
    pub(super) fn watch(&self, files: Vec<PathBuf>) {
        if let Self::Thread { worker, .. } = self {
            worker.watch(files);
        }
    }

    /// Returns the next message, if there is one.
    pub(super) fn poll(&self) -> Option<Message<Outcome>> {
        match self {
            Self::Thread { worker, .. } => worker.poll(),
            Self::Page(queue) => queue.poll(),
        }
    }

    /// Waits for the next message. (A page cannot wait.)
    pub(super) fn wait(&self, at_most: Duration) -> Option<Message<Outcome>> {
        match self {
            Self::Thread { worker, .. } => worker.wait(at_most),
            Self::Page(queue) => queue.poll(),
        }
    }

    /// Returns the progress of the running job.
    pub(super) fn progress(&self) -> Option<Progress> {
        match self {
            Self::Thread { worker, .. } => worker.progress(),
            Self::Page(queue) => queue.progress(),
        }
    }

    /// Returns true if a job of this kind waits or runs.
    pub(super) fn is_busy(&self, kind: JobKind) -> bool {
        match self {
            Self::Thread { worker, .. } => worker.is_busy(kind),
            Self::Page(queue) => queue.is_busy(kind),
        }
    }

    /// Returns true if no job waits or runs.
    pub(super) fn is_idle(&self) -> bool {
        match self {
            Self::Thread { worker, .. } => worker.is_idle(),
            Self::Page(queue) => queue.is_idle(),
        }
    }
}
