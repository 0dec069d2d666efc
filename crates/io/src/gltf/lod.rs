//! Levels of detail in a scene: the extension `MSFT_lod`.
//!
//! ```text
//! node "a", mesh 0                      node "a", mesh 0, ids [7, 8]        7: node "a_LOD1", mesh 4
//! with children, or moved by an         node "a" ── node "a_LOD0", mesh 0, ids [7, 8]
//!   animation, or a joint
//! ```
//!
//! A reader without the extension sees only level 0: no scene contains the other nodes. Those nodes have the
//! same parent and transform as the node with the extension. So a node that has children, a camera or other
//! extensions, is animated or is a joint gets a new child, which takes over the mesh and its levels.
//!
//! Source: Khronos, "MSFT_lod" (vendor extension of glTF 2.0).

use std::collections::{BTreeMap, BTreeSet};
use std::io;

use lodsmith_core::TriMesh;
use serde_json::{Map, Value, json};

use super::container::{list, list_mut, number};
use super::extension_losses::ExtensionLosses;
use super::features::take_replaced_by_material;
use super::lists::{add_extension, append, take_extension};
use super::references::{OF_INSTANCES, ReferenceKind, named_nodes, pointed_element, repeat_for_levels};
use super::renumber::{Renumbering, pointer_of, set_pointer};

/// Name of the extension.
pub(super) const EXTENSION: &str = "MSFT_lod";
/// Key of its thresholds in the extras of the node.
const COVERAGE_KEY: &str = "MSFT_screencoverage";
/// Properties that nodes of levels copy from the node of level 0.
const COPIED_PROPERTIES: [&str; 6] = ["matrix", "translation", "rotation", "scale", "skin", "weights"];

/// The levels of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SceneLevels {
    /// For each level, from level 0 on, the replacement of each mesh. In level 0 `None` keeps the mesh; in
    /// others it reuses the mesh of the level before.
    pub replaced: Vec<Vec<Option<TriMesh>>>,
    /// For each mesh and each of its levels, the smallest share of the screen that the level is meant for,
    /// descending; empty for no thresholds.
    pub coverage: Vec<Vec<f64>>,
    /// Text before the level number in names of meshes and nodes.
    pub separator: String,
    /// True if names of level 0 get a number too.
    pub numbers_level_0: bool,
    /// Name of the only mesh and the only node of the scene, if these have none.
    pub default_name: Option<String>,
    /// For each level from 1 on, and each mesh, the materials of its primitives, as indices in the scene; a single
    /// index applies to all primitives, and an empty list keeps the materials of level 0.
    pub materials: Vec<Vec<Vec<usize>>>,
}

impl SceneLevels {
    /// Creates levels without thresholds.
    pub fn new(replaced: Vec<Vec<Option<TriMesh>>>) -> Self {
        Self { replaced, separator: "_LOD".to_owned(), ..Self::default() }
    }
}

/// The JSON of a scene with levels, the replacement of each of its meshes, and the extensions that are left out.
type WithLevels = (Value, Vec<Option<TriMesh>>, ExtensionLosses);

