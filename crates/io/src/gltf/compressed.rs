//! Extensions of compressed geometry, and the fallback buffers that they make unnecessary.

use std::collections::HashSet;

use serde_json::Value;

use super::container::{list, number};

/// Extension of primitives.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// Names of the extension of views: the ratified one is a superset with the same keys.
pub(super) const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Returns the extension of a view or a buffer, with its name.
pub(super) fn extension(element: &Value) -> Option<(&'static str, &Value)> {
    MESHOPT.into_iter().map(|name| (name, &element["extensions"][name])).find(|(_, e)| !e.is_null())
}

/// Returns fallback buffers for readers without an extension that nothing else needs; their bytes may be
/// missing.
pub(super) fn fallbacks(json: &Value) -> HashSet<usize> {
    let (mut plain, mut spare) = (HashSet::new(), HashSet::new());
    for view in list(json, "bufferViews") {
        match extension(view) {
            Some((_, packed)) => {
                plain.extend(number(&packed["buffer"]));
                spare.extend(number(&view["buffer"]));
            }
            None => plain.extend(number(&view["buffer"])),
        }
    }
    let marked = |b: &Value| extension(b).is_some_and(|(_, e)| e["fallback"] == true);
    spare.extend(list(json, "buffers").iter().enumerate().filter(|(_, b)| marked(b)).map(|(i, _)| i));
    spare.retain(|buffer| !plain.contains(buffer));
    spare
}
