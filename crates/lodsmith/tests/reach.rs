//! Targets that are hard to reach: cut necks, escalation, pruned parts.

use lodsmith::core::{Positions, Topology, TriMesh, VertexId, shapes};
use lodsmith::{
    BorderPolicy, Change, Fit, Guards, Length, Measure, Method, MethodKind, NoControl, Part, Placement,
    Remesh, RemeshPattern, Simplified, SimplifyError, SimplifyOptions, Stop, TopologyPolicy, simplify,
    simplify_scene,
};

use crate::support::{bytes, counts, places};

fn run(mesh: &TriMesh, options: &SimplifyOptions) -> Simplified {
    simplify(mesh, options).unwrap()
}

/// Joins several meshes in one, each scaled and moved along x.
fn side_by_side(meshes: &[(&TriMesh, f64, f64)]) -> TriMesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (mesh, scale, x) in meshes {
        let first = positions.len() as u32;
        positions
            .extend(mesh.positions().view().iter().map(|p| [p[0] * scale + x, p[1] * scale, p[2] * scale]));
        let surface = mesh.surface();
        triangles.extend(surface.triangles().iter().map(|t| t.map(|v| VertexId(v.0 + first))));
    }
    TriMesh::new(Positions::F64(positions), triangles).unwrap()
}

fn free(stop: Stop) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(stop);
    options.topology = TopologyPolicy::Free;
    options
}

#[test]
fn a_ring_is_cut_if_its_target_requires_it() {
    let torus = shapes::torus(32, 12);
    let mut cut_relaxed = 0;
    for method in [MethodKind::Memoryless, MethodKind::Quadric] {
        for placement in [Placement::Optimal, Placement::Endpoint, Placement::Midpoint] {
            let mut options = free(Stop::faces(4));
            (options.method, options.placement) = (method.into(), placement);
            let done = run(&torus, &options);
            let case = format!("{method:?}, {placement:?}: {} faces", done.report.faces);
            // (The run may get stuck afterwards if vertices cannot move.)
            let is_reached = done.report.reached || placement == Placement::Endpoint;
            assert!(done.report.necks_cut > 0 && is_reached, "{case}");
            // Compared by index, because the sides of a cut may touch.
            let topology = Topology::unwelded(&done.mesh.surface()).counts();
            assert!(topology.is_manifold() && topology.border_edge_count == 0, "{case}");
            let is_kept = places(&done.mesh).is_subset(&places(&torus));
            assert!(is_kept || placement != Placement::Endpoint, "{case}: a vertex that is not in the input");
            // Relaxed topology cuts where the target requires it, if the two sides can be separated.
            options.topology = TopologyPolicy::Relaxed;
            let relaxed = run(&torus, &options);
            let topology = counts(&relaxed.mesh);
            assert!(topology.is_manifold() && topology.border_edge_count == 0, "{case}");
            cut_relaxed += relaxed.report.necks_cut;
            options.topology = TopologyPolicy::Preserve;
            let kept = run(&torus, &options);
            assert!(!kept.report.reached && kept.report.necks_cut == 0, "{case}");
            assert!(done.report.faces < kept.report.faces, "{case}, {} uncut", kept.report.faces);
            let wanted = match placement {
                Placement::Endpoint => TopologyPolicy::Free,
                _ => TopologyPolicy::Relaxed,
            };
            let wanted = [Change::Topology(wanted)];
            let proposals = &kept.report.proposals;
            assert!(
                proposals.iter().any(|p| p.changes == wanted),
                "{case}: {proposals:?}, {} left",
                kept.report.faces
            );
        }
    }
    assert!(cut_relaxed > 0);
}

/// Rings of several sizes, with tiny parts around them.
fn rings_and_tiny_parts() -> TriMesh {
    let (torus, speck) = (shapes::torus(64, 24), shapes::icosphere(2));
    let rings = (0..6).map(|i| (&torus, 1.0 - 0.1 * f64::from(i), 3.0 * f64::from(i)));
    let specks = (0..30).map(|i| (&speck, 0.01 * f64::from(1 + i), 0.6 * f64::from(i)));
    side_by_side(&rings.chain(specks).collect::<Vec<_>>())
}

