//! Replacement of the materials of a scene by materials with their own images.

use std::collections::BTreeSet;
use std::sync::Arc;

use lodsmith_core::model::{AlphaMode, Material};
use serde_json::{Value, json};

use super::Scene;
use super::container::{list, list_mut, number};
use super::features::take_replaced_by_material;
use super::inventory::MATERIALS_OF_MODELS;
use super::lists::{add_extension, append, take_extension};
use super::unused_materials::drop_unused_materials;
use super::vrm::append_material;
use crate::excerpt::excerpt;

/// A texture of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextureSlot {
    /// Base colour and opacity.
    BaseColor,
    /// Roughness in green, metallic in blue.
    MetallicRoughness,
    /// Normals in the tangent frame.
    Normal,
    /// Occlusion in red.
    Occlusion,
    /// Emitted light.
    Emissive,
}

/// An image for a slot.
#[derive(Clone, Debug)]
pub struct SlotImage {
    /// The slot.
    pub slot: TextureSlot,
    /// Name of the image.
    pub name: String,
    /// A PNG file.
    pub png: Arc<Vec<u8>>,
}

/// A material that is put into a scene.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct NewMaterial {
    /// Factors and modes; its textures do not count.
    pub look: Material,
    /// The material that keeps its extensions, extras and all textures that are not replaced; its factors change where
    /// a texture does. `None` makes a new one from `look`.
    pub base: Option<usize>,
    /// The textures, which use the first texture coordinates.
    pub images: Vec<SlotImage>,
}

impl NewMaterial {
    /// Describes a material.
    pub fn new(look: Material, base: Option<usize>, images: Vec<SlotImage>) -> Self {
        Self { look, base, images }
    }
}

/// The older workflow, whose textures replace the core textures.
const OLDER: &str = "KHR_materials_pbrSpecularGlossiness";
const UNLIT: &str = "KHR_materials_unlit";
/// Emission above 1.
const STRENGTH: &str = "KHR_materials_emissive_strength";

impl Scene {
    /// Adds a material with its images, identical images once; returns its index.
    pub fn add_material(&mut self, new: &NewMaterial) -> usize {
        let kept = new.base.and_then(|m| list(&self.json, "materials").get(m)).cloned();
        let mut material = kept.unwrap_or_else(|| made(&new.look));
        let mut added: Vec<(&SlotImage, usize)> = Vec::new();
        for image in &new.images {
            let same = added.iter().find(|(other, _)| Arc::ptr_eq(&other.png, &image.png));
            let texture = same.map_or_else(|| self.add_texture(image), |(_, texture)| *texture);
            added.push((image, texture));
            put_texture(&mut material, image.slot, texture, &new.look);
        }
        if new.look.unlit {
            add_extension(&mut self.json, "extensionsUsed", UNLIT);
        }
        if material["extensions"][STRENGTH].is_object() {
            add_extension(&mut self.json, "extensionsUsed", STRENGTH);
        }
        let added = append_material(&mut self.json, material);
        if new.base.is_none() {
            self.atlas_materials.insert(added);
        }
        added
    }

    /// Returns the names of what some materials have and a [`Material`] does not hold: extensions, in alphabetical order,
    /// and `extras`.
    pub fn further_data(&self, materials: &[usize]) -> Vec<String> {
        let all = list(&self.json, "materials");
        let named = || materials.iter().filter_map(|m| all.get(*m));
        let is_further = |name: &&String| {
            let kind = name.strip_prefix("KHR_materials_");
            !kind.is_some_and(|kind| MATERIALS_OF_MODELS.contains(&kind))
        };
        let extensions = named().filter_map(|m| m["extensions"].as_object());
        let names: BTreeSet<&String> = extensions.flat_map(|e| e.keys()).filter(is_further).collect();
        let extras = named().any(|m| !m["extras"].is_null()).then(|| "extras".to_owned());
        names.into_iter().take(16).map(|name| excerpt(name)).chain(extras).collect()
    }

    /// Sets the material of all primitives of a mesh with triangles or, with `primitive`, of one. Other materials that
    /// variants choose for it are left out; a warning comes with those of writing the scene.
    pub fn set_material(&mut self, mesh: usize, primitive: Option<usize>, material: usize) {
        let Some(mesh) = list_mut(&mut self.json, "meshes").get_mut(mesh) else { return };
        let has_new_uvs = self.atlas_materials.contains(&material);
        for (i, entry) in list_mut(mesh, "primitives").iter_mut().enumerate() {
            if entry.is_object() && primitive.is_none_or(|p| p == i) {
                entry["material"] = material.into();
                take_replaced_by_material(entry, has_new_uvs, &mut self.losses);
            }
        }
    }

