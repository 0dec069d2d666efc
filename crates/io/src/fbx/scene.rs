//! Nodes of a file, with their meshes and skins.

use std::collections::HashMap;

use serde_json::{Value, json};
use ufbx::{
    AllocatorOpts, CoordinateAxes, CoordinateAxis, ErrorType, GeometryTransformHandling, InheritModeHandling,
    LoadOpts, Matrix, MirrorAxis, Node, Scene, SpaceConversion,
};

use super::animation::{self, unit_quaternion};
use super::materials::FbxMaterials;
use super::mesh;
use crate::error::{ReadError, Warning};
use crate::excerpt::excerpt;
use crate::format::Format;
use crate::gltf::{BroughtImages, BuiltScene, SceneBuilder};
use crate::limits::Limits;
use crate::options::ReadOptions;

/// Maximum depth of nodes. Guessed: no skeleton is deeper.
const MAX_DEPTH: u32 = 256;

/// Memory that the library may use for each byte of the file, and for any file, in bytes: an array states its size before it is
/// unpacked. (Guessed: deflate shrinks meshes to a tenth, and the scene takes a few times the arrays.)
const MEMORY_PER_BYTE: u64 = 256;
const ALWAYS_ALLOWED_MEMORY: u64 = 512 << 20;

/// Reads a file and builds its scene.
pub(super) fn build(bytes: &[u8], options: &ReadOptions) -> Result<BuiltScene, ReadError> {
    let by_size = (bytes.len() as u64).saturating_mul(MEMORY_PER_BYTE).max(ALWAYS_ALLOWED_MEMORY);
    let memory_limit = options.limits.memory.min(by_size);
    let loaded = ufbx::load_memory(bytes, load_options(memory_limit)).map_err(|e| error(&e, memory_limit))?;
    let held = (loaded.metadata.result_memory_used as u64).saturating_add(bytes.len() as u64);
    options.limits.check_memory("reading FBX", held.saturating_mul(2))?;
    let mut builder = FbxScene {
        fbx: &loaded,
        scene: SceneBuilder::new(Format::Fbx),
        materials: FbxMaterials::new(BroughtImages::new(options.files(), options.limits)),
        node_of: HashMap::new(),
        meshes: HashMap::new(),
        limits: options.limits,
        held,
    };
    builder.warn();
    let roots = builder.nodes();
    builder.place_meshes()?;
    animation::add(&loaded, &builder.node_of, options.limits, &mut builder.scene);
    Ok(builder.scene.finish(&roots))
}

fn load_options<'a>(memory_limit: u64) -> LoadOpts<'a> {
    let limit = || AllocatorOpts {
        memory_limit: usize::try_from(memory_limit).unwrap_or(usize::MAX),
        ..AllocatorOpts::default()
    };
    LoadOpts {
        temp_allocator: limit(),
        result_allocator: limit(),
        target_axes: CoordinateAxes {
            right: CoordinateAxis::PositiveX,
            up: CoordinateAxis::PositiveY,
            front: CoordinateAxis::PositiveZ,
        },
        target_unit_meters: 1.0,
        // glTF has neither geometric transforms nor scale that children do not inherit; helper nodes represent what
        // cannot be applied to vertices.
        space_conversion: SpaceConversion::ModifyGeometry,
        geometry_transform_handling: GeometryTransformHandling::ModifyGeometry,
        inherit_mode_handling: InheritModeHandling::Compensate,
        handedness_conversion_axis: MirrorAxis::X,
        clean_skin_weights: true,
        use_blender_pbr_material: true,
        normalize_normals: true,
        node_depth_limit: MAX_DEPTH,
        ..LoadOpts::default()
    }
}

fn error(error: &ufbx::Error, memory_limit: u64) -> ReadError {
    match error.type_ {
        ErrorType::MemoryLimit | ErrorType::AllocationLimit => {
            let what = "memory for reading the FBX file, in bytes,";
            ReadError::Limit { what, size: memory_limit.saturating_add(1), limit: memory_limit }
        }
        ErrorType::OutOfMemory => crate::limits::out_of_memory(),
        ErrorType::UnsupportedVersion => ReadError::Unsupported(
            "this version of FBX is not read: convert the file to FBX 7 first".to_owned(),
        ),
        ErrorType::NodeDepthLimit => {
            ReadError::file(format!("the nodes of the FBX are nested more than {MAX_DEPTH} deep"))
        }
        _ => {
            let mut text = error.description.to_string();
            if !error.info().is_empty() {
                text = format!("{text} ({})", excerpt(error.info()));
            }
            ReadError::file(format!("the FBX is damaged: {text}"))
        }
    }
}

struct FbxScene<'a> {
    fbx: &'a Scene,
    scene: SceneBuilder,
    materials: FbxMaterials,
    /// Nodes of the scene, by the numbers of the nodes in the file.
    node_of: HashMap<u32, usize>,
    /// Meshes by their number in the file and the materials of the node.
    meshes: HashMap<(u32, Vec<u32>), Option<mesh::Added>>,
    limits: Limits,
    /// Bytes of memory of the file and of the parsed data.
    held: u64,
}

