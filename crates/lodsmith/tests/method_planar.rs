//! Coplanar regions: known counts, guarantees, and regressions.

use std::collections::HashMap;

use lodsmith::core::arbitrary::{Coordinates, perturbed_shape, soup};
use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::core::topology::size_of;
use lodsmith::core::{Positions, RegionId, TriMesh, VertexId, shapes};
use lodsmith::{
    BorderPolicy, Control, Fit, Guards, Input, Length, Method, MethodKind, NoControl, Placement, Simplified,
    SimplifyError, SimplifyOptions, Stop, StoppedBy, TopologyPolicy, Verdict, simplify, simplify_with,
};
use proptest::prelude::*;

use crate::support::attributed::{locked_complaints, with_random_attributes, with_rare_options};
use crate::support::{
    CaseFilter, Complaints, Random, bytes, complaints, counts, options_text, places, run, size,
    topology_complaints,
};

const TOPOLOGIES: [TopologyPolicy; 3] =
    [TopologyPolicy::Relaxed, TopologyPolicy::Preserve, TopologyPolicy::Free];

fn planar(stop: Stop) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(stop);
    options.method = MethodKind::Planar.into();
    options
}

fn merged(mesh: &TriMesh) -> Simplified {
    simplify(mesh, &planar(Stop::default())).unwrap()
}

/// Checks all guarantees for any result.
fn wrongs(mesh: &TriMesh, options: &SimplifyOptions, done: &Simplified) -> Vec<String> {
    let mut found = complaints(mesh, options, done);
    found.extend(topology_complaints(mesh, options, done));
    let known = places(mesh);
    let moved = places(&done.mesh).difference(&known).count();
    found.extend((moved > 0).then(|| format!("{moved} vertices are not from the input")));
    found
}

fn tried<'a>(
    all: &mut Complaints,
    name: &str,
    input: impl Into<Input<'a>>,
    options: &SimplifyOptions,
) -> Option<Simplified> {
    let input = input.into();
    let mesh = input.mesh().unwrap();
    let case = format!("{name}, {}, {:?}", options_text(options), options.method);
    match run(&input, options) {
        Ok(Ok(done)) => {
            all.add(&case, wrongs(mesh, options, &done));
            let again = matches!(run(&input, options), Ok(Ok(a)) if bytes(&a.mesh) == bytes(&done.mesh) && a.report == done.report);
            all.check(&case, again, "a second run gives another result");
            Some(done)
        }
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

#[test]
fn every_shape_and_stop() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(5);
    for (name, mesh) in shapes::all() {
        let (faces, vertices) = (mesh.face_count(), mesh.vertex_count());
        for stop in [
            Stop::default(),
            Stop::faces(1),
            Stop::faces(faces / 2),
            Stop::faces(faces / 10),
            Stop::faces(faces),
            Stop::vertices(vertices / 3),
            Stop::ratio(0.25),
            Stop { faces: Some(faces / 4), vertices: Some(vertices / 2), ratio: Some(0.3), error: None },
        ] {
            for topology in TOPOLOGIES {
                for flat in [None, Some(Length::OfDiagonal(0.0)), Some(Length::OfDiagonal(0.02))] {
                    if !cases.takes() {
                        continue;
                    }
                    let mut options = planar(stop);
                    options.topology = topology;
                    options.method = Method::Planar { flat, angle_deg: flat.map(|_| 25.0) };
                    tried(&mut all, name, &mesh, &options);
                }
            }
        }
    }
    all.report_all();
}

#[test]
fn known_counts() {
    // The numbers of faces and vertices that the outline needs.
    for (name, mesh, wanted) in [
        ("cube", shapes::cube(7), (12, 8)),
        ("grid", shapes::grid(20), (2, 4)),
        ("tube", shapes::cylinder(24, 6), (48, 48)),
        ("tetrahedron", shapes::tetrahedron(), (4, 4)),
        // Every face is a region of its own.
        ("torus", shapes::torus(24, 12), (576, 288)),
        ("sphere", shapes::icosphere(3), (1280, 642)),
    ] {
        let done = merged(&mesh);
        let got = (done.mesh.face_count(), done.mesh.vertex_count());
        // Whether quads of a torus are flat depends on rounding.
        assert_eq!(got, wanted, "{name}");
        assert_eq!(done.report.stopped_by, StoppedBy::Exhausted, "{name}");
        assert!(done.report.reached, "{name}");
    }
}

#[test]
fn a_sheet_with_holes_keeps_each_of_them() {
    let mesh = shapes::grid_with_holes(12);
    let (old, new) = (counts(&mesh), counts(&merged(&mesh).mesh));
    assert_eq!((new.euler(), new.border_loop_count), (old.euler(), old.border_loop_count));
    // An outline with b corners and h holes needs b + 2h - 2 triangles; all corners here are right angles.
    let holes = old.border_loop_count - 1;
    assert_eq!(new.border_edge_count, 4 * (holes + 1));
    assert_eq!(new.face_count, new.border_edge_count + 2 * holes - 2);
}

/// The surface of some unit cubes, each side divided into n by n squares, like a voxel model.
fn voxels(cubes: &[[i32; 3]], n: i32, tilt: bool) -> TriMesh {
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut known: HashMap<[i32; 3], u32> = HashMap::new();
    let mut triangles = Vec::new();
    for cube in cubes {
        for axis in 0..3 {
            for step in [-1, 1] {
                let mut beside = *cube;
                beside[axis] += step;
                if cubes.contains(&beside) {
                    continue;
                }
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let (u, v) = if step > 0 { (u, v) } else { (v, u) };
                for i in 0..n {
                    for j in 0..n {
                        let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| {
                            let mut p = cube.map(|x| x * n);
                            p[axis] += if step > 0 { n } else { 0 };
                            (p[u], p[v]) = (p[u] + i, p[v] + j);
                            *known.entry(p).or_insert_with(|| {
                                let [x, y, z] = p.map(|x| f64::from(x) / f64::from(n));
                                let turned = [
                                    0.36 * x - 0.8 * y + 0.48 * z,
                                    0.48 * x + 0.6 * y + 0.64 * z,
                                    0.6 * z - 0.8 * x,
                                ];
                                points.push(if tilt { turned } else { [x, y, z] });
                                points.len() as u32 - 1
                            })
                        });
                        triangles.extend([[a, b, c], [a, c, d]].map(|t| t.map(VertexId)));
                    }
                }
            }
        }
    }
    TriMesh::new(Positions::F64(points), triangles).unwrap()
}

