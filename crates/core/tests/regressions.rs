//! Regression tests for fixed bugs; for open bugs they assert today's wrong result and say so.

use lodsmith_core::polygon::Triangulator;
use lodsmith_core::{HalfEdgeId, Positions, Topology, TriMesh, VertexId};

/// The fan at a border vertex with a flipped face has two ends that look like its start; either one was used.
#[test]
fn a_flipped_face_on_a_border_leaves_the_fan_in_order() {
    //   3 --- 2        0 1 2 is correct, 0 3 2 is flipped: at 0 and 2 both corners
    //   |   / |        start with a border edge.
    //   | /   |
    //   0 --- 1
    let p = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let t = [[0, 1, 2], [0, 3, 2]].map(|t| t.map(VertexId)).to_vec();
    let mesh = TriMesh::new(Positions::F32(p), t).unwrap();
    let topology = Topology::new(&mesh.surface());
    topology.check();
    assert_eq!(topology.vertex(VertexId(0)).fan_count(), 1);
    assert_eq!(topology.counts().misoriented_edge_count, 1);
    assert!(topology.counts().is_orientable);
}

/// A plain fan of a concave polygon with a bridge (an assimp test model) doubled one face and overlapped others.
#[test]
fn a_concave_polygon_with_a_bridge_is_tiled_without_overlap() {
    // A square frame, cut open at its left: outer corners, then the inner ones in reverse.
    let flat: [[f64; 2]; 10] = [
        [0.0, 1.5],
        [0.0, 0.0],
        [3.0, 0.0],
        [3.0, 3.0],
        [0.0, 3.0],
        [0.0, 1.5],
        [1.0, 2.0],
        [2.0, 2.0],
        [2.0, 1.0],
        [1.0, 1.0],
    ];
    // The bridge ends where it started: at the outer corner and the inner corner that come twice.
    let mut points: Vec<[f64; 3]> = flat.iter().map(|p| [-1.146, p[0], p[1]]).collect();
    points.push([-1.146, 1.0, 2.0]);
    let mut triangles = Vec::new();
    Triangulator::default().triangulate(&points, &mut triangles);
    assert_eq!(triangles.len(), points.len() - 2);
    let mut sum = 0.0;
    for t in &triangles {
        let [a, b, c] = t.map(|i| points[i as usize]);
        let twice = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1]);
        assert!(twice.abs() > 1e-9, "no flat triangle");
        sum += twice.abs() / 2.0;
    }
    assert!((sum - 8.0).abs() < 1e-12);
}

/// Faults B4: each half-edge of an edge with 40,000 faces walked around all others to find out whether it was
/// the lowest.
#[test]
fn edges_with_many_faces_are_counted_in_one_walk() {
    let n = 300_000;
    let p = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = TriMesh::new(Positions::F32(p), vec![[0, 1, 2].map(VertexId); n]).unwrap();
    let topology = Topology::new(&mesh.surface());
    // In quadratic time this takes minutes: three times 300,000 walks of 300,000 steps.
    let counts = topology.counts();
    assert_eq!((counts.edge_count, counts.non_manifold_edge_count, counts.face_count), (3, 3, n));
    assert_eq!(topology.edges().collect::<Vec<_>>(), [0, 1, 2].map(HalfEdgeId));
    assert_eq!(topology.vertex(VertexId(0)).one_ring().collect::<Vec<_>>(), [1, 2].map(VertexId));
}
