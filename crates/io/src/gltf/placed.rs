//! The meshes of a scene that are simplified, and which of them share a coordinate system.

use super::scene::SceneMesh;

/// A mesh of a scene that is simplified.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PlacedMesh {
    /// Its number in the scene.
    pub index: usize,
    /// Equal for meshes that share a coordinate system: with one instance each, and equal transforms. `None` for a mesh
    /// without a single placement.
    pub system: Option<usize>,
}

/// Returns the meshes that have instances, or all if none has any.
///
/// Cost: O(meshes × coordinate systems).
pub fn placed_meshes(meshes: &[SceneMesh]) -> Vec<PlacedMesh> {
    let is_any_placed = meshes.iter().any(|m| m.instances > 0);
    let mut systems: Vec<[[f64; 4]; 3]> = Vec::new();
    let taken = meshes.iter().enumerate().filter(|(_, m)| !is_any_placed || m.instances > 0);
    taken
        .map(|(index, m)| {
            let system = m.world_from_mesh.map(|matrix| {
                let known = systems.iter().position(|s| is_near(s, &matrix));
                known.unwrap_or_else(|| {
                    systems.push(matrix);
                    systems.len() - 1
                })
            });
            PlacedMesh { index, system }
        })
        .collect()
}

/// Returns true if two transforms are equal up to rounding: products of the same matrices in another order.
fn is_near(known: &[[f64; 4]; 3], matrix: &[[f64; 4]; 3]) -> bool {
    let size = matrix.as_flattened().iter().fold(0f64, |m, x| m.max(x.abs()));
    let mut pairs = known.as_flattened().iter().zip(matrix.as_flattened());
    pairs.all(|(a, b)| (a - b).abs() <= 1e-6 * size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_are_equal_up_to_rounding() {
        let one = [[1.0, 0.0, 0.0, 5.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let mut other = one;
        other[0][3] += 1e-7;
        assert!(is_near(&one, &other));
        other[0][3] += 1e-4;
        assert!(!is_near(&one, &other));
    }
}
