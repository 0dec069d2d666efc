//! Threads, progress and cancellation, for all methods.

use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::{Bound, Measure, simplify_with};

use super::*;

fn in_threads<T: Send>(n: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads start").install(work)
}

#[test]
fn runs_are_repeatable_with_any_number_of_threads() {
    let mut all = Complaints::default();
    for promise in PROMISES.iter() {
        let mut meshes = shapes::all();
        meshes.push(("large_blob", shapes::blob(5, 3)));
        for (name, mesh) in meshes {
            for stop in [Stop::ratio(0.3), Stop::faces(12)] {
                let options = options(promise.method, stop);
                let case = case(name, &options);
                let results = [1, 2, 1].map(|n| in_threads(n, || simplify(&mesh, &options)));
                let [Ok(one), Ok(two), Ok(again)] = results else {
                    all.add(&case, ["fails".to_owned()]);
                    continue;
                };
                let same =
                    |a: &Simplified, b: &Simplified| bytes(&a.mesh) == bytes(&b.mesh) && a.report == b.report;
                all.check(&case, same(&one, &again), "a second run gives another result");
                all.check(&case, same(&one, &two), "two threads give another result");
            }
        }
    }
    all.report_all();
}

/// A control that gives an answer from the n-th call on, and checks that progress never decreases.
struct CheckingControl {
    questions: usize,
    from: usize,
    verdict: Verdict,
    last: f64,
    wrongs: Vec<String>,
}

impl CheckingControl {
    fn new(from: usize, verdict: Verdict) -> Self {
        Self { questions: 0, from, verdict, last: 0.0, wrongs: Vec::new() }
    }
}

impl Control for CheckingControl {
    fn stage(&mut self, _: Stage) {
        self.last = 0.0;
    }
    fn progress(&mut self, done: f64) -> Verdict {
        if !(done >= self.last && done <= 1.0) {
            self.wrongs.push(format!("progress {done} after {}", self.last));
        }
        self.last = done;
        self.questions += 1;
        if self.questions > self.from { self.verdict } else { Verdict::Continue }
    }
}

/// Minimum number of progress reports of a run on [`large`]: "a few thousand steps" are 16 thousand here.
const MIN_PROGRESS_REPORTS: usize = 5;

/// Large enough for several progress reports.
fn large() -> TriMesh {
    shapes::blob(6, 2)
}

#[test]
fn callers_get_progress_and_can_end_runs() {
    let mut all = Complaints::default();
    let mesh = large();
    for promise in PROMISES.iter() {
        let options = options(promise.method, Stop::ratio(0.05));
        let case = case("a large blob", &options);
        let mut watching = CheckingControl::new(usize::MAX, Verdict::Continue);
        let Ok(whole) = simplify_with(&mesh, &options, &mut watching) else {
            all.add(&case, ["fails".to_owned()]);
            continue;
        };
        all.add(&case, watching.wrongs);
        let asked = watching.questions;
        let text = format!("{asked} progress reports for {} faces", mesh.face_count());
        // Clustering reports each pass, of a few milliseconds.
        let least = if promise.method == MethodKind::Cluster { 2 } else { MIN_PROGRESS_REPORTS };
        all.check(&case, asked >= least, &text);
        for from in [0, 1, asked / 2, asked.saturating_sub(1)] {
            let mut control = CheckingControl::new(from, Verdict::Cancel);
            let done = simplify_with(&mesh, &options, &mut control);
            let text = format!("cancelled at report {} of {asked}, it continues", from + 1);
            all.check(&case, matches!(done, Err(SimplifyError::Cancelled)), &text);

            let mut control = CheckingControl::new(from, Verdict::Finish);
            let case = format!("{case}, finished at report {} of {asked}", from + 1);
            let done = match simplify_with(&mesh, &options, &mut control) {
                Ok(done) => done,
                Err(error) => {
                    all.add(&case, [format!("fails: {error}")]);
                    continue;
                }
            };
            all.add(&case, defect_complaints(&mesh, &options, promise, &done));
            let (faces, report) = (done.mesh.face_count(), &done.report);
            let is_counted = (report.faces, report.vertices) == (faces, done.mesh.vertex_count());
            all.check(&case, is_counted, "the report has the counts of another mesh");
            all.check(&case, faces > 0 && faces <= mesh.face_count(), &format!("{faces} faces"));
            if report.stopped_by == StoppedBy::Caller {
                all.check(
                    &case,
                    !report.reached,
                    "ended by the caller, but the report says that the stop was reached",
                );
            } else {
                // The work left after the answer is done nevertheless.
                all.check(&case, from > 1, "it continues");
                all.check(
                    &case,
                    faces == whole.mesh.face_count(),
                    "neither the whole result nor an early one",
                );
            }
        }
    }
    all.report_all();
}

