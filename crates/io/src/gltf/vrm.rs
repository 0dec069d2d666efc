//! The extension `VRM` of avatars before version 1, which names materials by their order and by their names.
//!
//! `materialProperties[i]` describes material i; `blendShapeGroups[*].materialValues[*]` change the material of a name.
//! Version 1 has numbers, as all other extensions: see the table of references.
//!
//! Source: VRM Consortium, "VRM 0.0 Specification".

use serde_json::{Value, json};

use super::container::{list, list_mut};
use super::lists::append;
use super::references::VRM_0;

/// Shader of a material that glTF describes entirely.
const PLAIN_SHADER: &str = "VRM_USE_GLTFSHADER";

/// Appends a material; returns its index. If the file describes its materials for avatars, this one is plain.
pub(super) fn append_material(json: &mut Value, material: Value) -> usize {
    let properties = json!({
        "name": material["name"].as_str().unwrap_or_default(),
        "shader": PLAIN_SHADER,
        "renderQueue": 2000,
        "floatProperties": {}, "vectorProperties": {}, "textureProperties": {}, "keywordMap": {}, "tagMap": {},
    });
    let count = list(json, "materials").len();
    let all = json.get_mut("extensions").and_then(|all| all.get_mut(VRM_0));
    let all = all.and_then(|vrm| vrm.get_mut("materialProperties")).and_then(Value::as_array_mut);
    if let Some(all) = all.filter(|all| all.len() == count) {
        all.push(properties);
    }
    append(json, "materials", material)
}

/// Removes what describes materials without a new number in `ranks`; the file has its old list of materials. Returns the
/// number of descriptions that are lost with them.
pub(super) fn remove_materials(json: &mut Value, ranks: &[Option<usize>]) -> usize {
    let is_kept = |(i, _): &(usize, &Value)| ranks.get(*i).is_none_or(Option::is_some);
    let names: Vec<Value> = list(json, "materials").iter().map(|m| m["name"].clone()).collect();
    let kept: Vec<Value> = names.iter().enumerate().filter(is_kept).map(|(_, name)| name.clone()).collect();
    let Some(vrm) = json.get_mut("extensions").and_then(|all| all.get_mut(VRM_0)) else { return 0 };
    let mut lost = 0;
    if let Some(all) = vrm.get_mut("materialProperties").and_then(Value::as_array_mut) {
        let mut i = 0;
        all.retain(|properties| {
            let is_kept = ranks.get(i).is_none_or(Option::is_some);
            i += 1;
            lost += usize::from(!is_kept && properties["shader"] != PLAIN_SHADER);
            is_kept
        });
    }
    let groups = vrm.get_mut("blendShapeMaster").map_or(&mut [][..], |all| list_mut(all, "blendShapeGroups"));
    for values in groups.iter_mut().filter_map(|group| group.get_mut("materialValues")?.as_array_mut()) {
        let before = values.len();
        let is_gone = |value: &Value| {
            let name = &value["materialName"];
            names.contains(name) && !kept.contains(name)
        };
        values.retain(|value| !is_gone(value));
        lost += before - values.len();
    }
    lost
}
