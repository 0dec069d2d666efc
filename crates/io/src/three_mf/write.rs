//! Writer of a mesh as a 3MF file with one object.

use std::collections::HashMap;
use std::io::{self, Write};

use lodsmith_core::{Positions, TriMesh, WedgeId};
use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, ZipWriter};

use crate::error::{Warning, WriteError};
use crate::frame::{Frame, Unit};
use crate::gltf::srgb_of_linear;
use crate::material::{ConvertedMaterial, ConvertedMaterials, Purpose, Regions, Textures, convert_materials};
use crate::numbers::TextOut;
use crate::options::WriteOptions;

const TYPES: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">
 <Default Extension=\"rels\" ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>
 <Default Extension=\"model\" ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/>
 <Default Extension=\"png\" ContentType=\"image/png\"/>
 <Default Extension=\"jpg\" ContentType=\"image/jpeg\"/>
</Types>
";
const RELATIONS: &str = "http://schemas.openxmlformats.org/package/2006/relationships";
const MODEL_TYPE: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
const TEXTURE_TYPE: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dtexture";
/// Level of compression; see the constant of the same kind for `.gz`.
const COMPRESSION: i64 = 3;
/// Identifiers of the resources: one object, one group of each kind, then two for each texture.
const OBJECT: usize = 1;
const MATERIALS: usize = 2;
const COLORS: usize = 3;
const DISPLAY: usize = 4;
const FIRST_TEXTURE: usize = 5;

type Archive<'a> = ZipWriter<StreamWriter<&'a mut dyn Write>>;

pub(super) fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    if !mesh.positions().view().iter().flatten().all(f64::is_finite) {
        let what = "coordinates that are not finite".to_owned();
        return Err(io::Error::other(WriteError::TooLarge { format: "3MF", what }));
    }
    let mut looks = options
        .regions
        .as_deref()
        .filter(|_| options.textures != Textures::None)
        .and_then(|regions| convert_materials(mesh, regions, Purpose::Gltf))
        .unwrap_or_default();
    let mut warnings = std::mem::take(&mut looks.warnings);
    let is_linear = options.regions.as_deref().is_some_and(|regions| regions.has_linear_colors);
    let properties = Properties::new(mesh, &looks, is_linear);
    warnings.extend(properties.warnings());

    let mut zip: Archive<'_> = ZipWriter::new_stream(out);
    let model = properties.used_images().map(|image| texture_path(&looks, image)).collect::<Vec<_>>();
    start(&mut zip, "[Content_Types].xml", 0)?;
    zip.write_all(TYPES.as_bytes())?;
    start(&mut zip, "_rels/.rels", 0)?;
    zip.write_all(relations(MODEL_TYPE, &["/3D/3dmodel.model".to_owned()]).as_bytes())?;
    // A triangle with properties takes less than this as text, and a vertex too.
    start(&mut zip, "3D/3dmodel.model", 128 * (mesh.face_count() + mesh.vertex_count()))?;
    let skipped = properties.write_model(options.regions.as_deref().and_then(Regions::frame), &mut zip)?;
    if !model.is_empty() {
        start(&mut zip, "3D/_rels/3dmodel.model.rels", 0)?;
        zip.write_all(relations(TEXTURE_TYPE, &model).as_bytes())?;
        for image in properties.used_images() {
            let bytes = &looks.images[image].bytes;
            start(&mut zip, texture_path(&looks, image).trim_start_matches('/'), bytes.len())?;
            zip.write_all(bytes)?;
        }
    }
    zip.finish().map_err(io::Error::from)?;
    if skipped > 0 {
        let text =
            format!("{skipped} triangles have the same vertex twice, which 3MF does not allow: left out");
        warnings.push(Warning::lost(text));
    }
    Ok(warnings)
}

fn start(zip: &mut Archive<'_>, name: &str, bytes: usize) -> io::Result<()> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(COMPRESSION))
        // Sizes of 64 bits, where they may be needed.
        .large_file(bytes >= 1 << 31);
    Ok(zip.start_file(name, options)?)
}

