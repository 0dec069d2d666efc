//! Chains of levels: as close as single runs, with the same borders and with geomorph targets.

use lodsmith::core::measure::{CompareOptions, Prepared, compare_prepared};
use lodsmith::core::spatial::Bvh;
use lodsmith::core::{Positions, TriMesh, shapes};
use lodsmith::lod::error_of;
use lodsmith::{
    BorderPolicy, Control, Length, Levels, LodOptions, Measure, MethodKind, NoControl, Part, Simplified,
    SimplifyError, SimplifyOptions, Stage, Stop, StoppedBy, Verdict, lod, lod_scene, lod_with, simplify,
    simplify_scene,
};

use crate::support::charts::two_charts;
use crate::support::{EndsFrom, bytes};

const RATIOS: [f64; 5] = [0.5, 0.25, 0.1, 0.05, 0.02];

fn ratios(ratios: &[f64]) -> LodOptions {
    LodOptions::new(Levels::Ratios(ratios.to_vec()))
}

/// Returns the two-way RMS distance from a reference.
fn rms(reference: &Prepared, mesh: &TriMesh) -> f64 {
    let mesh = Prepared::new(&mesh.surface()).unwrap();
    compare_prepared(reference, &mesh, &CompareOptions::default()).rms.symmetric
}

#[test]
fn levels_are_as_close_as_single_runs() {
    let (mut chain_all, mut single_all) = (0.0, 0.0);
    for (name, mesh) in [
        ("blob", shapes::blob(5, 1)),
        ("torus", shapes::torus(96, 64)),
        ("sheet", shapes::wavy_sheet(64)),
        ("charts", two_charts(48)),
    ] {
        let reference = Prepared::new(&mesh.surface()).unwrap();
        let chain = lod(&mesh, &ratios(&RATIOS)).unwrap();
        assert_eq!(chain.levels.len(), RATIOS.len());
        for (level, ratio) in chain.levels.iter().zip(RATIOS) {
            let single = simplify(&mesh, &SimplifyOptions::new(Stop::ratio(ratio))).unwrap();
            assert_eq!(level.report.stopped_by, StoppedBy::Ratio, "{name} at {ratio}");
            assert!(level.mesh.face_count() <= (mesh.face_count() as f64 * ratio).round() as usize);
            let (own, other) = (rms(&reference, &level.mesh), rms(&reference, &single.mesh));
            // On such regular shapes the order of collapses is noise; the mean over all must agree within a
            // percent, below.
            assert!(own < 1.1 * other, "{name} at {ratio}: {own} in the chain, {other} in a single run");
            chain_all += (own / other).ln();
            single_all += 1.0;
        }
    }
    let mean = f64::exp(chain_all / single_all);
    assert!(mean < 1.01, "chains are {mean} times as far as single runs");
}

#[test]
fn a_chain_of_one_level_is_a_single_run() {
    let mesh = two_charts(24);
    for method in [MethodKind::Memoryless, MethodKind::Quadric, MethodKind::Melax, MethodKind::Cluster] {
        let mut options = LodOptions::new(Levels::Faces(vec![200]));
        options.simplify.method = method.into();
        let mut alone = SimplifyOptions::new(Stop::faces(200));
        alone.method = method.into();
        let single = simplify(&mesh, &alone).unwrap();
        let chain = lod(&mesh, &options).unwrap();
        assert_eq!(bytes(&chain.levels[0].mesh), bytes(&single.mesh), "{}", method.name());
        assert_eq!(chain.levels[0].report, single.report, "{}", method.name());
    }
}

#[test]
fn chains_of_one_mesh_are_repeatable() {
    let mesh = shapes::blob(4, 2);
    let mut first = ratios(&RATIOS);
    first.geomorph = true;
    let faces = LodOptions::new(Levels::Faces(vec![300, 100]));
    let steps = LodOptions::new(Levels::Steps { count: 3, factor: 0.4 });
    let chains = [&first, &faces, &steps, &first].map(|o| lod(&mesh, o).unwrap());
    assert_eq!(chains[0], chains[3]);
    assert_eq!(chains[1].levels.len(), 2);
    assert!(chains[2].levels[2].mesh.face_count() <= (mesh.face_count() as f64 * 0.064).round() as usize);
}

