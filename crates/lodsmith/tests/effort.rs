//! Guarantees of the effort `best`: at the count of a plain run, a smaller largest distance and no clearly larger mean.

use lodsmith::core::measure::{CompareOptions, Comparison, compare};
use lodsmith::core::{TriMesh, shapes};
use lodsmith::{
    Control, Effort, Levels, LodOptions, MethodKind, Preset, Simplified, SimplifyError, SimplifyOptions,
    Stop, Verdict, lod, simplify, simplify_with,
};

fn run(mesh: &TriMesh, stop: Stop, effort: Effort) -> Simplified {
    let mut options = SimplifyOptions::new(stop);
    options.effort = effort;
    simplify(mesh, &options).unwrap()
}

fn distances(mesh: &TriMesh, to: &TriMesh) -> Comparison {
    let mut options = CompareOptions::default();
    (options.samples, options.seed) = (60_000, 77);
    compare(&mesh.surface(), &to.surface(), &options).unwrap()
}

#[test]
fn the_best_result_has_a_smaller_largest_distance_at_the_same_count() {
    let meshes = [shapes::blob(3, 2), shapes::noisy_sphere(4, 0.02, 5), shapes::wavy_sheet(24)];
    let mut product = 1.0;
    let mut count = 0.0;
    for mesh in &meshes {
        for stop in [Stop::ratio(0.25), Stop::vertices(mesh.vertex_count() / 8)] {
            let [plain, best] = [Effort::Default, Effort::Best].map(|effort| run(mesh, stop, effort));
            assert!(best.report.reached && best.report.stopped_by == plain.report.stopped_by);
            let size = |done: &Simplified| match stop.vertices {
                Some(_) => done.report.vertices,
                None => done.report.faces,
            };
            assert!(size(&best).abs_diff(size(&plain)) <= 1);
            let [before, after] = [&plain, &best].map(|done| distances(mesh, &done.mesh));
            // (Compared by other samples than the run's, so with one percent of noise.)
            assert!(after.hausdorff.symmetric <= 1.01 * before.hausdorff.symmetric);
            assert!(after.rms.symmetric <= 1.09 * before.rms.symmetric);
            assert!(after.mean.symmetric <= 1.09 * before.mean.symmetric);
            product *= after.hausdorff.symmetric / before.hausdorff.symmetric;
            count += 1.0;
        }
    }
    let mean = f64::powf(product, 1.0 / count);
    assert!(mean < 0.8, "{mean}");
}

#[test]
fn presets_for_parts_and_prints_use_the_best_effort_on_small_meshes() {
    let (small, large) = (shapes::blob(3, 2), shapes::blob(5, 2));
    assert!(small.face_count() <= Effort::MAX_SMALL_FACES && large.face_count() > Effort::MAX_SMALL_FACES);
    for preset in [Preset::Cad, Preset::Print] {
        for (mesh, effort) in [(&small, Effort::Best), (&large, Effort::Default)] {
            let mut options = SimplifyOptions::preset(preset, Stop::ratio(0.2));
            let by_preset = simplify(mesh, &options).unwrap();
            options.effort = effort;
            assert_eq!(by_preset.mesh, simplify(mesh, &options).unwrap().mesh);
        }
    }
}

#[test]
fn levels_are_the_results_of_single_runs() {
    let mesh = shapes::blob(3, 2);
    let mut options = LodOptions::new(Levels::Ratios(vec![0.5, 0.2]));
    options.simplify.effort = Effort::Best;
    let chain = lod(&mesh, &options).unwrap();
    for (level, ratio) in chain.levels.iter().zip([0.5, 0.2]) {
        assert_eq!(level.mesh, run(&mesh, Stop::ratio(ratio), Effort::Best).mesh);
    }
}

/// Ends a run after some time of reports.
struct EndsAfter(usize);

impl Control for EndsAfter {
    fn progress(&mut self, _: f64) -> Verdict {
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 { Verdict::Finish } else { Verdict::Continue }
    }
}

#[test]
fn a_run_that_is_ended_has_the_count_once_it_was_reached() {
    let mesh = shapes::blob(4, 2);
    let mut options = SimplifyOptions::new(Stop::ratio(0.25));
    let mut reports = Counts(0);
    let plain = simplify_with(&mesh, &options, &mut reports).unwrap();
    options.effort = Effort::Best;
    let mut control = EndsAfter(reports.0 + 3);
    let ended = simplify_with(&mesh, &options, &mut control).unwrap();
    assert_eq!(control.0, 0, "the run was not ended");
    assert_eq!(ended.mesh, plain.mesh);
}

/// Counts reports of progress.
struct Counts(usize);

impl Control for Counts {
    fn progress(&mut self, _: f64) -> Verdict {
        self.0 += 1;
        Verdict::Continue
    }
}

#[test]
fn only_methods_that_collapse_edges_have_an_effort() {
    let mut options = SimplifyOptions::new(Stop::ratio(0.5));
    (options.method, options.effort) = (MethodKind::Cluster.into(), Effort::Best);
    let error = simplify(&shapes::blob(3, 2), &options).unwrap_err();
    assert!(matches!(error, SimplifyError::NotOfMethod { option: "effort best", .. }), "{error}");
}

/// The presets for parts and prints ended in a panic with other methods than those that collapse edges.
#[test]
fn presets_go_with_all_methods() {
    for preset in [Preset::Cad, Preset::Print] {
        for kind in MethodKind::ALL {
            let mut options = SimplifyOptions::preset(preset, Stop::ratio(0.5));
            options.method = kind.into();
            match simplify(&shapes::blob(3, 2), &options) {
                Ok(done) => assert!(done.mesh.face_count() > 0, "{preset:?} {kind:?}"),
                Err(error) => assert!(matches!(error, SimplifyError::NotOfMethod { .. }), "{error}"),
            }
        }
    }
}
