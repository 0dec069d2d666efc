//! Guarantees of un-subdivision: subdivided meshes are restored, everything else is kept.

use std::collections::{BTreeSet, HashMap};

use lodsmith::core::{Positions, RegionId, TriMesh, VertexId, arbitrary, shapes};
use lodsmith::{
    BorderPolicy, Fit, Input, Length, Method, MethodKind, NoControl, Refusal, Simplified, SimplifyError,
    SimplifyOptions, Stop, StoppedBy, simplify, simplify_with,
};
use proptest::prelude::*;

use crate::support::{bits, bytes, complaints, run, topology_complaints};

fn options(stop: Stop) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(stop);
    options.method = MethodKind::Unsubdivide.into();
    options
}

fn one_level() -> SimplifyOptions {
    let mut options = options(Stop::default());
    options.method = Method::Unsubdivide { levels: Some(1) };
    options
}

fn undone<'a>(input: impl Into<Input<'a>>, options: &SimplifyOptions) -> Simplified {
    let input = input.into();
    let mesh = input.mesh().expect("it is a mesh");
    let done = simplify_with(&input, options, &mut NoControl).expect("shapes can be simplified");
    let mut wrong = complaints(mesh, options, &done);
    wrong.extend(topology_complaints(mesh, options, &done));
    assert!(wrong.is_empty(), "{wrong:?}");
    done
}

/// Splits every face into four at the midpoints of its edges, with one vertex per position.
fn subdivided(mesh: &TriMesh) -> TriMesh {
    let surface = mesh.surface();
    let mut at = HashMap::new();
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut number = |p: [f64; 3]| {
        *at.entry(bits(p.map(|x| x + 0.0))).or_insert_with(|| {
            points.push(p);
            VertexId::new(points.len() - 1)
        })
    };
    let mut triangles = Vec::new();
    for t in surface.triangles() {
        let [p, q, r] = t.map(|v| surface.positions().get(v));
        // Independent of the direction of the edge.
        let middle = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]));
        let [a, b, c] = [p, q, r].map(&mut number);
        let [x, y, z] = [middle(p, q), middle(q, r), middle(r, p)].map(&mut number);
        triangles.extend([[a, x, z], [x, b, y], [z, y, c], [x, y, z]]);
    }
    TriMesh::new(Positions::F64(points), triangles).expect("indices are below the count")
}

