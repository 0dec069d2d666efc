//! What a surface looks like: base colour, metal and roughness, normal map, as glTF 2.0 has them.

/// What a surface looks like.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Its name, for people.
    pub name: String,
    /// Linear colour and opacity, times the texture and the colours of vertices.
    pub base_color: [f32; 4],
    /// Colours in sRGB, with opacity.
    pub base_color_texture: Option<TextureRef>,
    /// 1 is metal, 0 is none; times blue of the texture.
    pub metallic: f32,
    /// 1 is dull, 0 a mirror; times green of the texture.
    pub roughness: f32,
    /// Roughness in green, metal in blue, linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Normals in the tangent frame of the texture coordinates: red along u, green along v (up in the image), blue out.
    pub normal_texture: Option<TextureRef>,
    /// How much of x and y of the normal map counts.
    pub normal_scale: f32,
    /// How much light gets into creases: red, linear.
    pub occlusion_texture: Option<TextureRef>,
    /// Linear light of its own, times the texture.
    pub emissive: [f32; 3],
    /// Light of its own, in sRGB.
    pub emissive_texture: Option<TextureRef>,
    /// What opacity does.
    pub alpha: AlphaMode,
    /// Whether the back is seen too.
    pub double_sided: bool,
    /// Whether light has no say: the colour is shown as it is.
    pub unlit: bool,
}

impl Material {
    /// All textures that it may have, to be changed.
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
    /// White, dull, no metal, opaque.
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

/// What opacity does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing.
    #[default]
    Opaque,
    /// What lies below is not there.
    Mask(f32),
    /// It blends with what lies behind.
    Blend,
}

/// An image on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// The image, by number in the model.
    pub image: usize,
    /// The set of texture coordinates; 0 is the mesh's own.
    pub uv_set: u8,
    /// Two rows of three: where in the image a pair of texture coordinates looks. Both count from the lower left corner
    /// of the image, as [`TriMesh::uvs`](crate::TriMesh::uvs) do; rows of [`Image`](crate::Image) count from the top, so
    /// (u, v) lies in row `(1 - v) * height`.
    pub transform: [[f32; 3]; 2],
    /// How it goes on beyond its edges, and between pixels.
    pub sampler: Sampler,
}

impl TextureRef {
    /// A transform that changes nothing.
    pub const PLAIN: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    /// Where in the image a pair of texture coordinates looks, from its lower left corner.
    #[inline]
    pub fn look_up(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        self.transform.map(|[a, b, c]| a * u + b * v + c)
    }
}

/// How an image goes on beyond its edges, and between its pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sampler {
    /// Along u.
    pub wrap_u: Wrap,
    /// Along v.
    pub wrap_v: Wrap,
    /// Whether each pixel stays a square when seen from near.
    pub nearest: bool,
}

/// How an image goes on beyond its edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Again and again.
    #[default]
    Repeat,
    /// Again and again, every second time mirrored.
    Mirror,
    /// Its last pixel.
    Clamp,
}