/// Returns the scene with nodes and meshes for all levels. `atlas_materials`: those with new texture coordinates.
pub(super) fn with_levels(
    source: &Value,
    levels: &SceneLevels,
    atlas_materials: &BTreeSet<usize>,
) -> io::Result<WithLevels> {
    if nodes_of_levels(source).next().is_some() {
        let problem = "the scene already has levels of detail (MSFT_lod): use a file without them";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    }
    let source = &with_default_name(source, levels.default_name.as_deref());
    let mut json = source.clone();
    let (mut losses, mut changes) = (ExtensionLosses::default(), Renumbering::default());
    let mesh_count = list(source, "meshes").len();
    let mut replaced: Vec<Option<TriMesh>> = levels.replaced.first().cloned().unwrap_or_default();
    replaced.resize(mesh_count, None);
    // Indices of the meshes of levels 1 and up, by source mesh.
    let mut of_mesh: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for m in 0..mesh_count {
        let own = |level: &Vec<Option<TriMesh>>| level.get(m).cloned().flatten();
        let others: Vec<Option<TriMesh>> = levels.replaced.iter().skip(1).map(own).collect();
        if others.iter().all(Option::is_none) {
            continue;
        }
        let name = name_of(source, "meshes", "mesh", m);
        let mut numbers = Vec::with_capacity(others.len());
        for (i, mesh) in others.into_iter().enumerate() {
            let Some(mesh) = mesh else {
                numbers.push(numbers.last().copied().unwrap_or(m));
                continue;
            };
            let mut copy = source["meshes"][m].clone();
            copy["name"] = level_name(&name, &levels.separator, i + 1).into();
            let materials = levels.materials.get(i).and_then(|level| level.get(m));
            set_materials(&mut copy, materials.map_or(&[], Vec::as_slice), atlas_materials, &mut losses);
            numbers.push(append(&mut json, "meshes", copy));
            replaced.push(Some(mesh));
        }
        if levels.numbers_level_0 {
            json["meshes"][m]["name"] = level_name(&name, &levels.separator, 0).into();
        }
        of_mesh.insert(m, numbers);
    }
    name_the_scene(&mut json);
    let needs_own = needs_own_node(&mut json);
    let mut of_node: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for n in 0..list(source, "nodes").len() {
        let Some(m) = number(&source["nodes"][n]["mesh"]) else { continue };
        let Some(numbers) = of_mesh.get(&m) else { continue };
        let name = name_of(source, "nodes", "node", n);
        let host = if needs_own.contains(&n) {
            let host = own_node(&mut json, n, &level_name(&name, &levels.separator, 0));
            changes.move_mesh(n, Some(host));
            host
        } else {
            n
        };
        let mut ids = Vec::with_capacity(numbers.len());
        for (i, mesh) in numbers.iter().enumerate() {
            let mut node = level_node(&json["nodes"][host]);
            node["mesh"] = (*mesh).into();
            node["name"] = level_name(&name, &levels.separator, i + 1).into();
            ids.push(append(&mut json, "nodes", node));
        }
        if levels.numbers_level_0 {
            json["nodes"][host]["name"] = level_name(&name, &levels.separator, 0).into();
        }
        of_node.insert(host, ids.clone());
        let node = &mut json["nodes"][host];
        node["extensions"][EXTENSION] = json!({ "ids": ids });
        let coverage = levels.coverage.get(m).filter(|all| !all.is_empty());
        if let Some(coverage) = coverage.filter(|_| node["extras"].is_null() || node["extras"].is_object()) {
            node["extras"][COVERAGE_KEY] = json!(coverage);
        }
    }
    if !of_mesh.is_empty() {
        add_extension(&mut json, "extensionsUsed", EXTENSION);
    }
    changes.apply(&mut json, &mut losses);
    let further = |kind: ReferenceKind, of: usize| match kind {
        ReferenceKind::Mesh => {
            let mut levels = of_mesh.get(&of).cloned().unwrap_or_default();
            levels.retain(|level| *level != of);
            levels.dedup();
            levels
        }
        ReferenceKind::MeshNode => of_node.get(&of).cloned().unwrap_or_default(),
        _ => Vec::new(),
    };
    repeat_for_levels(&mut json, &further);
    repeat_morphs(&mut json, &further);
    Ok((json, replaced, losses))
}

/// Sets the materials of the primitives of a mesh.
fn set_materials(
    mesh: &mut Value,
    materials: &[usize],
    atlas_materials: &BTreeSet<usize>,
    losses: &mut ExtensionLosses,
) {
    for (i, primitive) in list_mut(mesh, "primitives").iter_mut().enumerate() {
        let own = materials.get(i).or(materials.first().filter(|_| materials.len() == 1));
        if let Some(own) = own.filter(|_| primitive.is_object()) {
            primitive["material"] = (*own).into();
            take_replaced_by_material(primitive, atlas_materials.contains(own), losses);
        }
    }
}

/// Names the only mesh and the only node of a file, if they have no names.
fn with_default_name(source: &Value, name: Option<&str>) -> Value {
    let mut json = source.clone();
    for kind in ["meshes", "nodes"] {
        if let (Some(name), Some([only])) = (name, json[kind].as_array_mut().map(Vec::as_mut_slice))
            && only["name"].is_null()
        {
            only["name"] = name.into();
        }
    }
    json
}

/// Returns the nodes that are lower levels of others.
pub(super) fn nodes_of_levels(json: &Value) -> impl Iterator<Item = usize> + '_ {
    list(json, "nodes").iter().flat_map(levels_of).filter_map(number)
}

