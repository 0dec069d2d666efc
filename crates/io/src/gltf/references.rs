//! References in a file: of the core of glTF, and of the extensions that are understood.

mod kind;
pub(super) mod table;

use std::collections::BTreeSet;

use serde_json::{Map, Value};

use super::container::{list_mut, number};
pub(super) use kind::ReferenceKind;
pub(super) use table::{
    INSTANCING, KnownExtension, MESH_FEATURES, METADATA, OF_INSTANCES, POINTERS, VARIANTS, VRM_0, known,
};

/// A callback for references, which may change the value, and returns false if what it names is gone.
type Visit<'f> = dyn FnMut(ReferenceKind, &mut Value) -> bool + 'f;

impl KnownExtension {
    /// Calls `visit` for each reference of an extension of an element of the list `host`. Entries of lists whose
    /// reference is gone are removed and counted in `removed`, where the table allows it; otherwise returns false.
    pub(super) fn visit(
        &self,
        host: &str,
        content: &mut Value,
        removed: &mut usize,
        visit: &mut Visit<'_>,
    ) -> bool {
        let mut is_whole = true;
        for (path, kind) in self.paths(host) {
            is_whole &= walk(content, path, removed, &mut |value| visit(kind, value));
        }
        is_whole
    }

    /// Returns the paths of references from an element of the list `host`.
    fn paths<'k>(&'k self, host: &'k str) -> impl Iterator<Item = (&'static str, ReferenceKind)> + 'k {
        self.references.iter().filter_map(move |(path, kind)| match path.split_once(':') {
            Some((of, path)) => (of == host).then_some((path, *kind)),
            None => Some((path, *kind)),
        })
    }
}

/// Visits the values at a path of the table; returns false if one is gone that is in no list of removable entries.
fn walk(
    value: &mut Value,
    path: &str,
    removed: &mut usize,
    visit: &mut dyn FnMut(&mut Value) -> bool,
) -> bool {
    let (key, rest) = path.split_once('/').map_or((path, None), |(key, rest)| (key, Some(rest)));
    let mut step = |value: &mut Value| match rest {
        Some(rest) => walk(value, rest, removed, visit),
        None => visit(value),
    };
    match (key, value) {
        ("*", Value::Array(all)) => all.iter_mut().fold(true, |is_whole, value| step(value) & is_whole),
        ("*", Value::Object(all)) => all.values_mut().fold(true, |is_whole, value| step(value) & is_whole),
        ("+", Value::Array(all)) => {
            let before = all.len();
            all.retain_mut(step);
            *removed += before - all.len();
            true
        }
        (key, value) => value.get_mut(key).is_none_or(step),
    }
}

/// Calls `visit` for each reference; values that are not numbers are left to the callee. Extensions that are not
/// understood, and extras, may mean anything and are skipped.
pub(super) fn each_reference(json: &mut Value, visit: &mut dyn FnMut(ReferenceKind, &mut Value)) {
    each_core_reference(json, visit);
    each_extension(json, &mut |host, name, content| {
        if let Some(known) = known(name) {
            known.visit(host, content, &mut 0, &mut |kind, value| {
                visit(kind, value);
                true
            });
        }
        true
    });
}

/// Calls `visit` for each reference that keeps what it names in the file: not for those in lists whose entries go with
/// it, nor for pointers.
pub(super) fn each_owning_reference(json: &mut Value, visit: &mut dyn FnMut(ReferenceKind, &mut Value)) {
    each_core_reference(json, visit);
    each_extension(json, &mut |host, name, content| {
        let all = known(name).into_iter().flat_map(|known| known.paths(host));
        for (path, kind) in all.filter(|(path, kind)| !path.contains('+') && *kind != ReferenceKind::Pointer)
        {
            walk(content, path, &mut 0, &mut |value| {
                visit(kind, value);
                true
            });
        }
        true
    });
}

/// Calls `visit` for each reference of the core of glTF.
pub(super) fn each_core_reference(json: &mut Value, visit: &mut dyn FnMut(ReferenceKind, &mut Value)) {
    for (path, kind) in table::CORE {
        walk(json, path, &mut 0, &mut |value| {
            visit(*kind, value);
            true
        });
    }
    for animation in list_mut(json, "animations") {
        for channel in list_mut(animation, "channels") {
            let is_of_mesh = channel["target"]["path"] == "weights";
            if let Some(node) = channel.get_mut("target").and_then(|target| target.get_mut("node")) {
                visit(if is_of_mesh { ReferenceKind::MeshNode } else { ReferenceKind::Node }, node);
            }
        }
    }
}

/// Calls `visit` for each extension of a file, with the list that its element is in (`root` for the file itself,
/// `primitives` for those of meshes), its name and its content. Removes those for which it returns false. Extensions
/// inside those that are understood are visited too.
pub(super) fn each_extension(json: &mut Value, visit: &mut dyn FnMut(&str, &str, &mut Value) -> bool) {
    let Some(root) = json.as_object_mut() else { return };
    extensions_of(root, "root", visit);
    for (key, value) in root.iter_mut().filter(|(key, _)| !is_skipped(key)) {
        each_extension_in(value, key, visit);
    }
}

