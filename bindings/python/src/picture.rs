//! Images of meshes, and images as arrays.

use lodsmith::core::Image;
use lodsmith_asset::picture::render_mesh;
use lodsmith_asset::request::Verb;
use lodsmith_render::{PictureFormat, Shading, encode};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::{MeshArrays, matrix};
use crate::control::Watch;
use crate::errors::{asset_error, empty_mesh};
use crate::json::options_of_job;

/// Renders a mesh with the options of `render` for files; `heat` has a value for each vertex. Returns red, green, blue
/// and alpha, rows from the top.
#[pyfunction]
pub(crate) fn render<'py>(
    py: Python<'py>,
    mesh: MeshArrays<'py>,
    options: &Bound<'py, PyDict>,
    heat: Option<Vec<f32>>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut recipe = options_of_job(Verb::Render, options)?.picture;
    if heat.is_some() {
        recipe.shading.get_or_insert(Shading::Heat);
    } else if recipe.shading == Some(Shading::Heat) {
        return Err(PyValueError::new_err("shading: heat needs values at the vertices: heat=…"));
    }
    let mesh = mesh.mesh(py)?;
    if mesh.face_count() == 0 {
        return Err(empty_mesh(py, "the mesh has no faces to render"));
    }
    let picture = Watch::default().run(py, |_| render_mesh(mesh, heat, &recipe))?;
    pixels_array(py, &picture.map_err(|e| asset_error(&e))?)
}

/// Returns an image as a PNG file.
#[pyfunction]
pub(crate) fn png<'py>(
    py: Python<'py>,
    pixels: &[u8],
    width: usize,
    height: usize,
) -> PyResult<Bound<'py, PyBytes>> {
    if pixels.len() != 4 * width * height {
        return Err(PyValueError::new_err("an image has four bytes for each pixel"));
    }
    let image = Image::new(width, height, pixels.as_chunks().0.to_vec());
    let bytes = encode(&image, PictureFormat::Png).map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(PyBytes::new(py, &bytes))
}

/// Returns the pixels of an image as an array of rows.
pub(crate) fn pixels_array<'py>(py: Python<'py>, picture: &Image) -> PyResult<Bound<'py, PyAny>> {
    let pixels = picture.pixels().as_flattened().to_vec();
    matrix(py, pixels, 4)?.call_method1("reshape", (picture.height(), picture.width(), 4))
}
