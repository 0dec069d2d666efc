//! A scene on its way out, with other meshes in the places of some.
//!
//! ```text
//! for each replaced mesh:  its primitives let go of their accessors; the new numbers become pieces
//! free = let go, and named by nothing else
//! cut the bytes of free views out; append those of the pieces
//! a piece takes the numbers of the accessor and view that it replaces, if they are free; else another free one; else a new one
//! what is still free goes, and all references are renumbered
//! ```

use std::collections::{BTreeSet, HashMap, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{self, Write};
use std::ops::Range;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use lodsmith_core::mesh::Semantic;
use lodsmith_core::{Positions, TriMesh, VertexId, WedgeId};
use serde_json::{Map, Value, json};

use super::accessors::Component;
use super::buffers::COMPRESSED;
use super::container::{emit, list, list_mut, number};
use super::encode::{Encoded, Kind, encode, settle_weights, unit_directions};
use super::mesh::TYPES;
use super::primitive::Primitive;
use super::references::{Named, each_reference, has_extension, views_of};
use super::repack::{Repacked, Span};
use super::scene::{Scene, relink};
use super::slot::Slot;
use crate::attributes::rounding;
use crate::error::Warning;
use crate::format::Format;

/// What views are for.
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// Extensions of a primitive whose content depends on its vertices, and goes with them.
const OF_VERTICES: [&str; 2] = ["KHR_draco_mesh_compression", "CESIUM_primitive_outline"];

/// Extensions of a primitive that hold for any vertices.
const OF_PRIMITIVES: [&str; 3] = ["KHR_materials_variants", "EXT_mesh_features", "EXT_structural_metadata"];

pub(super) fn write(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    format: Format,
    new_uri: &dyn Fn(&str) -> Option<String>,
    out: &mut dyn Write,
) -> io::Result<Vec<Warning>> {
    if !matches!(format, Format::Gltf | Format::Glb) {
        return Err(invalid(format!("a scene is written as glTF or GLB, not as {}", format.title())));
    }
    let mut edit = Edit::new(scene);
    for (i, mesh) in replaced.iter().enumerate() {
        if let Some(mesh) = mesh {
            edit.replace(i, mesh)?;
        }
    }
    let (mut json, bytes, warnings) = edit.finish(scene);
    relink(&mut json, 0, new_uri);
    let glb = format == Format::Glb;
    set_buffer(&mut json, &bytes, glb);
    emit(&json, &bytes, glb, out)?;
    Ok(warnings)
}

fn invalid(problem: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, problem)
}

/// The one buffer that there is now.
fn set_buffer(json: &mut Value, bytes: &[u8], glb: bool) {
    let Some(root) = json.as_object_mut() else { return };
    if bytes.is_empty() {
        root.shift_remove("buffers");
        return;
    }
    if !root.get("buffers").is_some_and(|b| b.get(0).is_some_and(Value::is_object)) {
        root.insert("buffers".to_owned(), json!([{}]));
    }
    let Some(buffers) = root.get_mut("buffers").and_then(Value::as_array_mut) else { return };
    buffers.truncate(1);
    let Some(buffer) = buffers.first_mut().and_then(Value::as_object_mut) else { return };
    buffer.insert("byteLength".to_owned(), bytes.len().into());
    if glb {
        buffer.shift_remove("uri");
    } else {
        let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes));
        buffer.insert("uri".to_owned(), uri.into());
    }
}

/// The scene as it changes.
struct Edit<'s> {
    source: &'s Value,
    json: Value,
    pieces: Vec<Piece>,
    /// Pieces by the accessor that they replace and a hash of their bytes.
    known: HashMap<(usize, u64), usize>,
    /// Bytes of the pieces.
    fresh: Vec<u8>,
    /// Accessors and views that replaced primitives named.
    let_go: BTreeSet<usize>,
    views_let_go: BTreeSet<usize>,
    warnings: Vec<Warning>,
}

/// A new accessor.
struct Piece {
    spot: Spot,
    /// The accessor that stood there.
    old: Option<usize>,
    kind: Kind,
    width: usize,
    count: usize,
    min: Vec<Value>,
    max: Vec<Value>,
    data: Data,
}

/// Where an accessor is named.
struct Spot {
    mesh: usize,
    primitive: usize,
    part: Part,
}

impl Spot {
    /// The attribute that is named here.
    fn attribute(&self) -> Option<String> {
        match &self.part {
            Part::Attribute(name) => Some(name.clone()),
            Part::Indices | Part::Target(..) => None,
        }
    }
}

enum Part {
    Indices,
    Attribute(String),
    Target(usize, String),
}

/// Where the numbers of an accessor are.
enum Data {
    /// All are zero.
    Nowhere,
    /// In this earlier piece, which takes the place of the same accessor.
    Shared(usize),
    Dense(Stretch),
    /// Those that are not zero: how many, the type of their indices, these, and the numbers.
    Sparse(usize, Component, [Stretch; 2]),
}

