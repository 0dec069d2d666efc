//! The files beside its buffers that a scene names.

use serde_json::Value;

/// Calls for the uri of each file outside.
pub(super) fn outside_uris<'v>(json: &'v Value, found: &mut dyn FnMut(&'v String)) {
    let mut open = vec![(json, 0)];
    while let Some((value, depth)) = open.pop() {
        match value {
            Value::Object(object) => {
                for (key, inner) in object.iter().rev() {
                    match inner {
                        Value::String(uri) if key == "uri" && is_file(uri) => found(uri),
                        // What extras mean is not known; the buffers are inside.
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

/// Gives the files outside other names.
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

/// Whether a uri names a file, and not data or an address on the network.
pub(super) fn is_file(uri: &str) -> bool {
    !uri.is_empty() && !uri.starts_with("data:") && !uri.contains("://")
}
