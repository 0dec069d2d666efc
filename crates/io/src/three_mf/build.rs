//! Construction of a scene from the parts of a file.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::Arc;

use glam::{DMat4, DVec3};
use lodsmith_core::numbers::counted;
use serde_json::{Value, json};

use super::kept::{END_OF_NUMBERS, OF_THREE_MF, name_of};
use super::marks::{ExactPaint, MAX_MEMBERSHIPS, Marks};
use super::model::parse;
use super::package::Package;
use super::resources::{Group, ItemMark, Object, PaintOfTriangle, Part, PlacedObject, TriangleSet};
use super::settings::{ObjectVolumes, Settings, Volume};
use crate::attributes::{linear_colors, linear_of_srgb};
use crate::error::{ReadError, Warning};
use crate::excerpt::excerpt;
use crate::format::Format;
use crate::frame::Frame;
use crate::gltf::{BuiltScene, MeshParts, SceneBuilder, matrix_of_node};
use crate::lines::utf8_of;
use crate::material::image_type;
use crate::options::ReadOptions;

/// The coordinates of the result.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Coordinates {
    /// The coordinates of the file.
    File,
    /// Metres, y up: nodes of the scene convert them.
    Gltf,
}

/// The name of the node above the items of a build, which has their unit and axes.
pub(super) const BUILD_NODE: &str = "3MF build";

/// Limits on the nodes that components create: each may place any other object several times. Guessed: more than any
/// file has, and within memory.
const ALWAYS_ALLOWED_NODES: usize = 1 << 16;
const MAX_NODES: usize = 1 << 21;
pub(super) const MAX_DEPTH: usize = 256;
/// Number of bytes of XML that allow one more node.
const BYTES_PER_NODE: usize = 16;

const LOST_SETS: &str = "sets of triangles are too many, or name triangles that are not there: dropped";

/// Numbers of parts by their names.
type PartNumbers = HashMap<String, usize>;

/// A part and the number of an object, a group or a texture in it.
type Id = (usize, u32);

