//! Contraction of pairs of vertices that share no edge: joined parts, guarantees of each topology policy, and
//! targets that are out of reach without it.

use lodsmith::core::arbitrary::{self, Coordinates};
use lodsmith::core::mesh::defects::defects;
use lodsmith::core::{Positions, TriMesh, VertexId, shapes};
use lodsmith::{
    BorderPolicy, Change, Control, Input, Length, Method, MethodKind, NoControl, Placement, Simplified,
    SimplifyError, SimplifyOptions, Stop, TopologyPolicy, Verdict, simplify_with,
};
use proptest::prelude::*;

use crate::support::{self, CaseFilter, Complaints, counts, options_text};

const POLICIES: [TopologyPolicy; 3] =
    [TopologyPolicy::Preserve, TopologyPolicy::Relaxed, TopologyPolicy::Free];
const METHODS: [MethodKind; 2] = [MethodKind::Memoryless, MethodKind::Quadric];

fn with_pairs(stop: Stop, distance: Length) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(stop);
    options.method = Method::Memoryless { pairs: Some(distance) };
    options
}

fn paired(method: MethodKind, distance: Length) -> Method {
    let pairs = Some(distance);
    if method == MethodKind::Quadric { Method::Quadric { pairs } } else { Method::Memoryless { pairs } }
}

fn without_pairs(options: &SimplifyOptions) -> SimplifyOptions {
    let mut options = options.clone();
    options.method = options.method.kind().into();
    options
}

fn run<'a>(input: impl Into<Input<'a>>, options: &SimplifyOptions) -> Simplified {
    simplify_with(input, options, &mut NoControl).unwrap()
}

/// Joins meshes side by side, each moved.
fn together(parts: &[(&TriMesh, [f64; 3])]) -> TriMesh {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for (mesh, by) in parts {
        let first = positions.len() as u32;
        positions.extend(mesh.positions().view().iter().map(|p| [0, 1, 2].map(|k| p[k] + by[k])));
        faces.extend(mesh.surface().triangles().iter().map(|t| t.map(|v| VertexId(v.0 + first))));
    }
    TriMesh::new(Positions::F64(positions), faces).unwrap()
}

/// Returns the mesh with separate triangles, each shrunk towards its centre.
fn shrunk(mesh: &TriMesh, to: f64) -> TriMesh {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for t in mesh.surface().triangles() {
        let corners = t.map(|v| mesh.positions().view().get(v));
        let middle = [0, 1, 2].map(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0);
        let first = positions.len() as u32;
        positions.extend(corners.map(|c| [0, 1, 2].map(|k| middle[k] + to * (c[k] - middle[k]))));
        faces.push([first, first + 1, first + 2].map(VertexId));
    }
    TriMesh::new(Positions::F64(positions), faces).unwrap()
}

/// Two wavy sheets with a crack between them and opposite vertices on both sides of it.
fn cracked_sheet(gap: f64) -> TriMesh {
    let grid = shapes::grid(20);
    let bounds = grid.positions().view().bounds().unwrap();
    let unit = |p: [f64; 3], k: usize| (p[k] - bounds.min[k]) / (bounds.max[k] - bounds.min[k]);
    let wave = |p: [f64; 3]| 0.1 * (6.0 * unit(p, 0)).sin() * (std::f64::consts::TAU * unit(p, 1)).cos();
    let places = grid.positions().view().iter().map(|p| [unit(p, 0), unit(p, 1), wave(p)]).collect();
    let sheet = TriMesh::new(Positions::F64(places), grid.surface().triangles().to_vec()).unwrap();
    together(&[(&sheet, [0.0; 3]), (&sheet, [0.0, 1.0 + gap, 0.0])])
}

/// A three-sided bar with one triangle at each end, from one height to another.
fn prism(from: f64, to: f64) -> TriMesh {
    let ring = [[0.0, 0.0], [1.0, 0.0], [0.3, 0.8]];
    let places = [from, to].into_iter().flat_map(|z| ring.map(|p| [p[0], p[1], z])).collect();
    let faces = [[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]];
    TriMesh::new(Positions::F64(places), faces.map(|t: [u32; 3]| t.map(VertexId)).to_vec()).unwrap()
}

