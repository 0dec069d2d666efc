//! The objects of components and the build items, made from the nodes of a model.

use std::collections::{BTreeMap, HashMap};

use glam::{DMat3, DMat4, DVec3};
use lodsmith_core::Model;
use lodsmith_core::model::{Node, Transform};
use serde_json::Value;

use super::build::{BUILD_NODE, MAX_DEPTH};
use super::kept::END_OF_NUMBERS;
use super::model::OTHER_TYPES;
use super::resources::ItemMark;
use crate::frame::{Frame, Unit};

/// Axes whose volume is smaller than this share of the product of their lengths are nearly coplanar. Guessed: rounding of
/// single precision is smaller.
const MIN_VOLUME: f64 = 1e-6;

/// An object of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum ObjectRef {
    /// A mesh of the model.
    Mesh(usize),
    /// An entry of [`Assemblies::all`].
    Assembly(usize),
}

/// A placed object: an item of the build, or a component.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ObjectPlace {
    pub(super) object: ObjectRef,
    pub(super) transform: DMat4,
    /// Marks of an item.
    pub(super) marks: Vec<ItemMark>,
    /// The number of the volume, if the object is a volume of the one that has it as a component.
    volume: Option<usize>,
}

/// Properties of an object in the 3MF file that was read.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct ObjectFacts {
    /// Its type, if that is not `model`.
    pub(super) kind: Option<&'static str>,
    /// Its number in a file with settings that refer to it.
    pub(super) id: Option<u32>,
}

impl ObjectFacts {
    fn new(of_node: &Value, keeps_ids: bool) -> Self {
        let id = of_node["object"].as_u64().filter(|_| keeps_ids).and_then(|id| u32::try_from(id).ok());
        let id = id.filter(|id| *id < END_OF_NUMBERS);
        Self { kind: OTHER_TYPES.into_iter().find(|kind| of_node["type"] == *kind), id }
    }
}

/// An object of components.
#[derive(Debug, PartialEq)]
pub(super) struct Assembly {
    pub(super) name: String,
    pub(super) facts: ObjectFacts,
    pub(super) components: Vec<ObjectPlace>,
}

/// Objects of a file and their places.
#[derive(Debug)]
pub(super) struct Assemblies {
    pub(super) unit: Unit,
    /// Objects of components; each places only meshes and earlier objects.
    pub(super) all: Vec<Assembly>,
    pub(super) items: Vec<ObjectPlace>,
    /// True if all items are scaled or rotated.
    pub(super) is_moved: bool,
    /// Facts of objects that are meshes.
    pub(super) of_meshes: BTreeMap<usize, ObjectFacts>,
    /// Volumes of objects, by the mesh of the first one: numbers and meshes.
    pub(super) volumes: BTreeMap<usize, Vec<(usize, usize)>>,
    /// True if settings of a slicer may name objects by their numbers: these are the numbers of the file that was read.
    pub(super) has_known_ids: bool,
    /// Placed meshes, each with the node that places it if that has no children.
    places: Vec<(usize, Option<usize>)>,
    /// Number of nodes that were left out because they flatten what they place.
    pub(super) flattened: usize,
}

/// An object and the bits of its transform.
type PlaceBits = (ObjectRef, [u64; 16]);

/// A node of the model that becomes an object, or the place of one.
struct PlacedNode {
    /// The index of the node that has it as a child, among the placed nodes; `None` for an item.
    parent: Option<usize>,
    node: usize,
    transform: DMat4,
}

impl Assemblies {
    /// Takes one mesh in these coordinates.
    pub(super) fn of_mesh(frame: Frame) -> Self {
        let transform = if frame.z_up { DMat4::IDENTITY } else { z_up_from_gltf() };
        let item = ObjectPlace { object: ObjectRef::Mesh(0), transform, marks: Vec::new(), volume: None };
        Self { items: vec![item], ..Self::empty(frame.unit) }
    }

    fn empty(unit: Unit) -> Self {
        Self {
            unit,
            all: Vec::new(),
            items: Vec::new(),
            is_moved: false,
            of_meshes: BTreeMap::new(),
            volumes: BTreeMap::new(),
            has_known_ids: false,
            places: Vec::new(),
            flattened: 0,
        }
    }