/// Some of the new bytes: a view.
struct Stretch {
    bytes: Range<usize>,
    stride: Option<usize>,
    target: Option<u32>,
}

impl<'s> Edit<'s> {
    fn new(scene: &'s Scene) -> Self {
        Self {
            source: &scene.json,
            json: scene.json.clone(),
            pieces: Vec::new(),
            known: HashMap::new(),
            fresh: Vec::new(),
            let_go: BTreeSet::new(),
            views_let_go: BTreeSet::new(),
            warnings: Vec::new(),
        }
    }

    /// Puts a mesh in the place of another.
    fn replace(&mut self, index: usize, mesh: &TriMesh) -> io::Result<()> {
        let name = format!("meshes[{index}]");
        let Some(source) = list(self.source, "meshes").get(index) else {
            let count = list(self.source, "meshes").len();
            return Err(invalid(format!("{name} is to be replaced, but the scene has {count} meshes")));
        };
        let primitives = list(source, "primitives");
        let has_faces = |p: &Value| {
            Primitive::has_faces(p, "").unwrap_or(false) && !p["attributes"]["POSITION"].is_null()
        };
        let mut faces: Vec<Option<Vec<[WedgeId; 3]>>> =
            primitives.iter().map(|p| has_faces(p).then(Vec::new)).collect();
        let first = faces.iter().position(Option::is_some);
        for (i, &triangle) in mesh.triangles().iter().enumerate() {
            let region = mesh.regions().map(|r| r[i].index()).or(first);
            let list = region.and_then(|r| faces.get_mut(r)).and_then(Option::as_mut);
            let Some(list) = list else {
                let region = region.map_or("none".to_owned(), |r| r.to_string());
                return Err(invalid(format!(
                    "face {i} of {name} is of region {region}, which is no primitive with triangles"
                )));
            };
            list.push(triangle);
        }
        self.warnings.extend(rounding(mesh, "glTF", None));

        let held: HashSet<Slot> = primitives
            .iter()
            .filter(|p| has_faces(p))
            .flat_map(|p| p["attributes"].as_object().into_iter().flat_map(|a| a.keys()))
            .map(|key| Slot::of(None, key))
            .collect();
        let added: Vec<Slot> = Slot::all_of(mesh).into_iter().filter(|s| !held.contains(s)).collect();
        let mut task = Task {
            index,
            mesh,
            added,
            values: HashMap::new(),
            local: vec![u32::MAX; mesh.wedge_count()],
            lost: BTreeSet::new(),
            no_direction: 0,
        };
        for slot in Slot::all_of(mesh) {
            if let Some(values) = slot.values(mesh) {
                task.values.entry(slot).or_insert(values);
            }
        }
        for (p, faces) in faces.into_iter().enumerate() {
            let Some(faces) = faces else { continue };
            self.let_go(index, p);
            if faces.is_empty() {
                self.json["meshes"][index]["primitives"][p] = Value::Null;
                let text =
                    format!("{name}.primitives[{p}] has no face any more: left out, with its material");
                self.warnings.push(Warning::lost(text));
                continue;
            }
            self.primitive(&mut task, p, &primitives[p], &faces);
        }
        if !task.lost.is_empty() {
            let lost: Vec<String> = task.lost.into_iter().collect();
            self.warnings
                .push(Warning::lost(format!("{name} does not have its {} any more", lost.join(", "))));
        }
        if task.no_direction > 0 {
            let text = format!("{name}: {} normals or tangents have no length: replaced", task.no_direction);
            self.warnings.push(Warning::note(text));
        }
        Ok(())
    }

