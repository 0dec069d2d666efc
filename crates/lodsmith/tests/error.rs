//! Guarantees of a stop at an error: results are within it, proven; a clearly larger error gives no more faces; a plain
//! run within it is heavier.

use lodsmith::core::geometry::triangle::weights_at;
use lodsmith::core::measure::proof::{WithinResult, prove_within};
use lodsmith::core::measure::{CompareOptions, Prepared, compare};
use lodsmith::core::spatial::Bvh;
use lodsmith::core::{TriMesh, VertexId, shapes};
use lodsmith::{
    Bound, Control, Input, Length, MethodKind, NoControl, Refusal, Report, Simplified, SimplifyError,
    SimplifyOptions, Stage, Stop, StoppedBy, TopologyPolicy, Verdict, simplify, simplify_with,
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
struct FinishAt {
    left: usize,
    /// Number of questions in the stage of measuring and proving that are answered with a yes nevertheless.
    patience: usize,
    stage: Stage,
}

impl FinishAt {
    fn new(left: usize, patience: usize) -> Self {
        Self { left, patience, stage: Stage::Prepare }
    }
}

impl Control for FinishAt {
    fn stage(&mut self, stage: Stage) {
        self.stage = stage;
    }
    fn progress(&mut self, _: f64) -> Verdict {
        if self.left > 0 {
            self.left -= 1;
            return Verdict::Continue;
        }
        if self.stage == Stage::Measure && self.patience > 0 {
            self.patience -= 1;
            return Verdict::Continue;
        }
        Verdict::Finish
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
        let control = &mut FinishAt::new(n, usize::MAX);
        let done = simplify_with(Input::new(&mesh), &within(0.01), control).unwrap();
        let (report, faces) = (&done.report, done.report.faces);
        assert!(
            !report.error.is_incomplete
                && report.error.bound.unwrap() <= 0.01 * report.error.diagonal * (1.0 + 1e-9)
        );
        assert!(faces < mesh.face_count() || lightest == faces, "{n}: {faces} after {lightest}");
        lightest = lightest.min(faces);
        are_all_made |= report.reached;
    }
    assert!(are_all_made && lightest < mesh.face_count() / 10, "{lightest}");
}

/// A run whose time was over went on until its result was proven and measured.
#[test]
fn a_bound_that_there_was_no_time_to_prove_is_not_claimed() {
    let mesh = shapes::blob(3, 2);
    let options = within(0.01);
    let whole = simplify_with(&mesh, &options, &mut NoControl).unwrap();
    let (mut are_proven, mut are_unproven) = (0, 0);
    for n in 0..40 {
        let patience = n % 5;
        let control = &mut FinishAt::new(n, patience);
        let Simplified { mesh: made, report } = simplify_with(&mesh, &options, control).unwrap();
        let is_cut_short = control.left == 0 && report.stopped_by == StoppedBy::Caller;
        assert!(is_cut_short || made == whole.mesh, "{n}");
        let error = &report.error;
        let limit = 0.01 * error.diagonal * (1.0 + 1e-9);
        match error.bound {
            Some(bound) => {
                assert!(bound <= limit, "{n}: {bound}");
                are_proven += 1;
            }
            None => {
                assert!(error.is_incomplete && error.measured.is_none() && !report.reached, "{n}");
                // What is returned was tested at samples.
                let found = compare(&mesh.surface(), &made.surface(), &CompareOptions::default()).unwrap();
                assert!(found.hausdorff.symmetric <= 1.1 * limit, "{n}: {}", found.hausdorff.symmetric);
                are_unproven += 1;
            }
        }
    }
    assert!(are_proven > 0 && are_unproven > 0, "{are_proven} {are_unproven}");
}

/// Shares of an error that rise along x from `least` to 1.
fn rising(mesh: &TriMesh, least: f64) -> Vec<f32> {
    let view = mesh.positions().view();
    let bounds = view.bounds().unwrap();
    let along = |p: [f64; 3]| (p[0] - bounds.min[0]) / (bounds.max[0] - bounds.min[0]);
    view.iter().map(|p| (least + (1.0 - least) * along(p)) as f32).collect()
}

/// A grid of barycentric coordinates.
const GRID: usize = 6;

/// Returns points of each face, with its index and their barycentric coordinates.
fn samples(mesh: &TriMesh) -> impl Iterator<Item = ([f64; 3], usize, [f64; 3])> + '_ {
    let grid = || (0..=GRID).flat_map(|i| (0..=GRID - i).map(move |j| [i, j, GRID - i - j]));
    (0..mesh.face_count()).flat_map(move |face| {
        grid().map(move |shares| {
            let shares = shares.map(|n| n as f64 / GRID as f64);
            let corners = corners(mesh, face);
            let at = |k: usize| (0..3).map(|i| corners[i][k] * shares[i]).sum();
            ([at(0), at(1), at(2)], face, shares)
        })
    })
}

fn corners(mesh: &TriMesh, face: usize) -> [[f64; 3]; 3] {
    mesh.triangles()[face].map(|w| mesh.positions().view().get(mesh.vertex_of(w)))
}

/// Returns the value at a point of a face.
fn value_at(mesh: &TriMesh, shares: &[f32], face: usize, p: [f64; 3]) -> f64 {
    let weights = weights_at(p.into(), corners(mesh, face).map(Into::into));
    let of = mesh.triangles()[face].map(|w| f64::from(shares[mesh.vertex_of(w).index()]));
    (0..3).map(|k| of[k] * weights[k]).sum()
}