#[test]
fn a_crack_is_closed_under_any_topology_policy() {
    let mesh = cracked_sheet(0.004);
    assert_eq!(counts(&mesh).component_count, 2);
    for method in METHODS {
        for topology in POLICIES {
            let mut options = with_pairs(Stop::ratio(0.25), Length::Units(0.01));
            (options.method, options.topology) = (paired(method, Length::Units(0.01)), topology);
            let alone = run(&mesh, &without_pairs(&options));
            assert_eq!((counts(&alone.mesh).component_count, alone.report.pairs_contracted), (2, 0));
            let done = run(&mesh, &options);
            let after = counts(&done.mesh);
            let case = options_text(&options);
            assert!(done.report.reached && done.report.pairs_contracted > 0, "{case}");
            assert_eq!((after.component_count, after.border_loop_count), (1, 1), "{case}");
            assert!(after.is_manifold(), "{case}: {after:?}");
        }
    }
}

#[test]
fn separate_triangles_become_one_surface() {
    let mesh = shrunk(&shapes::icosphere(3), 0.9);
    assert_eq!(counts(&mesh).component_count, mesh.face_count());
    for method in METHODS {
        for topology in POLICIES {
            let mut options = with_pairs(Stop::ratio(0.2), Length::OfDiagonal(0.02));
            (options.method, options.topology) = (paired(method, Length::OfDiagonal(0.02)), topology);
            let done = run(&mesh, &options);
            let after = counts(&done.mesh);
            assert!(done.report.reached, "{}", options_text(&options));
            assert!(
                after.is_manifold() && after.component_count == 1,
                "{}: {after:?}",
                options_text(&options)
            );
            assert!(after.is_closed() && after.euler() == 2, "{}: {after:?}", options_text(&options));
        }
    }
}

#[test]
fn two_bodies_are_joined_at_their_faces() {
    let volume = |m: &TriMesh| lodsmith::core::topology::size_of(&m.surface()).volume.abs();
    let mesh = together(&[(&prism(0.0, 3.0), [0.0; 3]), (&prism(3.01, 6.0), [0.0; 3])]);
    for method in METHODS {
        for topology in POLICIES {
            let mut options = with_pairs(Stop::faces(8), Length::OfDiagonal(0.01));
            (options.method, options.topology) = (paired(method, Length::OfDiagonal(0.01)), topology);
            let (done, case) = (run(&mesh, &options), options_text(&options));
            let after = counts(&done.mesh);
            assert!(done.report.reached && after.is_closed() && after.is_manifold(), "{case}: {after:?}");
            assert_eq!((after.component_count, done.report.pairs_contracted), (1, 3), "{case}");
            assert_eq!(done.report.parts_removed, 0, "{case}");
            if method == MethodKind::Memoryless {
                // One long bar. (Costs with memory include the planes of the two joined ends, and lead to
                // other collapses.)
                let lost = |m: &TriMesh| (volume(m) / volume(&mesh) - 1.0).abs();
                let alone = run(&mesh, &without_pairs(&options));
                assert!(lost(&done.mesh) < 0.01 && lost(&alone.mesh) > 0.1, "{case}");
            }
        }
    }
}

#[test]
fn the_two_sides_of_a_wall_stay_apart() {
    // A plate far thinner than the distance: closed, with its sides back to back.
    let cube = shapes::cube(10);
    let flat = cube.positions().view().iter().map(|p| [p[0], p[1], 0.002 * p[2]]).collect();
    let plate = TriMesh::new(Positions::F64(flat), cube.surface().triangles().to_vec()).unwrap();
    for topology in POLICIES {
        let mut options = with_pairs(Stop::ratio(0.2), Length::OfDiagonal(0.02));
        options.topology = topology;
        let done = run(&plate, &options);
        assert_eq!(done.report.pairs_contracted, 0, "{}", options_text(&options));
        assert_eq!(done.mesh, run(&plate, &without_pairs(&options)).mesh);
    }
}

/// Checks the guarantees of each policy with pairs: counts of edges never rise, and a manifold mesh stays
/// manifold if the topology is preserved.
fn complaints(mesh: &TriMesh, options: &SimplifyOptions, done: &Simplified) -> Vec<String> {
    let mut found = support::complaints(mesh, options, done);
    let (old, new) = (counts(mesh), counts(&done.mesh));
    let mut check = |holds: bool, otherwise: String| found.extend((!holds).then_some(otherwise));
    let twice = defects(&done.mesh.surface()).same_winding_duplicate_count;
    check(twice == 0, format!("{twice} duplicate faces, by position"));
    if options.topology == TopologyPolicy::Free {
        return found;
    }
    let mut not_above = |what: &str, old: usize, new: usize| {
        check(new <= old, format!("{what}: {old} became {new}"));
    };
    not_above("border edges", old.border_edge_count, new.border_edge_count);
    not_above("non-manifold edges", old.non_manifold_edge_count, new.non_manifold_edge_count);
    let twisted =
        |c: &lodsmith::core::topology::TopologyCounts| c.misoriented_edge_count + c.non_manifold_edge_count;
    not_above("misoriented or non-manifold edges", twisted(&old), twisted(&new));
    let backs = |m: &TriMesh| defects(&m.surface()).opposite_duplicate_count;
    not_above("faces back to back", backs(mesh), backs(&done.mesh));
    if options.topology == TopologyPolicy::Preserve {
        not_above("non-manifold vertices", old.non_manifold_vertex_count, new.non_manifold_vertex_count);
    }
    found
}

