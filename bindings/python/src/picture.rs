//! Images of meshes, and images as arrays.

use lodsmith::core::{Bounds, Image};
use lodsmith_asset::picture::Viewpoint;
use lodsmith_asset::request::{Request, Verb};
use lodsmith_asset::warnings::Spelling;
use lodsmith_asset::{AssetError, Up, Writing, orient};
use lodsmith_render::{Camera, DVec3, PictureFormat, RenderError, Shading, Subject, encode};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::{MeshArrays, matrix};
use crate::control::Watch;
use crate::errors::{empty_mesh, text_of};
use crate::json::options_of_python;

/// Renders a mesh with the options of `render` for files; `heat` has a value for each vertex. Returns red, green, blue
/// and alpha, rows from the top.
#[pyfunction]
pub(crate) fn render<'py>(
    py: Python<'py>,
    mesh: MeshArrays<'py>,
    options: &Bound<'py, PyDict>,
    color: Option<(f32, f32, f32)>,
    heat: Option<Vec<f32>>,
) -> PyResult<Bound<'py, PyAny>> {
    let request = Request::new(Verb::Render, &options_of_python(options)?, Spelling::Keyword);
    let mut recipe =
        request.map_err(|e: AssetError| PyValueError::new_err(text_of(&e)))?.options().picture.clone();
    let mut mesh = mesh.mesh(py)?;
    if recipe.up == Up::Z {
        orient(&mut mesh, &Writing { up: Some(Up::Y), ..Writing::default() });
    }
    let usual = match (&heat, mesh.colors()) {
        (Some(_), _) => Shading::Heat,
        (None, Some(_)) => Shading::VertexColors,
        (None, None) => Shading::Smooth,
    };
    let shading = recipe.shading.unwrap_or(usual);
    if shading == Shading::Heat && heat.is_none() {
        return Err(PyValueError::new_err("shading: heat needs values at the vertices: heat=…"));
    }
    if let Some((r, g, b)) = color {
        recipe.look.surface = [r, g, b];
    }
    let wrong = |e: RenderError| PyValueError::new_err(e.to_string());
    let mut subject = Subject::of_mesh(mesh).map_err(wrong)?;
    if let Some(values) = heat {
        subject = subject.with_values(vec![values]).map_err(wrong)?;
    }
    let bounds = subject.bounds().ok_or_else(|| empty_mesh(py, "the mesh has no faces to render"))?;
    let size = recipe.size(1);
    let camera = camera(&recipe.viewpoint, &bounds, size);
    let view = recipe.view(camera, size, shading, recipe.look.heat_range);
    let picture = Watch::default().run(py, |_| lodsmith_render::render(&subject, &view))?.map_err(wrong)?;
    pixels_array(py, &picture)
}

/// Returns a camera that shows the whole bounding box.
fn camera(viewpoint: &Viewpoint, bounds: &Bounds, [width, height]: [usize; 2]) -> Camera {
    let aspect = width as f64 / height as f64;
    let camera = Camera::fitting(bounds, viewpoint.view, aspect);
    if viewpoint.azimuth_deg.is_none() && viewpoint.elevation_deg.is_none() {
        return camera;
    }
    let (azimuth, elevation) = (
        viewpoint.azimuth_deg.unwrap_or(0.0).to_radians(),
        viewpoint.elevation_deg.unwrap_or(0.0).to_radians(),
    );
    let level = elevation.cos();
    let to_eye = DVec3::new(azimuth.sin() * level, elevation.sin(), azimuth.cos() * level);
    let turned = Camera { eye: camera.target + to_eye, up: DVec3::Y, ..camera };
    turned.framing(bounds, aspect)
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