/// The role of a volume of an object if it is not solid, and its mesh if it has triangles.
type PlacedVolume = (Option<&'static str>, Option<usize>);

/// Reads a file; returns its scene, and the coordinates of the file.
pub(super) fn build(
    bytes: &[u8],
    options: &ReadOptions,
    coordinates: Coordinates,
) -> Result<(BuiltScene, Frame), ReadError> {
    let mut package = Package::open(bytes, options.limits)?;
    let (parts, paths) = read_parts(&mut package)?;
    // The parsed meshes, and the meshes of the scene with their wedges, besides the XML.
    let unpacked = package.unpacked;
    options
        .limits
        .check_memory("reading 3MF", unpacked.saturating_mul(3).saturating_add(bytes.len() as u64))?;
    let mut scene = SceneBuilder::new(Format::ThreeMf);
    let settings = package.settings(&mut |warning| scene.warn(warning));
    let nodes = ALWAYS_ALLOWED_NODES.saturating_add(unpacked as usize / BYTES_PER_NODE).min(MAX_NODES);
    let mut builder = ThreeMfScene {
        scene,
        new_numbers: new_numbers(&parts),
        settings,
        paint: BTreeMap::new(),
        placed: BTreeSet::new(),
        package,
        parts,
        paths,
        meshes: HashMap::new(),
        volumes: HashMap::new(),
        materials: HashMap::new(),
        textures: HashMap::new(),
        open: Vec::new(),
        next_parts: Vec::new(),
        part_numbers: BTreeMap::new(),
        nodes,
    };
    let frame = Frame::new(builder.parts[0].unit(), true);
    let roots = builder.roots(coordinates)?;
    builder.warn();
    let mut kept = builder
        .package
        .kept_contents(builder.settings.is_damaged, &mut |warning| builder.scene.warn(warning));
    kept.namespaces.clone_from(&builder.parts[0].namespaces);
    kept.paint = builder.paint;
    kept.objects = builder.placed;
    kept.part_numbers = builder.part_numbers;
    let mut built = builder.scene.finish(&roots);
    built.kept = Some(Arc::new(kept));
    Ok((built, frame))
}

/// Returns numbers for objects whose own number an object of an earlier part has: all are in one part when they are
/// written again.
fn new_numbers(parts: &[Arc<Part>]) -> HashMap<Id, u32> {
    let of_part =
        |(at, part): (usize, &Arc<Part>)| part.objects.keys().map(|&id| (at, id)).collect::<Vec<_>>();
    let all: Vec<Id> = parts.iter().enumerate().flat_map(of_part).collect();
    let mut last = all.iter().map(|(_, id)| *id).filter(|id| *id < END_OF_NUMBERS).max().unwrap_or(0);
    let mut taken = HashSet::new();
    let repeated = all.into_iter().filter(|(_, id)| !taken.insert(*id));
    let numbered = repeated.map(|id| {
        last += 1;
        (id, last)
    });
    numbered.collect()
}

/// Reads the first model, and the other parts that it refers to.
fn read_parts(package: &mut Package<'_>) -> Result<(Vec<Arc<Part>>, PartNumbers), ReadError> {
    let first = package.first_model()?;
    let (mut parts, mut paths, mut open) = (Vec::new(), HashMap::new(), vec![first]);
    while let Some(path) = open.pop() {
        let path = name_of(&path);
        if paths.contains_key(&path) {
            continue;
        }
        let Some(bytes) = package.part(&path)? else {
            return Err(ReadError::element(excerpt(&path), "the ZIP archive has no such part"));
        };
        let part = parse(&path, &utf8_of(&bytes))?;
        let components = part.objects.values().flat_map(|o| &o.components).chain(&part.items);
        open.extend(components.filter_map(|c| c.path.clone()));
        paths.insert(path, parts.len());
        parts.push(Arc::new(part));
    }
    Ok((parts, paths))
}

struct ThreeMfScene<'a> {
    scene: SceneBuilder,
    settings: Settings,
    /// See [`KeptContents::paint`](super::kept::KeptContents::paint).
    paint: BTreeMap<usize, Vec<ExactPaint>>,
    /// Numbers of the placed objects of the first part.
    placed: BTreeSet<u32>,
    package: Package<'a>,
    /// The parts; the first one has the build.
    parts: Vec<Arc<Part>>,
    paths: HashMap<String, usize>,
    /// Meshes of objects; `None` for those without triangles.
    meshes: HashMap<Id, Option<usize>>,
    /// Volumes of objects of the first part; `None` for those that are one solid.
    volumes: HashMap<u32, Option<Arc<[PlacedVolume]>>>,
    /// Materials by group, and by entry for groups that have a material for each.
    materials: HashMap<(Id, Option<u32>), Option<usize>>,
    textures: HashMap<Id, Option<usize>>,
    /// The objects that contain the object that is being placed; the first is the object of an item.
    open: Vec<Id>,
    /// Numbers of objects that need another one than their own.
    new_numbers: HashMap<Id, u32>,
    /// If settings name parts of the object of this item: for each depth, the place of the next object without components
    /// in the list of all.
    next_parts: Vec<usize>,
    /// See [`KeptContents::part_numbers`](super::kept::KeptContents::part_numbers).
    part_numbers: BTreeMap<(u32, usize), u32>,
    /// Number of nodes that may still be created.
    nodes: usize,
}

