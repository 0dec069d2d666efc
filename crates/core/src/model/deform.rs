//! Deformation of meshes by morph targets and joints.

use glam::{DMat4, Mat4, Vec3, Vec4Swizzles};

use super::{Instance, Model, Pose};
use crate::ids::WedgeId;
use crate::mesh::{Bounds, Morphed, Positions, Semantic, TriMesh};

/// A mesh deformed to a pose; buffers are reused for the next one.
#[derive(Clone, Debug, Default)]
pub struct Deformed {
    /// Positions, one for each wedge of the mesh.
    pub positions: Vec<[f32; 3]>,
    /// Normals, one for each wedge, of unit length; empty for a mesh without normals.
    pub normals: Vec<[f32; 3]>,
    /// Transform from the positions to model coordinates: the identity for skinned meshes, which their joints
    /// place.
    pub world_from_mesh: DMat4,
    palette: Vec<Mat4>,
}

impl Model {
    /// Returns the weights of the morph targets of a node's mesh.
    pub fn morph_weights<'a>(&'a self, node: usize, pose: &'a Pose) -> &'a [f32] {
        let of_pose = pose.morph_weights.get(node).and_then(Option::as_deref);
        let own = || self.nodes[node].morph_weights.as_deref();
        let of_mesh = || self.nodes[node].mesh.map(|m| &*self.meshes[m].morph_weights);
        of_pose.or_else(own).or_else(of_mesh).unwrap_or_default()
    }

    /// Deforms the mesh of an instance. Returns `false` and does nothing if nothing deforms it: it has no
    /// skin, and all morph weights are zero.
    ///
    /// `world_from_nodes` is the result of [`Model::world_from_nodes`] in the same pose. Morph targets are
    /// applied first, then joints. Cost: O(wedges · joints of each), on one thread, without allocation once
    /// `out` is large enough.
    pub fn deform(
        &self,
        instance: &Instance,
        pose: &Pose,
        world_from_nodes: &[DMat4],
        out: &mut Deformed,
    ) -> bool {
        let mesh = &*self.meshes[instance.mesh].mesh;
        let skin = self.nodes[instance.node].skin.filter(|_| JointSets::of(mesh).is_some());
        let strengths = self.morph_weights(instance.node, pose);
        if skin.is_none() && Targets::of(mesh, strengths, Morphed::Position).0.is_empty() {
            return false;
        }
        let Deformed { positions, normals, world_from_mesh, palette } = out;
        palette.clear();
        *world_from_mesh = instance.world_from_mesh;
        if let Some(skin) = skin {
            let skin = &self.skins[skin];
            let joints = skin.joints.iter().zip(&skin.joint_from_mesh);
            palette.extend(joints.map(|(&j, from_mesh)| (world_from_nodes[j] * *from_mesh).as_mat4()));
            *world_from_mesh = DMat4::IDENTITY;
        }
        deform(mesh, strengths, palette, positions, normals);
        true
    }

    /// Returns the bounding box of everything placed in a pose; `None` if there is nothing.
    ///
    /// Uses the boxes of the meshes where nothing deforms them, so the box of a rotated mesh may be larger
    /// than necessary. Cost: O(vertices).
    pub fn bounds(&self, pose: &Pose) -> Option<Bounds> {
        let world = self.world_from_nodes(pose);
        let mut own: Vec<Option<Option<Bounds>>> = vec![None; self.meshes.len()];
        let (mut all, mut deformed) = (None, Deformed::default());
        for instance in self.instances(pose) {
            if self.deform(&instance, pose, &world, &mut deformed) {
                let places = deformed.positions.iter();
                places.for_each(|p| grow(&mut all, &deformed.world_from_mesh, p.map(f64::from)));
                continue;
            }
            let mesh = &self.meshes[instance.mesh].mesh;
            let own = *own[instance.mesh].get_or_insert_with(|| mesh.positions().view().bounds());
            let Some(Bounds { min, max }) = own else { continue };
            for corner in 0..8 {
                let p = [0, 1, 2].map(|k| if corner >> k & 1 == 0 { min[k] } else { max[k] });
                grow(&mut all, &instance.world_from_mesh, p);
            }
        }
        all
    }
}

