//! Edge-collapse methods other than `memoryless` and `quadric`: `lindstrom-turk`, `melax`, `shortest-edge`.

use std::collections::HashMap;

use lodsmith::core::arbitrary::{Coordinates, perturbed_shape, soup};
use lodsmith::core::topology::size_of;
use lodsmith::core::{TriMesh, shapes};
use lodsmith::{
    BorderPolicy, Control, Fit, Guards, Input, Length, Measure, Method, MethodKind, NoControl, OwnedMeshData,
    Placement, Refusal, Report, Simplified, SimplifyError, SimplifyOptions, Stop, StoppedBy, TopologyPolicy,
    Verdict, simplify, simplify_with,
};
use proptest::prelude::*;

use crate::support::attributed::{
    attribute_complaints, locked_complaints, with_random_attributes, with_rare_options,
};
use crate::support::charts::{place, two_charts, wedges};
use crate::support::{
    CaseFilter, Complaints, Random, bytes, complaints, options_text, places, run, size, topology_complaints,
};

/// Each method with the placements that it has.
const METHODS: [(MethodKind, &[Placement]); 3] = [
    (MethodKind::LindstromTurk, &[Placement::Optimal, Placement::Endpoint, Placement::Midpoint]),
    (MethodKind::Melax, &[Placement::Endpoint]),
    (MethodKind::ShortestEdge, &[Placement::Midpoint, Placement::Endpoint]),
];
const BORDERS: [BorderPolicy; 4] =
    [BorderPolicy::Keep, BorderPolicy::Slide, BorderPolicy::Lock, BorderPolicy::Free];
const TOPOLOGIES: [TopologyPolicy; 3] =
    [TopologyPolicy::Relaxed, TopologyPolicy::Preserve, TopologyPolicy::Free];

fn by(method: MethodKind, stop: Stop) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(stop);
    options.method = method.into();
    options
}

fn done<'a>(input: impl Into<Input<'a>>, options: &SimplifyOptions) -> Simplified {
    simplify_with(input, options, &mut NoControl).unwrap()
}

fn shorter_than(edge: f64) -> SimplifyOptions {
    let mut options = SimplifyOptions::default();
    options.method = Method::ShortestEdge { edge_length: Some(Length::Units(edge)) };
    options
}

/// Returns the corners of the faces, by position.
fn corners(mesh: &TriMesh) -> Vec<[[f64; 3]; 3]> {
    let (surface, at) = (mesh.surface(), mesh.positions().view());
    surface.triangles().iter().map(|t| t.map(|v| at.get(v))).collect()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

fn shortest_edge(mesh: &TriMesh) -> f64 {
    let edges = |p: [[f64; 3]; 3]| [0, 1, 2].map(|k| distance(p[k], p[(k + 1) % 3]));
    corners(mesh).into_iter().flat_map(edges).fold(f64::INFINITY, f64::min)
}

fn subset_is_kept(mesh: &TriMesh, got: &Simplified) -> bool {
    places(&got.mesh).is_subset(&places(mesh))
}

#[test]
fn every_policy_and_stop_on_every_shape() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(7);
    let mut tried = |name: &str, mesh: &TriMesh, options: &SimplifyOptions| {
        if !cases.takes() {
            return;
        }
        let case = format!("{name}, {}", options_text(options));
        match run(mesh, options) {
            Ok(Ok(got)) => {
                all.add(&case, complaints(mesh, options, &got));
                all.add(&case, topology_complaints(mesh, options, &got));
                let is_subset = options.placement != Placement::Endpoint || subset_is_kept(mesh, &got);
                all.check(&case, is_subset, "a vertex that is not in the input");
            }
            Ok(Err(error)) => all.add(&case, [format!("fails: {error}")]),
            Err(panic) => all.add(&case, [panic]),
        }
    };
    for (name, mesh) in shapes::all() {
        let (faces, vertices) = (mesh.face_count(), mesh.vertex_count());
        for (method, placements) in METHODS {
            for &placement in placements {
                for border in BORDERS {
                    for topology in TOPOLOGIES {
                        let mut options = by(method, Stop::faces(faces / 10));
                        (options.placement, options.border, options.topology) = (placement, border, topology);
                        tried(name, &mesh, &options);
                    }
                }
            }
            let several = Stop { faces: Some(faces / 4), vertices: Some(vertices / 2), ..Stop::ratio(0.3) };
            for stop in
                [Stop::faces(1), Stop::vertices(vertices / 3), Stop::ratio(1.0), several, Stop::default()]
            {
                tried(name, &mesh, &by(method, stop));
            }
            for guards in [
                Guards { max_normal_deg: Some(15.0), ..Guards::default() },
                Guards { min_quality: Some(0.3), max_valence: Some(8), ..Guards::default() },
                Guards { max_edge: Some(Length::OfDiagonal(0.2)), ..Guards::default() },
            ] {
                let mut options = by(method, Stop::faces(4));
                options.guards = guards;
                tried(name, &mesh, &options);
            }
            tried(name, &mesh, &by(method, Stop::error(Length::OfDiagonal(0.02))));
        }
    }
    all.report_all();
}