/// Calls `visit` for each extension of an element of the list `host`, as [`each_extension`] does.
pub(super) fn each_extension_in(
    value: &mut Value,
    host: &str,
    visit: &mut dyn FnMut(&str, &str, &mut Value) -> bool,
) {
    match value {
        Value::Object(object) => {
            extensions_of(object, host, visit);
            for (key, value) in object.iter_mut().filter(|(key, _)| !is_skipped(key)) {
                let host = if key == "primitives" && host == "meshes" { "primitives" } else { host };
                each_extension_in(value, host, visit);
            }
        }
        Value::Array(values) => values.iter_mut().for_each(|value| each_extension_in(value, host, visit)),
        _ => {}
    }
}

fn is_skipped(key: &str) -> bool {
    key == "extras" || key == "extensions"
}

/// Visits the extensions of an object itself, and those inside them.
fn extensions_of(
    object: &mut Map<String, Value>,
    host: &str,
    visit: &mut dyn FnMut(&str, &str, &mut Value) -> bool,
) {
    let Some(all) = object.get_mut("extensions").and_then(Value::as_object_mut) else { return };
    let before = all.len();
    all.retain(|name, content| {
        let is_kept = visit(host, name, content);
        if is_kept && known(name).is_some() {
            each_extension_in(content, host, visit);
        }
        is_kept
    });
    if all.is_empty() && before > 0 {
        object.shift_remove("extensions");
    }
}

/// Repeats the entries of lists in extensions that name one of several levels of a mesh or node: `further` returns the
/// other levels of what an entry names.
pub(super) fn repeat_for_levels(json: &mut Value, further: &dyn Fn(ReferenceKind, usize) -> Vec<usize>) {
    each_extension(json, &mut |host, name, content| {
        for (path, kind) in known(name).into_iter().flat_map(|known| known.paths(host)) {
            let Some((to_list, in_entry)) = path.split_once("/+/") else { continue };
            walk(content, to_list, &mut 0, &mut |list| {
                let Some(all) = list.as_array_mut() else { return true };
                for entry in std::mem::take(all) {
                    let more = number(&entry[in_entry]).map_or_else(Vec::new, |of| further(kind, of));
                    let copy = |level: usize| {
                        let mut copy = entry.clone();
                        copy[in_entry] = level.into();
                        copy
                    };
                    let copies: Vec<Value> = more.into_iter().map(copy).collect();
                    all.push(entry);
                    all.extend(copies);
                }
                true
            });
        }
        true
    });
}

/// Returns the nodes that skins, animations or extensions name for more than their mesh.
pub(super) fn named_nodes(json: &mut Value) -> BTreeSet<usize> {
    let mut named = BTreeSet::new();
    each_reference(json, &mut |kind, value| match kind {
        ReferenceKind::Node => named.extend(number(value)),
        ReferenceKind::Pointer => {
            let pointed = value.as_str().and_then(pointed_element);
            named.extend(pointed.filter(|(kind, ..)| *kind == ReferenceKind::Node).map(|(_, node, _)| node));
        }
        _ => {}
    });
    named
}

/// Returns the kind and the number of the element that a JSON pointer points into, and the rest of the pointer.
pub(super) fn pointed_element(pointer: &str) -> Option<(ReferenceKind, usize, &str)> {
    use ReferenceKind::{Accessor, Animation, Image, Material, Mesh, MeshNode, Node, Sampler, Texture};
    let (list, rest) = pointer.strip_prefix('/')?.split_once('/')?;
    let (number, rest) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
    let all = [Accessor, Mesh, Node, Material, Texture, Image, Sampler, Animation];
    let kind = all.into_iter().find(|kind| kind.list() == Some(list))?;
    let is_of_mesh = kind == Node && (rest == "/weights" || rest.starts_with("/weights/"));
    Some((if is_of_mesh { MeshNode } else { kind }, number.parse().ok()?, rest))
}

/// Calls `visit` for each view that an accessor refers to.
pub(super) fn views_of(accessor: &mut Value, visit: &mut dyn FnMut(ReferenceKind, &mut Value)) {
    let of_accessors =
        table::CORE.iter().filter_map(|(path, kind)| Some((path.strip_prefix("accessors/*/")?, kind)));
    for (path, kind) in of_accessors {
        walk(accessor, path, &mut 0, &mut |value| {
            visit(*kind, value);
            true
        });
    }
}

/// Returns true if any element has an extension of this name.
pub(super) fn has_extension(json: &Value, name: &str) -> bool {
    match json {
        Value::Object(object) => {
            object.get("extensions").is_some_and(|e| e.get(name).is_some())
                || object.iter().any(|(key, v)| key != "extras" && has_extension(v, name))
        }
        Value::Array(values) => values.iter().any(|v| has_extension(v, name)),
        _ => false,
    }
}

/// Returns true if an extension contains a number of an element for which `is_changed` holds, as a number, a key, or in
/// the path of a pointer.
pub(super) fn may_name(content: &Value, is_changed: &dyn Fn(usize) -> bool) -> bool {
    let in_text = |text: &str| {
        let digits = |part: &str| part.parse::<usize>().is_ok_and(is_changed);
        text.split('/').any(digits)
    };
    match content {
        Value::Number(_) => number(content).is_some_and(is_changed),
        Value::String(text) => in_text(text),
        Value::Array(all) => all.iter().any(|value| may_name(value, is_changed)),
        Value::Object(all) => all.iter().any(|(key, value)| in_text(key) || may_name(value, is_changed)),
        Value::Null | Value::Bool(_) => false,
    }
}