impl Model {
    /// Returns the bounding box over evenly spaced moments of an animation, from its start to its end: what a
    /// camera has to see. `None` if there is nothing. Cost: O(moments · vertices).
    ///
    /// # Panics
    /// If there is no such animation.
    pub fn bounds_over(&self, animation: usize, moments: usize) -> Option<Bounds> {
        let length = self.animations[animation].duration();
        let at = |k: usize| length * k as f64 / moments.saturating_sub(1).max(1) as f64;
        let mut all = None;
        for b in (0..moments).filter_map(|k| self.bounds(&self.pose(animation, at(k)))) {
            [b.min, b.max].into_iter().for_each(|p| grow(&mut all, &DMat4::IDENTITY, p));
        }
        all
    }
}

/// Extends a box by a point, unless it is not finite.
fn grow(bounds: &mut Option<Bounds>, world_from_mesh: &DMat4, p: [f64; 3]) {
    let p = world_from_mesh.transform_point3(p.into()).to_array();
    if p.iter().all(|x| x.is_finite()) {
        *bounds = Some(bounds.unwrap_or(Bounds::EMPTY).with(p));
    }
}

/// Deforms a mesh: first by its morph targets with the weights `strengths`, then by joints.
///
/// `palette` has a matrix for each joint of a skin, from mesh coordinates to the joint's current ones; if it
/// is empty, no skinning is done. Positions and normals are written for each wedge; no normals for a mesh
/// without them. Normals are transformed by the inverse transpose, and have unit length. The joint weights of
/// a wedge are normalized by their sum; if it is zero, and for joints beyond the palette, the first joint is
/// used. Cost: O(wedges).
pub fn deform(
    mesh: &TriMesh,
    strengths: &[f32],
    palette: &[Mat4],
    positions: &mut Vec<[f32; 3]>,
    normals: &mut Vec<[f32; 3]>,
) {
    positions.clear();
    let wedges = (0..mesh.wedge_count()).map(WedgeId::new);
    match mesh.positions() {
        Positions::F32(p) => match mesh.vertex_map() {
            None => positions.extend_from_slice(p),
            Some(map) => positions.extend(map.iter().map(|v| p[v.index()])),
        },
        Positions::F64(p) => positions.extend(wedges.map(|w| p[mesh.vertex_of(w).index()].map(|x| x as f32))),
    }
    normals.clear();
    normals.extend_from_slice(mesh.normals().unwrap_or_default());

    Targets::of(mesh, strengths, Morphed::Position).add_to(positions);
    let of_normals = Targets::of(mesh, strengths, Morphed::Normal);
    let sets = if palette.is_empty() { None } else { JointSets::of(mesh) };
    if !normals.is_empty() && !of_normals.0.is_empty() {
        of_normals.add_to(normals);
        normals.iter_mut().for_each(|n| *n = unit(Vec3::from(*n)).into());
    }
    let Some(sets) = sets else { return };
    for (w, p) in positions.iter_mut().enumerate() {
        let matrix = sets.matrix(w, palette);
        *p = matrix.transform_point3(Vec3::from(*p)).into();
        let Some(n) = normals.get_mut(w) else { continue };
        let [x, y, z] = [matrix.x_axis.xyz(), matrix.y_axis.xyz(), matrix.z_axis.xyz()];
        // The cross products of the columns are the inverse transpose times the determinant, whose sign
        // matters.
        let [a, b, c] = [y.cross(z), z.cross(x), x.cross(y)];
        let turned = a * n[0] + b * n[1] + c * n[2];
        *n = unit(if x.dot(a) < 0.0 { -turned } else { turned }).into();
    }
}

/// Returns true if a mesh has joints and weights, so that a skin deforms it.
pub fn has_joints(mesh: &TriMesh) -> bool {
    JointSets::of(mesh).is_some()
}

/// Returns which joints of a palette of this many matrices move a mesh in [`deform`]; none for a mesh without joints.
///
/// Cost: O(wedges · joints of each).
pub fn joints_in_use(mesh: &TriMesh, count: usize) -> Vec<bool> {
    let mut in_use = vec![false; count];
    let (Some(sets), 1..) = (JointSets::of(mesh), count) else { return in_use };
    for w in 0..mesh.wedge_count() {
        let mut sum = 0.0;
        for (joints, weights) in &sets.0 {
            for (&joint, &weight) in joints[w].iter().zip(&weights[w]).filter(|(_, weight)| **weight != 0.0) {
                let joint = joint as usize;
                in_use[if joint < count { joint } else { 0 }] = true;
                sum += weight;
            }
        }
        in_use[0] |= sum == 0.0 || !sum.is_finite();
    }
    in_use
}

/// Returns true if two transforms are equal up to the rounding of files.
pub fn are_near(a: &DMat4, b: &DMat4) -> bool {
    // Guessed: a few steps of single precision, after programs that bake transforms into the mesh.
    const ROUNDING: f64 = 1e-5;
    let (a, b) = (a.to_cols_array(), b.to_cols_array());
    let size = a.iter().fold(0f64, |m, x| m.max(x.abs()));
    a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= ROUNDING * size)
}

