//! Decoder of primitives whose vertices and triangles are a Draco stream.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::Arc;

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use serde_json::{Map, Value, json};

use super::super::accessors::{AccessorShape, Component};
use super::super::buffers::Buffers;
use super::super::compressed::DRACO;
use super::super::container::{entry, list, list_mut, number, whole};
use super::super::encode::{EncodedAccessor, NumberType, encode, normalize_weights};
use super::super::extension_losses::ExtensionLosses;
use super::super::lists::{append, put, take_extension, view_span};
use super::super::mesh::TYPE_NAMES;
use super::super::references::{ReferenceKind, each_reference, views_of};
use super::super::renumber::Renumbering;
use super::decoded::{DecodeBudget, DecodedBytes};
use crate::error::ReadError;

/// Targets of views.
const VERTEX_TARGET: u32 = 34962;
const INDEX_TARGET: u32 = 34963;

/// A compressed primitive.
struct DracoPrimitive {
    mesh: usize,
    primitive: usize,
    /// For messages.
    name: String,
    view: usize,
    /// Attributes in the stream: their names, accessors and ids in the stream.
    attributes: Vec<(String, usize, u32)>,
    indices: Option<usize>,
}

/// A part of the stream of a view: the indices, or the attribute with this id.
type StreamPart = (usize, Option<u32>);

/// Decodes all compressed primitives.
pub(super) fn unpack(
    json: &mut Value,
    buffers: &mut Vec<Arc<Vec<u8>>>,
    room: &mut DecodeBudget,
    losses: &mut ExtensionLosses,
) -> Result<(), ReadError> {
    let mut jobs = Vec::new();
    for (m, mesh) in list(json, "meshes").iter().enumerate() {
        for (p, primitive) in list(mesh, "primitives").iter().enumerate() {
            if !primitive["extensions"][DRACO].is_null() {
                jobs.push(DracoPrimitive::new(primitive, (m, p))?);
            }
        }
    }
    if jobs.is_empty() {
        return Ok(());
    }
    // Primitives that share a stream become neighbours.
    jobs.sort_by_key(|job| job.view);

    let mut out = DracoOutput::new(json, &jobs);
    let mut latest: Option<(usize, Mesh)> = None;
    for job in &jobs {
        let mesh = match latest.take() {
            Some((view, mesh)) if view == job.view => mesh,
            _ => decode(json, buffers, job, room)?,
        };
        out.add(json, job, &mesh, room)?;
        latest = Some((job.view, mesh));
    }
    out.finish(json, buffers, losses);
    Ok(())
}

impl DracoPrimitive {
    fn new(primitive: &Value, (mesh, at): (usize, usize)) -> Result<Self, ReadError> {
        let name = format!("meshes[{mesh}].primitives[{at}]");
        let extension = &primitive["extensions"][DRACO];
        let mode = whole(primitive, "mode", &name)?.unwrap_or(4);
        if mode != 4 && mode != 5 {
            let problem = format!("the mode is {mode}; {DRACO} is for triangles (4) and strips (5)");
            return Err(ReadError::element(name, problem));
        }
        let Some(view) = whole(extension, "bufferView", &name)? else {
            return Err(ReadError::element(name, format!("{DRACO} has no bufferView")));
        };
        let mut attributes = Vec::new();
        for (key, _) in primitive["attributes"].as_object().into_iter().flatten() {
            let id = whole(&extension["attributes"], key, &name)?.map(u32::try_from);
            if let (Some(Ok(id)), Some(accessor)) = (id, whole(&primitive["attributes"], key, &name)?) {
                attributes.push((key.clone(), accessor, id));
            }
        }
        let indices = whole(primitive, "indices", &name)?;
        Ok(Self { mesh, primitive: at, name, view, attributes, indices })
    }
}

/// Decodes the mesh of a stream, within the limit on decoded bytes.
fn decode(
    json: &Value,
    buffers: &[Arc<Vec<u8>>],
    job: &DracoPrimitive,
    room: &DecodeBudget,
) -> Result<Mesh, ReadError> {
    let opened = Buffers::loaded(json, buffers, 0);
    let view = opened.view(job.view, &job.name)?;
    let limits = DecodeLimits::default()
        .with_max_faces(room.left() / 12)
        .with_max_points(room.left() / 4)
        .with_max_decoded_bytes(room.left());
    let mut mesh = Mesh::new();
    let mut stream = DecoderBuffer::new(view.bytes).with_limits(limits);
    MeshDecoder::new()
        .decode(&mut stream, &mut mesh)
        .map_err(|e| ReadError::element(view.name, format!("its Draco stream cannot be decoded: {e}")))?;
    Ok(mesh)
}

