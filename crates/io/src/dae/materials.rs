//! Effects and images, as glTF materials.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::document::{Ids, child, children, descend, error, numbers};
use super::tree::DaeElement;
use crate::error::{ReadError, Warning};
use crate::gltf::{BroughtImages, SceneBuilder, file_path_of_uri};

/// The names by which an effect refers to texture coordinates, and the sets of the mesh that an instance binds them to.
/// Names without an entry are the first set.
type Bindings<'a> = Vec<(&'a str, usize)>;

/// The materials and images of a file, added to the scene when they are first used.
pub(super) struct DaeMaterials<'a> {
    pub(super) images: BroughtImages,
    /// Materials by their ids and the sets that their textures are bound to.
    known: HashMap<(&'a str, Bindings<'a>), usize>,
    /// Textures by the ids of their images.
    textures: HashMap<&'a str, Option<usize>>,
}

impl<'a> DaeMaterials<'a> {
    pub(super) fn new(images: BroughtImages) -> Self {
        Self { images, known: HashMap::new(), textures: HashMap::new() }
    }

    /// Returns the material that an instance refers to; `None` if there is none. `uv_sets` are the numbers of the sets of
    /// texture coordinates that the mesh has.
    pub(super) fn of_instance(
        &mut self,
        ids: &mut Ids<'a>,
        instance: DaeElement<'a>,
        uv_sets: &[u32],
        scene: &mut SceneBuilder,
    ) -> Result<Option<usize>, ReadError> {
        let Some(material) = ids.target_or_note(instance, "target", "material") else { return Ok(None) };
        let id = material.attribute("id").unwrap_or_default();
        let key = (id, bindings(instance, uv_sets, scene));
        if let Some(&known) = self.known.get(&key) {
            return Ok(Some(known));
        }
        let made = self.material(ids, material, &key.1, scene)?;
        let index = scene.add("materials", made);
        self.known.insert(key, index);
        Ok(Some(index))
    }