fn relations(kind: &str, targets: &[String]) -> String {
    let mut text =
        format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Relationships xmlns=\"{RELATIONS}\">\n");
    for (i, target) in targets.iter().enumerate() {
        text.push_str(&format!(" <Relationship Target=\"{target}\" Id=\"rel{i}\" Type=\"{kind}\"/>\n"));
    }
    text + "</Relationships>\n"
}

fn texture_path(looks: &ConvertedMaterials, image: usize) -> String {
    let ending = if looks.images[image].kind == "image/png" { "png" } else { "jpg" };
    format!("/3D/Textures/texture_{image}.{ending}")
}

/// The properties of the triangles of a mesh.
struct Properties<'a> {
    mesh: &'a TriMesh,
    looks: &'a ConvertedMaterials,
    /// The image of each material; none if the mesh has no texture coordinates.
    images: Vec<Option<usize>>,
    /// Distinct colours of wedges, and that of each wedge; empty if the mesh has none.
    colors: Vec<[u8; 4]>,
    color_of: Vec<u32>,
    /// True if colours had more digits than a byte.
    is_rounded: bool,
}

impl<'a> Properties<'a> {
    fn new(mesh: &'a TriMesh, looks: &'a ConvertedMaterials, is_linear: bool) -> Self {
        let images = looks.all.iter().map(|look| look.color_image.filter(|_| mesh.uvs().is_some())).collect();
        let (mut colors, mut color_of, mut numbers) = (Vec::new(), Vec::new(), HashMap::new());
        let mut is_rounded = false;
        for &[r, g, b, a] in mesh.colors().unwrap_or_default() {
            let [r, g, b] = if is_linear { [r, g, b].map(srgb_of_linear) } else { [r, g, b] };
            let bytes = [r, g, b, a].map(|x| {
                let byte = (x * 255.0).round().clamp(0.0, 255.0);
                is_rounded |= byte / 255.0 != x;
                byte as u8
            });
            color_of.push(*numbers.entry(bytes).or_insert_with(|| {
                colors.push(bytes);
                colors.len() as u32 - 1
            }));
        }
        Self { mesh, looks, images, colors, color_of, is_rounded }
    }

    fn used_images(&self) -> impl Iterator<Item = usize> {
        (0..self.looks.images.len()).filter(|image| self.images.contains(&Some(*image)))
    }

    fn warnings(&self) -> Vec<Warning> {
        let mut lost = Vec::new();
        if self.mesh.normals().is_some() {
            lost.push("normals of vertices");
        }
        let has_images = self.images.iter().any(Option::is_some);
        if self.mesh.uvs().is_some() && !has_images {
            lost.push("texture coordinates without a texture");
        }
        if self.looks.all.iter().any(|look| look.normal_image.is_some()) {
            lost.push("normal maps");
        }
        if self.looks.all.iter().any(|look| look.emission != [0.0; 3] || look.emission_image.is_some()) {
            lost.push("emission");
        }
        if self.has_colored(|face| self.image_of(face).is_some()) {
            lost.push("colours of triangles with a texture");
        }
        let is_tinted = |material: usize| self.looks.all[material].color != [1.0; 3];
        if self.has_colored(|face| {
            self.image_of(face).is_none() && self.material_of(face).is_some_and(is_tinted)
        }) {
            lost.push("materials of triangles with colours");
        }
        let text = |what: &str| format!("3MF cannot carry {what}: dropped");
        let mut warnings: Vec<Warning> = lost.into_iter().map(|what| Warning::lost(text(what))).collect();
        if self.is_rounded {
            warnings.push(Warning::note("3MF holds colours as bytes: they are rounded"));
        }
        warnings
    }

