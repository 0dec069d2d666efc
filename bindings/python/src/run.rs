//! Options and control of a run, and `simplify`.

use lodsmith::options::by_name;
use lodsmith::{Input, OwnedMeshData, Simplified, SimplifyError, SimplifyOptions};
use lodsmith_asset::report_json;
use lodsmith_asset::request::engine_value;
use lodsmith_asset::warnings::{not_reached, warnings_of};
use numpy::PyReadonlyArray1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{MeshArrays, to_arrays};
use crate::control::{Watch, WatchedRun};
use crate::errors::{mesh_error, option_error, run_error, spelled};
use crate::json::{options_of_python, to_python};

/// The keywords of a run.
#[derive(FromPyObject)]
pub(crate) struct RunKeywords<'py> {
    /// Options by name.
    options: Bound<'py, PyDict>,
    locked: Option<PyReadonlyArray1<'py, bool>>,
    importance: Option<PyReadonlyArray1<'py, f32>>,
    error_map: Option<PyReadonlyArray1<'py, f32>>,
    progress: Option<Py<PyAny>>,
    pub(crate) time_limit: Option<f64>,
}

impl RunKeywords<'_> {
    /// Converts the keywords to options of the engine; `None` means the default.
    pub(crate) fn options(&self) -> PyResult<SimplifyOptions> {
        let given = options_of_python(&self.options)?;
        let mut values = Vec::new();
        for (name, value) in given.iter().filter(|(_, value)| !value.is_null()) {
            let value = engine_value(value).map_err(|why| PyValueError::new_err(format!("{name}: {why}")))?;
            values.push((name.as_str(), value));
        }
        by_name::from_names(&values).map_err(|e| option_error(&e))
    }

    /// Returns the locks, the importance and the error map of vertices.
    pub(crate) fn data(&self) -> PyResult<OwnedMeshData> {
        let mut data = OwnedMeshData::default();
        data.locked = self.locked.as_ref().map(|own| own.as_slice().map(<[bool]>::to_vec)).transpose()?;
        data.importance =
            self.importance.as_ref().map(|own| own.as_slice().map(<[f32]>::to_vec)).transpose()?;
        data.error_map =
            self.error_map.as_ref().map(|own| own.as_slice().map(<[f32]>::to_vec)).transpose()?;
        Ok(data)
    }

    /// Does a run of the engine with these keywords.
    pub(crate) fn run<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut WatchedRun) -> Result<T, SimplifyError> + Send,
    ) -> PyResult<T> {
        let progress = self.progress.as_ref().map(|f| f.clone_ref(py));
        let watch = Watch { progress, time_limit: self.time_limit };
        watch.run(py, work)?.map_err(|e| run_error(py, e))
    }
}

/// Returns the arrays, the report and the warnings of a result; `name` is the prefix of the warning about a missed
/// target.
pub(crate) fn simplified<'py>(
    py: Python<'py>,
    done: Simplified,
    options: &SimplifyOptions,
    time_limit: Option<f64>,
    name: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let mut warnings: Vec<String> = warnings_of(&done.report).iter().map(|w| spelled(&w.text)).collect();
    let missed = not_reached(&done.report, options, time_limit, [&done.mesh]);
    warnings.extend(missed.map(|why| format!("{name}{}", spelled(&why))));
    let report = to_python(py, &report_json::run(&done.report, options))?;
    let arrays = to_arrays(py, done.mesh)?;
    arrays.set_item("report", report)?;
    arrays.set_item("warnings", warnings)?;
    Ok(arrays)
}

/// Simplifies a mesh.
#[pyfunction]
pub(crate) fn simplify<'py>(
    py: Python<'py>,
    mesh: MeshArrays<'py>,
    keywords: RunKeywords<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let (options, data) = (keywords.options()?, keywords.data()?);
    if !options.has_end() {
        let text = "give a target: faces=, vertices=, ratio= or error=, or an option that ends the method";
        return Err(PyTypeError::new_err(text));
    }
    let done = if mesh.is_bare() {
        let typed = mesh.typed()?;
        let arrays = typed.surface(py)?;
        let surface = arrays.surface().map_err(|e| mesh_error(py, &e))?;
        let input = Input::of_surface(surface).with(data.view());
        keywords.run(py, |run| lodsmith::simplify_with(&input, &options, run))?
    } else {
        let mesh = mesh.mesh(py)?;
        let input = Input::new(&mesh).with(data.view());
        keywords.run(py, |run| lodsmith::simplify_with(&input, &options, run))?
    };
    simplified(py, done, &options, keywords.time_limit, "")
}

/// Returns the table of the options: name of the keyword, kind, words, default and help.
#[pyfunction]
pub(crate) fn options(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let list = PyList::empty(py);
    for option in by_name::OPTIONS {
        let (kind, words) = (option.kind.name(), option.kind.words());
        let entry = PyDict::new(py);
        entry.set_item("name", option.name.replace('-', "_"))?;
        entry.set_item("kind", kind)?;
        entry.set_item("words", words.to_vec())?;
        entry.set_item("default", option.default_text())?;
        entry.set_item("help", spelled(option.help))?;
        list.append(entry)?;
    }
    Ok(list)
}

/// Returns the keyword that is most similar to a misspelt keyword.
#[pyfunction]
pub(crate) fn nearest(misspelt: &str, names: Vec<String>) -> Option<String> {
    by_name::nearest(misspelt, names.iter().map(String::as_str)).map(str::to_owned)
}
