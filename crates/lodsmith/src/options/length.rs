//! Lengths that options have.

/// A length in the units of the mesh, or as a fraction of the diagonal of its bounding box.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Length {
    /// In the units of the mesh.
    Units(f64),
    /// A fraction of the diagonal: 0.001 is 0.1 %.
    OfDiagonal(f64),
}

impl Length {
    /// Returns the length in the units of a mesh with this diagonal.
    pub fn in_units(self, diagonal: f64) -> f64 {
        match self {
            Self::Units(x) => x,
            Self::OfDiagonal(x) => x * diagonal,
        }
    }
}
