//! Test fixtures of the engine's unit tests: random vectors and meshes, and prepared engines.

use glam::Vec3;
use lodsmith_core::splits::{Changes, Checkpoint, Counts, Layout, Original, SplitData};
use lodsmith_core::{FaceId, Positions, TriMesh, VertexId, WedgeId};
use proptest::prelude::*;

use crate::SimplifyOptions;
use crate::collapse::Engine;
use crate::constraints::Constraints;
use crate::control::NoControl;
use crate::cost::metric::Metric;
use crate::input::Input;
use crate::run::{Run, collapses, ordered};

/// A coordinate: few values are likely, so that vectors often coincide, are coplanar or zero.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        3 => (-2i8..=2).prop_map(f32::from),
        1 => Just(-0.0f32),
        3 => -1.0..1.0f32,
        1 => (-12i32..=4, -1.0..1.0f32).prop_map(|(e, x)| x * 10f32.powi(e)),
    ]
}

/// A vector like positions in the unit frame and their differences, or far outside that range.
pub(crate) fn vector() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
}

/// Four such vectors.
pub(crate) fn four_vectors() -> impl Strategy<Value = [Vec3; 4]> {
    [vector(), vector(), vector(), vector()]
}

/// A vector of length around one, in general position.
pub(crate) fn tame_vector() -> impl Strategy<Value = Vec3> {
    [-1.0..1.0f32, -1.0..1.0f32, -1.0..1.0f32].prop_map(Vec3::from)
}

/// Returns the bits of numbers; all NaNs are equal, and so are the two zeros.
pub(crate) fn bits<const N: usize>(of: [f32; N]) -> [u32; N] {
    of.map(|x| if x.is_nan() { f32::NAN } else { x + 0.0 }.to_bits())
}

/// Calls a function with an engine before its first sweep on a mesh, and the run that it belongs to.
pub(crate) fn with_engine<M: Metric>(
    metric: M,
    mesh: &TriMesh,
    options: &SimplifyOptions,
    act: &mut dyn FnMut(&mut Engine<M>, &Run<'_, '_>),
) {
    let input = Input::new(mesh);
    let Ok(mut in_order) = ordered(&input, &mut NoControl) else { return };
    let constraints = Constraints::new(&input.data, &in_order, |v| v);
    let pass = collapses(options.method.kind()).expect("a method that collapses edges");
    let mut run = Run::new(&input, options, &mut in_order, &constraints, pass);
    let (mut engine, _) = run.start(metric, false, (&[], 0));
    act(&mut engine, &run);
}

/// Returns the mesh with colours and with texture coordinates in two charts, one on each side of the middle:
/// vertices between them have two wedges.
pub(crate) fn in_two_charts(plain: &TriMesh) -> TriMesh {
    let view = plain.positions().view();
    let bounds = view.bounds().expect("the mesh has vertices");
    let at = |w: WedgeId| view.get(plain.vertex_of(w));
    let middle = 0.5 * (bounds.min[0] + bounds.max[0]);
    let is_right = |t: &[WedgeId; 3]| t.iter().map(|&w| at(w)[0]).sum::<f64>() / 3.0 > middle;
    let count = plain.vertex_count() as u32;
    // Wedge v is on the left side, v + count on the right.
    let vertex_of: Vec<VertexId> = (0..2 * count).map(|w| VertexId(w % count)).collect();
    let side = |t: &[WedgeId; 3]| if is_right(t) { count } else { 0 };
    let triangles = plain.triangles().iter().map(|t| t.map(|w| WedgeId(plain.vertex_of(w).0 + side(t))));
    let size = bounds.diagonal();
    let places: Vec<[f64; 3]> = vertex_of.iter().map(|v| view.get(*v).map(|x| x / size)).collect();
    let positions: Positions = plain.positions().clone();
    let mut mesh =
        TriMesh::with_wedges(positions, vertex_of, triangles.collect()).expect("wedges of vertices");
    let uv = |(w, p): (usize, &[f64; 3])| {
        let right = if w as u32 >= count { 3.0 } else { 0.0 };
        [(p[0] + 0.3 * p[2]) as f32 + right, (p[1] - 0.2 * p[2]) as f32]
    };
    mesh.set_uvs(Some(places.iter().enumerate().map(uv).collect())).expect("one for each wedge");
    let color = |p: &[f64; 3]| [p[0], p[1] * p[1], p[2].sin(), 1.0].map(|x| (0.5 + 0.3 * x) as f32);
    mesh.set_colors(Some(places.iter().map(color).collect())).expect("one for each wedge");
    lodsmith_core::mesh::compact::compact(&mesh).mesh
}

