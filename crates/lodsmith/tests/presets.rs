//! Presets and the options that they set.

use lodsmith::core::measure::{CompareOptions, Comparison, compare};
use lodsmith::core::{TriMesh, shapes};
use lodsmith::{
    BorderPolicy, Fit, NoControl, Preset, SimplifyError, SimplifyOptions, Stop, TopologyPolicy, simplify,
    simplify_with,
};

fn run(mesh: &TriMesh, options: &SimplifyOptions) -> TriMesh {
    simplify(mesh, options).unwrap().mesh
}

fn apart(reference: &TriMesh, candidate: &TriMesh) -> Comparison {
    compare(&reference.surface(), &candidate.surface(), &CompareOptions::default()).unwrap()
}

#[test]
fn presets_set_the_documented_options() {
    let stop = Stop::ratio(0.1);
    let of = |preset| SimplifyOptions::preset(preset, stop);
    assert_eq!(of(Preset::Auto), SimplifyOptions::new(stop));
    assert_eq!(of(Preset::default()), SimplifyOptions::new(stop));
    assert!(of(Preset::Scan).weights.normal == 0.0 && of(Preset::Scan).weld.is_some());
    assert_eq!(of(Preset::Cad).border, BorderPolicy::Slide);
    assert_eq!(of(Preset::Cad).topology, TopologyPolicy::Preserve);
    assert!(of(Preset::Visual).shape_normals && of(Preset::Visual).weights.normal > 1.0);
    assert_eq!(of(Preset::Print).topology, TopologyPolicy::Preserve);
    assert_eq!(of(Preset::Print).weights.color, 0.0);
    for preset in [Preset::Scan, Preset::Cad, Preset::Visual, Preset::Print] {
        assert_eq!(of(preset).stop, stop);
    }
}

#[test]
fn shape_normals_count_and_are_not_kept() {
    let mesh = shapes::blob(5, 4);
    let stop = Stop::ratio(0.05);
    let plain = run(&mesh, &SimplifyOptions::new(stop));
    let options = SimplifyOptions::preset(Preset::Visual, stop);
    let shaded = run(&mesh, &options);
    assert!(!shaded.has_attributes() && shaded.vertex_map().is_none());
    assert!(shaded.face_count() <= 1024 && shaded != plain);
    let of_surface = simplify_with(mesh.surface(), &options, &mut NoControl).unwrap().mesh;
    assert_eq!(of_surface, shaded, "buffers and meshes give the same result");
    let (near, plain) = (apart(&mesh, &shaded), apart(&mesh, &plain));
    assert!(near.rms.symmetric < 2.0 * plain.rms.symmetric);

    // The mesh keeps its own normals.
    let mut own = mesh.clone();
    own.set_normals(Some(vec![[0.0, 0.0, 1.0]; mesh.wedge_count()])).unwrap();
    let got = run(&own, &options);
    assert!(got.normals().is_some_and(|n| n.iter().all(|n| *n == [0.0, 0.0, 1.0])));

    // Other attributes and the vertex map are kept.
    let mut colored = mesh.clone();
    let heights = mesh.positions().view().iter().map(|p| [0.5 + 0.1 * p[2] as f32, 0.0, 0.0, 1.0]).collect();
    colored.set_colors(Some(heights)).unwrap();
    let got = run(&colored, &options);
    assert!(got.normals().is_none() && got.colors().is_some());
}

#[test]
fn borders_count_by_their_weight() {
    let mesh = shapes::wavy_sheet(24);
    // Total distance by which the sides of the square recede.
    let off = |weight: f64| {
        let mut options = SimplifyOptions::new(Stop::ratio(0.1));
        options.weights.border = weight;
        // (The fit has its own weight for borders.)
        options.fit = Fit::Off;
        let got = run(&mesh, &options).positions().view().bounds().unwrap();
        let is = mesh.positions().view().bounds().unwrap();
        (0..2).map(|k| (got.min[k] - is.min[k]).abs() + (got.max[k] - is.max[k]).abs()).sum::<f64>()
    };
    let (firm, usual, loose) = (off(100.0), off(1.0), off(0.001));
    assert!(firm < usual && 2.0 * usual < loose, "{firm} {usual} {loose}");
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let mut options = SimplifyOptions::new(Stop::ratio(0.1));
        options.weights.border = bad;
        let got = simplify(&mesh, &options);
        assert!(matches!(got, Err(SimplifyError::BadOption { option: "weight", .. })), "{got:?}");
    }
}
