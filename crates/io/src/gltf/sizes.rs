//! Costs of drawing a glTF file, from its JSON and the first bytes of its images.

use std::collections::HashSet;

use serde_json::Value;

use super::Scene;
use super::buffers::{Buffers, data_uri, inline_data, path_of};
use super::compressed::fallbacks;
use super::container::{Document, list, number};
use super::instances;
use super::placements::PlacedNodes;
use crate::error::ReadError;
use crate::material::{bytes_with_mipmaps, size_of, size_of_file};
use crate::options::ReadOptions;
use crate::sizes::Sizes;

/// Returns the sizes of a glTF file, JSON or GLB. Levels of detail, which are in no scene, do not count, and
/// images whose size cannot be read count as none. No geometry is decoded.
///
/// # Errors
/// As [`read`](super::read), for the structure of the file.
pub fn sizes(bytes: &[u8], options: &ReadOptions) -> Result<Sizes, ReadError> {
    let document = Document::parse(bytes, options.limits, 1)?;
    document.check_version()?;
    let sizes = of_parts(&document.json, &Buffers::new(&document, options.files(), options.limits))?;
    Ok(Sizes { file_bytes: Some(bytes.len() as u64), ..sizes })
}

impl Scene {
    /// Returns what the scene costs on a GPU, without the bytes of its file. Images in separate files do not count.
    pub fn sizes(&self) -> Option<Sizes> {
        of_parts(&self.json, &Buffers::loaded(&self.json, &self.buffers, 0)).ok()
    }
}

fn of_parts(json: &Value, buffers: &Buffers<'_>) -> Result<Sizes, ReadError> {
    let mut sizes = Sizes::default();
    for placement in PlacedNodes::new(json)?.or_all_meshes(json).placements {
        let instances = placement.node.map_or(1, |n| instances::count(json, &json["nodes"][n])) as u64;
        for primitive in list(&json["meshes"][placement.mesh], "primitives") {
            sizes.draw_calls += 1;
            sizes.triangles =
                sizes.triangles.saturating_add(triangles(json, primitive).saturating_mul(instances));
        }
    }
    let spare = fallbacks(json);
    let mut used = HashSet::new();
    for texture in list(json, "textures") {
        used.extend(number(&texture["source"]));
        let extensions = texture["extensions"].as_object().into_iter().flat_map(|e| e.values());
        used.extend(extensions.filter_map(|e| number(&e["source"])));
    }
    for (i, image) in list(json, "images").iter().enumerate().filter(|(i, _)| used.contains(i)) {
        let is_spare = number(&image["bufferView"])
            .and_then(|view| number(&list(json, "bufferViews").get(view)?["buffer"]))
            .is_some_and(|buffer| spare.contains(&buffer));
        if !is_spare && let Some([width, height]) = image_size(buffers, image, i) {
            sizes.texture_bytes = sizes.texture_bytes.saturating_add(bytes_with_mipmaps(width, height));
        }
    }
    Ok(sizes)
}

/// Returns the number of triangles of a primitive by the counts of its accessors.
fn triangles(json: &Value, primitive: &Value) -> u64 {
    let indices = if primitive["indices"].is_null() {
        &primitive["attributes"]["POSITION"]
    } else {
        &primitive["indices"]
    };
    let accessor = number(indices).and_then(|a| list(json, "accessors").get(a));
    let corners = accessor.and_then(|a| number(&a["count"])).unwrap_or(0) as u64;
    match number(&primitive["mode"]) {
        None | Some(4) => corners / 3,
        Some(5 | 6) => corners.saturating_sub(2),
        _ => 0,
    }
}

/// Returns width and height of an image, from the first bytes of its file.
fn image_size(buffers: &Buffers<'_>, image: &Value, index: usize) -> Option<[u32; 2]> {
    let at = format!("images[{index}]");
    if let Some(uri) = image["uri"].as_str() {
        return match inline_data(uri) {
            Some(data) => size_of(&data_uri(data, &at).ok()?).ok(),
            None => size_of_file(&mut buffers.assets.find(&path_of(uri).ok()?).ok()?.open().ok()?).ok(),
        };
    }
    size_of(buffers.view(number(&image["bufferView"])?, &at).ok()?.bytes).ok()
}