impl ThreeMfScene<'_> {
    fn roots(&mut self, coordinates: Coordinates) -> Result<Vec<usize>, ReadError> {
        let first = self.parts[0].clone();
        let mut roots = Vec::new();
        for item in &first.items {
            roots.push(self.place(0, item)?);
        }
        if first.items.is_empty() {
            let used: HashSet<u32> =
                first.objects.values().flat_map(|o| &o.components).map(|c| c.object).collect();
            for &object in first.objects.keys().filter(|id| !used.contains(id)) {
                roots.push(self.place(0, &PlacedObject { object, ..PlacedObject::default() })?);
            }
            if !roots.is_empty() {
                self.scene.warn(Warning::note("the build has no items: all objects are placed"));
            }
        }
        if coordinates == Coordinates::File || roots.is_empty() {
            return Ok(roots);
        }
        for (name, value) in first.metadata.iter().filter(|(_, value)| !value.is_empty()) {
            self.scene.set_extra(name, value);
        }
        let frame = Frame::new(first.unit(), true);
        let root = json!({
            "name": BUILD_NODE,
            "rotation": frame.rotation_to_gltf(),
            "scale": ([frame.unit.meters(); 3]),
            "children": roots,
        });
        Ok(vec![self.scene.add("nodes", root)])
    }

    /// Returns the part of a placed object.
    fn part_of(&self, from: usize, place: &PlacedObject) -> usize {
        place.path.as_ref().and_then(|path| self.paths.get(&name_of(path)).copied()).unwrap_or(from)
    }

    /// Adds a node for an object at a place, with all below it; returns its index.
    fn place(&mut self, from: usize, place: &PlacedObject) -> Result<usize, ReadError> {
        let part = self.part_of(from, place);
        let (id, owner) = ((part, place.object), self.parts[part].clone());
        let name = || format!("object {}", place.object);
        let Some(object) = owner.objects.get(&place.object) else {
            return Err(ReadError::element(name(), "it is placed, but not in the file"));
        };
        if self.open.contains(&id) {
            return Err(ReadError::element(name(), "it contains itself"));
        }
        if self.open.len() >= MAX_DEPTH {
            return Err(ReadError::element(
                name(),
                format!("components are nested more than {MAX_DEPTH} deep"),
            ));
        }
        self.take_node(&name())?;
        let mut node = json!({});
        if !object.name.is_empty() {
            node["name"] = object.name.as_str().into();
        }
        // Another part may have another unit.
        let scale = owner.unit().meters() / self.parts[from].unit().meters();
        if let Some(matrix) = matrix_of_node(matrix(place, scale), &mut self.scene) {
            node["matrix"] = matrix;
        }
        if self.open.is_empty() {
            self.next_parts = self.first_parts(id);
        }
        let said = if object.components.is_empty() { self.next_part(id) } else { None };
        if part == 0 && !(object.triangles.is_empty() && object.components.is_empty()) {
            self.placed.insert(place.object);
        }
        if self.settings.is_present {
            node["extras"][OF_THREE_MF]["object"] = self.number(id).into();
        }
        for mark in ItemMark::ALL.into_iter().filter(|mark| place.marks.contains(mark)) {
            node["extras"][OF_THREE_MF][mark.name()] = false.into();
        }
        if let Some(kind) = object.kind {
            node["extras"][OF_THREE_MF]["type"] = kind.into();
        }
        // A slicer that names the part decides what it is: several parts may share an object, which has one type.
        let is_hidden = said.is_none() && object.kind.is_some_and(|kind| kind != "surface");
        self.set_role(&mut node, said.flatten(), is_hidden);
        let mut children = Vec::new();
        if let Some(volumes) = self.volumes(id, object)? {
            for (at, &(role, mesh)) in volumes.iter().enumerate() {
                self.take_node(&name())?;
                let mut child = json!({ "extras": { OF_THREE_MF: { "volume": at } } });
                self.set_role(&mut child, role, false);
                if let Some(mesh) = mesh {
                    child["mesh"] = mesh.into();
                }
                children.push(self.scene.add("nodes", child));
            }
        } else if let Some(mesh) = self.mesh(id, object)? {
            node["mesh"] = mesh.into();
        }
        let node = self.scene.add("nodes", node);
        self.open.push(id);
        for component in &object.components {
            children.push(self.place(part, component)?);
        }
        self.open.pop();
        if !children.is_empty() {
            self.scene.entry("nodes", node)["children"] = children.into();
        }
        Ok(node)
    }

    /// Returns the number of an object in a file of one part.
    fn number(&self, id: Id) -> u32 {
        self.new_numbers.get(&id).copied().unwrap_or(id.1)
    }

    /// Returns, for each depth below the object of an item, the number of objects without components that are less deep;
    /// nothing if settings do not name its parts. BambuStudio lists the parts in this order, by depth (source: the file of
    /// the importer in [`marks`](super::marks), `_generate_current_object_list`).
    fn first_parts(&self, item: Id) -> Vec<usize> {
        let (mut firsts, mut first) = (Vec::new(), 0);
        // More nodes than these are refused.
        let mut left = self.nodes;
        let mut level: BTreeMap<Id, usize> = BTreeMap::new();
        if item.0 == 0 && self.settings.names_parts_of(item.1) {
            level.insert(item, 1);
        }
        while !level.is_empty() && firsts.len() < MAX_DEPTH {
            firsts.push(first);
            let mut below = BTreeMap::new();
            for ((part, id), count) in level {
                let Some(object) = self.parts[part].objects.get(&id) else { continue };
                let Some(less) = left.checked_sub(count.saturating_mul(object.components.len())) else {
                    return firsts;
                };
                left = less;
                first += if object.components.is_empty() { count } else { 0 };
                for component in &object.components {
                    *below.entry((self.part_of(part, component), component.object)).or_insert(0) += count;
                }
            }
            level = below;
        }
        firsts
    }

    /// Returns what settings say of the next object without components: `None` if nothing, else what it is if not solid.
    fn next_part(&mut self, id: Id) -> Option<Option<&'static str>> {
        let next = self.next_parts.get_mut(self.open.len())?;
        *next += 1;
        let (_, item) = *self.open.first().unwrap_or(&id);
        let (at, role) = self.settings.part(item, *next - 1, id.1)?;
        let number = self.number(id);
        if *self.part_numbers.entry((item, at)).or_insert(number) != number {
            self.scene.warn(Warning::lost(format!(
                "settings of one part of object {item} are those of several objects: only one has them"
            )));
        }
        Some(role)
    }

    /// Counts a further node.
    fn take_node(&mut self, element: &str) -> Result<(), ReadError> {
        let problem = "components place more objects than allowed for a file of this size";
        self.nodes = self.nodes.checked_sub(1).ok_or_else(|| ReadError::element(element, problem))?;
        Ok(())
    }

    /// Sets what a slicer does with the content of a node, and hides what is not a part of the printed shape.
    fn set_role(&mut self, node: &mut Value, role: Option<&str>, is_hidden: bool) {
        if let Some(role) = role {
            node["extras"][OF_THREE_MF]["role"] = role.into();
        }
        if role.is_some() || is_hidden {
            node["extensions"]["KHR_node_visibility"] = json!({ "visible": false });
            self.scene.uses("KHR_node_visibility");
        }
    }

    fn check_triangles(&self, id: Id, object: &Object) -> Result<(), ReadError> {
        let count = object.vertices.len();
        if let Some(at) = object.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= count)) {
            let element = format!("object {}, triangle {at}", id.1);
            return Err(ReadError::element(
                element,
                format!("it refers to a vertex beyond the {count} of the object"),
            ));
        }
        Ok(())
    }

    /// Returns the volumes of an object, or `None` if it is one solid; they are made once for all places of it.
    fn volumes(&mut self, id: Id, object: &Object) -> Result<Option<Arc<[PlacedVolume]>>, ReadError> {
        // Settings name the objects of the first part.
        if id.0 != 0 {
            return Ok(None);
        }
        if let Some(known) = self.volumes.get(&id.1) {
            return Ok(known.clone());
        }
        let all = match self.settings.volumes_of(id.1, object.triangles.len()) {
            ObjectVolumes::One => None,
            ObjectVolumes::Several(all) => Some(all.to_vec()),
            ObjectVolumes::Unfit => {
                self.scene.warn(Warning::lost(format!(
                    "ranges of parts of object {} do not fit its triangles: it is one solid, without settings",
                    id.1
                )));
                None
            }
        };
        let mut made = None;
        if let Some(all) = all {
            let (sets, is_lost) = sets_of_volumes(object, &all);
            if is_lost {
                self.scene.warn(Warning::lost(LOST_SETS));
            }
            self.check_triangles(id, object)?;
            let mut volumes = Vec::with_capacity(all.len());
            for (volume, sets) in all.into_iter().zip(sets) {
                let piece = piece_of(object, volume.first, volume.last, sets);
                volumes.push((volume.role, self.new_mesh(id, &piece)?));
            }
            made = Some(volumes.into());
        }
        self.volumes.insert(id.1, made.clone());
        Ok(made)
    }

    /// Returns the mesh of an object; `None` if it has no triangles.
    fn mesh(&mut self, id: Id, object: &Object) -> Result<Option<usize>, ReadError> {
        if let Some(&known) = self.meshes.get(&id) {
            return Ok(known);
        }
        self.check_triangles(id, object)?;
        let mesh = self.new_mesh(id, object)?;
        self.meshes.insert(id, mesh);
        Ok(mesh)
    }

    /// Adds the mesh of an object, or of a volume of it, whose triangles were checked.
    fn new_mesh(&mut self, id: Id, object: &Object) -> Result<Option<usize>, ReadError> {
        let mut parts = MeshParts { name: object.name.clone(), ..MeshParts::default() };
        let resolved = self.resolve(id, object)?;
        let marks = Marks::new(object, &self.parts[id.0].clone());
        if marks.lost_sets {
            self.scene.warn(Warning::lost(LOST_SETS));
        }
        let split_triangles;
        let triangles = if resolved.looks.iter().all(|look| matches!(look, Look::Plain(_))) {
            parts.positions.clone_from(&object.vertices);
            &object.triangles
        } else {
            split_triangles = split(object, &resolved, &mut parts);
            &split_triangles
        };
        let of_triangle = resolved.of_triangle.iter().enumerate();
        let keys = of_triangle.map(|(at, &look)| (resolved.looks[look].material(), marks.of(at)));
        let (groups, order) = grouped(keys, triangles);
        for ((material, mark), triangles) in groups {
            parts.primitives.push((material, triangles));
            parts.marks.push(marks.extras(mark));
        }
        let mesh = self.scene.mesh(parts);
        if let Some(mesh) = mesh.filter(|_| !marks.exact.is_empty()) {
            let mut exact = marks.exact;
            exact.iter_mut().for_each(|(triangle, ..)| *triangle = order[*triangle as usize]);
            exact.sort_unstable();
            self.paint.insert(mesh, exact);
        }
        Ok(mesh)
    }

    /// Finds the properties of the triangles of an object.
    fn resolve(&mut self, (part, number): Id, object: &Object) -> Result<Resolved, ReadError> {
        let owner = self.parts[part].clone();
        let (mut known, mut resolved, mut is_beyond) = (HashMap::new(), Resolved::default(), false);
        for at in 0..object.triangles.len() {
            let own = object.properties.get(at).and_then(|p| Some((p.group?, p.corners)));
            let property = own.or(object.property.map(|(group, entry)| (group, [entry; 3])));
            let key = property.map(|(group, corners)| {
                // Only material groups have a separate look for each entry.
                let is_material = matches!(owner.groups.get(&group), Some(Group::Materials(..)));
                (group, is_material.then_some(corners[0]), self.layer(&owner, group))
            });
            let look = match known.get(&key) {
                Some(&look) => look,
                None => {
                    let element = || format!("object {number}, triangle {at}");
                    let look = match key {
                        None => Look::Plain(None),
                        Some((group, entry, layer)) => {
                            self.look(part, group, layer, entry.unwrap_or(0), &element())?
                        }
                    };
                    resolved.looks.push(look);
                    known.insert(key, resolved.looks.len() - 1);
                    resolved.looks.len() - 1
                }
            };
            resolved.of_triangle.push(look);
            let corners = property.map_or([0; 3], |(_, corners)| corners);
            let length = resolved.looks[look].length().unwrap_or(usize::MAX);
            is_beyond |= corners.iter().any(|&corner| corner as usize >= length);
            resolved.corners.push(corners);
        }
        if is_beyond {
            let text =
                "some triangles use colours or texture coordinates beyond the end of their group: dropped";
            self.scene.warn(Warning::lost(text));
        }
        Ok(resolved)
    }

    /// Returns the layer of several properties that is shown: a texture, else colours, else the first.
    fn layer(&self, part: &Part, group: u32) -> Option<usize> {
        let Some(Group::Several(groups, _)) = part.groups.get(&group) else { return None };
        let find = |is: fn(&Group) -> bool| groups.iter().position(|g| part.groups.get(g).is_some_and(is));
        let textured = find(|g| matches!(g, Group::Coordinates(..)));
        Some(textured.or_else(|| find(|g| matches!(g, Group::Colors(_)))).unwrap_or(0))
    }

    fn look(
        &mut self,
        part: usize,
        group: u32,
        layer: Option<usize>,
        entry: u32,
        element: &str,
    ) -> Result<Look, ReadError> {
        let owner = self.parts[part].clone();
        let mut shown = group;
        let mut indices = None;
        if let (Some(layer), Some(Group::Several(groups, entries))) = (layer, owner.groups.get(&group)) {
            self.scene.warn(Warning::lost("some triangles have several materials: only one is kept"));
            shown = groups.get(layer).copied().unwrap_or(u32::MAX);
            indices = Some(entries.iter().map(|e| e.get(layer).copied().unwrap_or(0)).collect::<Vec<u32>>());
        }
        match owner.groups.get(&shown) {
            Some(Group::Materials(..)) => {
                let entry = indices.and_then(|i| i.first().copied()).unwrap_or(entry);
                Ok(Look::Plain(self.base_material((part, shown), entry)))
            }
            Some(Group::Colors(colors)) => {
                let material = self.color_material((part, shown), colors);
                Ok(Look::Colors(material, picked(&linear_colors(colors), indices)))
            }
            Some(Group::Coordinates(texture, uvs)) => {
                let material = self.texture_material((part, shown), *texture)?;
                let flipped: Vec<[f32; 2]> = uvs.iter().map(|&[u, v]| [u, 1.0 - v]).collect();
                Ok(Look::Texture(material, picked(&flipped, indices)))
            }
            Some(Group::Several(..)) => Err(ReadError::element(
                element,
                format!("the property group {group} contains another of its kind"),
            )),
            None => {
                let text = "some triangles use properties that are missing or not supported: dropped";
                self.scene.warn(Warning::lost(text));
                Ok(Look::Plain(None))
            }
        }
    }

    fn base_material(&mut self, group: Id, entry: u32) -> Option<usize> {
        if let Some(&known) = self.materials.get(&(group, Some(entry))) {
            return known;
        }
        let owner = self.parts[group.0].clone();
        let Some(Group::Materials(all, display)) = owner.groups.get(&group.1) else { return None };
        let material = all.get(entry as usize).map(|(name, color)| {
            let metallic = display.and_then(|d| owner.metallic.get(&d)?.get(entry as usize));
            let [metalness, roughness] = metallic.copied().unwrap_or([0.0, 1.0]);
            let [r, g, b, a] = color.map(f64::from);
            let linear = |x: f64| f64::from(linear_of_srgb(x as f32));
            let mut material = json!({
                "pbrMetallicRoughness": {
                    "baseColorFactor": [linear(r), linear(g), linear(b), a],
                    "metallicFactor": metalness,
                    "roughnessFactor": roughness,
                },
            });
            if !name.is_empty() {
                material["name"] = name.as_str().into();
            }
            if a < 1.0 {
                material["alphaMode"] = "BLEND".into();
            }
            self.scene.add("materials", material)
        });
        if material.is_none() {
            self.scene
                .warn(Warning::lost("some triangles use materials beyond the end of their group: dropped"));
        }
        self.materials.insert((group, Some(entry)), material);
        material
    }

    fn color_material(&mut self, group: Id, colors: &[[f32; 4]]) -> Option<usize> {
        let make = |scene: &mut SceneBuilder| {
            let mut material = plain_material();
            if colors.iter().any(|c| c[3] < 1.0) {
                material["alphaMode"] = "BLEND".into();
            }
            Some(scene.add("materials", material))
        };
        *self.materials.entry((group, None)).or_insert_with(|| make(&mut self.scene))
    }

    fn texture_material(&mut self, group: Id, texture: u32) -> Result<Option<usize>, ReadError> {
        if let Some(&known) = self.materials.get(&(group, None)) {
            return Ok(known);
        }
        let mut material = plain_material();
        if let Some(texture) = self.texture((group.0, texture))? {
            material["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": texture });
        }
        let material = Some(self.scene.add("materials", material));
        self.materials.insert((group, None), material);
        Ok(material)
    }

    fn texture(&mut self, id: Id) -> Result<Option<usize>, ReadError> {
        if let Some(&known) = self.textures.get(&id) {
            return Ok(known);
        }
        let owner = self.parts[id.0].clone();
        let mut lost = |why: String| self.scene.warn(Warning::lost(why));
        let texture = match owner.textures.get(&id.1) {
            None => {
                lost(format!("the texture {} is not in the file: dropped", id.1));
                None
            }
            Some(texture) => {
                let bytes = self.package.part(&texture.path)?;
                let shown = excerpt(&texture.path);
                match bytes.as_deref().map(|bytes| (image_type(bytes), bytes)) {
                    Some((Some(kind @ ("image/png" | "image/jpeg")), bytes)) => {
                        let name = texture.path.rsplit('/').next().unwrap_or_default();
                        let source = self.scene.image(name, kind, bytes);
                        let filter = if texture.is_nearest { 9728 } else { 9729 };
                        let [s, t] = texture.wrap;
                        let sampler = json!({ "magFilter": filter, "wrapS": s, "wrapT": t });
                        let sampler = self.scene.add("samplers", sampler);
                        Some(self.scene.add("textures", json!({ "source": source, "sampler": sampler })))
                    }
                    Some(_) => {
                        lost(format!("the texture {shown} is neither PNG nor JPEG: dropped"));
                        None
                    }
                    None => {
                        lost(format!("the texture {shown} is not in the file: dropped"));
                        None
                    }
                }
            }
        };
        self.textures.insert(id, texture);
        Ok(texture)
    }

    /// Adds warnings about content that is dropped.
    fn warn(&mut self) {
        let is_left_out = |(id, object): &(Id, &Object)| {
            let is_placed = self.meshes.contains_key(id) || (id.0 == 0 && self.volumes.contains_key(&id.1));
            !is_placed && !object.triangles.is_empty()
        };
        let all = self.parts.iter().enumerate();
        let objects =
            all.flat_map(|(at, part)| part.objects.iter().map(move |(number, o)| ((at, *number), o)));
        let unplaced = objects.filter(is_left_out).count();
        if unplaced > 0 {
            let objects = counted(unplaced, "object with triangles is", "objects with triangles are");
            self.scene.warn(Warning::lost(format!("{objects} not in the build: dropped")));
        }
        for part in self.parts.clone() {
            for what in &part.dropped {
                self.scene.warn(Warning::lost(format!("{what} are not read: dropped")));
            }
        }
    }
}

