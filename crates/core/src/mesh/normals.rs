//! Vertex normals computed from faces.

use crate::disjoint_sets::DisjointSets;
use crate::ids::{FaceId, VertexId, WedgeId};
use crate::mesh::{Surface, TriMesh};
use crate::topology::Topology;

/// Computes the normal of each vertex: the mean of the normals of its faces, weighted by their angles at the
/// vertex.
///
/// `place` returns the representative of all vertices at the same position; the identity if vertices are
/// already welded. Normals are of unit length. Faces without area are ignored; a vertex with no other faces
/// gets the z axis. Cost: O(n).
///
/// Source: [Thürmer-Wüthrich 1998].
pub fn vertex_normals(surface: &Surface<'_>, place: impl Fn(VertexId) -> VertexId) -> Vec<[f32; 3]> {
    let count = surface.positions().len();
    let triangles = surface.triangles();
    let normals = normals_of(surface, count, |face, k| place(triangles[face][k]).index());
    (0..count).map(|v| normals[place(VertexId::new(v)).index()]).collect()
}

/// Computes new normals for the wedges of a mesh from its faces. Hard edges of the mesh stay hard: two faces at an edge
/// share their new normals there unless the current normals differ by more than half the angle between the faces. A
/// mesh without normals has no hard edges.
///
/// Vertices at the same position count as different. Weights, faces without area and wedges without faces are treated
/// as in [`vertex_normals`]. Cost: O(n log k), where k is the number of edges at a vertex.
pub fn wedge_normals(mesh: &TriMesh) -> Vec<[f32; 3]> {
    let surface = mesh.surface();
    let Some(own) = mesh.normals() else {
        let of_vertex = vertex_normals(&surface, |v| v);
        return (0..mesh.wedge_count()).map(|w| of_vertex[mesh.vertex_of(WedgeId::new(w)).index()]).collect();
    };
    let positions = surface.positions();
    let corners = mesh.triangles().as_flattened();
    let topology = Topology::unwelded(&surface);
    let face_normal = |face: FaceId| {
        let [a, b, c] = topology.triangle(face).map(|v| positions.get(v));
        unit(cross(unit(sub(b, a))?, unit(sub(c, a))?))
    };
    let mut sets = DisjointSets::new(mesh.wedge_count());
    for h in topology.edges() {
        let Some(g) = topology.twin(h) else { continue };
        let here = [h, h.next()].map(|h| corners[h.index()]);
        let mut there = [g, g.next()].map(|h| corners[h.index()]);
        if topology.origin(g) != topology.origin(h) {
            there.swap(0, 1);
        }
        let (Some(m), Some(n)) = (face_normal(h.face()), face_normal(g.face())) else { continue };
        let bend = length(sub(m, n));
        let jump = [0, 1].map(|end| {
            let [m, n] = [here[end], there[end]].map(|w| own[w.index()].map(f64::from));
            length(sub(m, n))
        });
        let jump = jump[0].max(jump[1]);
        // (A NaN normal does not make an edge hard.)
        if jump > MIN_JUMP && 2.0 * jump > bend {
            continue;
        }
        sets.join(here[0].0, there[0].0);
        sets.join(here[1].0, there[1].0);
    }
    let set = sets.into_representatives();
    let of_set =
        normals_of(&surface, mesh.wedge_count(), |face, k| set[corners[3 * face + k].index()] as usize);
    set.iter().map(|&set| of_set[set as usize]).collect()
}

/// Smaller differences between two unit normals do not make an edge hard: half a degree, the possible error of normals
/// with one byte per coordinate.
const MIN_JUMP: f64 = 0.01;

/// Returns, for each number, the mean normal of the corners that have it, weighted by their angles; the z axis if there
/// are none.
fn normals_of(surface: &Surface<'_>, count: usize, number: impl Fn(usize, usize) -> usize) -> Vec<[f32; 3]> {
    let positions = surface.positions();
    let mut sums = vec![[0f64; 3]; count];
    for (f, face) in surface.triangles().iter().enumerate() {
        let p = face.map(|v| positions.get(v));
        // Sides are normalized first: then neither huge nor tiny coordinates leave the range of a double.
        let sides = [0, 1, 2].map(|k| unit(sub(p[(k + 1) % 3], p[k])));
        let [Some(a), Some(b), Some(c)] = sides else { continue };
        let Some(normal) = unit(cross(a, b)) else { continue };
        for (corner, (out, back)) in [(a, c), (b, a), (c, b)].into_iter().enumerate() {
            let angle = libm::acos((-dot(out, back)).clamp(-1.0, 1.0));
            let sum = &mut sums[number(f, corner)];
            *sum = [0, 1, 2].map(|k| sum[k] + angle * normal[k]);
        }
    }
    sums.iter().map(|sum| unit(*sum).unwrap_or([0.0, 0.0, 1.0]).map(|x| x as f32)).collect()
}

pub(super) fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
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
    use crate::mesh::weld::weld;
    use crate::mesh::{Positions, PositionsView};
    use crate::shapes;

    /// Two squares along the y axis that meet at a right angle; at the common edge each has wedges of its own, with the
    /// normals `own`.
    fn roof(own: [[f32; 3]; 2]) -> TriMesh {
        let positions = vec![
            [0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 0.0, -1.0],
            [0.0, 1.0, -1.0],
        ];
        let vertex_of = [0, 1, 2, 3, 0, 1, 4, 5].map(VertexId).to_vec();
        let faces = [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6]].map(|t| t.map(WedgeId)).to_vec();
        let mut mesh = TriMesh::with_wedges(Positions::F32(positions), vertex_of, faces).unwrap();
        mesh.set_normals(Some([[own[0]; 4], [own[1]; 4]].concat())).unwrap();
        mesh
    }

    #[test]
    fn hard_edges_stay_hard_when_normals_are_computed_again() {
        let near = |found: [f32; 3], wanted: [f32; 3]| {
            assert!((0..3).all(|k| (found[k] - wanted[k]).abs() < 1e-6), "{found:?}, not {wanted:?}");
        };
        // Normals of older faces, some degrees off.
        let hard = wedge_normals(&roof([[0.1, 0.0, 0.995], [-0.995, 0.0, 0.1]]));
        near(hard[0], [0.0, 0.0, 1.0]);
        near(hard[4], [-1.0, 0.0, 0.0]);
        // The same normal on both sides, as at a seam of textures alone.
        let half = 0.5f32.sqrt();
        let soft = wedge_normals(&roof([[-half, 0.0, half]; 2]));
        [0, 1, 4, 5].into_iter().for_each(|w| near(soft[w], [-half, 0.0, half]));
        near(soft[2], [0.0, 0.0, 1.0]);
        let mut bare = roof([[0.0, 0.0, 1.0]; 2]);
        bare.set_normals(None).unwrap();
        [0, 1, 4, 5].into_iter().for_each(|w| near(wedge_normals(&bare)[w], [-half, 0.0, half]));
    }

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
