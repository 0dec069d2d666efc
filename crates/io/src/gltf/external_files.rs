//! References of a scene to external files other than buffers.

use serde_json::Value;

use super::buffers::inline_data;

/// Calls `found` for the URI of each external file.
pub(super) fn external_uris<'v>(json: &'v Value, found: &mut dyn FnMut(&'v String)) {
    let mut open = vec![(json, 0)];
    while let Some((value, depth)) = open.pop() {
        match value {
            Value::Object(object) => {
                for (key, inner) in object.iter().rev() {
                    match inner {
                        Value::String(uri) if key == "uri" && is_file(uri) => found(uri),
                        // The meaning of extras is unknown; buffers are embedded.
                        _ if key == "extras" || (depth == 0 && key == "buffers") => {}
                        _ => open.push((inner, depth + 1)),
                    }
                }
            }
            Value::Array(values) => open.extend(values.iter().rev().map(|v| (v, depth + 1))),
            _ => {}
        }
    }
}

/// Renames external files.
pub(super) fn relink(json: &mut Value, depth: usize, new: &dyn Fn(&str) -> Option<String>) {
    match json {
        Value::Object(object) => {
            for (key, inner) in object.iter_mut() {
                match inner {
                    Value::String(uri) if key == "uri" && is_file(uri) => {
                        if let Some(new) = new(uri) {
                            *uri = new;
                        }
                    }
                    _ if key == "extras" || (depth == 0 && key == "buffers") => {}
                    _ => relink(inner, depth + 1, new),
                }
            }
        }
        Value::Array(values) => values.iter_mut().for_each(|v| relink(v, depth + 1, new)),
        _ => {}
    }
}

/// Returns the URI of a file beside the scene, with all characters that are special in a URI escaped.
pub(super) fn uri_of(name: &[u8]) -> String {
    let mut uri = String::with_capacity(name.len());
    for &byte in name {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            uri.push(byte.into());
        } else {
            uri.push_str(&format!("%{byte:02X}"));
        }
    }
    uri
}

/// Returns true if a URI names a file, not data or a network address.
pub(super) fn is_file(uri: &str) -> bool {
    !uri.is_empty() && inline_data(uri).is_none() && !uri.contains("://")
}
