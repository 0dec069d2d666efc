//! Guarantees of every method, in one table, checked on every shape.

mod control;
mod own_options;

use std::collections::HashSet;

use lodsmith::core::arbitrary::{Coordinates, perturbed_shape, soup};
use lodsmith::core::mesh::defects::defects;
use lodsmith::core::topology::EdgeKind;
use lodsmith::core::{Positions, Topology, TriMesh, VertexId, shapes};
use lodsmith::{
    BorderPolicy, Control, Fit, Guards, Input, Length, MethodKind, Placement, Simplified, SimplifyError,
    SimplifyOptions, Stage, Stop, StoppedBy, TopologyPolicy, Verdict, simplify,
};
use proptest::prelude::*;

use crate::support::{
    CaseFilter, Complaints, Random, attributed, bits, bytes, complaints, counts, options_text, places, run,
    size,
};

/// Defects of a mesh that are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Count {
    BorderEdges,
    NonManifoldEdges,
    NonManifoldVertices,
    /// Edges whose faces are wound in opposite directions; an edge of four faces can become one.
    MisorientedOrNonManifoldEdges,
    /// Faces on the same three positions as another, with opposite winding.
    FacesBackToBack,
    ZeroAreaFaces,
    /// Edges at which two faces lie back to back or nearly, on shapes that have none of these: flipped faces.
    Folds,
}

impl Count {
    const ALL: [Self; 7] = [
        Self::BorderEdges,
        Self::NonManifoldEdges,
        Self::NonManifoldVertices,
        Self::MisorientedOrNonManifoldEdges,
        Self::FacesBackToBack,
        Self::ZeroAreaFaces,
        Self::Folds,
    ];
}

/// Guarantees of one method in addition to those of all methods.
struct Promise {
    method: MethodKind,
    /// Counts that the method raises by design, with the default topology; the documentation says so.
    may_rise: &'static [Count],
    /// True if its vertices are vertices of the input with their attributes, valid or not.
    is_subset: bool,
    /// True if it always reaches its target on clean shapes; otherwise it removes only what its rule permits.
    goes_all_the_way: bool,
}

/// In the order of [`MethodKind::ALL`].
const PROMISES: [Promise; 10] = [
    Promise { method: MethodKind::Memoryless, may_rise: &[], is_subset: false, goes_all_the_way: true },
    Promise { method: MethodKind::Quadric, may_rise: &[], is_subset: false, goes_all_the_way: true },
    Promise { method: MethodKind::LindstromTurk, may_rise: &[], is_subset: false, goes_all_the_way: true },
    Promise { method: MethodKind::Melax, may_rise: &[], is_subset: true, goes_all_the_way: true },
    Promise { method: MethodKind::ShortestEdge, may_rise: &[], is_subset: false, goes_all_the_way: true },
    // All vertices in a cell are merged: separate sheets touch, and faces between them vanish.
    Promise {
        method: MethodKind::Cluster,
        may_rise: &[
            Count::BorderEdges,
            Count::NonManifoldEdges,
            Count::NonManifoldVertices,
            Count::MisorientedOrNonManifoldEdges,
            Count::FacesBackToBack,
            Count::ZeroAreaFaces,
            Count::Folds,
        ],
        is_subset: false,
        goes_all_the_way: true,
    },
    Promise { method: MethodKind::VertexRemoval, may_rise: &[], is_subset: true, goes_all_the_way: true },
    Promise { method: MethodKind::Planar, may_rise: &[], is_subset: true, goes_all_the_way: false },
    Promise { method: MethodKind::Unsubdivide, may_rise: &[], is_subset: true, goes_all_the_way: false },
    // Borders are remeshed with edges of the new length; a tube hardly wider than an edge can fold.
    Promise {
        method: MethodKind::Remesh,
        may_rise: &[Count::BorderEdges, Count::Folds],
        is_subset: false,
        goes_all_the_way: true,
    },
];

const TOPOLOGIES: [TopologyPolicy; 3] =
    [TopologyPolicy::Relaxed, TopologyPolicy::Preserve, TopologyPolicy::Free];

