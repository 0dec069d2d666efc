//! Guarantees of the clean-up.

use lodsmith::core::mesh::weld::weld_mesh;
use lodsmith::core::topology::{Topology, size_of};
use lodsmith::core::{Positions, RegionId, TriMesh, WedgeId, arbitrary, shapes};
use lodsmith::{CleanOptions, Cleaned, Length, NoControl, NonManifold, SimplifyError, clean};
use proptest::prelude::*;

fn mesh(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> TriMesh {
    TriMesh::new(Positions::F64(positions.to_vec()), bytemuck::cast_slice(faces).to_vec()).unwrap()
}

fn with(non_manifold: NonManifold) -> CleanOptions {
    let mut options = CleanOptions::default();
    options.non_manifold = non_manifold;
    options
}

fn run(mesh: &TriMesh, options: &CleanOptions) -> Cleaned {
    clean(mesh, options, &mut NoControl).unwrap()
}

/// Returns the same faces, scaled, moved by a vector, and flipped if `turned`.
fn copied(base: &TriMesh, by: [f64; 3], scale: f64, turned: bool) -> Buffers {
    let view = base.positions().view();
    let positions = view.iter().map(|p| [0, 1, 2].map(|k| p[k] * scale + by[k])).collect();
    let turn = |t: [u32; 3]| if turned { [t[0], t[2], t[1]] } else { t };
    let faces = base.triangles().iter().map(|t| turn(t.map(|w| base.vertex_of(w).0))).collect();
    (positions, faces)
}

type Buffers = (Vec<[f64; 3]>, Vec<[u32; 3]>);

fn joined(parts: &[Buffers]) -> TriMesh {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for (p, f) in parts {
        let first = positions.len() as u32;
        positions.extend_from_slice(p);
        faces.extend(f.iter().map(|t| t.map(|v| v + first)));
    }
    mesh(&positions, &faces)
}

/// A cube with a corner at this position; faces point outward.
fn cube(at: [f64; 3]) -> Buffers {
    let corner = |i: u32| [i & 1, i >> 1 & 1, i >> 2].map(f64::from);
    let positions = (0..8).map(|i| [0, 1, 2].map(|k| corner(i)[k] + at[k])).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    (positions, quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect())
}

#[test]
fn a_clean_mesh_is_unchanged() {
    for base in [shapes::icosphere(2), shapes::torus(12, 8)] {
        for policy in [NonManifold::Keep, NonManifold::Cut, NonManifold::Merge] {
            let got = run(&base, &with(policy));
            assert_eq!(got.mesh, base);
            assert_eq!(got.report.remaining, Default::default());
            assert_eq!(got.report.flipped_faces + got.report.welded_vertices + got.report.sewn_edges, 0);
        }
    }
}

#[test]
fn every_step_is_counted() {
    let sphere = shapes::icosphere(2);
    let (mut p, mut f) = copied(&sphere, [0.0; 3], 1.0, false);
    let (count, faces) = (p.len() as u32, f.len());
    // Some faces are flipped, one is duplicated, one uses a position twice, one is not finite, a vertex is
    // duplicated, and one is unused.
    for t in f.iter_mut().step_by(3) {
        t.swap(0, 1);
    }
    let turned = faces.div_ceil(3);
    p.extend([p[5], [f64::NAN; 3], [9.0; 3]]);
    f.push([f[0][1], f[0][2], f[0][0]]);
    f.push([5, count, 7]);
    f.push([1, 2, count + 1]);
    let got = run(&mesh(&p, &f), &CleanOptions::default());
    let r = got.report;
    assert_eq!((r.welded_vertices, r.duplicate_faces, r.degenerate_faces, r.non_finite_faces), (1, 1, 1, 1));
    assert_eq!((r.flipped_faces, r.unused_vertices), (turned, 2));
    assert_eq!((r.faces, r.vertices), (faces, count as usize));
    assert_eq!(r.remaining, Default::default());
    assert!(size_of(&got.mesh.surface()).volume > 4.0);
}

#[test]
fn closed_parts_face_outward_but_cavities_stay() {
    let sphere = shapes::icosphere(2);
    let inward = copied(&sphere, [0.0; 3], 1.0, true);
    let got = run(&joined(&[inward]), &CleanOptions::default());
    assert_eq!(got.report.flipped_faces, sphere.face_count());
    // A cavity in a sphere; next to it another sphere, inside out.
    let parts = [
        copied(&sphere, [0.0; 3], 1.0, false),
        copied(&sphere, [0.1; 3], 0.3, true),
        copied(&sphere, [5.0, 0.0, 0.0], 1.0, true),
    ];
    let all = joined(&parts);
    let got = run(&all, &CleanOptions::default());
    assert_eq!(got.report.flipped_faces, sphere.face_count());
    let n = 2 * sphere.face_count();
    assert_eq!(got.mesh.triangles()[..n], all.triangles()[..n]);
    // A sphere inside a cavity inside a sphere faces outward again.
    let parts = [parts[0].clone(), parts[1].clone(), copied(&sphere, [0.1; 3], 0.1, true)];
    assert_eq!(run(&joined(&parts), &CleanOptions::default()).report.flipped_faces, sphere.face_count());
}

#[test]
fn an_open_part_follows_most_of_its_faces() {
    let sheet = shapes::grid(6);
    let (p, mut f) = copied(&sheet, [0.0; 3], 1.0, false);
    for t in f.iter_mut().take(10) {
        t.swap(1, 2);
    }
    let got = run(&mesh(&p, &f), &CleanOptions::default());
    assert_eq!((got.report.flipped_faces, got.report.remaining.misoriented_edges), (10, 0));
    assert!(got.report.remaining.border_edges > 0);
}

#[test]
fn cubes_that_touch_are_separated_and_stay_closed() {
    for (at, welded, parted) in [([1.0, 1.0, 0.0], 2, 2), ([1.0, 1.0, 1.0], 1, 1)] {
        let both = joined(&[cube([0.0; 3]), cube(at)]);
        let kept = run(&both, &CleanOptions::default());
        assert_eq!(kept.report.welded_vertices, welded);
        assert!(kept.report.remaining.non_manifold_vertices > 0);
        let cut = run(&both, &with(NonManifold::Cut));
        assert_eq!((cut.report.parted_vertices, cut.report.remaining), (parted, Default::default()));
        assert_eq!(cut.mesh.vertex_count(), 16);
        // Separate vertices keep them apart, and there is no border to sew.
        let merged = run(&both, &with(NonManifold::Merge));
        assert_eq!((merged.mesh, merged.report.remaining), (both, Default::default()));
    }
}

#[test]
fn each_of_two_cubes_keeps_its_face_in_a_common_wall() {
    // Each cube has its own face in the middle; these are back to back.
    let both = joined(&[cube([0.0; 3]), cube([1.0, 0.0, 0.0])]);
    let cut = run(&both, &with(NonManifold::Cut));
    assert_eq!(cut.report.remaining.opposite_faces, 2);
    let counts = Topology::unwelded(&cut.mesh.surface()).counts();
    assert!(counts.is_closed() && counts.is_manifold() && counts.is_oriented());
    assert_eq!(counts.component_count, 2);
}

#[test]
fn cracks_are_sewn_without_joining_touching_surfaces() {
    // Two cubes that share an edge, each face with vertices of its own.
    let (mut p, mut f) = (Vec::new(), Vec::new());
    for (cp, cf) in [cube([0.0; 3]), cube([1.0, 1.0, 0.0])] {
        for t in cf {
            f.push([p.len() as u32, p.len() as u32 + 1, p.len() as u32 + 2]);
            p.extend(t.map(|v| cp[v as usize]));
        }
    }
    let got = run(&mesh(&p, &f), &with(NonManifold::Merge));
    assert_eq!((got.report.sewn_edges, got.report.welded_vertices), (36, 72 - 16));
    assert_eq!(got.report.remaining, Default::default());
    assert_eq!(run(&mesh(&p, &f), &CleanOptions::default()).report.remaining.non_manifold_edges, 1);
}

#[test]
fn a_one_sided_strip_is_reported_and_cut() {
    let strip = shapes::mobius_strip(20);
    let kept = run(&strip, &CleanOptions::default());
    assert!(kept.report.remaining.misoriented_edges > 0);
    let cut = run(&strip, &with(NonManifold::Cut));
    let counts = Topology::unwelded(&cut.mesh.surface()).counts();
    assert!(counts.is_manifold() && counts.is_oriented());
}

#[test]
fn removing_faces_without_area_opens_no_border() {
    //   3-------2      the corner 4 lies on the diagonal, in a face without area
    //   |    4' |
    //   0-------1
    let p = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 0.0]];
    let got = run(&mesh(&p, &[[0, 1, 4], [4, 1, 2], [0, 4, 2], [0, 2, 3]]), &CleanOptions::default());
    assert_eq!((got.report.zero_area_faces, got.report.remaining.zero_area_faces), (1, 0));
    assert_eq!((got.mesh.face_count(), got.report.remaining.border_edges), (4, 4));
    assert!((size_of(&got.mesh.surface()).area - 1.0).abs() < 1e-12);
    // One fin on an edge that already has two faces, and one on the border.
    let got = run(&mesh(&p, &[[0, 1, 2], [0, 2, 3], [0, 4, 2]]), &CleanOptions::default());
    assert_eq!((got.mesh.face_count(), got.mesh.vertex_count()), (2, 4));
    assert_eq!(got.report.remaining.non_manifold_edges, 0);
}

