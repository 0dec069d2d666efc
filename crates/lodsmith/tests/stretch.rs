//! Meshes that the scene stretches, and small meshes together with large ones.

use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::core::mesh::normals::vertex_normals;
use lodsmith::core::{Attribute, Morphed, Semantic, TriMesh, shapes};
use lodsmith::{
    Length, Measure, NoControl, Part, SimplifiedScene, SimplifyOptions, Starved, Stop, simplify_scene,
};

/// A shear and scales that differ by axis.
const STRETCH: [[f64; 3]; 3] = [[12.0, 3.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5]];

fn map([x, y, z]: [f64; 3]) -> [f64; 3] {
    STRETCH.map(|row| row[0] * x + row[1] * y + row[2] * z)
}

fn part(mesh: &TriMesh, stretch: Option<[[f64; 3]; 3]>) -> Part<'_> {
    let scale = if stretch.is_some() { 12.5 } else { 1.0 };
    Part { scale, stretch, ..Part::new(mesh) }
}

fn diagonal(mesh: &TriMesh) -> f64 {
    mesh.positions().view().bounds().unwrap().diagonal()
}

fn run(part: Part<'_>, diagonal: f64, options: &SimplifyOptions) -> SimplifiedScene {
    simplify_scene(&[part], diagonal, options, &mut NoControl).unwrap()
}

/// Every length was multiplied by the largest factor of any axis, so an error limit kept nearly all faces.
#[test]
fn a_stretched_part_is_simplified_like_the_stretched_mesh() {
    let own = shapes::blob(5, 3);
    let mut baked = own.clone();
    baked.map_positions(map);
    let size = diagonal(&baked);
    for stop in [Stop::error(Length::OfDiagonal(0.002)), Stop::ratio(0.1)] {
        let mut options = SimplifyOptions::new(stop);
        options.measure = Measure::Always;
        let of_part = run(part(&own, Some(STRETCH)), size, &options);
        let of_baked = run(part(&baked, None), size, &options);
        let [a, b] = [&of_part, &of_baked].map(|done| done.report.faces);
        // (Runs to an error use fixed levels, and the baked mesh is rounded.)
        assert!(a.abs_diff(b) * 5 <= b, "{a} and {b}");
        let mut result = of_part.meshes[0].clone();
        result.map_positions(map);
        let seen = compare(&baked.surface(), &result.surface(), &CompareOptions::default()).unwrap();
        let reported = of_part.report.error.measured.unwrap();
        let near = |reported: f64, seen: f64| (reported - seen).abs() <= 0.1 * seen;
        assert!(near(reported.rms.symmetric, seen.rms.symmetric), "{reported:?} for {seen:?}");
        assert!(near(reported.hausdorff.symmetric, seen.hausdorff.symmetric), "{reported:?} for {seen:?}");
    }
}

/// Values are converted back to the coordinates of the part.
#[test]
fn directions_and_displacements_of_a_stretched_part_are_restored() {
    let mut own = shapes::blob(4, 3);
    let normals = vertex_normals(&own.surface(), |v| v);
    own.set_normals(Some(normals.clone())).unwrap();
    let tangents = normals.iter().flat_map(|n| {
        let t = glam::Vec3::from(*n).any_orthonormal_vector();
        [t.x, t.y, t.z, -1.0]
    });
    own.add_attribute(Attribute { semantic: Semantic::Tangent, width: 4, values: tangents.collect() })
        .unwrap();
    let semantic = Semantic::Morph { target: 0, of: Morphed::Position };
    let values = own.positions().view().iter().flat_map(|p| p.map(|x| x as f32)).collect();
    own.add_attribute(Attribute { semantic, width: 3, values }).unwrap();
    let mut options = SimplifyOptions::new(Stop::ratio(0.5));
    // The result has vertices of the input with values of the input.
    options.placement = lodsmith::Placement::Endpoint;
    let mut baked = own.clone();
    baked.map_positions(map);
    let done = run(part(&own, Some(STRETCH)), diagonal(&baked), &options);
    let got = &done.meshes[0];
    assert!(done.report.reached);
    let view = got.positions().view();
    for w in 0..got.wedge_count() {
        let v = got.vertex_of(lodsmith::core::WedgeId::new(w));
        let p = view.get(v);
        let source = own.positions().view().iter().position(|q| (0..3).all(|k| (q[k] - p[k]).abs() < 1e-6));
        let source = source.expect("each vertex is a vertex of the input");
        let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(near(&got.normals().unwrap()[w], &normals[source]), "normal {w}");
        for (a, b) in got.further_attributes().iter().zip(own.further_attributes()) {
            let [w, source] = [w, source].map(lodsmith::core::WedgeId::new);
            assert!(
                near(a.of(w), b.of(source)),
                "{:?} of {w:?}: {:?} for {:?}",
                a.semantic,
                a.of(w),
                b.of(source)
            );
        }
    }
}

/// A map without an inverse is ignored; the largest scale is used.
#[test]
fn a_stretch_that_flattens_counts_as_its_largest_scale() {
    let own = shapes::blob(4, 1);
    let options = SimplifyOptions::new(Stop::ratio(0.3));
    let flat = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.0]];
    let of = |stretch| run(Part { scale: 2.0, ..part(&own, stretch) }, 4.0, &options);
    assert_eq!(of(Some(flat)).meshes, of(None).meshes);
}

/// Small meshes in a scene with a large one became tetrahedra, and the report did not say so.
#[test]
fn small_meshes_that_lose_their_shape_are_counted() {
    let (ground, prop, tile) = (shapes::wavy_sheet(64), shapes::blob(4, 1), shapes::grid(16));
    let small = |mesh, scale| Part { instances: 2, scale, ..Part::new(mesh) };
    let parts = [part(&ground, None), small(&prop, 1e-3), small(&prop, 2e-3), small(&tile, 1e-3)];
    let count = |options: &SimplifyOptions| {
        let done = simplify_scene(&parts, diagonal(&ground), options, &mut NoControl).unwrap();
        (done.counts.iter().map(|c| c.is_starved).collect::<Vec<_>>(), Starved::of(&done.counts))
    };
    let mut options = SimplifyOptions::new(Stop::ratio(0.2));
    // A flat tile keeps its shape when it loses faces.
    let (which, all) = count(&options);
    assert_eq!(which, [false, true, true, false]);
    let all = all.unwrap();
    assert_eq!((all.all, all.meshes, all.input_faces), (4, 2, 2 * prop.face_count()));
    let text = all.to_string();
    assert!(text.starts_with("2 of 4 meshes are small in the scene"), "{text}");
    options.per_mesh = true;
    assert_eq!(count(&options).1, None);
    options = SimplifyOptions::new(Stop::error(Length::OfDiagonal(0.01)));
    assert_eq!(count(&options).1, None);
}
