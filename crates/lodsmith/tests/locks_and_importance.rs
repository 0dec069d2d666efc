//! Locked vertices and importance.

use std::collections::HashSet;

use lodsmith::core::{
    Attribute, Positions, RegionId, Semantic, Topology, TriMesh, VertexId, WedgeId, shapes,
};
use lodsmith::{
    BorderPolicy, Input, Length, MethodKind, NoControl, Part, Placement, Refusal, SimplifyError,
    SimplifyOptions, Stop, StoppedBy, simplify, simplify_scene, simplify_with,
};

use crate::support::{CaseFilter, Complaints, bits, complaints, topology_complaints};

/// Returns one entry for each vertex.
fn of_vertices<T>(mesh: &TriMesh, of: impl Fn([f64; 3]) -> T) -> Vec<T> {
    mesh.positions().view().iter().map(of).collect()
}

/// A mesh with all kinds of attributes on its wedges: a seam where x changes sign, random values, normals
/// that are not quite of unit length.
fn with_random_attributes(mesh: &TriMesh) -> TriMesh {
    let surface = mesh.surface();
    let positions = surface.positions();
    let count = mesh.vertex_count() as u32;
    let side = |t: &[VertexId; 3]| t.iter().map(|&v| positions.get(v)[0]).sum::<f64>() > 0.0;
    let wedge = |t: &[VertexId; 3]| t.map(|v| WedgeId(v.0 + if side(t) { count } else { 0 }));
    let triangles = surface.triangles().iter().map(wedge).collect();
    let vertex_of = (0..2 * count).map(|w| VertexId(w % count)).collect();
    let mut result = TriMesh::with_wedges(mesh.positions().clone(), vertex_of, triangles).unwrap();
    // Pseudo-random numbers from 0 to 1.
    let chance = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / (1u32 << 24) as f32;
    let all = 0..2 * count;
    let normals = all.clone().map(|w| [0.6 + 1e-4 * chance(w), 0.8, -0.0]).collect();
    result.set_normals(Some(normals)).unwrap();
    result.set_uvs(Some(all.clone().map(|w| [chance(w), (w / count) as f32]).collect())).unwrap();
    result.set_colors(Some(all.clone().map(|w| [chance(w + 7), 0.5, 1.0, 1.0]).collect())).unwrap();
    let mut add = |semantic, width, values| {
        result.add_attribute(Attribute { semantic, width, values }).unwrap();
    };
    add(Semantic::Joints(0), 4, all.clone().flat_map(|w| [5.0, 3.0, (w % 2) as f32, 0.0]).collect());
    let weights = |w| [0.25 * chance(w), 0.5, 0.25 * chance(w + 1), 0.0];
    add(Semantic::Weights(0), 4, all.clone().flat_map(weights).collect());
    add(Semantic::Custom("_HEAT".to_owned()), 1, all.map(|w| 1e6 * chance(w)).collect());
    lodsmith::core::mesh::compact::compact(&result).mesh
}

/// Returns all attributes of a corner, as bits.
fn corner(mesh: &TriMesh, w: WedgeId) -> Vec<u64> {
    let mut all = bits(mesh.positions().view().get(mesh.vertex_of(w))).to_vec();
    let mut floats = |x: &[f32]| all.extend(x.iter().map(|x| u64::from(x.to_bits())));
    mesh.normals().inspect(|n| floats(&n[w.index()]));
    mesh.uvs().inspect(|n| floats(&n[w.index()]));
    mesh.colors().inspect(|n| floats(&n[w.index()]));
    let mut further: Vec<_> = mesh.further_attributes().iter().collect();
    further.sort_by_key(|a| a.semantic.clone());
    further.iter().for_each(|a| floats(a.of(w)));
    all
}

type Face = [Vec<u64>; 3];

/// Returns a face with all attributes of its corners, the lowest corner first.
fn face(mesh: &TriMesh, t: &[WedgeId; 3]) -> Face {
    let mut corners = t.map(|w| corner(mesh, w));
    let least = (0..3).min_by_key(|&k| corners[k].clone()).unwrap();
    corners.rotate_left(least);
    corners
}