/// Normalizes a direction; the zero vector stays zero.
fn unit(v: Vec3) -> Vec3 {
    v.try_normalize().unwrap_or(Vec3::ZERO)
}

/// The offsets and weights of the morph targets with non-zero weight.
struct Targets<'a>(Vec<(&'a [[f32; 3]], f32)>);

impl<'a> Targets<'a> {
    fn of(mesh: &'a TriMesh, strengths: &[f32], moved: Morphed) -> Self {
        let found = mesh.further_attributes().iter().filter_map(|a| match a.semantic {
            Semantic::Morph { target, of } if of == moved && a.width == 3 => {
                let strength = *strengths.get(usize::from(target))?;
                (strength != 0.0).then_some((a.values.as_chunks().0, strength))
            }
            _ => None,
        });
        Self(found.collect())
    }

    fn add_to(&self, values: &mut [[f32; 3]]) {
        for (deltas, strength) in &self.0 {
            for (value, delta) in values.iter_mut().zip(*deltas) {
                (0..3).for_each(|k| value[k] += strength * delta[k]);
            }
        }
    }
}

/// Joints and weights of each wedge, in sets of four.
struct JointSets<'a>(Vec<(JointSlots<'a>, JointSlots<'a>)>);
/// Four numbers for each wedge.
type JointSlots<'a> = &'a [[f32; 4]];

impl<'a> JointSets<'a> {
    /// Returns `None` for a mesh without joints.
    fn of(mesh: &'a TriMesh) -> Option<Self> {
        let find = |semantic: Semantic| {
            let found = mesh.further_attributes().iter().find(|a| a.semantic == semantic && a.width == 4);
            found.map(|a| a.values.as_chunks().0)
        };
        let set = |i: u8| Some((find(Semantic::Joints(i))?, find(Semantic::Weights(i))?));
        let sets: Vec<_> = (0..=u8::MAX).map_while(set).collect();
        (!sets.is_empty()).then_some(Self(sets))
    }

