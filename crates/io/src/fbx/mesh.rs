//! Meshes, with weights of joints and morph targets.

use lodsmith_core::polygon::Triangulator;
use ufbx::{Mesh, Node, VertexVec2};

use super::materials::FbxMaterials;
use crate::corners::{COLOR, Corner, CornerMesh, FIRST_UV, KINDS, MAX_UV_SETS, NONE, NORMAL, POSITION};
use crate::error::{ReadError, Warning};
use crate::gltf::{MeshParts, MorphTarget, SceneBuilder};
use crate::limits::Limits;

/// Maximum number of joints of a vertex: two sets of four.
const MAX_JOINTS: usize = 8;

/// A mesh of the scene.
pub(super) struct Added {
    pub(super) mesh: usize,
    /// The joints of its skin, if it has one.
    pub(super) joints: Option<Joints>,
}

/// The joints of a skin.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Joints {
    /// One for each cluster.
    Clusters,
    /// Also the node of the mesh, as the last one, for vertices without weights.
    ClustersAndMesh,
}

/// Adds a mesh with the materials of a node; returns `None` if it has no faces.
pub(super) fn add(
    mesh: &Mesh,
    node: &Node,
    limits: Limits,
    held: &mut u64,
    materials: &mut FbxMaterials,
    scene: &mut SceneBuilder,
) -> Result<Option<Added>, ReadError> {
    warn(mesh, scene);
    let corners = corners(mesh);
    if corners.is_empty() {
        return Ok(None);
    }
    let used: Vec<Option<usize>> =
        node.materials.iter().map(|m| Some(materials.add(m, mesh, scene))).collect();
    let mut split = corners.split(|slot| used.get(*slot as usize).copied().flatten());
    if split.lost_normals {
        scene.warn(Warning::lost("a mesh has normals for some of its faces only: they are dropped"));
    }
    let count = split.position_of.len() as u64;
    let shapes: usize = mesh.blend_deformers.iter().map(|b| b.channels.len()).sum();
    // Each shape has an offset for each vertex, and in glTF a normal.
    *held = held.saturating_add(count.saturating_mul(64 + 48 * shapes as u64));
    limits.check_memory("reading FBX", *held)?;
    let joints = add_joints(mesh, &split.position_of, &mut split.parts, scene);
    add_targets(mesh, &split.position_of, &mut split.parts, scene);
    Ok(scene.mesh(split.parts).map(|mesh| Added { mesh, joints }))
}

fn warn(mesh: &Mesh, scene: &mut SceneBuilder) {
    if mesh.num_point_faces + mesh.num_line_faces > 0 {
        scene.warn(Warning::lost("faces with one or two corners are dropped"));
    }
    if mesh.uv_sets.len() > MAX_UV_SETS {
        scene.warn(Warning::lost(format!(
            "texture coordinates beyond {MAX_UV_SETS} sets are not read: dropped"
        )));
    }
    if mesh.color_sets.len() > 1 {
        scene.warn(Warning::lost("colours of vertices beyond the first set are not read: dropped"));
    }
    if mesh.subdivision_display_mode as u32 != 0 {
        scene.warn(Warning::note("subdivision surfaces are read as their control meshes"));
    }
    if mesh.skin_deformers.len() > 1 {
        scene.warn(Warning::lost("a mesh has several skins: only the first is read"));
    }
}

/// Returns the triangles of a mesh, by the slots of their materials.
fn corners(mesh: &Mesh) -> CornerMesh<u32> {
    let mut all = CornerMesh { name: mesh.element.name.to_string(), ..CornerMesh::default() };
    if all.name.is_empty() {
        all.name = mesh.element.instances.iter().next().map_or(String::new(), |n| n.element.name.to_string());
    }
    let wide = |v: &ufbx::Vec3| [v.x as f32, v.y as f32, v.z as f32, 1.0];
    all.values[POSITION] = mesh.vertex_position.values.iter().map(wide).collect();
    all.values[NORMAL] = mesh.vertex_normal.values.iter().map(wide).collect();
    let color = |c: &ufbx::Vec4| [c.x, c.y, c.z, c.w].map(|x| x as f32);
    all.values[COLOR] = mesh.vertex_color.values.iter().map(color).collect();
    let sets: Vec<&VertexVec2> = mesh.uv_sets.iter().map(|s| &s.vertex_uv).take(MAX_UV_SETS).collect();
    for (k, set) in sets.iter().enumerate() {
        all.values[FIRST_UV + k] = set.values.iter().map(|v| [v.x as f32, v.y as f32, 0.0, 1.0]).collect();
    }
    let corner = |index: usize| -> Option<Corner> {
        let mut corner = [NONE; KINDS];
        let mut set = |kind: usize, indices: &[u32]| {
            let value = indices.get(index).copied().filter(|&i| (i as usize) < all.values[kind].len());
            corner[kind] = value.unwrap_or(NONE);
        };
        set(POSITION, &mesh.vertex_position.indices);
        set(NORMAL, &mesh.vertex_normal.indices);
        set(COLOR, &mesh.vertex_color.indices);
        for (k, uvs) in sets.iter().enumerate() {
            set(FIRST_UV + k, &uvs.indices);
        }
        (corner[POSITION] != NONE).then_some(corner)
    };
    let mut groups: Vec<(u32, Vec<[Corner; 3]>)> = Vec::new();
    let (mut triangulator, mut triangles) = (Triangulator::default(), Vec::new());
    for (at, face) in mesh.faces.iter().enumerate() {
        let begin = face.index_begin as usize;
        let polygon: Option<Vec<Corner>> = (begin..begin + face.num_indices as usize).map(&corner).collect();
        let Some(polygon) = polygon else { continue };
        let point = |c: &Corner| {
            let [x, y, z, _] = all.values[POSITION][c[POSITION] as usize];
            [x, y, z].map(f64::from)
        };
        let points: Vec<[f64; 3]> = polygon.iter().map(point).collect();
        triangulator.triangulate(&points, &mut triangles);
        let slot = mesh.face_material.get(at).copied().unwrap_or(0);
        let group = groups.iter().position(|(s, _)| *s == slot).unwrap_or_else(|| {
            groups.push((slot, Vec::new()));
            groups.len() - 1
        });
        groups[group].1.extend(triangles.iter().map(|t| t.map(|i| polygon[i as usize])));
    }
    groups.sort_by_key(|(slot, _)| *slot);
    all.primitives = groups;
    all
}

