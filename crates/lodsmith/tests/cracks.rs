//! Closed surfaces stay closed: by their indices, and at seams and borders that differ by rounding.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, Vec3};
use lodsmith::core::mesh::normals::vertex_normals;
use lodsmith::core::topology::Topology;
use lodsmith::core::{Positions, PositionsView, Surface, TriMesh, VertexId, WedgeId, shapes};
use lodsmith::{MethodKind, NoControl, Part, Preset, SimplifyOptions, Stop, simplify, simplify_scene};

/// Returns the number of edges with one face, if only equal wedges are joined, as in a file with one index
/// per corner.
fn open_by_index(mesh: &TriMesh) -> usize {
    let view = mesh.positions().view();
    let wedges = (0..mesh.wedge_count()).map(|w| view.get(mesh.vertex_of(WedgeId::new(w))));
    let places: Vec<[f64; 3]> = wedges.collect();
    let faces = mesh.triangles().iter().map(|t| t.map(|w| VertexId(w.0))).collect();
    let surface = Surface::with_triangles(PositionsView::F64(&places), faces).expect("the same faces");
    Topology::unwelded(&surface).counts().border_edge_count
}

/// Returns the number of edges with one face, if vertices at equal positions are joined.
fn open_by_position(mesh: &TriMesh) -> usize {
    Topology::new(&mesh.surface()).counts().border_edge_count
}

/// A closed star: a sphere with many thorns, and a normal for each vertex.
fn thorns() -> TriMesh {
    let mut mesh = shapes::icosphere(4);
    let sharp = |x: f64| (9.0 * x).sin().abs();
    mesh.map_positions(|p| p.map(|x| x * (0.4 + 0.8 * sharp(p[0]) * sharp(p[1] + 0.3) * sharp(p[2] - 0.2))));
    let normals = vertex_normals(&mesh.surface(), |v| v);
    mesh.set_normals(Some(normals)).expect("one for each wedge");
    mesh
}

/// Where a blended normal was far off a face, the vertex was split although it had a single normal before:
/// the result for a closed PLY was open, even if normals were to be ignored.
#[test]
fn meshes_closed_by_their_indices_stay_closed_with_normals() {
    let mesh = thorns();
    assert_eq!(open_by_index(&mesh), 0);
    for preset in [Preset::Auto, Preset::Print, Preset::Scan, Preset::Visual] {
        for ratio in [0.5, 0.1, 0.04] {
            let got = simplify(&mesh, &SimplifyOptions::preset(preset, Stop::ratio(ratio))).unwrap();
            let open = (open_by_position(&got.mesh), open_by_index(&got.mesh));
            assert_eq!(open, (0, 0), "{preset:?} at {ratio}");
            assert_eq!(got.mesh.wedge_count(), got.mesh.vertex_count());
        }
    }
    for method in [MethodKind::Quadric, MethodKind::LindstromTurk, MethodKind::Melax] {
        let mut options = SimplifyOptions::new(Stop::ratio(0.1));
        options.method = method.into();
        let got = simplify(&mesh, &options).unwrap();
        assert_eq!(open_by_index(&got.mesh) - open_by_position(&got.mesh), 0, "{method:?}");
    }
    // Methods that build new surfaces take the values of a vertex from one sheet where several are possible.
    for method in [MethodKind::VertexRemoval, MethodKind::Cluster, MethodKind::Planar, MethodKind::Remesh] {
        let mut options = SimplifyOptions::new(Stop::ratio(0.1));
        options.method = method.into();
        let got = simplify(&mesh, &options).unwrap();
        assert_eq!(open_by_index(&got.mesh) - open_by_position(&got.mesh), 0, "{method:?}");
    }
}