/// Relaxed topology removes parts and handles only once they block the target, free topology from the start.
#[test]
fn late_removal_of_parts_is_as_close() {
    let mesh = rings_and_tiny_parts();
    let mut shares = Vec::new();
    for faces in [160, 120, 60] {
        let with = |topology| {
            let mut options = free(Stop::faces(faces));
            (options.topology, options.measure) = (topology, Measure::Always);
            run(&mesh, &options)
        };
        let [late, early] = [TopologyPolicy::Relaxed, TopologyPolicy::Free].map(with);
        for done in [&late, &early] {
            let topology = Topology::unwelded(&done.mesh.surface()).counts();
            assert!(topology.is_manifold() && topology.border_edge_count == 0);
            let gone = done.report.parts_removed + done.report.necks_cut;
            assert!(done.report.reached && gone > 0, "{faces}: {}", done.report.faces);
        }
        assert!(counts(&late.mesh).is_manifold(), "{faces}: sides of a cut touch");
        let [late, early] = [&late, &early].map(|d| d.report.error.measured.unwrap().rms.symmetric);
        shares.push(late / early);
    }
    assert!(shares.iter().all(|s| *s < 1.25), "{shares:?}");
}

#[test]
fn nothing_is_cut_unnecessarily() {
    let torus = shapes::torus(48, 16);
    let done = run(&torus, &free(Stop::ratio(0.2)));
    let relaxed = run(&torus, &SimplifyOptions::new(Stop::ratio(0.2)));
    assert_eq!((bytes(&done.mesh), done.report.necks_cut), (bytes(&relaxed.mesh), 0));
}

#[test]
fn cut_surfaces_keep_their_attributes() {
    let mut torus = shapes::torus(48, 16);
    let view = torus.positions().view();
    let of_x = |p: [f64; 3]| [0.5 + 0.25 * p[0] as f32, 0.5, 0.5 - 0.25 * p[2] as f32, 1.0];
    let colors = view.iter().map(of_x).collect();
    torus.set_colors(Some(colors)).unwrap();
    for fit in [Fit::Auto, Fit::Off] {
        let mut options = free(Stop::faces(8));
        options.fit = fit;
        let done = run(&torus, &options);
        assert!(done.report.necks_cut > 0 && done.report.reached);
        // A colour that is linear in the position stays nearly so.
        let (mesh, colors) = (&done.mesh, done.mesh.colors().unwrap());
        let surface = mesh.surface();
        for (t, own) in mesh.triangles().iter().zip(surface.triangles()) {
            for k in 0..3 {
                let (got, want) = (colors[t[k].index()], of_x(mesh.positions().view().get(own[k])));
                assert!((got[0] - want[0]).abs() < 0.2, "{got:?} for {want:?}");
            }
        }
    }
}

#[test]
fn steps_are_tried_until_one_reaches_the_target() {
    let torus = shapes::torus(48, 16);
    let mut options = SimplifyOptions::new(Stop::faces(4));
    (options.topology, options.escalate) = (TopologyPolicy::Preserve, true);
    let done = run(&torus, &options);
    let steps: Vec<_> = done.report.escalated.iter().map(|s| s.change).collect();
    assert_eq!(steps, [Change::Topology(TopologyPolicy::Relaxed)]);
    let last = done.report.escalated[0];
    assert!(done.report.reached && last.after == done.report.faces && last.after < last.before);
    // The result equals a run with these options from the start.
    assert_eq!(bytes(&done.mesh), bytes(&run(&torus, &SimplifyOptions::new(Stop::faces(4))).mesh));
    // No step is tried if none is needed.
    options.stop = Stop::ratio(0.5);
    assert_eq!(run(&torus, &options).report.escalated, []);
}

#[test]
fn guards_and_borders_are_never_given_up() {
    let sheet = shapes::wavy_sheet(16);
    let mut options = SimplifyOptions::new(Stop::faces(2));
    (options.border, options.escalate) = (BorderPolicy::Lock, true);
    options.guards = Guards { min_quality: Some(0.5), ..Guards::default() };
    let done = run(&sheet, &options);
    assert!(!done.report.reached && !done.report.escalated.is_empty());
    assert_eq!(counts(&done.mesh).border_edge_count, counts(&sheet).border_edge_count);
    assert!(!done.report.proposals.is_empty());
}

