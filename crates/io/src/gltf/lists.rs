//! Edits of the lists of a file: inserting, removing and renumbering entries.

use serde_json::{Map, Value, json};

use super::container::{list, number};
use super::references::has_extension;
use super::repack::{ByteSpan, Repacked};

/// Puts an entry at an index of a list, or at its end; returns its index.
pub(super) fn put(json: &mut Value, name: &str, at: Option<usize>, entry: Map<String, Value>) -> usize {
    if !json[name].is_array() {
        json[name] = json!([]);
    }
    let Some(all) = json[name].as_array_mut() else { return 0 };
    let at = at.unwrap_or(all.len());
    if at == all.len() {
        all.push(Value::Null);
    }
    all[at] = entry.into();
    at
}

pub(super) fn drop_nulls(object: &mut Map<String, Value>) {
    object.retain(|_, value| !value.is_null());
}

/// Appends an entry; returns its index.
pub(super) fn append(json: &mut Value, name: &str, entry: Value) -> usize {
    let entry = entry.as_object().cloned().unwrap_or_default();
    put(json, name, None, entry)
}

/// Removes and returns an extension of an element; removes the map of extensions too if it becomes empty.
pub(super) fn take_extension(element: &mut Value, name: &str) -> Option<Value> {
    let extensions = element.get_mut("extensions")?.as_object_mut()?;
    let taken = extensions.shift_remove(name)?;
    if extensions.is_empty() {
        element.as_object_mut()?.shift_remove("extensions");
    }
    Some(taken)
}

/// Removes the entries of a list for which `is_gone` holds; a list that becomes empty is removed too.
pub(super) fn retain(json: &mut Value, name: &str, is_gone: &dyn Fn(usize, &Value) -> bool) {
    let Some(all) = json.get_mut(name).and_then(Value::as_array_mut) else { return };
    let before = all.len();
    let mut index = 0;
    all.retain(|v| {
        index += 1;
        !is_gone(index - 1, v)
    });
    if all.is_empty()
        && before > 0
        && let Some(root) = json.as_object_mut()
    {
        root.shift_remove(name);
    }
}

/// Returns the byte range of a view.
pub(super) fn view_span(view: &Value) -> Option<ByteSpan> {
    let start = number(&view["byteOffset"]).unwrap_or(0);
    let end = start.saturating_add(number(&view["byteLength"])?);
    Some(ByteSpan { buffer: number(&view["buffer"])?, bytes: start..end })
}

/// Updates a view to the new position of its bytes.
pub(super) fn move_view(view: &mut Value, repacked: &Repacked) {
    if view.is_null() {
        return;
    }
    let offset = number(&view["byteOffset"]).unwrap_or(0);
    let Some(place) = number(&view["buffer"]).and_then(|b| repacked.new_offset(b, offset)) else { return };
    view["buffer"] = 0.into();
    if place != offset {
        view["byteOffset"] = place.into();
    }
}

/// Removes those of the given extensions that are no longer used from the lists of the file.
pub(super) fn drop_unused_extensions(json: &mut Value, names: &[&str]) {
    let gone: Vec<&str> = names.iter().copied().filter(|e| !has_extension(json, e)).collect();
    for name in ["extensionsUsed", "extensionsRequired"] {
        retain(json, name, &|_, e| e.as_str().is_some_and(|e| gone.contains(&e)));
    }
}

/// Adds a required extension to the lists of the file, or removes it from them.
pub(super) fn set_extension(json: &mut Value, extension: &str, is_needed: bool) {
    for name in ["extensionsUsed", "extensionsRequired"] {
        if !is_needed {
            retain(json, name, &|_, e| e == extension);
            continue;
        }
        add_extension(json, name, extension);
    }
}

/// Adds an extension to one of the lists of the file, unless it is already there.
pub(super) fn add_extension(json: &mut Value, name: &str, extension: &str) {
    if !json[name].is_array() {
        json[name] = json!([]);
    }
    let all = json[name].as_array_mut();
    if let Some(all) = all.filter(|all| !all.iter().any(|e| e == extension)) {
        all.push(extension.into());
    }
}

pub(super) const QUANTIZATION: &str = "KHR_mesh_quantization";

/// Returns true if an attribute has numbers of a type that only `KHR_mesh_quantization` allows.
pub(super) fn needs_quantization(json: &Value) -> bool {
    const FLOAT: u64 = 5126;
    let accessors = list(json, "accessors");
    let is_extended = |(key, value): (&String, &Value), is_target: bool| {
        let Some(accessor) = number(value).and_then(|i| accessors.get(i)) else { return false };
        let component = accessor["componentType"].as_u64();
        let is_fraction = accessor["normalized"] == true && matches!(component, Some(5121 | 5123));
        match key.as_str() {
            "POSITION" | "NORMAL" | "TANGENT" => component != Some(FLOAT),
            key if key.starts_with("TEXCOORD_") => component != Some(FLOAT) && (is_target || !is_fraction),
            _ => false,
        }
    };
    list(json, "meshes").iter().flat_map(|m| list(m, "primitives")).any(|primitive| {
        let own = primitive["attributes"].as_object().into_iter().flatten();
        let of_targets = list(primitive, "targets").iter().filter_map(Value::as_object).flatten();
        own.into_iter().any(|a| is_extended(a, false)) || of_targets.into_iter().any(|a| is_extended(a, true))
    })
}