/// Returns what is wrong with the locked part of a result.
fn touched(mesh: &TriMesh, locked: &[bool], result: &TriMesh) -> Vec<String> {
    let of = |m: &TriMesh| m.triangles().iter().map(|t| face(m, t)).collect::<Vec<_>>();
    let left: HashSet<Face> = of(result).into_iter().collect();
    let is_locked = |t: &&[WedgeId; 3]| t.iter().all(|&w| locked[mesh.vertex_of(w).index()]);
    let gone = mesh.triangles().iter().filter(is_locked).filter(|t| !left.contains(&face(mesh, t))).count();
    let corners = |m: &TriMesh, taken: &dyn Fn(WedgeId) -> bool| {
        let wedges = m.triangles().iter().flatten().filter(|w| taken(**w));
        wedges.map(|&w| corner(m, w)).collect::<HashSet<_>>()
    };
    let wanted = corners(mesh, &|w| locked[mesh.vertex_of(w).index()]);
    let places: HashSet<&[u64]> = wanted.iter().map(|c| &c[..3]).collect();
    let is =
        corners(result, &|_| true).into_iter().filter(|c| places.contains(&c[..3])).collect::<HashSet<_>>();
    let mut found = Vec::new();
    if gone > 0 {
        found.push(format!("{gone} locked faces are gone"));
    }
    // One of two wedges with equal values is enough; a face between them may have been the last to use the
    // other.
    if let Some(changed) = is.difference(&wanted).next() {
        let vertex = wanted.iter().find(|c| c[..3] == changed[..3]);
        found.push(format!("a corner of a locked vertex has other values: {changed:?} for {vertex:?}"));
    }
    let missing = places.len() - is.iter().map(|c| &c[..3]).collect::<HashSet<_>>().len();
    if missing > 0 {
        found.push(format!("{missing} locked vertices are gone"));
    }
    found
}

#[test]
fn locked_vertices_and_faces_keep_their_bits() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(5);
    for (name, plain) in shapes::all() {
        for mesh in [with_random_attributes(&plain), plain] {
            // Everything above a plane, and some single vertices.
            let level = mesh.positions().view().bounds().map_or(0.0, |b| 0.6 * b.max[1] + 0.4 * b.min[1]);
            for (kind, locked) in [
                ("above", of_vertices(&mesh, |p| p[1] > level)),
                ("every seventh vertex", (0..mesh.vertex_count()).map(|i| i % 7 == 0).collect()),
            ] {
                for method in [MethodKind::Memoryless, MethodKind::Quadric] {
                    for placement in [Placement::Optimal, Placement::Endpoint, Placement::Midpoint] {
                        if !cases.takes() {
                            continue;
                        }
                        let mut options = SimplifyOptions::new(Stop::ratio(0.1));
                        (options.method, options.placement) = (method.into(), placement);
                        let input = Input::new(&mesh).locked(&locked);
                        let done = simplify_with(input, &options, &mut NoControl).unwrap();
                        let kind_of_mesh = if mesh.has_attributes() { "attributed" } else { "plain" };
                        let case = format!("{kind_of_mesh} {name}, {kind}, {method:?}, {placement:?}");
                        // Endpoint placement drops the other attributes; then positions and faces are
                        // compared with the plain mesh.
                        let bare = |m: &TriMesh| {
                            TriMesh::new(m.positions().clone(), m.surface().triangles().to_vec()).unwrap()
                        };
                        // Of duplicate locked faces, one remains.
                        if name != "doubled_sheet" && name != "soup" {
                            if placement == Placement::Endpoint {
                                all.add(&case, touched(&bare(&mesh), &locked, &bare(&done.mesh)));
                            } else {
                                all.add(&case, touched(&mesh, &locked, &done.mesh));
                            }
                        }
                        all.add(&case, topology_complaints(&mesh, &options, &done));
                        all.add(&case, complaints(&mesh, &options, &done));
                    }
                }
            }
        }
    }
    all.report_all();
}

