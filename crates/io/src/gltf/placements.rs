//! Nodes that place meshes: world transforms computed from the trees of nodes.

use serde_json::Value;

use super::affine::Affine;
use super::container::{entry, list, whole};
use super::lod::nodes_of_levels;
use crate::error::ReadError;

/// Maximum number of faces, and of vertices, that the nodes of one file may place: a small file can instance
/// a large mesh very often. Guessed: more than any user has needed, within the memory of a workstation.
const MAX_PLACED: u64 = 1 << 28;

/// Maximum number of placed faces, and of vertices, per byte of the file, or of its buffers if they are
/// larger: a few kilobytes must not request gigabytes. Guessed: a mesh has some 20 bytes per triangle, so
/// this allows a thousand copies; a million faces are always allowed.
const MAX_PLACED_PER_BYTE: u64 = 64;
const ALWAYS_PLACED: u64 = 1 << 20;

/// Returns an error if the nodes of a file of this size place too many faces or vertices. Shared by all
/// callers that process each instance, whether they merge or draw them.
pub(super) fn check_placed(faces: u64, vertices: u64, bytes: usize) -> Result<(), ReadError> {
    let by_bytes = (bytes as u64).saturating_mul(MAX_PLACED_PER_BYTE).saturating_add(ALWAYS_PLACED);
    let limit = MAX_PLACED.min(by_bytes);
    let [many_faces, many_vertices] = if by_bytes < MAX_PLACED {
        [
            "number of triangles placed by nodes, for a file of this size,",
            "number of vertices placed by nodes, for a file of this size,",
        ]
    } else {
        ["number of triangles placed by nodes", "number of vertices placed by nodes"]
    };
    for (what, size) in [(many_faces, faces), (many_vertices, vertices)] {
        if size > limit {
            return Err(ReadError::Limit { what, size, limit });
        }
    }
    Ok(())
}

/// A node that places a mesh.
#[derive(Clone, Debug)]
pub(super) struct Placement {
    /// `None` if no node of the file places a mesh.
    pub(super) node: Option<usize>,
    pub(super) mesh: usize,
    pub(super) world_from_node: Affine,
    /// True if it is hidden while others are shown (`KHR_node_visibility`).
    pub(super) is_hidden: bool,
}

/// The nodes of a file.
pub(super) struct PlacedNodes {
    /// The nodes of the default scene that place meshes; below all roots if there is no scene.
    pub(super) placements: Vec<Placement>,
    /// The transform of each node of the file; nodes that no root reaches count as roots.
    pub(super) world_from_nodes: Vec<Affine>,
}

impl PlacedNodes {
    pub(super) fn new(json: &Value) -> Result<Self, ReadError> {
        let nodes = list(json, "nodes");
        let roots = roots(json)?;
        let mut placements = Vec::new();
        let mut world: Vec<Option<Affine>> = vec![None; nodes.len()];
        // An explicit stack: a chain of nodes may be too long for recursion.
        let mut open: Vec<(usize, Affine, bool)> =
            roots.into_iter().rev().map(|r| (r, Affine::IDENTITY, false)).collect();
        while let Some((index, world_from_parent, is_hidden)) = open.pop() {
            let (node, name) = entry(json, "nodes", index, "the scene")?;
            let world_from_node = world_from_parent.after(&local(node, &name)?);
            if world[index].replace(world_from_node).is_some() {
                return Err(ReadError::element(
                    name,
                    "is reached twice: nodes must form a tree, but this one has two parents or is its own ancestor",
                ));
            }
            let is_hidden = is_hidden || node["extensions"]["KHR_node_visibility"]["visible"] == false;
            if let Some(mesh) = whole(node, "mesh", &name)? {
                let (_, _) = entry(json, "meshes", mesh, &name)?;
                placements.push(Placement { node: Some(index), mesh, world_from_node, is_hidden });
            }
            let children = indices(node, "children", &name)?;
            open.extend(children.into_iter().rev().map(|c| (c, world_from_node, is_hidden)));
        }
        if placements.iter().all(|p| p.is_hidden) {
            placements.iter_mut().for_each(|p| p.is_hidden = false);
        }
        let unreached = |node: &Value| local(node, "").unwrap_or(Affine::IDENTITY);
        let world =
            world.into_iter().zip(nodes).map(|(known, node)| known.unwrap_or_else(|| unreached(node)));
        Ok(Self { placements, world_from_nodes: world.collect() })
    }

    /// Adds all meshes, untransformed, if no node places one.
    pub(super) fn or_all_meshes(mut self, json: &Value) -> Self {
        if self.placements.is_empty() {
            let place =
                |mesh| Placement { node: None, mesh, world_from_node: Affine::IDENTITY, is_hidden: false };
            self.placements = (0..list(json, "meshes").len()).map(place).collect();
        }
        self
    }
}

/// Returns the roots of the default scene; all nodes without a parent if there is no scene.
pub(super) fn roots(json: &Value) -> Result<Vec<usize>, ReadError> {
    let nodes = list(json, "nodes");
    let scenes = list(json, "scenes");
    let mut roots = Vec::new();
    if scenes.is_empty() {
        let mut has_parent = vec![false; nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            for child in indices(node, "children", &format!("nodes[{i}]"))? {
                if let Some(flag) = has_parent.get_mut(child) {
                    *flag = true;
                }
            }
        }
        // Lower levels of detail belong to their node and are not roots.
        for level in nodes_of_levels(json) {
            if let Some(flag) = has_parent.get_mut(level) {
                *flag = true;
            }
        }
        roots.extend((0..nodes.len()).filter(|&i| !has_parent[i]));
    } else {
        let default = whole(json, "scene", "scene")?.unwrap_or(0);
        let (scene, name) = entry(json, "scenes", default, "scene")?;
        roots.extend(indices(scene, "nodes", &name)?);
    }
    Ok(roots)
}

