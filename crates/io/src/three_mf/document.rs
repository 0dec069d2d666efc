//! The text of a model part: resources and the build.

use std::collections::{BTreeSet, HashMap};
use std::io;

use glam::DMat4;
use lodsmith_core::model::{TextureRef, Wrap};
use lodsmith_core::{Positions, TriMesh, WedgeId};
use serde_json::Value;

use super::assemblies::{Assemblies, ObjectFacts, ObjectPlace, ObjectRef};
use super::looks::{Looks, LostParts, key_of};
use super::marks::{
    ExactPaint, PAINTS, PRUSA_NAMESPACE, PRUSA_PREFIX, RegionMarks, SETS_NAMESPACE, SETS_PREFIX, WrittenSets,
};
use super::properties::{Properties, Shown, TextureCoordinates, bytes_of_linear};
use super::settings::WrittenObjects;
use super::xml::escaped;
use crate::material::{bytes_with_mipmaps, size_of};
use crate::numbers::TextOut;
use crate::sizes::Sizes;

/// A mesh that becomes an object.
pub(super) struct MeshObject<'a> {
    pub(super) name: String,
    pub(super) mesh: &'a TriMesh,
    /// The material of each region; one entry for a mesh without regions.
    pub(super) of_region: Vec<Option<usize>>,
    /// The source vertex of each wedge, if the file distinguished vertices at equal positions.
    pub(super) sources: Option<Vec<u32>>,
    /// Marks of the regions; null for none. Regions beyond the end have none.
    pub(super) marks: Vec<Value>,
    /// Paint of triangles of which a part is painted, ascending.
    pub(super) paint: &'a [ExactPaint],
}

/// A model part.
pub(super) struct ModelPart<'a> {
    looks: &'a Looks,
    objects: &'a [Option<MeshObject<'a>>],
    /// Properties of the objects.
    properties: Vec<Option<Properties<'a>>>,
    /// Materials that triangles show, ascending.
    materials: Vec<usize>,
    /// True if there is a material for triangles without properties beside others with them.
    has_default: bool,
    /// Images with their samplers, and their numbers by the first part of their keys.
    textures: Vec<TextureRef>,
    texture_numbers: HashMap<(usize, [u8; 3]), usize>,
    /// True if colours had more digits than a byte.
    pub(super) is_rounded: bool,
    /// All numbers above are free.
    last_id: usize,
}

/// The numbers of objects.
struct ObjectNumbers {
    /// This one and all above are free.
    next: usize,
    /// By meshes; 0 for those that are not written.
    meshes: Vec<usize>,
    assemblies: Vec<usize>,
}

impl ObjectNumbers {
    /// Returns the number of an object, a new one if it has none.
    fn of(&mut self, facts: &ObjectFacts) -> usize {
        let new = self.next;
        self.next += usize::from(facts.id.is_none());
        facts.id.map_or(new, |id| id as usize)
    }

    fn of_object(&self, object: ObjectRef) -> usize {
        match object {
            ObjectRef::Mesh(mesh) => self.meshes[mesh],
            ObjectRef::Assembly(at) => self.assemblies[at],
        }
    }
}

/// The numbers of the resources of a mesh.
struct MeshIds {
    colors: usize,
    /// The first group of texture coordinates.
    coordinates: usize,
}

/// The numbers of resources, above those of objects that keep theirs: groups for all objects, then the textures, then the
/// other objects with the groups of each.
const MATERIALS: usize = 1;
const DISPLAY: usize = 2;
const FIRST_TEXTURE: usize = 3;

/// Metadata of the model, which come before its resources.
pub(super) struct ModelHeader<'a> {
    pub(super) metadata: &'a [(String, String)],
    /// Namespaces of prefixes that names of metadata have.
    pub(super) namespaces: Vec<&'a (String, String)>,
}