/// Random cubes connected by their sides.
fn random_cubes(random: &mut Random, count: usize) -> Vec<[i32; 3]> {
    let mut cubes = vec![[0; 3]];
    while cubes.len() < count {
        let mut cube = cubes[random.below(cubes.len() as u64) as usize];
        cube[random.below(3) as usize] += if random.below(2) == 0 { 1 } else { -1 };
        if !cubes.contains(&cube) {
            cubes.push(cube);
        }
    }
    cubes
}

#[test]
fn voxel_models_keep_their_volume_and_area() {
    let mut random = Random(5);
    for round in 0..40 {
        let cubes = random_cubes(&mut random, 1 + round);
        let tilt = round % 2 == 0;
        let fine = voxels(&cubes, 1 + round as i32 % 4, tilt);
        let done = merged(&fine);
        let (old, new) = (counts(&fine), counts(&done.mesh));
        let (a, b) = (size_of(&fine.surface()), size_of(&done.mesh.surface()));
        assert!((a.volume - b.volume).abs() < 1e-9 && (a.area - b.area).abs() < 1e-9, "{a:?} {b:?}");
        assert!((a.volume - cubes.len() as f64).abs() < 1e-9);
        assert_eq!(new.border_edge_count, 0);
        assert_eq!(new.component_count, old.component_count);
        // Cubes may touch along an edge.
        if old.is_manifold() {
            assert!(new.is_closed() && new.is_manifold() && new.is_oriented());
            assert_eq!(new.euler(), old.euler());
        }
        let error = compare(&fine.surface(), &done.mesh.surface(), &CompareOptions::default()).unwrap();
        assert!(error.hausdorff.symmetric < 1e-9, "{}", error.hausdorff.symmetric);
        // The result does not depend on the subdivision, and nothing is left to merge.
        let coarse = merged(&voxels(&cubes, 1, tilt)).mesh.face_count();
        assert_eq!(done.mesh.face_count(), coarse, "{} cubes", cubes.len());
        assert_eq!(merged(&done.mesh).mesh.face_count(), coarse);
    }
}

