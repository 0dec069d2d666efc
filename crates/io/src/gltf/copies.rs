//! Copies of a scene: nodes that share its meshes, materials and samplers.
//!
//! ```text
//! scene ── node "a"          scene ── "copy_1" ── node "a"
//!                                  └─ "copy_2" ── node "a", of its own
//! ```
//!
//! Skins, animation channels and levels of detail refer to nodes, so each copy has its own; their data in
//! buffers is shared.

use std::collections::{BTreeSet, HashMap};

use serde_json::{Value, json};

use super::container::{list, list_mut, number};
use super::lists::append;
use super::references::{each_extension_in, known, pointed_element};
use super::renumber::{pointer_of, set_pointer};
use super::{lod, placements};
use crate::error::ReadError;

/// Name and transform of a copy of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct CopyPlace {
    /// Name of its node.
    pub name: String,
    /// Translation of its origin.
    pub translation: [f64; 3],
    /// Rotation: a quaternion of length one, its real part last.
    pub rotation: [f64; 4],
    /// Uniform scale factor.
    pub scale: f64,
}

/// Returns the JSON with one scene, which holds a copy of the default scene at each of these places.
pub(super) fn with_copies(source: &Value, places: &[CopyPlace]) -> Result<Value, ReadError> {
    let mut json = source.clone();
    let mut roots = placements::roots(source)?;
    if placements::PlacedNodes::new(source)?.placements.is_empty() {
        // If no node refers to a mesh, all meshes are shown untransformed.
        for mesh in 0..list(source, "meshes").len() {
            roots.push(append(&mut json, "nodes", json!({ "mesh": mesh })));
        }
    }
    let nodes = descendants(&json, &roots);
    let of_node = |n: &usize, key: &str| number(&json["nodes"][*n][key]);
    let skins: BTreeSet<usize> = nodes.iter().filter_map(|n| of_node(n, "skin")).collect();
    let mut tops = Vec::with_capacity(places.len());
    let mut of_copies: Vec<HashMap<usize, usize>> = Vec::with_capacity(places.len());
    for (k, place) in places.iter().enumerate() {
        let own = if k == 0 { HashMap::new() } else { copy(&mut json, &nodes, &skins) };
        let renamed: Vec<usize> = roots.iter().map(|n| own.get(n).copied().unwrap_or(*n)).collect();
        let mut top = json!({
            "name": place.name,
            "translation": place.translation,
            "rotation": place.rotation,
            "scale": ([place.scale; 3]),
        });
        if !renamed.is_empty() {
            top["children"] = json!(renamed);
        }
        tops.push(append(&mut json, "nodes", top));
        of_copies.push(own);
    }
    animate(&mut json, &of_copies);
    let shown = number(&json["scene"]).unwrap_or(0);
    let mut scene = list(&json, "scenes").get(shown).cloned().unwrap_or_else(|| json!({}));
    scene["nodes"] = json!(tops);
    json["scenes"] = json!([scene]);
    json["scene"] = 0.into();
    Ok(json)
}

/// Returns the nodes of the trees under `roots`, parents first, and the trees of their levels of detail.
fn descendants(json: &Value, roots: &[usize]) -> Vec<usize> {
    // Levels may refer to each other, or to nodes that do not exist: only children have been checked.
    let mut is_new = vec![true; list(json, "nodes").len()];
    let mut all = Vec::new();
    let mut open: Vec<usize> = roots.iter().rev().copied().collect();
    while let Some(n) = open.pop() {
        if is_new.get(n) != Some(&true) {
            continue;
        }
        is_new[n] = false;
        all.push(n);
        let node = &json["nodes"][n];
        open.extend(lod::levels_of(node).iter().rev().filter_map(number));
        open.extend(list(node, "children").iter().rev().filter_map(number));
    }
    all
}

/// Duplicates nodes and skins; returns the new index of each node.
fn copy(json: &mut Value, nodes: &[usize], skins: &BTreeSet<usize>) -> HashMap<usize, usize> {
    let first = list(json, "nodes").len();
    let own: HashMap<usize, usize> = nodes.iter().enumerate().map(|(k, n)| (*n, first + k)).collect();
    let renamed = |value: &mut Value| {
        if let Some(new) = number(value).and_then(|n| own.get(&n)) {
            *value = (*new).into();
        }
    };
    let mut skin_of = HashMap::new();
    for &skin in skins {
        let Some(mut new) = list(json, "skins").get(skin).cloned() else { continue };
        list_mut(&mut new, "joints").iter_mut().for_each(renamed);
        if let Some(skeleton) = new.get_mut("skeleton") {
            renamed(skeleton);
        }
        skin_of.insert(skin, append(json, "skins", new));
    }
    for n in nodes {
        let mut node = json["nodes"][*n].clone();
        list_mut(&mut node, "children").iter_mut().for_each(renamed);
        each_extension_in(&mut node, "nodes", &mut |host, name, content| {
            if let Some(known) = known(name) {
                known.visit(host, content, &mut 0, &mut |kind, value| {
                    if kind.list() == Some("nodes") {
                        renamed(value);
                    }
                    true
                });
            }
            true
        });
        if let Some(skin) = number(&node["skin"]).and_then(|s| skin_of.get(&s)) {
            node["skin"] = (*skin).into();
        }
        append(json, "nodes", node);
    }
    own
}

/// Duplicates animation channels for the nodes of all copies.
fn animate(json: &mut Value, of_copies: &[HashMap<usize, usize>]) {
    for animation in list_mut(json, "animations") {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { continue };
        let mut more = Vec::new();
        for own in of_copies {
            for channel in channels.iter() {
                let mut copy = channel.clone();
                if let Some(new) = number(&channel["target"]["node"]).and_then(|n| own.get(&n)) {
                    copy["target"]["node"] = (*new).into();
                } else if let Some((kind, node, rest)) = pointer_of(channel).and_then(pointed_element)
                    && kind.list() == Some("nodes")
                    && let Some(new) = own.get(&node)
                {
                    set_pointer(&mut copy, format!("/nodes/{new}{rest}"));
                } else {
                    continue;
                }
                more.push(copy);
            }
        }
        channels.extend(more);
    }
}
