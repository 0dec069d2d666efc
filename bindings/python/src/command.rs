//! The command, called in this process: whole files, with the same bytes.

use std::ffi::OsString;
use std::sync::mpsc::channel;

use lodsmith_cli::Call;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::control::wait;

/// Runs the command with these arguments; signals and progress are looked at by the calling thread.
#[pyfunction]
pub(crate) fn call<'py>(
    py: Python<'py>,
    args: Vec<OsString>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let call = Call::new();
    let outcome = py.detach(|| {
        std::thread::scope(|scope| {
            let (send, receive) = channel();
            let (call, work) = (&call, move |call: &Call| drop(send.send(call.run(args))));
            std::thread::Builder::new().spawn_scoped(scope, || work(call))?;
            wait(&receive, progress.as_ref(), || (call.done(), ""), || call.cancel())
        })
    })?;
    let all = PyDict::new(py);
    all.set_item("status", outcome.status)?;
    all.set_item("results", outcome.results)?;
    all.set_item("warnings", outcome.warnings)?;
    all.set_item("errors", outcome.errors)?;
    all.set_item("is_unknown_argument", outcome.is_unknown_argument)?;
    Ok(all)
}
