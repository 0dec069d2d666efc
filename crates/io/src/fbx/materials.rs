//! Materials and textures.

use std::collections::HashMap;

use serde_json::{Value, json};
use ufbx::{Material, MaterialMap, Mesh, Texture, TextureType, WrapMode};

use crate::error::Warning;
use crate::gltf::{BroughtImages, SceneBuilder};

/// The materials and images of a file, added to the scene when they are first used.
pub(super) struct FbxMaterials {
    images: BroughtImages,
    known: HashMap<u32, usize>,
    textures: HashMap<u32, Option<usize>>,
}

impl FbxMaterials {
    pub(super) fn new(images: BroughtImages) -> Self {
        Self { images, known: HashMap::new(), textures: HashMap::new() }
    }

    /// Returns a material; `mesh` is the first that uses it, whose sets of texture coordinates its textures name.
    pub(super) fn add(&mut self, material: &Material, mesh: &Mesh, scene: &mut SceneBuilder) -> usize {
        if let Some(&known) = self.known.get(&material.element.typed_id) {
            return known;
        }
        let made = self.material(material, mesh, scene);
        let index = scene.add("materials", made);
        self.known.insert(material.element.typed_id, index);
        index
    }

    fn material(&mut self, material: &Material, mesh: &Mesh, scene: &mut SceneBuilder) -> Value {
        let pbr = &material.pbr;
        let factor = number(&pbr.base_factor, 1.0);
        let [r, g, b] = color(&pbr.base_color, 1.0);
        let opacity = number(&pbr.opacity, 1.0).clamp(0.0, 1.0);
        let mut surface = json!({
            "metallicFactor": number(&pbr.metalness, 0.0).clamp(0.0, 1.0),
            "roughnessFactor": number(&pbr.roughness, 1.0).clamp(0.0, 1.0),
        });
        let mut is_blended = opacity < 1.0;
        let base = shown(&pbr.base_color);
        let mut factors = [r * factor, g * factor, b * factor].map(|x| x.clamp(0.0, 1.0));
        if let Some(texture) = base.and_then(|t| self.texture(t, mesh, scene)) {
            surface["baseColorTexture"] = texture;
            // A texture replaces the colour.
            factors = [1.0; 3];
        }
        if let Some(mask) = shown(&pbr.opacity) {
            if base
                .is_some_and(|b| b.element.typed_id == mask.element.typed_id || b.filename == &*mask.filename)
            {
                is_blended = true;
            } else {
                scene.warn(Warning::lost("textures of transparency are not read: dropped"));
            }
        }
        if factors != [1.0; 3] || opacity < 1.0 {
            surface["baseColorFactor"] = json!([factors[0], factors[1], factors[2], opacity]);
        }
        let is_same = |a: &Texture, b: &Texture| a.element.typed_id == b.element.typed_id;
        match (shown(&pbr.metalness), shown(&pbr.roughness)) {
            (Some(metal), Some(rough)) if is_same(metal, rough) => {
                if let Some(texture) = self.texture(rough, mesh, scene) {
                    surface["metallicRoughnessTexture"] = texture;
                }
            }
            (None, None) => {}
            _ => scene
                .warn(Warning::lost("separate textures of roughness and metalness are not read: dropped")),
        }
        let mut made = json!({ "pbrMetallicRoughness": surface });
        if !material.element.name.is_empty() {
            made["name"] = (*material.element.name).into();
        }
        if let Some(texture) = shown(&pbr.normal_map).and_then(|t| self.texture(t, mesh, scene)) {
            made["normalTexture"] = texture;
        } else if shown(&material.fbx.bump).is_some() {
            scene.warn(Warning::lost("height maps are not read: dropped"));
        }
        if let Some(texture) = shown(&pbr.ambient_occlusion).and_then(|t| self.texture(t, mesh, scene)) {
            made["occlusionTexture"] = texture;
        }
        let strength = number(&pbr.emission_factor, 1.0);
        let mut emission = color(&pbr.emission_color, 0.0).map(|x| (x * strength).clamp(0.0, 1.0));
        if let Some(texture) = shown(&pbr.emission_color).and_then(|t| self.texture(t, mesh, scene)) {
            made["emissiveTexture"] = texture;
            emission = [strength.clamp(0.0, 1.0); 3];
        }
        if emission != [0.0; 3] {
            made["emissiveFactor"] = json!(emission);
        }
        if is_blended {
            made["alphaMode"] = "BLEND".into();
        }
        if material.features.double_sided.enabled {
            made["doubleSided"] = true.into();
        }
        let is_unread = |map: &MaterialMap| shown(map).is_some();
        if is_unread(&pbr.specular_color) || is_unread(&pbr.specular_factor) || is_unread(&pbr.glossiness) {
            scene.warn(Warning::lost("textures of highlights are not read: dropped"));
        }
        if is_unread(&pbr.displacement_map) {
            scene.warn(Warning::lost("displacement maps are not read: dropped"));
        }
        made
    }