/// Points and faces of a mesh small enough to check by hand.
pub(crate) struct SmallMesh {
    pub(crate) points: Vec<Vec3>,
    pub(crate) faces: Vec<[u32; 3]>,
}

impl SmallMesh {
    fn new(points: &[[f32; 3]], faces: &[[u32; 3]]) -> Self {
        Self { points: points.iter().copied().map(Vec3::from).collect(), faces: faces.to_vec() }
    }
    /// Appends another mesh, moved by `by`.
    pub(crate) fn and(mut self, other: &Self, by: Vec3) -> Self {
        let first = self.points.len() as u32;
        self.points.extend(other.points.iter().map(|p| *p + by));
        self.faces.extend(other.faces.iter().map(|t| t.map(|v| v + first)));
        self
    }
    pub(crate) fn scaled(mut self, by: f32) -> Self {
        self.points.iter_mut().for_each(|p| *p *= by);
        self
    }
    pub(crate) fn triangles(&self) -> Vec<[VertexId; 3]> {
        self.faces.iter().map(|t| t.map(VertexId)).collect()
    }
    pub(crate) fn mesh(&self) -> TriMesh {
        let points = self.points.iter().map(|p| p.to_array()).collect();
        TriMesh::new(Positions::F32(points), self.triangles()).expect("indices in range")
    }
}

/// The four sides of a pyramid without its base: apex 0 at this height over the middle of a square with the
/// corners 1 to 4 and sides of length 2. With `s` = √(1 + height²), each side has the doubled area 2 s.
pub(crate) fn pyramid(height: f32) -> SmallMesh {
    SmallMesh::new(
        &[[0.0, 0.0, height], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]],
        &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]],
    )
}

/// A tetrahedron with three edges of length 1 along the axes from vertex 0.
pub(crate) fn tetrahedron() -> SmallMesh {
    SmallMesh::new(
        &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    )
}

