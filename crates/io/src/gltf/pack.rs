//! Packing of a glTF file: rounding to fewer bits, order for the caches, and compression.
//!
//! ```text
//! choose a grid for the positions of each mesh
//! for each primitive: round its attributes, merge equal vertices, order triangles and vertices
//! round animations, and give constant tracks one keyframe; everything else that accessors hold stays as it is
//! transform the positions back by nodes, skins and instances
//! put all streams of one kind into one view, and compress it
//! ```
//!
//! Sources: Khronos, "KHR_mesh_quantization", "EXT_meshopt_compression", "KHR_meshopt_compression".

mod defaults;
mod geometry;
mod motion;
mod nodes;
mod options;
mod quantize;
mod streams;

use std::collections::{BTreeMap, HashMap, HashSet};
use std::io::{self, Write};
use std::sync::Arc;

use rayon::prelude::*;
use serde_json::Value;

use super::accessors::{Accessor, Component};
use super::buffers::Buffers;
use super::container::{FileParts, emit, list, list_mut, number};
use super::extension_losses::ExtensionLosses;
use super::features::depends_on_order;
use super::lists::{QUANTIZATION, needs_quantization, set_extension};
use super::references::{POINTERS, ReferenceKind, each_extension_in, each_reference, known};
use super::renumber::Renumbering;
use crate::error::{ReadError, Warning};
use crate::format::Format;

use geometry::{GeometryTask, PackedGeometry};
use motion::{Role, Tracks, roles};
use nodes::GridNodes;
pub use options::{Compression, PackReport, Packing, QuantizationErrors, SceneFormat, Written};
use quantize::{Grid, PositionBox, Rounding};
use streams::{Output, PackedBuffers};

/// Meshes smaller than this share of the largest mesh have their own grid. (Guessed: in the shared grid they
/// span 64 steps.)
const OWN_GRID: f32 = 1.0 / 256.0;

/// Writes a new file as glTF or GLB, packed if the format requests it.
pub(super) fn write(
    FileParts { mut json, mut bytes, mut warnings }: FileParts,
    SceneFormat { format, packing, .. }: SceneFormat,
    out: &mut dyn Write,
) -> io::Result<Written> {
    let mut packed = None;
    if packing.is_needed() {
        let (smaller, report, notes) = pack(&mut json, bytes, packing)?;
        (bytes, packed) = (smaller, Some(report));
        warnings.extend(notes);
    }
    emit(json, &bytes, format == Format::Glb, out)?;
    Ok(Written { packed, ..Written::new(warnings) })
}

/// A packed file: the bytes of its first buffer, the report, and warnings.
type Packed = (Vec<u8>, PackReport, Vec<Warning>);

/// Packs a file whose only buffer has these bytes. Cost: O(bytes); memory is about three times the bytes.
fn pack(json: &mut Value, bytes: Vec<u8>, packing: Packing) -> io::Result<Packed> {
    let buffers = [Arc::new(bytes)];
    let source = json.clone();
    let opened = Buffers::loaded(&source, &buffers, 0);
    let invalid = |e: ReadError| io::Error::new(io::ErrorKind::InvalidData, e.to_string());
    PackTask { source: &source, buffers: &opened, bytes: &buffers, packing }.run(json).map_err(invalid)
}

/// A file that is packed.
struct PackTask<'a, 'b> {
    source: &'a Value,
    buffers: &'a Buffers<'b>,
    bytes: &'b [Arc<Vec<u8>>],
    packing: Packing,
}

