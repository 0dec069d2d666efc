//! Files and pictures.

use std::path::PathBuf;
use std::sync::Arc;

use lodsmith::core::{Bounds, Image};
use lodsmith_io::gltf::{Compression, Packing};
use lodsmith_io::{AssetScope, Format, ReadOptions, Regions, Textures, WriteError, WriteOptions, machine};
use lodsmith_render::{
    Background, Camera, ColorMap, DVec3, PictureFormat, Shading, StandardView, Subject, View, encode,
};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::{MeshArrays, matrix, to_arrays};
use crate::control::Watch;
use crate::errors::{empty_mesh, spelled};

/// Share of the memory of the machine that a file may take, as in the command.
const MEMORY_SHARE: f64 = 0.75;

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
    if let Some(memory) = machine::memory_limit() {
        options.limits.memory = (memory as f64 * MEMORY_SHARE) as u64;
    }
    // The operating system's own exceptions, such as FileNotFoundError.
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

/// Keywords of writing a mesh.
#[derive(FromPyObject)]
pub(crate) struct WriteKeywords {
    to: Option<String>,
    ascii: bool,
    textures: String,
    force: bool,
    compress: String,
    quantize: bool,
    materials: Option<Py<Materials>>,
}

/// Writes a mesh; returns warnings on what the format cannot hold.
#[pyfunction]
pub(crate) fn save<'py>(
    py: Python<'py>,
    mesh: MeshArrays<'py>,
    path: PathBuf,
    keywords: WriteKeywords,
) -> PyResult<Vec<String>> {
    let mut options = WriteOptions::default();
    options.format = format(keywords.to.as_deref())?;
    options.ascii = keywords.ascii;
    options.force = keywords.force;
    options.textures = word("textures", &keywords.textures, &Textures::ALL, Textures::name)?;
    let compression = word("compress", &keywords.compress, &Compression::ALL, Compression::name)?;
    options.packing = Packing::new(compression, keywords.quantize);
    options.regions = keywords.materials.map(|m| m.get().0.clone());
    let mesh = mesh.mesh(py)?;
    let written = Watch::default().run(py, |_| lodsmith_io::write_path(&mesh, &path, &options))?;
    let failed = |e: WriteError| {
        // (The keyword has another name than the option.)
        let text = spelled(&e.to_string().replace("--to", "format="));
        PyOSError::new_err(match e {
            WriteError::Io { .. } | WriteError::UnknownFormat { .. } => text,
            _ => format!("{}: {text}", path.display()),
        })
    };
    Ok(written.map_err(failed)?.warnings.iter().map(|w| spelled(&w.text)).collect())
}

/// Keywords of drawing a picture.
#[derive(FromPyObject)]
pub(crate) struct PictureKeywords {
    size: (usize, usize),
    view: String,
    azimuth: Option<f64>,
    elevation: Option<f64>,
    up: String,
    shading: Option<String>,
    color: Option<(f32, f32, f32)>,
    wireframe: bool,
    borders: bool,
    transparent: bool,
    fine: bool,
    /// Values of vertices for colours, and the range of the colours.
    heat: Option<Vec<f32>>,
    range: Option<(f32, f32)>,
    colors: String,
}

fn word<T: Copy>(option: &str, given: &str, all: &[T], name: fn(T) -> &'static str) -> PyResult<T> {
    all.iter().copied().find(|x| name(*x) == given).ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|x| name(*x)).collect();
        PyValueError::new_err(format!("{option}: one of {} is expected, not {given:?}", names.join(", ")))
    })
}

