//! Reader of one mesh with wedges: equal positions are welded across primitives, and each primitive is a
//! region.

use std::collections::{BTreeMap, HashMap};

use lodsmith_core::mesh::{Attribute, IntegerType, Semantic};
use lodsmith_core::{MeshError, Positions, RegionId, TriMesh, VertexId, WedgeId};
use serde_json::Value;

use super::accessors::{Accessor, Component};
use super::buffers::Buffers;
use super::container::{entry, list, whole};
use super::primitive::Primitive;
use super::slot::Slot;
use crate::distinct::TripleSet;
use crate::error::ReadError;
use crate::limits::try_with_capacity;

/// Names of types by their number of components.
pub(super) const TYPE_NAMES: [&str; 5] = ["nothing", "SCALAR", "VEC2", "VEC3", "VEC4"];

/// Limits on all meshes of one file together: many primitives may refer to the same few bytes.
pub(super) struct Budget {
    pub(super) faces: Allowance,
    pub(super) numbers: Allowance,
    /// Copies of meshes that nodes place, and vertices that joints move.
    pub(super) copies: Allowance,
}

/// A limit on a count, and how much of it is used.
pub(super) struct Allowance {
    what: &'static str,
    limit: u64,
    used: u64,
}

impl Budget {
    /// Returns the limits for a file of this many bytes, including its buffers.
    pub(super) fn new(bytes: usize) -> Self {
        let room = |what, per_byte: u64, always: u64| Allowance {
            what,
            limit: (bytes as u64).saturating_mul(per_byte).saturating_add(always),
            used: 0,
        };
        // Guessed: a triangle takes six bytes at least, unless primitives share it; hundreds of sparse morph targets take
        // a few bytes for each of their vertices.
        Self {
            faces: room("number of triangles, for a file of this size,", 16, 1 << 20),
            numbers: room("numbers in attributes, for a file of this size,", 256, 1 << 24),
            // Guessed: a copy takes six bytes at least, unless nodes share them.
            copies: room("copies of meshes, for a file of this size,", 16, 1 << 20),
        }
    }
}

impl Allowance {
    pub(super) fn take(&mut self, count: u64) -> Result<(), ReadError> {
        self.used = self.used.saturating_add(count);
        if self.used > self.limit {
            return Err(ReadError::Limit { what: self.what, size: self.used, limit: self.limit });
        }
        Ok(())
    }
}

/// A decoded primitive, to be merged into the mesh.
struct DecodedPrimitive {
    region: RegionId,
    name: String,
    /// Triangles over the vertices of the primitive.
    triangles: Vec<[u32; 3]>,
    /// Vertices that triangles use, ascending: wedges of the mesh.
    used: Vec<u32>,
    /// Attributes with their accessors, in the order of the file.
    attributes: Vec<(Slot, usize)>,
    accessor_of: HashMap<Slot, usize>,
}

/// Reads a mesh in its local coordinates; returns it with the number of primitives that end in an incomplete
/// triangle.
///
/// Wedges are the vertices that triangles use, primitive after primitive, in the order of the file.
pub(super) fn read(
    json: &Value,
    buffers: &Buffers<'_>,
    mesh: &Value,
    mesh_name: &str,
    budget: &mut Budget,
) -> Result<(TriMesh, usize), ReadError> {
    let (mut parts, mut ragged) = (Vec::new(), 0);
    for (i, primitive) in list(mesh, "primitives").iter().enumerate() {
        let name = format!("{mesh_name}.primitives[{i}]");
        if !Primitive::has_faces(primitive, &name)? || primitive["attributes"]["POSITION"].is_null() {
            continue;
        }
        let (part, is_ragged) = decode_primitive(json, buffers, primitive, (i, name), budget)?;
        ragged += usize::from(is_ragged);
        parts.push(part);
    }

    let mut slots: Vec<(Slot, usize)> = Vec::new();
    let mut known = HashMap::new();
    for part in &parts {
        for (slot, index) in &part.attributes {
            let accessor = Accessor::new(json, buffers, *index, &part.name)?;
            // Colours have an alpha.
            let width = if slot.is_color() { 4 } else { accessor.width };
            match known.get(slot) {
                Some(&at) => {
                    let (_, most): &mut (Slot, usize) = &mut slots[at];
                    *most = width.max(*most);
                }
                None => {
                    known.insert(slot.clone(), slots.len());
                    slots.push((slot.clone(), width));
                }
            }
        }
    }
    let wedges: usize = parts.iter().map(|p| p.used.len()).sum();
    let per_wedge: usize = slots.iter().map(|(_, width)| width).sum();
    budget.numbers.take((wedges as u64).saturating_mul(per_wedge as u64))?;
    if wedges >= u32::MAX as usize {
        return Err(MeshError::TooLarge { what: "vertices", count: wedges }.into());
    }

    let mut out = mesh_without_attributes(json, buffers, &parts, wedges)?;
    for (slot, width) in slots {
        if slot == Slot::Position {
            continue;
        }
        let mut values = gather_attribute(json, buffers, &parts, &slot, width, wedges)?;
        if slot.is_uv() {
            // glTF counts from the upper left corner of the image.
            values.as_chunks_mut::<2>().0.iter_mut().for_each(|uv| uv[1] = 1.0 - uv[1]);
        }
        match slot.clone() {
            Slot::Position => {}
            Slot::Normal => out.set_normals(Some(values.as_chunks().0.to_vec()))?,
            Slot::Uv => out.set_uvs(Some(values.as_chunks().0.to_vec()))?,
            Slot::Color => out.set_colors(Some(values.as_chunks().0.to_vec()))?,
            Slot::Further(semantic) => {
                let integer = integer(json, buffers, &parts, &slot, &values)?;
                let semantic = match (semantic, integer) {
                    (Semantic::Custom(name), Some(of)) => Semantic::Discrete { name, of },
                    (semantic, _) => semantic,
                };
                out.add_attribute(Attribute { semantic, width, values })?;
            }
        }
    }
    Ok((out, ragged))
}

