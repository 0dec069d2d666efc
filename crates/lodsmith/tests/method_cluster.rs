//! Vertex clustering: known results, and guarantees for every mesh.

use std::collections::HashSet;

use lodsmith::core::arbitrary::{Coordinates, perturbed_shape, soup};
use lodsmith::core::{Positions, RegionId, Topology, TriMesh, VertexId, shapes};
use lodsmith::{
    BorderPolicy, Control, Fit, Guards, Input, Length, Measure, Method, MethodKind, NoControl, Placement,
    SimplifyError, SimplifyOptions, Stop, StoppedBy, TopologyPolicy, Verdict, simplify, simplify_with,
};
use proptest::prelude::*;

use crate::support::{Complaints, bits, bytes, places, run, size};

fn options(stop: Stop) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(stop);
    options.method = MethodKind::Cluster.into();
    options
}

fn by_cell(cell: Length) -> SimplifyOptions {
    let mut options = options(Stop::default());
    options.method = Method::Cluster { cell: Some(cell), two_stage: false };
    options
}

/// A sheet of `n` × `n` squares with edges of length 1, in the plane z = 0.
fn sheet(n: u32) -> TriMesh {
    let at = |i: u32, j: u32| VertexId(i * (n + 1) + j);
    let points = (0..=n).flat_map(|i| (0..=n).map(move |j| [i as f32, j as f32, 0.0])).collect();
    let square =
        |i, j| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
    let faces = (0..n).flat_map(|i| (0..n).flat_map(move |j| square(i, j))).collect();
    TriMesh::new(Positions::F32(points), faces).unwrap()
}

#[test]
fn counts_are_met_closely_from_below() {
    let sphere = shapes::icosphere(6);
    for wanted in [20_000, 8000, 2000, 500] {
        let done = simplify(&sphere, &options(Stop::faces(wanted))).unwrap();
        let faces = done.mesh.face_count();
        // The octants of the sphere change together, so the count has few steps.
        let near = if wanted > 500 { 0.93 } else { 0.85 };
        assert!(faces <= wanted && faces as f64 > near * wanted as f64, "{faces} of {wanted}");
        assert_eq!((done.report.stopped_by, done.report.reached), (StoppedBy::Faces, true));
        let done = simplify(&sphere, &options(Stop::vertices(wanted / 2))).unwrap();
        let vertices = done.mesh.vertex_count();
        assert!(
            vertices <= wanted / 2 && vertices as f64 > 0.45 * wanted as f64,
            "{vertices} of {}",
            wanted / 2
        );
    }
}

#[test]
fn sharp_corners_stay_sharp() {
    // The mean of the vertices in a cell would lie inside the cube by a third of a cell and more.
    let (_, cube) = shapes::all().into_iter().find(|x| x.0 == "fine_cube").unwrap();
    let done = simplify(&cube, &options(Stop::ratio(0.2))).unwrap();
    let bounds = cube.positions().view().bounds().unwrap();
    let near = 0.02 * (bounds.max[0] - bounds.min[0]);
    for corner in 0..8 {
        let at = [0, 1, 2].map(|k| if corner >> k & 1 == 0 { bounds.min[k] } else { bounds.max[k] });
        let is_near = |p: [f64; 3]| (0..3).all(|k| (p[k] - at[k]).abs() < near);
        assert!(done.mesh.positions().view().iter().any(is_near), "{at:?}");
    }
}

#[test]
fn a_flat_sheet_stays_flat_and_keeps_its_outline() {
    let mesh = sheet(40);
    let done = simplify(&mesh, &by_cell(Length::Units(4.0))).unwrap();
    let view = done.mesh.positions().view();
    assert!(view.iter().all(|p| p[2].abs() < 1e-5));
    let side = |k: usize| view.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max);
    // Without border quadrics the border would recede by nearly half a cell.
    assert!(side(0) > 39.8 && side(1) > 39.8, "{} {}", side(0), side(1));
    let mut free = by_cell(Length::Units(4.0));
    free.border = BorderPolicy::Free;
    let free = simplify(&mesh, &free).unwrap();
    let inside = free.mesh.positions().view().iter().map(|p| p[0]).fold(f64::NEG_INFINITY, f64::max);
    assert!(inside < 39.5, "{inside}");
    assert_eq!(Topology::new(&done.mesh.surface()).counts().border_loop_count, 1);
}