    /// Returns true if corners have colours other than white.
    fn is_colored(&self, wedges: &[WedgeId; 3]) -> bool {
        let is_white = |w: &WedgeId| self.colors[self.color_of[w.index()] as usize] == [255; 4];
        !self.colors.is_empty() && !wedges.iter().all(is_white)
    }

    /// Returns true if a triangle with colours of its own is of this kind.
    fn has_colored(&self, is: impl Fn(usize) -> bool) -> bool {
        self.mesh.triangles().iter().enumerate().any(|(face, wedges)| self.is_colored(wedges) && is(face))
    }

    /// Returns the material of a face.
    fn material_of(&self, face: usize) -> Option<usize> {
        let region = self.mesh.regions().map_or(0, |regions| regions[face].index());
        self.looks.of_region.get(region).copied().flatten()
    }

    /// Returns the image of a face.
    fn image_of(&self, face: usize) -> Option<usize> {
        self.material_of(face).and_then(|m| self.images[m])
    }

    /// Writes the model part; returns the number of triangles that were left out.
    fn write_model(&self, frame: Option<Frame>, out: &mut dyn Write) -> io::Result<usize> {
        let frame = frame.unwrap_or(Frame::new(Unit::Millimeter, true));
        let mut text = TextOut::new(out);
        text.text("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"");
        text.text(frame.unit.name());
        text.text(
            "\" xml:lang=\"en-US\" xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"",
        );
        text.text(" xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\">\n");
        text.text(" <metadata name=\"Application\">Lodsmith</metadata>\n <resources>\n");
        self.write_groups(&mut text)?;
        text.text(&format!("  <object id=\"{OBJECT}\" type=\"model\">\n   <mesh>\n    <vertices>\n"));
        self.write_vertices(&mut text)?;
        text.text("    </vertices>\n    <triangles>\n");
        let skipped = self.write_triangles(&mut text)?;
        text.text("    </triangles>\n   </mesh>\n  </object>\n </resources>\n <build>\n");
        text.text(&format!("  <item objectid=\"{OBJECT}\""));
        if !frame.z_up {
            text.text(" transform=\"1 0 0 0 0 1 0 -1 0 0 0 0\"");
        }
        text.text("/>\n </build>\n</model>\n");
        text.finish()?;
        Ok(skipped)
    }

    fn write_groups(&self, text: &mut TextOut<'_>) -> io::Result<()> {
        if self.looks.all.iter().zip(&self.images).any(|(_, image)| image.is_none()) {
            let is_default = |look: &ConvertedMaterial| look.metalness == 0.0 && look.roughness == 1.0;
            let mut display = String::new();
            if !self.looks.all.iter().all(is_default) {
                display = format!(" m:displaypropertiesid=\"{DISPLAY}\"");
                text.text(&format!("  <m:pbmetallicdisplayproperties id=\"{DISPLAY}\">\n"));
                for ConvertedMaterial { name, metalness, roughness, .. } in &self.looks.all {
                    let name = quick_xml::escape::escape(name);
                    text.text(&format!(
                        "   <m:pbmetallic name=\"{name}\" metallicness=\"{metalness}\" roughness=\"{roughness}\"/>"
                    ));
                    text.end_line()?;
                }
                text.text("  </m:pbmetallicdisplayproperties>\n");
            }
            text.text(&format!("  <basematerials id=\"{MATERIALS}\"{display}>\n"));
            for look in &self.looks.all {
                let [r, g, b] = look.color.map(|x| byte(srgb_of_linear(x as f32)));
                let color = hex([r, g, b, byte(look.alpha as f32)]);
                let name = quick_xml::escape::escape(&look.name);
                text.text(&format!("   <base name=\"{name}\" displaycolor=\"{color}\"/>"));
                text.end_line()?;
            }
            text.text("  </basematerials>\n");
        }
        if !self.colors.is_empty() {
            text.text(&format!("  <m:colorgroup id=\"{COLORS}\">\n"));
            for &color in &self.colors {
                text.text(&format!("   <m:color color=\"{}\"/>\n", hex(color)));
                text.end_line()?;
            }
            text.text("  </m:colorgroup>\n");
        }
        for image in self.used_images() {
            let (id, path) = (FIRST_TEXTURE + 2 * image, texture_path(self.looks, image));
            let kind = self.looks.images[image].kind;
            text.text(&format!("  <m:texture2d id=\"{id}\" path=\"{path}\" contenttype=\"{kind}\"/>\n"));
            text.text(&format!("  <m:texture2dgroup id=\"{}\" texid=\"{id}\">\n", id + 1));
            for [u, v] in self.mesh.uvs().unwrap_or_default() {
                text.text("   <m:tex2coord u=\"");
                text.parse_decimal(finite(*u));
                text.text("\" v=\"");
                text.parse_decimal(finite(*v));
                text.text("\"/>");
                text.end_line()?;
            }
            text.text("  </m:texture2dgroup>\n");
        }
        Ok(())
    }

    fn write_vertices(&self, text: &mut TextOut<'_>) -> io::Result<()> {
        fn row<T: zmij::Float + Copy>(text: &mut TextOut<'_>, p: &[T; 3]) -> io::Result<()> {
            for (name, &x) in ["     <vertex x=\"", "\" y=\"", "\" z=\""].iter().zip(p) {
                text.text(name);
                text.parse_decimal(x);
            }
            text.text("\"/>");
            text.end_line()
        }
        match self.mesh.positions() {
            Positions::F32(all) => all.iter().try_for_each(|p| row(text, p)),
            Positions::F64(all) => all.iter().try_for_each(|p| row(text, p)),
        }
    }

    fn write_triangles(&self, text: &mut TextOut<'_>) -> io::Result<usize> {
        let mut skipped = 0;
        for (face, wedges) in self.mesh.triangles().iter().enumerate() {
            let vertices = wedges.map(|w| self.mesh.vertex_of(w).0);
            let [a, b, c] = vertices;
            if a == b || b == c || c == a {
                skipped += 1;
                continue;
            }
            for (name, vertex) in ["     <triangle v1=\"", "\" v2=\"", "\" v3=\""].iter().zip(vertices) {
                text.text(name);
                text.parse_integer(vertex);
            }
            if let Some((group, entries)) = self.of_triangle(face, *wedges) {
                text.text("\" pid=\"");
                text.parse_integer(group);
                let is_uniform = entries.iter().all(|e| *e == entries[0]);
                let count = if is_uniform { 1 } else { 3 };
                for (name, entry) in ["\" p1=\"", "\" p2=\"", "\" p3=\""].iter().zip(entries).take(count) {
                    text.text(name);
                    text.parse_integer(entry);
                }
            }
            text.text("\"/>");
            text.end_line()?;
        }
        Ok(skipped)
    }

    /// Returns the group of properties of a triangle and the entries of its corners: a texture, else colours other
    /// than white, else a material.
    fn of_triangle(&self, face: usize, wedges: [WedgeId; 3]) -> Option<(usize, [u32; 3])> {
        if let Some(image) = self.image_of(face) {
            return Some((FIRST_TEXTURE + 2 * image + 1, wedges.map(|w| w.0)));
        }
        if self.is_colored(&wedges) {
            return Some((COLORS, wedges.map(|w| self.color_of[w.index()])));
        }
        self.material_of(face).map(|m| (MATERIALS, [m as u32; 3]))
    }
}

/// Returns zero for a number that XML cannot hold.
fn finite(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

fn byte(x: f32) -> u8 {
    (x * 255.0).round().clamp(0.0, 255.0) as u8
}

/// Returns a colour as `#RRGGBB`, with its alpha if it has one.
fn hex([r, g, b, a]: [u8; 4]) -> String {
    let alpha = if a == 255 { String::new() } else { format!("{a:02X}") };
    format!("#{r:02X}{g:02X}{b:02X}{alpha}")
}