#[test]
fn a_count_is_met_closely() {
    let mut all = Complaints::default();
    for mesh in [shapes::cube(20), shapes::grid(40), shapes::grid_with_holes(30)] {
        for part in [0.9, 0.5, 0.1, 0.02] {
            let faces = (mesh.face_count() as f64 * part) as usize;
            let Some(done) = tried(&mut all, "flat", &mesh, &planar(Stop::faces(faces))) else { continue };
            assert_eq!(done.report.stopped_by, StoppedBy::Faces);
            let got = done.mesh.face_count();
            // Corners removed from an outline cannot be restored one by one.
            assert!(got + 2 * 160 >= faces && got <= faces, "{got} of {faces}");
            let vertices = mesh.vertex_count() / 2;
            let done = simplify(&mesh, &planar(Stop::vertices(vertices))).unwrap();
            assert!(done.mesh.vertex_count() <= vertices && done.mesh.vertex_count() + 160 >= vertices);
        }
    }
    all.report_all();
    let done = simplify(&shapes::grid(40), &planar(Stop::faces(300))).unwrap();
    assert!((299..=300).contains(&done.mesh.face_count()), "{}", done.mesh.face_count());
}

#[test]
fn targets_out_of_reach_are_reported() {
    let done = simplify(&shapes::cube(5), &planar(Stop::faces(11))).unwrap();
    assert_eq!((done.mesh.face_count(), done.report.reached), (12, false));
    assert_eq!(done.report.stopped_by, StoppedBy::Exhausted);
}

#[test]
fn an_error_bounds_the_distance() {
    let mut all = Complaints::default();
    for mesh in [shapes::wavy_sheet(30), shapes::blob(4, 3)] {
        let mut last = usize::MAX;
        for part in [1e-3, 1e-2] {
            let mut options = planar(Stop::error(Length::OfDiagonal(part)));
            options.method = Method::Planar { angle_deg: Some(40.0), flat: None };
            let Some(done) = tried(&mut all, "curved", &mesh, &options) else { continue };
            let measured = done.report.error.measured.unwrap().hausdorff.symmetric;
            assert!(measured <= part * done.report.error.diagonal);
            assert!(done.mesh.face_count() <= last && done.report.reached);
            last = done.mesh.face_count();
        }
        assert!(last < mesh.face_count() / 2, "{last} of {}", mesh.face_count());
    }
    all.report_all();
}

#[test]
fn neither_angle_nor_distance_drifts_along_a_curve() {
    // A tube of 90 sides, four degrees each: a region may span ten degrees.
    let mesh = shapes::cylinder(90, 10);
    let mut options = planar(Stop::default());
    options.method = Method::Planar { angle_deg: Some(5.0), flat: Some(Length::OfDiagonal(1.0)) };
    let done = simplify(&mesh, &options).unwrap();
    let sides = done.mesh.face_count() / 2;
    assert!((30..=45).contains(&sides), "{sides} sides");
    // A distance limit alone has the same effect.
    options.method = Method::Planar { angle_deg: Some(89.0), flat: Some(Length::Units(1e-3)) };
    let done = simplify(&mesh, &options).unwrap();
    let error = compare(&mesh.surface(), &done.mesh.surface(), &CompareOptions::default()).unwrap();
    assert!(error.hausdorff.symmetric <= 2e-3, "{}", error.hausdorff.symmetric);
    assert!(done.mesh.face_count() < mesh.face_count() / 3);
}

