//! Materials as in 3MF: a colour with metalness and roughness, or a texture.

use std::collections::{BTreeSet, HashMap};

use lodsmith_core::model::{AlphaMode, Material, Sampler, TextureRef, Wrap};

use crate::error::Warning;
use crate::material::{ConvertedMaterial, ConvertedMaterials, image_type, left_out_warnings};

/// The materials of the objects of a file.
#[derive(Default)]
pub(super) struct Looks {
    pub(super) all: Vec<MaterialLook>,
    pub(super) pictures: Vec<Picture>,
    /// True if colours of vertices are linear factors of the colours of materials, as in glTF; else they are sRGB, and
    /// shown instead of the material.
    pub(super) has_linear_colors: bool,
    pub(super) lost: LostParts,
}

/// A material.
pub(super) struct MaterialLook {
    pub(super) name: String,
    /// Linear colour and opacity.
    pub(super) color: [f32; 4],
    pub(super) metalness: f64,
    pub(super) roughness: f64,
    /// Its image is an index into [`Looks::pictures`].
    pub(super) texture: Option<TextureRef>,
}

/// A PNG or JPEG file.
pub(super) struct Picture {
    pub(super) kind: &'static str,
    pub(super) bytes: Vec<u8>,
}

/// Identity of a texture: the image with its wrapping and filter, then the coordinates with their transform.
pub(super) type TextureKey = ((usize, [u8; 3]), (u8, [u32; 6]));

/// Returns the key of a texture.
pub(super) fn key_of(texture: &TextureRef) -> TextureKey {
    let TextureRef { image, uv_set, transform: [[a, b, c], [d, e, f]], sampler } = *texture;
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    };
    let sampler = [wrap(sampler.wrap_u), wrap(sampler.wrap_v), u8::from(sampler.nearest)];
    ((image, sampler), (uv_set, [a, b, c, d, e, f].map(f32::to_bits)))
}

/// Kinds of content that 3MF cannot hold.
#[derive(Default)]
pub(super) struct LostParts(Vec<&'static str>);

impl LostParts {
    /// Adds a kind, once, if this is true.
    pub(super) fn add(&mut self, is_lost: bool, what: &'static str) {
        if is_lost && !self.0.contains(&what) {
            self.0.push(what);
        }
    }

    /// Returns a warning for each kind.
    pub(super) fn warnings(&self) -> impl Iterator<Item = Warning> {
        self.0.iter().map(|what| Warning::lost(format!("3MF cannot carry {what}: dropped")))
    }
}

impl MaterialLook {
    /// Returns true if it is matt, like all surfaces without further description.
    pub(super) fn is_dull(&self) -> bool {
        self.metalness == 0.0 && self.roughness == 1.0
    }

    /// Returns true if it looks the same as no material.
    pub(super) fn is_plain(&self) -> bool {
        self.is_dull() && self.color == [1.0; 4]
    }

    fn of_converted(look: ConvertedMaterial, lost: &mut LostParts) -> Self {
        lost.add(look.normal_image.is_some(), "normal maps");
        lost.add(look.emission != [0.0; 3] || look.emission_image.is_some(), "emission");
        let [r, g, b] = look.color;
        lost.add(look.color_image.is_some() && look.is_tinted && look.color != [1.0; 3], TINTED);
        let texture = |image| TextureRef {
            image,
            uv_set: 0,
            transform: TextureRef::PLAIN,
            sampler: Sampler::default(),
        };
        Self {
            name: look.name,
            color: [r, g, b, look.alpha].map(|x| x as f32),
            metalness: look.metalness,
            roughness: look.roughness,
            texture: look.color_image.map(texture),
        }
    }

    fn of_material(material: &Material, lost: &mut LostParts) -> Self {
        lost.add(material.normal_texture.is_some(), "normal maps");
        lost.add(material.emissive != [0.0; 3], "emission");
        lost.add(material.metallic_roughness_texture.is_some(), "metallic-roughness textures");
        lost.add(material.occlusion_texture.is_some(), "occlusion textures");
        lost.add(material.unlit, "unlit materials");
        lost.add(matches!(material.alpha, AlphaMode::Mask(_)), "opacity cutoffs");
        let [r, g, b, alpha] = material.base_color;
        let is_textured = material.base_color_texture.is_some();
        lost.add(is_textured && [r, g, b] != [1.0; 3], TINTED);
        Self {
            name: material.name.clone(),
            color: [r, g, b, if material.alpha == AlphaMode::Opaque { 1.0 } else { alpha }],
            metalness: f64::from(material.metallic),
            roughness: f64::from(material.roughness),
            texture: material.base_color_texture,
        }
    }
}

const TINTED: &str = "colours of materials with a texture";

impl Looks {
    /// Returns the path of a picture in the archive.
    pub(super) fn path_of(&self, picture: usize) -> String {
        let extension = if self.pictures[picture].kind == "image/png" { "png" } else { "jpg" };
        format!("/3D/Textures/texture_{picture}.{extension}")
    }

    /// Returns the materials of a mesh, in their order.
    pub(super) fn of_converted(converted: ConvertedMaterials) -> Self {
        let mut lost = LostParts::default();
        let all = converted.all.into_iter().map(|look| MaterialLook::of_converted(look, &mut lost)).collect();
        // (Images of other types were left out before.)
        let picture = |image: crate::material::Image| Picture { kind: image.kind, bytes: image.bytes };
        let pictures = converted.images.into_iter().map(picture).collect();
        Self { all, pictures, has_linear_colors: false, lost }
    }

    /// Returns the materials of a model, in their order. Only images of used materials are loaded; an image that cannot
    /// be loaded is a warning.
    pub(super) fn of_model(
        materials: &[Material],
        used: &BTreeSet<usize>,
        mut encoded: impl FnMut(usize) -> Result<Vec<u8>, String>,
        warnings: &mut Vec<Warning>,
    ) -> Self {
        let mut looks = Self { has_linear_colors: true, ..Self::default() };
        let mut known: HashMap<usize, Option<usize>> = HashMap::new();
        let mut missing = Vec::new();
        for (i, material) in materials.iter().enumerate() {
            if !used.contains(&i) {
                looks.all.push(MaterialLook::of_material(&Material::default(), &mut LostParts::default()));
                continue;
            }
            let mut look = MaterialLook::of_material(material, &mut looks.lost);
            look.texture = look.texture.and_then(|texture| {
                let number = known.entry(texture.image).or_insert_with(|| {
                    let picture = encoded(texture.image).and_then(|bytes| match image_type(&bytes) {
                        Some(kind @ ("image/png" | "image/jpeg")) => Ok(Picture { kind, bytes }),
                        _ => Err("is neither PNG nor JPEG".to_owned()),
                    });
                    match picture {
                        Ok(picture) => {
                            looks.pictures.push(picture);
                            Some(looks.pictures.len() - 1)
                        }
                        Err(why) => {
                            missing.push(format!("images[{}] {why}", texture.image));
                            None
                        }
                    }
                });
                number.map(|image| TextureRef { image, ..texture })
            });
            looks.all.push(look);
        }
        warnings.extend(left_out_warnings(&missing));
        looks
    }
}
