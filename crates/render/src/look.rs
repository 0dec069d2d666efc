//! How surfaces are shown.

use crate::colormap::ColorMap;

/// What colours a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Shading {
    /// One colour, normals blended over faces: the mesh's own, or those of its shape.
    #[default]
    Smooth,
    /// One colour, one normal for each face.
    Flat,
    /// Materials with their images, under the lights.
    Textured,
    /// Colours of vertices, under the lights.
    VertexColors,
    /// Normals as colours, without light.
    Normals,
    /// A picture of a lit ball, looked up by the normal as the camera sees it.
    Matcap,
    /// A value for each vertex through a colour map, without light: the error.
    Heat,
}

impl Shading {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Smooth,
        Self::Flat,
        Self::Textured,
        Self::VertexColors,
        Self::Normals,
        Self::Matcap,
        Self::Heat,
    ];

    /// Its name as one types it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Smooth => "smooth",
            Self::Flat => "flat",
            Self::Textured => "textured",
            Self::VertexColors => "vertex-colors",
            Self::Normals => "normals",
            Self::Matcap => "matcap",
            Self::Heat => "heat",
        }
    }
}

/// How surfaces are shown. Colours are sRGB from 0 to 1, as people choose them.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// What colours them.
    pub shading: Shading,
    /// Colour where the shading has none of its own.
    pub surface: [f32; 3],
    /// Lines along the edges of all faces.
    pub wireframe: bool,
    /// Their colour, and how opaque they are.
    pub wire: [f32; 4],
    /// Their width in pixels.
    pub wire_width_px: f32,
    /// Whether open borders are drawn as lines.
    pub borders: bool,
    /// Whether what is broken is marked: non-manifold edges, faces without area, faces that stand twice.
    pub defects: bool,
    /// Whether faces seen from behind are left out.
    pub cull_back: bool,
    /// The colours of [`Shading::Heat`].
    pub color_map: ColorMap,
    /// The values at its ends, in the units of the model; `None` takes the largest.
    pub heat_range: Option<[f32; 2]>,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            shading: Shading::Smooth,
            surface: [0.80, 0.62, 0.40],
            wireframe: false,
            wire: [0.08, 0.09, 0.11, 0.8],
            wire_width_px: 1.0,
            borders: false,
            defects: false,
            cull_back: false,
            color_map: ColorMap::default(),
            heat_range: None,
        }
    }
}

/// What lies behind the model. Colours are sRGB from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// Nothing: the picture is transparent there.
    Transparent,
    /// One colour.
    Color([f32; 3]),
    /// From the upper edge to the lower one.
    Gradient([f32; 3], [f32; 3]),
    /// What is all around the model; without any surroundings the usual gradient.
    Surroundings {
        /// Whether it is out of focus.
        blurred: bool,
    },
}

impl Default for Background {
    fn default() -> Self {
        Self::Gradient([0.27, 0.30, 0.34], [0.13, 0.14, 0.16])
    }
}

impl Background {
    /// Colours of the upper edge and of the lower one, between which it goes evenly; `None` where it is transparent. For
    /// surroundings what stands in for them.
    pub fn edges(self) -> Option<[[f32; 3]; 2]> {
        match self {
            Self::Transparent => None,
            Self::Color(color) => Some([color; 2]),
            Self::Gradient(upper, lower) => Some([upper, lower]),
            Self::Surroundings { .. } => Self::default().edges(),
        }
    }
}