#[test]
fn locked_vertices_and_faces_stay() {
    let mut all = Complaints::default();
    for (name, mesh) in shapes::all() {
        for part in [2, 5, 30] {
            let mut random = Random(part);
            let locked: Vec<bool> = (0..mesh.vertex_count()).map(|_| random.below(part) == 0).collect();
            let input = Input::new(&mesh).locked(&locked);
            if let Some(done) = tried(&mut all, name, &input, &planar(Stop::default())) {
                all.add(name, locked_complaints(&mesh, &locked, (false, false), &done.mesh));
            }
        }
    }
    all.report_all();
    // A vertex in the middle with four triangles.
    let mesh = shapes::grid(6);
    let middle = mesh.positions().view().iter().position(|p| p[0] == 0.5 && p[1] == 0.5).unwrap();
    let locked: Vec<bool> = (0..mesh.vertex_count()).map(|v| v == middle).collect();
    let input = Input::new(&mesh).locked(&locked);
    let done = simplify_with(input, &planar(Stop::default()), &mut NoControl).unwrap();
    assert_eq!(done.mesh.face_count(), 4);
}

#[test]
fn locked_borders_stay() {
    let mesh = shapes::grid_with_holes(12);
    let mut options = planar(Stop::default());
    options.border = BorderPolicy::Lock;
    let done = simplify(&mesh, &options).unwrap();
    assert_eq!(counts(&done.mesh).border_edge_count, counts(&mesh).border_edge_count);
    assert!(done.mesh.face_count() < mesh.face_count());
}

#[test]
fn regions_of_the_input_keep_their_border() {
    // Two halves separated by a zigzag.
    let mut mesh = shapes::grid(8);
    let middle = |t: &[lodsmith::core::WedgeId; 3]| {
        let p = t.map(|w| mesh.positions().view().get(mesh.vertex_of(w)));
        (p.iter().map(|p| p[0]).sum::<f64>(), p.iter().map(|p| p[1]).sum::<f64>())
    };
    let side = |t| {
        let (x, y) = middle(t);
        RegionId(u32::from(x > 1.5 + 0.3 * (y * 8.0).sin()))
    };
    let regions: Vec<RegionId> = mesh.triangles().iter().map(side).collect();
    let first = regions.iter().filter(|r| r.0 == 0).count();
    mesh.set_regions(Some(regions)).unwrap();
    let done = merged(&mesh);
    // The common border has only the corners that it needs; each half keeps its area.
    assert!(first > 0 && done.mesh.face_count() > 4);
    assert!(done.mesh.face_count() < mesh.face_count() / 2);
    assert_eq!(size_of(&done.mesh.surface()).area, 1.0);
}

#[test]
fn nonlinear_textures_are_kept() {
    let flat = |uv: &dyn Fn(f64, f64) -> [f32; 2]| {
        let mut mesh = shapes::grid(16);
        let uvs = mesh.positions().view().iter().map(|p| uv(p[0], p[1])).collect();
        mesh.set_uvs(Some(uvs)).unwrap();
        merged(&mesh).mesh.face_count()
    };
    assert_eq!(flat(&|x, y| [(0.3 * x + 0.9 * y) as f32, (0.2 + x - 0.1 * y) as f32]), 2);
    // Two halves with linear texture coordinates in each.
    assert_eq!(flat(&|x, y| [(x - 0.5).abs() as f32, y as f32]), 4);
    assert_eq!(flat(&|x, y| [(x * x) as f32, (y * y * y) as f32]), 512);
    // Attributes with weight 0 are ignored.
    let mut mesh = shapes::grid(16);
    let colors = mesh.positions().view().iter().map(|p| [(p[0] * p[0]) as f32, 0.0, 0.0, 1.0]).collect();
    mesh.set_colors(Some(colors)).unwrap();
    assert!(merged(&mesh).mesh.face_count() > 16);
    let mut options = planar(Stop::default());
    options.weights.color = 0.0;
    assert_eq!(simplify(&mesh, &options).unwrap().mesh.face_count(), 2);
}

#[test]
fn nonlinear_normals_on_flat_sides_are_kept() {
    // A cube shaded like a sphere: its normals are not linear over a side.
    let mut mesh = shapes::cube(8);
    let outward = |p: [f64; 3]| {
        let length = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
        p.map(|x| (x / length) as f32)
    };
    let normals = mesh.positions().view().iter().map(outward).collect();
    mesh.set_normals(Some(normals)).unwrap();
    assert!(merged(&mesh).mesh.face_count() > 100);
}

