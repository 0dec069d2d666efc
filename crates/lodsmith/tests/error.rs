//! Guarantees of a stop at an error: results are within it, proven; a clearly larger error gives no more faces; a plain
//! run within it is heavier.

use lodsmith::core::measure::Prepared;
use lodsmith::core::measure::proof::{WithinResult, prove_within};
use lodsmith::core::spatial::Bvh;
use lodsmith::core::{TriMesh, VertexId, shapes};
use lodsmith::{
    Bound, Control, Input, Length, MethodKind, NoControl, Refusal, Report, Simplified, SimplifyOptions, Stop,
    StoppedBy, TopologyPolicy, Verdict, simplify, simplify_with,
};

use crate::support::{CaseFilter, size};

fn run(mesh: &TriMesh, options: &SimplifyOptions) -> Simplified {
    simplify(mesh, options).unwrap()
}

fn within(share: f64) -> SimplifyOptions {
    SimplifyOptions::new(Stop::error(Length::OfDiagonal(share)))
}

fn largest_seen(report: &Report) -> f64 {
    report.error.measured.as_ref().unwrap().hausdorff.symmetric
}

fn is_kept(from: &TriMesh, to: &TriMesh, distance: f64) -> bool {
    let [from, to] = [from, to].map(|mesh| Prepared::new(&mesh.surface()).unwrap());
    matches!(prove_within(&from, &to, distance), WithinResult::Yes(_))
}

/// Fault A11: a mesh of 9,000 faces was returned unchanged, although 8,600 faces are within the limit.
#[test]
fn a_few_faces_are_removed_if_the_error_allows_no_more() {
    let mesh = shapes::blob(3, 2);
    let mut options = SimplifyOptions::new(Stop::ratio(0.94));
    options.bound = Bound::TwoSided;
    let lighter = run(&mesh, &options).report;
    let limit = 1.2 * lighter.error.bound.unwrap();
    let got = run(&mesh, &SimplifyOptions::new(Stop::error(Length::Units(limit)))).report;
    assert!(got.faces < mesh.face_count() * 97 / 100, "{} of {}", got.faces, mesh.face_count());
    assert!(got.reached && got.error.bound.unwrap() <= limit * (1.0 + 1e-9));
}

/// Fault A11: .08 % gave more faces than .07 %.
#[test]
fn more_error_never_means_more_faces() {
    for (mesh, bound) in [(shapes::blob(3, 7), Bound::Auto), (shapes::wavy_sheet(24), Bound::OneSided)] {
        let mut before = usize::MAX;
        for k in (0..4).step_by(size(1, 3)) {
            let mut options = within(0.002 * 2f64.powi(k));
            options.bound = bound;
            let done = run(&mesh, &options);
            let (faces, error) = (done.report.faces, &done.report.error);
            assert!(faces <= before, "{faces} faces, not {before}");
            let limit = 0.002 * 2f64.powi(k) * error.diagonal;
            assert!(error.bound.unwrap() <= limit * (1.0 + 1e-9));
            assert!(is_kept(&done.mesh, &mesh, limit * (1.0 + 1e-9)));
            assert!(bound == Bound::OneSided || is_kept(&mesh, &done.mesh, limit * (1.0 + 1e-9)));
            before = faces;
        }
        assert!(before < mesh.face_count() / 5);
    }
}

#[test]
fn a_one_sided_bound_needs_no_more_faces() {
    for (mesh, share) in [(shapes::blob(3, 3), 0.005), (shapes::wavy_sheet(24), 0.005)] {
        let two = run(&mesh, &within(share)).report;
        let mut options = within(share);
        options.bound = Bound::OneSided;
        let one = run(&mesh, &options).report;
        assert!(one.faces <= two.faces, "{} {}", one.faces, two.faces);
        options.bound = Bound::Estimate;
        let seen = run(&mesh, &options).report;
        assert!(seen.error.bound.is_none() && largest_seen(&seen) <= share * seen.error.diagonal);
        assert!(seen.faces <= two.faces && seen.reached);
    }
}

#[test]
fn any_target_can_have_a_bound_close_to_the_measured_distance() {
    let mesh = shapes::blob(3, 5);
    for method in [MethodKind::Memoryless, MethodKind::Cluster] {
        let mut options = SimplifyOptions::new(Stop::ratio(0.1));
        options.method = method.into();
        assert_eq!(run(&mesh, &options).report.error.bound, None);
        options.bound = Bound::TwoSided;
        let done = run(&mesh, &options);
        let bound = done.report.error.bound.unwrap();
        let seen = largest_seen(&done.report);
        assert!(bound >= seen && bound <= 1.03 * seen, "{bound} {seen}");
        assert!(is_kept(&mesh, &done.mesh, bound * 1.000001) && is_kept(&done.mesh, &mesh, bound * 1.000001));
    }
}

