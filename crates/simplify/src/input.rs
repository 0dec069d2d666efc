//! Input of a run.

use lodsmith_core::{Surface, TriMesh, VertexId};

/// The input of a run, with its attributes if they are kept.
pub(crate) struct Input<'a> {
    pub(crate) surface: Surface<'a>,
    pub(crate) mesh: Option<&'a TriMesh>,
    /// The vertex that each vertex was merged with, if a weld came first. Before the preparation: that it is to be
    /// merged with.
    pub(crate) joined: Option<Vec<VertexId>>,
}

impl Input<'_> {
    /// Returns the vertex of the surface that a vertex of the mesh became.
    pub(crate) fn joined(&self, v: VertexId) -> VertexId {
        self.joined.as_ref().map_or(v, |joined| joined[v.index()])
    }
}
