//! Properties that hold for every mesh.

use lodsmith::core::arbitrary::{Coordinates, perturbed_shape, soup};
use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::core::{Positions, TriMesh, VertexId, shapes};
use lodsmith::{
    BorderPolicy, Fit, Guards, Input, Length, MethodKind, OwnedMeshData, Placement, SimplifyError,
    SimplifyOptions, Stop, TopologyPolicy, simplify,
};
use proptest::prelude::*;

use crate::support::attributed::{
    attribute_complaints, locked_complaints, with_random_attributes, with_rare_options,
};
use crate::support::without_ties::{moved, reordered, shapes_without_ties};
use crate::support::{self, Random, bytes, complaints, options_text, run, size};

/// Random faces; in two of three cases with attributes.
fn any_mesh() -> impl Strategy<Value = TriMesh> {
    let plain = prop_oneof![
        2 => soup(12, Coordinates::Tame),
        2 => soup(60, Coordinates::Tame),
        2 => soup(40, Coordinates::Wild),
        2 => soup(40, Coordinates::NotFinite),
        1 => perturbed_shape(0.0),
        1 => perturbed_shape(0.02),
        1 => perturbed_shape(0.5),
    ];
    (plain, any::<u64>()).prop_map(|(mesh, seed)| {
        if seed.is_multiple_of(3) { mesh } else { with_random_attributes(&mesh, &mut Random(seed | 1)) }
    })
}

/// Random options without an error stop, which would be slow.
fn random_options(seed: u64) -> SimplifyOptions {
    let mut random = Random(seed | 1);
    for _ in 0..4 {
        random.below(2);
    }
    let mut options = SimplifyOptions::default();
    options.method = random.pick(&[MethodKind::Memoryless, MethodKind::Quadric]).into();
    options.placement = random.pick(&[Placement::Optimal, Placement::Endpoint, Placement::Midpoint]);
    options.border =
        random.pick(&[BorderPolicy::Keep, BorderPolicy::Slide, BorderPolicy::Lock, BorderPolicy::Free]);
    options.topology =
        random.pick(&[TopologyPolicy::Relaxed, TopologyPolicy::Preserve, TopologyPolicy::Free]);
    options.fit = random.pick(&[Fit::Auto, Fit::On, Fit::Off]);
    options.stop = match random.below(4) {
        0 => Stop::faces(random.below(10) as usize),
        1 => Stop::vertices(random.below(20) as usize),
        2 => Stop::ratio(random.unit().max(1e-3)),
        _ => Stop { faces: Some(6), vertices: Some(5), ratio: Some(0.3), error: None },
    };
    let mut sometimes = |x: f64| (random.below(6) == 0).then(|| x * (0.5 + random.unit()));
    options.guards = Guards {
        max_normal_deg: sometimes(30.0),
        min_quality: sometimes(0.2),
        max_valence: sometimes(8.0).map(|x| x as usize),
        max_edge: sometimes(0.3).map(Length::OfDiagonal),
    };
    options.weld = sometimes(0.01).map(Length::OfDiagonal);
    options
}

/// Random options, and all rare ones.
fn any_options(seed: u64, mesh: &TriMesh) -> (SimplifyOptions, OwnedMeshData) {
    with_rare_options(random_options(seed), &mut Random(seed.rotate_left(32) | 1), mesh.vertex_count())
}

/// Returns what is wrong with a run; an error about a mesh without faces is not wrong.
fn wrongs<'a>(input: impl Into<Input<'a>>, options: &SimplifyOptions) -> Vec<String> {
    let input = input.into();
    let mesh = input.mesh().unwrap();
    match run(&input, options) {
        Ok(Ok(done)) => {
            let mut found = complaints(mesh, options, &done);
            let locked = input.data().locked;
            found.extend(attribute_complaints(mesh, options.placement, locked, &done.mesh));
            if let Some(locked) = locked {
                let paired = done.report.pairs_contracted > 0;
                found.extend(locked_complaints(mesh, locked, (options.weld.is_some(), paired), &done.mesh));
            }
            match run(&input, options) {
                Ok(Ok(again)) if bytes(&again.mesh) == bytes(&done.mesh) && again.report == done.report => {}
                _ => found.push("a second run gives another result".to_owned()),
            }
            found
        }
        Ok(Err(SimplifyError::NoFaces { .. })) => Vec::new(),
        Ok(Err(error)) => vec![format!("fails: {error}")],
        Err(panic) => vec![panic],
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(size(256, 64)) })]

    #[test]
    fn any_mesh_gives_a_sound_result(mesh in any_mesh(), seed in any::<u64>()) {
        let (options, data) = any_options(seed, &mesh);
        let found = wrongs(Input::new(&mesh).with(data.view()), &options);
        prop_assert!(found.is_empty(), "{}: {found:?}", options_text(&options));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(12) })]

    #[test]
    fn the_error_of_any_mesh_is_kept(
        mesh in prop_oneof![soup(12, Coordinates::Tame), soup(12, Coordinates::NotFinite)],
        limit in 0.0..0.2f64,
    ) {
        let options = SimplifyOptions::new(Stop::error(Length::OfDiagonal(limit)));
        let found = wrongs(&mesh, &options);
        prop_assert!(found.is_empty(), "{}: {found:?}", options_text(&options));
    }
}

