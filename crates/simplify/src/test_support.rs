//! Test fixtures of the engine's unit tests: random vectors and meshes, and prepared engines.

use glam::Vec3;
use lodsmith_core::{Positions, TriMesh, VertexId, WedgeId};
use proptest::prelude::*;

use crate::SimplifyOptions;
use crate::collapse::Engine;
use crate::constraints::Constraints;
use crate::control::NoControl;
use crate::input::Input;
use crate::metric::Metric;
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

/// Calls back with an engine before its first sweep on a mesh, and the run that belongs to it.
pub(crate) fn with_engine<M: Metric>(
    metric: M,
    mesh: &TriMesh,
    options: &SimplifyOptions,
    act: &mut dyn FnMut(&mut Engine<M>, &Run<'_, '_>),
) {
    let input = Input { surface: mesh.surface(), mesh: Some(mesh), joined: None };
    let Ok(mut in_order) = ordered(&input, &mut NoControl) else { return };
    let care = Constraints::new(options, &in_order, |v| v);
    let pass = collapses(options.method).expect("a method that collapses edges");
    let mut run = Run::new(&input, options, &mut in_order, &care, pass);
    let mut started = run.start(metric, None, false, (&[], 0)).expect("the options are sound");
    act(&mut started.engine, &run);
}

/// Returns the mesh with colours and with texture coordinates in two charts, one on each side of the middle:
/// vertices between them have two wedges.
pub(crate) fn in_two_charts(plain: &TriMesh) -> TriMesh {
    let view = plain.positions().view();
    let bounds = view.bounds().expect("it has vertices");
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
