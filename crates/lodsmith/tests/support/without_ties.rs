//! Shapes whose results do not depend on rounding, and changes that should not affect a run.

use lodsmith::core::{Positions, TriMesh, VertexId, shapes};

use super::Random;

/// Returns shapes without exact ties, so that the order of collapses does not depend on rounding.
pub(crate) fn shapes_without_ties() -> [(&'static str, TriMesh); 3] {
    [
        ("noisy_sphere", shapes::noisy_sphere(3, 0.05, 3)),
        ("blob", shapes::blob(3, 4)),
        ("wavy_sheet", shapes::wavy_sheet(16)),
    ]
}

/// Returns a mesh without attributes with other positions, in double precision.
pub(crate) fn moved(mesh: &TriMesh, map: impl Fn([f64; 3]) -> [f64; 3]) -> TriMesh {
    let points = mesh.positions().view().iter().map(map).collect();
    TriMesh::new(Positions::F64(points), mesh.surface().triangles().to_vec()).expect("the same faces")
}

/// Returns the mesh with vertices and faces in another order, and faces starting at another corner.
pub(crate) fn reordered(mesh: &TriMesh, seed: u64) -> TriMesh {
    let order = shuffled(mesh.vertex_count(), seed);
    let mut new = vec![VertexId(0); order.len()];
    order.iter().enumerate().for_each(|(i, &old)| new[old] = VertexId::new(i));
    let view = mesh.positions().view();
    let points = order.iter().map(|&i| view.get(VertexId::new(i))).collect();
    let triangles = shuffled(mesh.face_count(), seed + 10).into_iter().map(|f| {
        let [a, b, c] = mesh.surface().triangles()[f].map(|v| new[v.index()]);
        [[a, b, c], [b, c, a], [c, a, b]][f % 3]
    });
    TriMesh::new(Positions::F64(points), triangles.collect()).expect("the same faces")
}

/// Returns a seeded shuffle: `order[i]` is the old number of the element with the new number i.
fn shuffled(n: usize, seed: u64) -> Vec<usize> {
    let mut random = Random(seed);
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, random.below(i as u64 + 1) as usize);
    }
    order
}
