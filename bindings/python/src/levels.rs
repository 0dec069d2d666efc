//! Chains of levels, and progressive meshes.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use lodsmith::core::TriMesh;
use lodsmith::{Input, Progressive};
use lodsmith_asset::request::Verb;
use lodsmith_io::ReadOptions;
use lodsmith_io::lpm::{self, LpmOptions};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{MeshArrays, positions_array, to_arrays};
use crate::control::Watch;
use crate::errors::{asset_error, mesh_error, spelled};
use crate::json::options_of_job;
use crate::run::{RunKeywords, simplified};

/// Makes levels of detail, each with its switching distance, and with positions on the next level if requested.
#[pyfunction]
pub(crate) fn lod<'py>(
    py: Python<'py>,
    mesh: MeshArrays<'py>,
    levels: &Bound<'py, PyDict>,
    keywords: RunKeywords<'py>,
) -> PyResult<(Bound<'py, PyList>, Bound<'py, PyList>)> {
    let levels = options_of_job(Verb::Lod, levels)?;
    let mut options = levels.levels().map_err(|e| asset_error(&e))?;
    let measure = options.simplify.measure;
    options.simplify = keywords.options()?;
    options.simplify.measure = measure;
    let (mesh, data) = (mesh.mesh(py)?, keywords.data()?);
    let input = Input::new(&mesh).with(data.view());
    let chain = keywords.run(py, |run| lodsmith::lod_with(&input, &options, run))?;
    let geomorphs = PyList::empty(py);
    for level in 0..=chain.levels.len() {
        if let Some(positions) = chain.geomorph(level) {
            geomorphs.append(positions_array(py, positions.clone())?)?;
        }
    }
    let list = PyList::empty(py);
    for (k, level) in chain.levels.into_iter().enumerate() {
        let error = lodsmith::lod::error_of(&level.report);
        let distance = error.map(|error| levels.screen.distance(error));
        let name = format!("level {}: ", k + 1);
        let arrays = simplified(py, level, &options.simplify, keywords.time_limit, &name)?;
        arrays.set_item("distance", distance)?;
        list.append(arrays)?;
    }
    Ok((list, geomorphs))
}

/// A progressive mesh.
#[pyclass(frozen)]
pub(crate) struct ProgressiveMesh(Mutex<Progressive>);

impl ProgressiveMesh {
    fn lock(&self) -> MutexGuard<'_, Progressive> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl ProgressiveMesh {
    /// Records the simplification of a mesh.
    #[staticmethod]
    fn build<'py>(py: Python<'py>, mesh: MeshArrays<'py>, keywords: RunKeywords<'py>) -> PyResult<Self> {
        let options = keywords.options()?;
        let (mesh, data) = (mesh.mesh(py)?, keywords.data()?);
        let input = Input::new(&mesh).with(data.view());
        keywords.run(py, |run| Progressive::build(&input, &options, run)).map(|made| Self(Mutex::new(made)))
    }

    /// Reads a file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = py.detach(|| {
            let file = std::fs::File::open(&path).map_err(PyErr::from)?;
            lpm::read(std::io::BufReader::new(file), &ReadOptions::default())
                .map_err(|e| PyValueError::new_err(format!("{}: {e}", path.display())))
        });
        read.map(|file| Self(Mutex::new(Progressive::new(file.splits))))
    }

    /// Writes a file.
    fn write(&self, py: Python<'_>, path: PathBuf, bits: Option<u8>) -> PyResult<()> {
        let splits = self.lock().splits().clone();
        py.detach(|| {
            let mut options = LpmOptions::default();
            options.bits = bits;
            lpm::write_path(&splits, None, &options, &path).map(drop)
        })
        .map_err(|e| PyOSError::new_err(spelled(&e.to_string())))
    }

    /// Number of the finest level.
    #[getter]
    fn top(&self) -> usize {
        self.lock().top()
    }

    /// Returns the level for a number of faces, of vertices, or for an estimated error.
    fn level_of(&self, faces: Option<usize>, vertices: Option<usize>, error: Option<f64>) -> usize {
        let mesh = self.lock();
        let by_count = [faces.map(|n| mesh.level_of_faces(n)), vertices.map(|n| mesh.level_of_vertices(n))];
        let counts = by_count.into_iter().flatten().min();
        // The finest level that meets one of the targets.
        [counts, error.map(|e| mesh.level_of_error(e))].into_iter().flatten().max().unwrap_or(mesh.top())
    }

    /// Returns the mesh of a level, its estimated error, and its number.
    fn mesh<'py>(&self, py: Python<'py>, level: usize, fit: bool) -> PyResult<Bound<'py, PyDict>> {
        let made = Watch::default().run(py, |_| {
            let mut mesh = self.lock();
            mesh.to_level(level);
            let made: Result<TriMesh, _> = if fit { mesh.fitted_mesh() } else { mesh.mesh() };
            made.map(|made| (made, mesh.error()))
        })?;
        let (made, error) = made.map_err(|e| mesh_error(py, &e))?;
        let arrays = to_arrays(py, made)?;
        arrays.set_item("error", error)?;
        Ok(arrays)
    }
}
