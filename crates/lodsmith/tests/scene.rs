//! Meshes of a scene with one budget.

use std::collections::BTreeSet;

use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::core::spatial::Bvh;
use lodsmith::core::{Attribute, RegionId, Semantic, TriMesh, shapes};
use lodsmith::{
    Length, Measure, NoControl, Part, Placement, SimplifyError, SimplifyOptions, Stop, TopologyPolicy,
    simplify_scene,
};

use crate::support::attributed::{with_random_attributes, with_rare_options};
use crate::support::{Complaints, Random, bytes, options_text, scene_complaints};

fn part(mesh: &TriMesh, instances: usize, scale: f64) -> Part<'_> {
    Part { instances, scale, ..Part::new(mesh) }
}

#[test]
fn triangles_are_removed_where_they_cost_least() {
    // A flat grid needs two triangles, a blob uses all that it can get.
    let (flat, round) = (shapes::grid(32), shapes::blob(4, 1));
    let parts = [part(&flat, 1, 1.0), part(&round, 1, 1.0)];
    let options = SimplifyOptions::new(Stop::ratio(0.3));
    let got = simplify_scene(&parts, 4.0, &options, &mut NoControl).unwrap();
    assert!(got.report.reached && got.report.faces == got.meshes.iter().map(TriMesh::face_count).sum());
    assert!(got.meshes[0].face_count() < 10, "{} for the grid", got.meshes[0].face_count());
    assert!(got.meshes[1].face_count() * 10 > round.face_count() * 3);
    assert!(got.report.error.diagonal == 4.0);
}

#[test]
fn each_mesh_keeps_its_place_and_attributes() {
    let mut a = shapes::blob(4, 1);
    a.map_positions(|p| [p[0] + 100.0, p[1], p[2] - 7.0]);
    let normals = vec![[0.0, 0.0, 1.0]; a.wedge_count()];
    a.set_normals(Some(normals)).unwrap();
    let regions = vec![RegionId(0); a.face_count()];
    a.set_regions(Some(regions)).unwrap();
    let b = shapes::torus(24, 16);
    let empty = TriMesh::new(lodsmith::core::Positions::F32(Vec::new()), Vec::new()).unwrap();
    let parts = [part(&a, 1, 0.01), part(&b, 3, 20.0), part(&empty, 0, 1.0)];
    let options = SimplifyOptions::new(Stop::ratio(0.5));
    let got = simplify_scene(&parts, 50.0, &options, &mut NoControl).unwrap();
    assert_eq!(got.meshes.len(), 3);
    assert!(got.meshes[0].normals().is_some() && got.meshes[1].normals().is_none());
    assert!(got.meshes[0].regions().is_some() && got.meshes[1].regions().is_none());
    assert_eq!(got.meshes[2].face_count(), 0);
    let torus = got.meshes[1].surface();
    let distance = compare(&b.surface(), &torus, &CompareOptions::default()).unwrap();
    assert!(distance.hausdorff.symmetric < 0.05 * distance.diagonal);
    // All instances count: here one blob and three tori.
    let placed = a.face_count() + 3 * b.face_count();
    assert_eq!(got.report.input_faces, placed);
    let left = got.meshes[0].face_count() + 3 * got.meshes[1].face_count();
    assert_eq!(got.report.faces, left);
    assert!(left * 2 <= placed && left * 20 > placed * 9, "{left} of {placed}");
}

/// A scale, a quarter turn around z, and a move.
fn turned_place(scale: f64, [x, y, z]: [f64; 3]) -> lodsmith::Place {
    [[0.0, -scale, 0.0, x], [scale, 0.0, 0.0, y], [0.0, 0.0, scale, z]]
}

