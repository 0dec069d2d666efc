//! Models: meshes placed by nodes, with materials and animations.
//!
//! Plain data, the same for every format, filled by readers and walked by renderers. A mesh without a scene
//! is a model of one node.

pub mod animation;
pub mod deform;
pub mod material;
mod pose;
mod rest;

use std::sync::Arc;

use glam::DMat4;

use crate::image::Image;
use crate::mesh::TriMesh;

pub use animation::{Animation, Channel, Interpolation, Pose, Skin, Track, Transform};
pub use deform::{Deformed, are_near, deform, has_joints, joints_in_use};
pub use material::{AlphaMode, Material, Sampler, TextureRef, Wrap};

/// Meshes, the nodes that place them, materials and animations.
///
/// Indices refer to the lists of the same model and are in range: the creator of a model ensures it.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Model {
    /// The meshes, each stored once however often it is placed.
    pub meshes: Vec<ModelMesh>,
    /// Nodes that place meshes. Children are given by index; the roots are in [`Model::roots`].
    pub nodes: Vec<Node>,
    /// Nodes without a parent that are drawn.
    pub roots: Vec<usize>,
    /// Materials of surfaces.
    pub materials: Vec<Material>,
    /// Decoded texture images.
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::shared_list"))]
    pub images: Vec<Arc<Image>>,
    /// Skins with the joints that deform meshes.
    pub skins: Vec<Skin>,
    /// Animations of nodes and morph targets.
    pub animations: Vec<Animation>,
    /// Colour space of the vertex colours.
    pub vertex_colors: VertexColors,
}

/// Colour space of [`TriMesh::colors`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum VertexColors {
    /// sRGB, as displayed: in all formats but glTF.
    #[default]
    Srgb,
    /// Linear: in glTF, where they are factors of the base colour.
    Linear,
}

/// A mesh of a model.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ModelMesh {
    /// Display name.
    pub name: String,
    /// Its triangles, in mesh coordinates.
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::shared"))]
    pub mesh: Arc<TriMesh>,
    /// The material index of each region of the mesh; one entry for a mesh without regions. `None` is a plain
    /// material.
    pub materials: Vec<Option<usize>>,
    /// Weight of each morph target at rest.
    pub morph_weights: Vec<f32>,
}

/// A node: a transform, and the mesh placed there.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Node {
    /// Display name; empty if it has none.
    pub name: String,
    /// Transform to the parent's coordinates.
    pub transform: Transform,
    /// Indices of the child nodes.
    pub children: Vec<usize>,
    /// Index of the mesh placed here.
    pub mesh: Option<usize>,
    /// Index of the skin that deforms the mesh.
    pub skin: Option<usize>,
    /// Weights of the morph targets here, if they differ from the weights of the mesh.
    pub morph_weights: Option<Vec<f32>>,
}

/// A mesh placed by a node.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Index of the node.
    pub node: usize,
    /// Index of the mesh.
    pub mesh: usize,
    /// Transform from mesh to model coordinates. Ignored by skinned meshes: their joints place them.
    pub world_from_mesh: DMat4,
}

impl Model {
    /// Makes a model of one mesh, with a plain material.
    pub fn of_mesh(mesh: impl Into<Arc<TriMesh>>) -> Self {
        let mesh = mesh.into();
        let regions = mesh.regions().and_then(|r| r.iter().map(|r| r.index() + 1).max()).unwrap_or(1);
        let mesh = ModelMesh {
            name: String::new(),
            mesh,
            materials: vec![None; regions],
            morph_weights: Vec::new(),
        };
        let node = Node { mesh: Some(0), ..Node::default() };
        Self { meshes: vec![mesh], nodes: vec![node], roots: vec![0], ..Self::default() }
    }

    /// Returns the model with its meshes replaced by others in the same order, such as simplified ones.
    /// Nodes, materials, skins and animations stay, so the new meshes must have the same regions, joints and
    /// morph targets as the old ones.
    ///
    /// # Panics
    /// If the number of meshes differs.
    #[must_use]
    pub fn with_meshes(&self, meshes: Vec<Arc<TriMesh>>) -> Self {
        assert_eq!(meshes.len(), self.meshes.len(), "the model needs one mesh for each of its meshes");
        let meshes = self.meshes.iter().zip(meshes).map(|(old, mesh)| ModelMesh { mesh, ..old.clone() });
        Self { meshes: meshes.collect(), ..self.clone() }
    }

    /// True if any material is more metallic than not: it reflects its environment and shows little else.
    pub fn has_metal(&self) -> bool {
        self.materials.iter().any(|m| m.metallic > 0.5)
    }

    /// Returns every placed mesh, in the order in which the nodes are reached from the roots.
    ///
    /// Cost: O(nodes).
    pub fn instances(&self, pose: &Pose) -> Vec<Instance> {
        let world = self.world_from_nodes(pose);
        let mut instances = Vec::new();
        let mut open: Vec<usize> = self.roots.iter().rev().copied().collect();
        while let Some(node) = open.pop() {
            if let Some(mesh) = self.nodes[node].mesh {
                instances.push(Instance { node, mesh, world_from_mesh: world[node] });
            }
            open.extend(self.nodes[node].children.iter().rev());
        }
        instances
    }

    /// Returns the transform of each node to model coordinates; nodes that no root reaches count as roots.
    ///
    /// Cost: O(nodes).
    pub fn world_from_nodes(&self, pose: &Pose) -> Vec<DMat4> {
        let local = |node: usize| pose.transforms.get(node).unwrap_or(&self.nodes[node].transform).matrix();
        let mut world: Vec<DMat4> = (0..self.nodes.len()).map(local).collect();
        let mut open = self.roots.clone();
        while let Some(node) = open.pop() {
            for &child in &self.nodes[node].children {
                world[child] = world[node] * world[child];
                open.push(child);
            }
        }
        world
    }

    /// Number of triangles drawn: the triangles of a mesh count once for each node that places it.
    pub fn face_count(&self) -> usize {
        self.instances(&Pose::default()).iter().map(|i| self.meshes[i.mesh].mesh.face_count()).sum()
    }
}