/// Adds the weights of joints, if there are any; returns the joints that they need.
fn add_joints(
    mesh: &Mesh,
    position_of: &[u32],
    parts: &mut MeshParts,
    scene: &mut SceneBuilder,
) -> Option<Joints> {
    let skin = mesh.skin_deformers.iter().next()?;
    let mut joints = Joints::Clusters;
    let Ok(own) = u16::try_from(skin.clusters.len()) else {
        scene.warn(Warning::lost("a skin has too many joints for glTF: dropped"));
        return None;
    };
    if skin.max_weights_per_vertex > MAX_JOINTS {
        let text = format!("vertices with more than {MAX_JOINTS} joints keep the {MAX_JOINTS} strongest");
        scene.warn(Warning::lost(text));
    }
    if skin.skinning_method as u32 == ufbx::SkinningMethod::DualQuaternion as u32 {
        scene.warn(Warning::note("dual-quaternion skinning becomes linear: twisted joints look thinner"));
    }
    let sets = skin.max_weights_per_vertex.min(MAX_JOINTS).div_ceil(4).max(1);
    parts.joints = vec![(Vec::with_capacity(position_of.len()), Vec::with_capacity(position_of.len())); sets];
    for &vertex in position_of {
        let mut all: Vec<(u16, f32)> = Vec::new();
        if let Some(v) = skin.vertices.get(vertex as usize) {
            let begin = v.weight_begin as usize;
            for weight in skin.weights.iter().skip(begin).take(v.num_weights as usize).take(MAX_JOINTS) {
                let (joint, value) = (weight.cluster_index as u16, weight.weight as f32);
                if joint < own && value > 0.0 && value.is_finite() {
                    all.push((joint, value));
                }
            }
        }
        let sum: f32 = all.iter().map(|(_, w)| w).sum();
        if sum > 0.0 {
            all.iter_mut().for_each(|(_, w)| *w /= sum);
        } else {
            all = vec![(own, 1.0)];
            joints = Joints::ClustersAndMesh;
        }
        all.resize(4 * sets, (0, 0.0));
        for (four, (numbers, weights)) in all.chunks_exact(4).zip(&mut parts.joints) {
            numbers.push([four[0].0, four[1].0, four[2].0, four[3].0]);
            weights.push([four[0].1, four[1].1, four[2].1, four[3].1]);
        }
    }
    Some(joints)
}

/// Adds the shapes of a mesh: one morph target for each channel.
fn add_targets(mesh: &Mesh, position_of: &[u32], parts: &mut MeshParts, scene: &mut SceneBuilder) {
    for channel in mesh.blend_deformers.iter().flat_map(|b| b.channels.iter()) {
        if channel.keyframes.len() > 1 {
            scene.warn(Warning::lost("in-between shapes of morph targets are not read: dropped"));
        }
        let last = channel.keyframes.iter().next_back().map(|k| &k.shape);
        let shape = channel.target_shape.as_ref().or(last);
        let mut offsets = vec![[0f32; 3]; mesh.vertex_position.values.len()];
        let mut normals = offsets.clone();
        let mut has_normals = false;
        if let Some(shape) = shape {
            has_normals = parts.normals.is_some()
                && shape.normal_offsets.len() == shape.offset_vertices.len()
                && mesh.vertex_normal.unique_per_vertex;
            for (k, &vertex) in shape.offset_vertices.iter().enumerate() {
                let vector = |all: &[ufbx::Vec3]| {
                    all.get(k).map_or([0.0; 3], |v| [v.x as f32, v.y as f32, v.z as f32])
                };
                if let Some(offset) = offsets.get_mut(vertex as usize) {
                    *offset = vector(&shape.position_offsets);
                    normals[vertex as usize] = vector(&shape.normal_offsets);
                }
            }
        }
        let of = |all: &[[f32; 3]]| position_of.iter().map(|&v| all[v as usize]).collect();
        parts.targets.push(MorphTarget {
            name: channel.element.name.to_string(),
            weight: channel.weight,
            positions: of(&offsets),
            normals: has_normals.then(|| of(&normals)),
        });
    }
}