/// An octahedron: vertices 0 and 1 at ±x, 2 and 3 at ±y, 4 and 5 at ±z, all at distance 1.
pub(crate) fn octahedron() -> SmallMesh {
    SmallMesh::new(
        &[
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ],
        &[[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
    )
}

/// A flat square of n × n unit cells, each split along its diagonal from low to high x and y. Vertex (x, y)
/// has the number y (n + 1) + x.
pub(crate) fn sheet(n: u32) -> SmallMesh {
    let row = n + 1;
    let points: Vec<[f32; 3]> = (0..row * row).map(|i| [(i % row) as f32, (i / row) as f32, 0.0]).collect();
    let corners = (0..n).flat_map(|y| (0..n).map(move |x| y * row + x));
    let faces: Vec<[u32; 3]> =
        corners.flat_map(|a| [[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]).collect();
    SmallMesh::new(&points, &faces)
}

/// Two coplanar triangles with a gap between an edge of each: 0 1 2 to the left of x = 1, 3 4 5 to the right of
/// x = 1 + `gap`. Vertices 1 and 3, and 2 and 5, are `gap` apart.
pub(crate) fn gap(gap: f32) -> SmallMesh {
    let right = 1.0 + gap;
    SmallMesh::new(
        &[
            [0.0, 0.5, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [right, 0.0, 0.0],
            [right + 1.0, 0.5, 0.0],
            [right, 1.0, 0.0],
        ],
        &[[0, 1, 2], [3, 4, 5]],
    )
}

/// A closed tube of triangular rings around the z axis, with a tip at each end: ring i has the vertices 3 i to
/// 3 i + 2 at z = 2 i; the last two vertices are the tips.
pub(crate) fn tube(rings: u32) -> SmallMesh {
    let at = |i: u32| {
        let angle = (i % 3) as f32 * std::f32::consts::TAU / 3.0;
        [angle.cos(), angle.sin(), (2 * (i / 3)) as f32]
    };
    let mut points: Vec<[f32; 3]> = (0..3 * rings).map(at).collect();
    points.extend([[0.0, 0.0, -1.0], [0.0, 0.0, (2 * rings - 1) as f32]]);
    let (first, last, count) = (3 * rings, 3 * rings + 1, 3 * rings);
    let mut faces = Vec::new();
    for k in 0..3 {
        let next = (k + 1) % 3;
        faces.extend([[first, next, k], [last, count - 3 + k, count - 3 + next]]);
        for low in (0..rings - 1).map(|i| 3 * i) {
            let high = low + 3;
            faces.extend([[low + k, low + next, high + next], [low + k, high + next, high + k]]);
        }
    }
    SmallMesh::new(&points, &faces)
}

/// Splits with three levels, of the faces
///
/// - 0 1 2,
/// - 0 1 2 and 1 3 2: the first split adds vertex 3 and moves vertex 1 from x = 2 to x = 1,
/// - 0 1 2, 1 4 2, 4 3 2 and 1 5 4: the second split adds vertices 4 and 5, and gives a corner of 3 to 4.
///
/// Checkpoints at the first and the last level move vertex 0 along z by 1 and by 3, and the last one moves vertex 1
/// along x by 1. The original has the elements in reverse order.
pub(crate) fn three_levels() -> SplitData {
    let count = |faces, vertices| Counts { faces, wedges: vertices, vertices };
    let checkpoint = |level, error, vertices: &[u32], moves: &[[f32; 3]]| Checkpoint {
        level,
        error,
        vertices: vertices.iter().copied().map(VertexId).collect(),
        moves: moves.to_vec(),
        ..Checkpoint::default()
    };
    let points = [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, 2.0], [2.0, 1.0], [2.0, 0.0]];
    SplitData {
        counts: vec![count(1, 3), count(2, 4), count(4, 6)],
        faces: [[0, 1, 2], [1, 3, 2], [4, 3, 2], [1, 5, 4]].map(|t| t.map(WedgeId)).into(),
        regions: None,
        vertex_of: None,
        layout: Layout::default(),
        values: Vec::new(),
        positions: Positions::F32(points.map(|[x, y]| [x, y, 0.0]).into()),
        corners: Changes { ends: vec![0, 0, 1], at: vec![4], to: vec![WedgeId(4)] },
        owners: Changes { ends: vec![0; 3], at: Vec::new(), to: Vec::new() },
        rows: Changes { ends: vec![0; 3], at: Vec::new(), to: Vec::new() },
        places: Changes {
            ends: vec![0, 1, 1],
            at: vec![VertexId(1)],
            to: Positions::F32(vec![[1.0, 0.0, 0.0]]),
        },
        checkpoints: vec![
            checkpoint(0, 0.4, &[0], &[[0.0, 0.0, 1.0]]),
            checkpoint(2, 0.1, &[0, 1], &[[0.0, 0.0, 3.0], [1.0, 0.0, 0.0]]),
        ],
        original: Some(Original {
            vertices: (0..6).rev().map(VertexId).collect(),
            wedges: (0..6).rev().map(WedgeId).collect(),
            faces: (0..4).rev().map(FaceId).collect(),
            has_vertex_map: false,
        }),
    }
}
