//! Textures of meshes that lack the texture coordinates for them, which glTF does not allow.

use std::collections::BTreeMap;

use serde_json::Value;

use super::container::{list, list_mut, number};
use super::extension_losses::ExtensionLosses;
use super::unused_materials::drop_unused_materials;
use crate::error::Warning;

/// Gives primitives that lack the texture coordinates of their material one without textures, or with textures placed
/// by the first set if there is one; returns warnings.
pub(super) fn leave_out(json: &mut Value) -> Vec<Warning> {
    let needed: Vec<usize> = list(json, "materials").iter().map(needed_sets).collect();
    let mut all = list(json, "materials").to_vec();
    let mut made: BTreeMap<(usize, bool), usize> = BTreeMap::new();
    for primitive in list_mut(json, "meshes").iter_mut().flat_map(|mesh| list_mut(mesh, "primitives")) {
        let Some(material) = number(&primitive["material"]) else { continue };
        let sets = (0..).take_while(|k| !primitive["attributes"][format!("TEXCOORD_{k}")].is_null()).count();
        if needed.get(material).is_none_or(|&needed| needed <= sets) {
            continue;
        }
        let to = *made.entry((material, sets > 0)).or_insert_with(|| {
            let mut other = all[material].clone();
            if sets > 0 {
                place_by_first_set(&mut other);
            } else {
                remove_textures(&mut other);
            }
            all.push(other);
            all.len() - 1
        });
        primitive["material"] = to.into();
    }
    if made.is_empty() {
        return Vec::new();
    }
    json["materials"] = all.into();
    // A scene that was built has nothing that names materials but its primitives.
    drop_unused_materials(json, &mut ExtensionLosses::default());
    let mut warnings = Vec::new();
    if made.keys().any(|&(_, has_uvs)| !has_uvs) {
        warnings.push(Warning::lost("textures are left out where a mesh has no texture coordinates"));
    }
    if made.keys().any(|&(_, has_uvs)| has_uvs) {
        let text = "textures name texture coordinates that their mesh lacks: the first set places them";
        warnings.push(Warning::note(text));
    }
    warnings
}

/// Returns how many sets of texture coordinates the textures of a material need.
fn needed_sets(material: &Value) -> usize {
    let inner = |value: &Value| needed_sets(value);
    match material {
        Value::Object(object) => {
            let of = |(key, value): (&String, &Value)| {
                let own =
                    if is_texture(key, value) { number(&value["texCoord"]).unwrap_or(0) + 1 } else { 0 };
                own.max(if key == "extras" { 0 } else { inner(value) })
            };
            object.iter().map(of).max().unwrap_or(0)
        }
        Value::Array(all) => all.iter().map(inner).max().unwrap_or(0),
        _ => 0,
    }
}

fn is_texture(key: &str, value: &Value) -> bool {
    key.ends_with("Texture") && value["index"].is_number()
}

fn remove_textures(value: &mut Value) {
    let Some(object) = value.as_object_mut() else { return };
    // The factor scales the texture, and would light up the whole surface.
    if object.contains_key("emissiveTexture") {
        object.shift_remove("emissiveFactor");
    }
    object.retain(|key, value| !is_texture(key, value));
    object.iter_mut().filter(|(key, _)| *key != "extras").for_each(|(_, value)| remove_textures(value));
}

fn place_by_first_set(value: &mut Value) {
    let Some(object) = value.as_object_mut() else { return };
    for (key, value) in object.iter_mut().filter(|(key, _)| *key != "extras") {
        if is_texture(key, value)
            && let Some(texture) = value.as_object_mut()
        {
            texture.shift_remove("texCoord");
        }
        place_by_first_set(value);
    }
}