/// Found by fuzzing: a face that three others kept in place remained after these were gone, and a second run
/// removed it.
#[test]
fn faces_without_area_are_removed_in_one_run() {
    let far = [-1.7e38; 3];
    let [o, p, q, r, s] =
        [[0.0; 3], [3.5, 0.75, 2.75], [2.5, 3.75, 3.75], [3.75, 3.25, 0.0], [0.0, 0.0, 1.5]];
    let lone = [[0.0, 0.0, 0.0], [1e38, 0.0, 0.0], [0.0, 1e38, 0.0]];
    let positions: Vec<[f64; 3]> = [o, far, p, q, r, s].into_iter().chain(lone).collect();
    let faces = [[0, 1, 2], [2, 1, 3], [1, 4, 0], [5, 0, 1], [6, 7, 8]];
    let cleaned = run(&mesh(&positions, &faces), &CleanOptions::default());
    assert_eq!((cleaned.report.faces, cleaned.report.remaining.zero_area_faces), (1, 0));
}

#[test]
fn small_parts_are_removed_and_the_largest_stays() {
    let sphere = shapes::icosphere(2);
    let parts = joined(&[
        copied(&sphere, [0.0; 3], 1.0, false),
        copied(&sphere, [4.0, 0.0, 0.0], 0.01, false),
        copied(&sphere, [0.0, 4.0, 0.0], 0.02, false),
    ]);
    let mut options = CleanOptions::default();
    options.prune = Some(Length::OfDiagonal(0.05));
    let got = run(&parts, &options);
    assert_eq!((got.report.pruned.parts, got.mesh.face_count()), (2, sphere.face_count()));
    options.prune = Some(Length::Units(1e9));
    let got = run(&parts, &options);
    assert!(got.report.pruned.largest_kept && got.mesh.face_count() == sphere.face_count());
}