#[test]
fn only_small_parts_are_pruned_first() {
    let (large, small) = (shapes::blob(4, 1), shapes::icosphere(1));
    let mesh = side_by_side(&[(&small, 0.01, 5.0), (&large, 1.0, 0.0), (&small, 0.02, -5.0)]);
    let mut options = SimplifyOptions::new(Stop::ratio(1.0));
    options.prune = Some(Length::Units(0.5));
    let done = run(&mesh, &options);
    let pruned = done.report.pruned;
    assert_eq!((pruned.parts, pruned.faces), (2, 2 * small.face_count()));
    assert!(!pruned.largest_kept && done.report.parts_removed == 0);
    assert_eq!(done.report.faces, large.face_count());
    assert_eq!(done.report.input_faces, mesh.face_count());
    assert_eq!(done.report.cleanup, run(&mesh, &SimplifyOptions::new(Stop::ratio(1.0))).report.cleanup);
    assert!(places(&done.mesh).is_subset(&places(&mesh)));
    // A size between the two removes one; shares refer to the diagonal of the whole mesh.
    let whole = done.report.error.diagonal;
    assert!((10.0..13.0).contains(&whole), "{whole}");
    options.prune = Some(Length::OfDiagonal(0.05 / whole));
    assert_eq!(run(&mesh, &options).report.pruned.parts, 1);
    // Distances are measured from the remaining parts.
    (options.prune, options.measure) = (Some(Length::Units(0.5)), Measure::Always);
    let measured = run(&mesh, &options).report.error.measured.unwrap();
    assert!(measured.hausdorff.symmetric < 1e-9 * whole);
    // If no part is small, the bytes are the same as without pruning.
    let mut plain = SimplifyOptions::new(Stop::ratio(0.3));
    let without = run(&mesh, &plain);
    plain.prune = Some(Length::Units(1e-6));
    assert_eq!(bytes(&run(&mesh, &plain).mesh), bytes(&without.mesh));
}

#[test]
fn the_largest_part_is_never_pruned() {
    let (a, b) = (shapes::icosphere(1), shapes::icosphere(2));
    let mesh = side_by_side(&[(&a, 1.0, 0.0), (&b, 2.0, 9.0), (&a, 1.0, 20.0)]);
    let mut options = SimplifyOptions::new(Stop::ratio(1.0));
    options.prune = Some(Length::Units(1000.0));
    let report = run(&mesh, &options).report;
    assert!(report.pruned.largest_kept && report.pruned.parts == 2);
    assert_eq!(report.faces, b.face_count());
    for bad in [f64::NAN, -1.0, f64::INFINITY] {
        options.prune = Some(Length::Units(bad));
        let refused = simplify(&mesh, &options);
        assert!(matches!(refused, Err(SimplifyError::BadOption { option: "prune", .. })));
    }
}

fn part(mesh: &TriMesh, instances: usize, scale: f64) -> Part<'_> {
    Part { instances, scale, ..Part::new(mesh) }
}

#[test]
fn small_parts_of_a_scene_are_counted_by_instance() {
    let (large, small) = (shapes::blob(4, 1), shapes::icosphere(1));
    let mixed = side_by_side(&[(&large, 1.0, 0.0), (&small, 0.01, 5.0)]);
    // Small in its own units, large in the scene.
    let parts = [part(&mixed, 3, 1.0), part(&small, 1, 10.0), part(&small, 2, 0.01)];
    let mut options = SimplifyOptions::new(Stop::ratio(1.0));
    options.prune = Some(Length::Units(0.5));
    let got = simplify_scene(&parts, 30.0, &options, &mut NoControl).unwrap();
    assert_eq!((got.report.pruned.parts, got.report.pruned.faces), (5, 5 * small.face_count()));
    let faces: Vec<_> = got.meshes.iter().map(TriMesh::face_count).collect();
    assert_eq!(faces, [large.face_count(), small.face_count(), 0]);
}

