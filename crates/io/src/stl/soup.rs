//! The triangle soup of an STL file during reading.

use crate::distinct::TripleSet;
use crate::error::Warning;

/// The common result of both encodings.
pub(super) struct Soup {
    pub(super) corners: TripleSet,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) solids: usize,
    pub(super) warnings: Vec<Warning>,
}

impl Soup {
    /// Creates an empty soup with capacity for facets whose bytes are known to exist.
    pub(super) fn with_capacity(facets: usize) -> Self {
        // A closed surface has half as many vertices as faces.
        let corners = TripleSet::with_capacity(facets / 2 + 2);
        Self { corners, triangles: Vec::with_capacity(facets), solids: 0, warnings: Vec::new() }
    }

    /// Returns the vertex index of a corner.
    #[inline]
    pub(super) fn corner(&mut self, position: [f32; 3]) -> u32 {
        // Adding zero turns minus zero into zero.
        self.corners.id_of(position.map(|x| (x + 0.0).to_bits()))
    }
}
