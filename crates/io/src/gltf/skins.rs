//! Skins: their joints, and the matrices from mesh to joint coordinates.

use std::collections::HashMap;

use glam::{DMat4, DVec4};
use lodsmith_core::DisjointSets;
use lodsmith_core::model::{Skin, are_near};
use serde_json::Value;

use super::accessors::Accessor;
use super::affine::Affine;
use super::buffers::Buffers;
use super::container::{list, number};
use super::mesh::Budget;
use crate::error::ReadError;

/// Reads a skin: its joints, and the transform from mesh coordinates to each of them.
pub(super) fn read(
    json: &Value,
    buffers: &Buffers<'_>,
    skin: &Value,
    name: &str,
    budget: &mut Budget,
) -> Result<Skin, ReadError> {
    let nodes = list(json, "nodes").len();
    let joint = |v: &Value| number(v).filter(|&n| n < nodes);
    let joints: Option<Vec<usize>> = list(skin, "joints").iter().map(joint).collect();
    let joints = joints.filter(|all| !all.is_empty());
    let joints =
        joints.ok_or_else(|| ReadError::element(name, "its joints are not all nodes of the file"))?;
    budget.numbers.take(16 * joints.len() as u64)?;
    let joint_from_mesh = match number(&skin["inverseBindMatrices"]) {
        None => vec![DMat4::IDENTITY; joints.len()],
        Some(index) => {
            let accessor = Accessor::of_matrices(json, buffers, index, name)?;
            budget.numbers.take(16 * accessor.count as u64)?;
            let all = accessor.floats::<16>(false)?;
            if all.len() < joints.len() {
                let text = format!("it has {} matrices for {} joints", all.len(), joints.len());
                return Err(ReadError::element(name, text));
            }
            let matrices = all.iter().map(|m| DMat4::from_cols_array(&m.map(f64::from)));
            matrices.take(joints.len()).collect()
        }
    };
    Ok(Skin { joints, joint_from_mesh })
}

/// A skin at rest.
pub(super) struct SkinAtRest {
    /// The transform of a mesh that follows one joint alone, for each joint.
    pub(super) world_from_mesh: Vec<DMat4>,
    /// One of them; equal for skins whose meshes share a coordinate system.
    pub(super) of_system: Affine,
}

impl SkinAtRest {
    /// Returns true if the joints leave a mesh where its node is: the usual pose of a file.
    pub(super) fn is_at(&self, world_from_node: &Affine) -> bool {
        let node = matrix_of(world_from_node);
        self.world_from_mesh.iter().all(|joint| are_near(joint, &node))
    }

    /// Reads all skins of a file; `None` for a skin that cannot be read, whose meshes are placed as if they
    /// had none.
    pub(super) fn all(
        json: &Value,
        buffers: &Buffers<'_>,
        world_from_nodes: &[Affine],
        budget: &mut Budget,
    ) -> Vec<Option<Self>> {
        let read_one =
            |(i, value): (usize, &Value)| read(json, buffers, value, &format!("skins[{i}]"), budget).ok();
        let skins: Vec<Option<Skin>> = list(json, "skins").iter().enumerate().map(read_one).collect();
        let matrix = |(joint, from_mesh): (&usize, &DMat4)| matrix_of(&world_from_nodes[*joint]) * *from_mesh;
        let matrices = |skin: &Skin| skin.joints.iter().zip(&skin.joint_from_mesh).map(matrix).collect();
        let all: Vec<Option<Vec<DMat4>>> = skins.iter().map(|skin| skin.as_ref().map(matrices)).collect();
        let first = |of: u32| all[of as usize].as_ref().map_or(Affine::IDENTITY, |all| affine_of(&all[0]));
        let systems: Vec<Affine> = systems(&skins).into_iter().map(first).collect();
        all.into_iter()
            .zip(systems)
            .map(|(world_from_mesh, of_system)| Some(Self { world_from_mesh: world_from_mesh?, of_system }))
            .collect()
    }
}

/// Returns for each skin the first skin with the same coordinate system: the transform from mesh to a shared joint is
/// equal.
fn systems(skins: &[Option<Skin>]) -> Vec<u32> {
    let mut sets = DisjointSets::new(skins.len());
    let mut known: HashMap<usize, (usize, &DMat4)> = HashMap::new();
    for (i, skin) in skins.iter().enumerate() {
        for (&joint, from_mesh) in skin.iter().flat_map(|s| s.joints.iter().zip(&s.joint_from_mesh)) {
            let (first, other) = *known.entry(joint).or_insert((i, from_mesh));
            if are_near(from_mesh, other) {
                sets.join(first as u32, i as u32);
            }
        }
    }
    sets.into_representatives()
}

fn matrix_of(affine: &Affine) -> DMat4 {
    let [x, y, z] = affine.0.map(DVec4::from);
    DMat4::from_cols(x, y, z, DVec4::W).transpose()
}

/// Returns the affine part of a matrix.
pub(super) fn affine_of(matrix: &DMat4) -> Affine {
    Affine([0, 1, 2].map(|row| matrix.row(row).to_array()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn skins_that_share_a_joint_share_a_system() {
        let skin = |joints: &[usize], at: f64| {
            let from_mesh = DMat4::from_translation(DVec3::splat(at));
            Some(Skin { joints: joints.to_vec(), joint_from_mesh: vec![from_mesh; joints.len()] })
        };
        let skins =
            [skin(&[1, 2], 0.5), skin(&[5], 0.5), skin(&[2, 3], 0.5), None, skin(&[3], 0.7), skin(&[3], 0.5)];
        assert_eq!(systems(&skins), [0, 1, 0, 3, 4, 0]);
    }

    #[test]
    fn matrices_and_maps() {
        let map = Affine([[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0], [9.0, 10.0, 11.0, 12.0]]);
        assert_eq!(
            matrix_of(&map).transform_point3(DVec3::new(1.0, 2.0, 3.0)).to_array(),
            map.point([1.0, 2.0, 3.0])
        );
        assert_eq!(affine_of(&matrix_of(&map)), map);
    }
}
