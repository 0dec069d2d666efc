//! Guarantees of vertex removal.

use std::collections::HashMap;

use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::core::{Positions, RegionId, TriMesh, VertexId, arbitrary, shapes};
use lodsmith::{
    BorderPolicy, Control, Guards, Input, Length, MethodKind, NoControl, Placement, Refusal, Simplified,
    SimplifyError, SimplifyOptions, Stop, StoppedBy, TopologyPolicy, Verdict, simplify, simplify_with,
};
use proptest::prelude::*;

use crate::support::{Complaints, bits, bytes, complaints, options_text, places, run, topology_complaints};

fn options(stop: Stop) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(stop);
    options.method = MethodKind::VertexRemoval.into();
    options
}

fn removed<'a>(input: impl Into<Input<'a>>, options: &SimplifyOptions) -> Simplified {
    let input = input.into();
    let mesh = input.mesh().expect("it is a mesh");
    let done = simplify_with(&input, options, &mut NoControl).expect("shapes can be simplified");
    let mut wrong = complaints(mesh, options, &done);
    wrong.extend(topology_complaints(mesh, options, &done));
    assert!(wrong.is_empty(), "{}: {wrong:?}", options_text(options));
    done
}

fn tried(all: &mut Complaints, name: &str, mesh: &TriMesh, options: &SimplifyOptions) {
    let case = format!("{name}, {}", options_text(options));
    let done = match run(mesh, options) {
        Ok(Ok(done)) => done,
        other => return all.check(&case, false, &format!("{other:?}")),
    };
    all.add(&case, complaints(mesh, options, &done));
    all.add(&case, topology_complaints(mesh, options, &done));
    all.check(&case, places(&done.mesh).is_subset(&places(mesh)), "a vertex that is not in the input");
    let again = matches!(run(mesh, options), Ok(Ok(a)) if bytes(&a.mesh) == bytes(&done.mesh));
    all.check(&case, again, "a second run gives another result");
}

#[test]
fn every_shape_at_every_policy() {
    let mut all = Complaints::default();
    for (name, mesh) in shapes::all() {
        let faces = mesh.face_count();
        for topology in [TopologyPolicy::Relaxed, TopologyPolicy::Preserve, TopologyPolicy::Free] {
            for border in [BorderPolicy::Keep, BorderPolicy::Lock, BorderPolicy::Free] {
                for stop in [
                    Stop::faces(faces / 2),
                    Stop::faces(faces / 10),
                    Stop::faces(1),
                    Stop::vertices(mesh.vertex_count() / 3),
                ] {
                    let mut options = options(stop);
                    (options.topology, options.border) = (topology, border);
                    tried(&mut all, name, &mesh, &options);
                }
            }
        }
    }
    all.report_all();
}

#[test]
fn every_guard() {
    let none = Guards::default();
    let each = [
        Guards { max_normal_deg: Some(15.0), ..none },
        Guards { min_quality: Some(0.3), ..none },
        Guards { max_valence: Some(7), ..none },
        Guards { max_edge: Some(Length::OfDiagonal(0.2)), ..none },
    ];
    let mut all = Complaints::default();
    for (name, mesh) in shapes::all() {
        for guards in each {
            let mut options = options(Stop::faces(4));
            options.guards = guards;
            tried(&mut all, name, &mesh, &options);
        }
    }
    all.report_all();
    let sphere = shapes::icosphere(4);
    let mut with = options(Stop::faces(4));
    with.guards.max_valence = Some(7);
    let done = removed(&sphere, &with);
    let mut edges: HashMap<_, usize> = HashMap::new();
    done.mesh.triangles().iter().flatten().for_each(|w| *edges.entry(*w).or_default() += 1);
    assert!(edges.values().all(|&n| n <= 7));
    let mut with = options(Stop::faces(4));
    with.guards.max_edge = Some(Length::Units(0.5));
    let done = removed(&sphere, &with);
    let surface = done.mesh.surface();
    for t in surface.triangles() {
        let p = t.map(|v| surface.positions().get(v));
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let sq: f64 = (0..3).map(|k| (p[a][k] - p[b][k]).powi(2)).sum();
            assert!(sq.sqrt() <= 0.5 + 1e-9);
        }
    }
}