/// Fails unless samples of both meshes are within the limit at their place of the input; returns the largest part of the
/// limit that is used.
fn check_map(input: &TriMesh, made: &TriMesh, shares: &[f32], limit: f64, is_two_sided: bool) -> f64 {
    let [to_input, to_made] = [input, made].map(|mesh| Bvh::new(&mesh.surface()));
    let size = to_input.bounds().unwrap().diagonal();
    let mut most = 0f64;
    let mut check = |distance: f64, value: f64, place: &str| {
        assert!(distance <= limit * value + 2e-6 * size, "{place}: {distance} at {value} of {limit}");
        most = most.max(if value > 0.05 { distance / (limit * value) } else { 0.0 });
    };
    for (p, face, _) in samples(input).filter(|_| is_two_sided) {
        check(to_made.closest(p).unwrap().distance, value_at(input, shares, face, p), "input");
    }
    for (p, _, _) in samples(made) {
        let hit = to_input.closest(p).unwrap();
        check(hit.distance, value_at(input, shares, hit.face.index(), hit.point), "result");
    }
    most
}

#[test]
fn an_error_map_is_kept_at_every_place() {
    for (mesh, share, bound) in [
        (shapes::blob(4, 3), 0.02, Bound::Auto),
        (shapes::wavy_sheet(40), 0.02, Bound::Auto),
        (shapes::blob(4, 5), 0.01, Bound::OneSided),
    ] {
        let shares = rising(&mesh, 0.1);
        let mut options = within(share);
        options.bound = bound;
        let done = simplify_with(Input::new(&mesh).error_map(&shares), &options, &mut NoControl).unwrap();
        let limit = share * done.report.error.diagonal;
        let used = check_map(&mesh, &done.mesh, &shares, limit, bound != Bound::OneSided);
        assert!(used > 0.8, "only {used} of the limit is used");
        assert!(done.report.reached && done.report.error.bound.unwrap() <= limit * (1.0 + 1e-9));
        // Between the counts of the largest and of the least limit, and finer where the limit is less.
        let [mut fine, mut coarse] = [0.1 * share, share].map(within);
        (fine.bound, coarse.bound) = (bound, bound);
        let [fine, coarse] = [fine, coarse].map(|options| run(&mesh, &options).report.faces);
        let faces = done.report.faces;
        assert!(coarse < faces && faces < fine, "{coarse} {faces} {fine}");
        let middle = |f: usize| corners(&done.mesh, f).iter().map(|p| p[0]).sum::<f64>() / 3.0;
        let bounds = mesh.positions().view().bounds().unwrap();
        let half = (bounds.min[0] + bounds.max[0]) / 2.0;
        let low = (0..faces).filter(|&f| middle(f) < half).count();
        assert!(low > faces - low, "{low} of {faces}");
    }
}

#[test]
fn an_error_map_of_0_locks() {
    let mesh = shapes::blob(4, 6);
    let of = |p: [f64; 3]| if p[2] < 0.0 { 0.0 } else { (2.0 * p[2]).min(1.0) as f32 };
    let shares: Vec<f32> = mesh.positions().view().iter().map(of).collect();
    let done = simplify_with(Input::new(&mesh).error_map(&shares), &within(0.02), &mut NoControl).unwrap();
    let kept: std::collections::HashSet<[u64; 3]> =
        (0..done.mesh.vertex_count()).map(|v| bits(&done.mesh, v)).collect();
    let zeros = (0..mesh.vertex_count()).filter(|&v| shares[v] == 0.0);
    assert!(zeros.clone().all(|v| kept.contains(&bits(&mesh, v))));
    assert_eq!(done.report.locked_vertices, zeros.count());
    let is_fixed = |f: &usize| mesh.triangles()[*f].iter().all(|w| shares[mesh.vertex_of(*w).index()] == 0.0);
    let fixed = (0..mesh.face_count()).filter(is_fixed).count();
    assert!(done.report.locked_faces == fixed && fixed > 100, "{} of {fixed}", done.report.locked_faces);
    let free = mesh.face_count() - fixed;
    assert!(done.report.faces - fixed < free / 2, "{} of {free}", done.report.faces - fixed);
    check_map(&mesh, &done.mesh, &shares, 0.02 * done.report.error.diagonal, true);
}

#[test]
fn an_error_map_of_1_changes_nothing() {
    let mesh = shapes::blob(3, 5);
    let shares = vec![1.0; mesh.vertex_count()];
    let options = within(0.01);
    let mapped = simplify_with(Input::new(&mesh).error_map(&shares), &options, &mut NoControl).unwrap();
    assert_eq!(mapped.mesh, run(&mesh, &options).mesh);
}

#[test]
fn error_maps_are_checked() {
    let mesh = shapes::blob(2, 1);
    let with = |shares: &[f32], options: &SimplifyOptions| {
        simplify_with(Input::new(&mesh).error_map(shares), options, &mut NoControl).unwrap_err()
    };
    let ones = vec![1.0; mesh.vertex_count()];
    for bad in [-0.5, 1.5, f32::NAN, f32::INFINITY] {
        let mut shares = ones.clone();
        shares[5] = bad;
        let got = with(&shares, &within(0.01));
        assert!(matches!(got, SimplifyError::BadVertexValue { vertex: 5, .. }), "{got}");
    }
    let short = with(&ones[1..], &within(0.01));
    assert!(matches!(short, SimplifyError::WrongLength { option: "error map", .. }), "{short}");
    let without = with(&ones, &SimplifyOptions::new(Stop::ratio(0.5)));
    assert_eq!(without, SimplifyError::Needs { option: "error-map", other: "error" });
    for method in [MethodKind::Planar, MethodKind::Cluster, MethodKind::Remesh, MethodKind::VertexRemoval] {
        let mut options = within(0.01);
        options.method = method.into();
        let got = with(&ones, &options);
        assert!(matches!(got, SimplifyError::NotOfMethod { option: "error-map", .. }), "{got}");
    }
}
