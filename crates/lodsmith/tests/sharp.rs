//! Sharp edges as features: `SimplifyOptions::sharp_deg`.

use lodsmith::core::spatial::Bvh;
use lodsmith::core::{Positions, TriMesh, VertexId, shapes};
use lodsmith::{
    MethodKind, NoControl, Progressive, Simplified, SimplifyError, SimplifyOptions, Stop, simplify,
};

use crate::support::{Complaints, bytes, complaints, topology_complaints};

const COLLAPSES: [MethodKind; 5] = [
    MethodKind::Memoryless,
    MethodKind::Quadric,
    MethodKind::LindstromTurk,
    MethodKind::Melax,
    MethodKind::ShortestEdge,
];

fn done(mesh: &TriMesh, method: MethodKind, ratio: f64, sharp_deg: Option<f64>) -> Simplified {
    let mut options = SimplifyOptions::new(Stop::ratio(ratio));
    (options.method, options.sharp_deg) = (method.into(), sharp_deg);
    simplify(mesh, &options).unwrap()
}

/// Returns the point on the crest of the ridge at `x`.
fn crest(x: f64) -> [f64; 3] {
    [x, 0.5 + 0.15 * (4.0 * x).sin(), HEIGHT + wave(x, 0.5)]
}

const HEIGHT: f64 = 0.01;
const CELLS: u32 = 50;

fn wave(x: f64, v: f64) -> f64 {
    0.03 * (9.0 * x).sin() * (7.0 * v).cos()
}

/// A wavy sheet with a low ridge along a curve, two cells wide.
fn ridge() -> TriMesh {
    let grid = shapes::grid(CELLS);
    let place = |p: [f64; 3]| {
        let [x, v, _] = p;
        let side = (v - 0.5).abs() * f64::from(CELLS);
        let lift = HEIGHT * (1.0 - side).max(0.0);
        [x, v + 0.15 * (4.0 * x).sin(), lift + wave(x, v)].map(|x| x as f32)
    };
    let points = grid.positions().view().iter().map(place).collect();
    TriMesh::new(Positions::F32(points), grid.surface().triangles().to_vec()).unwrap()
}

/// Returns the RMS distance of the crest from a mesh.
fn off_the_crest(mesh: &TriMesh) -> f64 {
    let tree = Bvh::new(&mesh.surface());
    let far = |i: u32| tree.closest(crest(f64::from(i) / f64::from(CELLS))).unwrap().distance;
    ((0..=CELLS).map(|i| far(i).powi(2)).sum::<f64>() / f64::from(CELLS + 1)).sqrt()
}

#[test]
fn a_ridge_keeps_its_crest() {
    let mesh = ridge();
    for method in [MethodKind::Memoryless, MethodKind::Quadric, MethodKind::LindstromTurk] {
        let [without, with] = [None, Some(40.0)].map(|deg| done(&mesh, method, 0.05, deg));
        assert!(with.report.reached && !with.report.sharp_relaxed, "{method:?}");
        let [without, with] = [without, with].map(|d| off_the_crest(&d.mesh));
        assert!(with < 0.7 * without, "{method:?}: {with} with, {without} without");
    }
}

#[test]
fn an_angle_that_no_edge_exceeds_has_no_effect() {
    for (name, mesh) in [("blob", shapes::blob(4, 3)), ("ridge", ridge())] {
        for method in COLLAPSES {
            let [without, with] = [None, Some(179.0)].map(|deg| done(&mesh, method, 0.1, deg));
            assert!(bytes(&without.mesh) == bytes(&with.mesh), "{name}, {method:?}");
        }
    }
}

#[test]
fn with_features_results_are_sound_for_any_shape() {
    let mut all = Complaints::default();
    for (name, mesh) in shapes::all() {
        for method in COLLAPSES {
            for ratio in [0.3, 0.05] {
                let mut options = SimplifyOptions::new(Stop::ratio(ratio));
                (options.method, options.sharp_deg) = (method.into(), Some(25.0));
                let case = format!("{name}, {method:?}, {ratio}");
                match simplify(&mesh, &options) {
                    Ok(done) => {
                        all.add(&case, complaints(&mesh, &options, &done));
                        all.add(&case, topology_complaints(&mesh, &options, &done));
                    }
                    Err(SimplifyError::NoFaces { .. }) => {}
                    Err(why) => all.add(&case, [why.to_string()]),
                }
            }
        }
    }
    all.report_all();
}

/// If every edge is a feature, features are given up for the target, and the report says so.
#[test]
fn features_give_way_to_the_target() {
    let mesh = shapes::noisy_sphere(3, 0.2, 5);
    let all = done(&mesh, MethodKind::Memoryless, 0.02, Some(0.01));
    assert!(all.report.reached && all.report.sharp_relaxed);
}

#[test]
fn a_progressive_mesh_keeps_features() {
    let mesh = ridge();
    let build = |deg| {
        let mut options = SimplifyOptions::default();
        options.sharp_deg = deg;
        let mut progressive = Progressive::build(&mesh, &options, &mut NoControl).unwrap();
        progressive.to_faces(mesh.face_count() / 20);
        progressive
    };
    let [without, mut with] = [None, Some(40.0)].map(build);
    let off = |progressive: &Progressive| off_the_crest(&progressive.fitted_mesh().unwrap());
    assert!(off(&with) < 0.7 * off(&without), "{} with, {} without", off(&with), off(&without));
    with.to_level(with.top());
    assert_eq!(with.mesh().unwrap(), mesh);
}

#[test]
fn angles_out_of_range_and_methods_without_features_are_errors() {
    let mesh = shapes::icosphere(1);
    let run = |method: MethodKind, deg: f64| {
        let mut options = SimplifyOptions::new(Stop::faces(10));
        (options.method, options.sharp_deg) = (method.into(), Some(deg));
        simplify(&mesh, &options).map(|_| ())
    };
    for deg in [0.0, -1.0, 180.0, f64::NAN] {
        let result = run(MethodKind::Memoryless, deg);
        assert!(matches!(result, Err(SimplifyError::BadOption { option: "sharp", .. })), "{deg}: {result:?}");
    }
    for method in MethodKind::ALL.into_iter().filter(|m| !COLLAPSES.contains(m)) {
        let result = run(method, 30.0);
        assert!(
            matches!(result, Err(SimplifyError::NotOfMethod { option: "sharp", .. })),
            "{method:?}: {result:?}"
        );
    }
}

/// A sharp edge is recognised after a triangle was removed, and between sheets with different winding.
#[test]
fn differently_wound_faces_can_share_a_sharp_edge() {
    // A flat pair of triangles, the second flipped: none of its edges is sharp.
    let at = |p: &[[f32; 3]], t: &[[u32; 3]]| {
        TriMesh::new(Positions::F32(p.to_vec()), t.iter().map(|t| t.map(VertexId)).collect()).unwrap()
    };
    let flat = at(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]], &[[0, 1, 2], [1, 2, 3]]);
    let [without, with] = [None, Some(1.0)].map(|deg| done(&flat, MethodKind::Memoryless, 0.5, deg));
    assert!(bytes(&without.mesh) == bytes(&with.mesh));
}
