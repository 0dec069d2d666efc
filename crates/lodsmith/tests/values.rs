//! Attribute values stay valid: within the range of their source, and identifiers unchanged.

use std::collections::BTreeSet;

use lodsmith::core::{Attribute, IntegerType, Morphed, Semantic, TriMesh, WedgeId, shapes};
use lodsmith::{
    Input, Length, Levels, LodOptions, Method, MethodKind, NoControl, Part, Placement, Progressive, Remesh,
    SimplifyOptions, Stop, lod, simplify, simplify_scene, simplify_with,
};

use crate::support::charts::{place, two_charts, wedges};

/// Values that reach the limits of their range in many places, as turning points.
fn waves(mesh: &TriMesh, width: usize, low: f32, high: f32) -> Vec<f32> {
    let wave = |w: WedgeId, k: usize| {
        let p = place(mesh, w);
        let x = (7.0 * p[k % 3] + 4.0 * p[(k + 1) % 3] + k as f64).sin();
        low + (high - low) * (0.5 + 0.6 * x).clamp(0.0, 1.0) as f32
    };
    wedges(mesh).flat_map(|w| (0..width).map(move |k| (w, k))).map(|(w, k)| wave(w, k)).collect()
}

/// Returns the mesh with attributes in this range.
fn waved(mut mesh: TriMesh, low: f32, high: f32) -> TriMesh {
    let uvs = waves(&mesh, 2, low, high).as_chunks().0.to_vec();
    let colors = waves(&mesh, 4, 0.0, 1.0).as_chunks().0.to_vec();
    let further = [
        (Semantic::Uv(1), 2),
        (Semantic::Color(1), 4),
        (Semantic::Custom("_HEAT".to_owned()), 3),
        (Semantic::Morph { target: 0, of: Morphed::Position }, 3),
    ];
    for (semantic, width) in further {
        let values = waves(&mesh, width, low, high);
        mesh.add_attribute(Attribute { semantic, width, values }).unwrap();
    }
    mesh.set_uvs(Some(uvs)).unwrap();
    mesh.set_colors(Some(colors)).unwrap();
    mesh
}

/// Returns the minimum and the maximum of each value.
fn ranges(mesh: &TriMesh) -> Vec<(String, [f32; 2])> {
    let mut all: Vec<(String, usize, Vec<f32>)> = vec![
        ("uvs".to_owned(), 2, mesh.uvs().unwrap().as_flattened().to_vec()),
        ("colors".to_owned(), 4, mesh.colors().unwrap().as_flattened().to_vec()),
    ];
    let further = mesh.further_attributes().iter();
    all.extend(further.map(|a| (format!("{:?}", a.semantic), a.width, a.values.clone())));
    let range = |values: &[f32], width: usize, k: usize| {
        let of = || values.iter().skip(k).step_by(width).copied();
        [of().fold(f32::INFINITY, f32::min), of().fold(f32::NEG_INFINITY, f32::max)]
    };
    let mut ranges = Vec::new();
    for (name, width, values) in &all {
        ranges.extend((0..*width).map(|k| (format!("{name} {k}"), range(values, *width, k))));
    }
    ranges.sort_by(|a, b| a.0.cmp(&b.0));
    ranges
}

fn assert_within(what: &str, source: &TriMesh, got: &TriMesh) {
    for ((name, wide), (_, own)) in ranges(source).into_iter().zip(ranges(got)) {
        assert!(wide[0] <= own[0] && own[1] <= wide[1], "{what}: {name} is {own:?}, was {wide:?}");
    }
}

fn options(method: MethodKind) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(Stop::ratio(0.2));
    options.method = method.into();
    if let Method::Remesh(Remesh::OnSurface { edge_length, .. }) = &mut options.method {
        options.stop = Stop::default();
        *edge_length = Some(Length::Units(0.2));
    }
    options
}

/// Regression: texture coordinates in 0 to 1 became -0.0002 and 1.0009, colours -6e-5.
#[test]
fn no_value_leaves_the_range_of_its_source() {
    let mesh = waved(shapes::blob(4, 3), 0.0, 1.0);
    for method in [MethodKind::Memoryless, MethodKind::Quadric, MethodKind::Cluster, MethodKind::Remesh] {
        let got = simplify(&mesh, &options(method)).unwrap().mesh;
        assert!(got.face_count() > 50);
        assert_within(&format!("{method:?}"), &mesh, &got);
    }
}

/// Each mesh has its own range, not the range of all meshes with one budget.
#[test]
fn no_value_of_a_scene_leaves_the_range_of_its_mesh() {
    let (a, b) = (waved(shapes::blob(4, 3), 0.0, 1.0), waved(shapes::torus(48, 24), -20.0, 30.0));
    let part = |mesh| Part::new(mesh);
    let options = SimplifyOptions::new(Stop::ratio(0.2));
    let got = simplify_scene(&[part(&a), part(&b)], 4.0, &options, &mut NoControl).unwrap();
    assert_within("the first", &a, &got.meshes[0]);
    assert_within("the second", &b, &got.meshes[1]);
}