#[test]
fn flat_faces_become_as_few_as_possible() {
    for (mesh, faces) in [(shapes::cube(6), 12), (shapes::cube(10), 12), (shapes::grid(10), 2)] {
        let done = removed(&mesh, &options(Stop::faces(faces)));
        assert_eq!((done.report.faces, done.report.reached), (faces, true));
        let far = compare(&mesh.surface(), &done.mesh.surface(), &CompareOptions::default()).expect("faces");
        assert!(far.hausdorff.symmetric < 1e-6, "{}", far.hausdorff.symmetric);
    }
}

#[test]
fn a_sphere_can_become_a_tetrahedron() {
    let done = removed(&shapes::icosphere(4), &options(Stop::faces(4)));
    assert_eq!((done.report.faces, done.report.vertices, done.report.stopped_by), (4, 4, StoppedBy::Faces));
    let done = removed(&shapes::icosphere(4), &options(Stop::faces(3)));
    assert_eq!((done.report.faces, done.report.reached), (4, false));
    assert!(done.report.refusals.iter().any(|r| r.0 == Refusal::Component));
}

#[test]
fn a_sphere_is_approximated_as_well_as_its_count_allows() {
    // n triangles inscribed in a unit sphere lie at least about 2.4 / n below it on average. (Gruber 1993)
    let sphere = shapes::icosphere(5);
    for n in [4000, 1000, 250] {
        let done = removed(&sphere, &options(Stop::faces(n)));
        let far =
            compare(&sphere.surface(), &done.mesh.surface(), &CompareOptions::default()).expect("faces");
        let radius = 1.0f64.min(done.report.error.diagonal);
        assert!(far.rms.symmetric < 6.0 * radius / n as f64, "{n}: {}", far.rms.symmetric);
        assert!(done.report.error.estimate < 3.0 * far.rms.symmetric);
        assert!(done.report.error.estimate > far.rms.symmetric / 3.0);
    }
}

#[test]
fn an_error_is_kept() {
    let mut last = usize::MAX;
    for limit in [4e-3, 2e-2] {
        let done = removed(&shapes::icosphere(4), &options(Stop::error(Length::OfDiagonal(limit))));
        assert!(done.report.reached && done.report.faces < last, "{limit}: {} faces", done.report.faces);
        last = done.report.faces;
    }
    for mesh in [shapes::blob(4, 1), shapes::wavy_sheet(16)] {
        let done = removed(&mesh, &options(Stop::error(Length::OfDiagonal(0.02))));
        assert!(done.report.reached && done.report.faces < mesh.face_count());
    }
}

#[test]
fn whole_parts_are_removed_only_if_the_topology_may_change() {
    let many = shapes::tetrahedra(27);
    let mut with = options(Stop::faces(10));
    let done = removed(&many, &with);
    assert_eq!((done.report.faces, done.report.parts_removed), (8, 25));
    with.topology = TopologyPolicy::Preserve;
    let done = removed(&many, &with);
    assert_eq!((done.report.faces, done.report.stopped_by), (many.face_count(), StoppedBy::Refusals));
    with.topology = TopologyPolicy::Relaxed;
    let locked: Vec<bool> = (0..many.vertex_count()).map(|i| i < 4 * 9).collect();
    assert!(removed(Input::new(&many).locked(&locked), &with).report.faces >= 36);
}

#[test]
fn locked_vertices_stay() {
    let mesh = shapes::icosphere(4);
    let is_locked: Vec<bool> = mesh.positions().view().iter().map(|p| p[2] > 0.3).collect();
    let done = removed(Input::new(&mesh).locked(&is_locked), &options(Stop::ratio(0.01)));
    let left = places(&done.mesh);
    let all = mesh.positions().view();
    assert!(
        (0..mesh.vertex_count())
            .filter(|&i| is_locked[i])
            .all(|i| left.contains(&bits(all.get(VertexId::new(i)))))
    );
    assert!(done.report.refusals.iter().any(|r| r.0 == Refusal::Locked));
}

#[test]
fn important_places_keep_more_vertices() {
    let mesh = shapes::icosphere(5);
    let above = |m: &TriMesh| m.positions().view().iter().filter(|p| p[2] > 0.0).count() as f64;
    let factor = |p: [f64; 3]| if p[2] > 0.0 { 4.0 } else { 1.0 };
    let importance: Vec<f32> = mesh.positions().view().iter().map(factor).collect();
    let done = removed(Input::new(&mesh).importance(&importance), &options(Stop::ratio(0.1)));
    let share = above(&done.mesh) / (done.mesh.vertex_count() as f64 - above(&done.mesh));
    assert!((2.0..8.0).contains(&share), "{share}");
}

