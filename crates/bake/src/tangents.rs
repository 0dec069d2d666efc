//! Tangent frames by MikkTSpace, as Blender, Unreal and viewers of glTF compute them.

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use lodsmith_core::TriMesh;

struct Corners<'a> {
    mesh: &'a TriMesh,
    normals: &'a dyn Fn(usize, usize) -> [f32; 3],
    uvs: &'a dyn Fn(usize, usize) -> [f32; 2],
    tangents: Vec<[[f32; 4]; 3]>,
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.face_count()
    }
    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }
    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        let vertex = self.mesh.vertex_of(self.mesh.triangles()[face][corner]);
        self.mesh.positions().view().get(vertex).map(|x| x as f32)
    }
    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        (self.normals)(face, corner)
    }
    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        (self.uvs)(face, corner)
    }
    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, corner: usize) {
        if let Some(tangent) = tangent {
            self.tangents[face][corner] = tangent.tangent_encoded();
        }
    }
}

/// Computes the tangents at the corners of all faces: a direction of unit length along u, and the sign of the
/// bitangent, which is `sign * normal × tangent`. v grows upwards.
///
/// Corners that only faces without area share get (1, 0, 0, 1). Cost: O(n log n).
pub(crate) fn corner_tangents(
    mesh: &TriMesh,
    normals: &dyn Fn(usize, usize) -> [f32; 3],
    uvs: &dyn Fn(usize, usize) -> [f32; 2],
) -> Vec<[[f32; 4]; 3]> {
    let tangents = vec![[[1.0, 0.0, 0.0, 1.0]; 3]; mesh.face_count()];
    let mut corners = Corners { mesh, normals, uvs, tangents };
    if mesh.face_count() > 0 {
        // Its only error has no variants.
        let _ = generate_tangents(&mut corners);
    }
    corners.tangents
}
