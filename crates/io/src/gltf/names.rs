//! Names of the nodes and materials that belong to the meshes of a file.

use serde_json::Value;

use super::container::list;

/// Names by which a mesh of a scene, or a primitive of it, can be selected.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MeshNames {
    /// Names of the nodes that place the mesh and of their ancestors, each once.
    pub nodes: Vec<String>,
    /// Name of the material of each primitive, indexed by region; `None` if it has none.
    pub materials: Vec<Option<String>>,
}

/// Maximum number of ancestors of a mesh that are visited. (Guessed; deeper than the trees of any tool.)
const MAX_ANCESTORS: usize = 100;

impl MeshNames {
    /// Returns the names of all meshes.
    pub(super) fn all(json: &Value) -> Vec<Self> {
        let number = |v: &Value| v.as_u64().and_then(|n| usize::try_from(n).ok());
        let materials = list(json, "materials");
        let material = |primitive: &Value| {
            let of = materials.get(number(&primitive["material"])?)?;
            of["name"].as_str().map(str::to_owned)
        };
        let of_mesh = |mesh: &Value| {
            let materials = list(mesh, "primitives").iter().map(material).collect();
            Self { nodes: Vec::new(), materials }
        };
        let mut all: Vec<Self> = list(json, "meshes").iter().map(of_mesh).collect();

        let nodes = list(json, "nodes");
        let mut parent = vec![None; nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            for child in list(node, "children").iter().filter_map(number) {
                if let Some(parent) = parent.get_mut(child) {
                    *parent = Some(i);
                }
            }
        }
        for (i, node) in nodes.iter().enumerate() {
            let Some(names) = number(&node["mesh"]).and_then(|m| all.get_mut(m)) else { continue };
            // Nodes outside the scene may form cycles.
            let above = std::iter::successors(Some(i), |&n| parent[n]).take(MAX_ANCESTORS);
            names.nodes.extend(above.filter_map(|n| nodes[n]["name"].as_str()).map(str::to_owned));
        }
        for names in &mut all {
            names.nodes.sort();
            names.nodes.dedup();
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn ancestors_are_included_and_cycles_end() {
        let file = json!({
            "nodes": [
                { "name": "car", "children": [1, 2] },
                { "name": "wheel", "mesh": 0 },
                { "mesh": 1 },
                { "name": "ring", "mesh": 1, "children": [4] },
                { "name": "round", "children": [3] },
            ],
            "materials": [{ "name": "rubber" }, {}],
            "meshes": [
                { "primitives": [{ "material": 0 }, { "material": 1 }, {}] },
                { "primitives": [{ "material": 9 }] },
            ],
        });
        let all = MeshNames::all(&file);
        assert_eq!((all.len(), &all[0].nodes[..]), (2, &["car", "wheel"].map(str::to_owned)[..]));
        assert_eq!(all[0].materials, [Some("rubber".to_owned()), None, None]);
        assert_eq!(all[1].nodes, ["car", "ring", "round"]);
        assert_eq!(all[1].materials, [None]);
    }
}
