//! Removal of vertices and wedges that no face uses.

use crate::ids::{VertexId, WedgeId};
use crate::mesh::TriMesh;
use crate::mesh::weld::{kept, renumbered};

/// A mesh in which every vertex and every wedge is used, and the numbers of dropped ones.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Compacted {
    /// The mesh, with all triangles of the source in the same order.
    pub mesh: TriMesh,
    /// Number of vertices that no face used.
    pub dropped_vertex_count: usize,
    /// Number of wedges that no face used.
    pub dropped_wedge_count: usize,
}

/// Drops the vertices and wedges that no face uses; the others keep their order and are renumbered.
///
/// Cost: O(n).
pub fn compact(mesh: &TriMesh) -> Compacted {
    let mut wedge_used = vec![false; mesh.wedge_count()];
    for w in mesh.triangles.iter().flatten() {
        wedge_used[w.index()] = true;
    }
    let mut vertex_used = vec![false; mesh.vertex_count()];
    for (w, _) in wedge_used.iter().enumerate().filter(|(_, used)| **used) {
        vertex_used[mesh.vertex_of(WedgeId(w as u32)).index()] = true;
    }
    let wedge_number = ranks(&wedge_used);
    let vertex_number = ranks(&vertex_used);
    let wedge_stays = |w: usize| wedge_used[w];
    let vertex_of = mesh.vertex_of.as_deref().map(|map| {
        let mut map = kept(map, wedge_stays);
        map.iter_mut().for_each(|v| *v = VertexId(vertex_number[v.index()]));
        map
    });
    let vertex_of = vertex_of.filter(|map| map.iter().enumerate().any(|(w, v)| v.index() != w));
    let result = renumbered(mesh, |v| vertex_used[v], wedge_stays, &wedge_number, vertex_of);
    Compacted {
        dropped_vertex_count: mesh.vertex_count() - result.vertex_count(),
        dropped_wedge_count: mesh.wedge_count() - result.wedge_count(),
        mesh: result,
    }
}

/// Returns the number of marked entries before each entry.
fn ranks(marks: &[bool]) -> Vec<u32> {
    let mut next = 0;
    marks
        .iter()
        .map(|&marked| {
            let own = next;
            next += u32::from(marked);
            own
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Positions;

    #[test]
    fn unused_vertices_and_wedges_go() {
        let p = (0..5).map(|i| [i as f32, 0.0, 0.0]).collect();
        let map = [4, 0, 3, 3, 1].map(VertexId).to_vec();
        let mut mesh =
            TriMesh::with_wedges(Positions::F32(p), map, vec![[WedgeId(4), WedgeId(2), WedgeId(0)]]).unwrap();
        mesh.set_uvs(Some((0..5).map(|i| [i as f32; 2]).collect())).unwrap();
        let got = compact(&mesh);
        assert_eq!((got.dropped_vertex_count, got.dropped_wedge_count), (2, 2));
        assert_eq!(
            got.mesh.positions(),
            &Positions::F32(vec![[1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
        );
        assert_eq!(got.mesh.vertex_map().unwrap(), [2, 1, 0].map(VertexId));
        assert_eq!(got.mesh.uvs().unwrap(), [[0.0; 2], [2.0; 2], [4.0; 2]]);
        assert_eq!(got.mesh.triangles(), [[WedgeId(2), WedgeId(1), WedgeId(0)]]);
        let again = compact(&got.mesh);
        assert_eq!((again.mesh, again.dropped_wedge_count), (got.mesh, 0));
    }
}