    /// Empties a primitive: what it named has the value null until a piece takes its place.
    fn let_go(&mut self, mesh: usize, primitive: usize) {
        let Self { json, let_go, views_let_go, .. } = self;
        let primitive = &mut json["meshes"][mesh]["primitives"][primitive];
        let mut empty = |value: &mut Value| {
            let_go.extend(number(value));
            *value = Value::Null;
        };
        if let Some(indices) = primitive.get_mut("indices") {
            empty(indices);
        }
        if let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) {
            attributes.values_mut().for_each(&mut empty);
        }
        let targets = primitive.get_mut("targets").and_then(Value::as_array_mut).into_iter().flatten();
        for target in targets.filter_map(Value::as_object_mut) {
            target.values_mut().for_each(&mut empty);
        }
        if let Some(mode) = primitive.get_mut("mode") {
            *mode = 4.into();
        }
        for extension in OF_VERTICES {
            let Some(taken) = take_extension(primitive, extension) else { continue };
            if extension == "CESIUM_primitive_outline" {
                self.warnings.push(Warning::lost(format!("the {extension} of meshes[{mesh}] is left out")));
                let_go.extend(number(&taken["indices"]));
            }
            views_let_go.extend(number(&taken["bufferView"]));
        }
        let unknown = primitive["extensions"].as_object().into_iter().flat_map(|e| e.keys());
        for extension in unknown.filter(|e| !OF_PRIMITIVES.contains(&e.as_str())) {
            let text = format!(
                "the extension {extension} of meshes[{mesh}] stays as it is, though its vertices are others"
            );
            if !self.warnings.iter().any(|w| w.text == text) {
                self.warnings.push(Warning::note(text));
            }
        }
    }

    /// Makes the pieces of a primitive.
    fn primitive(&mut self, task: &mut Task<'_>, p: usize, source: &Value, faces: &[[WedgeId; 3]]) {
        let mesh = task.index;
        let mut used: Vec<WedgeId> = Vec::new();
        for w in faces.as_flattened() {
            let place = &mut task.local[w.index()];
            if *place == u32::MAX {
                *place = 0;
                used.push(*w);
            }
        }
        used.sort_unstable();
        used.iter().enumerate().for_each(|(i, w)| task.local[w.index()] = i as u32);

        let at = |part: Part| Spot { mesh, primitive: p, part };
        let no_attributes = Map::new();
        let attributes = source["attributes"].as_object().unwrap_or(&no_attributes);
        let first = self.pieces.len();
        let weights = self.weights(task, attributes, &used);
        for (key, old) in attributes {
            let slot = Slot::of(None, key);
            let kind = self.kind_of(old);
            let is_forced = slot.is_part_of_one() || matches!(slot, Slot::Further(Semantic::Joints(_)));
            let gathered = match weights.get(key) {
                Some(values) => Some((4, values.clone())),
                None => task.gather(&slot, self.width_of(old), &used),
            };
            let Some((width, values)) = gathered else {
                task.lost.insert(key.clone());
                continue;
            };
            let kind = settled(&slot, kind, &values);
            let encoded = encode(&values, width, kind, is_forced);
            self.dense(at(Part::Attribute(key.clone())), number(old), encoded, Some(VERTICES));
        }
        for slot in task.added.clone() {
            let Some(name) = slot.name() else { continue };
            let Some((width, values)) = task.gather(&slot, None, &used) else { continue };
            let kind = settled(&slot, None, &values);
            let encoded = encode(&values, width, kind, matches!(slot, Slot::Further(Semantic::Joints(_))));
            self.dense(at(Part::Attribute(name)), None, encoded, Some(VERTICES));
        }
        // A target can only move what the primitive has.
        let names: HashSet<String> = self.pieces[first..].iter().filter_map(|p| p.spot.attribute()).collect();
        for (t, target) in list(source, "targets").iter().enumerate() {
            let before = self.pieces.len();
            for (key, old) in target.as_object().into_iter().flatten() {
                let slot = Slot::of(Some(t), key);
                let width = self.width_of(old);
                let spot = at(Part::Target(t, key.clone()));
                let gathered = task.gather(&slot, width, &used).filter(|_| names.contains(key));
                if let Some((width, values)) = gathered {
                    let kind = settled(&slot, self.kind_of(old), &values);
                    let encoded = encode(&values, width, kind, false);
                    self.target(spot, number(old), encoded, &values);
                } else {
                    task.lost.insert(format!("targets[{t}].{key}"));
                }
            }
            if self.pieces.len() == before {
                // All primitives have the same number of targets, and animations count on it: this one moves nothing.
                let encoded = encode(&vec![0.0; 3 * used.len()], 3, Kind::FLOAT, false);
                let old = number(&target["POSITION"]);
                self.nowhere(at(Part::Target(t, "POSITION".to_owned())), old, encoded, used.len());
            }
        }
        let indices: Vec<u32> = faces.as_flattened().iter().map(|w| task.local[w.index()]).collect();
        let in_order = source["indices"].is_null() && indices.iter().enumerate().all(|(i, &v)| i as u32 == v);
        if !in_order {
            self.indices(at(Part::Indices), number(&source["indices"]), &indices, used.len());
        }
        used.iter().for_each(|w| task.local[w.index()] = u32::MAX);
    }

    /// The weights of a primitive, all sets together; empty if the mesh lacks one.
    fn weights(
        &self,
        task: &mut Task<'_>,
        attributes: &Map<String, Value>,
        used: &[WedgeId],
    ) -> HashMap<String, Vec<f32>> {
        let (mut keys, mut sets, mut ones) = (Vec::new(), Vec::new(), Vec::new());
        for (key, old) in attributes {
            let slot = Slot::of(None, key);
            if !matches!(slot, Slot::Further(Semantic::Weights(_))) {
                continue;
            }
            let Some((4, values)) = task.gather(&slot, Some(4), used) else { return HashMap::new() };
            let integers = self.kind_of(old).map(|k| k.component).filter(|&c| c != Component::F32);
            ones.push(integers.map(Component::one));
            keys.push(key.clone());
            sets.push(values);
        }
        // Integers of two types: those of the shorter are among those of the longer.
        let one = ones.into_iter().flatten().fold(None, |a: Option<f32>, b| Some(a.map_or(b, |a| a.min(b))));
        settle_weights(&mut sets, one);
        keys.into_iter().zip(sets).collect()
    }

    /// The type of an accessor's numbers.
    fn kind_of(&self, accessor: &Value) -> Option<Kind> {
        let accessor = list(self.source, "accessors").get(number(accessor)?)?;
        let component = Component::from_code(number(&accessor["componentType"])?)?;
        Some(Kind { component, normalized: accessor["normalized"].as_bool().unwrap_or(false) })
    }

    fn width_of(&self, accessor: &Value) -> Option<usize> {
        let accessor = list(self.source, "accessors").get(number(accessor)?)?;
        let kind = accessor["type"].as_str()?;
        TYPES.iter().position(|t| *t == kind).filter(|&n| n > 0)
    }

    /// Appends bytes, on a step of 4.
    fn append(&mut self, bytes: &[u8]) -> Range<usize> {
        let start = self.fresh.len().next_multiple_of(4);
        self.fresh.resize(start, 0);
        self.fresh.extend_from_slice(bytes);
        start..self.fresh.len()
    }

    fn dense(&mut self, spot: Spot, old: Option<usize>, encoded: Encoded, target: Option<u32>) {
        let tight = encoded.kind.component.size() * encoded.width;
        let bytes = self.append(&encoded.bytes);
        let stride = (encoded.stride != tight).then_some(encoded.stride);
        let count = bytes.len() / encoded.stride;
        self.piece(spot, old, encoded, count, Data::Dense(Stretch { bytes, stride, target }));
    }

    fn nowhere(&mut self, spot: Spot, old: Option<usize>, encoded: Encoded, count: usize) {
        self.piece(spot, old, encoded, count, Data::Nowhere);
    }

    /// What a morph target adds: sparse where it was so and still few are not zero.
    fn target(&mut self, spot: Spot, old: Option<usize>, encoded: Encoded, values: &[f32]) {
        let width = encoded.width;
        let count = values.len() / width;
        let before = old.and_then(|i| list(self.source, "accessors").get(i)).unwrap_or(&Value::Null);
        let was_sparse = before["bufferView"].is_null();
        let is_tight = encoded.stride == encoded.kind.component.size() * width;
        let moved: Vec<usize> =
            (0..count).filter(|i| values[i * width..][..width].iter().any(|x| *x != 0.0)).collect();
        // Guessed: beyond a third, the indices cost as much as they save.
        if !was_sparse || !is_tight || moved.len() * 3 > count {
            return self.dense(spot, old, encoded, Some(VERTICES));
        }
        if moved.is_empty() {
            return self.nowhere(spot, old, encoded, count);
        }
        let is_small = count <= usize::from(u16::MAX);
        let mut indices = Vec::new();
        for &i in &moved {
            if is_small {
                indices.extend_from_slice(&(i as u16).to_le_bytes());
            } else {
                indices.extend_from_slice(&(i as u32).to_le_bytes());
            }
        }
        let stride = encoded.stride;
        let numbers: Vec<u8> =
            moved.iter().flat_map(|i| encoded.bytes[i * stride..][..stride].iter().copied()).collect();
        let views = [indices, numbers].map(|bytes| {
            let bytes = self.append(&bytes);
            Stretch { bytes, stride: None, target: None }
        });
        let component = if is_small { Component::U16 } else { Component::U32 };
        self.piece(spot, old, encoded, count, Data::Sparse(moved.len(), component, views));
    }

    fn indices(&mut self, spot: Spot, old: Option<usize>, indices: &[u32], vertices: usize) {
        // The largest number of a type is not an index.
        let is_small = vertices <= usize::from(u16::MAX);
        let component = if is_small { Component::U16 } else { Component::U32 };
        let mut bytes = Vec::with_capacity(indices.len() * component.size());
        for i in indices {
            if is_small {
                bytes.extend_from_slice(&(*i as u16).to_le_bytes());
            } else {
                bytes.extend_from_slice(&i.to_le_bytes());
            }
        }
        let bound = |x: Option<&u32>| vec![x.copied().unwrap_or(0).into()];
        let (min, max) = (bound(indices.iter().min()), bound(indices.iter().max()));
        let kind = Kind { component, normalized: false };
        let bytes = self.append(&bytes);
        let data = Data::Dense(Stretch { bytes, stride: None, target: Some(INDICES) });
        self.push(Piece { spot, old, kind, width: 1, count: indices.len(), min, max, data });
    }

    fn piece(&mut self, spot: Spot, old: Option<usize>, encoded: Encoded, count: usize, data: Data) {
        let Encoded { kind, width, min, max, .. } = encoded;
        self.push(Piece { spot, old, kind, width, count, min, max, data });
    }

    /// Adds a piece whose bytes were appended last. What primitives shared and is still equal, they share again.
    fn push(&mut self, mut piece: Piece) {
        let next = self.pieces.len();
        if let (Some(old), Data::Dense(stretch)) = (piece.old, &piece.data) {
            let mut hasher = DefaultHasher::new();
            self.fresh[stretch.bytes.clone()].hash(&mut hasher);
            let twin = *self.known.entry((old, hasher.finish())).or_insert(next);
            if let Some(Piece { kind, width, data: Data::Dense(other), .. }) = self.pieces.get(twin)
                && (*kind, *width) == (piece.kind, piece.width)
                && self.fresh[other.bytes.clone()] == self.fresh[stretch.bytes.clone()]
            {
                self.fresh.truncate(stretch.bytes.start);
                piece.data = Data::Shared(twin);
            }
        }
        self.pieces.push(piece);
    }

    /// Puts the pieces where they belong; the JSON, its bytes and what there is to say.
    fn finish(mut self, scene: &Scene) -> (Value, Vec<u8>, Vec<Warning>) {
        let is_changed = !self.let_go.is_empty();
        self.free();
        let is_free = |json: &Value, name: &str| -> BTreeSet<usize> {
            list(json, name).iter().enumerate().filter(|(_, v)| v.is_null()).map(|(i, _)| i).collect()
        };
        let mut free =
            Free { accessors: is_free(&self.json, "accessors"), views: is_free(&self.json, "bufferViews") };
        let spans_of = |is_kept: bool| {
            let views = list(self.source, "bufferViews").iter().enumerate();
            views
                .filter(|(i, _)| free.views.contains(i) != is_kept)
                .flat_map(|(_, v)| spans(v))
                .collect::<Vec<_>>()
        };
        let mut repacked = Repacked::new(&scene.buffers, &spans_of(true), &spans_of(false));
        for view in list_mut(&mut self.json, "bufferViews") {
            move_view(view, &repacked);
        }
        let mut bytes = std::mem::take(&mut repacked.bytes);
        if !self.fresh.is_empty() {
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        let base = bytes.len();
        bytes.extend_from_slice(&self.fresh);

        // First those that take what they replace, then the others, so that no number goes to a stranger before its heir.
        let pieces = std::mem::take(&mut self.pieces);
        let mut accessors: Vec<Option<usize>> = Vec::with_capacity(pieces.len());
        for piece in &pieces {
            let heir = piece.old.filter(|_| !matches!(piece.data, Data::Shared(_)));
            accessors.push(heir.filter(|old| free.accessors.remove(old)));
        }
        let mut views: Vec<Vec<Option<usize>>> = Vec::with_capacity(pieces.len());
        for (piece, accessor) in pieces.iter().zip(&accessors) {
            let before = accessor.map_or(&Value::Null, |a| &self.source["accessors"][a]);
            let named = match &piece.data {
                Data::Nowhere | Data::Shared(_) => Vec::new(),
                Data::Dense(_) => vec![&before["bufferView"]],
                Data::Sparse(..) => {
                    ["indices", "values"].map(|k| &before["sparse"][k]["bufferView"]).to_vec()
                }
            };
            views.push(named.into_iter().map(|v| number(v).filter(|v| free.views.remove(v))).collect());
        }
        let mut placed = Vec::with_capacity(pieces.len());
        for ((piece, accessor), views) in pieces.into_iter().zip(accessors).zip(views) {
            let at = match piece.data {
                Data::Shared(twin) => placed[twin],
                _ => self.accessor(&piece, accessor, &views, base, &mut free),
            };
            placed.push(at);
            let Spot { mesh, primitive, part } = piece.spot;
            let primitive = &mut self.json["meshes"][mesh]["primitives"][primitive];
            match part {
                Part::Indices => primitive["indices"] = at.into(),
                Part::Attribute(key) => primitive["attributes"][key] = at.into(),
                Part::Target(target, key) => primitive["targets"][target][key] = at.into(),
            }
        }
        self.tidy();
        if is_changed {
            forget_extensions(&mut self.json);
        }
        renumber(&mut self.json);
        (self.json, bytes, self.warnings)
    }

    /// Empties the accessors and views that were let go and that nothing else names.
    fn free(&mut self) {
        let mut still = [HashSet::new(), HashSet::new()];
        each_reference(&mut self.json, &mut |named, value| {
            if let (Named::Accessor, Some(i)) = (named, number(value)) {
                still[0].insert(i);
            }
        });
        for &i in self.let_go.iter().filter(|i| !still[0].contains(*i)) {
            let Some(accessor) = list_mut(&mut self.json, "accessors").get_mut(i) else { continue };
            let mut taken = accessor.take();
            views_of(&mut taken, &mut |_, value| self.views_let_go.extend(number(value)));
        }
        each_reference(&mut self.json, &mut |named, value| {
            if let (Named::View, Some(i)) = (named, number(value)) {
                still[1].insert(i);
            }
        });
        for &i in self.views_let_go.iter().filter(|i| !still[1].contains(*i)) {
            if let Some(view) = list_mut(&mut self.json, "bufferViews").get_mut(i) {
                *view = Value::Null;
            }
        }
    }

    /// Makes an accessor of a piece, with its views; its number.
    fn accessor(
        &mut self,
        piece: &Piece,
        accessor: Option<usize>,
        views: &[Option<usize>],
        base: usize,
        free: &mut Free,
    ) -> usize {
        let source = accessor.and_then(|a| self.source["accessors"][a].as_object());
        let mut object = source.cloned().unwrap_or_default();
        let had_bounds = object.contains_key("min") || object.contains_key("max");
        ["byteOffset", "normalized", "min", "max", "sparse", "bufferView"].iter().for_each(|key| {
            // A null keeps the place of what is written again below.
            if let Some(value) = object.get_mut(*key) {
                *value = Value::Null;
            }
        });
        let mut stretches = match &piece.data {
            Data::Nowhere | Data::Shared(_) => Vec::new(),
            Data::Dense(one) => vec![one],
            Data::Sparse(_, _, two) => two.iter().collect(),
        };
        let mut numbers = Vec::new();
        for (stretch, old) in stretches.drain(..).zip(views) {
            numbers.push(self.place_view(stretch, *old, base, free));
        }
        match (&piece.data, numbers.as_slice()) {
            (Data::Dense(_), [view]) => {
                object.insert("bufferView".to_owned(), (*view).into());
            }
            (Data::Sparse(count, component, _), [indices, values]) => {
                let sparse = json!({
                    "count": count,
                    "indices": { "bufferView": indices, "componentType": component.code() },
                    "values": { "bufferView": values },
                });
                object.insert("sparse".to_owned(), sparse);
            }
            _ => {}
        }
        object.insert("componentType".to_owned(), piece.kind.component.code().into());
        if piece.kind.normalized {
            object.insert("normalized".to_owned(), true.into());
        }
        object.insert("count".to_owned(), piece.count.into());
        object.insert("type".to_owned(), TYPES[piece.width].into());
        let is_position = match &piece.spot.part {
            Part::Attribute(key) | Part::Target(_, key) => key == "POSITION",
            Part::Indices => false,
        };
        if had_bounds || is_position {
            object.insert("min".to_owned(), piece.min.clone().into());
            object.insert("max".to_owned(), piece.max.clone().into());
        }
        drop_nulls(&mut object);
        put(&mut self.json, "accessors", accessor.or_else(|| free.accessors.pop_first()), object)
    }

    fn place_view(&mut self, stretch: &Stretch, old: Option<usize>, base: usize, free: &mut Free) -> usize {
        let source = old.and_then(|v| self.source["bufferViews"][v].as_object());
        let mut view = Value::Object(source.cloned().unwrap_or_default());
        COMPRESSED.iter().for_each(|extension| drop(take_extension(&mut view, extension)));
        view["buffer"] = 0.into();
        view["byteOffset"] = (base + stretch.bytes.start).into();
        view["byteLength"] = stretch.bytes.len().into();
        for (key, value) in
            [("byteStride", stretch.stride.map(Value::from)), ("target", stretch.target.map(Value::from))]
        {
            view[key] = value.into();
        }
        let mut object = view.as_object().cloned().unwrap_or_default();
        drop_nulls(&mut object);
        put(&mut self.json, "bufferViews", old.or_else(|| free.views.pop_first()), object)
    }

    /// Takes away what is still empty: attributes, primitives, meshes.
    fn tidy(&mut self) {
        let mut emptied = BTreeSet::new();
        for (m, mesh) in list_mut(&mut self.json, "meshes").iter_mut().enumerate() {
            let Some(primitives) = mesh.get_mut("primitives").and_then(Value::as_array_mut) else { continue };
            let before = primitives.len();
            primitives.retain(|p| !p.is_null());
            if primitives.is_empty() && before > 0 {
                emptied.insert(m);
            }
            for primitive in primitives.iter_mut().filter_map(Value::as_object_mut) {
                if let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) {
                    drop_nulls(attributes);
                }
                let targets = primitive.get_mut("targets").and_then(Value::as_array_mut);
                targets.into_iter().flatten().filter_map(Value::as_object_mut).for_each(drop_nulls);
                if primitive.get("indices").is_some_and(Value::is_null) {
                    primitive.shift_remove("indices");
                }
            }
        }
        self.remove_skins();
        if !emptied.is_empty() {
            self.remove_meshes(&emptied);
        }
    }

    /// Takes the skin off nodes whose mesh has lost its joints.
    fn remove_skins(&mut self) {
        let has_joints =
            |mesh: &Value| list(mesh, "primitives").iter().any(|p| !p["attributes"]["JOINTS_0"].is_null());
        let meshes = list(self.source, "meshes").iter().zip(list(&self.json, "meshes"));
        let stiff: Vec<bool> = meshes.map(|(before, now)| has_joints(before) && !has_joints(now)).collect();
        for node in list_mut(&mut self.json, "nodes").iter_mut().filter_map(Value::as_object_mut) {
            let mesh = node.get("mesh").and_then(number);
            if mesh.is_some_and(|m| stiff.get(m) == Some(&true)) {
                node.shift_remove("skin");
            }
        }
    }

    /// Takes meshes without primitives away, and all that nodes and animations say of them.
    fn remove_meshes(&mut self, emptied: &BTreeSet<usize>) {
        for m in emptied {
            let text = format!("meshes[{m}] has no face any more: left out, and its nodes are empty");
            self.warnings.push(Warning::lost(text));
        }
        let mut bare = HashSet::new();
        for (n, node) in list_mut(&mut self.json, "nodes").iter_mut().enumerate() {
            let Some(mesh) = node.get("mesh").and_then(number) else { continue };
            if !emptied.contains(&mesh) {
                node["mesh"] = (mesh - emptied.range(..mesh).count()).into();
                continue;
            }
            bare.insert(n);
            take_extension(node, "EXT_mesh_gpu_instancing");
            if let Some(node) = node.as_object_mut() {
                ["mesh", "skin", "weights"].iter().for_each(|key| drop(node.shift_remove(*key)));
            }
        }
        // Nothing is left that such a channel could morph.
        let is_idle = |channel: &Value| {
            let target = &channel["target"];
            target["path"] == "weights" && number(&target["node"]).is_some_and(|n| bare.contains(&n))
        };
        for animation in list_mut(&mut self.json, "animations") {
            if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
                let before = channels.len();
                channels.retain(|c| !is_idle(c));
                if channels.is_empty() && before > 0 {
                    *animation = Value::Null;
                }
            }
        }
        for (name, is_gone) in [
            ("meshes", &(|i: usize, _: &Value| emptied.contains(&i)) as &dyn Fn(usize, &Value) -> bool),
            ("animations", &|_, v| v.is_null()),
        ] {
            retain(&mut self.json, name, is_gone);
        }
    }
}

