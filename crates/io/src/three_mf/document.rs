//! The text of a model part: resources and the build.

use std::collections::{BTreeSet, HashMap};
use std::io;

use glam::DMat4;
use lodsmith_core::model::{TextureRef, Wrap};
use lodsmith_core::{Positions, TriMesh, WedgeId};

use super::assemblies::{Assemblies, ObjectPlace, ObjectRef};
use super::looks::{Looks, LostParts, key_of};
use super::properties::{Properties, Shown, TextureCoordinates, bytes_of_linear};
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
}

/// The numbers of the resources of a mesh.
struct MeshIds {
    colors: usize,
    /// The first group of texture coordinates.
    coordinates: usize,
    object: usize,
}

/// The numbers of resources: groups for all objects, then the textures, then the objects with their own groups.
const MATERIALS: usize = 1;
const DISPLAY: usize = 2;
const FIRST_TEXTURE: usize = 3;

impl<'a> ModelPart<'a> {
    pub(super) fn new(looks: &'a Looks, objects: &'a [Option<MeshObject<'a>>], lost: &mut LostParts) -> Self {
        let mut is_rounded = false;
        let mut of_object = |object: &'a MeshObject<'a>| {
            Properties::new(object.mesh, looks, &object.of_region, (&mut *lost, &mut is_rounded))
        };
        let properties: Vec<Option<Properties<'_>>> =
            objects.iter().map(|object| object.as_ref().map(&mut of_object)).collect();
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
        Self { looks, objects, properties, materials, has_default, textures, texture_numbers, is_rounded }
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

    /// Writes the part; returns the number of triangles that were left out.
    pub(super) fn write(
        &self,
        placed: &Assemblies,
        metadata: &[(String, String)],
        out: &mut TextOut<'_>,
    ) -> io::Result<usize> {
        out.text("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"");
        out.text(placed.unit.name());
        out.text("\" xml:lang=\"en-US\" xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"");
        out.text(" xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\">\n");
        for (name, value) in metadata {
            out.text(&format!(" <metadata name=\"{name}\">{}</metadata>\n", escaped(value)));
        }
        out.text(" <metadata name=\"Application\">Lodsmith</metadata>\n <resources>\n");
        self.write_materials(out)?;
        self.write_textures(out)?;
        let (mut next, mut skipped) = (FIRST_TEXTURE + self.textures.len(), 0);
        let mut ids = Vec::new();
        for (object, properties) in self.objects.iter().zip(&self.properties) {
            let (Some(object), Some(properties)) = (object, properties) else {
                ids.push(0);
                continue;
            };
            let own = MeshIds {
                colors: next,
                coordinates: next + 1,
                object: next + 1 + properties.coordinates.len(),
            };
            next = own.object + 1;
            ids.push(own.object);
            self.write_groups(object.mesh, properties, &own, out)?;
            skipped += self.write_object(object, properties, &own, out)?;
        }
        let first_assembly = next;
        let number = |object: ObjectRef| match object {
            ObjectRef::Mesh(mesh) => ids[mesh],
            ObjectRef::Assembly(at) => first_assembly + at,
        };
        for (at, assembly) in placed.all.iter().enumerate() {
            out.text(&format!("  <object id=\"{}\" type=\"model\"", first_assembly + at));
            write_name(&assembly.name, out);
            out.text(">\n   <components>\n");
            for component in &assembly.components {
                write_place("    <component", component, number(component.object), out)?;
            }
            out.text("   </components>\n  </object>\n");
        }
        out.text(" </resources>\n <build>\n");
        for item in &placed.items {
            write_place("  <item", item, number(item.object), out)?;
        }
        out.text(" </build>\n</model>\n");
        out.finish()?;
        Ok(skipped)
    }

    fn write_materials(&self, out: &mut TextOut<'_>) -> io::Result<()> {
        if self.materials.is_empty() && !self.has_default {
            return Ok(());
        }
        let looks = || self.materials.iter().map(|&m| &self.looks.all[m]);
        let mut display = String::new();
        if !looks().all(|look| look.is_dull()) {
            display = format!(" m:displaypropertiesid=\"{DISPLAY}\"");
            out.text(&format!("  <m:pbmetallicdisplayproperties id=\"{DISPLAY}\">\n"));
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
        out.text(&format!("  <basematerials id=\"{MATERIALS}\"{display}>\n"));
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
            let (id, path) = (FIRST_TEXTURE + at, self.looks.path_of(*picture));
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
            let (id, texture) = (ids.coordinates + at, FIRST_TEXTURE + texture);
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

    /// Writes an object; returns the number of triangles that were left out.
    fn write_object(
        &self,
        object: &MeshObject<'_>,
        properties: &Properties<'_>,
        ids: &MeshIds,
        out: &mut TextOut<'_>,
    ) -> io::Result<usize> {
        let mesh = object.mesh;
        let property = |face: usize| self.property(properties, ids, face);
        out.text(&format!("  <object id=\"{}\" type=\"model\"", ids.object));
        write_name(&object.name, out);
        // An object whose triangles have properties must have a property itself, which applies to the other
        // triangles.
        let own =
            (mesh.face_count() > 0).then(|| property(0)).flatten().map(|(group, [first, ..])| (group, first));
        if let Some((group, entry)) = own {
            out.text(&format!(" pid=\"{group}\" pindex=\"{entry}\""));
        }
        out.text(">\n   <mesh>\n    <vertices>\n");
        let vertex_of = write_vertices(object, out)?;
        out.text("    </vertices>\n    <triangles>\n");
        let mut skipped = 0;
        for (face, wedges) in mesh.triangles().iter().enumerate() {
            let vertices = wedges.map(&vertex_of);
            let [a, b, c] = vertices;
            if a == b || b == c || c == a {
                skipped += 1;
                continue;
            }
            for (name, vertex) in ["     <triangle v1=\"", "\" v2=\"", "\" v3=\""].iter().zip(vertices) {
                out.text(name);
                out.parse_integer(vertex);
            }
            if let Some((group, entries)) = property(face) {
                let is_uniform = entries.iter().all(|e| *e == entries[0]);
                if !(is_uniform && own == Some((group, entries[0]))) {
                    out.text("\" pid=\"");
                    out.parse_integer(group);
                    let count = if is_uniform { 1 } else { 3 };
                    for (name, entry) in ["\" p1=\"", "\" p2=\"", "\" p3=\""].iter().zip(entries).take(count)
                    {
                        out.text(name);
                        out.parse_integer(entry);
                    }
                }
            }
            out.text("\"/>");
            out.end_line()?;
        }
        out.text("    </triangles>\n   </mesh>\n  </object>\n");
        Ok(skipped)
    }

    /// Returns the group of properties of a triangle and the entries of its corners.
    fn property(&self, properties: &Properties<'_>, ids: &MeshIds, face: usize) -> Option<(usize, [u32; 3])> {
        let wedges = properties.mesh.triangles()[face];
        match properties.shown(face) {
            Shown::Nothing => properties.is_mixed().then_some((MATERIALS, [self.materials.len() as u32; 3])),
            Shown::Material(material) => {
                Some((MATERIALS, [self.materials.partition_point(|&m| m < material) as u32; 3]))
            }
            Shown::Colors => Some((ids.colors, wedges.map(|w| properties.color_entry(w)))),
            Shown::Texture(group) => {
                let coordinates = &properties.coordinates[group];
                Some((ids.coordinates + group, wedges.map(|w| coordinates.entry(w))))
            }
        }
    }
}

/// Name of the material of triangles that have none, in an object where others have properties.
const DEFAULT: &str = "default";

/// Writes the vertices of an object; returns a function that gives the vertex of a wedge.
fn write_vertices<'a>(
    object: &'a MeshObject<'_>,
    out: &mut TextOut<'_>,
) -> io::Result<Box<dyn Fn(WedgeId) -> u32 + 'a>> {
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
        return Ok(Box::new(move |w| {
            let source = sources[w.index()];
            first.partition_point(|(s, _)| *s < source) as u32
        }));
    }
    match mesh.positions() {
        Positions::F32(all) => all.iter().try_for_each(|p| row(out, p))?,
        Positions::F64(all) => all.iter().try_for_each(|p| row(out, p))?,
    }
    Ok(Box::new(|w| mesh.vertex_of(w).0))
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
    out.text("/>");
    out.end_line()
}

/// Returns zero for a number that XML cannot hold.
fn finite(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

/// Returns a text for XML, with characters that it cannot hold replaced.
fn escaped(text: &str) -> String {
    let plain: String = text
        .chars()
        .map(|c| if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') { '_' } else { c })
        .collect();
    quick_xml::escape::escape(&plain).into_owned()
}

/// Returns a colour as `#RRGGBB`, with its alpha if it has one.
fn hex([r, g, b, a]: [u8; 4]) -> String {
    let alpha = if a == 255 { String::new() } else { format!("{a:02X}") };
    format!("#{r:02X}{g:02X}{b:02X}{alpha}")
}
