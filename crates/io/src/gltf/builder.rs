//! Construction of a scene from the contents of another format: the reader of that format adds meshes,
//! materials, images and nodes, and gets a glTF scene in memory.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DMat4;
use serde_json::{Map, Value, json};

use super::container::{FileParts, list};
use super::unplaced_textures;
#[cfg(feature = "fbx")]
use super::write::NO_TARGET;
use super::write::{F32, GltfBuilder, U8, U16, VERTEX_TARGET};
use crate::error::Warning;
use crate::format::Format;
use crate::three_mf::{KeptContents, OF_THREE_MF};

/// A scene that was made from the contents of another format.
pub(crate) struct BuiltScene {
    pub(super) parts: FileParts,
    pub(super) format: Format,
    /// The vertex in the source of each glTF vertex, by accessor of positions, for meshes whose vertices were split.
    pub(super) source_vertices: BTreeMap<usize, Vec<u32>>,
    /// Contents of a 3MF file that the scene does not hold.
    pub(crate) kept: Option<Arc<KeptContents>>,
}

/// The vertices of a mesh, and its triangles by material.
#[derive(Default)]
pub(crate) struct MeshParts {
    pub(crate) name: String,
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Option<Vec<[f32; 3]>>,
    /// Sets of texture coordinates, from the upper left corner of the image.
    pub(crate) uvs: Vec<Vec<[f32; 2]>>,
    /// Linear colours.
    pub(crate) colors: Option<Vec<[f32; 4]>>,
    /// Sets of four joints of each vertex with their weights.
    pub(crate) joints: Vec<JointSet>,
    pub(crate) targets: Vec<MorphTarget>,
    /// The source vertex of each of these vertices, if several share one.
    pub(crate) source_vertices: Option<Vec<u32>>,
    /// Material and triangles of each primitive.
    pub(crate) primitives: Vec<(Option<usize>, Vec<[u32; 3]>)>,
    /// For each primitive, marks of its triangles in 3MF, or null; empty if there are none.
    pub(crate) marks: Vec<Value>,
}

/// Four joints of each vertex, and their weights.
pub(crate) type JointSet = (Vec<[u16; 4]>, Vec<[f32; 4]>);

/// Offsets of a shape from the mesh.
#[derive(Default)]
pub(crate) struct MorphTarget {
    pub(crate) name: String,
    pub(crate) weight: f64,
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Option<Vec<[f32; 3]>>,
}

/// A scene under construction.
pub(crate) struct SceneBuilder {
    file: GltfBuilder,
    json: Value,
    source_vertices: BTreeMap<usize, Vec<u32>>,
    warnings: Vec<Warning>,
    format: Format,
}

impl SceneBuilder {
    pub(crate) fn new(format: Format) -> Self {
        let json = json!({ "asset": { "version": "2.0", "generator": "lodsmith" } });
        let (file, source_vertices) = (GltfBuilder::default(), BTreeMap::new());
        Self { file, json, source_vertices, warnings: Vec::new(), format }
    }

    /// Adds a warning, once.
    pub(crate) fn warn(&mut self, warning: Warning) {
        if !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
    }

    /// Appends an entry to a list (`nodes`, `materials`, `skins`, ...); returns its index.
    pub(crate) fn add(&mut self, list: &str, entry: Value) -> usize {
        let all = &mut self.json[list];
        if !all.is_array() {
            *all = json!([]);
        }
        let Some(all) = all.as_array_mut() else { return 0 };
        all.push(entry);
        all.len() - 1
    }

    /// Returns an entry of a list, to be changed.
    pub(crate) fn entry(&mut self, list: &str, index: usize) -> &mut Value {
        &mut self.json[list][index]
    }

    /// Adds a property of the file, such as its copyright.
    pub(crate) fn set_extra(&mut self, name: &str, value: &str) {
        self.json["asset"]["extras"][name] = value.into();
    }

    /// Declares an extension.
    pub(crate) fn uses(&mut self, extension: &str) {
        if !list(&self.json, "extensionsUsed").iter().any(|e| e == extension) {
            self.add("extensionsUsed", extension.into());
        }
    }

    /// Adds numbers that are neither vertices nor indices; returns the index of their accessor. `bounded` is for times of
    /// keyframes.
    #[cfg(feature = "fbx")]
    pub(crate) fn numbers(&mut self, values: &[f32], kind: &str, width: usize, bounded: bool) -> usize {
        self.file.begin(F32, kind, values.len() / width, NO_TARGET);
        self.file.floats(values);
        let index = self.file.end();
        if bounded && let (Some(first), Some(last)) = (values.first(), values.last()) {
            self.file.accessors[index]["min"] = json!([first]);
            self.file.accessors[index]["max"] = json!([last]);
        }
        index
    }

    /// Adds an image; returns its index.
    pub(crate) fn image(&mut self, name: &str, kind: &str, bytes: &[u8]) -> usize {
        let view = self.file.image(bytes);
        self.add("images", json!({ "name": name, "mimeType": kind, "bufferView": view }))
    }