/// Returns a list of indices.
fn indices(object: &Value, list_name: &str, at: &str) -> Result<Vec<usize>, ReadError> {
    let number = |v: &Value| {
        let number = v.as_u64().and_then(|n| usize::try_from(n).ok());
        number.ok_or_else(|| {
            ReadError::element(at, format!("{list_name} contains values that are not indices"))
        })
    };
    list(object, list_name).iter().map(number).collect()
}

/// Returns the transform of a node relative to its parent: a matrix, or translation, rotation and scale.
fn local(node: &Value, name: &str) -> Result<Affine, ReadError> {
    if let Some(m) = numbers::<16>(node, "matrix", name)? {
        // Column by column; the last row is 0 0 0 1.
        return Ok(Affine([0, 1, 2].map(|r| [0, 1, 2, 3].map(|c| m[4 * c + r]))));
    }
    let t = numbers::<3>(node, "translation", name)?.unwrap_or([0.0; 3]);
    let q = numbers::<4>(node, "rotation", name)?.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let s = numbers::<3>(node, "scale", name)?.unwrap_or([1.0; 3]);
    Ok(Affine::of_parts(t, q, s))
}

/// Returns a list of `N` numbers; `None` if it is missing.
pub(super) fn numbers<const N: usize>(
    node: &Value,
    what: &str,
    name: &str,
) -> Result<Option<[f64; N]>, ReadError> {
    if node[what].is_null() {
        return Ok(None);
    }
    let values: Vec<f64> =
        list(node, what).iter().filter_map(Value::as_f64).filter(|x| x.is_finite()).collect();
    let values = <[f64; N]>::try_from(values).ok().filter(|_| list(node, what).len() == N);
    values.map(Some).ok_or_else(|| ReadError::element(name, format!("{what} is not {N} numbers")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn placements(json: &Value) -> Vec<Placement> {
        PlacedNodes::new(json).unwrap().or_all_meshes(json).placements
    }

    fn refusal(json: &Value) -> String {
        PlacedNodes::new(json).err().unwrap().to_string()
    }

    #[test]
    fn rotation_scale_and_parents() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let json = json!({"scenes": [{"nodes": [0]}], "meshes": [{}], "nodes": [
            {"children": [1], "translation": [10, 0, 0]},
            {"mesh": 0, "rotation": [0, 0, half, half], "scale": [2, 2, -2]},
        ]});
        let got = PlacedNodes::new(&json).unwrap().placements;
        assert_eq!(got.len(), 1);
        let m = got[0].world_from_node;
        let p = m.point([1.0, 0.0, 0.0]);
        assert!((p[0] - 10.0).abs() < 1e-12 && (p[1] - 2.0).abs() < 1e-12, "{p:?}");
        assert!((m.determinant() + 8.0).abs() < 1e-9);
        // The mirror is along z: a normal along z is reversed.
        assert!(m.normal_matrix()[2][2] < 0.0 && m.normal_matrix()[1][0] > 0.0);
    }

    #[test]
    fn a_chain_of_100_000_nodes_is_walked() {
        let nodes: Vec<Value> =
            (0..100_000).map(|i| json!({"children": [i + 1]})).chain([json!({"mesh": 0})]).collect();
        let json = json!({"scenes": [{"nodes": [0]}], "meshes": [{}], "nodes": nodes});
        assert_eq!(placements(&json).len(), 1);
    }

    #[test]
    fn nodes_that_do_not_form_a_tree_are_errors() {
        let twice = json!({"scenes": [{"nodes": [0, 1]}], "nodes": [{"children": [1]}, {}]});
        let cycle = json!({"scenes": [{"nodes": [0]}], "nodes": [{"children": [1]}, {"children": [0]}]});
        assert!(refusal(&twice).starts_with("nodes[1]: is reached twice"));
        assert!(refusal(&cycle).starts_with("nodes[0]: is reached twice"));
        let beyond = json!({"nodes": [{"children": [7]}]});
        assert_eq!(refusal(&beyond), "the scene: refers to nodes[7], but the file has 1");
    }

    #[test]
    fn meshes_that_no_node_places_are_read() {
        assert_eq!(placements(&json!({"meshes": [{}, {}], "nodes": [{}]})).len(), 2);
    }

    #[test]
    fn nodes_below_a_hidden_node_are_hidden_unless_all_are() {
        let hidden = json!({"KHR_node_visibility": {"visible": false}});
        let mut json = json!({"scenes": [{"nodes": [0, 2]}], "meshes": [{}], "nodes": [
            {"children": [1], "extensions": hidden}, {"mesh": 0}, {"mesh": 0},
        ]});
        let are_hidden = |json: &Value| placements(json).iter().map(|p| p.is_hidden).collect::<Vec<_>>();
        assert_eq!(are_hidden(&json), [true, false]);
        json["nodes"][2]["extensions"] = json["nodes"][0]["extensions"].clone();
        assert_eq!(are_hidden(&json), [false, false]);
    }
}