fn any_mesh() -> impl Strategy<Value = TriMesh> {
    let plain = prop_oneof![
        soup(12, Coordinates::Tame),
        soup(60, Coordinates::Tame),
        soup(40, Coordinates::Wild),
        soup(40, Coordinates::NotFinite),
        perturbed_shape(0.02),
        perturbed_shape(0.5),
    ];
    (plain, any::<u64>()).prop_map(|(mesh, seed)| {
        if seed.is_multiple_of(3) { mesh } else { with_random_attributes(&mesh, &mut Random(seed | 1)) }
    })
}

fn any_options(seed: u64, vertices: usize) -> (SimplifyOptions, OwnedMeshData) {
    let mut random = Random(seed | 1);
    for _ in 0..4 {
        random.below(2);
    }
    let (method, placements) = random.pick(&METHODS);
    let stop = match random.below(3) {
        0 => Stop::faces(random.below(10) as usize),
        1 => Stop::vertices(random.below(20) as usize),
        _ => Stop::ratio(random.unit().max(1e-3)),
    };
    let (mut options, data) = with_rare_options(by(method, stop), &mut random, vertices);
    options.placement = random.pick(placements);
    options.border = random.pick(&BORDERS);
    options.topology = random.pick(&TOPOLOGIES);
    if method != MethodKind::Melax {
        options.fit = random.pick(&[Fit::Auto, Fit::On, Fit::Off]);
    }
    (options, data)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(size(192, 48)) })]

    #[test]
    fn any_mesh_gives_a_sound_result(mesh in any_mesh(), seed in any::<u64>()) {
        let (options, data) = any_options(seed, mesh.vertex_count());
        let input = Input::new(&mesh).with(data.view());
        let found = match run(&input, &options) {
            Ok(Ok(got)) => {
                let mut found = complaints(&mesh, &options, &got);
                let locked = data.locked.as_deref();
                found.extend(attribute_complaints(&mesh, options.placement, locked, &got.mesh));
                if let Some(locked) = locked {
                    found.extend(locked_complaints(&mesh, locked, (options.weld.is_some(), false), &got.mesh));
                }
                let is_same = |a: &Simplified| bytes(&a.mesh) == bytes(&got.mesh) && a.report == got.report;
                if !matches!(run(&input, &options), Ok(Ok(again)) if is_same(&again)) {
                    found.push("a second run gives another result".to_owned());
                }
                found
            }
            Ok(Err(SimplifyError::NoFaces { .. })) => Vec::new(),
            Ok(Err(error)) => vec![format!("fails: {error}")],
            Err(panic) => vec![panic],
        };
        prop_assert!(found.is_empty(), "{}: {found:?}", options_text(&options));
    }

    #[test]
    fn the_error_of_any_mesh_is_kept(
        mesh in prop_oneof![soup(12, Coordinates::Tame), soup(12, Coordinates::NotFinite)],
        limit in 0.0..0.2f64,
        method in 0..METHODS.len(),
    ) {
        let options = by(METHODS[method].0, Stop::error(Length::OfDiagonal(limit)));
        let found = match run(&mesh, &options) {
            Ok(Ok(got)) => complaints(&mesh, &options, &got),
            Ok(Err(SimplifyError::NoFaces { .. })) => Vec::new(),
            Ok(Err(error)) => vec![format!("fails: {error}")],
            Err(panic) => vec![panic],
        };
        prop_assert!(found.is_empty(), "{}: {found:?}", options_text(&options));
    }
}