/// Counts to stop at: half, a tenth, out of reach, vertices, a ratio, already met, several, none.
fn stops(mesh: &TriMesh) -> Vec<Stop> {
    let (faces, vertices) = (mesh.face_count(), mesh.vertex_count());
    vec![
        Stop::faces((faces / 2).max(1)),
        Stop::faces((faces / 10).max(1)),
        Stop::faces(1),
        Stop::faces(0),
        Stop::vertices(vertices / 3),
        Stop::ratio(0.25),
        Stop::faces(faces),
        Stop { faces: Some(faces / 4), vertices: Some(vertices / 2), ratio: Some(0.3), error: None },
        Stop::default(),
    ]
}

fn options(method: MethodKind, stop: Stop) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(stop);
    options.method = method.into();
    options
}

/// Returns true if an error says that the method does not have this option, and names methods that do.
fn is_refusal(error: &SimplifyError, method: MethodKind) -> bool {
    match error {
        SimplifyError::NotOfMethod { takers, method: of, .. } => {
            *of == method && !takers.contains(&method) && !takers.is_empty()
        }
        // A length that would leave nothing, or more than the input has.
        SimplifyError::BadOption { option, .. } => {
            ["cell", "edge-length", "voxel", "subdivisions"].contains(option)
        }
        _ => false,
    }
}

/// Runs and checks all guarantees. `None` if the method refuses an option that it does not have, or a
/// guarantee is broken.
fn tried<'a>(
    all: &mut Complaints,
    name: &str,
    input: impl Into<Input<'a>>,
    promise: &Promise,
    options: &SimplifyOptions,
) -> Option<Simplified> {
    let input = input.into();
    let mesh = input.mesh().unwrap();
    let case = case(name, options);
    match run(&input, options) {
        Ok(Ok(done)) => {
            all.add(&case, complaints(mesh, options, &done));
            all.add(&case, defect_complaints(mesh, options, promise, &done));
            if promise.is_subset && options.weld.is_none() {
                let strange = places(&done.mesh).difference(&places(mesh)).count();
                all.check(&case, strange == 0, &format!("{strange} vertices are not from the input"));
            }
            Some(done)
        }
        Ok(Err(error)) if is_refusal(&error, promise.method) => None,
        Ok(Err(error)) => {
            all.add(&case, [format!("fails: {error}")]);
            None
        }
        Err(panic) => {
            all.add(&case, [panic]);
            None
        }
    }
}

fn case(name: &str, options: &SimplifyOptions) -> String {
    format!("{name}, {:?}: {}", options.method, options_text(options))
}

/// Returns the counts that rose and should not have.
fn defect_complaints(
    mesh: &TriMesh,
    options: &SimplifyOptions,
    promise: &Promise,
    done: &Simplified,
) -> Vec<String> {
    let mut found = Vec::new();
    let new = defects(&done.mesh.surface());
    let flat = new.degenerate_face_count;
    found.extend((flat > 0).then(|| format!("{flat} faces with two corners at one position")));
    let twice = new.same_winding_duplicate_count;
    found.extend((twice > 0).then(|| format!("{twice} duplicate faces, by position")));
    if options.topology == TopologyPolicy::Free {
        return found;
    }
    for count in Count::ALL.into_iter().filter(|c| !promise.may_rise.contains(c) && *c != Count::Folds) {
        let [was, is] = [mesh, &done.mesh].map(|m| number(m, count));
        found.extend((is > was).then(|| format!("{count:?}: {was} became {is}")));
    }
    if options.topology == TopologyPolicy::Preserve {
        let (old, new) = (counts(mesh), counts(&done.mesh));
        let mut stays = |what: &str, old: i64, new: i64| {
            found.extend((old != new).then(|| format!("{what}: {old} became {new}")));
        };
        stays("parts", old.component_count as i64, new.component_count as i64);
        if old.is_manifold() {
            stays("Euler number", old.euler(), new.euler());
            stays("border loops", old.border_loop_count as i64, new.border_loop_count as i64);
        }
    }
    found
}

