//! Meshes of a scene as parts of one run.

use lodsmith::Part;
use lodsmith::core::TriMesh;
use lodsmith_io::gltf::SceneMesh;

/// Returns the meshes of a scene to simplify, as numbers and as parts.
pub(crate) fn parts_of(meshes: &[SceneMesh]) -> (Vec<usize>, Vec<Part<'_>>) {
    let mut systems = Vec::new();
    let mut system_of = |m: &SceneMesh| {
        let matrix = m.world_from_mesh?;
        // Equal up to rounding: products of the same matrices in another order.
        let size = matrix.as_flattened().iter().fold(0f64, |m, x| m.max(x.abs()));
        let near = |s: &[[f64; 4]; 3]| {
            let pairs = s.as_flattened().iter().zip(matrix.as_flattened());
            pairs.into_iter().all(|(a, b)| (a - b).abs() <= 1e-6 * size)
        };
        let known = systems.iter().position(near);
        Some(known.unwrap_or_else(|| {
            systems.push(matrix);
            systems.len() - 1
        }))
    };
    // A mesh without instances in the scene is not changed, unless none has any.
    let is_placed = meshes.iter().any(|m| m.instances > 0);
    let taken: Vec<usize> = (0..meshes.len()).filter(|&i| !is_placed || meshes[i].instances > 0).collect();
    let part = |m: &SceneMesh| {
        let system = system_of(m);
        (m.instances, m.scale, system)
    };
    let said: Vec<_> = taken.iter().map(|&i| &meshes[i]).map(part).collect();
    let parts = taken.iter().zip(said).map(|(&i, (instances, scale, system))| Part {
        mesh: &meshes[i].mesh,
        instances,
        scale,
        system,
    });
    let parts = parts.collect();
    (taken, parts)
}

/// Returns a count over all instances of the meshes; each counts once if none is placed.
pub(crate) fn count(parts: &[Part<'_>], of: fn(&TriMesh) -> usize) -> usize {
    let is_placed = parts.iter().any(|p| p.instances > 0);
    parts.iter().map(|p| of(p.mesh) * if is_placed { p.instances } else { 1 }).sum()
}