#[test]
fn no_value_of_a_level_leaves_the_range_of_the_full_mesh() {
    let mesh = waved(shapes::blob(4, 3), 0.0, 1.0);
    let mut progressive = Progressive::build(&mesh, &SimplifyOptions::default(), &mut NoControl).unwrap();
    for faces in [3000, 1111, 500, 100] {
        progressive.to_faces(faces);
        assert_within("the level", &mesh, &progressive.mesh().unwrap());
        assert_within("its fit", &mesh, &progressive.fitted_mesh().unwrap());
        assert_within("its buffers", &mesh, &progressive.fitted_buffers().unwrap());
    }
}

fn id() -> Semantic {
    Semantic::Discrete { name: "_FEATURE_ID_0".to_owned(), of: IntegerType::U16 }
}

fn ids(mesh: &TriMesh) -> Vec<f32> {
    let own: Vec<_> = mesh.further_attributes().iter().filter(|a| a.semantic == id()).collect();
    assert!(own.len() == 1 && own[0].width == 1);
    own[0].values.clone()
}

/// Ids in bands along x, one for each vertex.
fn banded(mut mesh: TriMesh) -> TriMesh {
    let values =
        wedges(&mesh).map(|w| 7.0 + 1000.0 * (place(&mesh, w)[0] * 3.0).floor().abs() as f32).collect();
    mesh.add_attribute(Attribute { semantic: id(), width: 1, values }).unwrap();
    mesh
}

fn assert_known(what: &str, source: &TriMesh, got: &TriMesh) {
    let known: BTreeSet<u32> = ids(source).into_iter().map(f32::to_bits).collect();
    let other = ids(got).into_iter().find(|x| !known.contains(&x.to_bits()));
    assert_eq!(other, None, "{what}: an id that is not in the source");
    let own: BTreeSet<u32> = ids(got).into_iter().map(f32::to_bits).collect();
    assert!(own.len() > 2, "{what}: {} ids are left", own.len());
}

/// Regression: 16-bit ids became -0.0887 and 2.94.
#[test]
fn ids_come_from_the_source() {
    let plain = banded(shapes::blob(4, 3));
    let mut dressed = waved(shapes::blob(4, 3), 0.0, 1.0);
    dressed.add_attribute(plain.further_attributes()[0].clone()).unwrap();
    for mesh in [&plain, &dressed] {
        for method in [
            MethodKind::Memoryless,
            MethodKind::Quadric,
            MethodKind::LindstromTurk,
            MethodKind::Cluster,
            MethodKind::Remesh,
            MethodKind::VertexRemoval,
            MethodKind::Planar,
        ] {
            let got = simplify(mesh, &options(method)).unwrap();
            assert!(got.report.dropped.is_empty());
            assert_known(&format!("{method:?}"), mesh, &got.mesh);
        }
        for placement in [Placement::Midpoint, Placement::Endpoint] {
            let mut options = options(MethodKind::Memoryless);
            options.placement = placement;
            let got = simplify(mesh, &options).unwrap().mesh;
            assert_known(&format!("{placement:?}"), mesh, &got);
        }
    }
    // Close to the original: a band is .33 wide.
    let got = simplify(&plain, &options(MethodKind::Memoryless)).unwrap().mesh;
    let far = wedges(&got).zip(ids(&got)).filter(|(w, id)| {
        let near = |d: f64| 7.0 + 1000.0 * ((place(&got, *w)[0] + d) * 3.0).floor().abs() as f32;
        ![-0.1, 0.0, 0.1].map(near).contains(id)
    });
    assert!(far.count() * 50 < got.wedge_count());
}

/// A face of a feature has the feature's id at all corners; features share vertices and differ only in their
/// ids.
#[test]
fn faces_belong_to_a_single_feature() {
    let mut mesh = two_charts(24);
    let right: Vec<bool> = mesh.uvs().unwrap().iter().map(|uv| uv[0] > 5.0).collect();
    mesh.set_uvs(None).unwrap();
    let values = right.iter().map(|r| if *r { 3.0 } else { 9.0 }).collect();
    mesh.add_attribute(Attribute { semantic: id(), width: 1, values }).unwrap();
    for method in [MethodKind::Memoryless, MethodKind::Cluster] {
        let got = simplify(&mesh, &options(method)).unwrap().mesh;
        let ids = ids(&got);
        let mut count = [0, 0];
        for t in got.triangles() {
            let [a, b, c] = t.map(|w| ids[w.index()]);
            assert!(a == b && b == c, "{method:?}: a face of {a}, {b} and {c}");
            count[usize::from(a == 3.0)] += 1;
        }
        assert!(count[0] > 10 && count[1] > 10, "{method:?}: {count:?}");
    }
}