impl PackTask<'_, '_> {
    fn run(&self, json: &mut Value) -> Result<Packed, ReadError> {
        let Self { source, buffers, packing, .. } = *self;
        let grids = self.grids()?;
        let (of_primitives, geometries) = self.geometries(&grids)?;
        let mut output = Output::new(packing.compression);
        let made: Vec<NewReferences> = geometries.iter().map(|g| self.put(g, &mut output)).collect();
        let mut report = PackReport::default();
        let mut rounding =
            Rounding { compression: packing.compression, errors: QuantizationErrors::default() };
        for geometry in &geometries {
            report.cache_before.add(geometry.report.cache_before);
            report.cache.add(geometry.report.cache);
            rounding.errors.raise(geometry.report.errors.unwrap_or_default());
        }
        let described = Described::take(json, &of_primitives, &geometries, &made);
        drop(geometries);
        for value in primitives_mut(json) {
            release(value);
        }
        let mut changes = self.changes(&grids);
        let grid_nodes = GridNodes { source, buffers, grids: &grids };
        let mut references = grid_nodes.apply(json, &mut output, &mut changes)?;
        if packing.quantize {
            let tracks = Tracks { source, buffers, packing };
            references.extend(tracks.shorten(json, &mut rounding, &mut output)?);
        }
        json["accessors"] = Value::Array(Vec::new());
        let views = self.others(json, &mut rounding, &mut output)?;
        for (primitive, at) in primitives_mut(json).zip(&of_primitives) {
            if let Some(written) = at.map(|at| &made[at]) {
                written.fill(primitive);
            }
        }
        described.put(json);
        for (pointer, accessor) in references {
            if let Some(value) = json.pointer_mut(&pointer) {
                *value = accessor.into();
            }
        }
        let PackedBuffers { bytes, stream_bytes, packed_bytes } = output.finish(json, &mut |json, first| {
            each_reference(json, &mut |kind, value| {
                if let (ReferenceKind::View, Some(view)) = (kind, number(value).and_then(|v| views.get(&v))) {
                    *value = (first + view).into();
                }
            });
        });
        let mut losses = ExtensionLosses::default();
        changes.apply(json, &mut losses);
        defaults::shorten(json, list(json, "extensionsUsed").iter().any(|e| e == POINTERS));
        (report.stream_bytes, report.packed_bytes) = (stream_bytes, packed_bytes);
        report.errors = packing.quantize.then_some(rounding.errors);
        set_extension(json, QUANTIZATION, needs_quantization(json));
        if let Some(extension) = packing.compression.extension() {
            set_extension(json, extension, stream_bytes > 0);
        }
        let sentence = report.errors.as_ref().and_then(QuantizationErrors::sentence);
        let mut warnings = losses.warnings();
        warnings.extend(sentence.map(Warning::note));
        Ok((bytes, report, warnings))
    }

    /// Returns what packing changes about the elements of the file: all accessors and views have other numbers, and meshes
    /// in a grid other coordinates. (Known references to accessors and views are changed where they are made.)
    fn changes(&self, grids: &[Option<Grid>]) -> Renumbering {
        let mut changes = Renumbering::default();
        for name in ["accessors", "bufferViews"] {
            changes.change(0..list(self.source, name).len());
        }
        changes.change((0..).zip(grids).filter(|(_, grid)| grid.is_some()).map(|(mesh, _)| mesh));
        changes
    }

    /// Returns the grid of each mesh; `None` if its positions stay as they are. Meshes of similar size share
    /// a grid, so that parts that touch each other still do.
    fn grids(&self) -> Result<Vec<Option<Grid>>, ReadError> {
        let meshes = list(self.source, "meshes");
        if !self.packing.quantize {
            return Ok(vec![None; meshes.len()]);
        }
        // Without a node, nothing transforms positions back; nor where extensions use the coordinates of a mesh.
        let mut placed: HashSet<usize> =
            list(self.source, "nodes").iter().filter_map(|n| number(&n["mesh"])).collect();
        each_reference(&mut self.source.clone(), &mut |kind, value| {
            let mesh = match kind {
                ReferenceKind::ShapeMesh => number(value),
                ReferenceKind::ShapeNode => number(value)
                    .and_then(|n| list(self.source, "nodes").get(n))
                    .and_then(|node| number(&node["mesh"])),
                _ => None,
            };
            if let Some(mesh) = mesh {
                placed.remove(&mesh);
            }
        });
        let own_box = |(m, mesh)| if placed.contains(&m) { self.position_box(mesh) } else { Ok(None) };
        let boxes: Vec<Option<PositionBox>> =
            meshes.iter().enumerate().map(own_box).collect::<Result<_, _>>()?;
        let largest = boxes.iter().flatten().map(PositionBox::extent).fold(0.0, f32::max);
        let is_common = |b: &PositionBox| b.extent() >= largest * OWN_GRID;
        let mut common = PositionBox::EMPTY;
        boxes.iter().flatten().filter(|b| is_common(b)).for_each(|b| common.add(b));
        // Boxes far from each other need a grid each.
        let has_common = common.extent() <= 2.0 * largest;
        let grid = |b: &PositionBox| if has_common && is_common(b) { common.grid(b) } else { b.grid(b) };
        Ok(boxes.iter().map(|b| b.as_ref().map(grid)).collect())
    }