#[test]
fn a_soup_gives_the_same_result() {
    // Then every vertex is on a border, and the border terms still cancel.
    let mesh = sheet(40);
    let view = mesh.positions().view();
    let corners =
        mesh.surface().triangles().as_flattened().iter().map(|v| view.get(*v).map(|x| x as f32)).collect();
    let faces = (0..mesh.face_count() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2].map(VertexId)).collect();
    let apart = TriMesh::new(Positions::F32(corners), faces).unwrap();
    let [whole, apart] =
        [&mesh, &apart].map(|mesh| simplify(mesh, &by_cell(Length::Units(4.0))).unwrap().mesh);
    assert_eq!(whole.triangles(), apart.triangles());
    for (p, q) in whole.positions().view().iter().zip(apart.positions().view().iter()) {
        assert!((0..3).all(|k| (p[k] - q[k]).abs() < 1e-3), "{p:?} {q:?}");
    }
}

#[test]
fn no_vertex_is_farther_off_than_a_cell_diagonal() {
    for (name, mesh) in shapes::all() {
        for share in [0.02, 0.1, 0.3] {
            let Ok(done) = simplify(&mesh, &by_cell(Length::OfDiagonal(share))) else {
                continue;
            };
            let cell = done.report.clustered.unwrap().cell;
            let diagonal = cell * 3f64.sqrt() * (1.0 + 1e-5);
            let input: Vec<_> = mesh.positions().view().iter().collect();
            for p in done.mesh.positions().view().iter() {
                let d = |q: &[f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
                assert!(input.iter().map(d).fold(f64::INFINITY, f64::min) <= diagonal, "{name} {share}");
            }
        }
    }
}

#[test]
fn a_plate_thinner_than_a_cell_keeps_both_sides() {
    // Two squares back to back, closer together than a cell.
    let one = sheet(8);
    let n = one.vertex_count() as u32;
    let mut points: Vec<[f32; 3]> = one.positions().view().iter().map(|p| p.map(|x| x as f32)).collect();
    points.extend(points.clone().iter().map(|p| [p[0], p[1], -0.01]));
    let top: Vec<[VertexId; 3]> = one.surface().triangles().to_vec();
    let bottom = top.iter().map(|t| [t[0], t[2], t[1]].map(|v| VertexId(v.0 + n)));
    let faces = top.iter().copied().chain(bottom).collect();
    let plate = TriMesh::new(Positions::F32(points), faces).unwrap();
    let done = simplify(&plate, &by_cell(Length::Units(2.0))).unwrap();
    let faces: HashSet<[u32; 3]> = done.mesh.triangles().iter().map(|t| turned(t.map(|w| w.0))).collect();
    assert_eq!(faces.len(), done.mesh.face_count(), "there are no duplicate faces");
    assert!(faces.iter().all(|&[a, b, c]| faces.contains(&turned([a, c, b]))), "each has an opposite face");
}

fn turned(t: [u32; 3]) -> [u32; 3] {
    match t.iter().min() {
        Some(x) if *x == t[1] => [t[1], t[2], t[0]],
        Some(x) if *x == t[2] => [t[2], t[0], t[1]],
        _ => t,
    }
}

#[test]
fn measured_distances_are_within_the_error() {
    for (mesh, share) in [(shapes::icosphere(5), 0.005), (sheet(60), 0.01), (shapes::icosphere(4), 1e-9)] {
        let done = simplify(&mesh, &options(Stop::error(Length::OfDiagonal(share)))).unwrap();
        let error = &done.report.error;
        let got = error.measured.as_ref().unwrap().hausdorff.symmetric;
        assert!(got <= share * error.diagonal * (1.0 + 1e-6) + 1e-12, "{got}");
        assert_eq!((done.report.stopped_by, done.report.reached), (StoppedBy::Error, true));
        assert!(share < 1e-6 || done.mesh.face_count() * 4 < mesh.face_count());
    }
}

#[test]
fn useless_cell_sizes_are_refused() {
    let mesh = shapes::icosphere(3);
    for cell in [10.0, 1e-9] {
        let got = simplify(&mesh, &by_cell(Length::Units(cell)));
        assert!(matches!(got, Err(SimplifyError::BadOption { option: "cell", .. })), "{cell}");
    }
}

#[test]
fn options_that_clustering_does_not_have_are_refused() {
    let mesh = shapes::icosphere(2);
    let refused = |change: &dyn Fn(&mut SimplifyOptions), two_stage: bool| {
        let mut options = options(Stop::ratio(0.5));
        options.method = Method::Cluster { cell: None, two_stage };
        change(&mut options);
        matches!(simplify(&mesh, &options), Err(SimplifyError::NotOfMethod { .. }))
    };
    assert!(refused(&|o| o.topology = TopologyPolicy::Preserve, true));
    let mut two_stage = options(Stop::ratio(0.5));
    two_stage.method = Method::Cluster { cell: None, two_stage: true };
    let importance = vec![1.0; mesh.vertex_count()];
    let got = simplify_with(Input::new(&mesh).importance(&importance), &two_stage, &mut NoControl);
    assert!(matches!(got, Err(SimplifyError::NotOfMethod { .. })));
    let of_steps: [&dyn Fn(&mut SimplifyOptions); 4] = [
        &|o| o.placement = Placement::Endpoint,
        &|o| o.fit = Fit::On,
        &|o| o.border = BorderPolicy::Slide,
        &|o| o.guards = Guards { max_valence: Some(9), ..Guards::default() },
    ];
    for change in of_steps {
        assert!(refused(change, false) && !refused(change, true));
    }
}

#[test]
fn locked_vertices_keep_their_bits() {
    let mesh = shapes::icosphere(4);
    let view = mesh.positions().view();
    let locked: Vec<bool> = view.iter().map(|p| p[2] > 0.8).collect();
    for two_stage in [false, true] {
        let mut options = options(Stop::faces(1200));
        options.method = Method::Cluster { cell: None, two_stage };
        let done = simplify_with(Input::new(&mesh).locked(&locked), &options, &mut NoControl).unwrap();
        let there = places(&done.mesh);
        let held: Vec<_> = view.iter().zip(locked.iter()).filter(|x| *x.1).map(|x| bits(x.0)).collect();
        assert!(held.iter().all(|p| there.contains(p)), "two stages: {two_stage}");
        assert_eq!(done.report.locked_vertices, held.len());
    }
}

#[test]
fn faces_keep_their_region() {
    let mut mesh = sheet(20);
    let regions = mesh.surface().triangles().iter().map(|t| RegionId(u32::from(t[0].0 >= 10 * 21))).collect();
    mesh.set_regions(Some(regions)).unwrap();
    let done = simplify(&mesh, &options(Stop::ratio(0.2))).unwrap();
    let view = done.mesh.positions().view();
    for (t, r) in done.mesh.triangles().iter().zip(done.mesh.regions().unwrap()) {
        let x = t.iter().map(|w| view.get(VertexId(w.0))[0]).sum::<f64>() / 3.0;
        assert!(if r.0 == 0 { x < 13.0 } else { x > 7.0 }, "{r:?} at {x}");
    }
}

#[test]
fn two_stages_are_closer_than_one() {
    let mesh = shapes::icosphere(7);
    let mut one = options(Stop::faces(1000));
    one.measure = Measure::Always;
    let mut two = one.clone();
    two.method = Method::Cluster { cell: None, two_stage: true };
    let [one, two] = [one, two].map(|o| simplify(&mesh, &o).unwrap().report);
    let rms = |r: &lodsmith::Report| r.error.measured.as_ref().unwrap().rms.symmetric;
    assert!(rms(&two) < 0.8 * rms(&one), "{} {}", rms(&two), rms(&one));
    let clustered = two.clustered.unwrap();
    assert!(clustered.faces > 4 * two.faces && clustered.faces < two.input_faces && two.fitted);
    assert_eq!(two.input_faces, mesh.face_count());
}

#[test]
fn a_second_stage_that_is_stuck_starts_from_the_input() {
    // Two sheets closer to each other than a cell: clustering merges them everywhere.
    let one = sheet(70);
    let n = one.vertex_count() as u32;
    let mut points: Vec<[f32; 3]> = one.positions().view().iter().map(|p| p.map(|x| x as f32)).collect();
    let wave = |p: &[f32; 3]| 0.3 * (p[0] * 2.1).sin() * (p[1] * 1.7).sin();
    points.extend(points.clone().iter().map(|p| [p[0], p[1], wave(p)]));
    let upper = one.surface().triangles().iter().map(|t| t.map(|v| VertexId(v.0 + n))).collect::<Vec<_>>();
    let faces = one.surface().triangles().iter().copied().chain(upper).collect();
    let mesh = TriMesh::new(Positions::F32(points), faces).unwrap();
    let mut options = options(Stop::ratio(0.02));
    options.method = Method::Cluster { cell: None, two_stage: true };
    let done = simplify(&mesh, &options).unwrap();
    assert!(done.report.reached, "{:?} at {} faces", done.report.stopped_by, done.report.faces);
}

#[test]
fn threads_do_not_change_the_result() {
    let (closed, open) = (shapes::icosphere(6), sheet(200));
    for (mesh, stop) in
        [(&closed, Stop::faces(9000)), (&closed, Stop::ratio(0.01)), (&open, Stop::faces(9000))]
    {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| simplify(mesh, &options(stop)).unwrap())
        };
        let one = with(1);
        for threads in [2, 3, 7] {
            let more = with(threads);
            assert!(bytes(&more.mesh) == bytes(&one.mesh) && more.report == one.report, "{threads} threads");
        }
    }
}

