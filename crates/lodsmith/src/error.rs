//! Errors of simplification.

use lodsmith_core::MeshError;

use crate::options::MethodKind;

/// Why a mesh could not be simplified.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimplifyError {
    /// The mesh has no face with an area, or none is left after cleaning.
    #[error("the mesh has no face with an area ({faces} faces read)")]
    NoFaces {
        /// Number of faces of the input.
        faces: usize,
    },
    /// An option is out of range.
    #[error("{option} must be {wanted}, not {got}")]
    BadOption {
        /// Name of the option.
        option: &'static str,
        /// The permitted range.
        wanted: &'static str,
        /// The value given.
        got: f64,
    },
    /// A list does not have one entry for each vertex.
    #[error("{option} has {got} entries for {wanted} vertices")]
    WrongLength {
        /// Name of the option.
        option: &'static str,
        /// The number of vertices.
        wanted: usize,
        /// The length of the list.
        got: usize,
    },
    /// An option that the method does not have.
    #[error("{option} is not an option of method {method}, but of {takers}", method = method.name(), takers = names(takers))]
    NotOfMethod {
        /// Name of the option.
        option: &'static str,
        /// The methods that have it.
        takers: &'static [MethodKind],
        /// The method of the run.
        method: MethodKind,
    },
    /// Two options that exclude each other.
    #[error("{first} and {second} do not go together")]
    NotTogether {
        /// Name of one option.
        first: &'static str,
        /// Name of the other option.
        second: &'static str,
    },
    /// An option that has no effect without another one.
    #[error("{option} only works together with {other}")]
    Needs {
        /// Name of the option.
        option: &'static str,
        /// Name of the option that it needs.
        other: &'static str,
    },
    /// A value of a vertex is out of range.
    #[error("{option} must be {wanted}, not {got} at vertex {vertex}")]
    BadVertexValue {
        /// Name of the list.
        option: &'static str,
        /// The permitted range.
        wanted: &'static str,
        /// Index of the vertex.
        vertex: usize,
        /// Its value.
        got: f64,
    },
    /// The control cancelled the run.
    #[error("cancelled")]
    Cancelled,
    /// The buffers are not a valid mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

impl SimplifyError {
    /// True for an error in the options, not in the mesh or its data.
    pub fn is_usage(&self) -> bool {
        use SimplifyError::{BadOption, Needs, NotOfMethod, NotTogether};
        matches!(self, BadOption { .. } | Needs { .. } | NotOfMethod { .. } | NotTogether { .. })
    }
}

fn names(methods: &[MethodKind]) -> String {
    let names: Vec<_> = methods.iter().map(|m| m.name()).collect();
    match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => names.concat(),
    }
}
