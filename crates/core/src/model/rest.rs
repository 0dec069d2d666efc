//! Models whose skins are applied, for formats without skins.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat4, Mat4};

use super::{Model, ModelMesh, Node, Pose, are_near, deform, has_joints, joints_in_use};
use crate::ids::VertexId;
use crate::mesh::{Positions, TriMesh};

impl Model {
    /// Returns the model at rest without skins. For each skinned mesh a further mesh, with its vertices where the
    /// joints put them, is added under a new root without a transform. Existing meshes keep their indices; a skinned
    /// mesh that the joints leave at the place of its node keeps that node. Morph targets are at zero.
    ///
    /// Cost: O(nodes + vertices of skinned meshes, once for each skin).
    #[must_use]
    pub fn without_skins(&self) -> Self {
        let pose = Pose::default();
        let world = self.world_from_nodes(&pose);
        let mut out = self.clone();
        let mut known: HashMap<(usize, usize), usize> = HashMap::new();
        for instance in self.instances(&pose) {
            let (source, node) = (&self.meshes[instance.mesh], &self.nodes[instance.node]);
            let Some(skin) = node.skin.filter(|_| has_joints(&source.mesh)) else { continue };
            let joints = self.skins[skin].joints.iter().zip(&self.skins[skin].joint_from_mesh);
            let palette: Vec<DMat4> = joints.map(|(&joint, from_mesh)| world[joint] * *from_mesh).collect();
            if palette.iter().all(|joint| are_near(joint, &instance.world_from_mesh)) {
                continue;
            }
            let mesh = *known.entry((instance.mesh, skin)).or_insert_with(|| {
                let mesh = Arc::new(deformed(&source.mesh, &palette));
                out.meshes.push(ModelMesh { mesh, ..source.clone() });
                out.meshes.len() - 1
            });
            out.nodes[instance.node].mesh = None;
            out.roots.push(out.nodes.len());
            out.nodes.push(Node { name: node.name.clone(), mesh: Some(mesh), ..Node::default() });
        }
        out.nodes.iter_mut().for_each(|node| node.skin = None);
        out.skins.clear();
        out
    }
}

/// Returns the mesh with its vertices where these joint matrices put them. Wedges of one vertex stay together.
fn deformed(mesh: &TriMesh, palette: &[DMat4]) -> TriMesh {
    let single: Vec<Mat4> = palette.iter().map(DMat4::as_mat4).collect();
    let (mut of_wedges, mut normals) = (Vec::new(), Vec::new());
    deform(mesh, &[], &single, &mut of_wedges, &mut normals);
    let mut positions = vec![[0.0; 3]; mesh.vertex_count()];
    let vertex_of: Vec<VertexId> =
        (0..mesh.wedge_count()).map(|w| mesh.vertex_of(crate::ids::WedgeId::new(w))).collect();
    for (v, p) in vertex_of.iter().zip(of_wedges) {
        positions[v.index()] = p;
    }
    let first = joints_in_use(mesh, palette.len()).iter().position(|is_used| *is_used).unwrap_or(0);
    let mut triangles = mesh.triangles().to_vec();
    if palette[first].determinant() < 0.0 {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    let made = TriMesh::with_wedges(Positions::F32(positions), vertex_of, triangles);
    let mut made = made.expect("it has the same elements as the mesh");
    let fits = "there is one for each element of the mesh";
    made.set_regions(mesh.regions().map(<[_]>::to_vec)).expect(fits);
    made.set_normals(Some(normals).filter(|n| !n.is_empty())).expect(fits);
    made.set_uvs(mesh.uvs().map(<[_]>::to_vec)).expect(fits);
    made.set_colors(mesh.colors().map(<[_]>::to_vec)).expect(fits);
    for attribute in mesh.further_attributes() {
        made.add_attribute(attribute.clone()).expect(fits);
    }
    made
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::mesh::{Attribute, Semantic};
    use crate::model::{Skin, Transform};

    #[test]
    fn skinned_meshes_are_where_a_renderer_shows_them() {
        let positions = Positions::F32(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let mut mesh = TriMesh::new(positions, vec![[VertexId(0), VertexId(1), VertexId(2)]]).unwrap();
        let set = |semantic, values: [f32; 4]| Attribute { semantic, width: 4, values: values.repeat(3) };
        mesh.add_attribute(set(Semantic::Joints(0), [0.0; 4])).unwrap();
        mesh.add_attribute(set(Semantic::Weights(0), [1.0, 0.0, 0.0, 0.0])).unwrap();
        let mut model = Model::of_mesh(mesh);
        let far = Transform::Matrix(DMat4::from_translation(DVec3::splat(50.0)));
        model.nodes[0] = Node { transform: far, skin: Some(0), ..model.nodes[0].clone() };
        let mirrored = Transform::Matrix(DMat4::from_scale(DVec3::new(-2.0, 2.0, 2.0)));
        model.nodes.push(Node { transform: mirrored, ..Node::default() });
        model.roots.push(1);
        let joint_from_mesh = vec![DMat4::from_translation(DVec3::X)];
        model.skins.push(Skin { joints: vec![1], joint_from_mesh });
        let rest = model.without_skins();
        let pose = Pose::default();
        assert_eq!(rest.bounds(&pose), model.bounds(&pose));
        assert_eq!((rest.face_count(), rest.meshes.len(), rest.skins.len()), (1, 2, 0));
        let mut bound = model.clone();
        bound.skins[0].joint_from_mesh[0] =
            model.nodes[1].transform.matrix().inverse() * model.nodes[0].transform.matrix();
        let bound = bound.without_skins();
        assert_eq!((bound.meshes.len(), bound.nodes.len(), bound.nodes[0].mesh), (1, 2, Some(0)));
        let corners = rest.meshes[1].mesh.surface().triangles()[0].map(|v| v.0);
        assert_eq!(corners, [0, 2, 1]);
    }
}
