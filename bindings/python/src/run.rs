//! Options and control of a run, and `simplify`.

use lodsmith::options::by_name::{self, OptionValue};
use lodsmith::{Input, OwnedMeshData, Simplified, SimplifyError, SimplifyOptions};
use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString};

use crate::arrays::{MeshArrays, to_arrays};
use crate::control::{Watch, WatchedRun};
use crate::errors::{mesh_error, option_error, run_error};
use lodsmith_bindings::report;

use crate::json::to_python;

/// The keywords of a run.
#[derive(FromPyObject)]
pub(crate) struct RunKeywords<'py> {
    /// Options by name.
    options: Bound<'py, PyDict>,
    locked: Option<PyReadonlyArray1<'py, bool>>,
    importance: Option<PyReadonlyArray1<'py, f32>>,
    progress: Option<Py<PyAny>>,
    time_limit: Option<f64>,
}

/// A value of a keyword, owned.
enum Given {
    Flag(bool),
    Whole(u64),
    Number(f64),
    Text(String),
    Weights(Vec<(String, f64)>),
}

impl Given {
    fn of(name: &str, any: &Bound<'_, PyAny>) -> PyResult<Self> {
        let wrong = || {
            let kind = any.get_type();
            PyValueError::new_err(format!("{name}: a value of type {kind} is not taken"))
        };
        // Scalars of NumPy count as numbers too.
        if any.is_instance_of::<PyBool>() {
            Ok(Self::Flag(any.extract()?))
        } else if any.is_instance_of::<PyString>() {
            Ok(Self::Text(any.extract()?))
        } else if let Ok(dict) = any.cast::<PyDict>() {
            let one = |(key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
                Ok((key.extract::<String>()?, value.extract::<f64>()?))
            };
            let all: PyResult<Vec<_>> = dict.iter().map(one).collect();
            all.map(Self::Weights).map_err(|_| wrong())
        } else if any.is_instance_of::<PyFloat>() {
            Ok(Self::Number(any.extract()?))
        } else if any.is_instance_of::<PyInt>() || any.hasattr("__index__")? {
            any.extract().map(Self::Whole).or_else(|_| any.extract().map(Self::Number)).map_err(|_| wrong())
        } else {
            any.extract().map(Self::Number).map_err(|_| wrong())
        }
    }

    fn value(&self) -> OptionValue<'_> {
        match self {
            Self::Flag(x) => OptionValue::Flag(*x),
            Self::Whole(x) => OptionValue::Whole(*x),
            Self::Number(x) => OptionValue::Number(*x),
            Self::Text(x) => x.as_str().into(),
            Self::Weights(all) => {
                OptionValue::Weights(all.iter().map(|(k, x)| (k.as_str().into(), *x)).collect())
            }
        }
    }
}

impl RunKeywords<'_> {
    /// Converts the keywords to options of the engine; `None` stands for the default.
    pub(crate) fn options(&self) -> PyResult<SimplifyOptions> {
        let mut given = Vec::new();
        for (name, value) in self.options.iter().filter(|(_, value)| !value.is_none()) {
            let name: String = name.extract()?;
            let value = Given::of(&name, &value)?;
            given.push((name, value));
        }
        let given: Vec<_> = given.iter().map(|(name, value)| (name.as_str(), value.value())).collect();
        by_name::from_names(&given).map_err(|e| option_error(&e))
    }

    /// Returns what the keywords say of vertices of the mesh.
    pub(crate) fn data(&self) -> PyResult<OwnedMeshData> {
        let mut data = OwnedMeshData::default();
        data.locked = self.locked.as_ref().map(|own| own.as_slice().map(<[bool]>::to_vec)).transpose()?;
        data.importance =
            self.importance.as_ref().map(|own| own.as_slice().map(<[f32]>::to_vec)).transpose()?;
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

/// Returns the arrays and the report of a result.
pub(crate) fn simplified<'py>(py: Python<'py>, done: Simplified) -> PyResult<Bound<'py, PyDict>> {
    let told = to_python(py, &report::report(&done.report))?;
    let arrays = to_arrays(py, done.mesh)?;
    arrays.set_item("report", told)?;
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
    simplified(py, done)
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
        entry.set_item("help", option.help)?;
        list.append(entry)?;
    }
    Ok(list)
}

/// Returns the keyword that is most similar to a misspelt one.
#[pyfunction]
pub(crate) fn nearest(misspelt: &str, names: Vec<String>) -> Option<String> {
    by_name::nearest(misspelt, names.iter().map(String::as_str)).map(str::to_owned)
}