/// Returns a mesh in which each face has its own normal, and each side of a hard edge its own wedges.
fn with_face_normals(mesh: &TriMesh) -> TriMesh {
    let surface = mesh.surface();
    let mut numbers: BTreeMap<(VertexId, [u32; 3]), WedgeId> = BTreeMap::new();
    let (mut vertex_of, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for t in surface.triangles() {
        let normal = face_normal(surface.positions(), *t).to_array().map(|x| x + 0.0);
        triangles.push(t.map(|v| {
            *numbers.entry((v, normal.map(f32::to_bits))).or_insert_with(|| {
                vertex_of.push(v);
                normals.push(normal);
                WedgeId::new(vertex_of.len() - 1)
            })
        }));
    }
    let mut flat =
        TriMesh::with_wedges(mesh.positions().clone(), vertex_of, triangles).expect("the same faces");
    flat.set_normals(Some(normals)).expect("one for each wedge");
    flat
}

fn face_normal(positions: PositionsView<'_>, t: [VertexId; 3]) -> Vec3 {
    let [a, b, c] = t.map(|v| DVec3::from(positions.get(v)));
    (b - a).cross(c - a).normalize_or_zero().as_vec3()
}

/// Returns the largest distance between the normal of a corner and its face's normal, both of length one.
fn off_faces(mesh: &TriMesh) -> f32 {
    let (surface, normals) = (mesh.surface(), mesh.normals().expect("the mesh has normals"));
    let of_face = |(t, wedges): (&[VertexId; 3], &[WedgeId; 3])| {
        let face = face_normal(surface.positions(), *t);
        wedges.map(|w| face.distance(Vec3::from(normals[w.index()]))).into_iter().fold(0.0, f32::max)
    };
    surface.triangles().iter().zip(mesh.triangles()).map(of_face).fold(0.0, f32::max)
}

/// Hard edges are still split: each side of a cube has its own normals, and keeps them.
#[test]
fn hard_edges_stay_split() {
    let mut mesh = with_face_normals(&shapes::cube(6));
    // A single normal that differs from its face's prevents the others from being left out of the run.
    let mut normals = mesh.normals().expect("they are set").to_vec();
    normals
        .iter_mut()
        .take(20)
        .for_each(|n| *n = Vec3::from(*n).lerp(Vec3::ONE, 0.3).normalize_or_zero().to_array());
    mesh.set_normals(Some(normals)).unwrap();
    let got = simplify(&mesh, &SimplifyOptions::new(Stop::ratio(0.2))).unwrap().mesh;
    assert!(got.wedge_count() > got.vertex_count() && off_faces(&got) < 0.8, "{}", off_faces(&got));
}

/// Every edge of a flat-shaded sphere was a seam, so the borders of its colours were lost among them: 11 % of
/// its area had a wrong colour at a tenth of the faces.
#[test]
fn flat_normals_do_not_count_and_are_recomputed() {
    let mut ball = shapes::icosphere(3);
    ball.map_positions(|p| [p[0] * 1.2, p[1], p[2] * (1.0 + 0.2 * p[0])]);
    let flat = with_face_normals(&ball);
    let color = |p: [f64; 3]| match (p[0] > 0.1, p[1] > -0.2) {
        (true, true) => [0.9, 0.1, 0.1, 1.0],
        (true, false) => [0.1, 0.8, 0.2, 1.0],
        (false, true) => [0.1, 0.2, 0.9, 1.0],
        (false, false) => [0.8, 0.8, 0.1, 1.0],
    };
    let colored = |mut mesh: TriMesh| {
        let view = mesh.positions().view();
        let colors = (0..mesh.wedge_count()).map(|w| color(view.get(mesh.vertex_of(WedgeId::new(w)))));
        let colors: Vec<[f32; 4]> = colors.collect();
        mesh.set_colors(Some(colors)).expect("one for each wedge");
        mesh
    };
    let (flat, bare) = (colored(flat), colored(ball.clone()));
    let options = SimplifyOptions::new(Stop::ratio(0.1));
    let got = simplify(&flat, &options).unwrap().mesh;
    let wanted = simplify(&bare, &options).unwrap().mesh;
    assert_eq!(got.positions(), wanted.positions());
    assert_eq!(got.surface().triangles(), wanted.surface().triangles());
    assert!(off_faces(&got) < 0.01, "{}", off_faces(&got));
    // The same in a scene, together with a mesh that is smooth or has no normals.
    let mut smooth = ball.clone();
    let normals = vertex_normals(&smooth.surface(), |v| v);
    smooth.set_normals(Some(normals)).unwrap();
    let part = |mesh| Part::new(mesh);
    let scene =
        simplify_scene(&[part(&flat), part(&smooth), part(&ball)], 9.0, &options, &mut NoControl).unwrap();
    assert!(off_faces(&scene.meshes[0]) < 0.01 && off_faces(&scene.meshes[1]) > 0.1);
    assert!(scene.meshes[2].normals().is_none());
    assert!(scene.meshes[1..].iter().all(|mesh| mesh.wedge_count() == mesh.vertex_count()));
    // A smooth mesh keeps its normals, however fine it is.
    let got = simplify(&smooth, &SimplifyOptions::new(Stop::ratio(0.5))).unwrap().mesh;
    assert_eq!(got.wedge_count(), got.vertex_count());
    assert!(off_faces(&got) > 0.05);
}

/// A bottle whose surface is computed from 0 to 2 π in single precision, as many programs do: the two sides of the seam
/// of its texture differ by rounding, and at the bottom each column ends at its own point.
fn bottle() -> TriMesh {
    let (columns, rows) = (48u32, 24u32);
    let (mut positions, mut uvs) = (Vec::new(), Vec::new());
    for c in 0..=columns {
        for r in 0..=rows {
            let (u, v) = (c as f32 / columns as f32, r as f32 / rows as f32);
            let (angle, height) = (u * std::f32::consts::TAU, v * std::f32::consts::PI);
            let radius = height.sin() * (1.0 + 0.2 * (5.0 * v).sin());
            positions.push([radius * angle.cos(), 2.0 * v, radius * angle.sin()]);
            uvs.push([u, v]);
        }
    }
    let v = |c: u32, r: u32| VertexId(c * (rows + 1) + r);
    let mut faces = Vec::new();
    for (c, r) in (0..columns).flat_map(|c| (0..rows).map(move |r| (c, r))) {
        // At its ends a column has a single triangle.
        if r > 0 {
            faces.push([v(c, r), v(c + 1, r), v(c, r + 1)]);
        }
        if r + 1 < rows {
            faces.push([v(c + 1, r), v(c + 1, r + 1), v(c, r + 1)]);
        }
    }
    let mut mesh = TriMesh::new(Positions::F32(positions), faces).expect("a bottle");
    mesh.set_uvs(Some(uvs)).expect("one for each wedge");
    mesh
}

/// The seam opened by half of the radius, without a warning; with any second mesh in the scene it did not.
#[test]
fn a_seam_whose_sides_differ_by_rounding_does_not_crack() {
    let mesh = bottle();
    assert!(open_by_position(&mesh) > 20, "the two sides are equal to the bit");
    let options = SimplifyOptions::new(Stop::ratio(0.05));
    let got = simplify(&mesh, &options).unwrap();
    assert_eq!(open_by_position(&got.mesh), 0);
    assert!(got.mesh.wedge_count() > got.mesh.vertex_count(), "the seam of the texture is gone");
    let part = Part { scale: 0.01, ..Part::new(&mesh) };
    let far = Part { scale: 5.0, ..part };
    let scene = simplify_scene(&[part, far], 20.0, &options, &mut NoControl).unwrap();
    assert_eq!([0, 1].map(|i: usize| open_by_position(&scene.meshes[i])), [0, 0]);
    // Vertices that have not moved have the bits of one side.
    let given: BTreeSet<[u64; 3]> = bits(&mesh, [0.0; 3]).collect();
    let half = simplify(&mesh, &SimplifyOptions::new(Stop::ratio(1.0))).unwrap();
    assert!(bits(&half.mesh, [0.0; 3]).all(|p| given.contains(&p)));
}

/// Returns the positions of a mesh, moved.
fn bits(mesh: &TriMesh, by: [f64; 3]) -> impl Iterator<Item = [u64; 3]> {
    let moved = |p: [f64; 3]| [0, 1, 2].map(|k| (p[k] + by[k] + 0.0).to_bits());
    mesh.positions().view().iter().map(moved).collect::<Vec<_>>().into_iter()
}

/// A square tile of hills whose left and right sides have equal heights, and so have front and back.
fn tile(n: u32) -> TriMesh {
    let mut mesh = shapes::grid(n);
    let bounds = mesh.positions().view().bounds().expect("the mesh has vertices");
    let size = [0, 1].map(|k| bounds.max[k] - bounds.min[k]);
    let wave = |x: f64| (std::f64::consts::TAU * (x - x.floor())).sin();
    // Multiples of a sixteenth, so that sums with the places of the tiles are exact.
    mesh.map_positions(|p| {
        let [x, y] = [0, 1].map(|k| ((p[k] - bounds.min[k]) / size[k] * f64::from(n)).round() / f64::from(n));
        [x, y, (16.0 * (0.1 * wave(2.0 * x) + 0.08 * wave(x + y))).round() / 64.0]
    });
    mesh
}

fn moved_by(x: f64, y: f64) -> [[f64; 4]; 3] {
    [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, 0.0]]
}