#[test]
fn locked_borders_are_the_same_in_all_levels() {
    let mesh = shapes::wavy_sheet(32);
    let mut options = ratios(&[0.5, 0.2]);
    options.simplify.border = BorderPolicy::Lock;
    let chain = lod(&mesh, &options).unwrap();
    let on_border = |p: &[f64; 3], all: &TriMesh| {
        let b = all.positions().view().bounds().unwrap();
        (0..2).any(|k| p[k] == b.min[k] || p[k] == b.max[k])
    };
    let border = |m: &TriMesh| {
        let view = m.positions().view();
        let mut all: Vec<[u64; 3]> =
            view.iter().filter(|p| on_border(p, &mesh)).map(|p| p.map(f64::to_bits)).collect();
        all.sort_unstable();
        all
    };
    let wanted = border(&mesh);
    assert_eq!(wanted.len(), 4 * 32);
    for level in &chain.levels {
        assert_eq!(border(&level.mesh), wanted);
    }
}

/// Returns the surface of a mesh with its vertices at other positions.
fn moved(mesh: &TriMesh, to: &Positions) -> TriMesh {
    TriMesh::new(to.clone(), mesh.surface().triangles().to_vec()).unwrap()
}

#[test]
fn blending_ends_on_the_coarser_level() {
    for (mesh, options) in [
        (shapes::blob(5, 1), ratios(&RATIOS)),
        (two_charts(32), ratios(&[0.5, 0.2, 0.1])),
        (shapes::tetrahedra(60), ratios(&[0.8, 0.3])),
        (shapes::blob(4, 1), {
            let mut options = ratios(&[0.5, 0.2]);
            options.simplify.method = MethodKind::Cluster.into();
            options
        }),
        (
            shapes::blob(4, 1),
            LodOptions::new(Levels::Errors(vec![Length::OfDiagonal(0.002), Length::OfDiagonal(0.01)])),
        ),
    ] {
        let mut options = options;
        options.geomorph = true;
        let chain = lod(&mesh, &options).unwrap();
        let diagonal = mesh.positions().view().bounds().unwrap().diagonal();
        let mut own = &mesh;
        for (k, level) in chain.levels.iter().enumerate() {
            let to = chain.geomorph(k).unwrap();
            assert_eq!(to.len(), own.vertex_count());
            let tree = Bvh::new(&level.mesh.surface());
            for p in to.view().iter() {
                let off = tree.closest(p).unwrap().distance;
                assert!(off <= 1e-6 * diagonal, "level {k}: {off} of {diagonal} off the next");
            }
            own = &level.mesh;
        }
        assert!(chain.geomorph(chain.levels.len()).is_none());
    }
}

#[test]
fn in_a_single_run_blending_ends_at_exactly_the_coarser_level() {
    let mesh = shapes::blob(5, 3);
    let mut options = ratios(&[0.5, 0.2, 0.05]);
    options.geomorph = true;
    let chain = lod(&mesh, &options).unwrap();
    let faces = |m: &TriMesh| {
        let view = m.positions().view();
        let mut all: Vec<_> = m
            .surface()
            .triangles()
            .iter()
            .map(|t| {
                let mut t = t.map(|v| view.get(v).map(f64::to_bits));
                let first = (0..3).min_by_key(|&k| t[k]).unwrap();
                t.rotate_left(first);
                t
            })
            .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
            .collect();
        all.sort_unstable();
        all
    };
    let mut own = &mesh;
    for (k, level) in chain.levels.iter().enumerate() {
        let blended = moved(own, chain.geomorph(k).unwrap());
        assert_eq!(faces(&blended), faces(&level.mesh), "level {k}");
        own = &level.mesh;
    }
}

#[test]
fn every_level_has_the_attributes() {
    let mesh = two_charts(32);
    let chain = lod(&mesh, &ratios(&[0.5, 0.2])).unwrap();
    for level in &chain.levels {
        assert_eq!(level.mesh.uvs().is_some(), mesh.uvs().is_some());
        assert_eq!(level.mesh.normals().is_some(), mesh.normals().is_some());
        assert!(level.mesh.wedge_count() > level.mesh.vertex_count(), "the seam is still there");
    }
}