/// A mesh that is being taken apart.
struct Task<'m> {
    index: usize,
    mesh: &'m TriMesh,
    /// Attributes that no primitive had.
    added: Vec<Slot>,
    /// What the mesh has, and how many values a wedge has.
    values: HashMap<Slot, (usize, &'m [f32])>,
    /// The vertex of the primitive for each wedge, while one is made.
    local: Vec<u32>,
    /// Attributes that the mesh does not have any more.
    lost: BTreeSet<String>,
    /// Normals and tangents without length.
    no_direction: usize,
}

impl Task<'_> {
    /// The values of some wedges, as glTF has them, and how many each has: the accessor's number before, or that of the
    /// mesh. `None` if the mesh does not have them.
    fn gather(&mut self, slot: &Slot, width: Option<usize>, used: &[WedgeId]) -> Option<(usize, Vec<f32>)> {
        if *slot == Slot::Position {
            let place = |w: &WedgeId| -> [f32; 3] {
                let VertexId(v) = self.mesh.vertex_of(*w);
                match self.mesh.positions() {
                    Positions::F32(p) => p[v as usize],
                    Positions::F64(p) => p[v as usize].map(|x| x as f32),
                }
            };
            return Some((3, used.iter().flat_map(place).collect()));
        }
        let &(own, values) = self.values.get(slot)?;
        let width = width.unwrap_or(own.min(4));
        let mut out = vec![0.0; used.len() * width];
        for (element, w) in out.chunks_exact_mut(width).zip(used) {
            element.iter_mut().zip(&values[w.index() * own..][..own]).for_each(|(to, from)| *to = *from);
        }
        match slot {
            // glTF counts from the upper left corner of the image.
            _ if slot.is_uv() => out.as_chunks_mut::<2>().0.iter_mut().for_each(|uv| uv[1] = 1.0 - uv[1]),
            Slot::Normal => self.no_direction += unit_directions(&mut out, width, [0.0, 0.0, 1.0]),
            Slot::Further(Semantic::Tangent) => {
                self.no_direction += unit_directions(&mut out, width, [1.0, 0.0, 0.0]);
                let side = |t: &mut [f32]| t[3] = if t[3] < 0.0 { -1.0 } else { 1.0 };
                out.chunks_exact_mut(4).for_each(side);
            }
            _ => {}
        }
        Some((width, out))
    }
}

