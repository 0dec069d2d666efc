//! Targets that count more than the result of a run: all instances of the meshes of a scene, or both sides of
//! sheets. Where that count is known only after a run, it is searched for.

use lodsmith_core::TriMesh;

use super::goal::share;
use crate::SimplifyError;
use crate::options::{Length, Stop};
use crate::report::{Report, StoppedBy};

/// Maximum number of runs in the search for a count.
const MAX_COUNT_RUNS: usize = 6;
/// The search ends at a count that is within the goal and above this fraction of it.
const MIN_COUNT_SHARE: f64 = 0.97;

/// Target of a run, counted over everything that its result stands for.
pub(crate) struct CountedGoal {
    by_ratio: Option<usize>,
    pub(crate) faces: Option<usize>,
    vertices: Option<usize>,
    stop: Stop,
    /// The kind of element that is counted, and the target count.
    pub(crate) counted: fn(&TriMesh) -> usize,
    pub(crate) count: Option<usize>,
    /// Elements of the run per element of the whole.
    share: f64,
}

impl CountedGoal {
    /// Takes the target of a stop; `count` counts elements of the whole input, `run` is the mesh of the run.
    pub(crate) fn new(stop: &Stop, count: impl Fn(fn(&TriMesh) -> usize) -> usize, run: &TriMesh) -> Self {
        let by_ratio = stop.ratio.map(|r| share(r, count(TriMesh::face_count)));
        let faces = stop.faces.into_iter().chain(by_ratio).max();
        let vertices = stop.vertices;
        let counted: fn(&TriMesh) -> usize =
            if faces.is_none() && vertices.is_some() { TriMesh::vertex_count } else { TriMesh::face_count };
        let share = counted(run) as f64 / count(counted).max(1) as f64;
        Self { by_ratio, faces, vertices, stop: *stop, counted, count: faces.or(vertices), share }
    }

    /// Returns the target count of the run, as far as it is known before the run.
    pub(crate) fn wanted(&self) -> Option<f64> {
        self.count.map(|n| n as f64 * self.share)
    }

    /// True if only a count decides, without an error limit.
    pub(crate) fn is_count_alone(&self) -> bool {
        self.count.is_some() && self.stop.error.is_none()
    }

    fn is_within(&self, got: usize) -> bool {
        self.count.is_none_or(|count| got <= count)
    }

    /// Returns the stop of a run with this target count.
    pub(crate) fn own_stop(&self, error: Option<Length>, wanted: Option<f64>) -> Stop {
        let own = |n: f64| (n.floor() as usize).max(1);
        let mut stop = Stop { error, ..Stop::default() };
        match self.faces {
            Some(_) => {
                stop.faces = wanted.map(own);
                stop.vertices = self.vertices.map(|n| own(n as f64 * self.share));
            }
            None => stop.vertices = wanted.map(own),
        }
        stop
    }

    /// Runs until the count is met as closely as possible; only once if the count of the run follows from the
    /// count of the whole (`is_direct`). `run` makes a result for a stop, and returns its count and whether
    /// it met the stop. `max_slope` is the largest number of elements of the whole per element of the run.
    pub(crate) fn search<R>(
        &self,
        is_direct: bool,
        max_slope: f64,
        error: Option<Length>,
        mut run: impl FnMut(Stop) -> Result<(R, usize, bool), SimplifyError>,
    ) -> Result<R, SimplifyError> {
        let mut wanted = self.wanted();
        let (first, got, reached) = run(self.own_stop(error, wanted))?;
        let mut best = (first, got);
        let (mut got, mut reached, mut before) = (got, reached, None);
        for _ in 1..if is_direct { 1 } else { MAX_COUNT_RUNS } {
            let (Some(count), Some(asked)) = (self.count, wanted) else { break };
            if !reached || (got <= count && got as f64 > MIN_COUNT_SHARE * count as f64) {
                break;
            }
            // Elements of the whole per element of the run.
            let slope = before
                .filter(|(x, _): &(f64, f64)| (asked - x).abs() >= 1.0)
                .map_or(1.0 / self.share, |(x, y)| (got as f64 - y) / (asked - x))
                .clamp(0.01, max_slope);
            before = Some((asked, got as f64));
            // Aims a little below the goal, since only counts within it are accepted.
            let aim = count as f64 * (1.0 + MIN_COUNT_SHARE) / 2.0;
            let next = (asked + (aim - got as f64) / slope).max(1.0);
            wanted = Some(next);
            let (result, count_now, reached_now) = run(self.own_stop(error, wanted))?;
            (got, reached) = (count_now, reached_now);
            // The largest count within the goal is best; if none is within, the smallest.
            let is_better = match (self.is_within(best.1), self.is_within(got)) {
                (true, true) => got > best.1,
                (within_before, within_now) => within_now || !within_before && got < best.1,
            };
            if is_better {
                best = (result, got);
            }
        }
        Ok(best.0)
    }

    /// Sets whether the counts of the report meet the stop, whether or not the run met its own share.
    pub(crate) fn judge(&self, report: &mut Report) {
        let stop = &self.stop;
        let met = |n: Option<usize>, count: usize| n.is_some_and(|n| count <= n);
        let [by_faces, by_vertices, by_ratio] = [
            met(stop.faces, report.faces),
            met(stop.vertices, report.vertices),
            met(self.by_ratio, report.faces),
        ];
        if stop.error.is_none() && self.count.is_some() && report.stopped_by != StoppedBy::Caller {
            report.reached = by_faces || by_vertices || by_ratio;
            let by_count = [StoppedBy::Faces, StoppedBy::Vertices, StoppedBy::Ratio];
            if !report.reached && by_count.contains(&report.stopped_by) {
                // The run met its share, but the whole has more elements: no remaining step is small enough.
                report.stopped_by = StoppedBy::Refusals;
            } else if report.reached {
                report.proposals.clear();
                report.stopped_by = match () {
                    () if by_faces => StoppedBy::Faces,
                    () if by_vertices => StoppedBy::Vertices,
                    () => StoppedBy::Ratio,
                };
            }
        }
    }
}