/// Returns the references of a node to its lower levels.
pub(super) fn levels_of(node: &Value) -> &[Value] {
    list(&node["extensions"][EXTENSION], "ids")
}

fn level_name(name: &str, mark: &str, level: usize) -> String {
    format!("{name}{mark}{level}")
}

/// Returns the name of an element of a list; for one without, its kind and index.
fn name_of(json: &Value, list: &str, what: &str, index: usize) -> String {
    json[list][index]["name"].as_str().map_or_else(|| format!("{what}_{index}"), str::to_owned)
}

/// Adds a scene if there is none: otherwise every node without a parent is a root, including the nodes of
/// levels.
fn name_the_scene(json: &mut Value) {
    if !list(json, "scenes").is_empty() {
        return;
    }
    let nodes = list(json, "nodes");
    let children: BTreeSet<usize> =
        nodes.iter().flat_map(|n| list(n, "children")).filter_map(number).collect();
    let roots: Vec<usize> = (0..nodes.len()).filter(|n| !children.contains(n)).collect();
    if !roots.is_empty() {
        json["scenes"] = json!([{ "nodes": roots }]);
        json["scene"] = 0.into();
    }
}

/// Returns the nodes that hold more than a mesh, are joints, are animated, or are named by extensions for more than their
/// mesh.
fn needs_own_node(json: &mut Value) -> BTreeSet<usize> {
    let mut all = BTreeSet::new();
    for (n, node) in list(json, "nodes").iter().enumerate() {
        let extensions = node["extensions"].as_object();
        let has_more =
            extensions.is_some_and(|e| e.keys().any(|name| !OF_INSTANCES.contains(&name.as_str())));
        if !list(node, "children").is_empty() || !node["camera"].is_null() || has_more {
            all.insert(n);
        }
    }
    all.extend(named_nodes(json));
    all
}

/// Moves the mesh of a node to a new child of this name; returns the index of the child.
fn own_node(json: &mut Value, n: usize, name: &str) -> usize {
    let mut child = json!({ "name": name });
    if let Some(node) = json["nodes"][n].as_object_mut() {
        for key in ["mesh", "skin", "weights"] {
            if let Some(value) = node.shift_remove(key) {
                child[key] = value;
            }
        }
    }
    for name in OF_INSTANCES {
        if let Some(instances) = take_extension(&mut json["nodes"][n], name) {
            child["extensions"][name] = instances;
        }
    }
    let child = append(json, "nodes", child);
    let node = &mut json["nodes"][n];
    if !node["children"].is_array() {
        node["children"] = json!([]);
    }
    if let Some(children) = node["children"].as_array_mut() {
        children.push(child.into());
    }
    child
}

/// Returns a node with the properties that levels copy from the node of level 0.
fn level_node(node: &Value) -> Value {
    let mut copy = Map::new();
    for key in COPIED_PROPERTIES {
        if let Some(value) = node.get(key) {
            copy.insert(key.to_owned(), value.clone());
        }
    }
    let mut copy = Value::Object(copy);
    for name in OF_INSTANCES {
        if let Some(instances) = node["extensions"].get(name) {
            copy["extensions"][name] = instances.clone();
        }
    }
    copy
}

/// Repeats channels of animations that move morph targets for the levels of their node or mesh; `further` returns the
/// other levels of a node or mesh.
fn repeat_morphs(json: &mut Value, further: &dyn Fn(ReferenceKind, usize) -> Vec<usize>) {
    for animation in list_mut(json, "animations") {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { continue };
        let mut more = Vec::new();
        for channel in channels.iter() {
            let target = &channel["target"];
            if target["path"] == "weights"
                && let Some(node) = number(&target["node"])
            {
                more.extend(further(ReferenceKind::MeshNode, node).into_iter().map(|level| {
                    let mut copy = channel.clone();
                    copy["target"]["node"] = level.into();
                    copy
                }));
            } else if let Some((kind, of, rest)) = pointer_of(channel).and_then(pointed_element)
                && let Some(list) = kind.list()
            {
                more.extend(further(kind, of).into_iter().map(|level| {
                    let mut copy = channel.clone();
                    set_pointer(&mut copy, format!("/{list}/{level}{rest}"));
                    copy
                }));
            }
        }
        channels.extend(more);
    }
}
