//! Inventory of the other contents of a file: counts for reports, and warnings for what is dropped.

use lodsmith_core::numbers::counted;
use serde_json::Value;

use super::container::{IGNORABLE_EXTENSIONS, list, number};
use super::instances;
use super::lod::nodes_of_levels;
use super::placements::Placement;
use super::references::INSTANCING;
use crate::error::Warning;
use crate::excerpt::excerpt;
use crate::loaded::Contents;
use crate::three_mf::OF_THREE_MF;

/// Attribute names as shown in reports.
const NAMES: [(&str, &str); 6] = [
    ("NORMAL", "normals"),
    ("TEXCOORD_0", "uvs"),
    ("COLOR_0", "colors"),
    ("TANGENT", "tangents"),
    ("JOINTS_0", "joints"),
    ("WEIGHTS_0", "weights"),
];

/// Suffixes of the names of the material extensions that [`Model`](lodsmith_core::Model) represents.
pub(super) const MATERIALS_OF_MODELS: [&str; 3] = ["unlit", "emissive_strength", "pbrSpecularGlossiness"];

/// The part of a file that is kept, and so needs no warnings.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kept {
    /// The mesh of all instances.
    Mesh,
    /// Meshes, nodes with their names, and the description of the file (`asset`).
    Nodes,
}

/// Returns what only 3MF has, and a mesh cannot hold.
fn marks_lost(json: &Value) -> impl Iterator<Item = &'static str> {
    let of_node = |node: &Value| node["extras"][OF_THREE_MF]["printable"] == false;
    let mark = |primitive: &Value, key: &str| !primitive["extras"][OF_THREE_MF][key].is_null();
    let primitives = || list(json, "meshes").iter().flat_map(|mesh| list(mesh, "primitives"));
    [
        (list(json, "nodes").iter().any(of_node), "marks of parts that are not printed are dropped"),
        (primitives().any(|p| mark(p, "paint")), "what a slicer painted on triangles is dropped"),
        (primitives().any(|p| mark(p, "sets")), "sets of triangles are dropped"),
    ]
    .into_iter()
    .filter_map(|(is, what)| is.then_some(what))
}

