//! The command, called in this process: whole files, with the same bytes.

use std::ffi::OsString;
use std::sync::mpsc::{RecvTimeoutError, channel};

use lodsmith_cli::Call;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::control::LOOK;

/// Runs the command with these arguments; signals and progress are looked at by the calling thread.
#[pyfunction]
pub(crate) fn call<'py>(
    py: Python<'py>,
    args: Vec<OsString>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let call = Call::new();
    let mut raised = None;
    let outcome = py.detach(|| {
        let (send, receive) = channel();
        std::thread::scope(|scope| {
            let work = || drop(send.send(call.run(args)));
            std::thread::Builder::new().spawn_scoped(scope, work).ok()?;
            loop {
                match receive.recv_timeout(LOOK) {
                    Ok(outcome) => return Some(outcome),
                    Err(RecvTimeoutError::Disconnected) => return None,
                    Err(RecvTimeoutError::Timeout) if raised.is_some() => {}
                    Err(RecvTimeoutError::Timeout) => {
                        let looked = Python::attach(|py| {
                            py.check_signals()?;
                            progress.as_ref().map_or(Ok(()), |f| f.call1(py, (call.done(), "")).map(drop))
                        });
                        if let Err(error) = looked {
                            call.cancel();
                            raised = Some(error);
                        }
                    }
                }
            }
        })
    });
    if let Some(raised) = raised {
        return Err(raised);
    }
    let outcome = outcome.ok_or_else(|| PyRuntimeError::new_err("the call did not come to an end"))?;
    let all = PyDict::new(py);
    all.set_item("status", outcome.status)?;
    all.set_item("results", outcome.results)?;
    all.set_item("warnings", outcome.warnings)?;
    all.set_item("errors", outcome.errors)?;
    all.set_item("is_unknown_argument", outcome.is_unknown_argument)?;
    Ok(all)
}