/// The type that numbers are to have: that of the source, where the format has it for this attribute.
fn settled(slot: &Slot, source: Option<Kind>, values: &[f32]) -> Kind {
    let component = source.map_or(Component::F32, |k| k.component);
    match slot {
        Slot::Further(Semantic::Joints(_)) => {
            let is_small = component == Component::U8 && values.iter().all(|&x| x <= 255.0);
            Kind { component: if is_small { Component::U8 } else { Component::U16 }, normalized: false }
        }
        _ if slot.is_part_of_one() => Kind { component, normalized: component != Component::F32 },
        _ => source.unwrap_or(Kind::FLOAT),
    }
}

/// Numbers of accessors and views that may be taken.
struct Free {
    accessors: BTreeSet<usize>,
    views: BTreeSet<usize>,
}

/// Puts an entry at a place of a list, or behind all.
fn put(json: &mut Value, name: &str, at: Option<usize>, entry: Map<String, Value>) -> usize {
    if !json[name].is_array() {
        json[name] = json!([]);
    }
    let Some(all) = json[name].as_array_mut() else { return 0 };
    let at = at.unwrap_or(all.len());
    if at == all.len() {
        all.push(Value::Null);
    }
    all[at] = entry.into();
    at
}

fn drop_nulls(object: &mut Map<String, Value>) {
    object.retain(|_, value| !value.is_null());
}

