//! Models of a mesh from a format without scenes, with the materials of its regions.

use std::borrow::Cow;
use std::sync::Arc;

use lodsmith_core::model::{AlphaMode, Material, Sampler, TextureRef};
use lodsmith_core::{Image, Model, TriMesh};

use super::decode::ImageQueue;
use crate::error::Warning;
use crate::limits::Limits;
use crate::material::{ConvertedMaterial, ConvertedMaterials, Purpose, Regions, convert_materials};

/// The index of the normal map in [`Material::textures_mut`].
const NORMAL_TEXTURE_SLOT: usize = 2;

pub(super) fn model(mesh: Arc<TriMesh>, regions: &Regions, limits: Limits) -> (Model, Vec<Warning>) {
    let looks = convert_materials(&mesh, regions, Purpose::Picture);
    let mut model = Model::of_mesh(mesh);
    let Some(ConvertedMaterials { all, images, of_region, mut warnings }) = looks else {
        return (model, Vec::new());
    };
    let mut pictures = ImageQueue::default();
    let mut materials: Vec<Material> = all.into_iter().map(|look| material(look, &mut pictures)).collect();
    let encoded = |i: usize| Ok((Cow::Borrowed(&*images[i].bytes), images[i].name.clone()));
    // `map_bump` is a height map as often as a normal map; height maps are grey.
    let is_grey = |image: &Image| image.pixels().iter().all(|[r, g, b, _]| r == g && g == b);
    let (decoded, more) = pictures.decode(&mut materials, limits, encoded, |slot, image| {
        slot != NORMAL_TEXTURE_SLOT || !is_grey(image)
    });
    warnings.extend(more);
    model.images = decoded;
    model.materials = materials;
    let of_mesh = &mut model.meshes[0].materials;
    for (place, material) in of_mesh.iter_mut().zip(of_region) {
        *place = material;
    }
    (model, warnings)
}

/// A base colour image, and its mapping by texture coordinates. (The image index of the mapping has no
/// meaning here.)
pub type BaseColor = (Arc<Image>, TextureRef);

/// Returns the base colours of the regions of a mesh; see
/// [`Loaded::base_colors`](crate::Loaded::base_colors).
pub(super) fn base_colors(
    mesh: &TriMesh,
    regions: &Regions,
    limits: Limits,
) -> (Vec<Option<BaseColor>>, Vec<Warning>) {
    let Some(ConvertedMaterials { all, images, of_region, .. }) =
        convert_materials(mesh, regions, Purpose::Picture)
    else {
        return Default::default();
    };
    let mut pictures = ImageQueue::default();
    let base_color = |look: ConvertedMaterial| {
        let look = ConvertedMaterial { normal_image: None, emission_image: None, ..look };
        material(look, &mut pictures)
    };
    let mut materials: Vec<Material> = all.into_iter().map(base_color).collect();
    let encoded = |i: usize| Ok((Cow::Borrowed(&*images[i].bytes), images[i].name.clone()));
    let (decoded, warnings) = pictures.decode_colors(&mut materials, limits, encoded);
    let of = |at: Option<usize>| {
        let texture = materials.get(at?)?.base_color_texture?;
        Some((decoded[texture.image].clone(), texture))
    };
    (of_region.into_iter().map(of).collect(), warnings)
}

fn material(look: ConvertedMaterial, pictures: &mut ImageQueue) -> Material {
    let mut texture = |image: Option<usize>| {
        let image = pictures.register(image?);
        Some(TextureRef { image, uv_set: 0, transform: TextureRef::PLAIN, sampler: Sampler::default() })
    };
    let [r, g, b] = if look.color_image.is_some() && !look.is_tinted { [1.0; 3] } else { look.color };
    let is_blended = look.alpha < 1.0 || (look.is_blended && look.color_image.is_some());
    // Converts a Phong exponent to the roughness of a highlight of the same width; shading uses its square.
    let roughness = look.shininess.map_or(look.roughness, |n| (2.0 / (n.max(0.0) + 2.0)).powf(0.25));
    Material {
        name: look.name,
        base_color: [r, g, b, look.alpha].map(|x| x as f32),
        base_color_texture: texture(look.color_image),
        metallic: look.metalness as f32,
        roughness: if look.roughness < 1.0 { look.roughness } else { roughness } as f32,
        normal_texture: texture(look.normal_image),
        emissive: look.emission.map(|x| x as f32),
        emissive_texture: texture(look.emission_image),
        alpha: if is_blended { AlphaMode::Blend } else { AlphaMode::Opaque },
        // The format has no backface culling.
        double_sided: true,
        ..Material::default()
    }
}
