//! Wedges and their positions; a mesh with a seam.

use lodsmith::core::{TriMesh, VertexId, WedgeId, shapes};

pub(crate) fn place(mesh: &TriMesh, w: WedgeId) -> [f64; 3] {
    mesh.positions().view().get(mesh.vertex_of(w))
}

pub(crate) fn wedges(mesh: &TriMesh) -> impl Iterator<Item = WedgeId> + use<> {
    (0..mesh.wedge_count() as u32).map(WedgeId)
}

/// A grid whose left and right half have separate texture charts: two wedges at each vertex of the middle
/// line.
pub(crate) fn two_charts(n: u32) -> TriMesh {
    let plain = shapes::wavy_sheet(n);
    let bounds = plain.positions().view().bounds().unwrap();
    let middle = 0.5 * (bounds.min[0] + bounds.max[0]);
    let is_right = |t: &[WedgeId; 3]| t.iter().map(|&w| place(&plain, w)[0]).sum::<f64>() / 3.0 > middle;
    let count = plain.vertex_count() as u32;
    // Wedge v is on the left side, v + count on the right.
    let vertex_of = (0..2 * count).map(|w| VertexId(w % count)).collect();
    let triangles = plain
        .triangles()
        .iter()
        .map(|t| t.map(|w| WedgeId(w.0 + if is_right(t) { count } else { 0 })))
        .collect();
    let mut mesh = TriMesh::with_wedges(plain.positions().clone(), vertex_of, triangles).unwrap();
    let uv = |w: WedgeId| {
        let p = place(&mesh, w);
        [p[0] as f32 + if w.0 >= count { 10.0 } else { 0.0 }, p[1] as f32]
    };
    let uvs = wedges(&mesh).map(uv).collect();
    mesh.set_uvs(Some(uvs)).unwrap();
    lodsmith::core::mesh::compact::compact(&mesh).mesh
}
