//! Appearance of surfaces and background.

use lodsmith_core::Model;

use crate::colormap::ColorMap;

/// Source of a surface's colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Shading {
    /// One colour, interpolated normals: the mesh's own, or computed from its shape.
    #[default]
    Smooth,
    /// One colour, one normal for each face.
    Flat,
    /// Materials with their textures, lit.
    Textured,
    /// Vertex colours, lit.
    VertexColors,
    /// Normals as colours, unlit.
    Normals,
    /// An image of a lit sphere, looked up by the normal in camera space.
    Matcap,
    /// A value for each vertex through a colour map, darker where the surface turns away: the error.
    Heat,
}

impl Shading {
    /// All shadings.
    pub const ALL: [Self; 7] = [
        Self::Smooth,
        Self::Flat,
        Self::Textured,
        Self::VertexColors,
        Self::Normals,
        Self::Matcap,
        Self::Heat,
    ];

    /// Returns the shading that a file intends: materials or vertex colours, if it has them.
    pub fn intended_by(model: &Model) -> Self {
        if !model.materials.is_empty() {
            Self::Textured
        } else if model.meshes.iter().any(|m| m.mesh.colors().is_some()) {
            Self::VertexColors
        } else {
            Self::Smooth
        }
    }

    /// Its name on the command line.
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

/// Appearance of surfaces. Colours are sRGB from 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Source of the colour.
    pub shading: Shading,
    /// Colour for shadings without colours of their own.
    pub surface: [f32; 3],
    /// Lines along the edges of all faces.
    pub wireframe: bool,
    /// Colour and opacity of the lines.
    pub wire: [f32; 4],
    /// Width of the lines in pixels.
    pub wire_width_px: f32,
    /// True if open borders are drawn as lines.
    pub borders: bool,
    /// True if defects are marked: non-manifold edges, faces without area, duplicate faces.
    pub defects: bool,
    /// True if back faces are culled.
    pub cull_back: bool,
    /// The colours of [`Shading::Heat`].
    pub color_map: ColorMap,
    /// Values at the ends of the colour map, in the units of the model; `None` for 0 to the largest.
    pub heat_range: Option<[f32; 2]>,
    /// Range of values that are coloured in [`Shading::Heat`]; others are grey. `None` for all values.
    pub heat_brush: Option<[f32; 2]>,
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
            heat_brush: None,
        }
    }
}

/// Background of the model. Colours are sRGB from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// Transparent.
    Transparent,
    /// One colour.
    Color([f32; 3]),
    /// A gradient from the upper edge to the lower one.
    Gradient([f32; 3], [f32; 3]),
    /// The environment; the default gradient if there is none.
    Environment {
        /// True if it is blurred.
        blurred: bool,
    },
}

impl Default for Background {
    fn default() -> Self {
        Self::Gradient([0.27, 0.30, 0.34], [0.13, 0.14, 0.16])
    }
}

impl Background {
    /// Colours of the upper and the lower edge, with a linear gradient between them; `None` if transparent.
    /// For an environment, the fallback gradient.
    pub fn edges(self) -> Option<[[f32; 3]; 2]> {
        match self {
            Self::Transparent => None,
            Self::Color(color) => Some([color; 2]),
            Self::Gradient(upper, lower) => Some([upper, lower]),
            Self::Environment { .. } => Self::default().edges(),
        }
    }
}
