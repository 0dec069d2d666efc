//! Comparison, source map, repair and counts of meshes.

use lodsmith::core::measure::{CompareOptions, MeasureError, compare_until};
use lodsmith::core::{Source, correspondence};
use lodsmith_asset::MeshFacts;
use lodsmith_asset::request::Verb;
use numpy::IntoPyArray as _;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{MeshArrays, matrix, to_arrays};
use crate::control::Watch;
use crate::errors::{empty_mesh, mesh_error};
use crate::json::{options_of_job, to_python};
use crate::report;
use crate::run::RunKeywords;

/// Measures the distance between two meshes in both directions.
#[pyfunction]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    reference: MeshArrays<'py>,
    candidate: MeshArrays<'py>,
    samples: Option<usize>,
    seed: Option<u64>,
) -> PyResult<Bound<'py, PyAny>> {
    let (reference, candidate) = (reference.typed()?, candidate.typed()?);
    let (reference, candidate) = (reference.surface(py)?, candidate.surface(py)?);
    let wrong = |e| mesh_error(py, &e);
    let (reference, candidate) = (reference.surface().map_err(wrong)?, candidate.surface().map_err(wrong)?);
    let mut options = CompareOptions::default();
    options.samples = samples.unwrap_or(options.samples);
    options.seed = seed.unwrap_or(options.seed);
    let found = Watch::default()
        .run(py, |run| compare_until(&reference, &candidate, &options, &mut || run.is_cancelled()))?
        .map_err(|e| empty(py, &e))?;
    to_python(py, &report::comparison(&found))
}

fn empty(py: Python<'_>, error: &MeasureError) -> PyErr {
    empty_mesh(py, &error.to_string())
}

/// Finds the source of each row of a result on the original: a row or -1, a face, and weights of its corners.
#[pyfunction]
pub(crate) fn source_map<'py>(
    py: Python<'py>,
    original: MeshArrays<'py>,
    result: MeshArrays<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let (original, result) = (original.mesh(py)?, result.mesh(py)?);
    let found = Watch::default().run(py, |_| {
        let found = correspondence(&original, &result)?;
        // Wedges that were kept get a face too, so that every row has one.
        let mut corner = vec![(u32::MAX, 0u8); original.wedge_count()];
        for (f, triangle) in original.triangles().iter().enumerate().rev() {
            for (k, w) in triangle.iter().enumerate() {
                corner[w.index()] = (f as u32, k as u8);
            }
        }
        let count = result.wedge_count();
        let mut map = (Vec::with_capacity(count), Vec::with_capacity(count), Vec::with_capacity(count));
        for source in found.sources() {
            let (row, face, weights) = match *source {
                Source::Wedge(w) => {
                    let (face, k) = corner[w.index()];
                    let mut weights = [0f32; 3];
                    weights[usize::from(k)] = 1.0;
                    (i64::from(w.0), if face == u32::MAX { -1 } else { i64::from(face) }, weights)
                }
                Source::Face { face, weights } => (-1, i64::from(face.0), weights),
                _ => (-1, -1, [0.0; 3]),
            };
            map.0.push(row);
            map.1.push(face);
            map.2.push(weights);
        }
        Ok(map)
    })?;
    let (vertices, faces, weights) = found.map_err(|e: MeasureError| empty(py, &e))?;
    let all = PyDict::new(py);
    all.set_item("vertices", vertices.into_pyarray(py))?;
    all.set_item("faces", faces.into_pyarray(py))?;
    all.set_item("weights", matrix(py, weights.into_flattened(), 3)?)?;
    Ok(all)
}

/// Repairs a mesh.
#[pyfunction]
pub(crate) fn clean<'py>(
    py: Python<'py>,
    mesh: MeshArrays<'py>,
    repairs: &Bound<'py, PyDict>,
    keywords: RunKeywords<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let lengths = keywords.options()?;
    let mut options = options_of_job(Verb::Clean, repairs)?.clean;
    (options.weld, options.prune) = (lengths.weld, lengths.prune);
    let mesh = mesh.mesh(py)?;
    let done = keywords.run(py, |run| lodsmith::clean(&mesh, &options, run))?;
    let report = to_python(py, &report::cleaned(&done.report))?;
    let arrays = to_arrays(py, done.mesh)?;
    arrays.set_item("report", report)?;
    Ok(arrays)
}

/// Counts elements and defects of a mesh.
#[pyfunction]
pub(crate) fn counts<'py>(py: Python<'py>, mesh: MeshArrays<'py>) -> PyResult<Bound<'py, PyAny>> {
    let mesh = mesh.mesh(py)?;
    let counted = Watch::default().run(py, |_| MeshFacts::of(&mesh).to_json())?;
    to_python(py, &counted)
}
