//! Changing the lists of a file: entries in and out, and the numbers by which others name them.

use serde_json::{Map, Value, json};

use super::container::{list, number};
use super::references::{Named, each_reference, has_extension};
use super::repack::{Repacked, Span};

/// Puts an entry at a place of a list, or behind all.
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

/// Adds an entry behind all; its number.
pub(super) fn append(json: &mut Value, name: &str, entry: Value) -> usize {
    let entry = entry.as_object().cloned().unwrap_or_default();
    put(json, name, None, entry)
}

/// Takes an extension off an element, and the map of extensions if it was the last.
pub(super) fn take_extension(element: &mut Value, name: &str) -> Option<Value> {
    let extensions = element.get_mut("extensions")?.as_object_mut()?;
    let taken = extensions.shift_remove(name)?;
    if extensions.is_empty() {
        element.as_object_mut()?.shift_remove("extensions");
    }
    Some(taken)
}

/// Keeps the entries of a list that are not gone; a list that becomes empty goes too.
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

/// Takes accessors and views that are still free out of their lists, and gives the others their new numbers.
pub(super) fn renumber(json: &mut Value) {
    let ranks = |json: &Value, name: &str| {
        let mut next = 0;
        let rank = |v: &Value| {
            next += usize::from(!v.is_null());
            next - usize::from(!v.is_null())
        };
        list(json, name).iter().map(rank).collect::<Vec<usize>>()
    };
    let [accessors, views] = ["accessors", "bufferViews"].map(|name| ranks(json, name));
    let moves = |ranks: &[usize]| ranks.iter().enumerate().any(|(i, r)| i != *r);
    if moves(&accessors) || moves(&views) {
        each_reference(json, &mut |named, value| {
            let ranks = if named == Named::Accessor { &accessors } else { &views };
            if let Some(&rank) = number(value).and_then(|i| ranks.get(i)) {
                *value = rank.into();
            }
        });
    }
    retain(json, "accessors", &|_, v| v.is_null());
    retain(json, "bufferViews", &|_, v| v.is_null());
}

/// The bytes that a view names.
pub(super) fn span(view: &Value) -> Option<Span> {
    let start = number(&view["byteOffset"]).unwrap_or(0);
    let end = start.saturating_add(number(&view["byteLength"])?);
    Some(Span { buffer: number(&view["buffer"])?, bytes: start..end })
}

/// Says where the bytes of a view are now.
pub(super) fn move_view(view: &mut Value, repacked: &Repacked) {
    if view.is_null() {
        return;
    }
    let offset = number(&view["byteOffset"]).unwrap_or(0);
    let Some(place) = number(&view["buffer"]).and_then(|b| repacked.place(b, offset)) else { return };
    view["buffer"] = 0.into();
    if place != offset {
        view["byteOffset"] = place.into();
    }
}

/// Takes those of these extensions that nothing uses any more off the lists of the file.
pub(super) fn forget_extensions(json: &mut Value, names: &[&str]) {
    let gone: Vec<&str> = names.iter().copied().filter(|e| !has_extension(json, e)).collect();
    for name in ["extensionsUsed", "extensionsRequired"] {
        retain(json, name, &|_, e| e.as_str().is_some_and(|e| gone.contains(&e)));
    }
}
