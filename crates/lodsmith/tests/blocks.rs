//! Large meshes are swept in blocks. Here the blocks are small, so that small meshes are cut too.

use lodsmith::core::measure::{CompareOptions, compare, compare_attributes};
use lodsmith::core::{RegionId, TriMesh, WedgeId, shapes};
use lodsmith::{
    BlockSizes, BorderPolicy, Input, Length, Levels, LodOptions, MethodKind, NoControl, SimplifyError,
    SimplifyOptions, Stop, StoppedBy, Verdict, lod, simplify, simplify_with,
};

use crate::support::attributed::{attribute_complaints, with_random_attributes};
use crate::support::charts::{place, two_charts};
use crate::support::{EndsFrom, Random, bytes, complaints, places};

const SMALL: BlockSizes = BlockSizes { min_faces: 2000, vertices: 200 };
const OFF: BlockSizes = BlockSizes { min_faces: usize::MAX, vertices: 1 };
fn options(ratio: f64, blocks: BlockSizes) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(Stop::ratio(ratio));
    options.blocks = blocks;
    options
}

fn shapes() -> [(&'static str, TriMesh); 4] {
    [
        ("blob", shapes::blob(5, 1)),
        ("sheet", shapes::wavy_sheet(64)),
        ("torus", shapes::torus(96, 64)),
        ("noisy sphere", shapes::noisy_sphere(5, 0.05, 3)),
    ]
}

#[test]
fn the_number_of_threads_does_not_change_the_bytes() {
    for (name, mesh) in shapes() {
        for ratio in [0.5, 0.1] {
            let with = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                bytes(&pool.install(|| simplify(&mesh, &options(ratio, SMALL))).unwrap().mesh)
            };
            let one = with(1);
            for threads in [2, 3, 8, 16] {
                assert!(with(threads) == one, "{name} at {ratio} with {threads} threads");
            }
        }
    }
}

#[test]
fn blocks_are_as_close_as_one_sweep_after_another() {
    let (mut logs, mut count) = (0.0, 0);
    let larger = BlockSizes { min_faces: 10_000, vertices: 2000 };
    for (name, mesh) in [("blob", shapes::blob(6, 1)), ("sheet", shapes::wavy_sheet(150))] {
        for ratio in [0.5, 0.1] {
            let rms = |blocks: BlockSizes| {
                let done = simplify(&mesh, &options(ratio, blocks)).unwrap();
                assert!(done.report.reached, "{name}");
                let found = complaints(&mesh, &options(ratio, blocks), &done);
                assert!(found.is_empty(), "{name} at {ratio}: {found:?}");
                let compared = compare(&mesh.surface(), &done.mesh.surface(), &CompareOptions::default());
                compared.unwrap().rms.symmetric
            };
            let (cut, whole) = (rms(larger), rms(OFF));
            assert!(cut != whole, "{name} was cut");
            assert!(cut < 1.03 * whole, "{name} at {ratio}: {cut} of {whole}");
            (logs, count) = (logs + (cut / whole).ln(), count + 1);
        }
    }
    let mean = (logs / f64::from(count)).exp();
    assert!(mean < 1.01, "{mean}");
}

#[test]
fn locks_weights_and_borders_hold_in_blocks() {
    let mesh = shapes::wavy_sheet(64);
    let count = mesh.vertex_count();
    let locked: Vec<bool> = (0..count).map(|v| v % 7 == 0).collect();
    let importance: Vec<f32> = (0..count).map(|v| if v % 5 == 0 { 10.0 } else { 1.0 }).collect();
    let mut options = options(0.5, SMALL);
    options.border = BorderPolicy::Lock;
    let input = Input::new(&mesh).locked(&locked).importance(&importance);
    let done = simplify_with(input, &options, &mut NoControl).unwrap();
    let kept = places(&done.mesh);
    let bounds = mesh.positions().view().bounds().unwrap();
    for (p, is_locked) in mesh.positions().view().iter().zip(locked) {
        let is_on_border = [0, 1].iter().any(|&k| p[k] == bounds.min[k] || p[k] == bounds.max[k]);
        assert!(!(is_locked || is_on_border) || kept.contains(&p.map(f64::to_bits)), "{p:?}");
    }
}

