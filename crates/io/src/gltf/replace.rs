//! Construction of the file of a scene with some meshes replaced.
//!
//! ```text
//! for each replaced mesh:  its primitives release their accessors; the new data become pieces
//! free = released, and not referred to by anything else
//! cut out the bytes of free views; append the bytes of the pieces
//! a piece takes the indices of the accessor and view that it replaces, if they are free; else other free ones; else new
//! accessors and views that are still free are removed, and all references are renumbered
//! ```

mod edit;
mod finish;
mod pieces;
mod tidy;

use std::collections::{BTreeSet, HashMap, HashSet};
use std::io;
use std::sync::Arc;

use lodsmith_core::mesh::{IntegerType, Semantic};
use lodsmith_core::{Positions, TriMesh, VertexId, WedgeId};
use serde_json::{Map, Value, json};

use super::accessors::Component;
use super::container::{FileParts, list, number};
use super::encode::{NumberType, encode, normalize_weights, unit_directions};
use super::external_files::relink;
use super::features;
use super::lists::{QUANTIZATION, needs_quantization, set_extension};
use super::mesh::TYPE_NAMES;
use super::pack::{Compression, SceneFormat};
use super::primitive::Primitive;
use super::references::{METADATA, ReferenceKind, known};
use super::slot::Slot;
use edit::{AccessorRole, Edit, Spot, VERTEX_TARGET};

use crate::attributes::rounding_warning;
use crate::error::Warning;
use crate::format::Format;

/// Makes the file, which [`pack::write`](super::pack::write) packs if the format requests it. `was_compressed` says
/// whether the buffers were decoded from compressed streams.
pub(super) fn parts(
    (source, buffers, was_compressed): (&Value, &[Arc<Vec<u8>>], bool),
    replaced: &[Option<TriMesh>],
    SceneFormat { format, packing, .. }: SceneFormat,
    new_uri: &dyn Fn(&str) -> Option<String>,
) -> io::Result<FileParts> {
    if !matches!(format, Format::Gltf | Format::Glb) {
        return Err(invalid(format!("a scene is written as glTF or GLB, not as {}", format.title())));
    }
    let mut edit = Edit::new(source);
    for (i, mesh) in replaced.iter().enumerate() {
        if let Some(mesh) = mesh {
            edit.replace(i, mesh)?;
        }
    }
    let (mut json, bytes, mut warnings) = edit.finish(buffers);
    relink(&mut json, 0, new_uri);
    set_buffer(&mut json, &bytes, format == Format::Glb);
    if was_compressed && packing.compression == Compression::None {
        let text = "the input was compressed, and the output is not: --compress meshopt keeps it small";
        warnings.push(Warning::note(text));
    }
    let is_listed = list(source, "extensionsUsed").iter().any(|e| e == QUANTIZATION);
    if is_listed && !needs_quantization(&json) {
        set_extension(&mut json, QUANTIZATION, false);
        if !packing.quantize {
            let text = "the input was quantized, and the output has floats: --quantize keeps it small";
            warnings.push(Warning::note(text));
        }
    }
    Ok(FileParts { json, bytes, warnings })
}

fn invalid(problem: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, problem)
}

/// Makes `bytes` the only buffer of the file.
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
    }
}