/// Returns the open edges of several meshes taken as one.
fn open_together(meshes: &[(&TriMesh, [f64; 3])]) -> usize {
    let (mut places, mut faces) = (Vec::new(), Vec::new());
    for (mesh, by) in meshes {
        let first = places.len() as u32;
        places.extend(mesh.positions().view().iter().map(|p| [0, 1, 2].map(|k| p[k] + by[k])));
        faces.extend(mesh.surface().triangles().iter().map(|t| t.map(|v| VertexId(v.0 + first))));
    }
    let surface = Surface::with_triangles(PositionsView::F64(&places), faces).expect("the same faces");
    Topology::new(&surface).counts().border_edge_count
}

/// Tiles with different origins opened along their common side.
#[test]
fn meshes_with_different_origins_stay_connected() {
    let left = tile(16);
    let mut right = tile(16);
    right.map_positions(|p| [p[0] - 7.0, p[1], p[2]]);
    let places = [[moved_by(0.0, 0.0)], [moved_by(8.0, 0.0)]];
    let part = |(i, mesh)| Part { system: Some(i), places: &places[i], ..Part::new(mesh) };
    let parts = [part((0, &left)), part((1, &right))];
    let options = SimplifyOptions::new(Stop::ratio(0.2));
    let got = simplify_scene(&parts, 2.5, &options, &mut NoControl).unwrap();
    assert_eq!(got.report.gaps, 0);
    // Where the border moves, both tiles move equally, to positions that both can represent in single
    // precision.
    let at_side = |mesh: &TriMesh, by: f64| -> Vec<[f64; 3]> {
        let view = mesh.positions().view();
        let all = view.iter().map(|p| [p[0] + by, p[1], p[2]]);
        all.filter(|p| (p[0] - 1.0).abs() < 1e-2).collect()
    };
    let (own, others) = (at_side(&got.meshes[0], 0.0), at_side(&got.meshes[1], 8.0));
    assert!(own.len() > 2 && own.len() < 17 && own.len() == others.len(), "{own:?} and {others:?}");
    assert!(own.iter().all(|p| others.contains(p)), "{own:?} and {others:?}");
    // Simplified separately, they come apart, and the report says so.
    let mut apart = options.clone();
    apart.per_mesh = true;
    let got = simplify_scene(&parts, 2.5, &apart, &mut NoControl).unwrap();
    assert!(got.report.gaps > 0);
}