#[test]
fn importance_counts_in_blocks() {
    let mesh = shapes::icosphere(5);
    let view = mesh.positions().view();
    let importance: Vec<f32> = view.iter().map(|p| if p[2] > 0.0 { 4.0 } else { 1.0 }).collect();
    let above = |blocks: BlockSizes| {
        let input = Input::new(&mesh).importance(&importance);
        let done = simplify_with(input, &options(0.25, blocks), &mut NoControl).unwrap();
        let above = done.mesh.positions().view().iter().filter(|p| p[2] > 0.0).count();
        (bytes(&done.mesh), above as f64 / done.mesh.vertex_count() as f64)
    };
    let (cut, whole) = (above(SMALL), above(OFF));
    assert!(cut.0 != whole.0, "it was cut");
    assert!((cut.1 - whole.1).abs() < 0.04 && cut.1 > 0.7, "{} and {} of the vertices", cut.1, whole.1);
}

#[test]
fn a_caller_can_end_sweeps_in_blocks() {
    let mesh = shapes::blob(5, 1);
    let mut counts = Vec::new();
    for after in 1..6 {
        let cancelled = simplify_with(&mesh, &options(0.1, SMALL), &mut EndsFrom(after, Verdict::Cancel));
        assert_eq!(cancelled.unwrap_err(), SimplifyError::Cancelled);
        let ended =
            simplify_with(&mesh, &options(0.1, SMALL), &mut EndsFrom(after, Verdict::Finish)).unwrap();
        assert_eq!(ended.report.stopped_by, StoppedBy::Caller);
        assert_eq!(ended.report.faces, ended.mesh.face_count());
        counts.push(ended.report.faces);
    }
    assert!(counts.is_sorted_by(|a, b| a >= b) && counts[4] < counts[0], "{counts:?}");
}

#[test]
fn levels_are_made_in_blocks() {
    let mesh = shapes::blob(5, 1);
    let mut levels = LodOptions::new(Levels::Ratios(vec![0.5, 0.2, 0.05]));
    let whole = lod(&mesh, &levels).unwrap();
    levels.simplify.blocks = SMALL;
    let cut = lod(&mesh, &levels).unwrap();
    assert_eq!(cut.levels.len(), whole.levels.len());
    for (a, b) in cut.levels.iter().zip(&whole.levels) {
        assert!(a.report.reached && a.report.faces.abs_diff(b.report.faces) <= 1);
        assert!(bytes(&a.mesh) != bytes(&b.mesh), "it was cut");
    }
}

#[test]
fn attributes_of_all_kinds_are_kept_in_blocks() {
    let (mut cut_ones, count) = (0, 24);
    for seed in 0..count {
        let mut random = Random(seed | 1);
        // (So small that every invariant of the engine is checked too.)
        let plain = match seed % 3 {
            0 => shapes::torus(48, 48),
            1 => shapes::wavy_sheet(48),
            _ => shapes::grid_with_holes(52),
        };
        let mesh = with_random_attributes(&plain, &mut random);
        let mut options = options(random.pick(&[0.5, 0.2]), SMALL);
        options.sharp_deg = (random.below(3) == 0).then_some(8.0);
        let [one, three] = [1, 3].map(|n| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| simplify(&mesh, &options).unwrap())
        });
        assert!(bytes(&one.mesh) == bytes(&three.mesh), "seed {seed}");
        let mut found = complaints(&mesh, &options, &one);
        found.extend(attribute_complaints(&mesh, options.placement, None, &one.mesh));
        assert!(found.is_empty(), "seed {seed}: {found:?}");
        options.blocks = OFF;
        cut_ones += u32::from(bytes(&one.mesh) != bytes(&simplify(&mesh, &options).unwrap().mesh));
    }
    assert!(cut_ones >= 20, "{cut_ones} of {count} were cut");
}

