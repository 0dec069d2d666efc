//! What a run is given.

use lodsmith_core::{Surface, TriMesh, VertexId};

/// The input of a run; attributes where they are kept.
pub(crate) struct Input<'a> {
    pub(crate) surface: Surface<'a>,
    pub(crate) mesh: Option<&'a TriMesh>,
    /// The vertex that each one was joined with, where a weld came first.
    pub(crate) joined: Option<Vec<VertexId>>,
}

impl Input<'_> {
    /// The vertex of the surface that a vertex of the mesh became.
    pub(crate) fn joined(&self, v: VertexId) -> VertexId {
        self.joined.as_ref().map_or(v, |joined| joined[v.index()])
    }
}
