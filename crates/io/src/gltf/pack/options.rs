//! Options and report of packing.

use crate::error::Warning;
use crate::format::Format;
use crate::material::Textures;
use crate::sizes::Sizes;
use crate::vertex_cache::CacheUse;

/// Compression of the geometry and the animations of a glTF file. Both are lossless.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Compression {
    /// None.
    #[default]
    None,
    /// By `EXT_meshopt_compression`, which most programs read.
    Meshopt,
    /// By `KHR_meshopt_compression`, its successor: somewhat smaller, read by fewer programs.
    MeshoptKhr,
}

impl Compression {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::None, Self::Meshopt, Self::MeshoptKhr];

    /// Returns its name, as on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Meshopt => "meshopt",
            Self::MeshoptKhr => "meshopt-khr",
        }
    }

    /// Returns the name of its extension.
    pub(crate) const fn extension(self) -> Option<&'static str> {
        match self {
            Self::None => None,
            Self::Meshopt => Some("EXT_meshopt_compression"),
            Self::MeshoptKhr => Some("KHR_meshopt_compression"),
        }
    }
}

/// Makes glTF files smaller. The default changes nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Packing {
    /// Compression of geometry and animations.
    pub compression: Compression,
    /// Round attributes and animations to fewer bits: positions to 14, normals, tangents, colours and weights
    /// to 8; if they are compressed as well, texture coordinates and rotations to 12, translations and scales
    /// to 16. Needs `KHR_mesh_quantization`.
    pub quantize: bool,
}

impl Packing {
    /// Returns packing with these options.
    pub const fn new(compression: Compression, quantize: bool) -> Self {
        Self { compression, quantize }
    }

    /// Returns true if it changes anything.
    pub const fn is_needed(self) -> bool {
        self.quantize || !matches!(self.compression, Compression::None)
    }
}

/// Options for writing a scene. From a [`Format`], it is one without packing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SceneFormat {
    /// glTF, GLB or 3MF; see [`Format::keeps_scenes`].
    pub format: Format,
    /// Packing of its data, in glTF and GLB.
    pub packing: Packing,
    /// [`Textures::None`] leaves out the materials of a 3MF. No other value, and no other format, makes a difference.
    pub textures: Textures,
}

impl SceneFormat {
    /// Returns a format with packing.
    pub const fn new(format: Format, packing: Packing) -> Self {
        Self { format, packing, textures: Textures::Copy }
    }
}

impl From<Format> for SceneFormat {
    fn from(format: Format) -> Self {
        Self::new(format, Packing::default())
    }
}

/// Result of writing: what the format cannot hold, and what packing did. As an iterator, it gives the warnings.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Written {
    /// Warnings about what the format cannot hold.
    pub warnings: Vec<Warning>,
    /// Results of packing; `None` without it.
    pub packed: Option<PackReport>,
    /// Costs of drawing the file, without the bytes of the file; `None` if they can be read from the file
    /// ([`sizes_of_path`](crate::sizes_of_path)) or computed from the mesh.
    pub sizes: Option<Sizes>,
}

impl Written {
    /// Returns a result without packing.
    pub const fn new(warnings: Vec<Warning>) -> Self {
        Self { warnings, packed: None, sizes: None }
    }
}

impl IntoIterator for Written {
    type Item = Warning;
    type IntoIter = std::vec::IntoIter<Warning>;

    fn into_iter(self) -> Self::IntoIter {
        self.warnings.into_iter()
    }
}

/// Results of packing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PackReport {
    /// Largest differences by quantization; `None` without it.
    pub errors: Option<QuantizationErrors>,
    /// Cache use of the order of triangles and vertices before.
    pub cache_before: CacheUse,
    /// Cache use of the order of triangles and vertices in the file.
    pub cache: CacheUse,
    /// Bytes of the compressed streams before compression; 0 without it.
    pub stream_bytes: u64,
    /// Bytes of the compressed streams.
    pub packed_bytes: u64,
}

/// Largest differences that quantization makes; 0 for what the file does not have.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct QuantizationErrors {
    /// Distance of positions and of the offsets of morph targets, in the local units of their mesh.
    pub position: f64,
    /// That distance as a share of the diagonal of the mesh.
    pub position_share: f64,
    /// Angle of normals, in degrees.
    pub normal: f64,
    /// Angle of tangents, in degrees.
    pub tangent: f64,
    /// Texture coordinates, per component.
    pub uv: f64,
    /// Colours, per component.
    pub color: f64,
    /// Weights of joints, per component.
    pub weight: f64,
    /// Angle of animated rotations, in degrees.
    pub rotation: f64,
    /// Animated translations, per component.
    pub translation: f64,
    /// Animated scales and weights of morph targets, per component.
    pub scale: f64,
}

impl QuantizationErrors {
    /// Raises each value to the one in another report if that is larger.
    pub(super) fn raise(&mut self, other: Self) {
        let Self { position, position_share, normal, tangent, uv, .. } = self;
        for (mine, other) in [
            (position, other.position),
            (position_share, other.position_share),
            (normal, other.normal),
            (tangent, other.tangent),
            (uv, other.uv),
            (&mut self.color, other.color),
            (&mut self.weight, other.weight),
            (&mut self.rotation, other.rotation),
            (&mut self.translation, other.translation),
            (&mut self.scale, other.scale),
        ] {
            *mine = mine.max(other);
        }
    }

    /// Returns a sentence for users; `None` if nothing was rounded.
    pub fn sentence(&self) -> Option<String> {
        let mut parts = Vec::new();
        if self.position > 0.0 {
            let share = 100.0 * self.position_share;
            parts.push(format!("positions by {:.2e} ({share:.2e} % of the diagonal)", self.position));
        }
        let angles = [("normals", self.normal), ("tangents", self.tangent), ("rotations", self.rotation)];
        let angles = angles.into_iter().filter(|(_, x)| *x > 0.0);
        parts.extend(angles.map(|(name, x)| format!("{name} by {x:.2}°")));
        let others = [
            ("texture coordinates", self.uv),
            ("colors", self.color),
            ("joint weights", self.weight),
            ("translations", self.translation),
            ("scales", self.scale),
        ];
        let others = others.into_iter().filter(|(_, x)| *x > 0.0);
        parts.extend(others.map(|(name, x)| format!("{name} by {x:.2e}")));
        (!parts.is_empty()).then(|| format!("quantization changes at most {}", parts.join(", ")))
    }
}