/// The properties of the triangles of an object.
#[derive(Default)]
struct Resolved {
    looks: Vec<Look>,
    of_triangle: Vec<usize>,
    /// Entries of the corners.
    corners: Vec<[u32; 3]>,
}

/// Look of the triangles of one group: their material, and the values that their entries mean.
enum Look {
    Plain(Option<usize>),
    Colors(Option<usize>, Vec<[f32; 4]>),
    Texture(Option<usize>, Vec<[f32; 2]>),
}

impl Look {
    /// Returns the number of values; `None` if it needs none.
    fn length(&self) -> Option<usize> {
        match self {
            Self::Plain(_) => None,
            Self::Colors(_, all) => Some(all.len()),
            Self::Texture(_, all) => Some(all.len()),
        }
    }

    fn material(&self) -> Option<usize> {
        match self {
            Self::Plain(material) | Self::Colors(material, _) | Self::Texture(material, _) => *material,
        }
    }
}

/// Returns the values at the given indices (entries of several properties); without indices, the values
/// themselves.
fn picked<T: Copy + Default>(values: &[T], indices: Option<Vec<u32>>) -> Vec<T> {
    match indices {
        None => values.to_vec(),
        Some(all) => all.iter().map(|&i| values.get(i as usize).copied().unwrap_or_default()).collect(),
    }
}

