//! Vertex normals computed from faces.

use crate::ids::VertexId;
use crate::mesh::Surface;

/// Computes the normal of each vertex: the mean of the normals of its faces, weighted by their angles at the
/// vertex.
///
/// `place` returns the representative of all vertices at the same position; the identity if vertices are
/// already welded. Normals are of unit length. Faces without area are ignored; a vertex with no other faces
/// gets the z axis. Cost: O(n).
///
/// Source: [Thürmer-Wüthrich 1998].
pub fn vertex_normals(surface: &Surface<'_>, place: impl Fn(VertexId) -> VertexId) -> Vec<[f32; 3]> {
    let positions = surface.positions();
    let mut sums = vec![[0f64; 3]; positions.len()];
    for face in surface.triangles() {
        let p = face.map(|v| positions.get(v));
        // Sides are normalized first: then neither huge nor tiny coordinates leave the range of a double.
        let sides = [0, 1, 2].map(|k| unit(sub(p[(k + 1) % 3], p[k])));
        let [Some(a), Some(b), Some(c)] = sides else { continue };
        let Some(normal) = unit(cross(a, b)) else { continue };
        for (corner, (out, back)) in [(a, c), (b, a), (c, b)].into_iter().enumerate() {
            let angle = libm::acos((-dot(out, back)).clamp(-1.0, 1.0));
            let sum = &mut sums[place(face[corner]).index()];
            *sum = [0, 1, 2].map(|k| sum[k] + angle * normal[k]);
        }
    }
    let normal = |v: usize| unit(sums[place(VertexId::new(v)).index()]).unwrap_or([0.0, 0.0, 1.0]);
    (0..positions.len()).map(|v| normal(v).map(|x| x as f32)).collect()
}

pub(super) fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
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
    use super::*;
    use crate::mesh::PositionsView;
    use crate::mesh::weld::weld;
    use crate::shapes;

    #[test]
    fn vertices_at_one_place_share_their_normal() {
        // A sphere as a soup: each corner has its own vertex.
        let ball = shapes::icosphere(2);
        let surface = ball.surface();
        let points: Vec<[f64; 3]> =
            surface.triangles().iter().flatten().map(|&v| surface.positions().get(v)).collect();
        let faces: Vec<[VertexId; 3]> =
            (0..points.len() as u32).step_by(3).map(|i| [0, 1, 2].map(|k| VertexId(i + k))).collect();
        let soup = Surface::new(PositionsView::F64(&points), &faces).unwrap();
        let joined = weld(soup.positions());
        for (n, p) in vertex_normals(&soup, |v| joined.of(v)).iter().zip(&points) {
            let along: f64 = n.iter().zip(p).map(|(a, b)| f64::from(*a) * b).sum();
            let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!(along > 0.999 * length, "{n:?} at {p:?}");
        }
        let flat = vertex_normals(&soup, |v| v);
        assert!(
            flat.chunks(3).all(|t| t[0] == t[1] || t[0].iter().zip(t[1]).all(|(a, b)| (a - b).abs() < 1e-6))
        );
    }
}
