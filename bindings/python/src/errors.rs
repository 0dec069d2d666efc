//! Exceptions.

use lodsmith::SimplifyError;
use lodsmith::core::MeshError;
use lodsmith::options::by_name::{self, OptionError};
use lodsmith_asset::AssetError;
use lodsmith_asset::warnings::Spelling;
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;

pyo3::create_exception!(
    lodsmith,
    InvalidMesh,
    PyValueError,
    "Raised if arrays or a file do not form a mesh.\n\nAttributes\n----------\nface : int or None\n    Number of the face at \
     fault.\nindex : int or None\n    The number of a vertex that it names."
);

/// Returns the exception for buffers that are not a mesh.
pub(crate) fn mesh_error(py: Python<'_>, error: &MeshError) -> PyErr {
    match error {
        MeshError::IndexOutOfRange { face, index, count } => bad_face(py, *face, i64::from(*index), *count),
        other => invalid(py, &other.to_string(), None),
    }
}

/// Returns the exception for a face with a vertex that does not exist.
pub(crate) fn bad_face(py: Python<'_>, face: usize, index: i64, count: usize) -> PyErr {
    let text = format!("face {face} uses vertex {index}, but the mesh has {count}");
    invalid(py, &text, Some((face, index)))
}

/// Returns the exception for a mesh or file that cannot be used, with the reason.
pub(crate) fn empty_mesh(py: Python<'_>, text: &str) -> PyErr {
    invalid(py, text, None)
}

fn invalid(py: Python<'_>, text: &str, at: Option<(usize, i64)>) -> PyErr {
    let error = InvalidMesh::new_err(text.to_owned());
    let value = error.value(py);
    let set = value.setattr("face", at.map(|x| x.0)).and_then(|()| value.setattr("index", at.map(|x| x.1)));
    match set {
        Ok(()) => error,
        Err(e) => e,
    }
}

/// Returns the exception for a run that failed, with options spelled as keywords.
pub(crate) fn run_error(py: Python<'_>, error: SimplifyError) -> PyErr {
    let text = error.to_string();
    match error {
        SimplifyError::NoFaces { .. } => return invalid(py, &text, None),
        SimplifyError::Mesh(error) => return mesh_error(py, &error),
        SimplifyError::Cancelled => return PyRuntimeError::new_err("cancelled"),
        _ => {}
    }
    PyValueError::new_err(with_keywords(text))
}

/// Returns the exception for an option that was rejected.
pub(crate) fn option_error(error: &OptionError) -> PyErr {
    match error {
        OptionError::Unknown { .. } => PyTypeError::new_err(error.to_string()),
        other => PyValueError::new_err(with_keywords(other.to_string())),
    }
}

/// Spells options of the command, such as `--max-memory`, as keywords.
pub(crate) fn spelled(text: &str) -> String {
    Spelling::Keyword.apply(text)
}

/// Replaces names of options of the engine with their keywords, and an example of a value with that of a keyword.
pub(crate) fn with_keywords(mut text: String) -> String {
    for option in by_name::OPTIONS.iter().filter(|o| o.name.contains('-')) {
        // Values such as `lindstrom-turk` are not changed.
        text = text.replace(option.name, &option.name.replace('-', "_"));
    }
    text.replace("as in name=2 (", "as in {'name': 2} (")
}

/// Returns the exception for a job whose options were rejected, or that failed.
pub(crate) fn asset_error(error: &AssetError) -> PyErr {
    PyValueError::new_err(text_of(error))
}

/// Returns the text of an error, with options spelled as keywords.
pub(crate) fn text_of(error: &AssetError) -> String {
    match error {
        AssetError::Input { path, problem } => format!("{path}: {}", text_of(problem)),
        AssetError::Simplify(why) => with_keywords(why.to_string()),
        other => spelled(&other.to_string()),
    }
}
