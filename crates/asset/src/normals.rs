//! Normals of results.

use lodsmith_core::TriMesh;
use lodsmith_core::mesh::normals::wedge_normals;

/// Normals of a result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normals {
    /// Kept from the input.
    #[default]
    Keep,
    /// Recomputed from the faces; hard edges stay hard.
    Recompute,
    /// None.
    None,
}

impl Normals {
    /// All choices.
    pub const ALL: [Self; 3] = [Self::Keep, Self::Recompute, Self::None];

    /// Returns the name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Keep => "keep",
            Self::Recompute => "recompute",
            Self::None => "none",
        }
    }

    /// Keeps, recomputes or removes the normals of a mesh.
    pub fn apply(self, mesh: &mut TriMesh) {
        match self {
            Self::Keep => {}
            Self::Recompute => recompute(mesh),
            Self::None => mesh.set_normals(None).expect("none fit any mesh"),
        }
    }
}

/// Computes new normals from the faces; hard edges stay hard.
fn recompute(mesh: &mut TriMesh) {
    let normals = wedge_normals(mesh);
    mesh.set_normals(Some(normals)).expect("there is one for each wedge");
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{Positions, VertexId};

    use super::*;

    #[test]
    fn corner_normals_of_a_cube_do_not_depend_on_its_diagonals() {
        // Three sides meet at the origin; one of them is two triangles, which must not count double.
        //   z
        //   |  y
        //   | /
        //   0---x
        let positions = Positions::F64(vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 1.0, 0.0],
        ]);
        let face = |a, b, c| [VertexId(a), VertexId(b), VertexId(c)];
        let faces = vec![face(0, 4, 1), face(0, 2, 4), face(0, 1, 3), face(0, 3, 2)];
        let mut mesh = TriMesh::new(positions, faces).unwrap();
        recompute(&mut mesh);
        let n = mesh.normals().unwrap()[0];
        let third = -(1f32 / 3.0).sqrt();
        assert!(n.iter().all(|x| (x - third).abs() < 1e-6), "{n:?}");
    }

    #[test]
    fn a_face_without_area_changes_nothing() {
        let positions = Positions::F32(vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
        let mut mesh = TriMesh::new(positions, vec![[VertexId(0), VertexId(1), VertexId(2)]]).unwrap();
        recompute(&mut mesh);
        assert_eq!(mesh.normals().unwrap(), [[0.0, 0.0, 1.0]; 3]);
    }
}
