//! Distances between the items of a picture and their references.

use lodsmith_core::measure::{MeasureError, Prepared, vertex_distances};
use lodsmith_core::model::{Instance, Pose};
use lodsmith_core::{Model, Positions, TriMesh, VertexId};
use lodsmith_render::{DMat4, DVec3};

use super::item::Item;
use crate::error::AssetError;

/// Computes the distances of vertices from their reference, for heat maps and captions. If a reference has a single
/// candidate, the distances of the reference from it are computed too; otherwise the reference has no heat map.
pub(super) fn measure(items: &mut [Item]) -> Result<(), AssetError> {
    for of in 0..items.len() {
        let candidates: Vec<usize> = (0..items.len()).filter(|i| items[*i].reference == Some(of)).collect();
        if candidates.is_empty() {
            continue;
        }
        let reference = merged(&items[of].model)?;
        let diagonal = reference.positions().view().bounds().map_or(0.0, |b| b.diagonal());
        let reference = prepared(&reference).map_err(|why| why.of(&items[of].path))?;
        for &i in &candidates {
            items[i].diagonal = diagonal;
            items[i].distances = Some(distances_to(&reference, &items[i].model)?);
        }
        if let [only] = candidates[..] {
            items[of].distances = match prepared(&merged(&items[only].model)?) {
                Ok(candidate) => Some(distances_to(&candidate, &items[of].model)?),
                // The candidate has no faces to measure from.
                Err(AssetError::Measure(MeasureError::Empty { .. })) => None,
                Err(why) => return Err(why.of(&items[only].path)),
            };
        }
    }
    Ok(())
}

/// Returns the largest distance.
pub(super) fn largest(distances: &[Vec<f32>]) -> f64 {
    distances.iter().flatten().filter(|d| d.is_finite()).fold(0f64, |m, &d| m.max(f64::from(d)))
}

fn prepared(mesh: &TriMesh) -> Result<Prepared, AssetError> {
    Ok(Prepared::new(&mesh.surface())?)
}

/// Returns the positions and faces of an instance, in world coordinates.
fn placed(model: &Model, instance: &Instance) -> Result<TriMesh, AssetError> {
    let mesh = &model.meshes[instance.mesh].mesh;
    let faces = mesh.surface().triangles().to_vec();
    if instance.world_from_mesh == DMat4::IDENTITY {
        return Ok(TriMesh::new(mesh.positions().clone(), faces)?);
    }
    let to_world = |p| instance.world_from_mesh.transform_point3(DVec3::from(p)).to_array();
    Ok(TriMesh::new(Positions::F64(mesh.positions().view().iter().map(to_world).collect()), faces)?)
}

/// Returns all instances as one mesh.
fn merged(model: &Model) -> Result<TriMesh, AssetError> {
    let instances = model.instances(&Pose::default());
    if let [one] = &instances[..] {
        return placed(model, one);
    }
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for instance in &instances {
        let mesh = placed(model, instance)?;
        let first = positions.len() as u32;
        faces.extend(mesh.surface().triangles().iter().map(|t| t.map(|v| VertexId(first + v.0))));
        positions.extend(mesh.positions().view().iter());
    }
    Ok(TriMesh::new(Positions::F64(positions), faces)?)
}

/// Returns the distance of each vertex of each mesh from the reference; for a mesh with several instances, the
/// largest of them.
fn distances_to(reference: &Prepared, model: &Model) -> Result<Vec<Vec<f32>>, AssetError> {
    let mut all: Vec<Vec<f32>> = model.meshes.iter().map(|m| vec![0.0; m.mesh.vertex_count()]).collect();
    for instance in model.instances(&Pose::default()) {
        let distances = vertex_distances(&placed(model, &instance)?.surface(), reference);
        let largest = &mut all[instance.mesh];
        largest.iter_mut().zip(distances).for_each(|(largest, d)| *largest = largest.max(d as f32));
    }
    Ok(all)
}
