//! Options of baking, and the names of their values.

/// A map that can be baked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum MapKind {
    /// Normals of the detailed surface in the tangent frame of the lighter one (MikkTSpace): red along u, green
    /// along v, blue outwards.
    Normal,
    /// Base colour and opacity: texture, factor and vertex colours of the source together, in sRGB.
    Color,
    /// Roughness in green, metallic in blue.
    MetallicRoughness,
    /// Emitted light, in sRGB.
    Emissive,
    /// The share of the directions above the surface that no face blocks.
    Occlusion,
    /// Vertex colours of the source alone, in sRGB.
    VertexColor,
    /// Distance of the detailed surface from the lighter one, in 16 bits.
    Height,
    /// Normals of the detailed surface in coordinates of the mesh.
    ObjectNormal,
    /// Mean curvature of the detailed surface: grey is flat, lighter is convex.
    Curvature,
}

impl MapKind {
    /// All kinds.
    pub const ALL: [Self; 9] = [
        Self::Normal,
        Self::Color,
        Self::MetallicRoughness,
        Self::Emissive,
        Self::Occlusion,
        Self::VertexColor,
        Self::Height,
        Self::ObjectNormal,
        Self::Curvature,
    ];

    /// Returns the name on the command line and in file names.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Color => "color",
            Self::MetallicRoughness => "metallic-roughness",
            Self::Emissive => "emissive",
            Self::Occlusion => "ao",
            Self::VertexColor => "vertex-color",
            Self::Height => "height",
            Self::ObjectNormal => "object-normal",
            Self::Curvature => "curvature",
        }
    }

    /// True if a material of glTF has a texture for it.
    pub const fn is_of_material(self) -> bool {
        matches!(
            self,
            Self::Normal | Self::Color | Self::MetallicRoughness | Self::Emissive | Self::Occlusion
        )
    }

    /// The texel where nothing was baked.
    pub(crate) const fn blank(self) -> [u8; 4] {
        match self {
            Self::Normal | Self::ObjectNormal => [128, 128, 255, 255],
            Self::Color | Self::Occlusion | Self::VertexColor => [255; 4],
            Self::MetallicRoughness => [255, 255, 0, 255],
            Self::Emissive => [0, 0, 0, 255],
            Self::Height | Self::Curvature => [128, 128, 128, 255],
        }
    }
}

/// Texture coordinates of the baked maps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AtlasMode {
    /// The coordinates of the lighter mesh, wherever they exist and do not overlap; a new atlas elsewhere.
    #[default]
    Keep,
    /// A new atlas, and one material for all of it.
    New,
}

impl AtlasMode {
    /// All modes.
    pub const ALL: [Self; 2] = [Self::Keep, Self::New];

    /// Returns the name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Keep => "keep",
            Self::New => "new",
        }
    }
}

/// Options of a bake.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BakeOptions {
    /// The maps, each at most once.
    pub maps: Vec<MapKind>,
    /// Texture coordinates.
    pub atlas: AtlasMode,
    /// Width and height of the maps in texels; `None` chooses a power of two by the detail of the source.
    pub size: Option<usize>,
    /// Rays per texel for [`MapKind::Occlusion`], within [`BakeOptions::RAYS`].
    pub rays: usize,
    /// Faces farther than this do not occlude; in units of the model. `None` has no limit.
    pub occlusion_distance: Option<f64>,
    /// Seed of the directions of rays.
    pub seed: u64,
    /// True if the lighter model was made from the detailed one: their meshes, materials and coordinates are the
    /// same, in the same order.
    pub is_same_model: bool,
    /// Bytes of memory that the process may take; a bake that needs more is refused before it begins.
    pub memory: u64,
}

impl Default for BakeOptions {
    /// Returns options without maps.
    fn default() -> Self {
        Self::new([])
    }
}

impl BakeOptions {
    /// The sizes that [`BakeOptions::size`] may have.
    pub const SIZES: std::ops::RangeInclusive<usize> = 16..=16384;
    /// The numbers of rays that [`BakeOptions::rays`] may have.
    pub const RAYS: std::ops::RangeInclusive<usize> = 1..=65536;

    /// Makes the default options for some maps.
    pub fn new(maps: impl IntoIterator<Item = MapKind>) -> Self {
        let mut maps: Vec<MapKind> = maps.into_iter().collect();
        maps.sort_unstable();
        maps.dedup();
        Self {
            maps,
            atlas: AtlasMode::default(),
            size: None,
            rays: 32,
            occlusion_distance: None,
            seed: 0,
            is_same_model: false,
            memory: u64::MAX,
        }
    }
}
