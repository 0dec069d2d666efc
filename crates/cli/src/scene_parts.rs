//! Meshes of a scene as parts of one run.

use lodsmith::core::TriMesh;
use lodsmith::{OwnedMeshData, Part};
use lodsmith_io::gltf::{PlacedMesh, SceneMesh, placed_meshes};

/// Returns the numbers of the meshes of a scene that are simplified.
pub(crate) fn taken(meshes: &[SceneMesh]) -> Vec<usize> {
    placed_meshes(meshes).iter().map(|placed| placed.index).collect()
}

/// Returns the meshes of a scene that are simplified, with their data, as parts.
pub(crate) fn parts_of<'a>(meshes: &'a [SceneMesh], data: &'a [OwnedMeshData]) -> Vec<Part<'a>> {
    let part = |(placed, data): (&PlacedMesh, &'a OwnedMeshData)| {
        let m = &meshes[placed.index];
        let (instances, scale, stretch) = (m.instances, m.scale, m.stretch);
        let (system, places, data) = (placed.system, &m.places, data.view());
        Part { mesh: &m.mesh, instances, scale, stretch, system, places, data }
    };
    placed_meshes(meshes).iter().zip(data).map(part).collect()
}

/// Returns a count over all instances of the meshes; each counts once if none is placed.
pub(crate) fn count(parts: &[Part<'_>], of: fn(&TriMesh) -> usize) -> usize {
    let is_placed = parts.iter().any(|p| p.instances > 0);
    parts.iter().map(|p| of(p.mesh) * if is_placed { p.instances } else { 1 }).sum()
}