/// Splits vertices whose corners have different values; returns the triangles.
fn split(object: &Object, resolved: &Resolved, parts: &mut MeshParts) -> Vec<[u32; 3]> {
    // A vertex, with the look and the entry of one of its corners.
    let key = |at: usize, k: usize| {
        let look = resolved.of_triangle[at];
        let entry = if matches!(resolved.looks[look], Look::Plain(_)) { 0 } else { resolved.corners[at][k] };
        (object.triangles[at][k], look as u32, entry)
    };
    let corners = (0..object.triangles.len()).flat_map(|at| (0..3).map(move |k| (at, k)));
    let mut keys: Vec<(u32, u32, u32)> = corners.map(|(at, k)| key(at, k)).collect();
    keys.sort_unstable();
    keys.dedup();
    let is_any = |is: fn(&Look) -> bool| resolved.looks.iter().any(is);
    parts.positions = keys.iter().map(|key| object.vertices[key.0 as usize]).collect();
    parts.source_vertices = Some(keys.iter().map(|key| key.0).collect());
    if is_any(|l| matches!(l, Look::Colors(..))) {
        let color = |&(_, look, entry): &(u32, u32, u32)| match &resolved.looks[look as usize] {
            Look::Colors(_, all) => all.get(entry as usize).copied().unwrap_or([1.0; 4]),
            _ => [1.0; 4],
        };
        parts.colors = Some(keys.iter().map(color).collect());
    }
    if is_any(|l| matches!(l, Look::Texture(..))) {
        let uv = |&(_, look, entry): &(u32, u32, u32)| match &resolved.looks[look as usize] {
            Look::Texture(_, all) => all.get(entry as usize).copied().unwrap_or_default(),
            _ => [0.0; 2],
        };
        parts.uvs = vec![keys.iter().map(uv).collect()];
    }
    let number = |at: usize, k: usize| keys.binary_search(&key(at, k)).unwrap_or(0) as u32;
    (0..object.triangles.len()).map(|at| [0, 1, 2].map(|k| number(at, k))).collect()
}