impl PictureKeywords {
    fn camera(&self, bounds: &Bounds) -> PyResult<Camera> {
        let view = word("view", &self.view, &StandardView::ALL, StandardView::name)?;
        let aspect = self.size.0.max(1) as f64 / self.size.1.max(1) as f64;
        let camera = Camera::fitting(bounds, view, aspect);
        if self.azimuth.is_none() && self.elevation.is_none() {
            return Ok(camera);
        }
        let (azimuth, elevation) =
            (self.azimuth.unwrap_or(0.0).to_radians(), self.elevation.unwrap_or(0.0).to_radians());
        let level = elevation.cos();
        let to_eye = DVec3::new(azimuth.sin() * level, elevation.sin(), azimuth.cos() * level);
        let turned = Camera { eye: camera.target + to_eye, up: DVec3::Y, ..camera };
        Ok(turned.framing(bounds, aspect))
    }
}

/// Draws a mesh: red, green, blue and alpha, rows from the top.
#[pyfunction]
pub(crate) fn render<'py>(
    py: Python<'py>,
    mesh: MeshArrays<'py>,
    keywords: PictureKeywords,
) -> PyResult<Bound<'py, PyAny>> {
    let mut mesh = mesh.mesh(py)?;
    if word("up", &keywords.up, &["y", "z"], |x| x)? == "z" {
        mesh.map_positions(|[x, y, z]| [x, z, -y]);
    }
    let auto = if mesh.colors().is_some() { "vertex-colors" } else { "smooth" };
    let given = keywords.shading.as_deref().unwrap_or(if keywords.heat.is_some() { "heat" } else { auto });
    let shading = word("shading", given, &Shading::ALL, Shading::name)?;
    if shading == Shading::Heat && keywords.heat.is_none() {
        return Err(PyValueError::new_err("shading: heat needs the values of vertices: heat=…"));
    }
    let wrong = |e: lodsmith_render::RenderError| PyValueError::new_err(e.to_string());
    let mut subject = Subject::of_mesh(mesh).map_err(wrong)?;
    if let Some(values) = &keywords.heat {
        subject = subject.with_values(vec![values.clone()]).map_err(wrong)?;
    }
    let bounds = subject.bounds().ok_or_else(|| empty_mesh(py, "the mesh has no faces to draw"))?;
    let (width, height) = keywords.size;
    let mut view = View::new(keywords.camera(&bounds)?, width, height);
    view.look.shading = shading;
    view.look.wireframe = keywords.wireframe;
    view.look.borders = keywords.borders;
    view.look.color_map = word("colors", &keywords.colors, &ColorMap::ALL, ColorMap::name)?;
    view.look.heat_range = keywords.range.map(|(low, high)| [low, high]);
    if let Some((r, g, b)) = keywords.color {
        view.look.surface = [r, g, b];
    }
    if keywords.transparent {
        view.background = Background::Transparent;
    }
    view.fine = keywords.fine;
    let picture = Watch::default().run(py, |_| lodsmith_render::render(&subject, &view))?.map_err(wrong)?;
    pixels_array(py, &picture)
}

/// Returns a picture as a PNG file.
#[pyfunction]
pub(crate) fn png<'py>(
    py: Python<'py>,
    pixels: &[u8],
    width: usize,
    height: usize,
) -> PyResult<Bound<'py, PyBytes>> {
    if pixels.len() != 4 * width * height {
        return Err(PyValueError::new_err("a picture has four bytes for each pixel"));
    }
    let image = Image::new(width, height, pixels.as_chunks().0.to_vec());
    let bytes = encode(&image, PictureFormat::Png).map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(PyBytes::new(py, &bytes))
}

/// Returns the pixels of an encoded picture.
#[pyfunction]
pub(crate) fn decode<'py>(py: Python<'py>, bytes: &[u8]) -> PyResult<Bound<'py, PyAny>> {
    let picture = lodsmith_render::decode(bytes).map_err(|e| PyValueError::new_err(e.to_string()))?;
    pixels_array(py, &picture)
}

/// Returns the pixels of a picture as an array of rows.
fn pixels_array<'py>(py: Python<'py>, picture: &Image) -> PyResult<Bound<'py, PyAny>> {
    let pixels = picture.pixels().as_flattened().to_vec();
    matrix(py, pixels, 4)?.call_method1("reshape", (picture.height(), picture.width(), 4))
}
