//! Construction of the glTF file of a mesh.

use std::borrow::Cow;

use lodsmith_core::numbers::counted;
use lodsmith_core::{Bounds, Positions, TriMesh, VertexId, WedgeId};
use serde_json::{Value, json};

use super::container::FileParts;
use crate::attributes::{linear_colors, rounding_warning};
use crate::error::Warning;
use crate::frame::Frame;
use crate::material::{ConvertedMaterial, ConvertedMaterials, Purpose, Regions, Textures, convert_materials};
use crate::options::WriteOptions;

/// glTF codes of component types and of view targets.
pub(super) const U8: u32 = 5121;
pub(super) const U16: u32 = 5123;
const U32: u32 = 5125;
pub(super) const F32: u32 = 5126;
pub(super) const VERTEX_TARGET: u32 = 34962;
const INDEX_TARGET: u32 = 34963;
/// For data that is neither vertices nor indices.
pub(super) const NO_TARGET: u32 = 0;

/// Makes the file of a mesh; see [`write`](fn@super::write).
pub(super) fn parts(mesh: &TriMesh, options: &WriteOptions) -> FileParts {
    let regions = options.regions.as_deref();
    let mut looks = regions
        .filter(|_| options.textures != Textures::None)
        .and_then(|regions| convert_materials(mesh, regions, Purpose::Gltf))
        .unwrap_or_default();
    let frame = regions.and_then(Regions::frame).unwrap_or(Frame::GLTF);
    let mut warnings = std::mem::take(&mut looks.warnings);
    let mut file = GltfBuilder::default();
    // Without attributes, wedges carry no information: the vertices are written as they are.
    let split = mesh.has_attributes() && mesh.vertex_map().is_some();
    let surface;
    let (count, triangles): (usize, &[[u32; 3]]) = if split {
        (mesh.wedge_count(), bytemuck::cast_slice(mesh.triangles()))
    } else {
        surface = mesh.surface();
        (mesh.vertex_count(), bytemuck::cast_slice(surface.triangles()))
    };
    let vertex = |i: usize| if split { mesh.vertex_of(WedgeId::new(i)) } else { VertexId::new(i) };

    let center = center(mesh);
    warnings.extend(rounding_warning(mesh, "glTF", center));
    let positions: Vec<[f32; 3]> = match mesh.positions() {
        Positions::F32(p) => (0..count).map(|i| p[vertex(i).index()]).collect(),
        Positions::F64(p) => {
            let from = center.unwrap_or([0.0; 3]);
            let relative = |p: [f64; 3]| [0, 1, 2].map(|k| (p[k] - from[k]) as f32);
            (0..count).map(|i| relative(p[vertex(i).index()])).collect()
        }
    };
    let mut attributes = json!({ "POSITION": file.positions(&positions) });
    drop(positions);
    if let Some(normals) = mesh.normals() {
        attributes["NORMAL"] = file.normals(normals, &mut warnings).into();
    }
    if let Some(uvs) = mesh.uvs() {
        file.begin(F32, "VEC2", uvs.len(), VERTEX_TARGET);
        // In glTF, texture coordinates start at the upper left corner of the image.
        uvs.iter().for_each(|uv| file.floats(&[uv[0], 1.0 - uv[1]]));
        attributes["TEXCOORD_0"] = file.end().into();
    }
    if let Some(colors) = mesh.colors() {
        attributes["COLOR_0"] = file.colors(&linear_colors(colors)).into();
    }
    if mesh.uvs().is_none() && !looks.images.is_empty() {
        let text = "textures are left out: the mesh has no texture coordinates";
        warnings.push(Warning::lost(text));
        looks.images.clear();
        for look in &mut looks.all {
            (look.color_image, look.normal_image, look.emission_image) = (None, None, None);
        }
    }
    let mut primitives = Vec::new();
    for (look, triangles) in by_look(mesh, &looks, triangles) {
        let indices = file.indices(&triangles, count);
        let mut primitive = json!({ "attributes": attributes, "indices": indices, "mode": 4 });
        if let Some(look) = look {
            primitive["material"] = look.into();
        }
        primitives.push(primitive);
    }
    let (json, bytes) = file.finish(primitives, &looks, node(frame, center));
    FileParts { json, bytes, warnings }
}

/// A material, if any, and its triangles.
type MaterialGroup<'t> = (Option<usize>, Cow<'t, [[u32; 3]]>);

