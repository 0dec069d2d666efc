//! The vertices and indices of one primitive, rounded and reordered.

use std::collections::HashMap;

use serde_json::Value;

use super::super::accessors::{Accessor, Component};
use super::super::buffers::Buffers;
use super::super::container::{list, number};
use super::super::encode::{NumberType, normalize_weights};
use super::super::meshopt::Filter;
use super::super::primitive::Primitive;
use super::options::{Compression, PackReport, Packing, QuantizationErrors};
use super::quantize::{Grid, Rounding, unchanged};
use super::streams::{PackedStream, StreamKind};
use crate::error::ReadError;
use crate::vertex_cache::{CacheUse, OrderFor, fetch_order, ordered};

/// Location of a reference of a primitive: the morph target, if any, and the name of the attribute.
pub(super) type AttributePlace = (Option<usize>, String);

/// Data of a primitive.
pub(super) struct PackedGeometry {
    /// Each stream with its source accessor.
    pub(super) streams: Vec<(AttributePlace, usize, PackedStream)>,
    pub(super) indices: Option<PackedStream>,
    /// The accessor of the indices.
    pub(super) index_source: Option<usize>,
    /// True if it consists of triangles now, whatever it was before.
    pub(super) has_faces: bool,
    /// True if the vertices have their old order.
    pub(super) keeps_order: bool,
    pub(super) report: PackReport,
}

/// A primitive, and how it is packed.
#[derive(Clone, Copy)]
pub(super) struct GeometryTask<'p> {
    pub(super) primitive: &'p Value,
    pub(super) grid: Option<Grid>,
    /// False if an extension may depend on the order of the vertices.
    pub(super) may_reorder: bool,
    pub(super) packing: Packing,
}

impl GeometryTask<'_> {
    /// Reads the primitive, rounds its attributes, and puts its triangles and vertices into an order for the
    /// caches; equal vertices become one.
    pub(super) fn run(
        &self,
        json: &Value,
        buffers: &Buffers<'_>,
        name: &str,
    ) -> Result<PackedGeometry, ReadError> {
        let mut rounding =
            Rounding { compression: self.packing.compression, errors: QuantizationErrors::default() };
        let mut streams = Vec::new();
        let attributes = self.primitive["attributes"].as_object().into_iter().flatten();
        let places = attributes.map(|(key, a)| ((None, key.clone()), a));
        let of_targets = list(self.primitive, "targets").iter().enumerate().flat_map(|(t, target)| {
            let all = target.as_object().into_iter().flatten();
            all.map(move |(key, a)| ((Some(t), key.clone()), a))
        });
        let weights = self.weights(json, buffers, name, &mut rounding)?;
        for (place, accessor) in places.chain(of_targets) {
            let Some(source) = number(accessor) else { continue };
            let stream = match weights.get(&place.1).filter(|_| place.0.is_none()) {
                Some(stream) => stream.clone(),
                None => self.stream(json, buffers, (&place, source), name, &mut rounding)?,
            };
            streams.push((place, source, stream));
        }
        let count = streams.first().map_or(0, |(_, _, stream)| stream.count());
        if let Some((place, _, stream)) = streams.iter().find(|(_, _, s)| s.count() != count) {
            let problem = format!("{} has {} elements, others have {count}", place.1, stream.count());
            return Err(ReadError::element(name, problem));
        }
        let mut made = PackedGeometry {
            streams,
            indices: None,
            index_source: number(&self.primitive["indices"]),
            has_faces: Primitive::has_faces(self.primitive, name)?,
            keeps_order: true,
            report: PackReport::default(),
        };
        if made.has_faces && self.may_reorder {
            let primitive = Primitive::new(json, buffers, self.primitive, name.to_owned(), count)?;
            let (triangles, _) = primitive.triangles(json, buffers, count)?;
            made.reorder(&triangles, count, self.packing.compression);
            made.keeps_order = false;
        } else {
            made.has_faces &= number(&self.primitive["mode"]).is_none_or(|mode| mode == 4);
            if let Some(source) = made.index_source {
                let indices = Accessor::new(json, buffers, source, name)?.indices()?;
                let is_whole = indices.len().is_multiple_of(3);
                made.indices = Some(index_stream(&indices, made.has_faces && is_whole));
            }
        }
        made.report.errors = Some(rounding.errors).filter(|_| self.packing.quantize);
        Ok(made)
    }

    /// Reads an attribute, and rounds it.
    fn stream(
        &self,
        json: &Value,
        buffers: &Buffers<'_>,
        ((target, key), source): (&AttributePlace, usize),
        name: &str,
        rounding: &mut Rounding,
    ) -> Result<PackedStream, ReadError> {
        let accessor = Accessor::new(json, buffers, source, name)?;
        let kind = StreamKind::Attribute { name: key.clone(), is_target: target.is_some() };
        if self.packing.quantize
            && let Some(stream) = rounding.attribute(&kind, &accessor, self.grid)?
        {
            return Ok(stream);
        }
        let has_bounds = !json["accessors"][source]["min"].is_null() && accessor.kind != Component::U32;
        let stream = unchanged(kind, &accessor, has_bounds || key == "POSITION")?;
        Ok(if key.starts_with("JOINTS_") { with_bytes(stream) } else { stream })
    }

    /// Rounds the weights of all sets of joints together; empty if they are not to be rounded.
    fn weights(
        &self,
        json: &Value,
        buffers: &Buffers<'_>,
        name: &str,
        rounding: &mut Rounding,
    ) -> Result<HashMap<String, PackedStream>, ReadError> {
        let (mut keys, mut exact) = (Vec::new(), Vec::new());
        let attributes = self.primitive["attributes"].as_object().into_iter().flatten();
        for (key, source) in
            attributes.filter(|(key, _)| self.packing.quantize && key.starts_with("WEIGHTS_"))
        {
            let Some(source) = number(source) else { continue };
            let accessor = Accessor::new(json, buffers, source, name)?;
            if accessor.width == 4 && (accessor.kind == Component::F32 || accessor.normalized) {
                keys.push(key.clone());
                exact.push(accessor.floats::<4>(false)?);
            }
        }
        let mut sets: Vec<Vec<f32>> = exact.iter().map(|set| set.as_flattened().to_vec()).collect();
        normalize_weights(&mut sets, Some(255.0));
        let streams = keys.into_iter().zip(exact.iter().zip(&sets)).map(|(key, (exact, set))| {
            let mut stream = rounding.weights(exact, set);
            stream.kind = StreamKind::Attribute { name: key.clone(), is_target: false };
            (key, stream)
        });
        Ok(streams.collect())
    }
}