#[test]
fn close_vertices_are_merged_within_the_distance() {
    let (mut p, mut f) = (Vec::new(), Vec::new());
    let (cp, cf) = cube([0.0; 3]);
    for (i, t) in cf.iter().enumerate() {
        f.push([3 * i as u32, 3 * i as u32 + 1, 3 * i as u32 + 2]);
        p.extend(t.map(|v| cp[v as usize].map(|x| x + 1e-6 * i as f64)));
    }
    let soup = mesh(&p, &f);
    assert_eq!(run(&soup, &CleanOptions::default()).report.remaining.border_edges, 36);
    for policy in [NonManifold::Keep, NonManifold::Merge] {
        let mut options = with(policy);
        options.weld = Some(Length::Units(1e-4));
        let got = run(&soup, &options);
        assert_eq!((got.mesh.vertex_count(), got.report.remaining), (8, Default::default()));
    }
}

#[test]
fn attributes_and_regions_stay_with_their_corners() {
    // Each corner has its own colour, and each face its own region; two cubes share an edge.
    let base = weld_mesh(&joined(&[cube([0.0; 3]), cube([1.0, 1.0, 0.0])]), None).mesh;
    let corners = base.triangles().as_flattened();
    let map = corners.iter().map(|&w| base.vertex_of(w)).collect();
    let faces = (0..base.face_count() as u32).map(|f| [0, 1, 2].map(|k| WedgeId(3 * f + k))).collect();
    let mut with_attributes = TriMesh::with_wedges(base.positions().clone(), map, faces).unwrap();
    with_attributes
        .set_colors(Some((0..corners.len()).map(|i| [i as f32, 0.0, 0.0, 1.0]).collect()))
        .unwrap();
    with_attributes.set_regions(Some((0..base.face_count()).map(RegionId::new).collect())).unwrap();
    for policy in [NonManifold::Keep, NonManifold::Cut, NonManifold::Merge] {
        let got = run(&with_attributes, &with(policy)).mesh;
        assert_eq!(got.regions(), with_attributes.regions());
        let colors = got.colors().unwrap();
        let corner_colors = got.triangles().as_flattened().iter().map(|w| colors[w.index()][0]);
        assert!(corner_colors.eq((0..corners.len()).map(|i| i as f32)));
        let places = |m: &TriMesh| -> Vec<[f64; 3]> {
            let view = m.positions().view();
            m.triangles().as_flattened().iter().map(|&w| view.get(m.vertex_of(w))).collect()
        };
        assert_eq!(places(&got), places(&with_attributes));
    }
}

