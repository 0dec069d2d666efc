//! Conversion of a scene to a model for display: nodes, materials with their images, skins and animations.

mod appearance;
mod motion;

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use lodsmith_core::model::{Material, ModelMesh, Node, Transform, VertexColors};
use lodsmith_core::{Model, TriMesh};
use serde_json::Value;

use super::buffers::Buffers;
use super::container::{list, number};
use super::instances::{self, Copies};
use super::mesh::Budget;
use super::placements::{PlacedNodes, numbers, roots};
use super::scene::Scene;
use crate::assets::MAX_IMAGE_BYTES;
use crate::error::{ReadError, Warning};
use crate::model::BaseColor;

impl Scene {
    /// Returns the scene as a model, and warnings on what cannot be shown.
    ///
    /// Meshes are shared with [`Scene::meshes`]. The nodes are the nodes of the file below the roots of the default
    /// scene; instances of `EXT_mesh_gpu_instancing` are further nodes, and so are all meshes if no node refers to one.
    /// Hidden nodes have no mesh. Images that materials use are decoded; separate files are read as far as
    /// [`ReadOptions::assets`](crate::ReadOptions::assets) allows. Extensions other than `KHR_materials_unlit`,
    /// `KHR_materials_emissive_strength`, `KHR_texture_transform`, `EXT_texture_webp` and the older
    /// `KHR_materials_pbrSpecularGlossiness` (without its highlights) are ignored. Cost: O(nodes + pixels + keyframes).
    pub fn model(&self) -> (Model, Vec<Warning>) {
        let buffers = Buffers::loaded(&self.json, &self.buffers, self.unpacked);
        let json = &self.json;
        let (materials, images, mut warnings) = appearance::read(self, &buffers);
        let mut budget = Budget::new(buffers.total());
        let skins = motion::skins(json, &buffers, &mut budget, &mut warnings);
        let mut model = self.placed_meshes(&buffers, materials, &skins, &mut budget, &mut warnings);
        let animations =
            motion::animations(json, &buffers, &model.nodes, &model.meshes, &mut budget, &mut warnings);
        (model.images, model.skins, model.animations) = (images, skins.all, animations);
        (model, warnings)
    }

    /// Returns the scene with some meshes replaced, as a model at rest without skins, animations and images: textures have
    /// the index of their image in the file, for [`Scene::encoded_image`]. See [`Model::without_skins`].
    pub(crate) fn encoded_model(&self, replaced: &[Option<TriMesh>]) -> (Model, Vec<Warning>) {
        let buffers = Buffers::loaded(&self.json, &self.buffers, self.unpacked);
        let (mut budget, mut warnings) = (Budget::new(buffers.total()), Vec::new());
        let materials = appearance::encoded(self);
        let skins = motion::skins(&self.json, &buffers, &mut budget, &mut warnings);
        let mut model = self.placed_meshes(&buffers, materials, &skins, &mut budget, &mut warnings);
        model.skins = skins.all;
        if self.kept().is_some() {
            // Hidden nodes are what a slicer does not print: they are written as such.
            for (node, v) in model.nodes.iter_mut().zip(list(&self.json, "nodes")) {
                node.mesh = node.mesh.or(number(&v["mesh"]).filter(|&m| m < model.meshes.len()));
            }
        }
        for (mesh, other) in model.meshes.iter_mut().zip(replaced) {
            other.iter().for_each(|other| mesh.mesh = Arc::new(other.clone()));
        }
        let mut rest = model.without_skins();
        // A mesh without a name is named by its number, which the meshes at rest do not have.
        let made = rest.meshes.iter_mut().skip(model.meshes.len());
        made.filter(|m| m.name.starts_with("meshes[")).for_each(|m| m.name.clear());
        (rest, warnings)
    }

    /// Returns the limit on the bytes of all images together, for [`Scene::encoded_image`].
    pub(crate) fn image_bytes_limit(&self) -> u64 {
        // Guessed: a quarter of the memory leaves room for the meshes and the output.
        MAX_IMAGE_BYTES.min(self.limits.max_bytes()).min(self.limits.memory / 4)
    }

    /// Returns the bytes of an image of the file, and subtracts them from the bytes left for all images.
    ///
    /// # Errors
    /// The end of a sentence that begins with its name.
    pub(crate) fn encoded_image(&self, index: usize, left: &mut u64) -> Result<Vec<u8>, String> {
        let buffers = Buffers::loaded(&self.json, &self.buffers, self.unpacked);
        let bytes = appearance::bytes_of(self, &buffers, index)?;
        *left = left.checked_sub(bytes.len() as u64).ok_or("is above the limit on all images together")?;
        Ok(bytes.into_owned())
    }