    /// Returns the box of the positions of a mesh, if all are finite floats.
    fn position_box(&self, mesh: &Value) -> Result<Option<PositionBox>, ReadError> {
        let mut all = PositionBox::EMPTY;
        for primitive in list(mesh, "primitives") {
            let mut margin = [0f32; 3];
            let keys = ["POSITION", "_GEOMORPH"];
            let own = keys.iter().filter_map(|key| Some((false, number(&primitive["attributes"][*key])?)));
            let of_targets = list(primitive, "targets").iter();
            let of_targets = of_targets.filter_map(|t| Some((true, number(&t["POSITION"])?)));
            let mut own_box = PositionBox::EMPTY;
            for (is_target, index) in own.chain(of_targets) {
                let accessor = Accessor::new(self.source, self.buffers, index, "a mesh")?;
                if accessor.kind != Component::F32 || accessor.width != 3 {
                    return Ok(None);
                }
                for p in accessor.floats::<3>(false)? {
                    for k in 0..3 {
                        if !p[k].is_finite() {
                            return Ok(None);
                        }
                        if is_target {
                            margin[k] = margin[k].max(p[k].abs());
                        } else {
                            own_box.min[k] = own_box.min[k].min(p[k]);
                            own_box.max[k] = own_box.max[k].max(p[k]);
                        }
                    }
                }
            }
            for (k, margin) in margin.into_iter().enumerate() {
                own_box.min[k] -= margin;
                own_box.max[k] += margin;
            }
            all.add(&own_box);
        }
        Ok(Some(all).filter(|b| (0.0..f32::INFINITY).contains(&b.extent())))
    }

    /// Packs all primitives, equal ones once. Returns the index of each, in the order of the file.
    fn geometries(
        &self,
        grids: &[Option<Grid>],
    ) -> Result<(Vec<Option<usize>>, Vec<PackedGeometry>), ReadError> {
        let mut known: HashMap<String, usize> = HashMap::new();
        let mut tasks: Vec<(String, GeometryTask<'_>)> = Vec::new();
        let mut of_primitives = Vec::new();
        for (m, mesh) in list(self.source, "meshes").iter().enumerate() {
            for (p, primitive) in list(mesh, "primitives").iter().enumerate() {
                if primitive["attributes"]["POSITION"].is_null() {
                    of_primitives.push(None);
                    continue;
                }
                let both = [&mesh["extensions"], &primitive["extensions"]];
                let mut extensions = both.into_iter().filter_map(Value::as_object).flatten();
                let task = GeometryTask {
                    primitive,
                    grid: grids[m],
                    may_reorder: !extensions.any(|(name, content)| depends_on_order(name, content)),
                    packing: self.packing,
                };
                let parts = ["attributes", "indices", "targets", "mode"].map(|key| &primitive[key]);
                let key = format!("{parts:?} {:?} {}", task.grid, task.may_reorder);
                let at = *known.entry(key).or_insert(tasks.len());
                if at == tasks.len() {
                    tasks.push((format!("meshes[{m}].primitives[{p}]"), task));
                }
                of_primitives.push(Some(at));
            }
        }
        let (source, bytes) = (self.source, self.bytes);
        let run = |(name, task): &(String, GeometryTask<'_>)| {
            task.run(source, &Buffers::loaded(source, bytes, 0), name)
        };
        // (Rayon keeps their order.)
        let made = tasks.par_iter().map(run).collect::<Result<_, _>>()?;
        Ok((of_primitives, made))
    }

    /// Appends the data of a primitive; returns its references.
    fn put(&self, geometry: &PackedGeometry, output: &mut Output) -> NewReferences {
        let accessor = |index: usize| &self.source["accessors"][index];
        let streams = geometry.streams.iter();
        NewReferences {
            attributes: streams
                .map(|(place, from, stream)| (place.clone(), output.stream(Some(accessor(*from)), stream)))
                .collect(),
            indices: geometry
                .indices
                .as_ref()
                .map(|stream| output.stream(geometry.index_source.map(accessor), stream)),
            has_faces: geometry.has_faces,
        }
    }

    /// Appends the accessors that the rest of the file refers to, and renumbers the references. Returns the
    /// indices of the views that it refers to among the copied views.
    fn others(
        &self,
        json: &mut Value,
        rounding: &mut Rounding,
        output: &mut Output,
    ) -> Result<HashMap<usize, usize>, ReadError> {
        let (mut accessors, mut views) = (BTreeMap::new(), BTreeMap::new());
        each_reference(json, &mut |kind, value| {
            let list = match kind {
                ReferenceKind::Accessor => &mut accessors,
                ReferenceKind::View => &mut views,
                _ => return,
            };
            if let Some(index) = number(value) {
                list.insert(index, 0usize);
            }
        });
        let roles = roles(self.source);
        for (&index, new) in &mut accessors {
            let role = roles.get(&index).copied().unwrap_or(Role::Other);
            let Some(source) = list(self.source, "accessors").get(index) else { continue };
            let made = motion::stream(self.source, self.buffers, index, role, self.packing, rounding)?;
            *new = match made {
                Some(stream) => output.stream(Some(source), &stream),
                None => self.copy_accessor(source, output)?,
            };
        }
        each_reference(json, &mut |kind, value| {
            let new = number(value).and_then(|index| accessors.get(&index));
            if let (ReferenceKind::Accessor, Some(new)) = (kind, new) {
                *value = (*new).into();
            }
        });
        for (&view, new) in &mut views {
            let Some(source) = list(self.source, "bufferViews").get(view) else { continue };
            *new = output.copy_view(view, source, self.buffers.view(view, "the file")?.bytes);
        }
        Ok(views.into_iter().collect())
    }

    /// Copies an accessor of another type as it is, with its views.
    fn copy_accessor(&self, source: &Value, output: &mut Output) -> Result<usize, ReadError> {
        let mut views = Vec::new();
        let parts = [
            ("", source),
            ("indices", &source["sparse"]["indices"]),
            ("values", &source["sparse"]["values"]),
        ];
        for (part, owner) in parts {
            let Some(view) = number(&owner["bufferView"]) else { continue };
            let bytes = self.buffers.view(view, "an accessor")?.bytes;
            views.push((part, output.copy_view(view, &self.source["bufferViews"][view], bytes)));
        }
        Ok(output.copy_accessor(source, &views))
    }
}

/// References in extensions of meshes to accessors of the vertices of the same mesh: they follow the vertices, where their
/// order stays.
struct Described(Vec<(usize, usize, usize)>);

impl Described {
    /// Sets such references to null; returns the mesh of each, its place among the references of the mesh, and the new
    /// accessor.
    fn take(
        json: &mut Value,
        of_primitives: &[Option<usize>],
        geometries: &[PackedGeometry],
        made: &[NewReferences],
    ) -> Self {
        let mut all = Vec::new();
        let mut of_primitives = of_primitives.iter();
        for (m, mesh) in list_mut(json, "meshes").iter_mut().enumerate() {
            let of_mesh = of_primitives.by_ref().take(list(mesh, "primitives").len()).flatten();
            let mut known: HashMap<usize, usize> = HashMap::new();
            for &at in of_mesh.filter(|at| geometries[**at].keeps_order) {
                let streams = geometries[at].streams.iter().zip(&made[at].attributes);
                known.extend(streams.map(|((_, from, _), (_, to))| (*from, *to)));
            }
            let mut place = 0;
            each_accessor_of_extensions(mesh, &mut |value| {
                if let Some(new) = number(value).and_then(|old| known.get(&old)) {
                    *value = Value::Null;
                    all.push((m, place, *new));
                }
                place += 1;
            });
        }
        Self(all)
    }