#[test]
fn the_estimate_is_within_a_factor_of_two() {
    for (method, _) in METHODS {
        for mesh in [shapes::blob(5, 1), shapes::torus(80, 40), shapes::noisy_sphere(4, 0.02, 1)] {
            for ratio in [0.5, 0.1] {
                let mut options = by(method, Stop::ratio(ratio));
                options.measure = Measure::Always;
                let Report { error, .. } = done(&mesh, &options).report;
                let share = error.estimate / error.measured.unwrap().rms.symmetric;
                assert!((0.5..2.0).contains(&share), "{method:?} to {ratio}: {share}");
            }
        }
    }
}

#[test]
fn a_run_can_be_cancelled_or_finished_early() {
    struct AnswerAfter(usize, Verdict);
    impl Control for AnswerAfter {
        fn progress(&mut self, _: f64) -> Verdict {
            self.0 = self.0.saturating_sub(1);
            if self.0 == 0 { self.1 } else { Verdict::Continue }
        }
    }
    let mesh = shapes::blob(5, 1);
    for (method, _) in METHODS {
        let options = by(method, Stop::faces(100));
        let cancelled = simplify_with(&mesh, &options, &mut AnswerAfter(4, Verdict::Cancel));
        assert_eq!(cancelled.unwrap_err(), SimplifyError::Cancelled);
        let finished = simplify_with(&mesh, &options, &mut AnswerAfter(4, Verdict::Finish)).unwrap();
        assert_eq!(finished.report.stopped_by, StoppedBy::Caller);
        assert!((101..mesh.face_count()).contains(&finished.mesh.face_count()));
    }
}

#[test]
fn important_places_get_more_triangles() {
    // A sphere of which one half is more important.
    let mesh = shapes::icosphere(4);
    let heights: Vec<f64> = mesh.positions().view().iter().map(|p| p[2]).collect();
    for (method, _) in METHODS {
        let importance: Vec<f32> = heights.iter().map(|&z| if z > 0.0 { 4.0 } else { 1.0 }).collect();
        let input = Input::new(&mesh).importance(&importance);
        let got = done(&input, &by(method, Stop::faces(1000))).mesh;
        let above = corners(&got).iter().filter(|t| t.iter().map(|p| p[2]).sum::<f64>() > 0.0).count();
        let share = above as f64 / (got.face_count() - above) as f64;
        assert!((1.7..9.0).contains(&share), "{method:?}: {share}");
    }
}

#[test]
fn options_that_a_method_does_not_have_are_refused() {
    let mesh = shapes::icosphere(1);
    let refused = |options: &SimplifyOptions| match simplify(&mesh, options) {
        Err(SimplifyError::NotOfMethod { option, .. }) => option,
        other => panic!("{:?}", other.map(|d| d.report)),
    };
    let mut options = by(MethodKind::Melax, Stop::faces(10));
    options.fit = Fit::On;
    assert_eq!(refused(&options), "fit on");
    options = by(MethodKind::Melax, Stop::faces(10));
    options.placement = Placement::Midpoint;
    assert_eq!(refused(&options), "placement midpoint");
}

// lindstrom-turk

#[test]
fn lindstrom_turk_keeps_the_volume() {
    for (name, mesh) in [("sphere", shapes::icosphere(4)), ("blob", shapes::blob(5, 1))] {
        let volume = |m: &TriMesh| size_of(&m.surface()).volume;
        let (before, by_turk) = (volume(&mesh), by(MethodKind::LindstromTurk, Stop::faces(200)));
        let mut plain = by(MethodKind::Memoryless, Stop::faces(200));
        plain.fit = Fit::Off;
        let off = |options: &SimplifyOptions| (volume(&done(&mesh, options).mesh) / before - 1.0).abs();
        let (own, other) = (off(&by_turk), off(&plain));
        assert!(own < 1e-5, "{name}: {own}");
        // Without the constraint the volume would change.
        assert!(other > 10.0 * own, "{name}: {other}");
    }
}