/// State of the conversion to uncompressed geometry.
struct DracoOutput {
    fresh: DecodedBytes,
    /// The new accessor, by part and source accessor.
    known: HashMap<(StreamPart, usize), usize>,
    /// Accessors whose indices parts have reused, and accessors that something else refers to.
    taken: HashSet<usize>,
    plain: HashSet<usize>,
    /// Views that may have become unused.
    loose: BTreeSet<usize>,
}

impl DracoOutput {
    fn new(json: &Value, jobs: &[DracoPrimitive]) -> Self {
        let mut others = json.clone();
        for job in jobs {
            let primitive = &mut others["meshes"][job.mesh]["primitives"][job.primitive];
            primitive["indices"] = Value::Null;
            for (key, ..) in &job.attributes {
                primitive["attributes"][key] = Value::Null;
            }
        }
        let mut plain = HashSet::new();
        each_reference(&mut others, &mut |named, value| {
            if named == ReferenceKind::Accessor {
                plain.extend(number(value));
            }
        });
        let loose = jobs.iter().map(|job| job.view).collect();
        Self { fresh: DecodedBytes::default(), known: HashMap::new(), taken: HashSet::new(), plain, loose }
    }

    /// Creates the accessors of a primitive from its stream.
    fn add(
        &mut self,
        json: &mut Value,
        job: &DracoPrimitive,
        mesh: &Mesh,
        room: &mut DecodeBudget,
    ) -> Result<(), ReadError> {
        let vertices = mesh.num_points();
        let mut weights = weights(json, job, mesh);
        for (key, accessor, id) in &job.attributes {
            let part = (job.view, Some(*id));
            let at = match self.known.get(&(part, *accessor)) {
                Some(at) => *at,
                None => {
                    let (source, name) = entry(json, "accessors", *accessor, &job.name)?;
                    let shape = AccessorShape::new(source, &name)?;
                    // A stream splits vertices at seams, so there may be more than the accessor claims.
                    if shape.count > vertices {
                        let problem = format!(
                            "claims {} elements, but the Draco stream of {} has {vertices} vertices",
                            shape.count, job.name
                        );
                        return Err(ReadError::element(name, problem));
                    }
                    let Some(attribute) = mesh.attribute_by_unique_id(*id) else {
                        let problem = format!(
                            "{key} refers to attribute {id} of the Draco stream, which does not exist"
                        );
                        return Err(ReadError::element(job.name.as_str(), problem));
                    };
                    let width = usize::from(attribute.num_components());
                    if width != shape.width {
                        let type_name = TYPE_NAMES[shape.width];
                        let problem =
                            format!("is of type {type_name}, but the Draco stream has {width} numbers");
                        return Err(ReadError::element(name, problem));
                    }
                    room.take((vertices as u64).saturating_mul(width as u64 * 4))?;
                    let kind = NumberType { component: shape.kind, normalized: false };
                    let settled = weights.remove(key);
                    let values = settled.unwrap_or_else(|| attribute.read_f32s(vertices, width));
                    let encoded = encode(&values, width, kind, true);
                    let tight = shape.kind.size() * width;
                    let stride = (encoded.stride != tight).then_some(encoded.stride);
                    let view =
                        json!({ "buffer": 0, "byteLength": encoded.bytes.len(), "target": VERTEX_TARGET });
                    self.accessor(json, (part, *accessor), view, stride, encoded, vertices)
                }
            };
            json["meshes"][job.mesh]["primitives"][job.primitive]["attributes"][key] = at.into();
        }
        let at = self.indices(json, job, mesh, room)?;
        let primitive = &mut json["meshes"][job.mesh]["primitives"][job.primitive];
        primitive["indices"] = at.into();
        // Strips are triangles in the stream.
        if !primitive["mode"].is_null() {
            primitive["mode"] = 4.into();
        }
        take_extension(primitive, DRACO);
        Ok(())
    }