    /// Makes the material of a primitive of a mesh double-sided, also for other primitives that use it; a primitive
    /// without a material gets one.
    pub fn set_double_sided(&mut self, mesh: usize, primitive: usize) {
        let entry = list(&self.json, "meshes").get(mesh).and_then(|m| list(m, "primitives").get(primitive));
        let Some(entry) = entry else { return };
        match number(&entry["material"]) {
            Some(material) => {
                if let Some(material) = list_mut(&mut self.json, "materials").get_mut(material) {
                    material["doubleSided"] = true.into();
                }
            }
            None => {
                let material = append_material(&mut self.json, json!({ "doubleSided": true }));
                list_mut(&mut self.json["meshes"][mesh], "primitives")[primitive]["material"] =
                    material.into();
            }
        }
    }

    /// Removes materials that nothing uses, the textures and images that only they used, and samplers without textures.
    /// Animations and expressions of avatars that refer to them are removed too; the warnings come with those of
    /// writing the scene.
    pub fn drop_unused_materials(&mut self) {
        self.atlas_materials.clear();
        drop_unused_materials(&mut self.json, &mut self.losses);
    }

    /// Adds a texture with an image; an existing one is reused.
    fn add_texture(&mut self, image: &SlotImage) -> usize {
        let buffer = self.buffers.iter().position(|b| Arc::ptr_eq(b, &image.png));
        let known = buffer.and_then(|b| {
            let view =
                list(&self.json, "bufferViews").iter().position(|v| number(&v["buffer"]) == Some(b))?;
            let image =
                list(&self.json, "images").iter().position(|i| number(&i["bufferView"]) == Some(view))?;
            list(&self.json, "textures").iter().position(|t| number(&t["source"]) == Some(image))
        });
        if let Some(known) = known {
            return known;
        }
        let length = image.png.len();
        let buffer = append(&mut self.json, "buffers", json!({ "byteLength": length }));
        let view = append(&mut self.json, "bufferViews", json!({ "buffer": buffer, "byteLength": length }));
        self.buffers.push(image.png.clone());
        let entry = json!({ "name": image.name, "mimeType": "image/png", "bufferView": view });
        let source = append(&mut self.json, "images", entry);
        // Linear filtering between texels and between mipmaps.
        let sampler = append(&mut self.json, "samplers", json!({ "magFilter": 9729, "minFilter": 9987 }));
        append(&mut self.json, "textures", json!({ "sampler": sampler, "source": source }))
    }
}

/// Returns a material from its properties.
fn made(look: &Material) -> Value {
    let mut material = json!({});
    if !look.name.is_empty() {
        material["name"] = look.name.clone().into();
    }
    material["pbrMetallicRoughness"] = json!({
        "baseColorFactor": look.base_color,
        "metallicFactor": look.metallic,
        "roughnessFactor": look.roughness,
    });
    if look.emissive != [0.0; 3] {
        set_emission(&mut material, look.emissive);
    }
    match look.alpha {
        AlphaMode::Opaque => {}
        AlphaMode::Mask(cutoff) => {
            material["alphaMode"] = "MASK".into();
            material["alphaCutoff"] = cutoff.into();
        }
        AlphaMode::Blend => material["alphaMode"] = "BLEND".into(),
    }
    if look.double_sided {
        material["doubleSided"] = true.into();
    }
    if look.unlit {
        material["extensions"][UNLIT] = json!({});
    }
    material
}

/// Sets the emission of a material, by an extension where it is above 1.
fn set_emission(material: &mut Value, emission: [f32; 3]) {
    let strength = emission.into_iter().fold(1.0, f32::max);
    material["emissiveFactor"] = json!(emission.map(|x| x / strength));
    take_extension(material, STRENGTH);
    if strength > 1.0 {
        if !material["extensions"].is_object() {
            material["extensions"] = json!({});
        }
        material["extensions"][STRENGTH] = json!({ "emissiveStrength": strength });
    }
}

/// Puts a texture into a material, with the factors of `look`.
fn put_texture(material: &mut Value, slot: TextureSlot, texture: usize, look: &Material) {
    let reference = json!({ "index": texture });
    if !material.is_object() {
        *material = json!({});
    }
    if !material["pbrMetallicRoughness"].is_object() {
        material["pbrMetallicRoughness"] = json!({});
    }
    match slot {
        TextureSlot::BaseColor => {
            take_extension(material, OLDER);
            material["pbrMetallicRoughness"]["baseColorTexture"] = reference;
            material["pbrMetallicRoughness"]["baseColorFactor"] = json!(look.base_color);
        }
        TextureSlot::MetallicRoughness => {
            material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = reference;
            material["pbrMetallicRoughness"]["metallicFactor"] = look.metallic.into();
            material["pbrMetallicRoughness"]["roughnessFactor"] = look.roughness.into();
        }
        TextureSlot::Normal => material["normalTexture"] = reference,
        TextureSlot::Occlusion => material["occlusionTexture"] = reference,
        TextureSlot::Emissive => {
            material["emissiveTexture"] = reference;
            set_emission(material, look.emissive);
        }
    }
}