/// The place of the largest distance is that of the mesh that has it, at the instance where it is largest.
#[test]
fn the_farthest_point_is_in_its_mesh_and_in_the_scene() {
    let (small, large) = (shapes::blob(4, 1), shapes::torus(48, 24));
    let places = [
        [turned_place(0.1, [5.0, 0.0, 0.0])].to_vec(),
        vec![turned_place(1.0, [0.0, 9.0, 0.0]), turned_place(3.0, [-20.0, 7.0, 1.0])],
    ];
    let scales = [0.1, 3.0];
    let (mut options, mut found) = (SimplifyOptions::new(Stop::ratio(0.1)), Vec::new());
    options.measure = Measure::Always;
    for (is_placed, per_mesh) in [(true, false), (true, true), (false, false), (false, true)] {
        options.per_mesh = per_mesh;
        let meshes = [&small, &large];
        let parts = [0, 1].map(|i| Part {
            places: if is_placed { &places[i] } else { &[] },
            ..part(meshes[i], places[i].len(), scales[i])
        });
        let done = simplify_scene(&parts, 40.0, &options, &mut NoControl).unwrap();
        let measured = done.report.error.measured.unwrap();
        let (farthest, i) = (measured.farthest.unwrap(), done.report.error.farthest_part.unwrap());
        let [from, to] =
            if farthest.is_forward { [meshes[i], &done.meshes[i]] } else { [&done.meshes[i], meshes[i]] };
        let moved = |mesh: &TriMesh, place: &lodsmith::Place| {
            let mut mesh = mesh.clone();
            mesh.map_positions(|[x, y, z]| place.map(|[a, b, c, d]| a * x + b * y + c * z + d));
            Bvh::new(&mesh.surface())
        };
        let unit = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let (place, scale) = match is_placed {
            true => (places[i].last().unwrap(), 1.0),
            false => (&unit, scales[i]),
        };
        let distance = |mesh: &TriMesh, p| moved(mesh, place).closest(p).unwrap().distance * scale;
        let largest = measured.hausdorff.symmetric;
        assert!((distance(to, farthest.point) - largest).abs() < 1e-5 * largest, "{farthest:?} {largest}");
        assert!(distance(from, farthest.point) < 1e-5 && distance(to, farthest.nearest.unwrap()) < 1e-5);
        found.push(i);
    }
    assert_eq!(found, [1; 4]);
    // With other scales the other mesh has it, unless the small one is gone: then nothing near it is left.
    for (scale, per_mesh, expected) in [(1.0, true, 0), (0.001, false, 1)] {
        options.per_mesh = per_mesh;
        let parts = [part(&small, 1, 50.0), part(&large, 1, scale)];
        let done = simplify_scene(&parts, 100.0, &options, &mut NoControl).unwrap();
        let farthest = done.report.error.measured.unwrap().farthest.unwrap();
        assert_eq!(done.report.error.farthest_part, Some(expected));
        assert_eq!((done.meshes[1].face_count() > 0, farthest.nearest.is_some()), (per_mesh, per_mesh));
    }
}

#[test]
fn parts_that_touch_stay_connected() {
    // Two sheets side by side, with the same height along the edge that they share.
    let left = shapes::wavy_sheet(16);
    let bounds = left.positions().view().bounds().unwrap();
    let mut right = left.clone();
    right.map_positions(|p| [2.0 * bounds.max[0] - p[0], p[1], p[2]]);
    let at = |mesh| Part { system: Some(5), ..Part::new(mesh) };
    let options = SimplifyOptions::new(Stop::ratio(0.2));
    let got = simplify_scene(&[at(&left), at(&right)], 3.0, &options, &mut NoControl).unwrap();
    // The common positions are those on the shared line, which is bit for bit the same in both.
    let places = |mesh: &TriMesh| -> BTreeSet<[u64; 3]> {
        mesh.positions().view().iter().map(|p| p.map(f64::to_bits)).collect()
    };
    let shared = places(&got.meshes[0]).intersection(&places(&got.meshes[1])).count();
    let near = |mesh: &TriMesh| {
        mesh.positions().view().iter().filter(|p| (p[0] - bounds.max[0]).abs() < 1e-2).count()
    };
    assert!(shared >= 3 && shared == near(&got.meshes[0]), "{shared} of {}", near(&got.meshes[0]));
}

/// The stop applies to all instances, whether or not the run met its own share.
#[test]
fn vertices_of_all_instances_are_counted() {
    let (a, b) = (shapes::blob(3, 1), shapes::torus(12, 8));
    for n in [40, 100, 400] {
        let parts = [part(&a, 1, 1.0), part(&b, 4, 0.3), Part { system: Some(1), ..part(&a, 1, 1.0) }];
        let neighbour = Part { system: Some(1), ..part(&a, 1, 1.0) };
        for parts in [parts, [neighbour, neighbour, neighbour]] {
            let options = SimplifyOptions::new(Stop::vertices(n));
            let done = simplify_scene(&parts, 4.0, &options, &mut NoControl).unwrap();
            let found = scene_complaints(&parts, &options, 4.0, &done);
            assert!(found.is_empty(), "{n}: {found:?}");
            assert!(done.report.reached && done.report.vertices <= n, "{} for {n}", done.report.vertices);
        }
    }
}

