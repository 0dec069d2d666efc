//! Meshes with new texture coordinates and tangents at their corners.

use std::collections::HashMap;

use crate::tangents::corner_tangents;
use lodsmith_core::{Attribute, Semantic, TriMesh, VertexId, WedgeId};

/// Returns the mesh with these texture coordinates and tangents at the corners of its faces: a wedge is split where
/// its corners have different ones. All other attributes stay. Wedges are numbered by their first use; the
/// attributes of unused ones are dropped. Cost: O(n).
pub(crate) fn with_corners(
    mesh: &TriMesh,
    uvs: Option<&[[[f32; 2]; 3]]>,
    tangents: Option<&[[[f32; 4]; 3]]>,
) -> TriMesh {
    let mut known: HashMap<(u32, [u32; 2], [u32; 4]), WedgeId> = HashMap::new();
    let mut sources: Vec<(WedgeId, usize, usize)> = Vec::new();
    let mut triangles = Vec::with_capacity(mesh.face_count());
    for (f, wedges) in mesh.triangles().iter().enumerate() {
        triangles.push([0, 1, 2].map(|k| {
            let uv = uvs.map_or([0; 2], |all| all[f][k].map(f32::to_bits));
            let tangent = tangents.map_or([0; 4], |all| all[f][k].map(f32::to_bits));
            *known.entry((wedges[k].0, uv, tangent)).or_insert_with(|| {
                sources.push((wedges[k], f, k));
                WedgeId::new(sources.len() - 1)
            })
        }));
    }
    let vertex_of: Vec<VertexId> = sources.iter().map(|s| mesh.vertex_of(s.0)).collect();
    let mut made = TriMesh::with_wedges(mesh.positions().clone(), vertex_of, triangles)
        .expect("vertices are those of the mesh, and wedges were just numbered");
    let carried = |n: &[[f32; 3]]| sources.iter().map(|s| n[s.0.index()]).collect();
    let fits = "there is one for each wedge";
    made.set_normals(mesh.normals().map(carried)).expect(fits);
    let own = |t: &[[f32; 2]]| sources.iter().map(|s| t[s.0.index()]).collect();
    let new = uvs.map(|all| sources.iter().map(|&(_, f, k)| all[f][k]).collect());
    made.set_uvs(new.or_else(|| mesh.uvs().map(own))).expect(fits);
    made.set_colors(mesh.colors().map(|c| sources.iter().map(|s| c[s.0.index()]).collect())).expect(fits);
    made.set_regions(mesh.regions().map(<[_]>::to_vec)).expect("there is one for each face");
    for attribute in mesh.further_attributes() {
        if tangents.is_some() && attribute.semantic == Semantic::Tangent {
            continue;
        }
        let values = sources.iter().flat_map(|s| attribute.of(s.0)).copied().collect();
        made.add_attribute(Attribute { values, ..attribute.clone() }).expect(fits);
    }
    if let Some(all) = tangents {
        let values = sources.iter().flat_map(|&(_, f, k)| all[f][k]).collect();
        made.add_attribute(Attribute { semantic: Semantic::Tangent, width: 4, values }).expect(fits);
    }
    made
}

/// Returns the mesh with the tangents of MikkTSpace; unchanged if it lacks normals or texture coordinates. Cost:
/// O(n log n).
pub fn with_tangents(mesh: &TriMesh) -> TriMesh {
    let (Some(normals), Some(uvs)) = (mesh.normals(), mesh.uvs()) else { return mesh.clone() };
    let wedge = |f: usize, k: usize| mesh.triangles()[f][k].index();
    let tangents = corner_tangents(mesh, &|f, k| normals[wedge(f, k)], &|f, k| uvs[wedge(f, k)]);
    with_corners(mesh, None, Some(&tangents))
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;

    #[test]
    fn wedges_are_split_only_where_corners_differ() {
        let mut mesh = shapes::grid(4);
        let heights: Vec<[f32; 4]> = (0..mesh.wedge_count()).map(|w| [w as f32, 0.0, 0.0, 1.0]).collect();
        mesh.set_colors(Some(heights)).unwrap();
        let at = |w: WedgeId| mesh.positions().view().get(mesh.vertex_of(w));
        let uv = |w: WedgeId| [at(w)[0] as f32, at(w)[1] as f32];
        let smooth: Vec<[[f32; 2]; 3]> = mesh.triangles().iter().map(|t| t.map(uv)).collect();
        let same = with_corners(&mesh, Some(&smooth), None);
        assert_eq!(same.wedge_count(), mesh.wedge_count());
        // One face of its own.
        let mut torn = smooth;
        torn[5] = torn[5].map(|[u, v]| [u + 2.0, v]);
        let made = with_corners(&mesh, Some(&torn), None);
        assert_eq!(made.wedge_count(), mesh.wedge_count() + 3);
        for (f, wedges) in made.triangles().iter().enumerate() {
            for (k, w) in wedges.iter().enumerate() {
                let before = mesh.triangles()[f][k];
                assert_eq!(made.vertex_of(*w), mesh.vertex_of(before));
                assert_eq!(made.uvs().unwrap()[w.index()], torn[f][k]);
                assert_eq!(made.colors().unwrap()[w.index()][0], before.0 as f32);
            }
        }
    }
}