#[test]
fn levels_are_measured_on_request() {
    let mesh = shapes::blob(4, 1);
    let mut options = ratios(&[0.5, 0.1]);
    options.simplify.measure = Measure::Always;
    let chain = lod(&mesh, &options).unwrap();
    let reference = Prepared::new(&mesh.surface()).unwrap();
    let errors: Vec<f64> =
        chain.levels.iter().map(|l| l.report.error.measured.unwrap().rms.symmetric).collect();
    for (level, error) in chain.levels.iter().zip(&errors) {
        assert_eq!(rms(&reference, &level.mesh), *error);
    }
    assert!(errors[0] < errors[1]);
}

#[test]
fn levels_by_errors_are_within_them() {
    let mesh = shapes::blob(4, 1);
    let limits = [0.002, 0.01].map(Length::OfDiagonal);
    let chain = lod(&mesh, &LodOptions::new(Levels::Errors(limits.to_vec()))).unwrap();
    let faces: Vec<usize> = chain.levels.iter().map(|l| l.mesh.face_count()).collect();
    assert!(faces[0] > faces[1], "{faces:?}");
    for (level, limit) in chain.levels.iter().zip(limits) {
        let error = &level.report.error;
        assert!(error.measured.unwrap().hausdorff.symmetric <= limit.in_units(error.diagonal) * 1.000001);
    }
}

#[test]
fn parts_are_removed_in_order_of_cost_in_chains_too() {
    let mesh = shapes::tetrahedra(60);
    let chain = lod(&mesh, &ratios(&[0.5, 0.25])).unwrap();
    for (level, ratio) in chain.levels.iter().zip([0.5, 0.25]) {
        let single = simplify(&mesh, &SimplifyOptions::new(Stop::ratio(ratio))).unwrap();
        assert_eq!(level.mesh.face_count(), single.mesh.face_count());
        assert!(level.report.parts_removed > 0);
    }
}

#[test]
fn a_caller_can_end_a_chain() {
    let mesh = shapes::blob(4, 1);
    for after in [1, 3, 6] {
        let ended = lod_with(&mesh, &ratios(&RATIOS), &mut EndsFrom(after, Verdict::Cancel));
        assert_eq!(ended.unwrap_err(), SimplifyError::Cancelled);
    }
    let chain = lod_with(&mesh, &ratios(&RATIOS), &mut EndsFrom(4, Verdict::Finish)).unwrap();
    assert!(chain.levels.len() < RATIOS.len());
    assert_eq!(chain.levels.last().unwrap().report.stopped_by, StoppedBy::Caller);
}

/// When the run in which parts are removed was ended, it replaced a level that was there: the second of `brain_mri`
/// had more faces than the first.
#[test]
fn no_level_of_an_ended_chain_has_more_faces_than_the_one_before() {
    let mesh = shapes::level(24, 200);
    let options = ratios(&[0.5, 0.3, 0.15]);
    let whole = lod(&mesh, &options).unwrap();
    assert!(whole.levels[2].report.parts_removed > 0);
    let mut ended = 0;
    for after in 15..60 {
        let chain = lod_with(&mesh, &options, &mut EndsFrom(after, Verdict::Finish)).unwrap();
        let faces: Vec<usize> = chain.levels.iter().map(|level| level.report.faces).collect();
        assert!(faces.is_sorted_by(|a, b| a >= b), "{faces:?} after {after} questions");
        let is_ended = |level: &Simplified| level.report.stopped_by == StoppedBy::Caller;
        let (last, others) = chain.levels.split_last().unwrap();
        assert!(others.iter().all(|level| level.report.reached), "{faces:?} after {after} questions");
        assert!(is_ended(last) || chain.levels.len() == 3, "{faces:?} after {after} questions");
        ended += usize::from(is_ended(last));
        for level in chain.levels.iter().filter(|level| level.report.reached) {
            assert!(level.report.proposals.is_empty());
        }
    }
    assert!(ended > 10, "{ended}");
}

/// Ends a run at the nth question of the stage `Measure`.
struct EndsInMeasure {
    left: usize,
    is_measuring: bool,
    questions: usize,
}

impl EndsInMeasure {
    fn after(left: usize) -> Self {
        Self { left, is_measuring: false, questions: 0 }
    }
}