#[test]
fn each_method_keeps_its_bound() {
    let mesh = shapes::blob(3, 4);
    for method in [MethodKind::Memoryless, MethodKind::Cluster, MethodKind::Planar, MethodKind::Remesh] {
        let mut options = within(0.01);
        options.method = method.into();
        let done = run(&mesh, &options);
        let error = &done.report.error;
        let limit = 0.01 * error.diagonal * (1.0 + 1e-9);
        assert!(done.report.reached && error.bound.unwrap() <= limit, "{}", method.name());
        assert!(is_kept(&mesh, &done.mesh, limit) && is_kept(&done.mesh, &mesh, limit), "{}", method.name());
    }
}

/// A run to a count spends its error where it is cheapest, but its largest distance grows first at one place. A run
/// within an error goes on everywhere else.
#[test]
fn the_result_is_lighter_than_any_plain_run_within_the_error() {
    let mut cases = CaseFilter::every(3);
    for (mesh, share) in [
        (shapes::blob(5, 3), 0.005),
        (shapes::blob(4, 9), 0.02),
        (shapes::wavy_sheet(60), 0.01),
        (shapes::level(8, 30), 0.01),
    ] {
        for method in [MethodKind::Memoryless, MethodKind::Quadric] {
            if !cases.takes() {
                continue;
            }
            let mut options = within(share);
            options.method = method.into();
            let done = run(&mesh, &options);
            let (faces, limit) = (done.report.faces, share * done.report.error.diagonal);
            assert!(faces < mesh.face_count() / 2, "{faces} of {}", mesh.face_count());
            for more in [105, 115] {
                let mut plain = SimplifyOptions::new(Stop::faces(faces * more / 100));
                plain.method = method.into();
                plain.bound = Bound::TwoSided;
                let seen = largest_seen(&run(&mesh, &plain).report);
                assert!(seen > limit, "{method:?} at {share}: {more} % of {faces} faces are within {seen}");
            }
        }
    }
}

/// Returns a blob and a part of it, moved out a little, that hides nothing.
fn with_shell(by: f64) -> TriMesh {
    let outer = shapes::blob(4, 3);
    let (mut positions, mut indices) = outer.to_indexed();
    let count = positions.len() as u32;
    let moved: Vec<[f32; 3]> = positions.iter().map(|p| p.map(|x| x * (1.0 + by as f32))).collect();
    // The faces on one side only, so that the shell has a border.
    let near: Vec<u32> = indices
        .chunks_exact(3)
        .filter(|t| t.iter().all(|&v| positions[v as usize][0] > 0.3))
        .flatten()
        .map(|v| v + count)
        .collect();
    assert!(!near.is_empty());
    positions.extend(moved);
    indices.extend(near);
    TriMesh::from_indexed(&positions, &indices).unwrap()
}

#[test]
fn a_part_within_the_error_of_the_rest_is_removed() {
    let mesh = with_shell(0.002);
    let mut options = within(0.01);
    let done = run(&mesh, &options);
    assert_eq!(done.report.parts_removed, 1);
    assert!(done.report.reached && done.report.error.bound.unwrap() <= 0.01 * done.report.error.diagonal);
    options.topology = TopologyPolicy::Preserve;
    assert_eq!(run(&mesh, &options).report.parts_removed, 0);
    // Too far away.
    assert_eq!(run(&with_shell(0.1), &within(0.01)).report.parts_removed, 0);
}

fn refused(report: &Report, why: Refusal) -> u64 {
    report.refusals.iter().filter(|r| r.0 == why).map(|r| r.1).sum()
}

