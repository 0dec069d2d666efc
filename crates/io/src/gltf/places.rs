//! The placement of each copy of each mesh, for everything that merges, measures, counts or draws a scene: by nodes, by
//! instances of nodes, and by the joints of skins.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Mat4;
use lodsmith_core::TriMesh;
use lodsmith_core::model::{deform, has_joints, joints_in_use};
use serde_json::Value;

use super::affine::Affine;
use super::buffers::Buffers;
use super::container::number;
use super::instances::{self, Copies, CopyAccessors};
use super::mesh::Budget;
use super::placements::{PlacedNodes, Placement};
use super::skins::{SkinAtRest, affine_of};
use crate::error::ReadError;

/// Finds the placements of meshes. Data that several nodes share are decoded once, and copies are not stored.
pub(super) struct Places<'a, 'b> {
    json: &'a Value,
    buffers: &'a Buffers<'b>,
    copies: HashMap<CopyAccessors, Arc<Copies>>,
    skins: Vec<Option<Arc<SkinAtRest>>>,
    budget: Budget,
}

/// Where a node places its mesh.
pub(super) struct NodePlaces {
    world_from_node: Affine,
    /// `None` for a node that places its mesh once.
    copies: Option<Arc<Copies>>,
    /// Number and joints of its skin, unless the joints leave the mesh where the node is.
    skin: Option<(usize, Arc<SkinAtRest>)>,
}

impl<'a, 'b> Places<'a, 'b> {
    /// `bytes` is the size of the file, or of its buffers if they are larger.
    pub(super) fn new(json: &'a Value, buffers: &'a Buffers<'b>, nodes: &PlacedNodes, bytes: usize) -> Self {
        let mut budget = Budget::new(bytes);
        let is_skinned = |p: &Placement| p.node.is_some_and(|n| !json["nodes"][n]["skin"].is_null());
        let skins = if nodes.placements.iter().any(is_skinned) {
            SkinAtRest::all(json, buffers, &nodes.world_from_nodes, &mut budget)
        } else {
            Vec::new()
        };
        let skins = skins.into_iter().map(|skin| skin.map(Arc::new)).collect();
        Self { json, buffers, copies: HashMap::new(), skins, budget }
    }

    /// Returns where a node places its mesh. A few bytes may place very many copies: it is an error if their number is
    /// out of proportion to the file.
    pub(super) fn of(&mut self, placement: &Placement) -> Result<NodePlaces, ReadError> {
        let world_from_node = placement.world_from_node;
        let Some(node) = placement.node.map(|n| &self.json["nodes"][n]) else {
            return Ok(NodePlaces { world_from_node, copies: None, skin: None });
        };
        let copies = match instances::accessors(node)? {
            None => None,
            Some(accessors) => Some(match self.copies.get(&accessors) {
                Some(known) => known.clone(),
                None => {
                    let read = Copies::read(self.json, self.buffers, accessors, &mut self.budget)?;
                    let read = Arc::new(read);
                    self.copies.insert(accessors, read.clone());
                    read
                }
            }),
        };
        let mut skin = number(&node["skin"]).and_then(|s| Some((s, self.skins.get(s)?.clone()?)));
        if let Some((_, joints)) = skin.as_ref().filter(|_| copies.is_none()) {
            self.budget.copies.take(joints.world_from_mesh.len() as u64)?;
            skin = skin.filter(|(_, joints)| !joints.is_at(&world_from_node));
        }
        let places = NodePlaces { world_from_node, copies, skin };
        self.budget.copies.take(places.count() as u64)?;
        Ok(places)
    }

    /// Counts `vertices` moved by joints against the limit for a file of this size.
    pub(super) fn take_vertices(&mut self, vertices: usize) -> Result<(), ReadError> {
        self.budget.copies.take(vertices as u64)
    }
}

impl NodePlaces {
    /// Returns the number of copies of the mesh.
    pub(super) fn count(&self) -> usize {
        self.copies.as_ref().map_or(1, |copies| copies.count)
    }

    /// Returns the transform of each copy of a mesh that no skin moves.
    pub(super) fn rigid(&self) -> impl Iterator<Item = Affine> + '_ {
        (0..self.count()).map(|i| match &self.copies {
            None => self.world_from_node,
            Some(copies) => {
                let (translation, rotation, scale) = copies.parts(i);
                self.world_from_node.after(&Affine::of_parts(translation, rotation, scale))
            }
        })
    }

    /// Returns the joints of its skin, which place the mesh if that has joint attributes.
    pub(super) fn skin(&self) -> Option<&SkinAtRest> {
        self.skin.as_ref().map(|(_, skin)| &**skin)
    }

    /// Returns number and joints of the skin that places a mesh, wherever the node is; `None` for a mesh without joints.
    pub(super) fn skin_of(&self, mesh: &TriMesh) -> Option<(usize, Arc<SkinAtRest>)> {
        self.skin.clone().filter(|_| has_joints(mesh))
    }

    /// Returns the only transform of the mesh, which is equal for skins with the same coordinate system; `None` for
    /// several copies.
    pub(super) fn only(&self, is_skinned: bool) -> Option<Affine> {
        match &self.skin {
            _ if self.count() != 1 => None,
            Some((_, skin)) if is_skinned => Some(skin.of_system),
            _ => self.rigid().next(),
        }
    }
}

impl SkinAtRest {
    /// Returns the transform that each joint in use gives to a mesh.
    pub(super) fn of_joints(&self, mesh: &TriMesh) -> impl Iterator<Item = Affine> {
        let in_use = joints_in_use(mesh, self.world_from_mesh.len());
        self.world_from_mesh.iter().zip(in_use).filter(|(_, is_used)| *is_used).map(|(m, _)| affine_of(m))
    }

    /// Returns true if its joints turn a mesh inside out.
    pub(super) fn is_mirrored(&self, mesh: &TriMesh) -> bool {
        self.of_joints(mesh).next().is_some_and(|place| place.determinant() < 0.0)
    }

    /// Returns positions and normals of the wedges of a mesh in the scene, as rendered.
    pub(super) fn deformed(&self, mesh: &TriMesh) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let palette: Vec<Mat4> = self.world_from_mesh.iter().map(|m| m.as_mat4()).collect();
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        deform(mesh, &[], &palette, &mut positions, &mut normals);
        (positions, normals)
    }
}
