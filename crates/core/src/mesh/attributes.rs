//! Attributes beside normals, the first texture coordinates and the first colours.

/// One attribute of all wedges.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute {
    /// What it means.
    pub semantic: Semantic,
    /// Values for each wedge.
    pub width: usize,
    /// `width` values for each wedge, wedge after wedge.
    pub values: Vec<f32>,
}

impl Attribute {
    /// The values of a wedge.
    ///
    /// # Panics
    /// If there is no such wedge.
    #[inline]
    pub fn of(&self, wedge: crate::WedgeId) -> &[f32] {
        &self.values[wedge.index() * self.width..][..self.width]
    }
}

/// What an attribute means, and so how it is blended.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Semantic {
    /// Four values: a unit direction along u, and 1 or -1 for the side of the third.
    Tangent,
    /// Two values: texture coordinates of a further set, from 1.
    Uv(u8),
    /// Four values: colours of a further set, from 1.
    Color(u8),
    /// Four values: numbers of joints of a skin. With [`Semantic::Weights`] of the same set.
    Joints(u8),
    /// Four values: how much each joint pulls. The sum over all sets is 1.
    Weights(u8),
    /// Three values: what a morph target at full strength adds.
    Morph {
        /// Which morph target.
        target: u16,
        /// What it is added to.
        of: Morphed,
    },
    /// Any number of values of a name.
    Custom(String),
}

/// What a morph target moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Morphed {
    /// The position, in the units of the mesh.
    Position,
    /// The normal.
    Normal,
    /// The direction of the tangent.
    Tangent,
}

impl Semantic {
    /// What it is called for people.
    pub fn title(&self) -> &'static str {
        match self {
            Self::Tangent => "tangents",
            Self::Uv(_) => "further texture coordinates",
            Self::Color(_) => "further colours",
            Self::Joints(_) => "joints",
            Self::Weights(_) => "weights",
            Self::Morph { .. } => "morph targets",
            Self::Custom(_) => "custom attribute",
        }
    }
}
