//! Typed ids: indices that differ in type by the element they name.
//!
//! Each id is a transparent `u32`, so a slice of ids converts to a slice of numbers at no cost
//! (`bytemuck::cast_slice`), and a vertex cannot be used in place of a face.

use bytemuck::{Pod, Zeroable};

macro_rules! define_id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Pod, Zeroable)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        #[repr(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// The id of the element at `index` of its buffer.
            ///
            /// # Panics
            /// If `index` does not fit 32 bits; constructors of meshes reject buffers of that length.
            #[inline]
            pub fn new(index: usize) -> Self {
                Self(u32::try_from(index).expect("a mesh has fewer than 2^32 elements of a kind"))
            }
            /// Index of the element in its buffer.
            #[inline]
            pub const fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

define_id!(
    /// A place where faces meet, whatever their attributes: one position.
    VertexId
);
define_id!(
    /// One set of attributes at a vertex; on a seam a vertex has several.
    WedgeId
);
define_id!(
    /// A triangle.
    FaceId
);
define_id!(
    /// A part of a mesh whose border is kept: the faces of a material, a group, a primitive.
    RegionId
);
define_id!(
    /// A few neighbouring triangles of one level of detail, drawn together or not at all.
    ClusterId
);
define_id!(
    /// Clusters that are simplified together.
    GroupId
);
define_id!(
    /// One side of an edge, named by the face corner that it leaves.
    HalfEdgeId
);

impl HalfEdgeId {
    /// Returns the half-edge that leaves corner `corner` (0, 1 or 2) of `face`.
    #[inline]
    pub const fn of(face: FaceId, corner: u32) -> Self {
        Self(face.0 * 3 + corner)
    }
    /// The face that the half-edge belongs to.
    #[inline]
    pub const fn face(self) -> FaceId {
        FaceId(self.0 / 3)
    }
    /// The corner of the face that it leaves: 0, 1 or 2.
    #[inline]
    pub const fn corner(self) -> usize {
        (self.0 % 3) as usize
    }
    /// The next half-edge around the same face: three consecutive ids make a triangle.
    #[inline]
    pub const fn next(self) -> Self {
        Self(if self.0 % 3 == 2 { self.0 - 2 } else { self.0 + 1 })
    }
    /// The previous half-edge around the same face.
    #[inline]
    pub const fn prev(self) -> Self {
        Self(if self.0.is_multiple_of(3) { self.0 + 2 } else { self.0 - 1 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_edges_go_round_their_face() {
        let h = HalfEdgeId::of(FaceId(7), 2);
        assert_eq!((h.face(), h.corner()), (FaceId(7), 2));
        assert_eq!(h.next(), HalfEdgeId::of(FaceId(7), 0));
        assert_eq!(h.next().next().next(), h);
        assert_eq!(h.next().prev(), h);
    }
}