/// Counts the contents of a file; returns one warning for each kind of content that is dropped.
pub(super) fn take(json: &Value, placements: &[Placement], kept: Kept) -> (Contents, Vec<Warning>) {
    let count = |name: &str| list(json, name).len();
    let meshes = list(json, "meshes");
    let mut placed = vec![false; meshes.len()];
    let is_merged = kept == Kept::Mesh;
    let merged = || placements.iter().filter(|p| !(is_merged && p.is_hidden));
    merged().for_each(|p| placed[p.mesh] = true);
    let copies = |p: &Placement| p.node.map_or(1, |n| instances::count(json, &json["nodes"][n]));
    let instances = merged().fold(0usize, |n, p| n.saturating_add(copies(p)));
    let mut contents = Contents {
        meshes: instances,
        distinct_meshes: placed.iter().filter(|is_placed| **is_placed).count(),
        instances,
        materials: count("materials"),
        // Several textures may use the same image.
        textures: if count("images") > 0 { count("images") } else { count("textures") },
        skins: count("skins"),
        animations: count("animations"),
        ..Contents::default()
    };
    let mut other_attributes: Vec<String> = Vec::new();
    for mesh in meshes {
        let mut targets = 0;
        for primitive in list(mesh, "primitives") {
            targets = targets.max(list(primitive, "targets").len());
            for name in primitive["attributes"].as_object().into_iter().flat_map(|a| a.keys()) {
                if name == "POSITION" {
                    continue;
                }
                let ours = NAMES.iter().find(|(gltf, _)| gltf == name);
                let shown = ours.map_or_else(|| excerpt(name), |(_, ours)| (*ours).to_owned());
                // A file may have any number of names; these are enough for a report.
                if contents.attributes.len() < 64 && !contents.attributes.contains(&shown) {
                    contents.attributes.push(shown);
                    if !["NORMAL", "TEXCOORD_0", "COLOR_0"].contains(&name.as_str()) {
                        other_attributes.push(excerpt(name));
                    }
                }
            }
        }
        contents.morph_targets += targets;
    }

    let mut warnings = Vec::new();
    let hidden = placements.iter().filter(|p| p.is_hidden).count();
    if hidden > 0 {
        let of_slicer = ["role", "type"]
            .iter()
            .any(|key| list(json, "nodes").iter().any(|node| !node["extras"][OF_THREE_MF][key].is_null()));
        let meshes = counted(hidden, "hidden mesh", "hidden meshes");
        let what = if of_slicer { "what a slicer does not print" } else { "KHR_node_visibility" };
        let text = format!("{meshes} ({what}) left out");
        warnings.push(Warning::lost(text));
        placements.iter().for_each(|p| placed[p.mesh] = true);
    }
    let mut not_carried = |is: bool, what: &str| {
        if is {
            warnings.push(if is_merged {
                Warning::lost_scene_data(what)
            } else {
                Warning::lost(format!("{what} are not carried: only glTF and GLB keep them"))
            });
        }
    };
    // (The name of a single mesh is usually the name of the file.)
    let is_named = ["nodes", "meshes"].iter().flat_map(|kind| list(json, kind)).any(|x| !x["name"].is_null());
    not_carried(is_merged && contents.meshes > 1 && is_named, "names of nodes and meshes");
    not_carried(contents.skins > 0, "skins");
    not_carried(contents.animations > 0, "animations");
    not_carried(contents.morph_targets > 0, "morph targets");
    not_carried(count("cameras") > 0, "cameras");
    not_carried(!json["extensions"]["KHR_lights_punctual"].is_null(), "lights");
    let with_extras = ["meshes", "nodes", "scenes"].iter().flat_map(|kind| list(json, kind));
    let of_file = [json].into_iter().chain(is_merged.then_some(&json["asset"]));
    // Those that are only of 3MF have warnings of their own.
    let has_extras = |v: &Value| match v["extras"].as_object() {
        Some(extras) => extras.keys().any(|key| key != OF_THREE_MF) || extras.is_empty(),
        None => !v["extras"].is_null(),
    };
    not_carried(with_extras.chain(of_file).any(has_extras), "extras");
    if !other_attributes.is_empty() {
        not_carried(true, &format!("attributes {}", other_attributes.join(", ")));
    }
    let unknown: Vec<String> = list(json, "extensionsUsed")
        .iter()
        .filter_map(Value::as_str)
        .filter(|e| match e.strip_prefix("KHR_materials_") {
            // (When meshes are merged, there are warnings for each material.)
            Some(kind) => !is_merged && !MATERIALS_OF_MODELS.contains(&kind),
            None => {
                let is_followed = ["KHR_mesh_quantization", "KHR_node_visibility", INSTANCING].contains(e);
                !is_followed && !IGNORABLE_EXTENSIONS.contains(e)
            }
        })
        .take(16)
        .map(excerpt)
        .collect();
    if !unknown.is_empty() {
        not_carried(true, &format!("extensions {}", unknown.join(", ")));
    }
    if is_merged {
        warnings.extend(marks_lost(json).map(|what| Warning::lost(format!("{what}: only 3MF keeps them"))));
    }
    // Meshes of lower levels are dropped with the extension, for which there is a warning already.
    for level in nodes_of_levels(json) {
        if let Some(flag) = number(&json["nodes"][level]["mesh"]).and_then(|m| placed.get_mut(m)) {
            *flag = true;
        }
    }
    let left = placed.iter().filter(|p| !**p).count();
    if left > 0 {
        let meshes = counted(left, "mesh is", "meshes are");
        warnings.push(Warning::lost(format!("{meshes} not placed in the default scene: dropped")));
    }
    (contents, warnings)
}