#[test]
fn every_shape_keeps_the_guarantees_of_its_policy() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(5);
    let mut contracted = 0;
    let mut shapes = shapes::all();
    shapes.push(("cracked sheet", cracked_sheet(0.02)));
    shapes.push(("shrunk torus", shrunk(&shapes::torus(12, 8), 0.8)));
    shapes.push(("shrunk soup", shrunk(&shapes::soup(60, 3), 0.9)));
    for (name, mesh) in shapes {
        for method in METHODS {
            for topology in POLICIES {
                for (border, placement) in [
                    (BorderPolicy::Keep, Placement::Optimal),
                    (BorderPolicy::Slide, Placement::Midpoint),
                    (BorderPolicy::Lock, Placement::Endpoint),
                    (BorderPolicy::Free, Placement::Optimal),
                ] {
                    for (stop, near) in [(Stop::ratio(0.5), 0.02), (Stop::faces(4), 0.2)] {
                        if !cases.takes() {
                            continue;
                        }
                        let mut options = with_pairs(stop, Length::OfDiagonal(near));
                        (options.method, options.topology) =
                            (paired(method, Length::OfDiagonal(near)), topology);
                        (options.border, options.placement) = (border, placement);
                        let case = format!("{name}, {}, pairs {near}", options_text(&options));
                        match support::run(&mesh, &options) {
                            Ok(Ok(done)) => {
                                contracted += done.report.pairs_contracted;
                                all.add(&case, complaints(&mesh, &options, &done));
                            }
                            Ok(Err(SimplifyError::NoFaces { .. })) => {}
                            Ok(Err(other)) => all.add(&case, [other.to_string()]),
                            Err(panic) => all.add(&case, [panic]),
                        }
                    }
                }
            }
        }
    }
    assert!(contracted > support::size(1000, 200), "{contracted}");
    all.report_all();
}

proptest! {
    #![proptest_config(ProptestConfig { cases: support::size(32, 8), ..ProptestConfig::default() })]

    #[test]
    fn soups_keep_the_guarantees_of_the_policy(
        mesh in arbitrary::soup(40, Coordinates::Tame),
        near in 0.01f64..1.5,
        which in 0usize..6,
        stop in 1usize..20,
    ) {
        let mut options = with_pairs(Stop::faces(stop), Length::OfDiagonal(near));
        (options.topology, options.method) = (POLICIES[which % 3], paired(METHODS[which / 3], Length::OfDiagonal(near)));
        if let Ok(done) = support::run(&mesh, &options).map_err(TestCaseError::fail)? {
            let found = complaints(&mesh, &options, &done);
            prop_assert!(found.is_empty(), "{}: {found:?}", options_text(&options));
            prop_assert_eq!(support::bytes(&run(&mesh, &options).mesh), support::bytes(&done.mesh));
        }
    }

    #[test]
    fn broken_up_shapes_keep_the_guarantees_of_the_policy(
        mesh in arbitrary::perturbed_shape(0.02),
        near in 0.01f64..0.3,
        to in 0.5f64..1.0,
        which in 0usize..6,
    ) {
        let mesh = shrunk(&mesh, to);
        let mut options = with_pairs(Stop::ratio(0.3), Length::OfDiagonal(near));
        (options.topology, options.method) = (POLICIES[which % 3], paired(METHODS[which / 3], Length::OfDiagonal(near)));
        if let Ok(done) = support::run(&mesh, &options).map_err(TestCaseError::fail)? {
            let found = complaints(&mesh, &options, &done);
            prop_assert!(found.is_empty(), "{}: {found:?}", options_text(&options));
        }
    }
}

#[test]
fn locked_vertices_stay_and_others_are_merged_onto_them() {
    let mesh = cracked_sheet(0.004);
    let half = mesh.vertex_count() / 2;
    let options = with_pairs(Stop::ratio(0.3), Length::Units(0.01));
    let locked: Vec<bool> = (0..mesh.vertex_count()).map(|i| i < half).collect();
    let done = run(Input::new(&mesh).locked(&locked), &options);
    assert!(done.report.pairs_contracted > 0);
    let places = support::places(&done.mesh);
    let held = (0..half).map(|i| support::bits(mesh.positions().view().get(VertexId(i as u32))));
    assert!(held.into_iter().all(|p| places.contains(&p)));
    assert_eq!(counts(&done.mesh).component_count, 1);
}