/// A material and a mark.
type GroupKey = (Option<usize>, u32);

/// Triangles with one material and mark.
type TriangleGroup = (GroupKey, Vec<[u32; 3]>);

/// Groups triangles by material and mark, in the order in which these first appear. Also returns the place of each triangle
/// among those of all groups.
fn grouped(keys: impl Iterator<Item = GroupKey>, triangles: &[[u32; 3]]) -> (Vec<TriangleGroup>, Vec<u32>) {
    let mut groups: Vec<TriangleGroup> = Vec::new();
    let (mut place_of, mut places) = (BTreeMap::new(), Vec::new());
    for (key, triangle) in keys.zip(triangles) {
        let at = *place_of.entry(key).or_insert_with(|| {
            groups.push((key, Vec::new()));
            groups.len() - 1
        });
        places.push((at, groups[at].1.len()));
        groups[at].1.push(*triangle);
    }
    let firsts: Vec<usize> = groups
        .iter()
        .scan(0, |next, (_, own)| {
            *next += own.len();
            Some(*next - own.len())
        })
        .collect();
    let order = places.into_iter().map(|(at, within)| (firsts[at] + within) as u32).collect();
    (groups, order)
}

/// Returns the sets of each volume of an object, which cover its triangles, and whether some are lost: sets that are too
/// many, or name triangles that are not there.
fn sets_of_volumes(object: &Object, volumes: &[Volume]) -> (Vec<Vec<TriangleSet>>, bool) {
    let count = object.triangles.len();
    let mut of_volumes: Vec<Vec<TriangleSet>> = volumes.iter().map(|_| Vec::new()).collect();
    let mut last_sets: Vec<Option<usize>> = vec![None; volumes.len()];
    let mut order: Vec<usize> = (0..volumes.len()).collect();
    order.sort_unstable_by_key(|&at| volumes[at].first);
    let ranges = || object.sets.iter().flat_map(|set| &set.ranges);
    let fits = |[first, last]: [u32; 2]| first <= last && (last as usize) < count;
    let is_lost = !ranges().all(|range| fits(*range));
    // A range is in no more volumes than it has triangles.
    let members = ranges().filter(|range| fits(**range)).map(|[first, last]| (last - first) as usize + 1);
    if members.fold(0, usize::saturating_add) > count.saturating_mul(MAX_MEMBERSHIPS) {
        return (of_volumes, true);
    }
    for (number, set) in object.sets.iter().enumerate() {
        for &[first, last] in set.ranges.iter().filter(|range| fits(**range)) {
            let from = order.partition_point(|&at| volumes[at].last < first);
            for &at in order[from..].iter().take_while(|&&at| volumes[at].first <= last) {
                let (volume, sets) = (volumes[at], &mut of_volumes[at]);
                let range = [first.max(volume.first) - volume.first, last.min(volume.last) - volume.first];
                let is_same = last_sets[at].replace(number) == Some(number);
                match sets.last_mut().filter(|_| is_same) {
                    Some(own) => own.ranges.push(range),
                    None => {
                        let (name, identifier) = (set.name.clone(), set.identifier.clone());
                        sets.push(TriangleSet { name, identifier, ranges: vec![range] });
                    }
                }
            }
        }
    }
    (of_volumes, is_lost)
}

