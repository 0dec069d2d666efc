//! A mesh as a glTF scene, with locks and importance mapped to its vertices.

use std::collections::HashMap;

use lodsmith::OwnedMeshData;
use lodsmith::core::TriMesh;
use lodsmith_io::gltf::{Scene, SceneMesh};
use lodsmith_io::{Loaded, Warning};

use crate::args::PartNames;
use crate::constraints;
use crate::file::Destination;
use crate::orient::orient;

/// A mesh that has become a scene.
pub(crate) struct MeshScene {
    pub(crate) scene: Scene,
    /// Locks and importance of the vertices of its only mesh.
    pub(crate) data: OwnedMeshData,
    pub(crate) warnings: Vec<Warning>,
}

impl MeshScene {
    /// Converts a mesh.
    ///
    /// # Errors
    /// If a name on the command line is not found.
    pub(crate) fn new(loaded: Loaded, names: &PartNames, to: &Destination) -> anyhow::Result<Self> {
        let own = constraints::of_mesh(names, &loaded)?;
        let Loaded { mut mesh, regions, mut warnings, .. } = loaded;
        orient(&mut mesh, &to.writing);
        let (scene, lost) = to.as_scene(&mesh, regions)?;
        warnings.extend(lost);
        let of_vertices = scene.meshes().first().map(|there| vertices_of(there, &mesh));
        let mut data = OwnedMeshData::default();
        if let Some(of) = of_vertices {
            data.locked = own.locked.map(|all| of.iter().map(|v| v.iter().any(|&v| all[v])).collect());
            data.importance = own.importance.map(|all| {
                of.iter().map(|v| v.iter().map(|&v| all[v]).reduce(f32::max).unwrap_or(1.0)).collect()
            });
        }
        Ok(Self { scene, data, warnings })
    }
}

/// Returns for each vertex of a scene's mesh the vertices of the mesh that it was made from.
fn vertices_of(there: &SceneMesh, mesh: &TriMesh) -> Vec<Vec<usize>> {
    let moved = there.world_from_mesh.map_or([0.0; 3], |m| m.map(|row| row[3]));
    // As written: relative to the node, and with -0 as 0.
    let key = |p: [f64; 3], by: [f64; 3]| [0, 1, 2].map(|k| ((p[k] - by[k]) as f32 + 0.0).to_bits());
    let mut at: HashMap<[u32; 3], Vec<usize>> = HashMap::new();
    for (v, p) in mesh.positions().view().iter().enumerate() {
        at.entry(key(p, moved)).or_default().push(v);
    }
    let own = there.mesh.positions().view();
    own.iter().map(|p| at.get(&key(p, [0.0; 3])).cloned().unwrap_or_default()).collect()
}