fn number(mesh: &TriMesh, count: Count) -> usize {
    let topology = || counts(mesh);
    match count {
        Count::BorderEdges => topology().border_edge_count,
        Count::NonManifoldEdges => topology().non_manifold_edge_count,
        Count::NonManifoldVertices => topology().non_manifold_vertex_count,
        Count::MisorientedOrNonManifoldEdges => {
            topology().misoriented_edge_count + topology().non_manifold_edge_count
        }
        Count::FacesBackToBack => defects(&mesh.surface()).opposite_duplicate_count,
        Count::ZeroAreaFaces => defects(&mesh.surface()).zero_area_face_count,
        Count::Folds => folds(mesh),
    }
}

/// Returns the number of edges whose two faces differ by more than 150 degrees.
fn folds(mesh: &TriMesh) -> usize {
    let surface = mesh.surface();
    let topology = Topology::new(&surface);
    let normal = |f: lodsmith::core::FaceId| {
        let [a, b, c] = surface.triangles()[f.index()].map(|v| surface.positions().get(v));
        let to = |p: [f64; 3]| [0, 1, 2].map(|k| p[k] - a[k]);
        let (u, v) = (to(b), to(c));
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    };
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let inner = topology.edges().filter(|&h| topology.kind(h) == Some(EdgeKind::Inner));
    let is_fold = |(a, b): &([f64; 3], [f64; 3])| {
        dot(*a, *b) < 150f64.to_radians().cos() * (dot(*a, *a) * dot(*b, *b)).sqrt()
    };
    let pairs = inner.filter_map(|h| Some((normal(h.face()), normal(topology.twin(h)?.face()))));
    pairs.filter(is_fold).count()
}

#[test]
fn each_method_has_its_row() {
    assert_eq!(PROMISES.map(|p| p.method), MethodKind::ALL);
    let names: HashSet<&str> = MethodKind::ALL.iter().map(|m| m.name()).collect();
    assert_eq!(names.len(), MethodKind::ALL.len(), "each method has its own name");
}

#[test]
fn every_shape_to_every_count() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(4);
    for promise in PROMISES.iter() {
        for (name, mesh) in shapes::all() {
            for stop in stops(&mesh) {
                for topology in TOPOLOGIES {
                    if !cases.takes() {
                        continue;
                    }
                    let mut options = options(promise.method, stop);
                    options.topology = topology;
                    let done = tried(&mut all, name, &mesh, promise, &options);
                    let is_default = topology == TopologyPolicy::default();
                    let is_accepted = done.is_some() || !is_default;
                    all.check(&case(name, &options), is_accepted, "the default topology is refused");
                }
            }
        }
    }
    all.report_all();
}

/// Shapes with randomly moved vertices, and soups.
fn any_mesh() -> impl Strategy<Value = TriMesh> {
    prop_oneof![
        1 => perturbed_shape(0.0),
        2 => perturbed_shape(0.02),
        2 => perturbed_shape(0.5),
        1 => soup(40, Coordinates::Tame),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(size(64, 16)) })]

    #[test]
    fn any_mesh_to_any_count_by_any_method(
        mesh in any_mesh(), ratio in 0.02..1.0f64, topology in 0..TOPOLOGIES.len(),
    ) {
        let is_empty = run(&mesh, &SimplifyOptions::default());
        prop_assume!(!matches!(is_empty, Ok(Err(SimplifyError::NoFaces { .. }))));
        let mut all = Complaints::default();
        for promise in PROMISES.iter() {
            let mut options = options(promise.method, Stop::ratio(ratio));
            options.topology = TOPOLOGIES[topology];
            tried(&mut all, "any mesh", &mesh, promise, &options);
        }
        all.report_all();
    }
}

/// A search measures many times, so each method takes every third shape, and each shape is used by some
/// method.
#[test]
fn every_shape_within_an_error() {
    let mut all = Complaints::default();
    for (i, promise) in PROMISES.iter().enumerate() {
        for (name, mesh) in shapes::all().into_iter().skip(i % 3).step_by(3) {
            let options = options(promise.method, Stop::error(Length::OfDiagonal(0.01)));
            let Some(done) = tried(&mut all, name, &mesh, promise, &options) else { continue };
            let by = done.report.stopped_by;
            let text = format!(
                "the result is within the error, but the report says that the stop was not reached: {by:?}"
            );
            all.check(&case(name, &options), done.report.reached, &text);
        }
    }
    all.report_all();
}