    #[inline]
    fn matrix(&self, wedge: usize, palette: &[Mat4]) -> Mat4 {
        let (mut matrix, mut sum) = (Mat4::ZERO, 0.0);
        for (joints, weights) in &self.0 {
            for (&joint, &weight) in joints[wedge].iter().zip(&weights[wedge]) {
                if weight != 0.0 {
                    matrix += *palette.get(joint as usize).unwrap_or(&palette[0]) * weight;
                    sum += weight;
                }
            }
        }
        // If the sum is one up to rounding, dividing by it would only add rounding errors.
        if (sum - 1.0).abs() <= 4.0 * f32::EPSILON {
            matrix
        } else if sum != 0.0 && sum.is_finite() {
            matrix * sum.recip()
        } else {
            palette[0]
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;
    use std::sync::Arc;

    use glam::{DQuat, DVec3};

    use super::*;
    use crate::ids::VertexId;
    use crate::mesh::Attribute;
    use crate::model::{Animation, Channel, Interpolation, ModelMesh, Node, Skin, Track, Transform};

    fn near(got: &[[f32; 3]], wanted: &[[f32; 3]]) {
        assert_eq!(got.len(), wanted.len());
        for (g, w) in got.iter().zip(wanted) {
            assert!((0..3).all(|k| (g[k] - w[k]).abs() < 1e-6), "{got:?} for {wanted:?}");
        }
    }

    /// ```text
    /// 3-----2-----5    a joint at 0, and one at 1 that turns
    /// |     |     |
    /// 0-----1-----4
    /// ```
    fn arm() -> Model {
        let places = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 0.5], [2.0, 0.0], [2.0, 0.5]];
        let positions = Positions::F32(places.map(|[x, y]| [x, y, 0.0]).to_vec());
        let triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]].map(|t| t.map(VertexId));
        let mut mesh = TriMesh::new(positions, triangles.to_vec()).unwrap();
        mesh.set_normals(Some(vec![[0.0, 1.0, 0.0]; 6])).unwrap();
        let joints = [0.0, 1.0, 0.0, 0.0].repeat(6);
        // The last two follow the outer joint; the weights of the last do not sum to one.
        let weights = [[1.0, 0.0], [0.5, 0.5], [0.5, 0.5], [1.0, 0.0], [0.0, 1.0], [0.0, 0.25]];
        let weights = weights.iter().flat_map(|[a, b]| [*a, *b, 0.0, 0.0]).collect();
        mesh.add_attribute(Attribute { semantic: Semantic::Joints(0), width: 4, values: joints }).unwrap();
        mesh.add_attribute(Attribute { semantic: Semantic::Weights(0), width: 4, values: weights }).unwrap();
        let node = |x: f64, children| Node {
            transform: Transform::Parts {
                translation: DVec3::new(x, 0.0, 0.0),
                rotation: DQuat::IDENTITY,
                scale: DVec3::ONE,
            },
            children,
            ..Node::default()
        };
        let mut model = Model::of_mesh(mesh);
        // The node is moved, but its joints place the mesh.
        model.nodes[0].transform = node(50.0, Vec::new()).transform;
        model.nodes[0].skin = Some(0);
        model.nodes.extend([node(0.0, vec![2]), node(1.0, Vec::new())]);
        model.roots.push(1);
        let moved = DMat4::from_translation(DVec3::new(-1.0, 0.0, 0.0));
        model.skins.push(Skin { joints: vec![1, 2], joint_from_mesh: vec![DMat4::IDENTITY, moved] });
        model
    }

    fn deformed(model: &Model, pose: &Pose) -> Deformed {
        let mut out = Deformed::default();
        let instance = &model.instances(pose)[0];
        assert!(model.deform(instance, pose, &model.world_from_nodes(pose), &mut out));
        out
    }

    #[test]
    fn an_arm_bends_by_a_right_angle() {
        let model = arm();
        let rest = Pose::default();
        let at_rest = deformed(&model, &rest);
        let Positions::F32(places) = model.meshes[0].mesh.positions() else { panic!("single") };
        near(&at_rest.positions, places);
        assert_eq!(at_rest.world_from_mesh, DMat4::IDENTITY);
        let bounds = model.bounds(&rest).unwrap();
        assert_eq!((bounds.min, bounds.max), ([0.0; 3], [2.0, 0.5, 0.0]));

        let mut pose = Pose { transforms: model.nodes.iter().map(|n| n.transform).collect(), ..rest };
        if let Transform::Parts { rotation, .. } = &mut pose.transforms[2] {
            *rotation = DQuat::from_rotation_z(FRAC_PI_2);
        }
        let bent = deformed(&model, &pose);
        // Halfway between both joints, (1, 0.5) goes to the mean of itself and (0.5, 0).
        let wanted = [[0.0, 0.0], [1.0, 0.0], [0.75, 0.25], [0.0, 0.5], [1.0, 1.0], [0.5, 1.0]];
        near(&bent.positions, &wanted.map(|[x, y]| [x, y, 0.0]));
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let wanted = [[0.0, 1.0], [-half, half], [-half, half], [0.0, 1.0], [-1.0, 0.0], [-1.0, 0.0]];
        near(&bent.normals, &wanted.map(|[x, y]| [x, y, 0.0]));
        assert!((model.bounds(&pose).unwrap().max[1] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn bounds_over_an_animation_contain_all_of_its_motion() {
        let mut model = arm();
        let root = std::f32::consts::FRAC_1_SQRT_2;
        let track = Track::Rotation(vec![[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, root, root], [0.0, 0.0, 0.0, 1.0]]);
        let (times, interpolation) = (vec![0.0, 1.0, 2.0], Interpolation::Linear);
        let channels = vec![Channel { node: 2, track, times, interpolation }];
        model.animations = vec![Animation { name: String::new(), channels }];
        let all = model.bounds_over(0, 17).unwrap();
        // Extends to the right at rest, and up in the middle of the animation.
        assert!((all.max[0] - 2.0).abs() < 0.13 && (all.max[1] - 1.0).abs() < 0.2, "{all:?}");
        assert_eq!(model.bounds_over(0, 0), None);
        assert!((model.bounds_over(0, 1).unwrap().max[1] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn morph_targets_add_by_their_strengths() {
        let positions = Positions::F64(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let wedges = vec![VertexId(0), VertexId(1), VertexId(2), VertexId(2)];
        let triangles = vec![[WedgeId(0), WedgeId(1), WedgeId(3)]];
        let mut mesh = TriMesh::with_wedges(positions, wedges, triangles).unwrap();
        mesh.set_normals(Some(vec![[0.0, 0.0, 1.0]; 4])).unwrap();
        for (target, of, values) in [
            (0, Morphed::Position, [0.0, 0.0, 8.0].repeat(4)),
            (1, Morphed::Position, [0.0, 2.0, 0.0].repeat(4)),
            (1, Morphed::Normal, [2.0, 0.0, 0.0].repeat(4)),
        ] {
            let semantic = Semantic::Morph { target, of };
            mesh.add_attribute(Attribute { semantic, width: 3, values }).unwrap();
        }
        let mut model = Model::of_mesh(Arc::new(mesh));
        model.nodes[0].transform = Transform::Matrix(DMat4::from_scale(DVec3::splat(3.0)));
        let rest = Pose::default();
        let instance = model.instances(&rest)[0].clone();
        let world = model.world_from_nodes(&rest);
        let mut out = Deformed::default();
        assert!(!model.deform(&instance, &rest, &world, &mut out));
        model.meshes[0].morph_weights = vec![0.25, 0.0];
        near(&deformed(&model, &rest).normals, &[[0.0, 0.0, 1.0]; 4]);
        near(&deformed(&model, &rest).positions[1..2], &[[1.0, 0.0, 2.0]]);
        // The node overrides the mesh, the pose overrides the node.
        model.nodes[0].morph_weights = Some(vec![0.0, 1.0]);
        near(&deformed(&model, &rest).positions[1..2], &[[1.0, 2.0, 0.0]]);
        let pose = Pose { morph_weights: vec![Some(vec![0.5, 0.5])], ..Pose::default() };
        let got = deformed(&model, &pose);
        near(&got.positions, &[[0.0, 1.0, 4.0], [1.0, 1.0, 4.0], [0.0, 2.0, 4.0], [0.0, 2.0, 4.0]]);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        near(&got.normals, &[[half, 0.0, half]; 4]);
        assert_eq!(got.world_from_mesh, world[0]);
        assert_eq!(model.bounds(&pose).unwrap().max, [3.0, 6.0, 12.0]);
    }

    #[test]
    fn normals_go_by_the_inverse_transpose() {
        let model = arm();
        let mut mesh = TriMesh::clone(&model.meshes[0].mesh);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        mesh.set_normals(Some(vec![[half, half, 0.0]; 6])).unwrap();
        let scaled = [Mat4::from_scale(Vec3::new(2.0, 1.0, 1.0)); 2];
        let (mut p, mut n) = (Vec::new(), Vec::new());
        deform(&mesh, &[], &scaled, &mut p, &mut n);
        near(&n, &[Vec3::new(1.0, 2.0, 0.0).normalize_or_zero().to_array(); 6]);
        // A mirror flips the direction, not inside and outside.
        deform(&mesh, &[], &[Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0)); 2], &mut p, &mut n);
        near(&n, &[[-half, half, 0.0]; 6]);
        // A zero matrix, and a singular one: no NaN.
        deform(&mesh, &[], &[Mat4::ZERO; 2], &mut p, &mut n);
        near(&n, &[[0.0; 3]; 6]);
    }

    #[test]
    fn missing_joints_and_missing_weights_use_the_first_joint() {
        let mut model = arm();
        let mut mesh = TriMesh::clone(&model.meshes[0].mesh);
        mesh.further_values_mut(0)[16..20].fill(9.0);
        mesh.further_values_mut(1)[20..24].fill(0.0);
        mesh.set_normals(None).unwrap();
        let palette = [Vec3::Y, Vec3::Z].map(Mat4::from_translation);
        let (mut p, mut n) = (Vec::new(), vec![[0.0; 3]; 99]);
        deform(&mesh, &[], &palette, &mut p, &mut n);
        near(&p[4..], &[[2.0, 1.0, 0.0], [2.0, 1.5, 0.0]]);
        assert_eq!((has_joints(&mesh), joints_in_use(&mesh, 2)), (true, vec![true, true]));
        let mut outer = mesh.clone();
        outer.further_values_mut(0).fill(1.0);
        outer.further_values_mut(1).fill(0.5);
        assert_eq!(joints_in_use(&outer, 3), [false, true, false]);
        assert!(n.is_empty());
        // A mesh without joints ignores its skin.
        let plain = TriMesh::new(mesh.positions().clone(), mesh.surface().triangles().to_vec()).unwrap();
        assert_eq!((has_joints(&plain), joints_in_use(&plain, 2)), (false, vec![false, false]));
        model.meshes[0] = ModelMesh { mesh: Arc::new(plain), ..model.meshes[0].clone() };
        let rest = Pose::default();
        let world = model.world_from_nodes(&rest);
        assert!(!model.deform(&model.instances(&rest)[0], &rest, &world, &mut Deformed::default()));
        assert_eq!(model.bounds(&rest).unwrap().min, [50.0, 0.0, 0.0]);
    }
}