/// Groups the triangles by material, in the order of the file; materials in the order in which they first
/// appear.
fn by_look<'t>(
    mesh: &TriMesh,
    looks: &ConvertedMaterials,
    triangles: &'t [[u32; 3]],
) -> Vec<MaterialGroup<'t>> {
    let of_region = |region: usize| looks.of_region.get(region).copied().flatten();
    let Some(regions) = mesh.regions().filter(|_| looks.all.len() > 1 || looks.of_region.contains(&None))
    else {
        return vec![(of_region(0), Cow::Borrowed(triangles))];
    };
    // The last group is for faces without a material.
    let mut groups: Vec<Vec<[u32; 3]>> = vec![Vec::new(); looks.all.len() + 1];
    for (&triangle, region) in triangles.iter().zip(regions) {
        groups[of_region(region.index()).unwrap_or(looks.all.len())].push(triangle);
    }
    let look = |at: usize| (at < looks.all.len()).then_some(at);
    let all = groups.into_iter().enumerate().filter(|(_, g)| !g.is_empty());
    let mut all: Vec<MaterialGroup<'t>> = all.map(|(at, g)| (look(at), Cow::Owned(g))).collect();
    if all.is_empty() {
        all.push((None, Cow::Borrowed(triangles)));
    }
    all
}

/// Converts a material to glTF.
fn material(look: &ConvertedMaterial) -> Value {
    let [r, g, b] = if look.color_image.is_some() && !look.is_tinted { [1.0; 3] } else { look.color };
    let mut surface = json!({ "metallicFactor": look.metalness, "roughnessFactor": look.roughness });
    if [r, g, b, look.alpha] != [1.0; 4] {
        surface["baseColorFactor"] = json!([r, g, b, look.alpha]);
    }
    if let Some(image) = look.color_image {
        surface["baseColorTexture"] = json!({ "index": image });
    }
    let mut material = json!({ "name": look.name, "pbrMetallicRoughness": surface });
    if let Some(image) = look.normal_image {
        material["normalTexture"] = json!({ "index": image });
    }
    if look.emission != [0.0; 3] {
        material["emissiveFactor"] = json!(look.emission);
    }
    if let Some(image) = look.emission_image {
        material["emissiveTexture"] = json!({ "index": image });
    }
    if look.alpha < 1.0 || (look.is_blended && look.color_image.is_some()) {
        material["alphaMode"] = "BLEND".into();
    }
    material
}

/// Returns the node of a mesh with these coordinates, whose origin is at `center` of them.
fn node(frame: Frame, center: Option<[f64; 3]>) -> Value {
    let mut node = json!({ "mesh": 0 });
    let scale = frame.unit.meters();
    if let Some(center) = center {
        node["translation"] = json!(frame.turned(center, Frame::GLTF).map(|x| x * scale));
    }
    if let Some(rotation) = frame.rotation_to_gltf() {
        node["rotation"] = json!(rotation);
    }
    if scale != 1.0 {
        node["scale"] = json!([scale, scale, scale]);
    }
    node
}

/// Returns the part of double positions that becomes the node's translation: the centre of their box, if it
/// is far from the origin for the size of the box.
fn center(mesh: &TriMesh) -> Option<[f64; 3]> {
    if !matches!(mesh.positions(), Positions::F64(_)) {
        return None;
    }
    let bounds = mesh.positions().view().bounds()?;
    let Bounds { min, max } = bounds;
    // Rounded to a float: short in JSON, and exact for every reader.
    let middle = [0, 1, 2].map(|k| f64::from((min[k] / 2.0 + max[k] / 2.0) as f32));
    let far = middle.iter().fold(0f64, |m, x| m.max(x.abs()));
    (far > bounds.diagonal() && far.is_finite()).then_some(middle)
}

/// Buffer, views and accessors of a file. Each accessor has a view of its own.
#[derive(Default)]
pub(super) struct GltfBuilder {
    pub(super) bytes: Vec<u8>,
    pub(super) views: Vec<Value>,
    pub(super) accessors: Vec<Value>,
    /// Start of the view that is being filled.
    start: usize,
}

