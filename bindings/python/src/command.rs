//! Jobs on whole files, with the same options and the same bytes as the command.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::channel;

use lodsmith::{Control, Stage, Verdict};
use lodsmith_asset::request::{Answer, JobOption, Request, Verb};
use lodsmith_asset::warnings::Spelling;
use lodsmith_asset::{AssetError, JobProgress, Sink, Source, Step, Watch};
use pyo3::exceptions::{PyRuntimeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::ThreadPoolBuilder;

use crate::control::wait;
use crate::errors::text_of;
use crate::json::{options_of_python, to_python};
use crate::picture::pixels_array;

/// State that a job shares with the calling thread.
#[derive(Default)]
struct SharedState {
    is_cancelled: AtomicBool,
    /// Bits of the fraction done; for non-negative numbers, bits are ordered like the numbers.
    done: AtomicU64,
}

/// The caller of a job.
struct FileWatch {
    shared: Arc<SharedState>,
    progress: JobProgress,
}

impl FileWatch {
    fn report(&self) {
        self.shared.done.fetch_max(self.progress.done().to_bits(), Ordering::Relaxed);
    }
}

impl Control for FileWatch {
    fn stage(&mut self, stage: Stage) {
        self.progress.stage(stage);
        self.report();
    }
    fn progress(&mut self, done: f64) -> Verdict {
        self.progress.within(done);
        self.report();
        if self.shared.is_cancelled.load(Ordering::Relaxed) { Verdict::Cancel } else { Verdict::Continue }
    }
}

impl Watch for FileWatch {
    fn enter(&mut self, step: Step) {
        self.progress.step(step);
        self.report();
    }
    fn while_writing(&mut self, _: &Path, write: &mut dyn FnMut()) -> bool {
        let may_write = !self.shared.is_cancelled.load(Ordering::Relaxed);
        if may_write {
            write();
        }
        may_write
    }
}

/// Does a job; returns the exit status of the command, the report, warnings, errors, and the pixels of an image that
/// is not written.
#[pyfunction]
pub(crate) fn run_job<'py>(
    py: Python<'py>,
    verb: &str,
    inputs: Vec<PathBuf>,
    output: Option<PathBuf>,
    out_dir: Option<PathBuf>,
    options: &Bound<'py, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = options_of_python(options)?;
    let verb = verb_of(verb)?;
    let made = py.detach(|| match Request::new(verb, &options, Spelling::Keyword) {
        Ok(request) => {
            let inputs: Vec<Source> = inputs.into_iter().map(Source::Path).collect();
            let output = output.map(Sink::Path);
            answer(&request, &inputs, output.as_ref(), out_dir.as_deref(), progress.as_ref())
        }
        Err(why) => Ok(Err(why)),
    })?;
    let (status, report, warnings, errors, picture) = match made {
        Ok(Answer { report, warnings, faults, picture }) => {
            let picture = picture.map(|picture| pixels_array(py, &picture)).transpose()?;
            (if faults.is_empty() { 0 } else { 3 }, to_python(py, &report)?, warnings, faults, picture)
        }
        Err(why @ AssetError::UnknownOption { .. }) => return Err(PyTypeError::new_err(why.to_string())),
        Err(why) => {
            let status = if why.is_usage() { 2 } else { 1 };
            (status, py.None().into_bound(py), Vec::new(), vec![text_of(&why)], None)
        }
    };
    let all = PyDict::new(py);
    all.set_item("status", status)?;
    all.set_item("report", report)?;
    all.set_item("warnings", warnings)?;
    all.set_item("errors", errors)?;
    all.set_item("picture", picture)?;
    Ok(all)
}

fn verb_of(name: &str) -> PyResult<Verb> {
    let verb = Verb::ALL.into_iter().find(|v| v.name() == name);
    verb.ok_or_else(|| PyRuntimeError::new_err("there is no such job"))
}

/// Does a job in separate threads; the calling thread checks signals and reports progress.
fn answer(
    request: &Request,
    inputs: &[Source],
    output: Option<&Sink>,
    out_dir: Option<&Path>,
    progress: Option<&Py<PyAny>>,
) -> PyResult<Result<Answer, AssetError>> {
    let pool = ThreadPoolBuilder::new().num_threads(request.threads().unwrap_or(0)).build();
    let pool = pool.map_err(|e| PyRuntimeError::new_err(format!("cannot start threads: {e}")))?;
    let shared = Arc::new(SharedState::default());
    let mut watch = FileWatch { shared: shared.clone(), progress: JobProgress::default() };
    pool.in_place_scope(|scope| {
        let (send, receive) = channel();
        scope.spawn(move |_| drop(send.send(request.run(inputs, output, out_dir, &mut watch))));
        let state = || (f64::from_bits(shared.done.load(Ordering::Relaxed)), "");
        wait(&receive, progress, state, || shared.is_cancelled.store(true, Ordering::Relaxed))
    })
}

/// Returns the table of the options of a job: name, kind, whether it is a list, words, default and help of each.
#[pyfunction]
pub(crate) fn job_options<'py>(py: Python<'py>, verb: &str) -> PyResult<Bound<'py, PyAny>> {
    to_python(py, &verb_of(verb).map(JobOption::all)?.iter().map(JobOption::to_json).collect())
}