/// Returns the vertex in the source of each wedge of a mesh; see [`BuiltScene`](super::BuiltScene). For a position
/// accessor without an entry, the vertices are those of the source.
pub(super) fn source_vertices(
    json: &Value,
    buffers: &Buffers<'_>,
    index: usize,
    sources: &BTreeMap<usize, Vec<u32>>,
) -> Result<Vec<u32>, ReadError> {
    let (mesh, mesh_name) = entry(json, "meshes", index, "a scene")?;
    let mut budget = Budget::new(buffers.total());
    let mut all = Vec::new();
    for (i, primitive) in list(mesh, "primitives").iter().enumerate() {
        let name = format!("{mesh_name}.primitives[{i}]");
        let (part, _) = decode_primitive(json, buffers, primitive, (i, name), &mut budget)?;
        let of_accessor = part.accessor_of.get(&Slot::Position).and_then(|accessor| sources.get(accessor));
        all.extend(part.used.iter().map(|&v| of_accessor.map_or(v, |sources| sources[v as usize])));
    }
    Ok(all)
}

/// Reads the triangles of a primitive, the vertices that they use, and its attributes; checks all accessors.
fn decode_primitive(
    json: &Value,
    buffers: &Buffers<'_>,
    primitive: &Value,
    (region, name): (usize, String),
    budget: &mut Budget,
) -> Result<(DecodedPrimitive, bool), ReadError> {
    let attributes = attributes(json, primitive, &name)?;
    let mut vertices = None;
    for (slot, index) in &attributes {
        let accessor = Accessor::new(json, buffers, *index, &name)?;
        check(&accessor, slot, &name)?;
        let count = *vertices.get_or_insert(accessor.count);
        if accessor.count != count {
            let got = accessor.count;
            return Err(ReadError::element(
                accessor.name,
                format!("it has {got} entries for the {count} vertices of {name}"),
            ));
        }
    }
    let vertices = vertices.unwrap_or(0);
    if vertices >= u32::MAX as usize {
        return Err(MeshError::TooLarge { what: "vertices", count: vertices }.into());
    }
    let faces = Primitive::new(json, buffers, primitive, name, vertices)?;
    budget.faces.take(faces.max_faces().max(faces.corners / 3) as u64)?;
    let (triangles, is_ragged) = faces.triangles(json, buffers, vertices)?;
    let used = used(&triangles, vertices);
    let (region, name) = (RegionId::new(region), faces.name);
    let accessor_of = attributes.iter().cloned().collect();
    Ok((DecodedPrimitive { region, name, triangles, used, attributes, accessor_of }, is_ragged))
}

/// Returns the attributes and morph targets of a primitive that a mesh can hold, with their accessors.
fn attributes(json: &Value, primitive: &Value, name: &str) -> Result<Vec<(Slot, usize)>, ReadError> {
    let targets = list(primitive, "targets").iter().enumerate().map(|(i, t)| (Some(i), t));
    let mut found = Vec::new();
    for (target, object) in std::iter::once((None, &primitive["attributes"])).chain(targets) {
        for key in object.as_object().into_iter().flat_map(|o| o.keys()) {
            let Some(index) = whole(object, key, name)? else { continue };
            let slot = Slot::of(target, key);
            // Custom attributes of matrices are not read; they stay in the file.
            let is_matrix = list(json, "accessors")
                .get(index)
                .and_then(|a| a["type"].as_str())
                .is_some_and(|t| t.starts_with("MAT"));
            if is_matrix && slot.widths() == (1..=4) {
                continue;
            }
            found.push((slot, index));
        }
    }
    Ok(found)
}