#[test]
fn the_sides_of_a_two_sided_sheet_do_not_become_duplicates() {
    for n in [1, 4, 9] {
        let mesh = shapes::doubled_sheet(n);
        let done = merged(&mesh);
        assert_eq!(topology_complaints(&mesh, &planar(Stop::default()), &done), Vec::<String>::new());
    }
}

#[test]
fn duplicate_faces_are_left_out_and_counted() {
    let mesh = shapes::grid(3);
    let mut twice = mesh.surface().triangles().to_vec();
    let again: Vec<[VertexId; 3]> = twice.iter().take(5).map(|&[a, b, c]| [b, c, a]).collect();
    twice.extend(again);
    let mesh = TriMesh::new(mesh.positions().clone(), twice).unwrap();
    for stop in [Stop::default(), Stop::faces(18), Stop::ratio(1.0)] {
        let done = simplify(&mesh, &planar(stop)).unwrap();
        assert_eq!(done.report.cleanup.duplicate_faces, 5);
        assert_eq!(done.mesh.face_count(), if stop == Stop::default() { 2 } else { 18 });
    }
}

#[test]
fn impossible_options_are_errors() {
    let mesh = shapes::cube(2);
    let fails = |change: &dyn Fn(&mut SimplifyOptions)| {
        let mut options = planar(Stop::default());
        change(&mut options);
        matches!(simplify(&mesh, &options), Err(SimplifyError::NotOfMethod { .. }))
    };
    assert!(!fails(&|_| {}));
    assert!(!fails(&|o| o.placement = Placement::Endpoint));
    assert!(!fails(&|o| o.guards.max_normal_deg = Some(1.0)));
    assert!(fails(&|o| o.placement = Placement::Midpoint));
    assert!(fails(&|o| o.fit = Fit::On));
    assert!(fails(&|o| o.guards = Guards { max_valence: Some(8), ..Guards::default() }));
    assert!(fails(&|o| o.guards = Guards { min_quality: Some(0.1), ..Guards::default() }));
    assert!(fails(&|o| o.guards.max_edge = Some(Length::Units(1.0))));
    let importance = vec![1.0; mesh.vertex_count()];
    let input = Input::new(&mesh).importance(&importance);
    let got = simplify_with(input, &planar(Stop::default()), &mut NoControl);
    assert!(matches!(got, Err(SimplifyError::NotOfMethod { option: "importance", .. })));
}

/// A control that gives an answer after a number of calls, and checks that progress never decreases.
struct AnswerAfter(usize, Verdict, f64);

impl Control for AnswerAfter {
    fn stage(&mut self, _: lodsmith::Stage) {
        self.2 = 0.0;
    }
    fn progress(&mut self, done: f64) -> Verdict {
        assert!((self.2..=1.0).contains(&done), "{done} after {}", self.2);
        self.2 = done;
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 { self.1 } else { Verdict::Continue }
    }
}

#[test]
fn a_caller_may_end_a_run_at_any_time() {
    let mesh = shapes::cube(60);
    let options = planar(Stop::default());
    let mut asked = AnswerAfter(usize::MAX, Verdict::Continue, 0.0);
    simplify_with(&mesh, &options, &mut asked).unwrap();
    let questions = usize::MAX - asked.0;
    assert!(questions >= 10, "{questions}");
    for n in 1..=questions {
        let cancelled = simplify_with(&mesh, &options, &mut AnswerAfter(n, Verdict::Cancel, 0.0));
        assert_eq!(cancelled.unwrap_err(), SimplifyError::Cancelled);
    }
    let mut last = usize::MAX;
    for n in [2, 5, 8, questions] {
        let done = simplify_with(&mesh, &options, &mut AnswerAfter(n, Verdict::Finish, 0.0)).unwrap();
        let mut found = wrongs(&mesh, &options, &done);
        found.retain(|w| !w.starts_with("stopped by"));
        assert_eq!(found, Vec::<String>::new());
        let faces = done.mesh.face_count();
        assert!(faces <= last);
        last = faces;
    }
    assert!(last < mesh.face_count());
}