    /// Returns the reference to a texture.
    fn texture(&mut self, texture: &Texture, mesh: &Mesh, scene: &mut SceneBuilder) -> Option<Value> {
        let file = match texture.type_ {
            TextureType::File => texture,
            _ => {
                scene.warn(Warning::lost(
                    "layered and procedural textures are not read: the first image is kept",
                ));
                texture.file_textures.iter().next()?
            }
        };
        let id = file.element.typed_id;
        if !self.textures.contains_key(&id) {
            let made = self.file(file, scene);
            self.textures.insert(id, made);
        }
        let mut reference = json!({ "index": self.textures[&id]? });
        let set = mesh.uv_sets.iter().position(|s| !s.name.is_empty() && s.name == &*file.uv_set);
        if let Some(set) = set.filter(|&set| set > 0 && set < crate::corners::MAX_UV_SETS) {
            reference["texCoord"] = set.into();
        }
        if file.has_uv_transform {
            let m = &file.uv_to_texture;
            if m.m01.abs() + m.m10.abs() > 1e-6 {
                scene.warn(Warning::lost("rotations of texture coordinates are not read: dropped"));
            } else {
                // Texture coordinates of glTF start at the upper left corner.
                let transform = json!({ "offset": [m.m03, 1.0 - m.m11 - m.m13], "scale": [m.m00, m.m11] });
                reference["extensions"] = json!({ "KHR_texture_transform": transform });
                scene.uses("KHR_texture_transform");
            }
        }
        Some(reference)
    }

    fn file(&mut self, file: &Texture, scene: &mut SceneBuilder) -> Option<usize> {
        let content: &[u8] = match (&*file.content, file.video.as_ref()) {
            ([], Some(video)) => &video.content,
            (content, _) => content,
        };
        let path = [&file.relative_filename, &file.filename, &file.absolute_filename];
        let path = path.into_iter().find(|p| !p.is_empty()).map_or(String::new(), |p| p.replace('\\', "/"));
        let image = if content.is_empty() {
            self.images.file(&path, scene)
        } else {
            let name =
                path.rsplit('/').next().filter(|n| !n.is_empty()).unwrap_or(&file.element.name).to_owned();
            self.images.bytes(&name, content, scene)
        }?;
        let wrap = |mode: WrapMode| if mode as u32 == WrapMode::Clamp as u32 { 33071 } else { 10497 };
        let sampler = json!({ "wrapS": wrap(file.wrap_u), "wrapT": wrap(file.wrap_v) });
        let sampler = scene.add("samplers", sampler);
        Some(scene.add("textures", json!({ "source": image, "sampler": sampler })))
    }
}

/// Returns the texture of a property, if it is in use.
fn shown(map: &MaterialMap) -> Option<&Texture> {
    map.texture.as_ref().filter(|_| map.texture_enabled).map(|t| &**t)
}

fn number(map: &MaterialMap, default: f64) -> f64 {
    if map.has_value && map.value_vec4.x.is_finite() { map.value_vec4.x } else { default }
}

fn color(map: &MaterialMap, default: f64) -> [f64; 3] {
    let v = &map.value_vec4;
    let values = if map.value_components < 3 { [v.x; 3] } else { [v.x, v.y, v.z] };
    if map.has_value && values.iter().all(|x| x.is_finite()) { values } else { [default; 3] }
}