/// Takes an extension off an element, and the map of extensions if it was the last.
fn take_extension(element: &mut Value, name: &str) -> Option<Value> {
    let extensions = element.get_mut("extensions")?.as_object_mut()?;
    let taken = extensions.shift_remove(name)?;
    if extensions.is_empty() {
        element.as_object_mut()?.shift_remove("extensions");
    }
    Some(taken)
}

/// The bytes that a view names, compressed ones too.
fn spans(view: &Value) -> Vec<Span> {
    let compressed = COMPRESSED.iter().map(|e| &view["extensions"][e]);
    let span = |v: &Value| {
        let start = number(&v["byteOffset"]).unwrap_or(0);
        let end = start.saturating_add(number(&v["byteLength"])?);
        Some(Span { buffer: number(&v["buffer"])?, bytes: start..end })
    };
    compressed.chain([view]).filter_map(span).collect()
}

/// Says where the bytes of a view are now.
fn move_view(view: &mut Value, repacked: &Repacked) {
    let new_place = |v: &mut Value| {
        let offset = number(&v["byteOffset"]).unwrap_or(0);
        let Some(place) = number(&v["buffer"]).and_then(|b| repacked.place(b, offset)) else { return };
        v["buffer"] = 0.into();
        if place != offset {
            v["byteOffset"] = place.into();
        }
    };
    if view.is_null() {
        return;
    }
    for extension in COMPRESSED {
        if let Some(inner) = view.get_mut("extensions").and_then(|e| e.get_mut(extension)) {
            new_place(inner);
        }
    }
    new_place(view);
}

