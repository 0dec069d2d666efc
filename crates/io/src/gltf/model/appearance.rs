//! Materials, and the images that they use.

use std::borrow::Cow;
use std::sync::Arc;

use lodsmith_core::Image;
use lodsmith_core::model::{AlphaMode, Material, Sampler, TextureRef, Wrap};
use serde_json::Value;

use crate::error::Warning;
use crate::excerpt::excerpt;
use crate::gltf::Scene;
use crate::gltf::buffers::{Buffers, data_uri, inline_data, path_of};
use crate::gltf::container::{list, number};
use crate::gltf::texture_transform::{finite, numbers, transform};
use crate::material::image_type;
use crate::model::ImageQueue;

pub(super) fn read(scene: &Scene, buffers: &Buffers<'_>) -> (Vec<Material>, Vec<Arc<Image>>, Vec<Warning>) {
    let mut pictures = ImageQueue::default();
    let all = list(&scene.json, "materials").iter();
    let mut materials: Vec<Material> = all.map(|m| material(&scene.json, m, &mut pictures)).collect();
    let encoded = |index| {
        let bytes = bytes_of(scene, buffers, index)?;
        if image_type(&bytes) == Some("image/ktx2") {
            return Err("is a KTX2 image, which is not supported".to_owned());
        }
        Ok((bytes, String::new()))
    };
    let (images, warnings) = pictures.decode(&mut materials, scene.limits, encoded, |_, _| true);
    (materials, images, warnings)
}

/// Returns the materials; their textures refer to images by index in the file.
pub(super) fn encoded(scene: &Scene) -> Vec<Material> {
    let mut pictures = ImageQueue::default();
    let all = list(&scene.json, "materials").iter();
    let mut materials: Vec<Material> = all.map(|m| material(&scene.json, m, &mut pictures)).collect();
    for texture in materials.iter_mut().flat_map(Material::textures_mut).flatten() {
        texture.image = pictures.in_file(texture.image);
    }
    materials
}

/// Returns the base colour textures alone, one per material, with their images; warns of images that are too large.
pub(super) fn base_colors(
    scene: &Scene,
    buffers: &Buffers<'_>,
) -> (Vec<Option<TextureRef>>, Vec<Arc<Image>>, Vec<Warning>) {
    let (mut all, mut wanted) = (ImageQueue::default(), ImageQueue::default());
    let base_color = |m: &Value| {
        let of_all = material(&scene.json, m, &mut all).base_color_texture;
        let base_color_texture =
            of_all.map(|t| TextureRef { image: wanted.register(all.in_file(t.image)), ..t });
        Material { base_color_texture, ..Material::default() }
    };
    let mut materials: Vec<Material> = list(&scene.json, "materials").iter().map(base_color).collect();
    let encoded = |index| bytes_of(scene, buffers, index).map(|bytes| (bytes, String::new()));
    let (images, warnings) = wanted.decode_colors(&mut materials, scene.limits, encoded);
    (materials.into_iter().map(|m| m.base_color_texture).collect(), images, warnings)
}

fn material(json: &Value, material: &Value, pictures: &mut ImageQueue) -> Material {
    let extensions = &material["extensions"];
    let older = &extensions["KHR_materials_pbrSpecularGlossiness"];
    let usual = &material["pbrMetallicRoughness"];
    // The core properties beside the older extension are a fallback for readers without it.
    let (surface, [color, color_texture]) = if older.is_object() {
        (older, ["diffuseFactor", "diffuseTexture"])
    } else {
        (usual, ["baseColorFactor", "baseColorTexture"])
    };
    let factor = |value: &Value, otherwise: f32| finite(value).unwrap_or(otherwise);
    let (metallic, roughness) = if older.is_object() {
        (0.0, 1.0 - factor(&older["glossinessFactor"], 1.0))
    } else {
        (factor(&usual["metallicFactor"], 1.0), factor(&usual["roughnessFactor"], 1.0))
    };
    let strength = &extensions["KHR_materials_emissive_strength"]["emissiveStrength"];
    let strength = factor(strength, 1.0);
    let mut texture = |slot: &Value| texture(json, slot, pictures);
    Material {
        name: material["name"].as_str().unwrap_or_default().to_owned(),
        base_color: numbers(&surface[color], [1.0; 4]),
        base_color_texture: texture(&surface[color_texture]),
        metallic,
        roughness,
        metallic_roughness_texture: if older.is_object() {
            None
        } else {
            texture(&usual["metallicRoughnessTexture"])
        },
        normal_texture: texture(&material["normalTexture"]),
        normal_scale: factor(&material["normalTexture"]["scale"], 1.0),
        occlusion_texture: texture(&material["occlusionTexture"]),
        emissive: numbers(&material["emissiveFactor"], [0.0; 3]).map(|x| x * strength),
        emissive_texture: texture(&material["emissiveTexture"]),
        alpha: match material["alphaMode"].as_str() {
            Some("MASK") => AlphaMode::Mask(factor(&material["alphaCutoff"], 0.5)),
            Some("BLEND") => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        },
        double_sided: material["doubleSided"] == true,
        unlit: extensions["KHR_materials_unlit"].is_object(),
    }
}

fn texture(json: &Value, slot: &Value, pictures: &mut ImageQueue) -> Option<TextureRef> {
    let texture = list(json, "textures").get(number(&slot["index"])?)?;
    let others = texture["extensions"].as_object().into_iter().flat_map(|e| e.values());
    // All programs read the plain image; few read one in an extension.
    let image = std::iter::once(texture).chain(others).find_map(|t| number(&t["source"]))?;
    let moved = &slot["extensions"]["KHR_texture_transform"];
    let set = if moved["texCoord"].is_null() { &slot["texCoord"] } else { &moved["texCoord"] };
    let uv_set = if set.is_null() { 0 } else { u8::try_from(number(set)?).ok()? };
    let sampler = number(&texture["sampler"]).and_then(|s| list(json, "samplers").get(s));
    let sampler = sampler.unwrap_or(&Value::Null);
    // Codes of OpenGL.
    let wrap = |way: &str| match number(&sampler[way]) {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    let sampler = Sampler {
        wrap_u: wrap("wrapS"),
        wrap_v: wrap("wrapT"),
        nearest: number(&sampler["magFilter"]) == Some(9728),
    };
    Some(TextureRef { image: pictures.register(image), uv_set, transform: transform(moved), sampler })
}

/// Returns the bytes of an image: from a buffer, from a data URI, or from a file in the folder of the scene.
pub(super) fn bytes_of<'b>(
    scene: &Scene,
    buffers: &'b Buffers<'_>,
    index: usize,
) -> Result<Cow<'b, [u8]>, String> {
    let image = list(&scene.json, "images").get(index).ok_or("does not exist")?;
    let at = format!("images[{index}]");
    let Some(uri) = image["uri"].as_str() else {
        let view = number(&image["bufferView"]).ok_or("has neither a uri nor a view")?;
        return buffers.view(view, &at).map(|v| Cow::Borrowed(v.bytes)).map_err(|e| e.to_string());
    };
    if let Some(data) = inline_data(uri) {
        return data_uri(data, &at).map(Cow::Owned).map_err(|e| e.to_string());
    }
    let path = path_of(uri)?;
    if !scene.assets.has_folder() {
        return Err("is a file, but no folder is known to search for it".to_owned());
    }
    let shown = excerpt(uri);
    let file = scene.assets.find(&path).map_err(|refusal| format!("({shown}) {}", refusal.reason()))?;
    file.read(scene.limits.max_bytes()).map(Cow::Owned).map_err(|why| format!("({shown}) {why}"))
}