#[test]
fn an_error_of_zero_and_a_count_together() {
    let mut all = Complaints::default();
    for promise in PROMISES.iter() {
        let cases = [
            ("fine_cube", shapes::cube(6), Length::OfDiagonal(0.0)),
            ("blob", shapes::blob(3, 2), Length::OfDiagonal(0.2)),
        ];
        for (name, mesh, error) in cases {
            let stop = Stop { faces: Some(60), error: Some(error), ..Stop::default() };
            let options = options(promise.method, stop);
            let Some(done) = tried(&mut all, name, &mesh, promise, &options) else { continue };
            let faces = done.mesh.face_count();
            // With a generous error the count stops the run.
            let is_count_first = promise.goes_all_the_way && name == "blob";
            let text = format!("{faces} faces by {:?}", done.report.stopped_by);
            all.check(&case(name, &options), !is_count_first || faces <= 60, &text);
        }
    }
    all.report_all();
}

#[test]
fn clean_shapes_reach_the_target_without_folds() {
    let mut all = Complaints::default();
    for promise in PROMISES.iter() {
        for name in ["fine_cube", "icosphere", "blob", "torus", "grid", "wavy_sheet", "cylinder"] {
            let mesh =
                shapes::all().into_iter().find(|s| s.0 == name).expect("there is a shape of this name").1;
            for ratio in [0.5, 0.2] {
                let options = options(promise.method, Stop::ratio(ratio));
                let Some(done) = tried(&mut all, name, &mesh, promise, &options) else { continue };
                let case = case(name, &options);
                let (faces, report) = (done.mesh.face_count(), &done.report);
                if promise.goes_all_the_way {
                    let why = format!("{faces} faces, {:?}: {:?}", report.stopped_by, report.refusals);
                    all.check(&case, report.reached, &why);
                    // A result far below the target would waste quality.
                    let enough = 0.5 * ratio * mesh.face_count() as f64;
                    all.check(&case, faces as f64 >= enough, &format!("{faces} faces, far below the target"));
                }
                if !promise.may_rise.contains(&Count::Folds) {
                    let [was, is] = [&mesh, &done.mesh].map(|m| number(m, Count::Folds));
                    all.check(&case, is <= was, &format!("{was} folds became {is}"));
                }
            }
        }
    }
    all.report_all();
}

/// Returns the name under which the report lists a dropped attribute.
fn title(name: &str) -> &str {
    let known = [
        ("normals", "normals"),
        ("uvs", "uvs"),
        ("colours", "colors"),
        ("Tangent", "tangents"),
        ("Uv", "further texture coordinates"),
        ("Color", "further colours"),
        ("Joints", "joints"),
        ("Weights", "weights"),
        ("Morph", "morph targets"),
        ("Custom", "custom attribute"),
    ];
    known.into_iter().find(|(start, _)| name.starts_with(start)).map_or(name, |(_, title)| title)
}

#[test]
fn attributes_are_kept_or_reported() {
    let mut all = Complaints::default();
    for promise in PROMISES.iter() {
        let mut random = Random(11);
        for (name, plain) in shapes::all() {
            for round in 0..4 {
                let mesh = attributed::with_random_attributes(&plain, &mut random);
                let stop =
                    random.pick(&[Stop::ratio(0.5), Stop::ratio(0.1), Stop::faces(4), Stop::default()]);
                let options = options(promise.method, stop);
                let name = format!("{name} {round}");
                let Some(done) = tried(&mut all, &name, &mesh, promise, &options) else { continue };
                all.add(&case(&name, &options), attribute_complaints(&mesh, promise, &done));
            }
        }
    }
    all.report_all();
}

