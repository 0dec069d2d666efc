//! Remeshing: isotropic meshes, with uniform or curvature-adapted edge lengths, and semi-regular meshes,
//! whose coarser levels are contained in the finer ones.

use std::collections::{HashMap, HashSet};

use glam::DVec3;
use lodsmith_core::mesh::compact::compact;
use lodsmith_core::{MeshError, TriMesh, VertexId, WedgeId};

use crate::SimplifyError;
use crate::collapse::order::NONE;
use crate::control::Control;
use crate::methods::task::{PreparedInput, RebuiltSurface, Task};
use crate::options::{Method, Remesh, RemeshPattern};

mod half_edges;
mod isotropic;
mod least_squares;
mod reference;
mod relax;
mod semi_regular;
mod sizing;
mod voxel;

pub(crate) fn make(task: &Task<'_>, control: &mut dyn Control) -> Result<RebuiltSurface, SimplifyError> {
    let Method::Remesh(remesh) = task.options.method else { unreachable!("the method is remesh") };
    let mut made = match remesh {
        Remesh::Voxels { size } => return voxel::make(task, size, control),
        Remesh::OnSurface { pattern: RemeshPattern::SemiRegular { subdivisions }, .. } => {
            semi_regular::make(task, subdivisions, control)?
        }
        Remesh::OnSurface { .. } => isotropic::make(task, control)?,
    };
    separate_coincident(task.input, &mut made);
    Ok(made)
}

/// A vertex that coincides with another is moved by this share of the way to the centroid of its neighbours.
const SEPARATION_SHARE: f64 = 1e-3;

/// Separates coincident vertices, where sheets of the input touch: a file reader would weld them.
fn separate_coincident(prepared: &PreparedInput, made: &mut RebuiltSurface) {
    let place = |p: DVec3| {
        let p = prepared.frame.user_from_unit(p);
        if prepared.is_single { p.map(|x| u64::from((x as f32).to_bits())) } else { p.map(f64::to_bits) }
    };
    let mut taken = HashSet::with_capacity(made.points.len());
    let own = |made: &RebuiltSurface, v: usize| made.kept[v] == NONE;
    // Vertices of the input do not move.
    for v in (0..made.points.len()).filter(|&v| !own(made, v)) {
        taken.insert(place(made.points[v]));
    }
    let late: Vec<usize> =
        (0..made.points.len()).filter(|&v| own(made, v) && !taken.insert(place(made.points[v]))).collect();
    if late.is_empty() {
        return;
    }
    let mut middles: HashMap<usize, (DVec3, f64)> = late.iter().map(|&v| (v, (DVec3::ZERO, 0.0))).collect();
    for t in &made.faces {
        for v in t {
            if let Some((sum, count)) = middles.get_mut(&v.index()) {
                *sum += t.iter().map(|w| made.points[w.index()]).sum::<DVec3>();
                *count += 3.0;
            }
        }
    }
    for v in late {
        let (sum, count) = middles[&v];
        made.points[v] = made.points[v].lerp(sum / count, SEPARATION_SHARE);
    }
}

/// Returns the levels of a semi-regular mesh, coarsest first, as made by [`simplify`](crate::simplify) with
/// [`RemeshPattern::SemiRegular`](crate::RemeshPattern) and `subdivisions`; the last one is the mesh itself.
///
/// Vertex k of a level is vertex k of the next, at the same position, and faces 4k to 4k + 3 of the next
/// level replace face k: subdivision connectivity, as a multiresolution basis needs. If the run ended before
/// all levels were made, fewer are returned: as many as have faces in groups of four with a middle face.
/// Cost: O(n).
pub fn levels(mesh: &TriMesh, subdivisions: usize) -> Vec<TriMesh> {
    let mut levels = vec![mesh.clone()];
    for _ in 0..subdivisions {
        let Some(coarser) = coarser(&levels[levels.len() - 1]) else { break };
        levels.push(coarser);
    }
    levels.reverse();
    levels
}

fn coarser(mesh: &TriMesh) -> Option<TriMesh> {
    let (fours, rest) = mesh.triangles().as_chunks::<4>();
    let vertex = |w: WedgeId| mesh.vertex_of(w);
    let is_one = |four: &[[WedgeId; 3]; 4]| {
        let middle = four[3].map(vertex);
        let sides = [four[1][2], four[2][0], four[0][1]].map(vertex);
        middle == sides && vertex(four[0][2]) == middle[1] && vertex(four[1][0]) == middle[2]
    };
    if !rest.is_empty() || fours.is_empty() || !fours.iter().all(is_one) {
        return None;
    }
    let triangles = fours.iter().map(|four| [four[0][0], four[1][1], four[2][2]]).collect();
    let vertex_of = (0..mesh.wedge_count()).map(|w| vertex(WedgeId::new(w))).collect();
    let coarse = with_attributes_of(mesh, vertex_of, triangles);
    Some(compact(&coarse.expect("wedges, vertices and values are those of a mesh")).mesh)
}

fn with_attributes_of(
    mesh: &TriMesh,
    vertex_of: Vec<VertexId>,
    triangles: Vec<[WedgeId; 3]>,
) -> Result<TriMesh, MeshError> {
    let mut result = TriMesh::with_wedges(mesh.positions().clone(), vertex_of, triangles)?;
    result.set_normals(mesh.normals().map(<[_]>::to_vec))?;
    result.set_uvs(mesh.uvs().map(<[_]>::to_vec))?;
    result.set_colors(mesh.colors().map(<[_]>::to_vec))?;
    for attribute in mesh.further_attributes() {
        result.add_attribute(attribute.clone())?;
    }
    result.set_regions(mesh.regions().map(|r| r.iter().step_by(4).copied().collect()))?;
    Ok(result)
}