/// With joints in two sets in one mesh, the other lost the weights in the second set.
#[test]
fn meshes_with_different_sets_of_joints_keep_their_weights() {
    let mut meshes = [shapes::blob(3, 1), shapes::blob(3, 2)];
    for (sets, mesh) in meshes.iter_mut().enumerate() {
        let count = mesh.vertex_count();
        for set in 0..=sets as u8 {
            let joints = (0..4 * count).map(|i| (i * 7 / 3 % 11) as f32).collect();
            let values = vec![0.25 / (sets + 1) as f32; 4 * count];
            for (semantic, values) in [(Semantic::Joints(set), joints), (Semantic::Weights(set), values)] {
                mesh.add_attribute(Attribute { semantic, width: 4, values }).unwrap();
            }
        }
    }
    let parts = [part(&meshes[0], 1, 1.0), part(&meshes[1], 1, 1.0)];
    let options = SimplifyOptions::new(Stop::ratio(0.2));
    let done = simplify_scene(&parts, 4.0, &options, &mut NoControl).unwrap();
    let found = scene_complaints(&parts, &options, 4.0, &done);
    assert!(found.is_empty(), "{found:?}");
}

/// Parts of different systems are laid side by side for the run; a weld never connects them.
#[test]
fn a_weld_stays_within_its_part() {
    let mesh = shapes::grid(2);
    let parts = [part(&mesh, 1, 1.0), part(&mesh, 1, 1.0)];
    let mut options = SimplifyOptions::new(Stop::ratio(1.0));
    options.weld = Some(Length::Units(0.45));
    let alone = simplify_scene(&parts[..1], 4.0, &options, &mut NoControl).unwrap();
    let both = simplify_scene(&parts, 4.0, &options, &mut NoControl).unwrap();
    assert_eq!(both.report.cleanup.welded_vertices, 2 * alone.report.cleanup.welded_vertices);
}

/// Instances, scale and system of a part.
type Place = (usize, f64, Option<usize>);

/// Random parts: single ones, instances, and neighbours that are mirror images of the part before.
fn any_parts(random: &mut Random) -> (Vec<TriMesh>, Vec<Place>) {
    let (mut meshes, mut places): (Vec<TriMesh>, Vec<_>) = (Vec::new(), Vec::new());
    for i in 0..1 + random.below(4) as usize {
        let mut all = shapes::all();
        all.retain(|s| s.1.face_count() <= 130);
        let mut mesh = all.swap_remove(random.below(all.len() as u64) as usize).1;
        if i > 0 && random.below(2) == 0 {
            mesh = meshes[i - 1].clone();
            let (axis, bounds) = (random.below(3) as usize, mesh.positions().view().bounds().unwrap());
            mesh.map_positions(|mut p| {
                p[axis] = 2.0 * bounds.max[axis] - p[axis];
                p
            });
        }
        meshes.push(if random.below(3) > 0 { with_random_attributes(&mesh, random) } else { mesh });
        places.push(match random.below(2) {
            0 => (1, 1.0, Some(random.below(2) as usize)),
            _ => (random.below(5) as usize, random.pick(&[1.0, 0.01, 20.0, 3.3]), None),
        });
    }
    (meshes, places)
}

#[test]
fn any_scene_gives_sound_results() {
    let mut all = Complaints::default();
    for seed in 0..300u64 {
        let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        let (meshes, places) = any_parts(&mut random);
        let stop = random.pick(&[Stop::ratio(0.3), Stop::faces(40), Stop::vertices(30), Stop::ratio(0.02)]);
        let (mut options, _) = with_rare_options(SimplifyOptions::new(stop), &mut random, 0);
        let of_mesh = |mesh: &TriMesh| with_rare_options(options.clone(), &mut random, mesh.vertex_count()).1;
        let data: Vec<_> = meshes.iter().map(of_mesh).collect();
        let placed = meshes.iter().zip(&places).zip(&data);
        let parts: Vec<Part<'_>> = placed
            .map(|((mesh, &(instances, scale, system)), data)| Part {
                instances,
                scale,
                system,
                data: data.view(),
                ..Part::new(mesh)
            })
            .collect();
        options.placement = random.pick(&[Placement::Optimal, Placement::Endpoint, Placement::Midpoint]);
        options.topology =
            random.pick(&[TopologyPolicy::Relaxed, TopologyPolicy::Preserve, TopologyPolicy::Free]);
        let run = || simplify_scene(&parts, 4.0, &options, &mut NoControl);
        let case = format!("seed {seed}, {}, {places:?}", options_text(&options));
        match (run(), run()) {
            (Ok(done), Ok(again)) => {
                all.add(&case, scene_complaints(&parts, &options, 4.0, &done));
                let same = done.meshes.iter().map(bytes).eq(again.meshes.iter().map(bytes));
                all.check(&case, same && done.counts == again.counts, "a second run gives another result");
            }
            (Err(SimplifyError::NoFaces { .. }), _) => {}
            (failed, _) => all.add(&case, failed.err().map(|e| format!("fails: {e}"))),
        }
    }
    all.report_all();
}
