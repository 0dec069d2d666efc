//! Facets as they are met, and their corners.

use crate::distinct::Distinct;
use crate::error::Warning;

/// What both kinds of file give.
pub(super) struct Soup {
    pub(super) corners: Distinct,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) solids: usize,
    pub(super) warnings: Vec<Warning>,
}

impl Soup {
    /// Room for facets whose bytes have been seen to be there.
    pub(super) fn with_room_for(facets: usize) -> Self {
        // A closed surface has half as many vertices as faces.
        let corners = Distinct::with_room_for(facets / 2 + 2);
        Self { corners, triangles: Vec::with_capacity(facets), solids: 0, warnings: Vec::new() }
    }

    /// The number of a corner.
    #[inline]
    pub(super) fn corner(&mut self, position: [f32; 3]) -> u32 {
        // Adding zero makes zero of minus zero.
        self.corners.id_of(position.map(|x| (x + 0.0).to_bits()))
    }
}