#[test]
fn the_target_may_apply_to_each_mesh_of_a_scene() {
    let (flat, round) = (shapes::grid(32), shapes::blob(4, 1));
    let empty = TriMesh::new(Positions::F32(Vec::new()), Vec::new()).unwrap();
    let parts = [part(&flat, 1, 1.0), part(&round, 4, 2.0), part(&empty, 1, 1.0)];
    let mut options = SimplifyOptions::new(Stop::ratio(0.3));
    (options.per_mesh, options.measure) = (true, Measure::Always);
    let got = simplify_scene(&parts, 4.0, &options, &mut NoControl).unwrap();
    for (mesh, part) in got.meshes.iter().zip(&parts) {
        let (most, faces) = (0.3 * part.mesh.face_count() as f64, mesh.face_count() as f64);
        assert!(faces <= most.round() && faces >= most - 2.0, "{faces} of {most}");
    }
    assert!(got.report.reached && got.report.error.diagonal == 4.0);
    assert_eq!(got.report.input_faces, flat.face_count() + 4 * round.face_count());
    assert_eq!(got.report.faces, got.meshes[0].face_count() + 4 * got.meshes[1].face_count());
    let counts = got.counts[1];
    assert_eq!((counts.instances, counts.input_faces), (4, round.face_count()));
    assert_eq!((counts.faces, counts.reached), (got.meshes[1].face_count(), true));
    // Each mesh is the same as in a run of its own, with lengths of the scene.
    let mut alone = SimplifyOptions::new(Stop::ratio(0.3));
    alone.measure = Measure::Always;
    let flat_alone = run(&flat, &alone);
    assert_eq!(got.meshes[0].face_count(), flat_alone.mesh.face_count());
    let largest = run(&round, &alone).report.error.measured.unwrap().hausdorff.symmetric;
    let measured = got.report.error.measured.unwrap().hausdorff.symmetric;
    assert!((measured / largest / 2.0 - 1.0).abs() < 0.2, "{measured} for {largest}");
    // A count applies to each mesh.
    (options.stop, options.measure) = (Stop::faces(100), Measure::Auto);
    let got = simplify_scene(&parts, 4.0, &options, &mut NoControl).unwrap();
    assert!(got.meshes[..2].iter().all(|m| (98..=100).contains(&m.face_count())));
    // If one mesh cannot reach it, the scene has not reached it, and the counts show which mesh.
    options.stop = Stop::faces(2);
    let got = simplify_scene(&parts, 4.0, &options, &mut NoControl).unwrap();
    assert!(!got.report.reached);
    assert_eq!(got.counts.iter().map(|c| c.reached).collect::<Vec<_>>(), [true, false, true]);
}

type SetLength = fn(&mut SimplifyOptions, Length);

/// Options of single methods that are lengths.
const METHOD_LENGTHS: [(MethodKind, SetLength); 5] = [
    (MethodKind::Cluster, |o, l| o.method = Method::Cluster { cell: Some(l), two_stage: false }),
    (MethodKind::ShortestEdge, |o, l| o.method = Method::ShortestEdge { edge_length: Some(l) }),
    (MethodKind::Remesh, |o, l| {
        o.method = Method::Remesh(Remesh::OnSurface {
            edge_length: Some(l),
            crease_deg: None,
            rounds: None,
            pattern: RemeshPattern::Even,
        });
    }),
    (MethodKind::Remesh, |o, l| o.method = Method::Remesh(Remesh::Voxels { size: l })),
    (MethodKind::Planar, |o, l| o.method = Method::Planar { angle_deg: None, flat: Some(l) }),
];

fn with_length((method, set): (MethodKind, SetLength), length: Length) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(Stop::default());
    options.method = method.into();
    set(&mut options, length);
    options
}

#[test]
fn lengths_of_methods_are_shares_of_the_whole_scene() {
    let mesh = shapes::blob(4, 1);
    let parts = [part(&mesh, 1, 1.0), part(&mesh, 1, 0.5)];
    for (i, method) in METHOD_LENGTHS.into_iter().enumerate() {
        let got = |length| {
            let options = with_length(method, length);
            let scene = simplify_scene(&parts, 40.0, &options, &mut NoControl).unwrap();
            scene.meshes.iter().map(bytes).collect::<Vec<_>>()
        };
        assert!(got(Length::OfDiagonal(0.01)) == got(Length::Units(0.4)), "case {i}");
    }
}

#[test]
fn lengths_of_methods_are_shares_of_the_input_before_pruning() {
    let (large, small) = (shapes::blob(4, 1), shapes::icosphere(1));
    let mesh = side_by_side(&[(&large, 1.0, 0.0), (&small, 0.01, 40.0)]);
    for (i, method) in METHOD_LENGTHS.into_iter().enumerate() {
        let got = |length| {
            let mut options = with_length(method, length);
            options.prune = Some(Length::Units(0.5));
            let report = run(&mesh, &options).report;
            assert_eq!(report.pruned.parts, 1);
            (report.faces, report.error.diagonal)
        };
        let (faces, diagonal) = got(Length::OfDiagonal(0.01));
        assert_eq!(faces, got(Length::Units(0.01 * diagonal)).0, "case {i}");
    }
}