impl GltfBuilder {
    /// Begins an accessor.
    pub(super) fn begin(&mut self, component: u32, kind: &str, count: usize, target: u32) {
        self.start = self.bytes.len();
        let mut view = json!({ "buffer": 0, "byteOffset": self.start });
        if target != NO_TARGET {
            view["target"] = target.into();
        }
        self.views.push(view);
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1, "componentType": component, "count": count, "type": kind,
        }));
    }

    /// Ends the accessor; returns its index.
    pub(super) fn end(&mut self) -> usize {
        let last = self.views.len() - 1;
        self.views[last]["byteLength"] = (self.bytes.len() - self.start).into();
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        self.accessors.len() - 1
    }

    #[inline]
    pub(super) fn floats(&mut self, numbers: &[f32]) {
        numbers.iter().for_each(|x| self.bytes.extend_from_slice(&x.to_le_bytes()));
    }

    pub(super) fn positions(&mut self, positions: &[[f32; 3]]) -> usize {
        self.begin(F32, "VEC3", positions.len(), VERTEX_TARGET);
        let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in positions {
            self.floats(p);
            // JSON has no NaN or infinity.
            for k in (0..3).filter(|&k| p[k].is_finite()) {
                min[k] = min[k].min(p[k]);
                max[k] = max[k].max(p[k]);
            }
        }
        let index = self.end();
        let shown = |b: [f32; 3]| b.map(|x| if x.is_finite() { f64::from(x) } else { 0.0 });
        self.accessors[index]["min"] = json!(shown(min));
        self.accessors[index]["max"] = json!(shown(max));
        index
    }

    pub(super) fn normals(&mut self, normals: &[[f32; 3]], warnings: &mut Vec<Warning>) -> usize {
        self.begin(F32, "VEC3", normals.len(), VERTEX_TARGET);
        let mut replaced = 0usize;
        for &n in normals {
            let length = n.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
            // glTF requires unit length; the tolerance is well within that of the glTF validator.
            let n = if (length - 1.0).abs() <= 1e-4 {
                n
            } else if length > 0.0 && length.is_finite() {
                n.map(|x| (f64::from(x) / length) as f32)
            } else {
                replaced += 1;
                [0.0, 0.0, 1.0]
            };
            self.floats(&n);
        }
        if replaced > 0 {
            let normals = counted(replaced, "normal has", "normals have");
            warnings.push(Warning::note(format!("{normals} length zero: written as (0, 0, 1)")));
        }
        self.end()
    }

    /// Adds linear colours: as bytes or as 16 bits if these represent them, else as floats.
    pub(super) fn colors(&mut self, colors: &[[f32; 4]]) -> usize {
        let are_steps = |steps: f32| {
            let is_step = |x: f32| (0.0..=1.0).contains(&x) && (x * steps).round() / steps == x;
            colors.iter().flatten().all(|&x| is_step(x))
        };
        let (are_bytes, are_words) = (are_steps(255.0), are_steps(65535.0));
        let all = colors.iter().flatten();
        if are_bytes {
            self.begin(U8, "VEC4", colors.len(), VERTEX_TARGET);
            self.bytes.extend(all.map(|x| (x * 255.0).round() as u8));
        } else if are_words {
            self.begin(U16, "VEC4", colors.len(), VERTEX_TARGET);
            self.bytes.extend(all.flat_map(|x| ((x * 65535.0).round() as u16).to_le_bytes()));
        } else {
            self.begin(F32, "VEC4", colors.len(), VERTEX_TARGET);
            self.floats(colors.as_flattened());
            return self.end();
        }
        let index = self.end();
        self.accessors[index]["normalized"] = true.into();
        index
    }

    pub(super) fn indices(&mut self, triangles: &[[u32; 3]], vertices: usize) -> usize {
        // The largest value of a type is not allowed as an index.
        let small = vertices <= usize::from(u16::MAX);
        self.begin(if small { U16 } else { U32 }, "SCALAR", triangles.len() * 3, INDEX_TARGET);
        if small {
            triangles
                .as_flattened()
                .iter()
                .for_each(|&i| self.bytes.extend_from_slice(&(i as u16).to_le_bytes()));
        } else {
            triangles.as_flattened().iter().for_each(|i| self.bytes.extend_from_slice(&i.to_le_bytes()));
        }
        self.end()
    }

    /// Adds the bytes of an image; returns the index of their view.
    pub(super) fn image(&mut self, bytes: &[u8]) -> usize {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": bytes.len() }));
        self.views.len() - 1
    }

    fn finish(mut self, primitives: Vec<Value>, looks: &ConvertedMaterials, node: Value) -> (Value, Vec<u8>) {
        let mut images = Vec::new();
        for image in &looks.images {
            let view = self.image(&image.bytes);
            images.push(json!({ "name": image.name, "mimeType": image.kind, "bufferView": view }));
        }
        let buffer = json!({ "byteLength": self.bytes.len() });
        let mut json = json!({
            "asset": { "version": "2.0", "generator": "lodsmith" },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [node],
            "meshes": [{ "primitives": primitives }],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [buffer],
        });
        if !looks.all.is_empty() {
            json["materials"] = looks.all.iter().map(material).collect();
        }
        if !images.is_empty() {
            json["textures"] = (0..images.len()).map(|image| json!({ "source": image })).collect();
            json["images"] = images.into();
        }
        (json, self.bytes)
    }
}