fn check(accessor: &Accessor<'_>, slot: &Slot, name: &str) -> Result<(), ReadError> {
    let widths = slot.widths();
    if !widths.contains(&accessor.width) {
        let (wanted, got) = (TYPE_NAMES[*widths.start()], TYPE_NAMES[accessor.width]);
        return Err(ReadError::element(
            accessor.name.as_str(),
            format!("an attribute of {name} is of type {got}, expected {wanted}"),
        ));
    }
    if accessor.kind == Component::U32 && widths != (1..=4) {
        let problem = format!("an attribute of {name} must not be 32-bit integers");
        return Err(ReadError::element(accessor.name.as_str(), problem));
    }
    Ok(())
}

/// Returns the vertices that triangles use, ascending.
fn used(triangles: &[[u32; 3]], vertices: usize) -> Vec<u32> {
    let corners = triangles.as_flattened();
    // Guessed: with fewer corners, few of the vertices are used, and flags for all would cost more than
    // sorting.
    if corners.len() < vertices / 16 {
        let mut all = corners.to_vec();
        all.sort_unstable();
        all.dedup();
        return all;
    }
    let mut marks = vec![false; vertices];
    corners.iter().for_each(|&v| marks[v as usize] = true);
    (0..vertices as u32).filter(|&v| marks[v as usize]).collect()
}

/// Returns the integer type of a custom attribute with discrete values: plain integers in all primitives that
/// have it, or ids of another type. Of several types the first that holds all values.
fn integer(
    json: &Value,
    buffers: &Buffers<'_>,
    parts: &[DecodedPrimitive],
    slot: &Slot,
    values: &[f32],
) -> Result<Option<IntegerType>, ReadError> {
    if !matches!(slot, Slot::Further(Semantic::Custom(_))) {
        return Ok(None);
    }
    let mut wanted = Vec::new();
    for part in parts {
        let Some(&index) = part.accessor_of.get(slot) else { continue };
        let accessor = Accessor::new(json, buffers, index, &part.name)?;
        let of = accessor.kind.integer().filter(|_| !accessor.normalized);
        if of.is_none() && !slot.holds_ids() {
            return Ok(None);
        }
        wanted.extend(of);
    }
    Ok(wanted.into_iter().chain(IntegerType::ALL).find(|of| values.iter().all(|&x| of.holds(x))))
}

/// Builds a mesh without attributes: positions, wedges, triangles and regions.
fn mesh_without_attributes(
    json: &Value,
    buffers: &Buffers<'_>,
    parts: &[DecodedPrimitive],
    wedges: usize,
) -> Result<TriMesh, ReadError> {
    let corners = gather_attribute(json, buffers, parts, &Slot::Position, 3, wedges)?;
    let mut places = TripleSet::with_capacity(0);
    // Adding zero turns -0 into +0.
    let vertex_of: Vec<VertexId> = corners
        .as_chunks::<3>()
        .0
        .iter()
        .map(|p| VertexId(places.id_of(p.map(|x| (x + 0.0).to_bits()))))
        .collect();
    let positions = Positions::F32(places.into_keys().into_iter().map(|k| k.map(f32::from_bits)).collect());
    let mut triangles: Vec<[WedgeId; 3]> = try_with_capacity(parts.iter().map(|p| p.triangles.len()).sum())?;
    let mut regions = Vec::with_capacity(triangles.capacity());
    let mut base = 0;
    for part in parts {
        let wedge = |v: u32| {
            let at = if part.used.last() == Some(&(part.used.len() as u32 - 1)) {
                v as usize
            } else {
                part.used.partition_point(|&u| u < v)
            };
            WedgeId::new(base + at)
        };
        triangles.extend(part.triangles.iter().map(|t| t.map(wedge)));
        regions.resize(triangles.len(), part.region);
        base += part.used.len();
    }
    let mut mesh = if vertex_of.iter().enumerate().all(|(w, v)| w == v.index()) {
        TriMesh::new(positions, bytemuck::allocation::cast_vec(triangles))?
    } else {
        TriMesh::with_wedges(positions, vertex_of, triangles)?
    };
    if parts.len() > 1 || parts.iter().any(|p| p.region.0 > 0) {
        mesh.set_regions(Some(regions))?;
    }
    Ok(mesh)
}

/// Returns an attribute of all wedges; zeros, or white for colours, where a primitive lacks it.
fn gather_attribute(
    json: &Value,
    buffers: &Buffers<'_>,
    parts: &[DecodedPrimitive],
    slot: &Slot,
    width: usize,
    wedges: usize,
) -> Result<Vec<f32>, ReadError> {
    let empty = if slot.is_color() { 1.0 } else { 0.0 };
    let mut values = vec![empty; wedges * width];
    let mut at = 0;
    for part in parts {
        let end = at + part.used.len() * width;
        if let Some(&index) = part.accessor_of.get(slot) {
            let accessor = Accessor::new(json, buffers, index, &part.name)?;
            accessor.pick(&part.used, slot.is_normalized(), width, &mut values[at..end])?;
        }
        at = end;
    }
    Ok(values)
}
