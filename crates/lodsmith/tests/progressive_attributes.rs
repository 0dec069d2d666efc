//! Attributes at the levels of a progressive mesh: as close as in single runs, and equal at all wedges of a
//! vertex if they displace it.

use lodsmith::core::measure::{CompareOptions, compare_attributes};
use lodsmith::core::{Attribute, Morphed, Semantic, TriMesh, WedgeId, shapes};
use lodsmith::{NoControl, Progressive, SimplifyOptions, Stop, simplify};

use crate::support::charts::{place, two_charts, wedges};

fn built(mesh: &TriMesh) -> Progressive {
    Progressive::build(mesh, &SimplifyOptions::default(), &mut NoControl).unwrap()
}

/// Returns the RMS difference of texture coordinates.
fn off(mesh: &TriMesh, other: &TriMesh) -> f64 {
    compare_attributes(mesh, other, &CompareOptions::default()).unwrap().uvs.unwrap().rms.symmetric
}

#[test]
fn values_of_levels_are_as_close_as_in_single_runs() {
    let mut mesh = shapes::blob(5, 3);
    let bent = |p: [f64; 3]| [(2.0 * p[0]).sin() as f32, (p[1] * p[2]) as f32];
    let uvs = wedges(&mesh).map(|w| bent(place(&mesh, w))).collect();
    mesh.set_uvs(Some(uvs)).unwrap();
    let mut progressive = built(&mesh);
    for share in [0.5, 0.2, 0.1, 0.03] {
        let goal = (mesh.face_count() as f64 * share) as usize;
        progressive.to_faces(goal);
        let single = simplify(&mesh, &SimplifyOptions::new(Stop::faces(goal))).unwrap().mesh;
        let [one, plain, fitted] =
            [single, progressive.mesh().unwrap(), progressive.fitted_mesh().unwrap()].map(|m| off(&mesh, &m));
        assert!(fitted <= 1.08 * one, "{share}: {fitted} for {one}");
        assert!(fitted < 0.98 * plain, "{share}: {fitted} with the fit, {plain} without");
    }
    progressive.to_level(progressive.top());
    assert_eq!(progressive.fitted_mesh().unwrap(), mesh);
}

/// Returns the number of wedges whose values differ from the values of the first wedge of their vertex.
fn apart(mesh: &TriMesh, semantic: &Semantic) -> usize {
    let found = mesh.further_attributes().iter().find(|a| a.semantic == *semantic).unwrap();
    let mut first: Vec<Option<WedgeId>> = vec![None; mesh.vertex_count()];
    let mut is_used = vec![false; mesh.wedge_count()];
    mesh.triangles().iter().flatten().for_each(|w| is_used[w.index()] = true);
    let other = |w: &WedgeId| {
        let v = mesh.vertex_of(*w);
        found.of(*w) != found.of(*first[v.index()].get_or_insert(*w))
    };
    wedges(mesh).filter(|w| is_used[w.index()]).filter(other).count()
}

#[test]
fn no_level_tears_at_a_seam_when_displaced() {
    let wave = |p: [f64; 3]| (0.5 + 0.5 * (9.0 * p[0] + 5.0 * p[1]).sin()) as f32;
    let morph = Semantic::Morph { target: 0, of: Morphed::Position };
    let mut mesh = two_charts(24);
    let values: Vec<f32> = wedges(&mesh).map(|w| wave(place(&mesh, w))).collect();
    let joints = values.iter().flat_map(|_| [0.0, 1.0, 2.0, 0.0]).collect();
    let weights = values.iter().flat_map(|x| [0.7 * x, 1.0 - x, 0.3 * x, 0.0]).collect();
    let moved = values.iter().flat_map(|x| [x * x, 0.0, -x]).collect();
    for (semantic, width, values) in
        [(Semantic::Joints(0), 4, joints), (Semantic::Weights(0), 4, weights), (morph.clone(), 3, moved)]
    {
        mesh.add_attribute(Attribute { semantic, width, values }).unwrap();
    }
    let mut progressive = built(&mesh);
    let mut seams = 0;
    while progressive.level() > 0 {
        progressive.coarsen(1 + progressive.level() / 40);
        for level in [
            progressive.mesh().unwrap(),
            progressive.fitted_mesh().unwrap(),
            progressive.fitted_buffers().unwrap(),
        ] {
            seams += level.wedge_count() - level.vertex_count();
            for semantic in [&Semantic::Joints(0), &Semantic::Weights(0), &morph] {
                assert_eq!(
                    apart(&level, semantic),
                    0,
                    "level {} of {}: {semantic:?}",
                    progressive.level(),
                    progressive.top()
                );
            }
        }
    }
    assert!(seams > 1000, "there are wedges on seams");
    progressive.to_level(progressive.top());
    assert_eq!(progressive.mesh().unwrap(), mesh);
}

#[test]
fn a_mesh_without_values_may_have_normals_in_the_cost() {
    // The engine computes its normals. (Found by fuzzing: this panicked.)
    let mesh = shapes::blob(3, 1);
    let mut options = SimplifyOptions::default();
    options.shape_normals = true;
    options.weights.normal = 1.0;
    let mut progressive = Progressive::build(&mesh, &options, &mut NoControl).unwrap();
    assert_eq!(progressive.mesh().unwrap(), mesh);
    progressive.to_faces(mesh.face_count() / 4);
    let level = progressive.fitted_mesh().unwrap();
    assert!(level.normals().is_none() && level.face_count() <= mesh.face_count() / 4);
}
