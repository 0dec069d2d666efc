//! Removal of materials that nothing uses, with their textures and images.

use std::collections::HashSet;

use serde_json::Value;

use super::container::{list, list_mut, number};
use super::extension_losses::ExtensionLosses;
use super::lists::drop_unused_extensions;
use super::references::{ReferenceKind, each_owning_reference, each_reference};
use super::renumber::Renumbering;

/// Removes from the JSON of a scene materials that nothing uses, the textures and images that only they used, samplers
/// without textures, and what else refers to them.
pub(super) fn drop_unused_materials(json: &mut Value, losses: &mut ExtensionLosses) {
    use ReferenceKind::{Image, Material, Sampler, Texture};
    drop_unused(json, &[Material], losses);
    drop_unused(json, &[Texture], losses);
    let images = used(json, Image);
    free_views_of_images(json, &images);
    drop_unused(json, &[Sampler, Image], losses);
    let mut changes = Renumbering::default();
    changes.remove_nulls(json);
    changes.apply(json, losses);
    let of_materials: Vec<String> = list(json, "extensionsUsed")
        .iter()
        .filter_map(Value::as_str)
        .filter(|e| e.starts_with("KHR_materials_") || e.contains("_texture_"))
        .map(str::to_owned)
        .collect();
    let names: Vec<&str> = of_materials.iter().map(String::as_str).collect();
    drop_unused_extensions(json, &names);
}

/// Returns the elements of a kind that something uses.
fn used(json: &mut Value, kind: ReferenceKind) -> HashSet<usize> {
    let mut used = HashSet::new();
    each_owning_reference(json, &mut |named, value| {
        if named == kind {
            used.extend(number(value));
        }
    });
    used
}

/// Removes the elements of some kinds that nothing uses.
fn drop_unused(json: &mut Value, kinds: &[ReferenceKind], losses: &mut ExtensionLosses) {
    let mut changes = Renumbering::default();
    for &kind in kinds {
        let used = used(json, kind);
        changes.remove(json, kind, &|i, _| !used.contains(&i));
    }
    changes.apply(json, losses);
}

/// Clears the views of images that are not used, unless something else refers to them.
fn free_views_of_images(json: &mut Value, used: &HashSet<usize>) {
    let images = list(json, "images").iter().enumerate().filter(|(i, _)| !used.contains(i));
    let freed: HashSet<usize> = images.filter_map(|(_, image)| number(&image["bufferView"])).collect();
    for (i, image) in list_mut(json, "images").iter_mut().enumerate() {
        if !used.contains(&i) && image.is_object() {
            image["bufferView"] = Value::Null;
        }
    }
    let mut still = HashSet::new();
    each_reference(json, &mut |kind, value| {
        if kind == ReferenceKind::View {
            still.extend(number(value));
        }
    });
    for view in freed.difference(&still) {
        if let Some(view) = list_mut(json, "bufferViews").get_mut(*view) {
            *view = Value::Null;
        }
    }
}