impl FbxScene<'_> {
    fn warn(&mut self) {
        let fbx = self.fbx;
        for (count, what) in [
            (fbx.lights.len(), "lights"),
            (fbx.cameras.len(), "cameras"),
            (fbx.line_curves.len() + fbx.nurbs_curves.len(), "curves"),
            (fbx.constraints.len(), "constraints"),
            (fbx.cache_deformers.len(), "vertex caches"),
        ] {
            if count > 0 {
                self.scene.warn(Warning::lost_of_scene(format!("{what} of FBX are not read: dropped")));
            }
        }
        if !fbx.nurbs_surfaces.is_empty() || !fbx.procedural_geometries.is_empty() {
            self.scene.warn(Warning::lost("NURBS and procedural surfaces are not read: dropped"));
        }
        if fbx.nodes.iter().any(|n| !n.visible) {
            self.scene.warn(Warning::note("nodes that are hidden in the file are shown"));
        }
        if !fbx.lod_groups.is_empty() {
            self.scene.warn(Warning::note("all levels of detail of the file are read, as separate meshes"));
        }
    }

    /// Adds the nodes; returns the roots of the scene.
    fn nodes(&mut self) -> Vec<usize> {
        let root = &*self.fbx.root_node;
        // Joints of glTF have a common root.
        let is_plain =
            root.mesh.is_none() && is_identity(&root.node_to_parent) && self.fbx.skin_deformers.is_empty();
        let all = self.fbx.nodes.iter().map(|n| &**n);
        let shown: Vec<&Node> = all.filter(|n| !(n.is_root && is_plain)).collect();
        for node in &shown {
            let t = &node.local_transform;
            let mut entry = json!({});
            if !node.element.name.is_empty() {
                entry["name"] = (*node.element.name).into();
            }
            if [t.translation.x, t.translation.y, t.translation.z] != [0.0; 3] {
                entry["translation"] = json!([t.translation.x, t.translation.y, t.translation.z]);
            }
            let rotation = unit_quaternion([t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w]);
            if rotation != [0.0, 0.0, 0.0, 1.0] {
                entry["rotation"] = json!(rotation);
            }
            if [t.scale.x, t.scale.y, t.scale.z] != [1.0; 3] {
                entry["scale"] = json!([t.scale.x, t.scale.y, t.scale.z]);
            }
            let index = self.scene.add("nodes", entry);
            self.node_of.insert(node.element.typed_id, index);
        }
        for node in &shown {
            let children: Vec<usize> = node.children.iter().filter_map(|c| self.index_of(c)).collect();
            if let (Some(index), false) = (self.index_of(node), children.is_empty()) {
                self.scene.entry("nodes", index)["children"] = children.into();
            }
        }
        match self.index_of(root) {
            Some(index) => vec![index],
            None => root.children.iter().filter_map(|c| self.index_of(c)).collect(),
        }
    }

    fn index_of(&self, node: &Node) -> Option<usize> {
        self.node_of.get(&node.element.typed_id).copied()
    }

    /// Adds the meshes of nodes, with their skins.
    fn place_meshes(&mut self) -> Result<(), ReadError> {
        for node in &self.fbx.nodes {
            let (Some(mesh), Some(index)) = (node.mesh.as_ref(), self.index_of(node)) else { continue };
            let materials: Vec<u32> = node.materials.iter().map(|m| m.element.typed_id).collect();
            let key = (mesh.element.typed_id, materials);
            if !self.meshes.contains_key(&key) {
                let added =
                    mesh::add(mesh, node, self.limits, &mut self.held, &mut self.materials, &mut self.scene)?;
                self.meshes.insert(key.clone(), added);
            }
            let Some(Some(added)) = self.meshes.get(&key) else { continue };
            let entry = self.scene.entry("nodes", index);
            entry["mesh"] = added.mesh.into();
            if let Some(joints) = added.joints {
                let skin = skin(mesh, index, joints, &self.node_of, &mut self.scene);
                let skin = self.scene.add("skins", skin);
                self.scene.entry("nodes", index)["skin"] = skin.into();
            }
        }
        Ok(())
    }
}

/// Returns the skin of a mesh at a node: a joint for each cluster, and the node itself if vertices without
/// weights need it.
fn skin(
    mesh: &ufbx::Mesh,
    index: usize,
    needed: mesh::Joints,
    node_of: &HashMap<u32, usize>,
    scene: &mut SceneBuilder,
) -> Value {
    let (mut joints, mut matrices) = (Vec::new(), Vec::new());
    let clusters = mesh.skin_deformers.iter().next().into_iter().flat_map(|s| s.clusters.iter());
    for cluster in clusters {
        let bone = cluster.bone_node.as_ref().and_then(|b| node_of.get(&b.element.typed_id));
        joints.push(bone.copied().unwrap_or(index));
        matrices.extend(columns(&cluster.geometry_to_bone));
    }
    if needed == mesh::Joints::ClustersAndMesh {
        joints.push(index);
        matrices.extend(IDENTITY);
    }
    let matrices = scene.numbers(&matrices, "MAT4", 16, false);
    json!({ "joints": joints, "inverseBindMatrices": matrices })
}

const IDENTITY: [f32; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

fn columns(m: &Matrix) -> [f32; 16] {
    [m.m00, m.m10, m.m20, 0.0, m.m01, m.m11, m.m21, 0.0, m.m02, m.m12, m.m22, 0.0, m.m03, m.m13, m.m23, 1.0]
        .map(|x| x as f32)
}

fn is_identity(m: &Matrix) -> bool {
    columns(m) == IDENTITY
}