    fn indices(
        &mut self,
        json: &mut Value,
        job: &DracoPrimitive,
        mesh: &Mesh,
        room: &mut DecodeBudget,
    ) -> Result<usize, ReadError> {
        let part = (job.view, None);
        let accessor = match job.indices {
            Some(accessor) => accessor,
            None => {
                let plain = json!({ "componentType": Component::U32.code(), "count": 0, "type": "SCALAR" });
                append(json, "accessors", plain)
            }
        };
        if let Some(at) = self.known.get(&(part, accessor)) {
            return Ok(*at);
        }
        let (source, name) = entry(json, "accessors", accessor, &job.name)?;
        let shape = AccessorShape::new(source, &name)?;
        room.take((mesh.num_faces() as u64).saturating_mul(12))?;
        let corners: Vec<u32> = mesh.faces().iter().flatten().map(|point| point.0).collect();
        let most = corners.iter().max().copied().unwrap_or(0);
        let component = match shape.kind {
            // The largest value of a type is not allowed as an index.
            Component::U8 if most < u8::MAX.into() => Component::U8,
            Component::U8 | Component::U16 if most < u16::MAX.into() => Component::U16,
            _ => Component::U32,
        };
        let size = component.size();
        let bytes: Vec<u8> = corners.iter().flat_map(|i| i.to_le_bytes().into_iter().take(size)).collect();
        let bound = |x: Option<&u32>| vec![x.copied().unwrap_or(0).into()];
        let (min, max) = (bound(corners.iter().min()), bound(corners.iter().max()));
        let kind = NumberType { component, normalized: false };
        let encoded = EncodedAccessor { kind, width: 1, stride: size, bytes, min, max };
        let view = json!({ "buffer": 0, "byteLength": encoded.bytes.len(), "target": INDEX_TARGET });
        Ok(self.accessor(json, (part, accessor), view, None, encoded, corners.len()))
    }

    /// Replaces an accessor with a part, or appends one if others need the old one unchanged; returns its
    /// index.
    fn accessor(
        &mut self,
        json: &mut Value,
        (part, accessor): (StreamPart, usize),
        mut view: Value,
        stride: Option<usize>,
        encoded: EncodedAccessor,
        count: usize,
    ) -> usize {
        if let Some(stride) = stride {
            view["byteStride"] = stride.into();
        }
        let view = append(json, "bufferViews", view);
        self.fresh.push(view, &encoded.bytes);
        let is_free = !self.plain.contains(&accessor) && self.taken.insert(accessor);
        let mut object = list(json, "accessors")[accessor].as_object().cloned().unwrap_or_default();
        if is_free {
            let mut old = Value::Object(object.clone());
            views_of(&mut old, &mut |_, value| self.loose.extend(number(value)));
        }
        fill(&mut object, view, encoded, count);
        let at = put(json, "accessors", is_free.then_some(accessor), object);
        self.known.insert((part, accessor), at);
        at
    }

    /// Removes the streams, and views that only readers without the extension need.
    fn finish(mut self, json: &mut Value, buffers: &mut Vec<Arc<Vec<u8>>>, losses: &mut ExtensionLosses) {
        let mut named = BTreeSet::new();
        each_reference(json, &mut |kind, value| {
            if kind == ReferenceKind::View {
                named.extend(number(value));
            }
        });
        for &i in self.loose.difference(&named) {
            if let Some(view) = list_mut(json, "bufferViews").get_mut(i) {
                self.fresh.freed.extend(view_span(view));
                *view = Value::Null;
            }
        }
        self.fresh.finish(json, buffers);
        let mut changes = Renumbering::default();
        changes.remove_nulls(json);
        changes.apply(json, losses);
    }
}

/// Returns the float weights of a primitive, rescaled to the sum one, since the stream has rounded them.
fn weights(json: &Value, job: &DracoPrimitive, mesh: &Mesh) -> HashMap<String, Vec<f32>> {
    let (mut keys, mut sets) = (Vec::new(), Vec::new());
    for (key, accessor, id) in &job.attributes {
        let is_float = json["accessors"][*accessor]["componentType"] == Component::F32.code();
        let attribute = mesh.attribute_by_unique_id(*id).filter(|a| a.num_components() == 4);
        if let Some(attribute) = attribute.filter(|_| is_float && key.starts_with("WEIGHTS_")) {
            keys.push(key.clone());
            sets.push(attribute.read_f32s(mesh.num_points(), 4));
        }
    }
    normalize_weights(&mut sets, None);
    keys.into_iter().zip(sets).collect()
}

/// Updates the properties of an accessor for its new bytes.
fn fill(object: &mut Map<String, Value>, view: usize, encoded: EncodedAccessor, count: usize) {
    let EncodedAccessor { kind, min, max, .. } = encoded;
    ["byteOffset", "sparse"].iter().for_each(|key| drop(object.shift_remove(*key)));
    object.insert("bufferView".to_owned(), view.into());
    object.insert("componentType".to_owned(), kind.component.code().into());
    object.insert("count".to_owned(), count.into());
    if object.contains_key("min") || object.contains_key("max") {
        object.insert("min".to_owned(), min.into());
        object.insert("max".to_owned(), max.into());
    }
}