impl Edit<'_> {
    /// Replaces a mesh.
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
                    "face {i} of {name} has region {region}, which is not a primitive with triangles"
                )));
            };
            list.push(triangle);
        }
        self.warnings.extend(rounding_warning(mesh, "glTF", None));

        let held: HashSet<Slot> = primitives
            .iter()
            .filter(|p| has_faces(p))
            .flat_map(|p| p["attributes"].as_object().into_iter().flat_map(|a| a.keys()))
            .map(|key| Slot::of(None, key))
            .collect();
        let added: Vec<Slot> = Slot::all_of(mesh).into_iter().filter(|s| !held.contains(s)).collect();
        let mut task = Replacement {
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
        self.leave_out_ordered(index, None);
        self.changes.change([index]);
        for (p, faces) in faces.into_iter().enumerate() {
            let Some(faces) = faces else { continue };
            self.release(index, p);
            if faces.is_empty() {
                self.json["meshes"][index]["primitives"][p] = Value::Null;
                self.emptied.push(format!("{name}.primitives[{p}]"));
                continue;
            }
            self.primitive(&mut task, p, &primitives[p], &faces);
        }
        if !task.lost.is_empty() {
            let lost: Vec<String> = task.lost.into_iter().collect();
            self.warnings.push(Warning::lost(format!("{name} no longer has its {}", lost.join(", "))));
        }
        if task.no_direction > 0 {
            let text =
                format!("{name}: {} normals or tangents have length zero: replaced", task.no_direction);
            self.warnings.push(Warning::note(text));
        }
        Ok(())
    }

    /// Releases the accessors of a primitive: references become null until a piece replaces them.
    fn release(&mut self, mesh: usize, primitive: usize) {
        let Self { json, released, .. } = self;
        let element = &mut json["meshes"][mesh]["primitives"][primitive];
        let mut empty = |value: &mut Value| {
            released.extend(number(value));
            *value = Value::Null;
        };
        if let Some(indices) = element.get_mut("indices") {
            empty(indices);
        }
        if let Some(attributes) = element.get_mut("attributes").and_then(Value::as_object_mut) {
            attributes.values_mut().for_each(&mut empty);
        }
        let targets = element.get_mut("targets").and_then(Value::as_array_mut).into_iter().flatten();
        for target in targets.filter_map(Value::as_object_mut) {
            target.values_mut().for_each(&mut empty);
        }
        if let Some(mode) = element.get_mut("mode") {
            *mode = 4.into();
        }
        self.leave_out_ordered(mesh, Some(primitive));
    }

    /// Removes extensions of a mesh or one of its primitives that depend on vertices, and releases their accessors.
    fn leave_out_ordered(&mut self, mesh: usize, primitive: Option<usize>) {
        let Self { json, released, losses, .. } = self;
        let mesh = &mut json["meshes"][mesh];
        let (element, host) = match primitive {
            Some(primitive) => (&mut mesh["primitives"][primitive], "primitives"),
            None => (mesh, "meshes"),
        };
        for (name, mut content) in features::take_ordered(element, losses) {
            let Some(known) = known(&name) else { continue };
            known.visit(host, &mut content, &mut 0, &mut |kind, value| {
                released.extend(number(value).filter(|_| kind == ReferenceKind::Accessor));
                true
            });
        }
    }

    /// Makes the pieces of a primitive.
    fn primitive(&mut self, task: &mut Replacement<'_>, p: usize, source: &Value, faces: &[[WedgeId; 3]]) {
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

        let at = |part: AccessorRole| Spot { mesh, primitive: p, part };
        let no_attributes = Map::new();
        let attributes = source["attributes"].as_object().unwrap_or(&no_attributes);
        let first = self.pieces.len();
        let weights = self.weights(task, attributes, &used);
        for (key, old) in attributes {
            let slot = Slot::of(None, key);
            let kind = self.kind_of(old);
            let is_forced = slot.is_normalized() || matches!(slot, Slot::Further(Semantic::Joints(_)));
            let gathered = match weights.get(key) {
                Some(values) => Some((4, values.clone())),
                None => task.gather(&slot, self.width_of(old), &used),
            };
            let Some((width, values)) = gathered else {
                task.lost.insert(key.clone());
                continue;
            };
            let kind = output_type(&slot, kind, &values);
            let encoded = encode(&values, width, kind, is_forced);
            self.dense(at(AccessorRole::Attribute(key.clone())), number(old), encoded, Some(VERTEX_TARGET));
        }
        for slot in task.added.clone() {
            let Some(name) = slot.name() else { continue };
            let Some((width, values)) = task.gather(&slot, None, &used) else { continue };
            let integer = slot.integer(task.mesh).and_then(|of| fitting_type(of, &values));
            let kind = output_type(&slot, integer, &values);
            let encoded = encode(&values, width, kind, matches!(slot, Slot::Further(Semantic::Joints(_))));
            self.dense(at(AccessorRole::Attribute(name)), None, encoded, Some(VERTEX_TARGET));
        }
        // A target can only move attributes that the primitive has.
        let names: HashSet<String> = self.pieces[first..].iter().filter_map(|p| p.spot.attribute()).collect();
        let metadata = &self.source["extensions"][METADATA];
        let edited = &mut self.json["meshes"][mesh]["primitives"][p];
        features::keep_carried(edited, metadata, &names, &mut self.losses);
        for (t, target) in list(source, "targets").iter().enumerate() {
            let before = self.pieces.len();
            for (key, old) in target.as_object().into_iter().flatten() {
                let slot = Slot::of(Some(t), key);
                let width = self.width_of(old);
                let spot = at(AccessorRole::Target(t, key.clone()));
                let gathered = task.gather(&slot, width, &used).filter(|_| names.contains(key));
                if let Some((width, values)) = gathered {
                    let kind = output_type(&slot, self.kind_of(old), &values);
                    let encoded = encode(&values, width, kind, false);
                    self.target(spot, number(old), encoded, &values);
                } else {
                    task.lost.insert(format!("targets[{t}].{key}"));
                }
            }
            if self.pieces.len() == before {
                // All primitives need the same number of targets, and animations rely on it: this one moves
                // nothing.
                let encoded = encode(&vec![0.0; 3 * used.len()], 3, NumberType::FLOAT, false);
                let old = number(&target["POSITION"]);
                self.zeros(at(AccessorRole::Target(t, "POSITION".to_owned())), old, encoded, used.len());
            }
        }
        let indices: Vec<u32> = faces.as_flattened().iter().map(|w| task.local[w.index()]).collect();
        let in_order = source["indices"].is_null() && indices.iter().enumerate().all(|(i, &v)| i as u32 == v);
        if !in_order {
            self.indices(at(AccessorRole::Indices), number(&source["indices"]), &indices, used.len());
        }
        used.iter().for_each(|w| task.local[w.index()] = u32::MAX);
    }

    /// Returns the weights of a primitive, all sets; empty if the mesh lacks one.
    fn weights(
        &self,
        task: &mut Replacement<'_>,
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
        // With two integer types, the values of the shorter are exact in the longer.
        let one = ones.into_iter().flatten().fold(None, |a: Option<f32>, b| Some(a.map_or(b, |a| a.min(b))));
        normalize_weights(&mut sets, one);
        keys.into_iter().zip(sets).collect()
    }

    /// Returns the type of an accessor's numbers.
    fn kind_of(&self, accessor: &Value) -> Option<NumberType> {
        let accessor = list(self.source, "accessors").get(number(accessor)?)?;
        let component = Component::from_code(number(&accessor["componentType"])?)?;
        Some(NumberType { component, normalized: accessor["normalized"].as_bool().unwrap_or(false) })
    }

    fn width_of(&self, accessor: &Value) -> Option<usize> {
        let accessor = list(self.source, "accessors").get(number(accessor)?)?;
        let kind = accessor["type"].as_str()?;
        TYPE_NAMES.iter().position(|t| *t == kind).filter(|&n| n > 0)
    }
}