/// Takes extensions that nothing uses any more off the lists of the file.
fn forget_extensions(json: &mut Value) {
    let gone: Vec<&str> =
        OF_VERTICES.into_iter().chain(COMPRESSED).filter(|e| !has_extension(json, e)).collect();
    for name in ["extensionsUsed", "extensionsRequired"] {
        retain(json, name, &|_, e| e.as_str().is_some_and(|e| gone.contains(&e)));
    }
}

/// Keeps the entries of a list that are not gone; a list that becomes empty goes too.
fn retain(json: &mut Value, name: &str, is_gone: &dyn Fn(usize, &Value) -> bool) {
    let Some(all) = json.get_mut(name).and_then(Value::as_array_mut) else { return };
    let before = all.len();
    let mut index = 0;
    all.retain(|v| {
        index += 1;
        !is_gone(index - 1, v)
    });
    if all.is_empty()
        && before > 0
        && let Some(root) = json.as_object_mut()
    {
        root.shift_remove(name);
    }
}

/// Takes accessors and views that are still free out of their lists, and gives the others their new numbers.
fn renumber(json: &mut Value) {
    let ranks = |json: &Value, name: &str| {
        let mut next = 0;
        let rank = |v: &Value| {
            next += usize::from(!v.is_null());
            next - usize::from(!v.is_null())
        };
        list(json, name).iter().map(rank).collect::<Vec<usize>>()
    };
    let [accessors, views] = ["accessors", "bufferViews"].map(|name| ranks(json, name));
    let moves = |ranks: &[usize]| ranks.iter().enumerate().any(|(i, r)| i != *r);
    if moves(&accessors) || moves(&views) {
        each_reference(json, &mut |named, value| {
            let ranks = if named == Named::Accessor { &accessors } else { &views };
            if let Some(&rank) = number(value).and_then(|i| ranks.get(i)) {
                *value = rank.into();
            }
        });
    }
    retain(json, "accessors", &|_, v| v.is_null());
    retain(json, "bufferViews", &|_, v| v.is_null());
}