#[test]
fn lindstrom_turk_keeps_the_area_within_a_planar_border() {
    // A disc with 256 border edges, rotated off the axes.
    let (rings, around) = (16, 256);
    let mut positions = vec![[0.0, 0.0, 0.0]];
    let mut faces = Vec::new();
    for r in 1..=rings {
        for i in 0..around {
            let angle = f64::from(i) / f64::from(around) * std::f64::consts::TAU;
            let radius = f64::from(r) / f64::from(rings);
            let (x, y) = (radius * angle.cos(), radius * angle.sin());
            positions.push([x, y, 0.5 * x - 0.25 * y]);
        }
    }
    let at = |r: i32, i: i32| (1 + (r - 1) * around + i % around) as u32;
    for i in 0..around {
        faces.push([0, at(1, i), at(1, i + 1)]);
        for r in 1..rings {
            faces.push([at(r, i), at(r + 1, i), at(r + 1, i + 1)]);
            faces.push([at(r, i), at(r + 1, i + 1), at(r, i + 1)]);
        }
    }
    let faces = faces.into_iter().map(|t| t.map(lodsmith::core::VertexId)).collect();
    let mesh = TriMesh::new(lodsmith::core::Positions::F64(positions), faces).unwrap();
    let area = |m: &TriMesh| size_of(&m.surface()).area;
    let got = done(&mesh, &by(MethodKind::LindstromTurk, Stop::faces(60)));
    assert!(got.report.reached);
    let off = area(&got.mesh) / area(&mesh) - 1.0;
    assert!(off.abs() < 1e-5, "{off}");
}

#[test]
fn lindstrom_turk_loses_nothing_on_flat_meshes() {
    let mut options = by(MethodKind::LindstromTurk, Stop::faces(12));
    options.measure = Measure::Always;
    let got = done(&shapes::cube(12), &options);
    assert!(got.report.reached);
    assert!(got.report.error.measured.unwrap().hausdorff.symmetric < 1e-5);
}

// melax

#[test]
fn melax_keeps_vertices_and_attributes_of_the_input() {
    let mesh = two_charts(24);
    let uvs = mesh.uvs().unwrap();
    let mut known: HashMap<_, Vec<[u32; 2]>> = HashMap::new();
    for w in wedges(&mesh) {
        known.entry(place(&mesh, w).map(f64::to_bits)).or_default().push(uvs[w.index()].map(f32::to_bits));
    }
    let got = done(&mesh, &by(MethodKind::Melax, Stop::ratio(0.1)));
    assert!(got.mesh.face_count() < mesh.face_count() / 2);
    for w in wedges(&got.mesh) {
        let at_place = &known[&place(&got.mesh, w).map(f64::to_bits)];
        assert!(at_place.contains(&got.mesh.uvs().unwrap()[w.index()].map(f32::to_bits)), "{w}");
    }
}

#[test]
fn melax_keeps_the_outline_of_a_sheet() {
    // Only the border is curved, at its four corners.
    let mesh = shapes::grid(16);
    let got = done(&mesh, &by(MethodKind::Melax, Stop::faces(2)));
    assert_eq!(got.mesh.face_count(), 2);
    let area = |m: &TriMesh| size_of(&m.surface()).area;
    assert!((area(&got.mesh) / area(&mesh) - 1.0).abs() < 1e-6);
}

#[test]
fn melax_levels_of_one_model_are_repeatable() {
    let mesh = shapes::blob(5, 1);
    for faces in [4000, 2000, 1000, 500, 250, 100, 40, 10] {
        let got = done(&mesh, &by(MethodKind::Melax, Stop::faces(faces)));
        assert!(got.report.reached && got.mesh.face_count() + 2 > faces, "{faces}");
        assert!(subset_is_kept(&mesh, &got));
    }
}

// shortest-edge