/// A control that gives an answer from the n-th call on.
struct AnswerAfter(usize, Verdict);

impl Control for AnswerAfter {
    fn progress(&mut self, _: f64) -> Verdict {
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 { self.1 } else { Verdict::Continue }
    }
}

#[test]
fn a_caller_can_end_a_run() {
    let mesh = shapes::icosphere(5);
    for two_stage in [false, true] {
        let mut options = options(Stop::faces(500));
        options.method = Method::Cluster { cell: None, two_stage };
        for asked in [1, 2] {
            let got = simplify_with(&mesh, &options, &mut AnswerAfter(asked, Verdict::Cancel));
            assert_eq!(got.err(), Some(SimplifyError::Cancelled));
        }
        let done = simplify_with(&mesh, &options, &mut AnswerAfter(2, Verdict::Finish)).unwrap();
        assert_eq!((done.report.stopped_by, done.report.reached), (StoppedBy::Caller, false));
        assert!(done.mesh.face_count() > 0 && done.mesh.face_count() < mesh.face_count());
    }
}

/// Checks the guarantees that hold for any result.
fn complaints(mesh: &TriMesh, options: &SimplifyOptions) -> Vec<String> {
    let done = match run(mesh, options) {
        Ok(Ok(done)) => done,
        Ok(Err(SimplifyError::NoFaces { .. } | SimplifyError::BadOption { option: "cell", .. })) => {
            return Vec::new();
        }
        Ok(Err(error)) => return vec![error.to_string()],
        Err(panic) => return vec![panic],
    };
    let mut found = Vec::new();
    let mut check = |holds: bool, otherwise: &str| found.extend((!holds).then(|| otherwise.to_owned()));
    let result = &done.mesh;
    check(result.face_count() <= mesh.face_count() && result.face_count() > 0, "faces");
    let places: Vec<_> = result.positions().view().iter().collect();
    check(places.iter().flatten().all(|x| x.is_finite()), "a position is not finite");
    let mut used = vec![false; places.len()];
    let mut seen = HashSet::new();
    for t in result.triangles() {
        check(seen.insert(turned(t.map(|w| w.0))), "there are duplicate faces");
        check(t[0] != t[1] && t[1] != t[2] && t[2] != t[0], "a face is degenerate");
        t.iter().for_each(|w| used[w.index()] = true);
    }
    check(used.iter().all(|u| *u), "a vertex has no face");
    let stop = &options.stop;
    let met = stop.faces.is_some_and(|n| result.face_count() <= n)
        || stop.vertices.is_some_and(|n| result.vertex_count() <= n)
        || stop
            .ratio
            .is_some_and(|r| result.face_count() as f64 <= (r * mesh.face_count() as f64).round().max(1.0));
    let counts = stop.faces.is_some() || stop.vertices.is_some() || stop.ratio.is_some();
    check(!counts || done.report.reached == met, "the report is wrong about reaching the stop");
    let again = run(mesh, options);
    check(
        matches!(&again, Ok(Ok(a)) if bytes(&a.mesh) == bytes(result) && a.report == done.report),
        "a second run gives another result",
    );
    found
}