fn any_mesh() -> impl Strategy<Value = TriMesh> {
    let plain = prop_oneof![
        2 => soup(12, Coordinates::Tame),
        3 => soup(80, Coordinates::Tame),
        2 => soup(40, Coordinates::Wild),
        1 => soup(40, Coordinates::NotFinite),
        3 => perturbed_shape(0.0),
        1 => perturbed_shape(1e-7),
        1 => perturbed_shape(0.05),
    ];
    (plain, any::<u64>()).prop_map(|(mesh, seed)| {
        if seed.is_multiple_of(2) { mesh } else { with_random_attributes(&mesh, &mut Random(seed | 1)) }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: size(150, 40), ..ProptestConfig::default() })]

    #[test]
    fn any_mesh_gives_a_sound_result(mesh in any_mesh(), seed in any::<u64>()) {
        let mut random = Random(seed | 1);
        let mut options = planar(random.pick(&[
            Stop::default(),
            Stop::default(),
            Stop::ratio(0.5),
            Stop::vertices(7),
            Stop::faces(1),
        ]));
        options.topology = random.pick(&TOPOLOGIES);
        let (mut options, mut data) = with_rare_options(options, &mut random, mesh.vertex_count());
        data.importance = None;
        let input = Input::new(&mesh).with(data.view());
        options.prune = None;
        let flat = random.pick(&[None, Some(Length::OfDiagonal(0.0)), Some(Length::OfDiagonal(0.1))]);
        options.method = Method::Planar { flat, angle_deg: random.pick(&[None, Some(0.0), Some(40.0), Some(89.0)]) };
        match run(&input, &options) {
            Ok(Ok(done)) => {
                let mut found = complaints(&mesh, &options, &done);
                if options.weld.is_none() {
                    found.extend(topology_complaints(&mesh, &options, &done));
                }
                if let Some(locked) = &data.locked {
                    let welded = true;
                    found.extend(locked_complaints(&mesh, locked, (welded, false), &done.mesh));
                }
                prop_assert!(found.is_empty(), "{}: {found:?}", options_text(&options));
                let again = run(&input, &options);
                prop_assert!(matches!(again, Ok(Ok(a)) if bytes(&a.mesh) == bytes(&done.mesh)));
            }
            Ok(Err(SimplifyError::NoFaces { .. })) => {}
            other => prop_assert!(false, "{}: {other:?}", options_text(&options)),
        }
    }
}

/// Splits each face into four, with midpoints in single precision.
fn subdivided(mesh: &TriMesh) -> TriMesh {
    let view = mesh.positions().view();
    let mut points: Vec<[f32; 3]> = view.iter().map(|p| p.map(|x| x as f32)).collect();
    let (mut middles, mut triangles) = (HashMap::new(), Vec::new());
    for t in mesh.surface().triangles() {
        let m = [0, 1, 2].map(|k| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let (p, q) = (points[a.index()], points[b.index()]);
                points.push([0, 1, 2].map(|i| (0.5 * (f64::from(p[i]) + f64::from(q[i]))) as f32));
                VertexId::new(points.len() - 1)
            })
        });
        triangles.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
    }
    TriMesh::new(Positions::F32(points), triangles).unwrap()
}

/// Fault A17: far from the origin, midpoints in single precision are farther off a plane than the tolerance,
/// which was a share of the size.
#[test]
fn the_tolerance_depends_on_the_precision_of_the_coordinates() {
    let (sin, cos) = 0.4f64.sin_cos();
    for far in [0.0, 4.0, 20.0] {
        // A plate of 8 by 6 by 1, rotated about two axes.
        let place = |p: [f64; 3]| {
            let [x, y, z] = [8.0 * p[0], 6.0 * p[1], p[2]];
            let (x, y) = (cos * x - sin * y, sin * x + cos * y);
            let (y, z) = (cos * y - sin * z, sin * y + cos * z);
            [x + 10.0 * far, y + 7.0 * far, z + 3.0 * far].map(|x| x as f32)
        };
        let cube = shapes::cube(1);
        let points = cube.positions().view().iter().map(place).collect();
        let plate = TriMesh::new(Positions::F32(points), cube.surface().triangles().to_vec()).unwrap();
        let fine = subdivided(&subdivided(&subdivided(&plate)));
        assert_eq!(fine.face_count(), 768);
        assert_eq!(merged(&fine).mesh.face_count(), 12, "{far} times its width from the origin");
    }
}