impl Control for EndsInMeasure {
    fn stage(&mut self, stage: Stage) {
        self.is_measuring = stage == Stage::Measure;
    }
    fn progress(&mut self, done: f64) -> Verdict {
        assert!((0.0..=1.0).contains(&done), "{done}");
        if self.is_measuring {
            self.questions += 1;
        }
        if self.questions > self.left { Verdict::Finish } else { Verdict::Continue }
    }
}

/// All levels were measured, however late it was: 64 levels took 13.5 s with a time limit of one second.
#[test]
fn levels_are_not_measured_after_the_end() {
    let mesh = shapes::blob(3, 1);
    let mut chained = ratios(&[0.5, 0.2]);
    chained.simplify.measure = Measure::Always;
    let mut separate = chained.clone();
    separate.simplify.escalate = true;
    for (options, is_chained) in [(chained, true), (separate, false)] {
        let mut all = EndsInMeasure::after(usize::MAX);
        let whole = lod_with(&mesh, &options, &mut all).unwrap();
        let is_whole =
            |level: &Simplified| level.report.error.measured.is_some() && !level.report.error.is_incomplete;
        assert!(whole.levels.len() == 2 && whole.levels.iter().all(is_whole));
        assert!(all.questions > 8, "{}", all.questions);
        for after in [0, 1, 2, all.questions / 2, all.questions / 2 + 1, all.questions - 2, all.questions - 1]
        {
            let mut control = EndsInMeasure::after(after);
            let made = lod_with(&mesh, &options, &mut control).unwrap();
            // Not one more question for each level than it takes to know that it is over.
            assert!(control.questions <= after + 3, "{} after {after}", control.questions);
            assert!(made.levels.len() == 2 || !is_chained);
            let (mut is_measured, mut are_unknown) = (true, 0);
            for (level, whole) in made.levels.iter().zip(&whole.levels) {
                assert!(level.mesh == whole.mesh || level.report.stopped_by == StoppedBy::Caller);
                let error = &level.report.error;
                if error.is_incomplete {
                    assert!(error.measured.is_none() && error_of(&level.report).is_none());
                    (is_measured, are_unknown) = (false, are_unknown + 1);
                } else {
                    assert!(is_measured && level == whole);
                }
            }
            assert!(are_unknown > 0, "{after}");
        }
    }
}

#[test]
fn invalid_options_are_errors() {
    let mesh = shapes::cube(4);
    let mut stopped = ratios(&[0.5]);
    stopped.simplify.stop = Stop::faces(3);
    for options in [ratios(&[0.5, 0.6]), ratios(&[]), ratios(&[1.5]), stopped] {
        assert!(lod(&mesh, &options).is_err(), "{:?}", options.levels);
    }
}

fn part(mesh: &TriMesh, instances: usize) -> Part<'_> {
    Part { instances, ..Part::new(mesh) }
}

#[test]
fn levels_of_a_scene_share_their_budget() {
    let (flat, round) = (shapes::grid(32), shapes::blob(4, 1));
    for instances in [[1, 1], [1, 3]] {
        let parts = [part(&flat, instances[0]), part(&round, instances[1])];
        let mut options = ratios(&[0.5, 0.2]);
        options.geomorph = true;
        let chain = lod_scene(&parts, 4.0, &options, &mut NoControl).unwrap();
        for (level, ratio) in chain.levels.iter().zip([0.5, 0.2]) {
            let stop = SimplifyOptions::new(Stop::ratio(ratio));
            let single = simplify_scene(&parts, 4.0, &stop, &mut NoControl).unwrap();
            assert!(level.report.reached && level.report.faces <= single.report.input_faces);
            assert!(level.report.faces.abs_diff(single.report.faces) * 20 <= single.report.faces);
            assert!(level.report.error.estimate <= 1.1 * single.report.error.estimate);
        }
        for (k, level) in chain.levels.iter().enumerate() {
            for (i, to) in chain.geomorph(k).unwrap().iter().enumerate() {
                let tree = Bvh::new(&level.meshes[i].surface());
                let off = to.view().iter().map(|p| tree.closest(p).unwrap().distance).fold(0.0, f64::max);
                assert!(off < 1e-6, "mesh {i} of level {k} ends {off} away from the next level");
            }
        }
    }
}
