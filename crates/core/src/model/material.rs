//! Materials: base colour, metallic and roughness, normal map, as in glTF 2.0.

/// A material.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Material {
    /// Display name.
    pub name: String,
    /// Linear base colour and opacity, multiplied by the texture and the vertex colours.
    pub base_color: [f32; 4],
    /// Base colour texture in sRGB, with opacity.
    pub base_color_texture: Option<TextureRef>,
    /// 1 is metal, 0 is a dielectric; multiplied by blue of the texture.
    pub metallic: f32,
    /// 1 is dull, 0 a mirror; multiplied by green of the texture.
    pub roughness: f32,
    /// Texture with roughness in green and metallic in blue, linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Normal map in the tangent frame of the texture coordinates: red along u, green along v (up in the
    /// image), blue outwards.
    pub normal_texture: Option<TextureRef>,
    /// Scale of x and y of the normal map.
    pub normal_scale: f32,
    /// Ambient occlusion: the light that reaches creases, in red, linear.
    pub occlusion_texture: Option<TextureRef>,
    /// Linear emitted light, multiplied by the texture.
    pub emissive: [f32; 3],
    /// Emission texture, in sRGB.
    pub emissive_texture: Option<TextureRef>,
    /// Use of the opacity.
    pub alpha: AlphaMode,
    /// True if back faces are drawn too.
    pub double_sided: bool,
    /// True if the colour is shown without lighting.
    pub unlit: bool,
}

impl Material {
    /// All texture slots, mutable.
    pub fn textures_mut(&mut self) -> [&mut Option<TextureRef>; 5] {
        [
            &mut self.base_color_texture,
            &mut self.metallic_roughness_texture,
            &mut self.normal_texture,
            &mut self.occlusion_texture,
            &mut self.emissive_texture,
        ]
    }
}

impl Default for Material {
    /// White, dull, not metallic, opaque.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [1.0; 4],
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            emissive: [0.0; 3],
            emissive_texture: None,
            alpha: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
        }
    }
}

/// Use of the opacity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum AlphaMode {
    /// Opacity is ignored.
    #[default]
    Opaque,
    /// Pixels with an opacity below this cutoff are not drawn.
    Mask(f32),
    /// Blended with the background.
    Blend,
}

/// A texture: an image with its coordinates and sampler.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TextureRef {
    /// Index of the image in the model.
    pub image: usize,
    /// Set of texture coordinates; 0 is the mesh's first.
    pub uv_set: u8,
    /// Two rows of three that transform texture coordinates to image coordinates. Both count from the lower
    /// left corner of the image, as [`TriMesh::uvs`](crate::TriMesh::uvs) do; rows of [`Image`](crate::Image)
    /// count from the top, so (u, v) lies in row `(1 - v) * height`.
    pub transform: [[f32; 3]; 2],
    /// Wrapping and filtering.
    pub sampler: Sampler,
}

impl TextureRef {
    /// The identity transform.
    pub const PLAIN: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    /// Transforms texture coordinates to image coordinates, from its lower left corner.
    #[inline]
    pub fn look_up(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        self.transform.map(|[a, b, c]| a * u + b * v + c)
    }
}

/// Wrapping and filtering of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sampler {
    /// Wrapping along u.
    pub wrap_u: Wrap,
    /// Wrapping along v.
    pub wrap_v: Wrap,
    /// True for nearest-neighbour magnification.
    pub nearest: bool,
}

/// Wrapping of an image beyond its edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Wrap {
    /// Repeats.
    #[default]
    Repeat,
    /// Repeats, every second time mirrored.
    Mirror,
    /// Clamps to the last pixel.
    Clamp,
}