/// Returns joints as bytes, if all fit.
fn with_bytes(stream: PackedStream) -> PackedStream {
    let is_small = stream.number.component == Component::U16
        && stream.width == 4
        && stream.bytes.as_chunks::<2>().0.iter().all(|b| b[1] == 0);
    if !is_small {
        return stream;
    }
    let bytes = stream.bytes.as_chunks::<2>().0.iter().map(|b| b[0]).collect();
    let number = NumberType { component: Component::U8, ..stream.number };
    PackedStream { number, stride: 4, bytes, ..stream }
}

/// Returns indices as 16-bit integers if they fit, else as 32-bit integers.
fn index_stream(indices: &[u32], has_faces: bool) -> PackedStream {
    // The largest value of a type is not allowed as an index.
    let is_small = indices.iter().all(|i| *i < u32::from(u16::MAX));
    let (component, stride) = if is_small { (Component::U16, 2) } else { (Component::U32, 4) };
    let mut bytes = Vec::with_capacity(indices.len() * stride);
    indices.iter().for_each(|i| bytes.extend_from_slice(&i.to_le_bytes()[..stride]));
    let kind = if has_faces { StreamKind::Triangles } else { StreamKind::Indices };
    let number = NumberType { component, normalized: false };
    PackedStream { kind, number, width: 1, stride, bytes, filter: Filter::None, has_bounds: false }
}

impl PackedGeometry {
    /// Merges equal vertices, puts triangles and vertices into an order for the caches, and leaves out vertices
    /// without a triangle.
    fn reorder(&mut self, triangles: &[[u32; 3]], count: usize, compression: Compression) {
        let row: usize = self.streams.iter().map(|(_, _, s)| s.stride).sum();
        let mut rows = vec![0u8; row * count];
        let mut at = 0;
        for (_, _, PackedStream { stride, bytes, .. }) in &self.streams {
            for (row, element) in rows.chunks_exact_mut(row).zip(bytes.chunks_exact(*stride)) {
                row[at..at + stride].copy_from_slice(element);
            }
            at += stride;
        }
        let of_vertices = self.streams.iter().filter(|((target, _), _, _)| target.is_none());
        let vertex_bytes = of_vertices.map(|(_, _, s)| s.stride).sum();
        self.report.cache_before = CacheUse::of(triangles, count, vertex_bytes);
        let mut known: HashMap<&[u8], u32> = HashMap::with_capacity(count);
        let merged: Vec<u32> =
            (0u32..).zip(rows.chunks_exact(row)).map(|(i, row)| *known.entry(row).or_insert(i)).collect();
        drop(known);
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| merged[v as usize])).collect();
        let purpose = if compression == Compression::None { OrderFor::Gpu } else { OrderFor::Size };
        let triangles = ordered(&triangles, count, purpose);
        let vertices = fetch_order(&triangles, count);
        let mut places = vec![0u32; count];
        (0u32..).zip(&vertices).for_each(|(i, v)| places[*v as usize] = i);
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| places[v as usize])).collect();
        for (_, _, stream) in &mut self.streams {
            let element = |v: &u32| &stream.bytes[*v as usize * stream.stride..][..stream.stride];
            stream.bytes = vertices.iter().flat_map(element).copied().collect();
        }
        self.report.cache = CacheUse::of(&triangles, vertices.len(), vertex_bytes);
        self.indices = Some(index_stream(triangles.as_flattened(), true));
    }
}