    /// Returns a model of the meshes and nodes.
    fn placed_meshes(
        &self,
        buffers: &Buffers<'_>,
        materials: Vec<Material>,
        skins: &motion::Skins,
        budget: &mut Budget,
        warnings: &mut Vec<Warning>,
    ) -> Model {
        let json = &self.json;
        let meshes: Vec<ModelMesh> = self
            .meshes()
            .iter()
            .zip(list(json, "meshes"))
            .map(|(m, v)| mesh(m, v, materials.len()))
            .collect();
        let mut nodes: Vec<Node> = list(json, "nodes").iter().map(|v| node(v, skins, meshes.len())).collect();
        let node_count = nodes.len();
        for node in &mut nodes {
            node.children.retain(|&c| c < node_count);
        }
        // Roots and nodes were checked when the scene was read.
        let mut roots = roots(json).unwrap_or_default();
        let placed = PlacedNodes::new(json).map_or_else(|_| Vec::new(), |nodes| nodes.placements);
        for node in placed.iter().filter(|p| p.is_hidden).filter_map(|p| p.node) {
            (nodes[node].mesh, nodes[node].skin) = (None, None);
        }
        for i in 0..node_count {
            match copies(json, buffers, i, budget) {
                Ok(None) => {}
                Ok(Some(places)) => {
                    let (mesh, skin) = (nodes[i].mesh.take(), nodes[i].skin.take());
                    for transform in places {
                        let copy = nodes.len();
                        nodes[i].children.push(copy);
                        nodes.push(Node { transform, mesh, skin, ..Node::default() });
                    }
                }
                Err(e) => {
                    warnings.push(Warning::note(format!("the copies of nodes[{i}] are not shown: {e}")))
                }
            }
        }
        if placed.is_empty() {
            for mesh in 0..meshes.len() {
                roots.push(nodes.len());
                nodes.push(Node { mesh: Some(mesh), ..Node::default() });
            }
        }
        let vertex_colors = VertexColors::Linear;
        Model { meshes, nodes, roots, materials, vertex_colors, ..Model::default() }
    }

    /// Returns the base colour images for each of [`Scene::meshes`] and each of its regions (one, if it has
    /// none), and the mapping of texture coordinates to them.
    ///
    /// Only base colours are decoded. Images that cannot be decoded are left out; so are images that exceed what the
    /// reading limits leave for them (an eighth of the memory), with a warning. Cost: O(pixels).
    pub fn base_colors(&self) -> (Vec<Vec<Option<BaseColor>>>, Vec<Warning>) {
        let buffers = Buffers::loaded(&self.json, &self.buffers, self.unpacked);
        let (of_materials, images, warnings) = appearance::base_colors(self, &buffers);
        let base_color = |m: &usize| of_materials[*m].map(|texture| (images[texture.image].clone(), texture));
        let meshes = self.meshes().iter().zip(list(&self.json, "meshes"));
        let of_mesh = |m: ModelMesh| m.materials.iter().map(|m| base_color(m.as_ref()?)).collect();
        (meshes.map(|(m, v)| of_mesh(mesh(m, v, of_materials.len()))).collect(), warnings)
    }
}

/// Returns a mesh with a material for each of its primitives.
fn mesh(of: &super::SceneMesh, json: &Value, materials: usize) -> ModelMesh {
    let primitives = list(json, "primitives");
    let material = |p: &Value| number(&p["material"]).filter(|&m| m < materials);
    let mut of_regions: Vec<_> = primitives.iter().map(material).collect();
    if of_regions.is_empty() {
        of_regions.push(None);
    }
    let targets = primitives.iter().map(|p| list(p, "targets").len()).max().unwrap_or(0);
    let mut morph_weights = strengths(&json["weights"]).unwrap_or_default();
    morph_weights.resize(targets, 0.0);
    ModelMesh { name: of.name.clone(), mesh: of.mesh.clone(), materials: of_regions, morph_weights }
}

fn strengths(list: &Value) -> Option<Vec<f32>> {
    let finite = |v: &Value| v.as_f64().map(|x| x as f32).filter(|x| x.is_finite()).unwrap_or(0.0);
    list.as_array().map(|all| all.iter().map(finite).collect())
}

fn node(json: &Value, skins: &motion::Skins, meshes: usize) -> Node {
    Node {
        name: json["name"].as_str().unwrap_or_default().to_owned(),
        transform: transform(json),
        children: list(json, "children").iter().filter_map(number).collect(),
        mesh: number(&json["mesh"]).filter(|&m| m < meshes),
        skin: number(&json["skin"]).and_then(|s| skins.number(s)),
        morph_weights: strengths(&json["weights"]),
    }
}

/// Returns the transform of a node. Nodes of the scene have been checked; on others, invalid parts are the
/// identity.
fn transform(json: &Value) -> Transform {
    if let Ok(Some(columns)) = numbers::<16>(json, "matrix", "") {
        return Transform::Matrix(DMat4::from_cols_array(&columns));
    }
    let three = |what, otherwise| numbers::<3>(json, what, "").ok().flatten().map_or(otherwise, DVec3::from);
    let rotation = numbers::<4>(json, "rotation", "").ok().flatten();
    Transform::Parts {
        translation: three("translation", DVec3::ZERO),
        rotation: rotation.map_or(DQuat::IDENTITY, unit),
        scale: three("scale", DVec3::ONE),
    }
}

/// Normalizes a rotation; zero becomes the identity.
fn unit(q: [f64; 4]) -> DQuat {
    let q = DQuat::from_array(q);
    let length = q.length();
    if length > 0.0 && length.is_finite() { q / length } else { DQuat::IDENTITY }
}

/// Returns the transforms of a node's mesh instances, relative to the node; `None` for a node without
/// instancing.
fn copies(
    json: &Value,
    buffers: &Buffers<'_>,
    node: usize,
    budget: &mut Budget,
) -> Result<Option<Vec<Transform>>, ReadError> {
    let Some(accessors) = instances::accessors(&json["nodes"][node])? else { return Ok(None) };
    let copies = Copies::read(json, buffers, accessors, budget)?;
    // A node takes more memory than the ten numbers of its transform.
    budget.numbers.take(64 * copies.count as u64)?;
    let place = |i: usize| {
        let (translation, rotation, scale) = copies.parts(i);
        let (translation, scale) = (DVec3::from(translation), DVec3::from(scale));
        Transform::Parts { translation, rotation: unit(rotation), scale }
    };
    Ok(Some((0..copies.count).map(place).collect()))
}
