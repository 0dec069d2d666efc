//! What is to be seen: meshes placed by nodes, with what they look like and how they move.
//!
//! Plain data, the same for every format: whoever reads fills it, whoever draws walks it. A mesh without a scene around it
//! is a model of one node.

pub mod animation;
pub mod deform;
pub mod material;
mod pose;

use std::sync::Arc;

use glam::DMat4;

use crate::image::Image;
use crate::mesh::TriMesh;

pub use animation::{Animation, Channel, Interpolation, Pose, Skin, Track, Transform};
pub use deform::{Deformed, deform};
pub use material::{AlphaMode, Material, Sampler, TextureRef, Wrap};

/// Meshes, where they stand, what they look like, and how they move.
///
/// Indices name places in the lists of the same model and are in range: whoever makes a model sees to it.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// The meshes, each once however often it stands somewhere.
    pub meshes: Vec<ModelMesh>,
    /// Who stands where. Children come by number; roots are those of [`Model::roots`].
    pub nodes: Vec<Node>,
    /// Nodes without a parent that are to be seen.
    pub roots: Vec<usize>,
    /// What surfaces look like.
    pub materials: Vec<Material>,
    /// Pictures on surfaces, decoded.
    pub images: Vec<Arc<Image>>,
    /// Joints that pull meshes.
    pub skins: Vec<Skin>,
    /// What moves.
    pub animations: Vec<Animation>,
    /// What the colours of vertices mean.
    pub vertex_colors: VertexColors,
}

/// What the numbers of [`TriMesh::colors`] mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VertexColors {
    /// As screens take them (sRGB): in all formats that do not say.
    #[default]
    Srgb,
    /// Amounts of light: in glTF, where they are factors of the base colour.
    Linear,
}

/// A mesh of a model.
#[derive(Clone, Debug)]
pub struct ModelMesh {
    /// Its name, for people.
    pub name: String,
    /// Its triangles, in its own coordinates.
    pub mesh: Arc<TriMesh>,
    /// The material of each region of the mesh, by number; one entry for a mesh without regions. `None` is a plain one.
    pub materials: Vec<Option<usize>>,
    /// How strong each morph target is at rest.
    pub morph_weights: Vec<f32>,
}

/// A place, and what stands there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Its name, for people; empty without one.
    pub name: String,
    /// Where it stands as seen from its parent.
    pub transform: Transform,
    /// Who moves with it.
    pub children: Vec<usize>,
    /// The mesh that stands here.
    pub mesh: Option<usize>,
    /// The skin that pulls the mesh.
    pub skin: Option<usize>,
    /// Strengths of the morph targets here, where they are not those of the mesh.
    pub morph_weights: Option<Vec<f32>>,
}

/// A mesh where it is to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// The node.
    pub node: usize,
    /// The mesh.
    pub mesh: usize,
    /// From the coordinates of the mesh to those of the model. A skinned mesh does not heed it: its joints place it.
    pub world_from_mesh: DMat4,
}

impl Model {
    /// A model of one mesh, with a plain material.
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

    /// The same with other meshes in the places of its own, in their order: lighter ones, say. Nodes, materials, skins and
    /// animations stay, so the meshes must have the regions, joints and morph targets of those before them.
    ///
    /// # Panics
    /// If there is not one for each mesh.
    #[must_use]
    pub fn with_meshes(&self, meshes: Vec<Arc<TriMesh>>) -> Self {
        assert_eq!(meshes.len(), self.meshes.len(), "one mesh for each place");
        let meshes = self.meshes.iter().zip(meshes).map(|(old, mesh)| ModelMesh { mesh, ..old.clone() });
        Self { meshes: meshes.collect(), ..self.clone() }
    }

    /// Whether a material is more metal than not: it mirrors what is around it, and shows little else.
    pub fn has_metal(&self) -> bool {
        self.materials.iter().any(|m| m.metallic > 0.5)
    }

    /// Every mesh that is placed, in the order in which the nodes are reached from the roots.
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

    /// From the coordinates of each node to those of the model; of nodes that no root reaches, as if they were roots.
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

    /// Triangles as they are drawn: those of a mesh as often as nodes place it.
    pub fn face_count(&self) -> usize {
        self.instances(&Pose::default()).iter().map(|i| self.meshes[i.mesh].mesh.face_count()).sum()
    }
}