/// Small soups of things that files should not contain: repeated, flipped and degenerate faces, many faces on
/// an edge.
fn soup_with_many_defects(seed: u64) -> TriMesh {
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    random.below(2);
    let count = 4 + random.below(14);
    let mut points: Vec<[f64; 3]> = (0..count)
        .map(|_| match random.below(4) {
            0 => [0; 3].map(|_| random.below(3) as f64),
            1 => [random.unit(), random.unit(), 0.0],
            _ => [0; 3].map(|_| random.unit() * 2.0),
        })
        .collect();
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for _ in 0..1 + random.below(30) {
        let mut any = || random.below(count) as u32;
        let face = [any(), any(), any()];
        match random.below(8) {
            0 if !faces.is_empty() => faces.push(random.pick(&faces)),
            1 if !faces.is_empty() => {
                let [a, b, c] = random.pick(&faces);
                faces.push([a, c, b]);
            }
            2 if !faces.is_empty() => {
                let [a, b, c] = random.pick(&faces);
                faces.push([b, c, a]);
            }
            3 => {
                // Five pages on one edge.
                let first = points.len() as u32;
                points.extend((0..5).map(|_| [0; 3].map(|_| 2.0 * random.unit())));
                let turned = random.below(2) == 0;
                let [a, b] = [face[0], face[1]];
                let page = |i: u32| {
                    if turned && i.is_multiple_of(2) { [b, a, first + i] } else { [a, b, first + i] }
                };
                faces.extend((0..5).map(page));
            }
            // A patch that closes: a tetrahedron over the face.
            4 => {
                let tip = random.below(count) as u32;
                let [a, b, c] = face;
                faces.extend([[a, c, b], [a, b, tip], [b, c, tip], [c, a, tip]]);
            }
            _ => faces.push(face),
        }
    }
    let triangles = faces.into_iter().map(|t| t.map(VertexId)).collect();
    let positions = if random.below(2) == 0 {
        Positions::F64(points)
    } else {
        Positions::F32(points.iter().map(|p| p.map(|x| x as f32)).collect())
    };
    TriMesh::new(positions, triangles).unwrap()
}

#[test]
fn soups_with_many_defects_give_sound_results() {
    let mut all = support::Complaints::default();
    for seed in 0..size(1500, 400) {
        let (mut mesh, mut options) = (soup_with_many_defects(seed), random_options(seed ^ 0xABCD_EF01_2345));
        let mut data = OwnedMeshData::default();
        if seed.is_multiple_of(2) {
            mesh = with_random_attributes(&mesh, &mut Random(seed | 1));
            (options, data) = any_options(seed ^ 0xABCD_EF01_2345, &mesh);
        }
        let found = wrongs(Input::new(&mesh).with(data.view()), &options);
        all.add(&format!("seed {seed}, {} faces, {}", mesh.face_count(), options_text(&options)), found);
    }
    all.report_all();
}

/// The topology policies keep their guarantees for soups as well.
#[test]
fn soups_keep_the_guarantees_of_the_topology_policy() {
    let mut all = support::Complaints::default();
    let mut checked = 0;
    let seeds = size(1500, 400);
    for seed in 0..seeds {
        let mesh = soup_with_many_defects(seed);
        let mut options = random_options(seed ^ 0x1234_5678);
        options.weld = None;
        let Ok(Ok(done)) = run(&mesh, &options) else { continue };
        // Two merged vertices may get the same position (midpoints of a soup on whole numbers do); counted by
        // position, that joins edges that are separate by index.
        if lodsmith::core::mesh::weld::weld(done.mesh.positions().view()).merged_count() > 0 {
            continue;
        }
        checked += 1;
        let case = format!("seed {seed}, {} faces, {}", mesh.face_count(), options_text(&options));
        all.add(&case, support::topology_complaints(&mesh, &options, &done));
    }
    all.report_all();
    assert!(checked > 2 * seeds / 3, "{checked} of {seeds} soups were checked");
}

fn light(mesh: &TriMesh, share: f64) -> TriMesh {
    simplify(mesh, &SimplifyOptions::new(Stop::ratio(share))).unwrap().mesh
}

/// Returns the largest and the RMS distance between two meshes, as shares of the diagonal of the first.
fn apart(a: &TriMesh, b: &TriMesh) -> (f64, f64) {
    let mut options = CompareOptions::default();
    options.samples = 20_000;
    let got = compare(&a.surface(), &b.surface(), &options).unwrap();
    (got.hausdorff.symmetric / got.diagonal, got.rms.symmetric / got.diagonal)
}

