//! Temporary vertex normals for meshes that have none, for runs in which normals count.

use lodsmith_core::mesh::normals::vertex_normals;
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::{MeshError, Positions, PositionsView, TriMesh};

use crate::input::Input;

/// Returns the mesh of an input with vertex normals computed from its faces; `None` if it already has
/// normals.
pub(crate) fn with_shape_normals(input: &Input<'_>) -> Result<Option<TriMesh>, MeshError> {
    let mut mesh = match input.mesh {
        Some(mesh) if mesh.normals().is_some() => return Ok(None),
        Some(mesh) => mesh.clone(),
        None => plain(&input.surface.positions(), input.surface.triangles().to_vec())?,
    };
    let joined = weld(input.surface.positions());
    let of_vertex = vertex_normals(&input.surface, |v| joined.of(v));
    let normals = match mesh.vertex_map() {
        None => of_vertex,
        Some(map) => map.iter().map(|v| of_vertex[v.index()]).collect(),
    };
    mesh.set_normals(Some(normals))?;
    Ok(Some(mesh))
}

/// Removes the temporary normals from a result.
pub(crate) fn without_temporary_normals(mut mesh: TriMesh) -> Result<TriMesh, MeshError> {
    mesh.set_normals(None)?;
    if mesh.has_attributes() || mesh.vertex_map().is_none() {
        return Ok(mesh);
    }
    let mut bare = plain(&mesh.positions().view(), mesh.surface().triangles().to_vec())?;
    bare.set_regions(mesh.regions().map(<[_]>::to_vec))?;
    Ok(bare)
}

fn plain(
    positions: &PositionsView<'_>,
    triangles: Vec<[lodsmith_core::VertexId; 3]>,
) -> Result<TriMesh, MeshError> {
    let positions = match positions {
        PositionsView::F32(p) => Positions::F32(p.to_vec()),
        PositionsView::F64(p) => Positions::F64(p.to_vec()),
    };
    TriMesh::new(positions, triangles)
}