    fn material(
        &mut self,
        ids: &mut Ids<'a>,
        material: DaeElement<'a>,
        bindings: &Bindings<'a>,
        scene: &mut SceneBuilder,
    ) -> Result<Value, ReadError> {
        let mut made = json!({ "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 } });
        if let Some(name) = material.attribute("name").or(material.attribute("id")) {
            made["name"] = name.into();
        }
        let Some(instance) = child(material, "instance_effect") else { return Ok(made) };
        let Some(effect) = ids.target_or_note(instance, "url", "effect") else { return Ok(made) };
        let Some(profile) = child(effect, "profile_COMMON") else {
            scene.warn(Warning::lost("effects without a common profile are not read: materials are plain"));
            return Ok(made);
        };
        if is_double_sided(effect) {
            made["doubleSided"] = true.into();
        }
        let shading = child(profile, "technique").and_then(|technique| {
            ["phong", "blinn", "lambert", "constant"].iter().find_map(|kind| child(technique, kind))
        });
        let Some(shading) = shading else { return Ok(made) };
        let surface = &mut made["pbrMetallicRoughness"];
        let mut color = [1.0; 4];
        let mut diffuse_image = None;
        match ShadingProperty::of(shading, "diffuse")? {
            Some(ShadingProperty::Color(c)) => color = c.map(|x| x.clamp(0.0, 1.0)),
            Some(ShadingProperty::Texture(sampler, coordinates)) => {
                diffuse_image = image_of(ids, profile, effect, sampler);
                if let Some(texture) = self.texture(diffuse_image, sampler, scene) {
                    surface["baseColorTexture"] = reference(texture, coordinates, bindings);
                }
            }
            None => {}
        }
        let (opacity, is_textured) = opacity(ids, (profile, effect), shading, diffuse_image, scene)?;
        color[3] = opacity;
        if color != [1.0; 4] {
            surface["baseColorFactor"] = json!(color);
        }
        if opacity < 1.0 || is_textured {
            made["alphaMode"] = "BLEND".into();
        }
        if shading.tag() != "lambert"
            && let Some(exponent) = float(shading, "shininess")?
        {
            // The roughness that gives a highlight of the same width; shading uses its square. (Some programs write a
            // fraction of 1.)
            let exponent = if exponent <= 1.0 { exponent * 128.0 } else { exponent };
            made["pbrMetallicRoughness"]["roughnessFactor"] =
                (2.0 / (exponent.max(0.0) + 2.0)).powf(0.25).into();
        }
        match ShadingProperty::of(shading, "emission")? {
            Some(ShadingProperty::Color([r, g, b, _])) if [r, g, b] != [0.0; 3] => {
                made["emissiveFactor"] = json!([r, g, b].map(|x| x.clamp(0.0, 1.0)));
            }
            Some(ShadingProperty::Texture(sampler, coordinates)) => {
                let image = image_of(ids, profile, effect, sampler);
                if let Some(texture) = self.texture(image, sampler, scene) {
                    made["emissiveTexture"] = reference(texture, coordinates, bindings);
                    made["emissiveFactor"] = json!([1.0, 1.0, 1.0]);
                }
            }
            _ => {}
        }
        for (channel, lost) in
            [("specular", "textures of highlights"), ("reflective", "textures of reflections")]
        {
            if matches!(ShadingProperty::of(shading, channel)?, Some(ShadingProperty::Texture(..))) {
                scene.warn(Warning::lost(format!("{lost} are not read: dropped")));
            }
        }
        if effect.descendants().any(|e| matches!(e.tag(), "bump" | "normal_map")) {
            scene.warn(Warning::lost("bump maps are not read: dropped"));
        }
        Ok(made)
    }

    fn texture(
        &mut self,
        image: Option<DaeElement<'a>>,
        sampler: &str,
        scene: &mut SceneBuilder,
    ) -> Option<usize> {
        let Some(image) = image else {
            let text = format!("the texture `{}` names no image: dropped", crate::excerpt::excerpt(sampler));
            scene.warn(Warning::lost(text));
            return None;
        };
        let id = image.attribute("id").unwrap_or_default();
        if let Some(&known) = self.textures.get(id) {
            return known;
        }
        // Version 1.5 has the address within another element.
        let source = child(image, "init_from").map(|from| child(from, "ref").unwrap_or(from));
        let source = match source.map(|from| file_path_of_uri(from.text().trim())) {
            Some(Ok(path)) => self.images.file(&path, scene),
            Some(Err(why)) => {
                scene.warn(Warning::lost(format!(
                    "the image `{}` {why}: dropped",
                    crate::excerpt::excerpt(id)
                )));
                None
            }
            None => {
                scene.warn(Warning::lost("images inside the file are not read: dropped"));
                None
            }
        };
        let texture = source.map(|source| {
            let sampler = scene.add("samplers", json!({ "wrapS": 10497, "wrapT": 10497 }));
            scene.add("textures", json!({ "source": source, "sampler": sampler }))
        });
        self.textures.insert(id, texture);
        texture
    }
}

/// Returns the bindings of an instance to other sets than the first.
fn bindings<'a>(instance: DaeElement<'a>, uv_sets: &[u32], scene: &mut SceneBuilder) -> Bindings<'a> {
    let mut bindings = Bindings::new();
    for bound in children(instance, "bind_vertex_input") {
        if !matches!(bound.attribute("input_semantic"), Some("TEXCOORD" | "UV")) {
            continue;
        }
        let set = bound.attribute("input_set").and_then(|s| s.trim().parse().ok()).unwrap_or(0);
        match uv_sets.iter().position(|&s| s == set) {
            Some(0) => {}
            Some(at) => bindings.push((bound.attribute("semantic").unwrap_or_default(), at)),
            None if uv_sets.is_empty() => {}
            None => scene.warn(Warning::note(format!(
                "textures are bound to the set {set} of texture coordinates, which their mesh lacks: the first set \
                 places them"
            ))),
        }
    }
    bindings
}

/// Returns a reference to a texture whose coordinates have this name.
fn reference(texture: usize, coordinates: &str, bindings: &Bindings<'_>) -> Value {
    let mut reference = json!({ "index": texture });
    if let Some((_, set)) = bindings.iter().find(|(name, _)| *name == coordinates) {
        reference["texCoord"] = (*set).into();
    }
    reference
}

/// A property of a shading model.
enum ShadingProperty<'a> {
    Color([f64; 4]),
    /// The sampler of a texture, and the name of its texture coordinates.
    Texture(&'a str, &'a str),
}