#[test]
fn shortest_edge_leaves_no_edge_below_its_length() {
    let mesh = shapes::blob(5, 1);
    let length = 3.0 * shortest_edge(&mesh);
    let got = done(&mesh, &shorter_than(length));
    assert_eq!(got.report.stopped_by, StoppedBy::Exhausted);
    assert!(got.report.reached && got.report.collapses > 0);
    // (The unit frame has single precision.)
    assert!(shortest_edge(&got.mesh) > 0.9999 * length);
    // Vertices and faces are removed together: a closed surface of one part keeps V − F / 2 = 2.
    assert_eq!(got.report.vertices, got.report.faces / 2 + 2);
    // With a limit below the shortest edge nothing is done, and the stop counts as met.
    let nothing = done(&mesh, &shorter_than(0.9 * shortest_edge(&mesh)));
    assert_eq!((nothing.report.collapses, nothing.report.reached), (0, true));
    assert_eq!(nothing.report.stopped_by, StoppedBy::Exhausted);
}

#[test]
fn shortest_edge_reports_short_edges_that_may_not_be_removed() {
    let mesh = shapes::icosphere(3);
    let mut options = shorter_than(2.0 * shortest_edge(&mesh));
    options.guards.max_edge = Some(Length::Units(1.1 * shortest_edge(&mesh)));
    let report = done(&mesh, &options).report;
    assert_eq!((report.stopped_by, report.reached), (StoppedBy::Refusals, false));
    assert!(report.refusals.iter().any(|r| r.0 == Refusal::EdgeLength));
    assert!(!report.proposals.is_empty());
}

#[test]
fn shortest_edge_stops_at_the_first_of_length_and_count() {
    let mesh = shapes::blob(5, 1);
    let mut options = shorter_than(3.0 * shortest_edge(&mesh));
    let by_length = done(&mesh, &options).report.faces;
    options.stop = Stop::faces(by_length + 100);
    assert_eq!(done(&mesh, &options).report.stopped_by, StoppedBy::Faces);
    options.stop = Stop::faces(by_length / 2);
    let report = done(&mesh, &options).report;
    // The target was not met, as `reached` shows.
    assert_eq!((report.stopped_by, report.reached, report.faces), (StoppedBy::Exhausted, false, by_length));
}

/// Fault A15: collapses after the last check of all edges made collapses possible that had been refused
/// before.
#[test]
fn shortest_edge_checks_again_before_it_ends() {
    let mut exhausted = 0;
    for mesh in
        [shapes::blob(3, 1), shapes::torus(24, 12), shapes::cylinder(40, 8), shapes::noisy_sphere(3, 0.2, 5)]
    {
        let shortest = shortest_edge(&mesh);
        for times in [1.5, 3.0, 5.0, 8.0, 12.0, 20.0] {
            let got = done(&mesh, &shorter_than(times * shortest));
            if got.report.stopped_by == StoppedBy::Exhausted {
                exhausted += 1;
                let left = shortest_edge(&got.mesh) / (times * shortest);
                assert!(left > 0.9999, "{times}: an edge of {left} of the length is left");
            }
        }
    }
    assert!(exhausted > 5, "{exhausted}");
}

#[test]
fn shortest_edge_places_vertices_at_the_midpoint_or_an_end() {
    let mesh = shapes::icosphere(3);
    let middles = done(&mesh, &by(MethodKind::ShortestEdge, Stop::ratio(0.5)));
    assert!(!subset_is_kept(&mesh, &middles));
    let mut options = by(MethodKind::ShortestEdge, Stop::ratio(0.5));
    options.placement = Placement::Endpoint;
    assert!(subset_is_kept(&mesh, &done(&mesh, &options)));
}

#[test]
fn shortest_edge_keeps_borders() {
    // Inner vertices collapse onto the border, not the reverse: the outline of a square is kept.
    let mesh = shapes::grid(16);
    let mut options = by(MethodKind::ShortestEdge, Stop::ratio(0.3));
    options.border = BorderPolicy::Lock;
    let got = done(&mesh, &options);
    let area = |m: &TriMesh| size_of(&m.surface()).area;
    assert!((area(&got.mesh) / area(&mesh) - 1.0).abs() < 1e-6);
}
