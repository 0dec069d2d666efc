//! Transfer of data that is not part of the mesh from the original to the result.

use lodsmith::core::{Source, TriMesh, VertexId, WedgeId, correspondence, shapes};
use lodsmith::{Fit, Length, MethodKind, Placement, SimplifyOptions, Stop, simplify};

use crate::support::charts::{place, two_charts, wedges};

#[test]
fn sources_are_on_the_side_of_their_wedge_even_after_the_fit() {
    let mesh = two_charts(24);
    let is_right = |w: WedgeId| mesh.uvs().unwrap()[w.index()][0] > 5.0;
    for ratio in [0.5, 0.2, 0.05] {
        let done = simplify(&mesh, &SimplifyOptions::new(Stop::ratio(ratio))).unwrap();
        assert!(done.report.fitted);
        let found = correspondence(&mesh, &done.mesh).unwrap();
        for w in wedges(&done.mesh) {
            let uv = done.mesh.uvs().unwrap()[w.index()];
            let sides = found.blend(w).unwrap().map(|part| is_right(part.0));
            assert_eq!(sides, [uv[0] > 5.0; 3], "{ratio}: {w} has {uv:?}");
        }
    }
}

#[test]
fn transferred_attributes_match_those_of_the_run() {
    let mut mesh = shapes::icosphere(5);
    let normals: Vec<[f32; 3]> = mesh.positions().view().iter().map(|p| p.map(|x| x as f32)).collect();
    let flat = normals.as_flattened().to_vec();
    mesh.set_normals(Some(normals)).unwrap();
    for (ratio, most_deg) in [(0.5, 1.5), (0.1, 4.0)] {
        let got = simplify(&mesh, &SimplifyOptions::new(Stop::ratio(ratio))).unwrap().mesh;
        let carried = correspondence(&mesh, &got).unwrap().transfer(&flat, 3).unwrap();
        for (own, from) in got.normals().unwrap().iter().zip(carried.as_chunks::<3>().0) {
            let dot: f32 = own.iter().zip(from).map(|(a, b)| a * b).sum();
            let length = from.iter().map(|x| x * x).sum::<f32>().sqrt();
            assert!((dot / length).clamp(-1.0, 1.0).acos().to_degrees() < most_deg, "{own:?} {from:?}");
        }
    }
}

#[test]
fn kept_vertices_have_the_ids_of_the_input() {
    // Every face has its own vertices, and some are merged first: although the run renumbers them, the
    // correspondence holds.
    let smooth = shapes::blob(3, 2);
    let surface = smooth.surface();
    let corners: Vec<[f64; 3]> =
        surface.triangles().iter().flatten().map(|&v| surface.positions().get(v)).collect();
    let triangles = (0..corners.len() as u32 / 3).map(|f| [0, 1, 2].map(|k| VertexId(3 * f + k))).collect();
    let soup = TriMesh::new(lodsmith::core::Positions::F64(corners), triangles).unwrap();
    for method in [MethodKind::Memoryless, MethodKind::Quadric] {
        let mut options = SimplifyOptions::new(Stop::ratio(0.3));
        options.method = method.into();
        options.placement = Placement::Endpoint;
        options.fit = Fit::Off;
        options.weld = Some(Length::OfDiagonal(1e-9));
        let got = simplify(&soup, &options).unwrap().mesh;
        for (w, source) in wedges(&got).zip(correspondence(&soup, &got).unwrap().sources()) {
            let Source::Wedge(from) = *source else { panic!("{w} is not kept: {source:?}") };
            assert_eq!(place(&got, w), place(&soup, from));
        }
    }
}
