//! Attributes other than normals, the first texture coordinates and the first colours.

/// One attribute of all wedges.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Attribute {
    /// Meaning of the values.
    pub semantic: Semantic,
    /// Number of values for each wedge.
    pub width: usize,
    /// `width` values for each wedge, wedge after wedge.
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::plain"))]
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

/// Meaning of an attribute, which determines how it is blended.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Semantic {
    /// Four values: a unit direction along u, and 1 or -1 for the sign of the bitangent.
    Tangent,
    /// Two values: texture coordinates of a further set, from 1.
    Uv(u8),
    /// Four values: colours of a further set, from 1.
    Color(u8),
    /// Four values: joint numbers of a skin. Used with [`Semantic::Weights`] of the same set.
    Joints(u8),
    /// Four values: weights of the joints. The sum over all sets is 1.
    Weights(u8),
    /// Three values: offsets of a morph target at full strength.
    Morph {
        /// Number of the morph target.
        target: u16,
        /// The property that the offsets are added to.
        of: Morphed,
    },
    /// Any number of values under a name, which may be blended.
    Custom(String),
    /// Whole numbers under a name that identify something: a feature, a label, a row of a table. They are
    /// never blended: a wedge of a result has the values of one source wedge, and writers keep their type.
    /// Values are exact up to 16,777,216.
    Discrete {
        /// The name.
        name: String,
        /// The type of the numbers in the file that was read and in files that are written.
        of: IntegerType,
    },
}

/// An integer type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum IntegerType {
    /// 8 bits, signed.
    I8,
    /// 8 bits, unsigned.
    U8,
    /// 16 bits, signed.
    I16,
    /// 16 bits, unsigned.
    U16,
    /// 32 bits, signed.
    I32,
    /// 32 bits, unsigned.
    U32,
}

impl IntegerType {
    /// All types.
    pub const ALL: [Self; 6] = [Self::I8, Self::U8, Self::I16, Self::U16, Self::I32, Self::U32];

    /// The smallest and the largest number of the type.
    pub const fn range(self) -> [i64; 2] {
        match self {
            Self::I8 => [i8::MIN as i64, i8::MAX as i64],
            Self::U8 => [0, u8::MAX as i64],
            Self::I16 => [i16::MIN as i64, i16::MAX as i64],
            Self::U16 => [0, u16::MAX as i64],
            Self::I32 => [i32::MIN as i64, i32::MAX as i64],
            Self::U32 => [0, u32::MAX as i64],
        }
    }
    /// The code of the type in the project's own files: its index in [all](Self::ALL).
    pub const fn number(self) -> u32 {
        self as u32
    }
    /// Returns the type of a [number](Self::number).
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.get(number as usize).copied()
    }

    /// True if a value is a number of the type.
    pub fn holds(self, x: f32) -> bool {
        let [low, high] = self.range().map(|x| x as f64);
        x.fract() == 0.0 && (low..=high).contains(&f64::from(x))
    }
}

/// The property that a morph target changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Morphed {
    /// The position, in the units of the mesh.
    Position,
    /// The normal.
    Normal,
    /// The direction of the tangent.
    Tangent,
}

impl Semantic {
    /// Display name.
    pub fn title(&self) -> &'static str {
        match self {
            Self::Tangent => "tangents",
            Self::Uv(_) => "further texture coordinates",
            Self::Color(_) => "further colours",
            Self::Joints(_) => "joints",
            Self::Weights(_) => "weights",
            Self::Morph { .. } => "morph targets",
            Self::Custom(_) => "custom attribute",
            Self::Discrete { .. } => "discrete attribute",
        }
    }
    /// The name of an attribute that has one of its own.
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::Custom(name) | Self::Discrete { name, .. } => Some(name),
            _ => None,
        }
    }
    /// True if its values are whole numbers that identify something and are never blended. (Joints are too,
    /// but are handled with their weights.)
    pub fn is_discrete(&self) -> bool {
        matches!(self, Self::Discrete { .. })
    }
}