#[test]
fn every_shape() {
    let mut all = Complaints::default();
    for (name, mesh) in shapes::all() {
        for two_stage in [false, true] {
            for stop in [
                Stop::ratio(0.5),
                Stop::ratio(0.1),
                Stop::ratio(0.01),
                Stop::faces(1),
                Stop::vertices(7),
                Stop::ratio(1.0),
                Stop::default(),
                Stop { faces: Some(40), vertices: Some(9), ..Stop::default() },
            ] {
                let mut options = options(stop);
                options.method = Method::Cluster { cell: None, two_stage };
                all.add(&format!("{name} {stop:?} {two_stage}"), complaints(&mesh, &options));
            }
        }
    }
    all.report_all();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(size(128, 32)))]
    #[test]
    fn any_mesh(
        mesh in prop_oneof![
            soup(60, Coordinates::Tame),
            soup(40, Coordinates::Wild),
            soup(40, Coordinates::NotFinite),
            perturbed_shape(0.02),
            perturbed_shape(0.5),
        ],
        share in 0.01..1.0f64,
        two_stage: bool,
        cell: bool,
    ) {
        let mut options = options(Stop::ratio(share));
        options.method = Method::Cluster { cell: cell.then_some(Length::OfDiagonal(0.5 * share)), two_stage };
        prop_assert_eq!(complaints(&mesh, &options), Vec::<String>::new());
    }
}
