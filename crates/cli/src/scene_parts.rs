//! Meshes of a scene as parts of one run.

use lodsmith::Part;
use lodsmith::core::TriMesh;
use lodsmith_io::gltf::{PlacedMesh, SceneMesh, placed_meshes};

/// Returns the meshes of a scene to simplify, as numbers and as parts.
pub(crate) fn parts_of(meshes: &[SceneMesh]) -> (Vec<usize>, Vec<Part<'_>>) {
    let part = |placed: &PlacedMesh| {
        let m = &meshes[placed.index];
        let (instances, scale, stretch) = (m.instances, m.scale, m.stretch);
        Part { mesh: &m.mesh, instances, scale, stretch, system: placed.system, places: &m.places }
    };
    let placed = placed_meshes(meshes);
    (placed.iter().map(|p| p.index).collect(), placed.iter().map(part).collect())
}

/// Returns a count over all instances of the meshes; each counts once if none is placed.
pub(crate) fn count(parts: &[Part<'_>], of: fn(&TriMesh) -> usize) -> usize {
    let is_placed = parts.iter().any(|p| p.instances > 0);
    parts.iter().map(|p| of(p.mesh) * if is_placed { p.instances } else { 1 }).sum()
}