#[test]
fn the_report_says_where_the_result_is_farthest_and_what_the_error_refused() {
    for (mesh, share) in
        [(shapes::blob(4, 3), 0.005), (shapes::wavy_sheet(40), 0.004), (shapes::level(6, 30), 0.01)]
    {
        let done = run(&mesh, &within(share));
        let report = &done.report;
        assert_eq!((report.stopped_by, report.reached), (StoppedBy::Error, true));
        assert!(refused(report, Refusal::ErrorLimit) > 0, "{:?}", report.refusals);
        let (farthest, largest) = (report.error.measured.unwrap().farthest.unwrap(), largest_seen(report));
        let (from, to) = if farthest.is_forward { (&mesh, &done.mesh) } else { (&done.mesh, &mesh) };
        let distance = |to: &TriMesh| Bvh::new(&to.surface()).closest(farthest.point).unwrap().distance;
        assert!((distance(to) - largest).abs() < 1e-9 * report.error.diagonal);
        assert!(distance(from) < 1e-9 * report.error.diagonal);
        assert!(largest <= report.error.bound.unwrap());
        assert_eq!(report.error.farthest_part, None);
    }
    // A run without a limit is neither measured nor refused anything by it.
    let plain = run(&shapes::blob(4, 3), &SimplifyOptions::new(Stop::ratio(0.1))).report;
    assert_eq!((refused(&plain, Refusal::ErrorLimit), plain.error.measured), (0, None));
}

/// The error did not end a run in which it refused nothing.
#[test]
fn a_run_that_the_error_does_not_end_says_what_did() {
    let mut options = within(10.0);
    options.topology = TopologyPolicy::Preserve;
    options.guards.max_normal_deg = Some(20.0);
    let report = run(&shapes::blob(4, 3), &options).report;
    assert_eq!(refused(&report, Refusal::ErrorLimit), 0);
    assert!(refused(&report, Refusal::NormalFlip) > 0, "{:?}", report.refusals);
    assert_eq!((report.stopped_by, report.reached), (StoppedBy::Refusals, true));
    // Nor does it reach a count that these refusals keep it from.
    options.stop.faces = Some(4);
    let report = run(&shapes::blob(4, 3), &options).report;
    assert_eq!((report.stopped_by, report.reached), (StoppedBy::Refusals, false));
}

#[test]
fn locked_vertices_stay_within_an_error() {
    let mesh = shapes::blob(4, 6);
    let locked: Vec<bool> = (0..mesh.vertex_count()).map(|v| v % 11 == 0).collect();
    let input = Input::new(&mesh).locked(&locked);
    let done = simplify_with(&input, &within(0.01), &mut NoControl).unwrap();
    assert!(done.report.reached && done.report.faces < mesh.face_count() / 2);
    let kept: std::collections::HashSet<[u64; 3]> =
        (0..done.mesh.vertex_count()).map(|v| bits(&done.mesh, v)).collect();
    for v in (0..mesh.vertex_count()).filter(|&v| locked[v]) {
        assert!(kept.contains(&bits(&mesh, v)), "vertex {v} moved");
    }
}

fn bits(mesh: &TriMesh, v: usize) -> [u64; 3] {
    mesh.positions().view().get(VertexId::new(v)).map(f64::to_bits)
}

/// Asks a run to finish from the nth time on that it is asked.
struct FinishAt(usize);

impl Control for FinishAt {
    fn progress(&mut self, _: f64) -> Verdict {
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 { Verdict::Finish } else { Verdict::Continue }
    }
}

/// Two spheres of different faces at the same place: samples of either are near faces of the other, so that proofs of
/// the whole fail.
fn two_spheres() -> TriMesh {
    let (mut positions, mut indices) = shapes::noisy_sphere(4, 0.0, 1).to_indexed();
    let count = positions.len() as u32;
    let (others, faces) = shapes::icosphere(1).to_indexed();
    positions.extend(others);
    indices.extend(faces.iter().map(|v| v + count));
    TriMesh::from_indexed(&positions, &indices).unwrap()
}

/// If the last state is not proven, the one before counts: an assembly of open parts came back unchanged after two
/// seconds, and with 60 % of its faces after one.
#[test]
fn a_run_that_is_ended_later_does_not_return_the_input() {
    let mesh = two_spheres();
    let (mut lightest, mut are_all_made) = (mesh.face_count(), false);
    for n in (61..260).step_by(9).chain([usize::MAX]) {
        let done = simplify_with(Input::new(&mesh), &within(0.01), &mut FinishAt(n)).unwrap();
        let (report, faces) = (&done.report, done.report.faces);
        assert!(report.error.bound.unwrap() <= 0.01 * report.error.diagonal * (1.0 + 1e-9));
        assert!(faces < mesh.face_count() || lightest == faces, "{n}: {faces} after {lightest}");
        lightest = lightest.min(faces);
        are_all_made |= report.reached;
    }
    assert!(are_all_made && lightest < mesh.face_count() / 10, "{lightest}");
}
