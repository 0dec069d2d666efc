//! Large meshes are swept in blocks. Here the blocks are small, so that small meshes are cut too.

use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::core::{TriMesh, shapes};
use lodsmith::{
    BlockSizes, BorderPolicy, Input, Levels, LodOptions, NoControl, SimplifyError, SimplifyOptions, Stop,
    StoppedBy, Verdict, lod, simplify, simplify_with,
};

use crate::support::{EndsFrom, bytes, complaints, places};

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