#[test]
fn a_search_for_an_error_can_be_ended() {
    let mut all = Complaints::default();
    let mesh = shapes::blob(3, 2);
    for promise in PROMISES.iter() {
        let options = options(promise.method, Stop::error(Length::OfDiagonal(0.005)));
        let case = case("a blob", &options);
        let mut watching = CheckingControl::new(usize::MAX, Verdict::Continue);
        let whole = simplify_with(&mesh, &options, &mut watching);
        all.check(&case, whole.is_ok(), "fails");
        for from in [0, watching.questions / 2, watching.questions.saturating_sub(1)] {
            let done = simplify_with(&mesh, &options, &mut CheckingControl::new(from, Verdict::Cancel));
            let text = format!("cancelled at report {} of {}, it continues", from + 1, watching.questions);
            all.check(&case, matches!(done, Err(SimplifyError::Cancelled)), &text);
        }
        let from = watching.questions / 2;
        let Ok(done) = simplify_with(&mesh, &options, &mut CheckingControl::new(from, Verdict::Finish))
        else {
            all.add(&case, [format!("finished at report {}, it fails", from + 1)]);
            continue;
        };
        let error = &done.report.error;
        let limit = 0.005 * error.diagonal;
        let text = format!("finished at report {}: {error:?} beyond {limit}", from + 1);
        // Without time for a proof, the report says so.
        let is_within = |bound: f64| bound <= 1.0001 * limit;
        let is_unknown = error.is_incomplete && done.report.stopped_by == StoppedBy::Caller;
        all.check(&case, error.bound.map_or(is_unknown, is_within), &text);
        // (What is returned then has passed a test of samples.)
        let found = compare(&mesh.surface(), &done.mesh.surface(), &CompareOptions::default());
        all.check(&case, found.is_ok_and(|found| found.hausdorff.symmetric <= 1.1 * limit), &text);
    }
    all.report_all();
}

#[test]
fn a_result_is_measured_wholly_or_not_at_all() {
    let mut all = Complaints::default();
    let mesh = shapes::blob(2, 2);
    for promise in PROMISES.iter() {
        let mut options = options(promise.method, Stop::ratio(0.3));
        (options.measure, options.bound) = (Measure::Always, Bound::TwoSided);
        let case = case("a blob", &options);
        let mut watching = CheckingControl::new(usize::MAX, Verdict::Continue);
        let Ok(whole) = simplify_with(&mesh, &options, &mut watching) else {
            all.add(&case, ["fails".to_owned()]);
            continue;
        };
        all.check(&case, !whole.report.error.is_incomplete, "incomplete without an end");
        // At the last questions the result is measured and proven.
        for before in [1, 2, 4, 7] {
            let from = watching.questions.saturating_sub(before);
            let case = format!("{case}, finished at report {} of {}", from + 1, watching.questions);
            let mut control = CheckingControl::new(from, Verdict::Finish);
            let Ok(done) = simplify_with(&mesh, &options, &mut control) else {
                all.add(&case, ["fails".to_owned()]);
                continue;
            };
            let (error, full) = (&done.report.error, &whole.report.error);
            all.check(&case, error.is_incomplete, "complete after the end");
            all.check(&case, error.bound.is_none(), "a bound that is not proven");
            let is_known = error.measured.is_none() || error.measured == full.measured;
            all.check(&case, is_known, "part of a measurement");
        }
    }
    all.report_all();
}
