//! What keeps a mesh from being simplified.

use lodsmith_core::MeshError;

use crate::options::Method;

/// Why a mesh could not be simplified.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimplifyError {
    /// The mesh has no face, or none that is left after cleaning.
    #[error("the mesh has no face with an area ({faces} faces read)")]
    NoFaces {
        /// Faces of the input.
        faces: usize,
    },
    /// An option is out of range.
    #[error("{option} must be {wanted}, not {got}")]
    BadOption {
        /// The option.
        option: &'static str,
        /// What it may be.
        wanted: &'static str,
        /// What it was.
        got: f64,
    },
    /// A list has not one entry for each vertex.
    #[error("{option} has {got} entries for {wanted} vertices")]
    WrongLength {
        /// The option.
        option: &'static str,
        /// The number of vertices.
        wanted: usize,
        /// Its length.
        got: usize,
    },
    /// An option that only other methods know.
    #[error("{option} is for {takers}, not for {method}", method = method.name(), takers = names(takers))]
    NotOfMethod {
        /// The option.
        option: &'static str,
        /// The methods that take it.
        takers: &'static [Method],
        /// The method of the run.
        method: Method,
    },
    /// Two options that do not go together.
    #[error("{first} and {second} do not go together")]
    NotTogether {
        /// One of them.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// The caller ended the run.
    #[error("cancelled")]
    Cancelled,
    /// The buffers are no mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

fn names(methods: &[Method]) -> String {
    let names: Vec<_> = methods.iter().map(|m| m.name()).collect();
    match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => names.concat(),
    }
}