#[test]
fn a_power_of_two_scales_the_result_exactly() {
    for (name, mesh) in shapes_without_ties() {
        let base = light(&moved(&mesh, |p| p), 0.2);
        for scale in [-60, -20, 30, 90].map(|e| 2f64.powi(e)) {
            let scaled = light(&moved(&mesh, |p| p.map(|x| x * scale)), 0.2);
            let back = moved(&scaled, |p| p.map(|x| x / scale));
            assert_eq!(bytes(&back), bytes(&moved(&base, |p| p)), "{name} times {scale}");
        }
    }
}

#[test]
fn scale_and_place_have_no_effect() {
    for (name, mesh) in shapes_without_ties() {
        let base = light(&moved(&mesh, |p| p), 0.2);
        for scale in [1e-6, 1e6] {
            let scaled = light(&moved(&mesh, |p| p.map(|x| x * scale)), 0.2);
            let back = moved(&scaled, |p| p.map(|x| x / scale));
            assert_eq!(back.face_count(), base.face_count(), "{name} times {scale}");
            let (worst, _) = apart(&base, &back);
            assert!(worst < 1e-4, "{name} times {scale}: {worst} of the diagonal apart");
        }
        // Map coordinates in metres, where the last bit of a double is 5e-10.
        let utm = [500_000.0, 4_000_000.0, 100.0];
        let far = light(&moved(&mesh, |p| [0, 1, 2].map(|k| p[k] + utm[k])), 0.2);
        let back = moved(&far, |p| [0, 1, 2].map(|k| p[k] - utm[k]));
        assert_eq!(back.face_count(), base.face_count(), "{name} on the map");
        let (worst, _) = apart(&base, &back);
        assert!(worst < 1e-4, "{name} on the map: {worst} of the diagonal apart");
    }
}

#[test]
fn the_order_in_the_file_has_little_effect() {
    for (name, mesh) in shapes_without_ties() {
        let (_, error) = apart(&mesh, &light(&mesh, 0.15));
        for seed in 1..4 {
            let other = reordered(&mesh, seed);
            let result = light(&other, 0.15);
            let (_, other_error) = apart(&mesh, &result);
            assert!(result.face_count() as f64 <= 0.15 * mesh.face_count() as f64 + 1.0);
            assert!(
                (other_error / error - 1.0).abs() < 0.15,
                "{name}, seed {seed}: rms {other_error} instead of {error}"
            );
        }
    }
}

#[test]
fn two_copies_share_the_faces_evenly() {
    for (name, mesh) in shapes_without_ties() {
        let count = mesh.vertex_count() as u32;
        let single = moved(&mesh, |p| p);
        let mut points: Vec<[f64; 3]> = single.positions().view().iter().collect();
        points.extend(single.positions().view().iter().map(|p| [p[0] + 4.0, p[1], p[2]]));
        let first = single.triangles().iter().map(|t| t.map(|w| VertexId(w.0)));
        let second = single.triangles().iter().map(|t| t.map(|w| VertexId(w.0 + count)));
        let both = TriMesh::new(Positions::F64(points), first.chain(second).collect()).unwrap();
        let result = light(&both, 0.2);
        let surface = result.surface();
        let is_left = |t: &&[VertexId; 3]| surface.positions().get(t[0])[0] < 2.0;
        let left = surface.triangles().iter().filter(is_left).count();
        let all = result.face_count();
        assert!(all <= (0.2 * both.face_count() as f64).round() as usize);
        let share = left as f64 / all as f64;
        assert!((0.47..0.53).contains(&share), "{name}: {left} of {all} faces lie in the first copy");
        // The result is not worse than for one copy alone.
        let (_, alone) = apart(&single, &light(&single, 0.2));
        let half = |x: fn(&TriMesh) -> TriMesh| x(&result);
        let left_half = half(|m| {
            let s = m.surface();
            let keep = s.triangles().iter().filter(|t| s.positions().get(t[0])[0] < 2.0).copied().collect();
            TriMesh::new(m.positions().clone(), keep).unwrap()
        });
        let (_, together) = apart(&single, &left_half);
        assert!(together < alone * 1.2, "{name}: rms {together} with a copy, {alone} alone");
    }
}

#[test]
fn a_finer_target_is_closer() {
    for (name, mesh) in shapes_without_ties() {
        let errors = [0.5, 0.25, 0.1, 0.04].map(|share| apart(&mesh, &light(&mesh, share)).1);
        assert!(errors.is_sorted(), "{name}: {errors:?}");
    }
}

#[test]
fn meshes_that_are_light_enough_are_unchanged() {
    for (name, mesh) in shapes::all() {
        let first = light(&mesh, 0.5);
        let mut options = SimplifyOptions::new(Stop::faces(first.face_count()));
        for stop in [Stop::faces(first.face_count()), Stop::ratio(1.0), Stop::default()] {
            options.stop = stop;
            let again = simplify(&first, &options).unwrap();
            assert_eq!(again.report.collapses, 0, "{name}");
            assert_eq!(again.mesh.face_count(), first.face_count(), "{name}");
            assert_eq!(support::places(&again.mesh), support::places(&first), "{name}");
        }
    }
}
