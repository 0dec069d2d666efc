//! The extension module `lodsmith._lodsmith`: the libraries for NumPy arrays. The Python package `lodsmith` around it
//! has the functions for users, with their documentation.

mod arrays;
mod command;
mod control;
mod errors;
mod files;
mod json;
mod levels;
mod measure;
mod picture;
mod report;
mod run;

use pyo3::prelude::*;

/// The extension module.
#[pymodule]
mod _lodsmith {
    #[pymodule_export]
    use super::command::{job_options, run_job};
    #[pymodule_export]
    use super::errors::InvalidMesh;
    #[pymodule_export]
    use super::files::{Materials, load, save};
    #[pymodule_export]
    use super::levels::{ProgressiveMesh, lod};
    #[pymodule_export]
    use super::measure::{clean, compare, counts, source_map};
    #[pymodule_export]
    use super::picture::{png, render};
    #[pymodule_export]
    use super::run::{nearest, options, simplify};

    use lodsmith_io::Format;
    use pyo3::prelude::*;
    use pyo3::types::PyTuple;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let readable = Format::ALL.into_iter().filter(|f| *f != Format::Fbx || cfg!(feature = "fbx"));
        module.add("FORMATS", PyTuple::new(module.py(), readable.map(Format::name).collect::<Vec<_>>())?)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