/// Copies of one tile in a row, and a mirrored one: a change of the left side is not a change of the right
/// side.
#[test]
fn copies_stay_connected_where_they_touch() {
    let mesh = tile(16);
    let row = [moved_by(0.0, 0.0), moved_by(1.0, 0.0), moved_by(2.0, 0.0)];
    let copies = Part { instances: 3, places: &row, ..Part::new(&mesh) };
    let got =
        simplify_scene(&[copies], 3.5, &SimplifyOptions::new(Stop::ratio(0.3)), &mut NoControl).unwrap();
    let meshes: Vec<_> = [0.0, 1.0, 2.0].map(|x| (&got.meshes[0], [x, 0.0, 0.0])).to_vec();
    assert_eq!(got.report.gaps, 0);
    // The outline of the row: the open edges of each tile, without both sides of the two seams of 16 edges.
    assert_eq!(open_together(&meshes), 3 * open_by_position(&got.meshes[0]) - 4 * 16);
    let mirrored = [[-1.0, 0.0, 0.0, 2.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let pair = [moved_by(0.0, 0.0), mirrored];
    let halves = Part { instances: 2, places: &pair, ..copies };
    let got =
        simplify_scene(&[halves], 2.5, &SimplifyOptions::new(Stop::ratio(0.3)), &mut NoControl).unwrap();
    let given: BTreeSet<_> = bits(&mesh, [0.0; 3]).filter(|p| p[0] == 1f64.to_bits()).collect();
    let kept = bits(&got.meshes[0], [0.0; 3]).filter(|p| given.contains(p)).count();
    assert_eq!((given.len(), kept, got.report.gaps), (17, 17, 0));
}