#[test]
fn wedges_of_both_sides_of_a_crack_stay() {
    let mut mesh = cracked_sheet(0.004);
    let n = mesh.wedge_count();
    // Two charts: attributes of one end of a pair must not be blended into the other.
    let uvs: Vec<[f32; 2]> = (0..n)
        .map(|i| {
            let p = mesh.positions().view().get(mesh.vertex_of(lodsmith::core::WedgeId(i as u32)));
            let chart = if i < n / 2 { 0.0 } else { 10.0 };
            [p[0] as f32 + chart, p[1] as f32]
        })
        .collect();
    mesh.set_uvs(Some(uvs)).unwrap();
    let done = run(&mesh, &with_pairs(Stop::ratio(0.3), Length::Units(0.01)));
    assert_eq!(counts(&done.mesh).component_count, 1);
    for t in done.mesh.triangles() {
        let own = t.map(|w| done.mesh.uvs().unwrap()[w.index()][0]);
        assert!(own.iter().all(|u| *u < 5.0) || own.iter().all(|u| *u > 5.0), "{own:?} mixes charts");
    }
}

#[test]
fn pairs_are_proposed_and_tried_if_the_target_is_out_of_reach() {
    // Separate triangles: no edge can be collapsed if parts are kept.
    let sphere = shapes::icosphere(2);
    let mesh = shrunk(&sphere, 0.98);
    let mut options = SimplifyOptions::new(Stop::ratio(0.5));
    options.topology = TopologyPolicy::Preserve;
    let stuck = run(&mesh, &options);
    assert_eq!((stuck.report.reached, stuck.report.faces), (false, mesh.face_count()));
    let named = |c: &Change| matches!(c, Change::Pairs(_));
    let proposals = &stuck.report.proposals;
    assert!(proposals.iter().any(|p| p.changes.iter().any(named)), "{proposals:?}");
    options.escalate = true;
    let done = run(&mesh, &options);
    assert!(named(&done.report.escalated[0].change) && done.report.escalated.len() == 1);
    assert!(done.report.reached && done.report.pairs_contracted > 0);
    // A single part cannot be joined to another.
    options.stop = Stop::faces(1);
    let alone = run(&sphere, &options);
    assert!(!alone.report.reached && !alone.report.escalated.iter().any(|s| named(&s.change)));
    assert!(!alone.report.proposals.iter().any(|p| p.changes.iter().any(named)));
}

/// Ends a run at its `left`th progress report.
struct AnswerAfter {
    left: usize,
    with: Verdict,
}

impl Control for AnswerAfter {
    fn progress(&mut self, _: f64) -> Verdict {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 { self.with } else { Verdict::Continue }
    }
}

#[test]
fn a_caller_can_end_a_run_with_pairs() {
    let mesh = shrunk(&shapes::icosphere(4), 0.9);
    let options = with_pairs(Stop::ratio(0.1), Length::OfDiagonal(0.02));
    for left in [2, 3, 5, 8] {
        let cancelled = simplify_with(&mesh, &options, &mut AnswerAfter { left, with: Verdict::Cancel });
        assert_eq!(cancelled.map(|d| d.mesh), Err(SimplifyError::Cancelled));
        let finished =
            simplify_with(&mesh, &options, &mut AnswerAfter { left, with: Verdict::Finish }).unwrap();
        assert!(finished.mesh.face_count() > mesh.face_count() / 10);
        assert_eq!(finished.report.stopped_by, lodsmith::StoppedBy::Caller);
    }
}

#[test]
fn a_distance_that_is_far_too_large_takes_bounded_time() {
    // Each vertex has all others within the distance.
    let mesh = shapes::soup(800, 7);
    let done = run(&mesh, &with_pairs(Stop::ratio(0.5), Length::OfDiagonal(10.0)));
    // The closer result is taken, with or without pairs.
    assert!(done.report.reached);
}

#[test]
fn the_error_of_a_run_with_pairs_is_kept() {
    let mesh = cracked_sheet(0.004);
    for limit in [0.001, 0.01] {
        let done = run(&mesh, &with_pairs(Stop::error(Length::Units(limit)), Length::Units(0.01)));
        assert!(done.report.reached && done.report.error.measured.unwrap().hausdorff.symmetric <= limit);
    }
}
