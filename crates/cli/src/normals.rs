//! New normals for a mesh that has lost its own.

use lodsmith::core::TriMesh;

/// Gives every wedge the normal of its vertex: the mean of the face normals round it, weighted by their angles there.
///
/// Faces without area count nothing; a vertex with no other faces gets the z axis. Cost: O(n).
///
/// Source: [Thürmer-Wüthrich 1998].
pub(crate) fn recompute(mesh: &mut TriMesh) {
    let mut sums = vec![[0f64; 3]; mesh.vertex_count()];
    let surface = mesh.surface();
    let positions = surface.positions();
    for face in surface.triangles() {
        let p = face.map(|v| positions.get(v));
        // Each side as a direction: neither huge nor tiny coordinates leave the range of a double then.
        let sides = [0, 1, 2].map(|k| unit(sub(p[(k + 1) % 3], p[k])));
        let [Some(a), Some(b), Some(c)] = sides else { continue };
        let Some(normal) = unit(cross(a, b)) else { continue };
        for (corner, (out, back)) in [(a, c), (b, a), (c, b)].into_iter().enumerate() {
            let angle = (-dot(out, back)).clamp(-1.0, 1.0).acos();
            let sum = &mut sums[face[corner].index()];
            *sum = [0, 1, 2].map(|k| sum[k] + angle * normal[k]);
        }
    }
    let of_vertex = |sum: [f64; 3]| unit(sum).unwrap_or([0.0, 0.0, 1.0]).map(|x| x as f32);
    let normals = match mesh.vertex_map() {
        None => sums.into_iter().map(of_vertex).collect(),
        Some(map) => map.iter().map(|v| of_vertex(sums[v.index()])).collect(),
    };
    mesh.set_normals(Some(normals)).expect("there is one for each wedge");
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let largest = v.iter().fold(0f64, |m, x| m.max(x.abs()));
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let v = v.map(|x| x / largest);
    let length = dot(v, v).sqrt();
    Some(v.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use lodsmith::core::{Positions, VertexId};

    use super::*;

    #[test]
    fn corners_of_a_cube_point_outward_whatever_its_diagonals() {
        // Three faces meet at the origin; one of them is cut in two, which must not count double.
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