impl<'a> ShadingProperty<'a> {
    fn of(shading: DaeElement<'a>, name: &'static str) -> Result<Option<Self>, ReadError> {
        let Some(property) = child(shading, name) else { return Ok(None) };
        if let Some(texture) = child(property, "texture") {
            let attribute = |name: &str| texture.attribute(name).unwrap_or_default();
            return Ok(Some(Self::Texture(attribute("texture"), attribute("texcoord"))));
        }
        let Some(color) = child(property, "color") else { return Ok(None) };
        match numbers(color)?[..] {
            [r, g, b] => Ok(Some(Self::Color([r, g, b, 1.0]))),
            [r, g, b, a, ..] => Ok(Some(Self::Color([r, g, b, a]))),
            _ => Err(error(color, "a colour has three or four numbers")),
        }
    }
}

fn float(shading: DaeElement<'_>, name: &'static str) -> Result<Option<f64>, ReadError> {
    let Some(value) = descend(shading, &[name, "float"]) else { return Ok(None) };
    Ok(numbers(value)?.first().copied().filter(|x| x.is_finite()))
}

/// Returns the opacity of a material, and true if it is stored in the image of its colour.
fn opacity<'a>(
    ids: &Ids<'a>,
    (profile, effect): (DaeElement<'a>, DaeElement<'a>),
    shading: DaeElement<'a>,
    diffuse_image: Option<DaeElement<'a>>,
    scene: &mut SceneBuilder,
) -> Result<(f64, bool), ReadError> {
    let strength = float(shading, "transparency")?.unwrap_or(1.0);
    let mode = child(shading, "transparent").and_then(|t| t.attribute("opaque")).unwrap_or("A_ONE");
    let opacity = match ShadingProperty::of(shading, "transparent")? {
        // Without a colour, only the programs that wrote the file know which end is opaque.
        None => 1.0,
        Some(ShadingProperty::Color([r, g, b, a])) => {
            let luminance = 0.212_671 * r + 0.715_160 * g + 0.072_169 * b;
            match mode {
                "RGB_ZERO" => 1.0 - luminance * strength,
                "RGB_ONE" => luminance * strength,
                "A_ZERO" => 1.0 - a * strength,
                _ => a * strength,
            }
        }
        Some(ShadingProperty::Texture(sampler, _)) => {
            let image = image_of(ids, profile, effect, sampler);
            if image.is_some() && image == diffuse_image {
                return Ok((1.0, true));
            }
            scene.warn(Warning::lost("textures of transparency are not read: dropped"));
            1.0
        }
    };
    if opacity <= 0.0 || !opacity.is_finite() {
        scene.warn(Warning::note(
            "fully transparent materials were made opaque (exporters disagree on what transparency means)",
        ));
        return Ok((1.0, false));
    }
    Ok((opacity.min(1.0), false))
}

/// Returns the image of a sampler: by its surface in version 1.4, by its instance in 1.5, or directly.
fn image_of<'a>(
    ids: &Ids<'a>,
    profile: DaeElement<'a>,
    effect: DaeElement<'a>,
    sampler: &str,
) -> Option<DaeElement<'a>> {
    let parameter = |sid: &str| {
        let all = children(profile, "newparam").chain(children(effect, "newparam"));
        all.into_iter().find(|p| p.attribute("sid") == Some(sid))
    };
    let is_image = |e: &DaeElement<'a>| e.tag() == "image";
    let Some(sampler) = parameter(sampler).and_then(|p| child(p, "sampler2D")) else {
        return ids.get(sampler).filter(is_image);
    };
    if let Some(instance) = child(sampler, "instance_image") {
        return ids.find(instance.attribute("url")?).filter(is_image);
    }
    let surface = parameter(child(sampler, "source")?.text().trim())?;
    let from = descend(surface, &["surface", "init_from"])?;
    ids.get(from.text().trim()).filter(is_image)
}

/// Returns true if a common extension says that both sides are shown.
fn is_double_sided(effect: DaeElement<'_>) -> bool {
    let says = |e: DaeElement<'_>| e.tag() == "double_sided" && e.text().trim() == "1";
    effect.descendants().any(says)
}