#[test]
fn ids_of_scenes_and_levels_come_from_the_source() {
    let (a, b) = (banded(shapes::blob(4, 3)), waved(shapes::torus(48, 24), 0.0, 1.0));
    let part = |mesh| Part::new(mesh);
    let options = SimplifyOptions::new(Stop::ratio(0.2));
    let got = simplify_scene(&[part(&a), part(&b)], 4.0, &options, &mut NoControl).unwrap();
    assert_known("of a scene", &a, &got.meshes[0]);
    assert!(got.meshes[1].further_attributes().iter().all(|a| !a.semantic.is_discrete()));
    let mut dressed = waved(shapes::blob(4, 3), 0.0, 1.0);
    dressed.add_attribute(a.further_attributes()[0].clone()).unwrap();
    for mesh in [a, dressed] {
        let mut progressive = Progressive::build(&mesh, &SimplifyOptions::default(), &mut NoControl).unwrap();
        for faces in [3000, 500, 100] {
            progressive.to_faces(faces);
            assert_known("of a level", &mesh, &progressive.mesh().unwrap());
            assert_known("of a fitted level", &mesh, &progressive.fitted_mesh().unwrap());
        }
        progressive.to_level(progressive.top());
        assert_eq!(progressive.fitted_mesh().unwrap(), mesh);
    }
}

/// A sphere with a named value, its height, which is missing at the vertices `is_gap`; and a second named
/// value without gaps.
fn sphere_with_gaps(is_gap: impl Fn(usize) -> bool) -> TriMesh {
    let mut mesh = shapes::icosphere(4);
    for (name, gaps) in [("height", true), ("width", false)] {
        let value = |w: WedgeId| match gaps && is_gap(w.index()) {
            true => f32::NAN,
            false => place(&mesh, w)[if gaps { 2 } else { 0 }] as f32,
        };
        let values = wedges(&mesh).map(value).collect();
        mesh.add_attribute(Attribute { semantic: Semantic::Custom(name.into()), width: 1, values }).unwrap();
    }
    mesh
}

/// Regression: missing values counted as 0, were blended with their neighbours, and attracted triangles.
#[test]
fn missing_values_stay_missing_and_do_not_count() {
    let (mesh, full) = (sphere_with_gaps(|i| i % 7 == 0), sphere_with_gaps(|_| false));
    let rms = |m: &TriMesh| {
        let found = lodsmith::core::measure::compare(&full.surface(), &m.surface(), &Default::default());
        found.unwrap().rms.symmetric
    };
    for method in MethodKind::ALL {
        let mut options = SimplifyOptions::new(Stop::ratio(0.2));
        options.method = method.into();
        let run = |mesh: &TriMesh| simplify(mesh, &options).unwrap();
        let (done, whole) = (run(&mesh), run(&full));
        let further = done.mesh.further_attributes();
        let names: Vec<_> = further.iter().map(|a| a.semantic.name()).collect();
        assert_eq!(names, [Some("height"), Some("width")], "{method:?}");
        let [heights, widths] = [0, 1].map(|i| &further[i].values);
        assert!(widths.iter().all(|x| x.is_finite()), "{method:?}");
        let gone = heights.iter().filter(|x| x.is_nan()).count();
        assert!(gone > 0 && 5 * gone < 2 * heights.len(), "{method:?}: {gone} of {}", heights.len());
        for w in wedges(&done.mesh).filter(|w| !heights[w.index()].is_nan()) {
            let (got, wanted) = (heights[w.index()], place(&done.mesh, w)[2] as f32);
            assert!((got - wanted).abs() < 0.1, "{method:?}: {got} for {wanted}");
        }
        let (with, without) = (rms(&done.mesh), rms(&whole.mesh));
        assert!(with < 1.2 * without + 1e-9, "{method:?}: {with} for {without}");
    }
}

/// Regression: as above, for scenes and levels, with escalation, and where locked vertices keep their bits.
#[test]
fn missing_values_stay_missing_in_scenes_and_levels() {
    let mesh = sphere_with_gaps(|i| i % 7 == 0);
    let gaps = |m: &TriMesh| m.further_attributes()[0].values.iter().filter(|x| x.is_nan()).count();
    let is_right = |m: &TriMesh| {
        let share = gaps(m) as f64 / m.wedge_count() as f64;
        m.further_attributes().len() == 2 && share > 0.0 && share < 0.4
    };
    let mut options = SimplifyOptions::new(Stop::ratio(0.2));
    let part = Part::new(&mesh);
    let scene = simplify_scene(&[part, part], 2.0, &options, &mut NoControl).unwrap();
    assert!(scene.meshes.iter().all(is_right));
    options.per_mesh = true;
    let scene = simplify_scene(&[part, part], 2.0, &options, &mut NoControl).unwrap();
    assert!(scene.meshes.iter().all(is_right));
    options.per_mesh = false;
    options.escalate = true;
    assert!(is_right(&simplify(&mesh, &options).unwrap().mesh));
    options.escalate = false;
    let chain = lod(&mesh, &LodOptions::new(Levels::Ratios(vec![0.5, 0.2]))).unwrap();
    assert!(chain.levels.iter().all(|level| is_right(&level.mesh)));

    let locked: Vec<bool> = (0..mesh.vertex_count()).map(|v| v % 7 == 0).collect();
    let done = simplify_with(Input::new(&mesh).locked(&locked), &options, &mut NoControl).unwrap();
    assert!(gaps(&done.mesh) >= gaps(&mesh));
}
