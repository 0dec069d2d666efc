//! Visitor of all references to accessors and views in a file.

use serde_json::Value;

/// Extension of nodes that places a mesh several times.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Kind of a referenced element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReferenceKind {
    Accessor,
    View,
}

/// Calls `visit` for each reference; values that are not numbers are left to the callee.
///
/// Extensions are searched for `accessor` and `bufferView`, the keys that they use by convention, and for the
/// keys of a few known ones; a reference under another key is missed.
pub(super) fn each_reference(json: &mut Value, visit: &mut dyn FnMut(ReferenceKind, &mut Value)) {
    for mesh in entries(json, "meshes") {
        for primitive in entries(mesh, "primitives") {
            values(primitive.get_mut("attributes"), ReferenceKind::Accessor, visit);
            one(primitive, "indices", ReferenceKind::Accessor, visit);
            entries(primitive, "targets").for_each(|t| values(Some(t), ReferenceKind::Accessor, visit));
        }
    }
    for animation in entries(json, "animations") {
        for sampler in entries(animation, "samplers") {
            one(sampler, "input", ReferenceKind::Accessor, visit);
            one(sampler, "output", ReferenceKind::Accessor, visit);
        }
    }
    entries(json, "skins").for_each(|s| one(s, "inverseBindMatrices", ReferenceKind::Accessor, visit));
    for accessor in entries(json, "accessors") {
        views_of(accessor, visit);
    }
    entries(json, "images").for_each(|i| one(i, "bufferView", ReferenceKind::View, visit));
    extensions(json, false, visit);
}

/// Calls `visit` for each view that an accessor refers to.
pub(super) fn views_of(accessor: &mut Value, visit: &mut dyn FnMut(ReferenceKind, &mut Value)) {
    one(accessor, "bufferView", ReferenceKind::View, visit);
    for part in ["indices", "values"] {
        if let Some(part) = accessor.get_mut("sparse").and_then(|s| s.get_mut(part)) {
            one(part, "bufferView", ReferenceKind::View, visit);
        }
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

/// Returns the entries of a list, mutably.
fn entries<'v>(object: &'v mut Value, name: &str) -> impl Iterator<Item = &'v mut Value> {
    object.get_mut(name).and_then(Value::as_array_mut).into_iter().flatten()
}

fn one(
    object: &mut Value,
    name: &str,
    named: ReferenceKind,
    visit: &mut dyn FnMut(ReferenceKind, &mut Value),
) {
    if let Some(value) = object.get_mut(name) {
        visit(named, value);
    }
}

fn values(
    object: Option<&mut Value>,
    named: ReferenceKind,
    visit: &mut dyn FnMut(ReferenceKind, &mut Value),
) {
    let all = object.and_then(Value::as_object_mut).into_iter().flat_map(|o| o.values_mut());
    all.for_each(|v| visit(named, v));
}

/// Visits references in extensions, wherever they are. Extras may mean anything and are skipped.
fn extensions(value: &mut Value, is_inside: bool, visit: &mut dyn FnMut(ReferenceKind, &mut Value)) {
    match value {
        Value::Object(object) => {
            for (key, inner) in object.iter_mut() {
                match key.as_str() {
                    "extras" => {}
                    "accessor" if is_inside && inner.is_number() => visit(ReferenceKind::Accessor, inner),
                    "bufferView" if is_inside && inner.is_number() => visit(ReferenceKind::View, inner),
                    INSTANCING if is_inside => {
                        values(inner.get_mut("attributes"), ReferenceKind::Accessor, visit);
                    }
                    "CESIUM_primitive_outline" if is_inside => {
                        one(inner, "indices", ReferenceKind::Accessor, visit);
                    }
                    "EXT_structural_metadata" if is_inside => {
                        for table in entries(inner, "propertyTables") {
                            let all = table.get_mut("properties").and_then(Value::as_object_mut);
                            for property in all.into_iter().flat_map(|p| p.values_mut()) {
                                for name in ["values", "arrayOffsets", "stringOffsets"] {
                                    one(property, name, ReferenceKind::View, visit);
                                }
                            }
                        }
                    }
                    _ => extensions(inner, is_inside || key == "extensions", visit),
                }
            }
        }
        Value::Array(values) => values.iter_mut().for_each(|v| extensions(v, is_inside, visit)),
        _ => {}
    }
}