    /// Adds a mesh; returns its index, or `None` if it has no triangles.
    pub(crate) fn mesh(&mut self, parts: MeshParts) -> Option<usize> {
        let count = parts.positions.len();
        let marks = parts.marks.iter().chain(std::iter::repeat(&Value::Null));
        let primitives: Vec<_> =
            parts.primitives.iter().zip(marks).filter(|((_, t), _)| !t.is_empty()).collect();
        if primitives.is_empty() {
            return None;
        }
        let positions = self.file.positions(&parts.positions);
        let mut attributes = Map::new();
        attributes.insert("POSITION".to_owned(), positions.into());
        if let Some(normals) = &parts.normals {
            let index = self.file.normals(normals, &mut self.warnings);
            attributes.insert("NORMAL".to_owned(), index.into());
        }
        for (k, uvs) in parts.uvs.iter().enumerate() {
            self.file.begin(F32, "VEC2", uvs.len(), VERTEX_TARGET);
            self.file.floats(uvs.as_flattened());
            attributes.insert(format!("TEXCOORD_{k}"), self.file.end().into());
        }
        if let Some(colors) = &parts.colors {
            attributes.insert("COLOR_0".to_owned(), self.file.colors(colors).into());
        }
        for (k, (joints, weights)) in parts.joints.iter().enumerate() {
            let index = self.joints(joints);
            attributes.insert(format!("JOINTS_{k}"), index.into());
            self.file.begin(F32, "VEC4", weights.len(), VERTEX_TARGET);
            self.file.floats(weights.as_flattened());
            attributes.insert(format!("WEIGHTS_{k}"), self.file.end().into());
        }
        let targets: Vec<Value> = parts.targets.iter().map(|t| self.target(t)).collect();
        let of_primitive = |((material, triangles), marks): &(&(Option<usize>, Vec<[u32; 3]>), &Value)| {
            let indices = self.file.indices(triangles, count);
            let mut primitive = json!({ "attributes": attributes, "indices": indices });
            if let Some(material) = material {
                primitive["material"] = (*material).into();
            }
            if !targets.is_empty() {
                primitive["targets"] = targets.clone().into();
            }
            if !marks.is_null() {
                primitive["extras"][OF_THREE_MF] = (*marks).clone();
            }
            primitive
        };
        let primitives: Vec<Value> = primitives.iter().map(of_primitive).collect();
        let mut mesh = json!({ "primitives": primitives });
        if !parts.name.is_empty() {
            mesh["name"] = parts.name.into();
        }
        if !targets.is_empty() {
            mesh["weights"] = parts.targets.iter().map(|t| t.weight).collect();
            mesh["extras"]["targetNames"] = parts.targets.iter().map(|t| t.name.as_str()).collect();
        }
        if let Some(vertices) = parts.source_vertices {
            self.source_vertices.insert(positions, vertices);
        }
        Some(self.add("meshes", mesh))
    }

    fn joints(&mut self, joints: &[[u16; 4]]) -> usize {
        let small = joints.as_flattened().iter().all(|&j| j <= u16::from(u8::MAX));
        self.file.begin(if small { U8 } else { U16 }, "VEC4", joints.len(), VERTEX_TARGET);
        for &joint in joints.as_flattened() {
            let [low, high] = joint.to_le_bytes();
            self.file.bytes.push(low);
            if !small {
                self.file.bytes.push(high);
            }
        }
        self.file.end()
    }

    fn target(&mut self, target: &MorphTarget) -> Value {
        let mut object = json!({ "POSITION": self.file.positions(&target.positions) });
        if let Some(normals) = &target.normals {
            self.file.begin(F32, "VEC3", normals.len(), VERTEX_TARGET);
            self.file.floats(normals.as_flattened());
            object["NORMAL"] = self.file.end().into();
        }
        object
    }

    /// Returns the scene with these nodes as its roots.
    pub(crate) fn finish(mut self, roots: &[usize]) -> BuiltScene {
        self.json["scene"] = 0.into();
        self.json["scenes"] = if roots.is_empty() { json!([{}]) } else { json!([{ "nodes": roots }]) };
        let GltfBuilder { bytes, views, accessors, .. } = std::mem::take(&mut self.file);
        if !bytes.is_empty() {
            self.json["buffers"] = json!([{ "byteLength": bytes.len() }]);
            self.json["bufferViews"] = views.into();
            self.json["accessors"] = accessors.into();
        }
        for warning in unplaced_textures::leave_out(&mut self.json) {
            self.warn(warning);
        }
        let Self { json, source_vertices, warnings, format, .. } = self;
        BuiltScene { parts: FileParts { json, bytes, warnings }, format, source_vertices, kept: None }
    }
}

/// Returns the matrix of a node by columns; `None` for the identity. glTF has no shear, which is a warning.
pub(crate) fn matrix_of_node(matrix: DMat4, scene: &mut SceneBuilder) -> Option<Value> {
    if matrix == DMat4::IDENTITY {
        return None;
    }
    let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|a| a.truncate().normalize_or_zero());
    let skew =
        [(0, 1), (1, 2), (2, 0)].map(|(i, j)| axes[i].dot(axes[j]).abs()).into_iter().fold(0.0, f64::max);
    // The tolerance covers the rounding of single-precision files.
    if skew > 1e-4 {
        scene.warn(Warning::note(
            "nodes are sheared, which glTF does not allow: some viewers show them differently",
        ));
    }
    Some(json!(matrix.to_cols_array()))
}
