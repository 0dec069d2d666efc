//! Extensions of primitives that describe vertices by attributes, by textures, or by the order of the vertices.
//!
//! Sources: Khronos, "EXT_mesh_features" and "EXT_structural_metadata" (drafts of 3D Tiles Next).

use std::collections::HashSet;

use serde_json::Value;

use super::container::{list, number};
use super::extension_losses::{ExtensionLosses, LossReason};
use super::lists::take_extension;
use super::references::{MESH_FEATURES, METADATA, VARIANTS, known, may_name};

/// Old form of the features of a primitive.
const OLD_FEATURES: &str = "EXT_feature_metadata";

/// Returns true if an extension of a mesh or a primitive may depend on the order of vertices or triangles.
pub(super) fn depends_on_order(name: &str, content: &Value) -> bool {
    match known(name) {
        Some(known) if known.is_of_vertices => true,
        Some(_) if name == MESH_FEATURES => list(content, "featureIds").iter().any(is_by_vertex),
        Some(_) if name == OLD_FEATURES => {
            list(content, "featureIdAttributes").iter().any(|ids| !ids["featureIds"]["divisor"].is_null())
        }
        Some(_) => false,
        None => may_name(content, &|_| true),
    }
}

/// Returns true for the features of a set that number the vertices.
fn is_by_vertex(ids: &Value) -> bool {
    ids["attribute"].is_null() && ids["texture"].is_null()
}

/// Removes the extensions of a mesh or a primitive that depend on vertices or triangles that are replaced; returns them.
pub(super) fn take_ordered(element: &mut Value, losses: &mut ExtensionLosses) -> Vec<(String, Value)> {
    let all = element["extensions"].as_object().into_iter().flatten();
    let is_ordered = |(name, content): &(&String, &Value)| {
        // Sets of features are examined one by one.
        *name != MESH_FEATURES && depends_on_order(name, content)
    };
    let names: Vec<String> = all.filter(is_ordered).map(|(name, _)| name.clone()).collect();
    let mut taken = Vec::new();
    for name in names {
        losses.add(LossReason::Geometry, &name, 1);
        taken.extend(take_extension(element, &name).map(|content| (name, content)));
    }
    taken
}

/// Removes from the extensions of a primitive with new vertices what describes attributes that it does not have any
/// more. `metadata`: the extension `EXT_structural_metadata` of the file.
pub(super) fn keep_carried(
    primitive: &mut Value,
    metadata: &Value,
    attributes: &HashSet<String>,
    losses: &mut ExtensionLosses,
) {
    let is_carried = |ids: &Value| {
        let attribute = |prefix: &str, number: &Value| match number.as_u64() {
            Some(number) => attributes.contains(&format!("{prefix}{number}")),
            None => true,
        };
        let texture = &ids["texture"];
        let has_coordinates = texture.is_null()
            || attributes.contains(&format!("TEXCOORD_{}", texture["texCoord"].as_u64().unwrap_or(0)));
        !is_by_vertex(ids) && has_coordinates && attribute("_FEATURE_ID_", &ids["attribute"])
    };
    retain_in(primitive, MESH_FEATURES, "featureIds", &is_carried, LossReason::Geometry, losses);
    let is_carried = |property: &Value| {
        let described = number(property).and_then(|i| list(metadata, "propertyAttributes").get(i));
        let properties = described.and_then(|all| all["properties"].as_object());
        let mut names = properties.into_iter().flatten().filter_map(|(_, p)| p["attribute"].as_str());
        names.all(|name| attributes.contains(name))
    };
    retain_in(primitive, METADATA, "propertyAttributes", &is_carried, LossReason::Geometry, losses);
}

/// Removes from the extensions of a primitive what a new material replaces: its variants, and with new texture
/// coordinates (`has_new_uvs`) textures that describe features.
pub(super) fn take_replaced_by_material(
    primitive: &mut Value,
    has_new_uvs: bool,
    losses: &mut ExtensionLosses,
) {
    losses.add(LossReason::Material, VARIANTS, usize::from(take_extension(primitive, VARIANTS).is_some()));
    if !has_new_uvs {
        return;
    }
    let is_kept = |ids: &Value| {
        let texture = &ids["texture"];
        texture.is_null() || texture["texCoord"].as_u64().unwrap_or(0) > 0
    };
    retain_in(primitive, MESH_FEATURES, "featureIds", &is_kept, LossReason::Material, losses);
    retain_in(primitive, METADATA, "propertyTextures", &|_| false, LossReason::Material, losses);
    let has_old_texture = !list(&primitive["extensions"][OLD_FEATURES], "featureIdTextures").is_empty()
        || !primitive["extensions"][OLD_FEATURES]["featureTextures"].is_null();
    if has_old_texture {
        take_extension(primitive, OLD_FEATURES);
        losses.add(LossReason::Material, OLD_FEATURES, 1);
    }
}

/// Removes entries of a list of an extension; the extension goes with the last of its lists.
fn retain_in(
    element: &mut Value,
    extension: &str,
    name: &str,
    is_kept: &dyn Fn(&Value) -> bool,
    reason: LossReason,
    losses: &mut ExtensionLosses,
) {
    let content = element.get_mut("extensions").and_then(|all| all.get_mut(extension));
    let Some(object) = content.and_then(Value::as_object_mut) else { return };
    let Some(all) = object.get_mut(name).and_then(Value::as_array_mut) else { return };
    let before = all.len();
    all.retain(is_kept);
    losses.add(reason, extension, before - all.len());
    if all.is_empty() && before > 0 {
        object.shift_remove(name);
        if object.is_empty() {
            take_extension(element, extension);
        }
    }
}
