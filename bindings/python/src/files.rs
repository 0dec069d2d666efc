//! Meshes in files.

use std::path::PathBuf;
use std::sync::Arc;

use lodsmith_asset::Job;
use lodsmith_asset::request::Verb;
use lodsmith_io::{AssetScope, Format, ReadOptions, Regions, WriteError, WriteOptions};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{MeshArrays, to_arrays};
use crate::control::Watch;
use crate::errors::{empty_mesh, spelled};
use crate::json::options_of_job;

/// Descriptions of the regions of a mesh that was read: materials, groups, their files.
#[pyclass(frozen)]
pub(crate) struct Materials(Arc<Regions>);

#[pymethods]
impl Materials {
    /// Names of the materials of the regions.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.0.materials().map(|name| String::from_utf8_lossy(name).into_owned()).collect()
    }
}

fn format(name: Option<&str>) -> PyResult<Option<Format>> {
    let Some(name) = name else { return Ok(None) };
    let names = || Format::ALL.map(Format::name).join(", ");
    let wrong = || PyValueError::new_err(format!("format: one of {} is expected, not {name:?}", names()));
    Format::from_name(name).map(Some).ok_or_else(wrong)
}

/// Reads a file: its arrays, its format and warnings.
#[pyfunction]
pub(crate) fn load<'py>(
    py: Python<'py>,
    path: PathBuf,
    from: Option<&str>,
    asset_root: Option<PathBuf>,
    allow_outside: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let mut options = ReadOptions::default();
    options.format = format(from)?;
    options.assets = match asset_root {
        Some(root) => AssetScope::Root(root),
        None if allow_outside => AssetScope::Anywhere,
        None => AssetScope::Folder,
    };
    options.limits.memory = Job::default_memory();
    // Raises exceptions of the operating system, such as FileNotFoundError.
    std::fs::File::open(&path).map_err(|e| os_error(py, &e, &path))?;
    let loaded = Watch::default().run(py, |_| lodsmith_io::read_path(&path, &options))?;
    let loaded = loaded.map_err(|e| empty_mesh(py, &spelled(&e.to_string())))?;
    let warnings: Vec<String> = loaded.warnings.iter().map(|w| spelled(&w.text)).collect();
    let arrays = to_arrays(py, Arc::unwrap_or_clone(loaded.mesh))?;
    arrays.set_item("format", loaded.format.name())?;
    arrays.set_item("warnings", warnings)?;
    arrays.set_item("materials", Materials(Arc::new(loaded.regions)))?;
    Ok(arrays)
}

fn os_error(py: Python<'_>, error: &std::io::Error, path: &std::path::Path) -> PyErr {
    match error.raw_os_error() {
        Some(code) => {
            let made = py
                .import("os")
                .and_then(|os| os.call_method1("strerror", (code,)))
                .map(|text| PyOSError::new_err((code, text.unbind(), path.display().to_string())));
            made.unwrap_or_else(|e| e)
        }
        None => PyOSError::new_err(format!("{}: {error}", path.display())),
    }
}

/// Writes a mesh; returns warnings about data that the format cannot store.
#[pyfunction]
pub(crate) fn save<'py>(
    py: Python<'py>,
    mesh: MeshArrays<'py>,
    path: PathBuf,
    to: Option<&str>,
    materials: Option<Py<Materials>>,
    writing: &Bound<'py, PyDict>,
) -> PyResult<Vec<String>> {
    let mut options = WriteOptions::default();
    options.format = format(to)?;
    let writing = options_of_job(Verb::Convert, writing)?.writing;
    (options.ascii, options.force) = (writing.ascii, writing.force);
    (options.textures, options.packing) = (writing.textures, writing.packing);
    options.regions = materials.map(|m| m.get().0.clone());
    let mesh = mesh.mesh(py)?;
    let written = Watch::default().run(py, |_| lodsmith_io::write_path(&mesh, &path, &options))?;
    let failed = |e: WriteError| {
        // (The keyword and the option have different names.)
        let text = spelled(&e.to_string().replace("--to", "format="));
        PyOSError::new_err(match e {
            WriteError::Io { .. } | WriteError::UnknownFormat { .. } => text,
            _ => format!("{}: {text}", path.display()),
        })
    };
    Ok(written.map_err(failed)?.warnings.iter().map(|w| spelled(&w.text)).collect())
}