/// Returns a range of the triangles of an object as an object of its own, with the vertices that they use and these sets.
fn piece_of(object: &Object, first: u32, last: u32, sets: Vec<TriangleSet>) -> Object {
    let range = first as usize..last as usize + 1;
    let triangles = &object.triangles[range.clone()];
    let mut used: Vec<u32> = triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    let number = |v: u32| used.binary_search(&v).unwrap_or(0) as u32;
    let [from, to] = [first, last + 1].map(|at| object.paint.partition_point(|p| p.triangle < at));
    let paint = object.paint[from..to].iter();
    Object {
        name: object.name.clone(),
        kind: object.kind,
        property: object.property,
        vertices: used.iter().map(|&v| object.vertices[v as usize]).collect(),
        triangles: triangles.iter().map(|t| t.map(number)).collect(),
        properties: range.clone().map_while(|at| object.properties.get(at).copied()).collect(),
        paint: paint.map(|p| PaintOfTriangle { triangle: p.triangle - first, ..*p }).collect(),
        sets,
        components: Vec::new(),
    }
}

/// A material whose colour comes from vertices or a texture.
fn plain_material() -> Value {
    json!({ "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 } })
}

/// Returns the matrix of a place.
fn matrix(place: &PlacedObject, scale: f64) -> DMat4 {
    let t = place.transform.unwrap_or([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let row = |at: usize| DVec3::new(t[at], t[at + 1], t[at + 2]);
    let axis = |at: usize| (row(at) * scale).extend(0.0);
    DMat4::from_cols(axis(0), axis(3), axis(6), row(9).extend(1.0))
}