#[test]
fn invalid_input_is_an_error() {
    let flat = mesh(&[[0.0; 3], [1.0, 0.0, 0.0]], &[[0, 1, 1]]);
    let got = clean(&flat, &CleanOptions::default(), &mut NoControl);
    assert_eq!(got, Err(SimplifyError::NoFaces { faces: 1 }));
    let mut options = CleanOptions::default();
    options.weld = Some(Length::Units(f64::NAN));
    let got = clean(&shapes::icosphere(0), &options, &mut NoControl);
    assert!(matches!(got, Err(SimplifyError::BadOption { option: "weld", .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_cut_surface_is_manifold_and_oriented(soup in arbitrary::soup(24, arbitrary::Coordinates::NotFinite)) {
        if let Ok(cut) = clean(&soup, &with(NonManifold::Cut), &mut NoControl) {
            let surface = cut.mesh.surface();
            let counts = Topology::unwelded(&surface).counts();
            prop_assert!(counts.is_manifold() && counts.is_oriented(), "{counts:?}");
            // The report counts every change.
            let kept = run(&soup, &CleanOptions::default());
            prop_assert_eq!(kept.mesh.face_count(), cut.mesh.face_count());
            let vertices = cut.mesh.vertex_count();
            prop_assert_eq!(vertices, kept.mesh.vertex_count() + cut.report.parted_vertices);
            // A second run changes nothing, compared by index.
            let again = run(&cut.mesh, &with(NonManifold::Merge));
            prop_assert!(again.report.remaining.border_edges <= cut.report.remaining.border_edges);
        }
    }

    #[test]
    fn sewing_leaves_no_borders_that_could_be_sewn(soup in arbitrary::soup(24, arbitrary::Coordinates::NotFinite)) {
        if let Ok(sewn) = clean(&soup, &with(NonManifold::Merge), &mut NoControl) {
            let surface = sewn.mesh.surface();
            let own = Topology::unwelded(&surface);
            let counts = Topology::new(&surface).counts();
            // Where positions give an edge with two consistently wound faces, indices do too.
            let by_place = Topology::new(&surface);
            for h in by_place.edges() {
                let Some(g) = by_place.twin(h).filter(|&g| by_place.origin(g) != by_place.origin(h)) else { continue };
                prop_assert_eq!(own.twin(h), Some(g), "{:?}", counts);
            }
        }
    }
}