#[test]
fn the_locked_area_and_the_rest_stay_one_surface() {
    let mesh = shapes::blob(4, 2);
    let locked = of_vertices(&mesh, |p| p[2] > 0.2);
    let input = Input::new(&mesh).locked(&locked);
    let done = simplify_with(input, &SimplifyOptions::new(Stop::faces(10)), &mut NoControl).unwrap();
    let all = |t: &&[WedgeId; 3]| t.iter().all(|w| locked[w.index()]);
    let locked_faces = mesh.triangles().iter().filter(all).count();
    assert_eq!(done.report.locked_faces, locked_faces);
    assert_eq!(done.report.locked_vertices, locked.iter().filter(|l| **l).count());
    assert_eq!(done.report.stopped_by, StoppedBy::Refusals);
    assert!(!done.report.reached && done.report.refusals.iter().any(|r| r.0 == Refusal::Locked));
    // Little more remains than the locked area and the faces at its rim.
    assert!(done.report.faces < locked_faces + locked_faces / 5, "{} of {locked_faces}", done.report.faces);
    let counts = Topology::new(&done.mesh.surface()).counts();
    assert_eq!((counts.border_edge_count, counts.non_manifold_edge_count), (0, 0));
    assert_eq!(touched(&mesh, &locked, &done.mesh), Vec::<String>::new());
}

#[test]
fn parts_with_a_locked_vertex_are_never_removed() {
    let mesh = shapes::tetrahedra(40);
    let locked: Vec<bool> = (0..mesh.vertex_count()).map(|i| i < 4 || i == 9).collect();
    let input = Input::new(&mesh).locked(&locked);
    let done = simplify_with(input, &SimplifyOptions::new(Stop::faces(8)), &mut NoControl).unwrap();
    assert!(done.report.reached && done.report.faces == 8, "{}", done.report.faces);
    assert_eq!(touched(&mesh, &locked, &done.mesh), Vec::<String>::new());
    assert_eq!((done.report.locked_vertices, done.report.locked_faces), (5, 4));
}

#[test]
fn a_weld_moves_no_locked_vertex() {
    // Two sheets with a gap between them that the weld closes.
    let left = shapes::wavy_sheet(12);
    let bounds = left.positions().view().bounds().unwrap();
    let mut points: Vec<[f64; 3]> = left.positions().view().iter().collect();
    let count = points.len() as u32;
    let gap = 1e-4;
    points.extend(left.positions().view().iter().map(|p| [2.0 * bounds.max[0] + gap - p[0], p[1], p[2]]));
    let faces = left.surface().triangles().to_vec();
    let right = faces.iter().map(|t| [t[0], t[2], t[1]].map(|v| VertexId(v.0 + count)));
    let both = faces.iter().copied().chain(right).collect();
    let mesh = TriMesh::new(Positions::F64(points), both).unwrap();
    let locked: Vec<bool> = (0..2 * count).map(|v| v >= count).collect();
    let mut options = SimplifyOptions::new(Stop::ratio(0.6));
    options.weld = Some(Length::Units(2.0 * gap));
    options.border = BorderPolicy::Free;
    let done = simplify_with(Input::new(&mesh).locked(&locked), &options, &mut NoControl).unwrap();
    assert_eq!(touched(&mesh, &locked, &done.mesh), Vec::<String>::new());
    assert_eq!(Topology::new(&done.mesh.surface()).counts().component_count, 1);
}

#[test]
fn a_weld_keeps_attributes() {
    // Two sheets that touch, each with vertices and colours of its own: a ramp over both.
    let left = shapes::grid(8);
    let bounds = left.positions().view().bounds().unwrap();
    let mut points: Vec<[f64; 3]> = left.positions().view().iter().collect();
    let count = points.len() as u32;
    points.extend(left.positions().view().iter().map(|p| [p[0] + bounds.max[0] - bounds.min[0], p[1], p[2]]));
    let faces = left.surface().triangles().to_vec();
    let right = faces.iter().map(|t| t.map(|v| VertexId(v.0 + count)));
    let ramp: Vec<[f32; 4]> = points.iter().map(|p| [0.25 + 0.1 * p[0] as f32, 0.0, 0.0, 1.0]).collect();
    let mut mesh =
        TriMesh::new(Positions::F64(points), faces.iter().copied().chain(right).collect()).unwrap();
    mesh.set_colors(Some(ramp)).unwrap();
    let mut options = SimplifyOptions::new(Stop::ratio(1.0));
    options.weld = Some(Length::Units(1e-5));
    let got = simplify(&mesh, &options).unwrap().mesh;
    for (p, c) in got
        .triangles()
        .iter()
        .flatten()
        .map(|&w| (got.positions().view().get(got.vertex_of(w)), got.colors().unwrap()[w.index()]))
    {
        assert!((c[0] - 0.25 - 0.1 * p[0] as f32).abs() < 1e-6, "{c:?} at {p:?}");
    }
}