/// Returns the faces by position, each starting at its lowest corner; faces with a repeated corner are left
/// out.
fn faces_by_place(mesh: &TriMesh) -> BTreeSet<[[u64; 3]; 3]> {
    let surface = mesh.surface();
    let place = |v: VertexId| bits(surface.positions().get(v).map(|x| x + 0.0));
    let corners = surface.triangles().iter().map(|t| t.map(place));
    let sound = corners.filter(|[a, b, c]| a != b && b != c && c != a);
    sound.map(|[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().expect("three")).collect()
}

#[test]
fn an_icosphere_becomes_the_next_coarser_one() {
    for n in 1..=5 {
        let done = undone(&shapes::icosphere(n), &one_level());
        assert_eq!(faces_by_place(&done.mesh), faces_by_place(&shapes::icosphere(n - 1)), "from {n}");
    }
}

#[test]
fn all_levels_are_undone_by_default_or_down_to_a_count() {
    let sphere = shapes::icosphere(5);
    let done = undone(&sphere, &options(Stop::default()));
    assert_eq!((done.report.faces, done.report.stopped_by), (20, StoppedBy::Exhausted));
    let done = undone(&sphere, &options(Stop::faces(1280)));
    assert_eq!((done.report.faces, done.report.stopped_by), (1280, StoppedBy::Faces));
    let done = undone(&sphere, &options(Stop::vertices(200)));
    assert_eq!((done.report.faces, done.report.stopped_by), (320, StoppedBy::Vertices));
    let done = undone(&sphere, &options(Stop::faces(5)));
    assert_eq!(
        (done.report.faces, done.report.stopped_by, done.report.reached),
        (20, StoppedBy::Exhausted, false)
    );
}

#[test]
fn every_shape_is_restored_from_its_subdivision() {
    // The shape with two coincident sheets becomes one sheet by welding, with edges of four faces.
    for (name, mesh) in shapes::all().into_iter().filter(|s| s.0 != "doubled_sheet") {
        let fine = subdivided(&mesh);
        let done = undone(&fine, &one_level());
        assert_eq!(faces_by_place(&done.mesh), faces_by_place(&mesh), "{name}");
        let finer = subdivided(&fine);
        let mut twice = one_level();
        twice.method = Method::Unsubdivide { levels: Some(2) };
        let done = undone(&finer, &twice);
        assert_eq!(faces_by_place(&done.mesh), faces_by_place(&mesh), "{name}, twice");
    }
}

#[test]
fn parts_without_the_pattern_stay_and_are_counted() {
    for mesh in [shapes::tetrahedron(), shapes::icosphere(0), shapes::cube(1), shapes::blob(4, 1)] {
        let before = faces_by_place(&mesh);
        let done = undone(&mesh, &options(Stop::default()));
        if done.report.collapses == 0 {
            assert_eq!(faces_by_place(&done.mesh), before);
            assert_eq!(done.report.refusals, [(Refusal::Pattern, 1)]);
        }
    }
    // With one face missing the pattern does not match.
    let sphere = shapes::icosphere(3);
    let triangles = sphere.surface().triangles()[1..].to_vec();
    let open = TriMesh::new(sphere.positions().clone(), triangles).expect("a sphere without one face");
    let done = undone(&open, &options(Stop::default()));
    assert_eq!(done.report.faces, open.face_count());
    assert_eq!(done.report.refusals, [(Refusal::Pattern, 1)]);
}

/// Joins both in one mesh, with the second moved away.
fn side_by_side(a: &TriMesh, b: &TriMesh) -> TriMesh {
    let (first, second) = (a.surface(), b.surface());
    let mut points: Vec<[f64; 3]> = first.positions().iter().collect();
    let shift = points.len() as u32;
    points.extend(second.positions().iter().map(|p| [p[0] + 10.0, p[1], p[2]]));
    let mut triangles = first.triangles().to_vec();
    triangles.extend(second.triangles().iter().map(|t| t.map(|v| VertexId(v.0 + shift))));
    TriMesh::new(Positions::F64(points), triangles).expect("two meshes")
}

#[test]
fn each_part_is_undone_separately() {
    let (fits, stays) = (shapes::icosphere(2), shapes::tetrahedron());
    let done = undone(&side_by_side(&fits, &stays), &one_level());
    assert_eq!(done.report.faces, shapes::icosphere(1).face_count() + 4);
    assert_eq!(done.report.refusals, [(Refusal::Pattern, 1)]);
    assert_eq!(faces_by_place(&done.mesh), faces_by_place(&side_by_side(&shapes::icosphere(1), &stays)));
}

#[test]
fn locks_borders_and_regions_hold() {
    let fine = subdivided(&shapes::grid(3));
    let middle = fine.vertex_count();
    let coarse = faces_by_place(&shapes::grid(3));
    // Removed vertices may not be locked; kept ones may.
    let stays: BTreeSet<_> = coarse.iter().flatten().copied().collect();
    let is_even: Vec<bool> =
        fine.positions().view().iter().map(|p| stays.contains(&bits(p.map(|x| x + 0.0)))).collect();
    let input = Input::new(&fine).locked(&is_even);
    assert_eq!(faces_by_place(&undone(input, &one_level()).mesh), coarse);
    let odd = (0..middle).find(|&i| !is_even[i]).expect("there are odd vertices");
    let locked: Vec<bool> = (0..middle).map(|i| i == odd).collect();
    let done = undone(Input::new(&fine).locked(&locked), &one_level());
    assert_eq!(
        (done.report.faces, &done.report.refusals[..]),
        (fine.face_count(), &[(Refusal::Locked, 1)][..])
    );

    let mut with = one_level();
    with.border = BorderPolicy::Lock;
    assert_eq!(undone(&fine, &with).report.refusals, [(Refusal::Border, 1)]);

    let mut painted = fine.clone();
    let by_tile = (0..fine.face_count()).map(|f| RegionId(u32::from(f / 4 % 2 == 0))).collect();
    painted.set_regions(Some(by_tile)).expect("one for each face");
    assert_eq!(faces_by_place(&undone(&painted, &one_level()).mesh), coarse);
    let across = (0..fine.face_count()).map(|f| RegionId(u32::from(f == 0))).collect();
    painted.set_regions(Some(across)).expect("one for each face");
    assert_eq!(undone(&painted, &one_level()).report.refusals, [(Refusal::Seam, 1)]);
}

#[test]
fn only_levels_within_the_error_are_undone() {
    // The sheet is planar, so undoing its levels costs nothing; each level of a sphere does.
    let flat = undone(&subdivided(&shapes::grid(3)), &options(Stop::error(Length::Units(1e-9))));
    assert_eq!(flat.report.faces, 18);
    let sphere = shapes::icosphere(5);
    let mut last = sphere.face_count();
    for limit in [1e-6, 1e-3, 5e-3, 0.02, 0.1] {
        let done = undone(&sphere, &options(Stop::error(Length::OfDiagonal(limit))));
        assert!(done.report.reached && done.report.faces <= last, "{limit}");
        last = done.report.faces;
    }
    assert_eq!(last, 20);
}

#[test]
fn options_that_the_method_does_not_have_are_refused() {
    let mesh = shapes::icosphere(2);
    let mut with = one_level();
    with.fit = Fit::On;
    assert!(matches!(
        simplify(&mesh, &with),
        Err(SimplifyError::NotOfMethod { option: "fit on", method: MethodKind::Unsubdivide, .. })
    ));
    let mut with = one_level();
    with.guards.max_valence = Some(7);
    assert!(matches!(simplify(&mesh, &with), Err(SimplifyError::NotOfMethod { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn random_meshes_are_restored(mesh in arbitrary::perturbed_shape(0.02)) {
        let fine = subdivided(&mesh);
        let options = one_level();
        let Ok(done) = run(&fine, &options).expect("no panic") else { return Ok(()) };
        let wrong = complaints(&fine, &options, &done);
        prop_assert!(wrong.is_empty(), "{wrong:?}");
        if done.report.refusals.is_empty() {
            prop_assert_eq!(done.report.faces * 4, fine.face_count());
            prop_assert_eq!(faces_by_place(&done.mesh), faces_by_place(&mesh));
        }
    }
    #[test]
    fn soups_give_a_result_or_an_error(mesh in arbitrary::soup(40, arbitrary::Coordinates::Wild)) {
        for mesh in [subdivided(&mesh), mesh] {
            let options = options(Stop::default());
            let Ok(done) = run(&mesh, &options).expect("no panic") else { continue };
            let wrong = complaints(&mesh, &options, &done);
            prop_assert!(wrong.is_empty(), "{wrong:?}");
            let again = run(&mesh, &options).expect("no panic").expect("the first run succeeded");
            prop_assert_eq!(bytes(&again.mesh), bytes(&done.mesh));
        }
    }
}