#[test]
fn straight_borders_of_regions_stay() {
    let mut mesh = shapes::grid(12);
    let surface = mesh.surface();
    let centre =
        |t: &[VertexId; 3], k: usize| t.iter().map(|&v| surface.positions().get(v)[k]).sum::<f64>() / 3.0;
    let span = surface.positions().bounds().expect("points");
    let middle = [0, 1].map(|k| 0.5 * (span.min[k] + span.max[k]));
    let quarter = |t| RegionId(u32::from(centre(t, 0) > middle[0]) + 2 * u32::from(centre(t, 1) > middle[1]));
    let regions = surface.triangles().iter().map(quarter).collect();
    mesh.set_regions(Some(regions)).expect("one for each face");
    // At least two triangles in each quarter, as long as the corners of the sheet are kept.
    for faces in [60, 20, 8] {
        let done = removed(&mesh, &options(Stop::faces(faces)));
        assert!(done.report.reached);
        let surface = done.mesh.surface();
        for t in surface.triangles() {
            for (k, middle) in middle.into_iter().enumerate() {
                let sides = t.map(|v| surface.positions().get(v)[k] - middle);
                let is_across = sides.iter().any(|x| *x > 1e-6) && sides.iter().any(|x| *x < -1e-6);
                assert!(!is_across, "a face of two regions at {faces}: {sides:?}");
            }
        }
    }
}

#[test]
fn a_fan_of_many_faces_takes_bounded_time() {
    // A double cone of 20,000 sides: each apex is adjacent to the whole rim.
    let count = 20_000u32;
    let mut points = vec![[0.0, 0.0, 0.3], [0.0, 0.0, -0.3]];
    points.extend((0..count).map(|i| {
        let angle = std::f64::consts::TAU * f64::from(i) / f64::from(count);
        [angle.cos(), angle.sin(), 0.0]
    }));
    let rim = |i: u32| VertexId(2 + i % count);
    let sides =
        (0..count).flat_map(|i| [[VertexId(0), rim(i), rim(i + 1)], [VertexId(1), rim(i + 1), rim(i)]]);
    let mesh = TriMesh::new(Positions::F64(points), sides.collect()).expect("a double cone");
    let done = removed(&mesh, &options(Stop::faces(100)));
    assert!(done.report.reached);
}

#[test]
fn a_caller_can_end_a_run() {
    struct AnswerAfter(usize, Verdict);
    impl Control for AnswerAfter {
        fn progress(&mut self, _: f64) -> Verdict {
            self.0 = self.0.saturating_sub(1);
            if self.0 == 0 { self.1 } else { Verdict::Continue }
        }
    }
    let mesh = shapes::icosphere(5);
    let with = options(Stop::faces(4));
    for looks in 1..40 {
        let cancelled = simplify_with(&mesh, &with, &mut AnswerAfter(looks, Verdict::Cancel));
        assert_eq!(cancelled.unwrap_err(), SimplifyError::Cancelled, "{looks}");
    }
    let done = simplify_with(&mesh, &with, &mut AnswerAfter(70, Verdict::Finish)).expect("the result so far");
    assert_eq!(done.report.stopped_by, StoppedBy::Caller);
    assert!(done.report.faces < mesh.face_count());
}

#[test]
fn options_that_the_method_does_not_have_are_refused() {
    let mut with = options(Stop::faces(4));
    with.placement = Placement::Midpoint;
    let error = simplify(&shapes::icosphere(2), &with).unwrap_err();
    assert!(matches!(error, SimplifyError::NotOfMethod { option: "placement midpoint", .. }));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn soups_give_a_sound_mesh(mesh in arbitrary::soup(60, arbitrary::Coordinates::NotFinite), faces in 0..20usize) {
        let options = options(Stop::faces(faces));
        let Ok(done) = run(&mesh, &options).expect("no panic") else { return Ok(()) };
        let wrong = complaints(&mesh, &options, &done);
        prop_assert!(wrong.is_empty(), "{wrong:?}");
    }
    #[test]
    fn perturbed_shapes_keep_their_topology(mesh in arbitrary::perturbed_shape(0.05), ratio in 0.01..0.9f64) {
        let options = options(Stop::ratio(ratio));
        let Ok(done) = run(&mesh, &options).expect("no panic") else { return Ok(()) };
        let mut wrong = complaints(&mesh, &options, &done);
        wrong.extend(topology_complaints(&mesh, &options, &done));
        prop_assert!(wrong.is_empty(), "{wrong:?}");
        prop_assert!(places(&done.mesh).is_subset(&places(&mesh)));
    }
}