impl<'a> ModelPart<'a> {
    pub(super) fn new(
        looks: &'a Looks,
        objects: &'a [Option<MeshObject<'a>>],
        placed: &Assemblies,
        lost: &mut LostParts,
    ) -> Self {
        let mut is_rounded = false;
        let mut of_object = |object: &'a MeshObject<'a>| {
            Properties::new(object.mesh, looks, &object.of_region, (&mut *lost, &mut is_rounded))
        };
        let mut properties: Vec<Option<Properties<'_>>> =
            objects.iter().map(|object| object.as_ref().map(&mut of_object)).collect();
        for volumes in placed.volumes.values() {
            let has_any =
                volumes.iter().any(|&(_, mesh)| properties[mesh].as_ref().is_some_and(Properties::has_any));
            for &(_, mesh) in volumes.iter().filter(|_| has_any) {
                properties[mesh].iter_mut().for_each(Properties::set_beside_others);
            }
        }
        let all = || properties.iter().flatten();
        let materials: BTreeSet<usize> = all().flat_map(|p| p.materials.iter().copied()).collect();
        let has_default = all().any(Properties::is_mixed);
        let (mut textures, mut texture_numbers) = (Vec::new(), HashMap::new());
        for coordinates in all().flat_map(Properties::used_coordinates) {
            texture_numbers.entry(key_of(&coordinates.texture).0).or_insert_with(|| {
                textures.push(coordinates.texture);
                textures.len() - 1
            });
        }
        let materials = materials.into_iter().collect();
        let last_id = placed.ids().max().unwrap_or(0) as usize;
        Self {
            looks,
            objects,
            properties,
            materials,
            has_default,
            textures,
            texture_numbers,
            is_rounded,
            last_id,
        }
    }

    /// Returns the images that triangles show.
    pub(super) fn used_pictures(&self) -> BTreeSet<usize> {
        self.textures.iter().map(|texture| texture.image).collect()
    }

    /// Returns the sizes of these meshes, each counted as often as it is listed.
    pub(super) fn sizes(&self, meshes: impl Iterator<Item = usize>) -> Sizes {
        let mut sizes = Sizes::default();
        for properties in meshes.filter_map(|mesh| self.properties[mesh].as_ref()) {
            sizes.triangles += properties.mesh.face_count() as u64;
            sizes.draw_calls += properties.kind_count() as u64;
        }
        for picture in self.used_pictures() {
            if let Ok([width, height]) = size_of(&self.looks.pictures[picture].bytes) {
                sizes.texture_bytes += bytes_with_mipmaps(width, height);
            }
        }
        sizes
    }

    /// Writes the part; returns the number of triangles that were left out, and what was written of each object.
    pub(super) fn write(
        &self,
        placed: &Assemblies,
        header: &ModelHeader<'_>,
        out: &mut TextOut<'_>,
    ) -> io::Result<(usize, WrittenObjects)> {
        self.write_header(placed, header, out)?;
        self.write_materials(out)?;
        self.write_textures(out)?;
        let mut numbers = ObjectNumbers {
            next: self.last_id + FIRST_TEXTURE + self.textures.len(),
            meshes: vec![0; self.objects.len()],
            assemblies: Vec::new(),
        };
        let (mut skipped, mut written) = (0, WrittenObjects::default());
        let further: BTreeSet<usize> =
            placed.volumes.values().flat_map(|all| all[1..].iter().map(|&(_, mesh)| mesh)).collect();
        for mesh in (0..self.objects.len()).filter(|mesh| !further.contains(mesh)) {
            skipped += self.write_mesh(mesh, placed, &mut numbers, &mut written, out)?;
        }
        for assembly in &placed.all {
            let id = numbers.of(&assembly.facts);
            numbers.assemblies.push(id);
            written.assemblies.insert(id as u32);
            write_begin(id, &assembly.facts, &assembly.name, out);
            out.text(">\n   <components>\n");
            for component in &assembly.components {
                write_place("    <component", component, numbers.of_object(component.object), out)?;
            }
            out.text("   </components>\n  </object>\n");
        }
        out.text(" </resources>\n <build>\n");
        for item in &placed.items {
            write_place("  <item", item, numbers.of_object(item.object), out)?;
        }
        out.text(" </build>\n</model>\n");
        out.finish()?;
        Ok((skipped, written))
    }

    /// Writes the object of a mesh and of its further volumes, with its groups of properties; returns the number of
    /// triangles that were left out.
    fn write_mesh(
        &self,
        mesh: usize,
        placed: &Assemblies,
        numbers: &mut ObjectNumbers,
        written: &mut WrittenObjects,
        out: &mut TextOut<'_>,
    ) -> io::Result<usize> {
        let alone = [(0, mesh)];
        let volumes = placed.volumes.get(&mesh);
        let mut pieces = Vec::new();
        for &(volume, mesh) in volumes.map_or(&alone[..], Vec::as_slice) {
            let (Some(object), Some(properties)) = (&self.objects[mesh], &self.properties[mesh]) else {
                continue;
            };
            let own = MeshIds { colors: numbers.next, coordinates: numbers.next + 1 };
            numbers.next += 1 + properties.coordinates.len();
            self.write_groups(object.mesh, properties, &own, out)?;
            pieces.push((volume, object, properties, own));
        }
        if pieces.is_empty() {
            return Ok(0);
        }
        let facts = placed.of_meshes.get(&mesh).cloned().unwrap_or_default();
        let id = numbers.of(&facts);
        numbers.meshes[mesh] = id;
        let counts = self.write_object(&pieces, (id, &facts), out)?;
        let faces: usize = pieces.iter().map(|(_, object, ..)| object.mesh.face_count()).sum();
        let skipped = faces - counts.iter().sum::<usize>();
        if volumes.is_some() {
            let of_volumes = written.volumes.entry(id as u32).or_default();
            for ((volume, ..), count) in pieces.iter().zip(counts) {
                of_volumes.resize(of_volumes.len().max(volume + 1), 0);
                of_volumes[*volume] = count;
            }
        } else {
            written.faces.insert(id as u32, counts.iter().sum());
        }
        Ok(skipped)
    }

    fn write_header(
        &self,
        placed: &Assemblies,
        header: &ModelHeader<'_>,
        out: &mut TextOut<'_>,
    ) -> io::Result<()> {
        out.text("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"");
        out.text(placed.unit.name());
        out.text("\" xml:lang=\"en-US\" xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"");
        out.text(" xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\"");
        let marks = || self.objects.iter().flatten().flat_map(|object| &object.marks);
        let has_sets = marks().any(|mark| !mark["sets"].is_null());
        let is_prusa = |mark: &Value| {
            PAINTS.iter().any(|(name, prefix)| *prefix == PRUSA_PREFIX && !mark["paint"][name].is_null())
        };
        let painted = self.objects.iter().flatten().flat_map(|object| object.paint);
        let has_prusa =
            marks().any(is_prusa) || painted.into_iter().any(|p| PAINTS[usize::from(p.1)].1 == PRUSA_PREFIX);
        let mut prefixes = vec!["m"];
        for (is_used, prefix, uri) in
            [(has_sets, SETS_PREFIX, SETS_NAMESPACE), (has_prusa, PRUSA_PREFIX, PRUSA_NAMESPACE)]
        {
            let prefix = prefix.trim_end_matches(':');
            if is_used {
                prefixes.push(prefix);
                out.text(&format!(" xmlns:{prefix}=\"{uri}\""));
            }
        }
        for (prefix, uri) in header.namespaces.iter().filter(|(prefix, _)| !prefixes.contains(&&**prefix)) {
            out.text(&format!(" xmlns:{prefix}=\"{}\"", escaped(uri)));
        }
        out.text(">\n");
        for (name, value) in header.metadata {
            out.text(&format!(" <metadata name=\"{}\">{}</metadata>\n", escaped(name), escaped(value)));
        }
        if !header.metadata.iter().any(|(name, _)| name == APPLICATION) {
            out.text(&format!(" <metadata name=\"{APPLICATION}\">Lodsmith</metadata>\n"));
        }
        out.text(" <resources>");
        out.end_line()
    }

    fn write_materials(&self, out: &mut TextOut<'_>) -> io::Result<()> {
        if self.materials.is_empty() && !self.has_default {
            return Ok(());
        }
        let looks = || self.materials.iter().map(|&m| &self.looks.all[m]);
        let mut display = String::new();
        if !looks().all(|look| look.is_dull()) {
            let id = self.last_id + DISPLAY;
            display = format!(" m:displaypropertiesid=\"{id}\"");
            out.text(&format!("  <m:pbmetallicdisplayproperties id=\"{id}\">\n"));
            let mut entry = |name: &str, metalness: f64, roughness: f64| {
                out.text(&format!(
                    "   <m:pbmetallic name=\"{}\" metallicness=\"{metalness}\" roughness=\"{roughness}\"/>",
                    escaped(name)
                ));
                out.end_line()
            };
            looks().try_for_each(|look| entry(&look.name, look.metalness, look.roughness))?;
            if self.has_default {
                entry(DEFAULT, 0.0, 1.0)?;
            }
            out.text("  </m:pbmetallicdisplayproperties>\n");
        }
        out.text(&format!("  <basematerials id=\"{}\"{display}>\n", self.last_id + MATERIALS));
        let mut entry = |name: &str, color: [u8; 4]| {
            let name = escaped(name);
            out.text(&format!("   <base name=\"{name}\" displaycolor=\"{}\"/>", hex(color)));
            out.end_line()
        };
        looks().try_for_each(|look| entry(&look.name, bytes_of_linear(look.color)))?;
        if self.has_default {
            entry(DEFAULT, [255; 4])?;
        }
        out.text("  </basematerials>\n");
        Ok(())
    }

    fn write_textures(&self, out: &mut TextOut<'_>) -> io::Result<()> {
        for (at, TextureRef { image: picture, sampler, .. }) in self.textures.iter().enumerate() {
            let (id, path) = (self.last_id + FIRST_TEXTURE + at, self.looks.path_of(*picture));
            let kind = self.looks.pictures[*picture].kind;
            out.text(&format!("  <m:texture2d id=\"{id}\" path=\"{path}\" contenttype=\"{kind}\""));
            for (way, wrap) in [("u", sampler.wrap_u), ("v", sampler.wrap_v)] {
                match wrap {
                    Wrap::Repeat => {}
                    Wrap::Mirror => out.text(&format!(" tilestyle{way}=\"mirror\"")),
                    Wrap::Clamp => out.text(&format!(" tilestyle{way}=\"clamp\"")),
                }
            }
            out.text(if sampler.nearest { " filter=\"nearest\"/>" } else { "/>" });
            out.end_line()?;
        }
        Ok(())
    }

    /// Writes the colours and texture coordinates of a mesh.
    fn write_groups(
        &self,
        mesh: &TriMesh,
        properties: &Properties<'_>,
        ids: &MeshIds,
        out: &mut TextOut<'_>,
    ) -> io::Result<()> {
        if !properties.colors.is_empty() {
            out.text(&format!("  <m:colorgroup id=\"{}\">\n", ids.colors));
            for &color in &properties.colors {
                out.text(&format!("   <m:color color=\"{}\"/>", hex(color)));
                out.end_line()?;
            }
            out.text("  </m:colorgroup>\n");
        }
        for (at, coordinates) in properties.coordinates.iter().enumerate() {
            let TextureCoordinates { texture, wedges } = coordinates;
            let number = self.texture_numbers.get(&key_of(texture).0);
            let Some(texture) = number.filter(|_| !wedges.is_empty()) else { continue };
            let (id, texture) = (ids.coordinates + at, self.last_id + FIRST_TEXTURE + texture);
            out.text(&format!("  <m:texture2dgroup id=\"{id}\" texid=\"{texture}\">\n"));
            for [u, v] in coordinates.values(mesh) {
                out.text("   <m:tex2coord u=\"");
                out.parse_decimal(finite(u));
                out.text("\" v=\"");
                out.parse_decimal(finite(v));
                out.text("\"/>");
                out.end_line()?;
            }
            out.text("  </m:texture2dgroup>\n");
        }
        Ok(())
    }

    /// Writes an object of these pieces; returns the number of triangles that were written of each. Triangles with the same
    /// vertex twice are left out.
    fn write_object(
        &self,
        pieces: &[ObjectPiece<'_>],
        (id, facts): (usize, &ObjectFacts),
        out: &mut TextOut<'_>,
    ) -> io::Result<Vec<usize>> {
        let (_, first, properties, own_ids) = &pieces[0];
        write_begin(id, facts, &first.name, out);
        // An object whose triangles have properties must have a property itself, which applies to the other
        // triangles.
        let own = (first.mesh.face_count() > 0)
            .then(|| self.property(properties, own_ids, 0))
            .flatten()
            .map(|(group, [entry, ..])| (group, entry));
        if let Some((group, entry)) = own {
            out.text(&format!(" pid=\"{group}\" pindex=\"{entry}\""));
        }
        out.text(">\n   <mesh>\n    <vertices>\n");
        let (mut numbers, mut count) = (Vec::new(), 0);
        for (_, object, ..) in pieces {
            let (written, number) = write_vertices(object, out)?;
            numbers.push((count, number));
            count += written;
        }
        out.text("    </vertices>\n    <triangles>\n");
        let (mut counts, mut at) = (Vec::new(), 0);
        let mut sets = WrittenSets::default();
        for ((_, object, properties, ids), (offset, number)) in pieces.iter().zip(&numbers) {
            let before = at;
            let mut marks = RegionMarks::new(&object.marks, object.paint);
            sets.begin(&object.marks);
            let regions = object.mesh.regions();
            for (face, wedges) in object.mesh.triangles().iter().enumerate() {
                let vertices = wedges.map(|w| number(w) + offset);
                let [a, b, c] = vertices;
                if a == b || b == c || c == a {
                    continue;
                }
                for (name, vertex) in ["     <triangle v1=\"", "\" v2=\"", "\" v3=\""].iter().zip(vertices) {
                    out.text(name);
                    out.parse_integer(vertex);
                }
                if let Some((group, entries)) = self.property(properties, ids, face) {
                    let is_uniform = entries.iter().all(|e| *e == entries[0]);
                    if !(is_uniform && own == Some((group, entries[0]))) {
                        out.text("\" pid=\"");
                        out.parse_integer(group);
                        let count = if is_uniform { 1 } else { 3 };
                        let names = ["\" p1=\"", "\" p2=\"", "\" p3=\""];
                        for (name, entry) in names.iter().zip(entries).take(count) {
                            out.text(name);
                            out.parse_integer(entry);
                        }
                    }
                }
                let region = regions.map_or(0, |r| r[face].index());
                out.text("\"");
                marks.write(face, region, out);
                sets.add(region, at as u32);
                out.text("/>");
                out.end_line()?;
                at += 1;
            }
            counts.push(at - before);
        }
        out.text("    </triangles>\n");
        sets.write(out)?;
        out.text("   </mesh>\n  </object>\n");
        Ok(counts)
    }

    /// Returns the group of properties of a triangle and the entries of its corners.
    fn property(&self, properties: &Properties<'_>, ids: &MeshIds, face: usize) -> Option<(usize, [u32; 3])> {
        let wedges = properties.mesh.triangles()[face];
        match properties.shown(face) {
            Shown::Nothing => {
                properties.is_mixed().then_some((self.last_id + MATERIALS, [self.materials.len() as u32; 3]))
            }
            Shown::Material(material) => Some((
                self.last_id + MATERIALS,
                [self.materials.partition_point(|&m| m < material) as u32; 3],
            )),
            Shown::Colors => Some((ids.colors, wedges.map(|w| properties.color_entry(w)))),
            Shown::Texture(group) => {
                let coordinates = &properties.coordinates[group];
                Some((ids.coordinates + group, wedges.map(|w| coordinates.entry(w))))
            }
        }
    }
}

/// A piece of an object: the number of its volume, its mesh, the properties of its triangles and their numbers.
type ObjectPiece<'a> = (usize, &'a MeshObject<'a>, &'a Properties<'a>, MeshIds);

/// A function that returns the vertex of a wedge.
type VertexNumbers<'a> = Box<dyn Fn(WedgeId) -> u32 + 'a>;

/// Name of metadata: the program that wrote the file.
pub(super) const APPLICATION: &str = "Application";

/// Name of the material of triangles that have none, in an object where others have properties.
const DEFAULT: &str = "default";

/// Writes the vertices of an object; returns their number and a function that gives the vertex of a wedge.
fn write_vertices<'a>(
    object: &'a MeshObject<'_>,
    out: &mut TextOut<'_>,
) -> io::Result<(u32, VertexNumbers<'a>)> {
    fn row<T: zmij::Float + Copy>(out: &mut TextOut<'_>, p: &[T; 3]) -> io::Result<()> {
        for (name, &x) in ["     <vertex x=\"", "\" y=\"", "\" z=\""].iter().zip(p) {
            out.text(name);
            out.parse_decimal(x);
        }
        out.text("\"/>");
        out.end_line()
    }
    let mesh = object.mesh;
    if let (Some(sources), Positions::F32(positions)) = (&object.sources, mesh.positions()) {
        let mut first: Vec<(u32, u32)> =
            sources.iter().zip(0..).map(|(&source, wedge)| (source, wedge)).collect();
        first.sort_unstable();
        first.dedup_by_key(|(source, _)| *source);
        for &(_, wedge) in &first {
            row(out, &positions[mesh.vertex_of(WedgeId(wedge)).index()])?;
        }
        let count = first.len() as u32;
        let number = move |w: WedgeId| {
            let source = sources[w.index()];
            first.partition_point(|(s, _)| *s < source) as u32
        };
        return Ok((count, Box::new(number)));
    }
    match mesh.positions() {
        Positions::F32(all) => all.iter().try_for_each(|p| row(out, p))?,
        Positions::F64(all) => all.iter().try_for_each(|p| row(out, p))?,
    }
    Ok((mesh.vertex_count() as u32, Box::new(|w| mesh.vertex_of(w).0)))
}

/// Writes the begin of an object, but for its end.
fn write_begin(id: usize, facts: &ObjectFacts, name: &str, out: &mut TextOut<'_>) {
    let kind = facts.kind.unwrap_or("model");
    out.text(&format!("  <object id=\"{id}\" type=\"{kind}\""));
    write_name(name, out);
}

fn write_name(name: &str, out: &mut TextOut<'_>) {
    if !name.is_empty() {
        out.text(&format!(" name=\"{}\"", escaped(name)));
    }
}

/// Writes an item or a component.
fn write_place(element: &str, place: &ObjectPlace, id: usize, out: &mut TextOut<'_>) -> io::Result<()> {
    out.text(&format!("{element} objectid=\"{id}\""));
    if place.transform != DMat4::IDENTITY {
        out.text(" transform=\"");
        let m = place.transform;
        let columns = [m.x_axis, m.y_axis, m.z_axis, m.w_axis];
        for (at, x) in columns.iter().flat_map(|c| c.truncate().to_array()).enumerate() {
            if at > 0 {
                out.byte(b' ');
            }
            // Without the sign of a zero.
            out.parse_decimal(x + 0.0);
        }
        out.byte(b'"');
    }
    if element.ends_with("<item") {
        place.marks.iter().for_each(|mark| out.text(&format!(" {}=\"0\"", mark.name())));
    }
    out.text("/>");
    out.end_line()
}

/// Returns zero for a number that XML cannot hold.
fn finite(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

/// Returns a colour as `#RRGGBB`, with its alpha if it has one.
fn hex([r, g, b, a]: [u8; 4]) -> String {
    let alpha = if a == 255 { String::new() } else { format!("{a:02X}") };
    format!("#{r:02X}{g:02X}{b:02X}{alpha}")
}