fn attribute_complaints(mesh: &TriMesh, promise: &Promise, done: &Simplified) -> Vec<String> {
    let mut found = Vec::new();
    let (old, new) = (attributed::kinds(mesh), attributed::kinds(&done.mesh));
    let is_in = |all: &[(String, usize, Vec<f32>)], kind: &(String, usize, Vec<f32>)| {
        all.iter().any(|k| (&k.0, k.1) == (&kind.0, kind.1))
    };
    for kind in old.iter().filter(|k| !is_in(&new, k)) {
        if !done.report.dropped.contains(&title(&kind.0)) {
            found.push(format!("{} are gone, and the report drops {:?}", kind.0, done.report.dropped));
        }
    }
    for kind in new.iter().filter(|k| !is_in(&old, k)) {
        found.push(format!("{} are new", kind.0));
    }
    for (name, width, values) in &new {
        let wanted = width * done.mesh.wedge_count();
        if values.len() != wanted {
            found.push(format!("{} values of {name}, {wanted} wanted", values.len()));
        }
        let own = old.iter().find(|k| k.0 == *name).map(|k| &k.2);
        let was_finite = own.is_some_and(|v| v.iter().all(|x| x.is_finite()));
        // Named values that are missing in the input are missing in the result.
        let may_miss = !was_finite && name.starts_with("Custom");
        // A vertex of the input keeps its attributes, valid or not.
        let keeps_some = promise.is_subset || promise.method == MethodKind::Remesh;
        if (was_finite || !keeps_some)
            && let Some(i) = values.iter().position(|x| !(x.is_finite() || x.is_nan() && may_miss))
        {
            found.push(format!("{name} of wedge {} are {}", i / width, values[i]));
        }
    }
    let used: HashSet<_> = done.mesh.triangles().iter().flatten().collect();
    if used.len() != done.mesh.wedge_count() {
        found.push(format!("{} of {} wedges are used", used.len(), done.mesh.wedge_count()));
    }
    match (mesh.regions(), done.mesh.regions()) {
        (Some(was), Some(is)) => {
            let known: HashSet<_> = was.iter().collect();
            if let Some(strange) = is.iter().find(|r| !known.contains(r)) {
                found.push(format!("{strange:?} is not a region of the input"));
            }
        }
        (Some(_), None) if !done.report.dropped.contains(&"regions") => {
            found.push("regions are gone, and the report does not say so".to_owned());
        }
        (None, Some(_)) => found.push("regions are new".to_owned()),
        _ => {}
    }
    found
}

/// In double precision, on a grid so coarse that translations and doublings are exact.
fn gridded(mesh: &TriMesh, scale: f64, shift: [f64; 3]) -> TriMesh {
    const FINE: f64 = (1u32 << 20) as f64;
    let place = |p: [f64; 3]| [0, 1, 2].map(|k| ((p[k] * FINE).round() / FINE + shift[k]) * scale);
    let places = mesh.positions().view().iter().map(place).collect();
    TriMesh::new(Positions::F64(places), mesh.surface().triangles().to_vec()).expect("the same faces")
}

#[test]
fn size_and_place_have_no_effect() {
    let mut all = Complaints::default();
    let far = [f64::from(1u32 << 20), -f64::from(1u32 << 22), f64::from(1u32 << 18)];
    let cases = [
        ("tiny", 2f64.powi(-60), [0.0; 3]),
        ("huge", 2f64.powi(60), [0.0; 3]),
        // About 1e-30 and 1e30.
        ("extremely small", 2f64.powi(-100), [0.0; 3]),
        ("extremely large", 2f64.powi(100), [0.0; 3]),
        ("far from the origin", 1.0, far),
        ("tiny and far from the origin", 2f64.powi(-50), far),
    ];
    for promise in PROMISES.iter() {
        for (name, mesh) in shapes::all() {
            let options = options(promise.method, Stop::ratio(0.3));
            let plain = gridded(&mesh, 1.0, [0.0; 3]);
            let Ok(near) = simplify(&plain, &options) else {
                all.add(&case(name, &options), ["fails".to_owned()]);
                continue;
            };
            for (how, scale, shift) in cases {
                let case = format!("{}, {how}", case(name, &options));
                let moved = gridded(&mesh, scale, shift);
                let Ok(done) = simplify(&moved, &options) else {
                    all.add(&case, ["fails".to_owned()]);
                    continue;
                };
                let same = done.mesh.triangles() == near.mesh.triangles();
                let [a, b] = [&near, &done].map(|d| d.mesh.face_count());
                all.check(&case, same, &format!("other faces: {b} for {a}"));
                if !same {
                    continue;
                }
                let pairs = near.mesh.positions().view();
                let pairs = pairs.iter().zip(done.mesh.positions().view().iter().collect::<Vec<_>>());
                let off = |(p, q): ([f64; 3], [f64; 3])| {
                    [0, 1, 2].map(|k| (q[k] / scale - shift[k] - p[k]).abs()).into_iter().fold(0.0, f64::max)
                };
                let worst = pairs.map(off).fold(0.0, f64::max);
                let limit = 1e-7 * near.report.error.diagonal;
                all.check(&case, worst <= limit, &format!("a vertex {worst} off"));
                let ratio = done.report.error.estimate / (scale * near.report.error.estimate);
                let is_scaled = near.report.error.estimate == 0.0 || (ratio - 1.0).abs() < 1e-3;
                all.check(&case, is_scaled, &format!("an estimate {ratio} times as large"));
            }
        }
    }
    all.report_all();
}