#[test]
fn locked_vertices_of_a_scene_are_unchanged() {
    let a = with_random_attributes(&shapes::blob(3, 1));
    let mut b = with_random_attributes(&shapes::torus(24, 16));
    b.map_positions(|p| [0.001 * p[0], 1e-9 * p[1], p[2]]);
    let regions = (0..b.face_count()).map(|f| RegionId::new(f % 2)).collect();
    b.set_regions(Some(regions)).unwrap();
    let lock = |m: &TriMesh| -> Vec<bool> { of_vertices(m, |p| p[2] > 0.1) };
    let (of_a, of_b) = (lock(&a), lock(&b));
    let options = SimplifyOptions::new(Stop::ratio(0.3));
    let mut parts = [Part { scale: 0.37, ..Part::new(&a) }, Part { scale: 3.3, ..Part::new(&b) }];
    parts[0].data.locked = Some(&of_a);
    parts[1].data.locked = Some(&of_b);
    let got = simplify_scene(&parts, 3.0, &options, &mut NoControl).unwrap();
    for (name, mesh, locked, result) in [("a", &a, &of_a, &got.meshes[0]), ("b", &b, &of_b, &got.meshes[1])] {
        assert_eq!(touched(mesh, locked, result), Vec::<String>::new(), "{name}");
    }
    assert!(got.meshes[0].face_count() < a.face_count());
}

/// Returns the triangles per area above and below the plane z = 0.
fn densities(mesh: &TriMesh) -> [f64; 2] {
    let (mut faces, mut area) = ([0f64; 2], [0f64; 2]);
    for t in mesh.surface().triangles() {
        let [a, b, c] = t.map(|v| place(mesh, v));
        let n = cross(minus(b, a), minus(c, a));
        let side = usize::from(a[2] + b[2] + c[2] < 0.0);
        faces[side] += 1.0;
        area[side] += 0.5 * n.iter().map(|x| x * x).sum::<f64>().sqrt();
    }
    [faces[0] / area[0], faces[1] / area[1]]
}

fn place(mesh: &TriMesh, v: VertexId) -> [f64; 3] {
    mesh.positions().view().get(v)
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[test]
fn importance_is_relative_density() {
    let mesh = shapes::icosphere(5);
    for method in [MethodKind::Memoryless, MethodKind::Quadric] {
        for wanted in [0.25f32, 1.0, 2.0, 4.0] {
            for ratio in [0.25, 0.05] {
                let mut options = SimplifyOptions::new(Stop::ratio(ratio));
                options.method = method.into();
                let importance = of_vertices(&mesh, |p| if p[2] > 0.0 { wanted } else { 1.0 });
                let input = Input::new(&mesh).importance(&importance);
                let done = simplify_with(input, &options, &mut NoControl).unwrap();
                assert!(done.report.reached);
                let [above, below] = densities(&done.mesh);
                let got = above / below / f64::from(wanted);
                assert!((0.7..1.4).contains(&got), "{method:?} to {ratio}: {got:.2} of {wanted}");
            }
        }
    }
}

#[test]
fn equal_importance_changes_nothing() {
    let mesh = shapes::blob(3, 5);
    let options = SimplifyOptions::new(Stop::ratio(0.2));
    let plain = simplify(&mesh, &options).unwrap();
    for all in [1.0, 7.5] {
        let importance = of_vertices(&mesh, |_| all);
        let input = Input::new(&mesh).importance(&importance);
        assert_eq!(simplify_with(input, &options, &mut NoControl).unwrap(), plain);
    }
}

#[test]
fn lists_have_one_entry_for_each_vertex() {
    let mesh = shapes::cube(2);
    let options = SimplifyOptions::new(Stop::ratio(0.5));
    let run = |input: Input<'_>| simplify_with(input, &options, &mut NoControl);
    let wanted = mesh.vertex_count();
    let wrong = |option| Err(SimplifyError::WrongLength { option, wanted, got: 1 });
    assert_eq!(run(Input::new(&mesh).locked(&[true])), wrong("locked"));
    assert_eq!(run(Input::new(&mesh).importance(&[1.0])), wrong("importance"));
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let got = run(Input::new(&mesh).importance(&of_vertices(&mesh, |_| bad)));
        assert!(matches!(got, Err(SimplifyError::BadOption { option: "importance", .. })), "{got:?}");
    }
}
