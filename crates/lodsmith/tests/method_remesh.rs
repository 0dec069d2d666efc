//! Guarantees of remeshing in addition to those of all methods.

use std::collections::HashSet;

use lodsmith::core::arbitrary::{Coordinates, perturbed_shape, soup};
use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::core::topology::TopologyCounts;
use lodsmith::core::{Topology, TriMesh, shapes};
use lodsmith::{
    BorderPolicy, Control, Input, Length, Method, MethodKind, NoControl, Placement, Remesh, RemeshPattern,
    SimplifyError, SimplifyOptions, Stop, StoppedBy, Verdict, simplify, simplify_with,
};
use proptest::prelude::*;

use crate::support::{self, Complaints, bytes, complaints, counts, run};

fn remesh(stop: Stop) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(stop);
    options.method = MethodKind::Remesh.into();
    options
}

fn on_surface(edge_length: Option<f64>, rounds: Option<usize>, pattern: RemeshPattern) -> Method {
    let edge_length = edge_length.map(Length::Units);
    Method::Remesh(Remesh::OnSurface { edge_length, crease_deg: None, rounds, pattern })
}

/// Returns all kinds of remeshing to a count.
fn patterns(stop: Stop) -> [(&'static str, SimplifyOptions); 3] {
    let (even, mut adaptive, mut levels) = (remesh(stop), remesh(stop), remesh(stop));
    adaptive.method = on_surface(None, None, RemeshPattern::Adaptive);
    levels.method = on_surface(None, None, RemeshPattern::SemiRegular { subdivisions: 1 });
    [("even", even), ("adaptive", adaptive), ("semi-regular", levels)]
}

/// Returns the qualities of triangles: 1 is equilateral. (4 · √3 · area / sum of squared edges.)
fn qualities(mesh: &TriMesh) -> Vec<f64> {
    let surface = mesh.surface();
    let shape = |t: &[lodsmith::core::VertexId; 3]| {
        let p = t.map(|v| surface.positions().get(v));
        let d = |i: usize, j: usize| [0, 1, 2].map(|k| p[j][k] - p[i][k]);
        let sq = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
        let (a, b, c) = (d(0, 1), d(1, 2), d(2, 0));
        let n = [a[1] * c[2] - a[2] * c[1], a[2] * c[0] - a[0] * c[2], a[0] * c[1] - a[1] * c[0]];
        2.0 * 3f64.sqrt() * sq(n).sqrt() / (sq(a) + sq(b) + sq(c))
    };
    surface.triangles().iter().map(shape).collect()
}

fn error(a: &TriMesh, b: &TriMesh) -> f64 {
    compare(&a.surface(), &b.surface(), &CompareOptions::default()).unwrap().rms.symmetric
}

#[test]
fn any_shape_to_any_count() {
    let mut all = Complaints::default();
    for (name, mesh) in shapes::all() {
        for share in [0.5, 0.1, 0.01] {
            for (pattern, options) in patterns(Stop::ratio(share)) {
                let case = format!("{name} {pattern} {share}");
                match run(&mesh, &options) {
                    Ok(Ok(done)) => {
                        all.add(&case, complaints(&mesh, &options, &done));
                        let (old, new) = (counts(&mesh), counts(&done.mesh));
                        // Each edge of the base becomes two.
                        let times = if pattern == "semi-regular" { 2 } else { 1 };
                        let twisted =
                            |c: &TopologyCounts| c.misoriented_edge_count + c.non_manifold_edge_count;
                        let kept = new.non_manifold_edge_count <= times * old.non_manifold_edge_count
                            && twisted(&new) <= times * twisted(&old);
                        all.check(
                            &case,
                            kept,
                            "there are new edges of three faces, or with inconsistent winding",
                        );
                        let again = run(&mesh, &options).unwrap().unwrap();
                        all.check(
                            &case,
                            bytes(&again.mesh) == bytes(&done.mesh),
                            "a second run gives another result",
                        );
                    }
                    // A base may need more faces than the input has.
                    Ok(Err(SimplifyError::BadOption { option: "subdivisions", .. })) => {}
                    Ok(Err(error)) => all.add(&case, [error.to_string()]),
                    Err(panic) => all.add(&case, [panic]),
                }
            }
        }
    }
    all.report_all();
}

#[test]
fn triangles_are_even_and_the_count_is_close() {
    for (mesh, target) in [(shapes::icosphere(5), 2000), (shapes::torus(80, 60), 1500)] {
        let done = simplify(&mesh, &remesh(Stop::faces(target))).unwrap();
        assert_eq!(done.report.stopped_by, StoppedBy::Faces);
        assert!(done.mesh.face_count() as f64 >= 0.97 * target as f64, "{}", done.mesh.face_count());
        let q = qualities(&done.mesh);
        let mean = q.iter().sum::<f64>() / q.len() as f64;
        assert!(mean > 0.95, "mean {mean}");
        assert!(q.iter().all(|q| *q > 0.3), "worst {:?}", q.iter().copied().fold(1.0, f64::min));
        assert_eq!(counts(&done.mesh).euler(), counts(&mesh).euler());
    }
}

#[test]
fn creases_and_corners_of_a_cube_are_kept() {
    let mesh = shapes::cube(16);
    let done = simplify(&mesh, &remesh(Stop::faces(600))).unwrap();
    assert!(error(&mesh, &done.mesh) < 1e-9, "{}", error(&mesh, &done.mesh));
}

#[test]
fn a_border_stays_on_its_curve() {
    let mesh = shapes::cylinder(64, 32);
    let done = simplify(&mesh, &remesh(Stop::ratio(0.3))).unwrap();
    assert_eq!(counts(&done.mesh).border_loop_count, counts(&mesh).border_loop_count);
    let mut locked = remesh(Stop::ratio(0.5));
    locked.border = BorderPolicy::Lock;
    let done = simplify(&mesh, &locked).unwrap();
    let border = |m: &TriMesh| {
        let topology = Topology::new(&m.surface());
        let positions = m.surface().positions();
        let open: HashSet<[u64; 3]> = topology
            .edges()
            .filter(|&h| topology.kind(h) == Some(lodsmith::core::topology::EdgeKind::Border))
            .flat_map(|h| [topology.origin(h), topology.target(h)])
            .map(|v| positions.get(v).map(f64::to_bits))
            .collect();
        open
    };
    assert_eq!(border(&mesh), border(&done.mesh));
}

#[test]
fn adaptive_is_closer_at_the_same_count() {
    // Four times as long as wide: the curvature is largest at its ends.
    let mut mesh = shapes::icosphere(5);
    mesh.map_positions(|p| [4.0 * p[0], p[1], p[2]]);
    let done: Vec<TriMesh> = patterns(Stop::faces(1500))
        .into_iter()
        .take(2)
        .map(|(_, mut options)| {
            if let Method::Remesh(Remesh::OnSurface { rounds, .. }) = &mut options.method {
                *rounds = Some(5);
            }
            simplify(&mesh, &options).unwrap().mesh
        })
        .collect();
    let [even, adaptive] = [error(&mesh, &done[0]), error(&mesh, &done[1])];
    assert!(adaptive < 0.9 * even, "{adaptive} against {even}");
}

#[test]
fn the_edge_length_is_the_requested_one() {
    let mesh = shapes::icosphere(5);
    let mut options = remesh(Stop::default());
    options.method = on_surface(Some(0.15), None, RemeshPattern::Even);
    let done = simplify(&mesh, &options).unwrap();
    assert_eq!(done.report.stopped_by, StoppedBy::Exhausted);
    let surface = done.mesh.surface();
    let lengths: Vec<f64> = surface
        .triangles()
        .iter()
        .map(|t| {
            let [a, b] = [t[0], t[1]].map(|v| surface.positions().get(v));
            (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
        })
        .collect();
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    assert!((mean / 0.15 - 1.0).abs() < 0.1, "{mean}");
    options.method = on_surface(Some(1e-6), None, RemeshPattern::Even);
    let error = simplify(&mesh, &options).unwrap_err();
    assert!(matches!(error, SimplifyError::BadOption { option: "edge-length", .. }), "{error}");
}

#[test]
fn options_that_remeshing_does_not_have_are_refused() {
    let mesh = shapes::icosphere(3);
    let mut options = remesh(Stop::faces(100));
    options.placement = Placement::Endpoint;
    let error = simplify(&mesh, &options).unwrap_err();
    assert!(matches!(error, SimplifyError::NotOfMethod { option: "placement endpoint", .. }), "{error}");
}

#[test]
fn levels_share_their_vertices() {
    let mesh = shapes::icosphere(5);
    let mut options = remesh(Stop::faces(5000));
    options.method = on_surface(None, None, RemeshPattern::SemiRegular { subdivisions: 3 });
    let done = simplify(&mesh, &options).unwrap();
    let levels = lodsmith::remesh::levels(&done.mesh, 3);
    assert_eq!(levels.len(), 4);
    assert_eq!(levels[3], done.mesh);
    for pair in levels.windows(2) {
        assert_eq!(pair[1].face_count(), 4 * pair[0].face_count());
        let [coarse, fine] = [&pair[0], &pair[1]].map(|m| m.positions().view());
        for (i, p) in coarse.iter().enumerate() {
            assert_eq!(p, fine.get(lodsmith::core::VertexId(i as u32)));
        }
        assert_eq!(counts(&pair[0]).euler(), 2);
        assert!(error(&mesh, &pair[1]) < error(&mesh, &pair[0]));
    }
}

#[test]
fn locked_vertices_keep_their_places() {
    let mesh = shapes::icosphere(4);
    let options = remesh(Stop::ratio(0.3));
    let positions = mesh.positions().view();
    let locked: Vec<bool> = positions.iter().map(|p| p[2] > 0.9).collect();
    let done = simplify_with(Input::new(&mesh).locked(&locked), &options, &mut NoControl).unwrap();
    let there = support::places(&done.mesh);
    let held = positions.iter().zip(&locked).filter(|x| *x.1).map(|x| support::bits(x.0));
    let held: Vec<[u64; 3]> = held.collect();
    assert!(held.len() > 20 && held.iter().all(|p| there.contains(p)));
    assert!(done.report.reached);
}

struct Once(Verdict);

impl Control for Once {
    fn progress(&mut self, _: f64) -> Verdict {
        self.0
    }
}

#[test]
fn a_caller_can_end_a_run() {
    let mesh = shapes::icosphere(5);
    for (_, options) in patterns(Stop::ratio(0.2)) {
        assert_eq!(simplify_with(&mesh, &options, &mut Once(Verdict::Cancel)), Err(SimplifyError::Cancelled));
        let done = simplify_with(&mesh, &options, &mut Once(Verdict::Finish)).unwrap();
        assert!(done.mesh.face_count() <= mesh.face_count());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: support::size(48, 12), ..ProptestConfig::default() })]
    #[test]
    fn any_mesh_gives_a_sound_result_or_an_error(
        mesh in prop_oneof![
            soup(40, Coordinates::Tame),
            soup(40, Coordinates::Wild),
            soup(40, Coordinates::NotFinite),
            perturbed_shape(0.02),
            perturbed_shape(0.5),
        ],
        share in 0.01f64..1.0,
    ) {
        for (pattern, options) in patterns(Stop::ratio(share)) {
            match run(&mesh, &options) {
                Ok(Ok(done)) => {
                    let found = complaints(&mesh, &options, &done);
                    prop_assert!(found.is_empty(), "{pattern}: {found:?}");
                }
                Ok(Err(SimplifyError::NoFaces { .. })) => {}
                Ok(Err(SimplifyError::BadOption { option: "subdivisions", .. })) => {}
                other => prop_assert!(false, "{pattern}: {other:?}"),
            }
        }
    }
}

#[test]
fn levels_within_a_distance_end_where_no_base_is_lighter() {
    let mesh = shapes::torus(48, 24);
    for limit in [0.1, 0.2, 0.4] {
        for subdivisions in [1, 2] {
            let mut options = remesh(Stop::error(Length::OfDiagonal(limit)));
            options.method = on_surface(None, None, RemeshPattern::SemiRegular { subdivisions });
            let done = simplify(&mesh, &options).unwrap();
            let error = &done.report.error;
            assert!(
                done.report.reached && error.bound.unwrap() <= limit * error.diagonal,
                "{limit} {subdivisions}"
            );
        }
    }
}