    fn put(self, json: &mut Value) {
        let mut next = self.0.into_iter().peekable();
        for (m, mesh) in list_mut(json, "meshes").iter_mut().enumerate() {
            let mut place = 0;
            each_accessor_of_extensions(mesh, &mut |value| {
                if let Some((.., new)) = next.next_if(|(of, at, _)| (*of, *at) == (m, place)) {
                    *value = new.into();
                }
                place += 1;
            });
        }
    }
}

/// Calls `visit` for each reference to an accessor in the extensions of a mesh and its primitives.
fn each_accessor_of_extensions(mesh: &mut Value, visit: &mut dyn FnMut(&mut Value)) {
    each_extension_in(mesh, "meshes", &mut |host, name, content| {
        if let Some(known) = known(name) {
            known.visit(host, content, &mut 0, &mut |kind, value| {
                if kind == ReferenceKind::Accessor {
                    visit(value);
                }
                true
            });
        }
        true
    });
}

/// New accessors of a primitive.
struct NewReferences {
    attributes: Vec<(geometry::AttributePlace, usize)>,
    indices: Option<usize>,
    has_faces: bool,
}

impl NewReferences {
    /// Puts the references into a primitive.
    fn fill(&self, primitive: &mut Value) {
        for ((target, key), accessor) in &self.attributes {
            let owner = match target {
                None => &mut primitive["attributes"],
                Some(target) => &mut primitive["targets"][*target],
            };
            owner[key.as_str()] = (*accessor).into();
        }
        if let Some(indices) = self.indices {
            primitive["indices"] = indices.into();
        }
        if self.has_faces && !primitive["mode"].is_null() {
            primitive["mode"] = 4.into();
        }
    }
}

/// Returns all primitives of a file.
fn primitives_mut(json: &mut Value) -> impl Iterator<Item = &mut Value> {
    let meshes = list_mut(json, "meshes").iter_mut();
    meshes.flat_map(|mesh| list_mut(mesh, "primitives").iter_mut())
}

/// Sets the references of a primitive to null if they will be replaced.
fn release(primitive: &mut Value) {
    if primitive["attributes"]["POSITION"].is_null() {
        return;
    }
    let owners = |value: Option<&mut Value>| {
        let all = value.and_then(Value::as_object_mut).into_iter().flat_map(|o| o.values_mut());
        all.for_each(|v| *v = Value::Null);
    };
    owners(primitive.get_mut("attributes"));
    let targets = primitive.get_mut("targets").and_then(Value::as_array_mut);
    targets.into_iter().flatten().for_each(|target| owners(Some(target)));
    if let Some(indices) = primitive.get_mut("indices") {
        *indices = Value::Null;
    }
}