#[test]
fn meshes_without_area_are_errors() {
    let mut all = Complaints::default();
    let mesh = |places: Vec<[f64; 3]>, faces: &[[u32; 3]]| {
        let faces = faces.iter().map(|t| t.map(VertexId)).collect();
        TriMesh::new(Positions::F64(places), faces).expect("indices are in range")
    };
    let nan = f64::NAN;
    let cases = [
        ("no vertex", mesh(Vec::new(), &[])),
        ("no face", mesh(vec![[0.0; 3], [1.0; 3]], &[])),
        ("one position", mesh(vec![[1.0; 3]; 3], &[[0, 1, 2]])),
        ("a line", mesh(vec![[0.0; 3], [1.0; 3], [2.0; 3]], &[[0, 1, 2], [2, 1, 0]])),
        ("NaN", mesh(vec![[nan; 3], [1.0, nan, 0.0], [2.0, 0.0, nan]], &[[0, 1, 2]])),
        ("infinities", mesh(vec![[f64::INFINITY; 3], [1.0, 0.0, 0.0], [2.0, 1.0, 0.0]], &[[0, 1, 2]])),
    ];
    for promise in PROMISES.iter() {
        for (name, mesh) in &cases {
            for stop in [Stop::faces(1), Stop::error(Length::OfDiagonal(0.1)), Stop::default()] {
                let options = options(promise.method, stop);
                let case = case(name, &options);
                match run(mesh, &options) {
                    Ok(Err(SimplifyError::NoFaces { faces })) if faces == mesh.face_count() => {}
                    other => all.add(&case, [format!("{:?}", other.map(|r| r.map(|d| d.report)))]),
                }
            }
        }
    }
    all.report_all();
}

/// Broken faces among sound ones are left out, and the rest is simplified.
#[test]
fn broken_faces_among_sound_ones_are_left_out() {
    let mut all = Complaints::default();
    for promise in PROMISES.iter() {
        let sound = shapes::icosphere(2);
        let mut places: Vec<[f64; 3]> = sound.positions().view().iter().collect();
        let mut faces = sound.surface().triangles().to_vec();
        let v = |i: usize| VertexId::new(i);
        places.extend([[f64::NAN; 3], [f64::INFINITY, 0.0, 0.0], [9.0; 3]]);
        let n = places.len();
        faces.extend([[v(0), v(1), v(n - 3)], [v(n - 2), v(3), v(4)], [v(5), v(5), v(6)]]);
        faces.extend(faces[..3].to_vec());
        let mesh = TriMesh::new(Positions::F64(places), faces).expect("indices are in range");
        for stop in [Stop::ratio(0.5), Stop::faces(20), Stop::error(Length::OfDiagonal(0.02))] {
            let options = options(promise.method, stop);
            let Some(done) = tried(&mut all, "a broken sphere", &mesh, promise, &options) else { continue };
            let case = case("a broken sphere", &options);
            let c = &done.report.cleanup;
            let is_counted = (c.non_finite_faces, c.degenerate_faces) == (2, 1);
            all.check(&case, is_counted, &format!("repaired: {c:?}"));
            let closed = counts(&done.mesh).is_closed() || promise.may_rise.contains(&Count::BorderEdges);
            all.check(&case, closed, "a closed surface was opened");
        }
    }
    all.report_all();
}