    /// Takes the nodes of a model in the coordinates of glTF. A node with only a mesh places the object of that mesh, a
    /// node with children becomes an object of components; equal nodes share an object. Meshes without faces are left
    /// out. `of_node`: what 3MF says of a node; `is_project`: true if settings of a slicer are kept, which name objects;
    /// `moved`: a transform of all items, in the coordinates of the file.
    pub(super) fn new<'a>(
        model: &Model,
        has_faces: impl Fn(usize) -> bool,
        of_node: impl Fn(usize) -> &'a Value,
        is_project: bool,
        moved: DMat4,
    ) -> Self {
        let (unit, roots, first) = match build_of(model) {
            Some((unit, build)) => (unit, &model.nodes[build].children, moved),
            None => (Unit::Meter, &model.roots, moved * z_up_from_gltf()),
        };
        let is_moved = moved != DMat4::IDENTITY;
        let mut new = Self { has_known_ids: is_project, is_moved, ..Self::empty(unit) };
        // Volumes are no components.
        let is_volume = |node: usize| is_project && !of_node(node)["volume"].is_null();
        let placed = new.placed_nodes(&model.nodes, roots, first, is_volume);
        let mut parts: Vec<Vec<ObjectPlace>> = placed.iter().map(|_| Vec::new()).collect();
        let mut known: HashMap<(String, ObjectFacts, Vec<PlaceBits>), usize> = HashMap::new();
        // Children follow their parents, so all components of a node are known when it is reached.
        for (at, PlacedNode { parent, node: index, transform }) in placed.iter().enumerate().rev() {
            let node = &model.nodes[*index];
            let mut components = std::mem::take(&mut parts[at]);
            let mesh = node.mesh.filter(|&m| has_faces(m));
            new.places.extend(mesh.map(|mesh| (mesh, components.is_empty().then_some(*index))));
            let said = of_node(*index);
            let facts = ObjectFacts::new(said, is_project);
            new.has_known_ids &= facts.id.is_some() || said["object"].is_null();
            let volume = |c: &ObjectPlace| match c.object {
                ObjectRef::Mesh(mesh) if c.transform == DMat4::IDENTITY => Some((c.volume?, mesh)),
                _ => None,
            };
            let volumes: Option<Vec<(usize, usize)>> = components.iter().rev().map(volume).collect();
            let volumes = volumes.filter(|_| is_project && mesh.is_none());
            let object = if let Some(mesh) = mesh.filter(|_| components.is_empty()) {
                new.of_meshes.entry(mesh).or_insert(facts);
                Some(ObjectRef::Mesh(mesh))
            } else if components.is_empty() {
                None
            } else if let Some(volumes) = volumes {
                let first = volumes[0].1;
                new.of_meshes.insert(first, facts);
                new.volumes.insert(first, volumes);
                Some(ObjectRef::Mesh(first))
            } else {
                let own = mesh.map(ObjectRef::Mesh);
                let (transform, marks, volume) = (DMat4::IDENTITY, Vec::new(), None);
                components.extend(own.map(|object| ObjectPlace { object, transform, marks, volume }));
                components.reverse();
                let bits = |p: &ObjectPlace| (p.object, p.transform.to_cols_array().map(f64::to_bits));
                let key = (node.name.clone(), facts.clone(), components.iter().map(bits).collect());
                let assembly = *known.entry(key).or_insert_with(|| {
                    new.all.push(Assembly { name: node.name.clone(), facts, components });
                    new.all.len() - 1
                });
                Some(ObjectRef::Assembly(assembly))
            };
            let marks = ItemMark::ALL.into_iter().filter(|mark| said[mark.name()] == false).collect();
            let volume = said["volume"].as_u64().map(|at| at as usize);
            let place = object.map(|object| ObjectPlace { object, transform: *transform, marks, volume });
            match parent {
                Some(parent) => parts[*parent].extend(place),
                None => new.items.extend(place),
            }
        }
        new.items.reverse();
        new.places.reverse();
        new.check_ids();
        new
    }

    /// Forgets the numbers of objects if two of them have the same one, or one of them is too large.
    fn check_ids(&mut self) {
        let mut ids: Vec<u32> = self.ids().collect();
        ids.sort_unstable();
        if !self.has_known_ids || ids.windows(2).any(|two| two[0] == two[1]) {
            self.has_known_ids = false;
            self.of_meshes
                .values_mut()
                .chain(self.all.iter_mut().map(|a| &mut a.facts))
                .for_each(|f| f.id = None);
        }
    }

    /// Returns the known numbers of objects.
    pub(super) fn ids(&self) -> impl Iterator<Item = u32> {
        self.of_meshes.values().chain(self.all.iter().map(|a| &a.facts)).filter_map(|facts| facts.id)
    }

    /// Returns the mesh of each place.
    pub(super) fn meshes(&self) -> impl Iterator<Item = usize> {
        self.places.iter().map(|(mesh, _)| *mesh)
    }

    /// Returns the placed meshes with names for their objects: the name of the only node that places the mesh, else of
    /// the mesh, else of the first node. Also returns the number of meshes for which other names are left out.
    pub(super) fn names(&self, model: &Model) -> (BTreeMap<usize, String>, usize) {
        let mut nodes: BTreeMap<usize, Vec<&str>> = BTreeMap::new();
        for &(mesh, node) in &self.places {
            nodes.entry(mesh).or_default().push(node.map_or("", |node| &model.nodes[node].name));
        }
        let mut left_out = 0;
        let name_of = |(mesh, names): (usize, Vec<&str>)| {
            let own = Some(&*model.meshes[mesh].name).filter(|name| *name != format!("meshes[{mesh}]"));
            let given = names.iter().copied().filter(|name| !name.is_empty());
            let first = given.clone().next();
            let name = if names.len() == 1 { first.or(own) } else { own.or(first) }.unwrap_or_default();
            left_out += usize::from(given.chain(own).any(|other| other != name));
            (mesh, name.to_owned())
        };
        (nodes.into_iter().map(name_of).collect(), left_out)
    }

    /// Returns the nodes that place something, parents before their children. Nodes deeper than a reader takes, but for
    /// volumes, become components of the object above.
    fn placed_nodes(
        &mut self,
        nodes: &[Node],
        roots: &[usize],
        first: DMat4,
        is_volume: impl Fn(usize) -> bool,
    ) -> Vec<PlacedNode> {
        let mut placed: Vec<PlacedNode> = Vec::new();
        let mut open: Vec<(usize, Option<usize>, DMat4, usize)> =
            roots.iter().rev().map(|&root| (root, None, first, 0)).collect();
        while let Some((node, parent, above, depth)) = open.pop() {
            let transform = above * nodes[node].transform.matrix();
            if is_flat(&transform) {
                self.flattened += 1;
                continue;
            }
            placed.push(PlacedNode { parent, node, transform });
            let own = placed.len() - 1;
            for &child in nodes[node].children.iter().rev() {
                let (parent, above) = if depth + 1 < MAX_DEPTH || is_volume(child) {
                    (Some(own), DMat4::IDENTITY)
                } else {
                    (parent, transform)
                };
                open.push((child, parent, above, depth + 1));
            }
        }
        placed
    }
}

/// Returns the node that the reader puts above the items of a build, and the unit of the file.
fn build_of(model: &Model) -> Option<(Unit, usize)> {
    let &[root] = model.roots.as_slice() else { return None };
    let node = model.nodes.get(root).filter(|node| node.name == BUILD_NODE && node.mesh.is_none())?;
    let Transform::Parts { translation: DVec3::ZERO, rotation, scale } = node.transform else { return None };
    let unit = Unit::ALL.into_iter().find(|unit| scale == DVec3::splat(unit.meters()))?;
    let wanted = Frame::new(unit, true).rotation_to_gltf()?;
    let is_equal = rotation.to_array().iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9);
    is_equal.then_some((unit, root))
}

/// Returns the rotation from y up to z up.
fn z_up_from_gltf() -> DMat4 {
    DMat4::from_mat3(DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y))
}

/// Returns true if a matrix has no inverse, or nearly none. (3MF advises against such matrices.)
fn is_flat(matrix: &DMat4) -> bool {
    let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|a| a.truncate());
    let size: f64 = axes.iter().map(|a| a.length()).product();
    let volume = axes[0].cross(axes[1]).dot(axes[2]).abs();
    !(matrix.is_finite() && size > 0.0 && volume > size * MIN_VOLUME)
}