#[test]
fn attributes_are_as_close_in_blocks() {
    let larger = BlockSizes { min_faces: 10_000, vertices: 2000 };
    let mut mesh = two_charts(150);
    let height = |p: [f64; 3]| [0.5 + 2.0 * p[2] as f32, 0.5, p[0].sin() as f32 * 0.5 + 0.5, 1.0];
    let wedges = 0..mesh.wedge_count() as u32;
    let colors = wedges.map(|w| height(place(&mesh, WedgeId(w)))).collect();
    mesh.set_colors(Some(colors)).unwrap();
    let strips = (0..mesh.face_count()).map(|i| RegionId((i * 5 / mesh.face_count()) as u32)).collect();
    mesh.set_regions(Some(strips)).unwrap();
    for ratio in [0.5, 0.1] {
        let errors = |blocks: BlockSizes| {
            let done = simplify(&mesh, &options(ratio, blocks)).unwrap().mesh;
            let shape = compare(&mesh.surface(), &done.surface(), &CompareOptions::default()).unwrap();
            let look = compare_attributes(&mesh, &done, &CompareOptions::default()).unwrap();
            [shape.rms.symmetric, look.uvs.unwrap().rms.symmetric, look.colors.unwrap().rms.symmetric]
        };
        let (cut, whole) = (errors(larger), errors(OFF));
        assert!(cut != whole, "it was cut");
        assert!((0..3).all(|k| cut[k] < 1.03 * whole[k]), "at {ratio}: {cut:?} of {whole:?}");
    }
}

#[test]
fn other_methods_are_swept_in_blocks_too() {
    let larger = BlockSizes { min_faces: 10_000, vertices: 2000 };
    let (mesh, methods) = (
        shapes::blob(6, 1),
        [MethodKind::Quadric, MethodKind::LindstromTurk, MethodKind::Melax, MethodKind::ShortestEdge],
    );
    for method in methods {
        for ratio in [0.5, 0.1] {
            let run = |blocks: BlockSizes, threads: usize| {
                let mut options = options(ratio, blocks);
                options.method = method.into();
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let done = pool.install(|| simplify(&mesh, &options)).unwrap();
                assert!(done.report.reached, "{method:?}");
                let found = complaints(&mesh, &options, &done);
                assert!(found.is_empty(), "{method:?} at {ratio}: {found:?}");
                done.mesh
            };
            let (cut, whole) = (run(larger, 1), run(OFF, 1));
            assert!(bytes(&cut) == bytes(&run(larger, 3)), "{method:?} at {ratio}");
            let [cut, whole] = [cut, whole].map(|result| {
                let compared = compare(&mesh.surface(), &result.surface(), &CompareOptions::default());
                compared.unwrap().rms.symmetric
            });
            assert!(cut != whole, "{method:?} was cut");
            assert!(cut < 1.05 * whole, "{method:?} at {ratio}: {cut} of {whole}");
        }
    }
}

#[test]
fn limits_hold_in_blocks() {
    for (name, mesh) in
        [("blob", shapes::blob(5, 1)), ("sheet", shapes::wavy_sheet(64)), ("torus", shapes::torus(48, 48))]
    {
        let run = |blocks: BlockSizes, threads: usize| {
            let mut options = options(1.0, blocks);
            options.stop = Stop::error(Length::OfDiagonal(0.002));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| simplify(&mesh, &options)).unwrap()
        };
        let [one, three] = [1, 3].map(|threads| run(SMALL, threads));
        assert!(bytes(&one.mesh) == bytes(&three.mesh), "{name}");
        let whole = run(OFF, 1);
        assert!(bytes(&one.mesh) != bytes(&whole.mesh), "{name} was cut");
        let compared = compare(&mesh.surface(), &one.mesh.surface(), &CompareOptions::default()).unwrap();
        let limit = 0.002 * mesh.positions().view().bounds().unwrap().diagonal();
        assert!(compared.hausdorff.symmetric <= limit, "{name}: {} of {limit}", compared.hausdorff.symmetric);
        assert_eq!(one.report.stopped_by, StoppedBy::Error, "{name}");
        let (cut, whole) = (one.report.faces as f64, whole.report.faces as f64);
        assert!(cut < 1.03 * whole, "{name}: {cut} of {whole} faces");
    }
}