/// State of the replacement of one mesh.
struct Replacement<'m> {
    index: usize,
    mesh: &'m TriMesh,
    /// Attributes that no primitive had.
    added: Vec<Slot>,
    /// Attributes of the mesh, each with its number of components.
    values: HashMap<Slot, (usize, &'m [f32])>,
    /// For each wedge, its vertex in the current primitive.
    local: Vec<u32>,
    /// Attributes that the mesh no longer has.
    lost: BTreeSet<String>,
    /// Number of normals and tangents without length.
    no_direction: usize,
}

impl Replacement<'_> {
    /// Returns the number of components and the values of some wedges, in glTF conventions. The number is
    /// `width`, from the previous accessor, or else that of the mesh. `None` if the mesh lacks the attribute.
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
            // In glTF, texture coordinates start at the upper left corner of the image.
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

/// Returns the type for integers of a mesh: their own type or, as glTF has no 32-bit integer attributes, the
/// first type that holds the values.
fn fitting_type(of: IntegerType, values: &[f32]) -> Option<NumberType> {
    let all = [Component::U8, Component::I8, Component::U16, Component::I16];
    let is_own = |c: &Component| c.integer() == Some(of);
    let holds = |c: &Component| c.integer().is_some_and(|of| values.iter().all(|&x| of.holds(x)));
    let component = all.into_iter().find(is_own).or_else(|| all.into_iter().find(holds))?;
    Some(NumberType { component, normalized: false })
}

/// Returns the type to write: the type of the source, if glTF allows it for this attribute.
fn output_type(slot: &Slot, source: Option<NumberType>, values: &[f32]) -> NumberType {
    let component = source.map_or(Component::F32, |k| k.component);
    match slot {
        Slot::Further(Semantic::Joints(_)) => {
            let is_small = component == Component::U8 && values.iter().all(|&x| x <= 255.0);
            NumberType { component: if is_small { Component::U8 } else { Component::U16 }, normalized: false }
        }
        _ if slot.is_normalized() => NumberType { component, normalized: component != Component::F32 },
        _ => source.unwrap_or(NumberType::FLOAT),
    }
}
