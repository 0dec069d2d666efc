//! Guarantees of `remesh` with voxels: closed, manifold, oriented and close to the input, whatever the state
//! of the input.

use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::core::topology::{Topology, size_of};
use lodsmith::core::{Positions, TriMesh, VertexId, arbitrary, shapes};
use lodsmith::{
    Control, Input, Length, Method, NoControl, Remesh, Simplified, SimplifyError, SimplifyOptions, Stop,
    Verdict, simplify, simplify_with,
};
use proptest::prelude::*;

fn options(voxel: Length) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(Stop::default());
    options.method = Method::Remesh(Remesh::Voxels { size: voxel });
    options
}

fn run(mesh: &TriMesh, options: &SimplifyOptions) -> Result<Simplified, SimplifyError> {
    simplify(mesh, options)
}

#[track_caller]
fn assert_closed(mesh: &TriMesh, what: &str) {
    let counts = Topology::unwelded(&mesh.surface()).counts();
    assert!(counts.is_closed() && counts.is_manifold() && counts.is_oriented(), "{what}: {counts:?}");
}

/// Returns the faces in another order, with vertices of their own, some flipped.
fn soup_of(mesh: &TriMesh) -> TriMesh {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    let view = mesh.positions().view();
    for (i, t) in mesh.triangles().iter().enumerate() {
        let first = positions.len() as u32;
        // Slightly moved, so that no positions are equal.
        positions.extend(t.map(|w| view.get(mesh.vertex_of(w)).map(|x| x + 1e-5 * (i % 7) as f64)));
        let [a, b, c] = [first, first + 1, first + 2].map(VertexId);
        faces.push(if i % 3 == 0 { [a, c, b] } else { [a, b, c] });
    }
    TriMesh::new(Positions::F64(positions), faces).unwrap()
}

#[test]
fn every_result_is_closed_and_close() {
    for (name, mesh) in shapes::all() {
        let diagonal = mesh.positions().view().bounds().map_or(0.0, |b| b.diagonal());
        match run(&mesh, &options(Length::OfDiagonal(0.04))) {
            Ok(done) => {
                assert_closed(&done.mesh, name);
                let compared =
                    compare(&mesh.surface(), &done.mesh.surface(), &CompareOptions::default()).unwrap();
                // Parts may be smaller than a voxel, and few faces cannot represent a shape.
                if mesh.face_count() > 500 {
                    assert!(
                        compared.rms.symmetric < 0.04 * 1.74 * diagonal,
                        "{name}: {}",
                        compared.rms.symmetric
                    );
                }
                assert!(done.mesh.face_count() <= mesh.face_count().max(40), "{name}");
            }
            Err(e) => assert!(
                matches!(e, SimplifyError::NoFaces { .. } | SimplifyError::BadOption { .. }),
                "{name}: {e}"
            ),
        }
    }
}

#[test]
fn spheres_keep_their_volume_and_their_soups_are_closed() {
    let sphere = shapes::icosphere(5);
    let voxel = options(Length::Units(0.1));
    let done = run(&sphere, &voxel).unwrap();
    let ball = 4.0 / 3.0 * std::f64::consts::PI;
    let volume = size_of(&done.mesh.surface()).volume;
    assert!((volume / ball - 1.0).abs() < 0.01, "{volume}");
    let soup = soup_of(&sphere);
    let done = run(&soup, &voxel).unwrap();
    assert_closed(&done.mesh, "soup");
    let counts = Topology::unwelded(&done.mesh.surface()).counts();
    assert_eq!((counts.component_count, counts.genus()), (1, Some(0)));
    // Thickened by up to a voxel.
    let volume = size_of(&done.mesh.surface()).volume;
    assert!(volume > 0.99 * ball && volume < 1.1f64.powi(3) * ball, "{volume}");
}

#[test]
fn holes_are_closed_and_sharp_edges_kept() {
    // A fine cube with one face missing in the middle of a side.
    let cube = shapes::cube(16);
    let view = cube.positions().view();
    let faces: Vec<[VertexId; 3]> =
        cube.triangles().iter().skip(1).map(|t| t.map(|w| cube.vertex_of(w))).collect();
    let open = TriMesh::new(Positions::F64(view.iter().collect()), faces).unwrap();
    let done = run(&open, &options(Length::OfDiagonal(0.05))).unwrap();
    assert_closed(&done.mesh, "cube");
    let (side, of) = (size_of(&cube.surface()).volume, size_of(&done.mesh.surface()).volume);
    // Rounded edges would add four times as much.
    assert!((of / side - 1.0).abs() < 0.005, "{of} of {side}");
}

#[test]
fn a_count_is_reached_with_a_closed_surface() {
    let torus = shapes::torus(96, 64);
    let mut voxel = options(Length::OfDiagonal(0.02));
    voxel.stop = Stop::faces(600);
    let done = run(&torus, &voxel).unwrap();
    assert!(done.report.reached && (590..=600).contains(&done.mesh.face_count()), "{:?}", done.report);
    assert_closed(&done.mesh, "torus");
    assert_eq!(Topology::unwelded(&done.mesh.surface()).counts().genus(), Some(1));
}

#[test]
fn the_same_bytes_at_any_number_of_threads() {
    let mesh = soup_of(&shapes::torus(24, 16));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&mesh, &options(Length::OfDiagonal(0.03))).unwrap().mesh)
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn voxels_that_are_too_small_are_an_error_before_memory_runs_out() {
    for mesh in [shapes::icosphere(2), shapes::grid(4)] {
        let got = run(&mesh, &options(Length::OfDiagonal(1e-7)));
        assert!(matches!(got, Err(SimplifyError::BadOption { option: "voxel", .. })), "{got:?}");
    }
}

#[test]
fn unsupported_options_are_errors_and_runs_can_be_cancelled() {
    let sphere = shapes::icosphere(2);
    let locked = vec![true; sphere.vertex_count()];
    let input = Input::new(&sphere).locked(&locked);
    let got = simplify_with(&input, &options(Length::OfDiagonal(0.1)), &mut NoControl);
    assert!(matches!(got, Err(SimplifyError::NotTogether { second: "lock", .. })));
    struct Never(usize);
    impl Control for Never {
        fn progress(&mut self, _: f64) -> Verdict {
            self.0 = self.0.saturating_sub(1);
            if self.0 == 0 { Verdict::Cancel } else { Verdict::Continue }
        }
    }
    for n in 1..6 {
        let got = simplify_with(&sphere, &options(Length::OfDiagonal(0.05)), &mut Never(n));
        assert_eq!(got, Err(SimplifyError::Cancelled), "{n}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_soup_gives_a_closed_result_or_an_error(soup in arbitrary::soup(16, arbitrary::Coordinates::NotFinite)) {
        match run(&soup, &options(Length::OfDiagonal(0.08))) {
            Ok(done) => {
                let counts = Topology::unwelded(&done.mesh.surface()).counts();
                prop_assert!(counts.is_closed() && counts.is_manifold() && counts.is_oriented(), "{counts:?}");
            }
            Err(e) => prop_assert!(
                matches!(e, SimplifyError::NoFaces { .. } | SimplifyError::BadOption { .. }),
                "{e}"
            ),
        }
    }
}
