//! Two-stage simplification: clustering first, then edge collapse, for huge meshes in little time and memory.
//! [Garland-Shaffer 2002]

use lodsmith_core::WedgeId;

use super::model::ClusterPosition;
use super::{ClusterRun, ClusteredMesh, clustered};
use crate::collapse::Goal;
use crate::constraints::HeldWedges;
use crate::control::{Control, Stage};
use crate::deviation::{self, Deviation};
use crate::input::{Input, MeshData};
use crate::options::{Bound, Length, Measure, MethodKind, SimplifyOptions, Stop};
use crate::report::{Clustered, Report, StoppedBy};
use crate::run;
use crate::{Simplified, SimplifyError};

/// Size of the first stage's result, as a multiple of the goal. (Measured in docs/methods/cluster.md.)
const FIRST_STAGE_FACTOR: usize = 8;
/// Largest share of the input that the first stage may leave; above it the stage saves too little.
const MAX_FIRST_STAGE_SHARE: f64 = 0.35;
/// If the first stage may not leave at least this multiple of the goal, it is skipped.
const MIN_FACTOR: f64 = 3.0;
/// Cell size as a share of the error limit, if only the error ends the run. (Measured: the distance is about
/// half a cell diagonal at most, so three quarters and more are left to the collapses.)
const CELL_OF_ERROR: f64 = 0.25;
/// Maximum number of second stages in the search for an error.
const MAX_SECOND_STAGES: usize = 4;

impl<P: ClusterPosition> ClusterRun<'_, P> {
    /// Runs both stages. The second sees only the clustered mesh; distances are measured from the input.
    pub(super) fn in_two_stages(
        mut self,
        control: &mut dyn Control,
    ) -> Result<(Simplified, HeldWedges), SimplifyError> {
        let goal = self.goal;
        let memoryless = SimplifyOptions {
            method: MethodKind::Memoryless.into(),
            weld: None,
            prune: None,
            ..self.options.clone()
        };
        let (first_goal, is_worth_it) = self.first_stage_goal();
        self.goal = first_goal;
        let limit = self.options.stop.error.map(|e| e.in_units(self.diagonal));
        if let Some(limit) = limit {
            // Applies only without a count: an error is no reason to leave more than the goal needs.
            let by_error = self.longest() / (CELL_OF_ERROR * limit.max(f64::MIN_POSITIVE));
            if self.goal.faces.is_none() && self.goal.vertices.is_none() {
                self.coarsest = Some(self.coarsest.unwrap_or(1.0).max(by_error).min(super::MAX_RESOLUTION));
            }
        }
        if !is_worth_it || self.is_met() {
            return without_first_stage(self.input, &memoryless, control);
        }
        let first = self.reach_goal(control)?;
        let clusters = clustered(&first);
        let mesh = &first.mesh;
        let data = MeshData { locked: first.locked.as_deref(), ..self.input.data };
        let input = Input { mesh: mesh.regions().map(|_| mesh), ..Input::new(mesh).with(data) };
        let mut options = SimplifyOptions {
            stop: Stop { faces: goal.faces, vertices: goal.vertices, ..Stop::default() },
            measure: Measure::Auto,
            ..memoryless.clone()
        };
        options.guards.max_edge = options.guards.max_edge.map(|l| Length::Units(l.in_units(self.diagonal)));
        // The second stage bounds the distance from the clustered mesh; the guarantee refers to the input.
        if limit.is_none() {
            options.bound = Bound::Estimate;
        }
        let comparer =
            if deviation::needs_measurement(self.options) { self.input_comparer(control) } else { None };
        let mut share = limit;
        for stage in 1.. {
            options.stop.error = share.map(Length::Units);
            let (done, held) = run::run_by_collapses(&input, &options, control)?;
            let deviation = match &comparer {
                Some(comparer) => {
                    control.stage(Stage::Measure);
                    comparer.measure(&done.mesh, None, control)?
                }
                None => Deviation::default(),
            };
            let got = deviation.largest().unwrap_or(0.0);
            let is_unknown = limit.is_some() && deviation.is_incomplete;
            let is_over = done.report.stopped_by == StoppedBy::Caller || is_unknown;
            if let (Some(limit), Some(own)) = (limit, &mut share)
                && got > limit
                && stage < MAX_SECOND_STAGES
                && !is_over
            {
                *own *= (0.95 * limit / got).clamp(0.2, 0.95);
                continue;
            }
            if done.report.stopped_by == StoppedBy::Refusals && !done.report.reached && !is_over {
                // Merged sheets can block collapses: then the full detail is needed after all.
                let alone = without_first_stage(self.input, &memoryless, control)?;
                if alone.0.report.faces < done.report.faces {
                    return Ok(alone);
                }
            }
            let held = map_held_wedges(&first, &held, done.mesh.face_count());
            let second = done.report;
            let made = ClusteredMesh {
                estimate: libm::hypot(first.estimate, second.error.estimate),
                mesh: done.mesh,
                held,
                ..first
            };
            self.goal = goal;
            self.is_over |= is_over;
            let by = match second.stopped_by {
                StoppedBy::Error if limit.is_some_and(|l| got <= l) => StoppedBy::Error,
                StoppedBy::Error => StoppedBy::Exhausted,
                by => by,
            };
            let (mut both, held) = self.build_report(ClusteredMesh { by, ..made }, deviation)?;
            both.report.clustered = Some(clusters);
            add_second_stage(&mut both.report, second);
            return Ok((both, held));
        }
        unreachable!("the last run returns")
    }

    /// Returns the goal of the first stage, and true if the stage saves enough.
    fn first_stage_goal(&self) -> (Goal, bool) {
        let vertices = self.model.points.len() - self.model.cleanup.unused_vertices;
        let factor = |goal: usize, all: usize| {
            (MAX_FIRST_STAGE_SHARE * all as f64 / goal.max(1) as f64).min(FIRST_STAGE_FACTOR as f64)
        };
        let by_faces = self.goal.faces.map(|n| factor(n, self.model.sound_faces()));
        let by_vertices = self.goal.vertices.map(|n| factor(n, vertices));
        // The first stop met ends the run, so the stop that leaves more faces counts.
        let least = by_faces.into_iter().chain(by_vertices).fold(f64::INFINITY, f64::min);
        let times = |n: usize| (n as f64 * least) as usize;
        let goal = Goal { faces: self.goal.faces.map(times), vertices: self.goal.vertices.map(times) };
        (goal, least >= MIN_FACTOR)
    }
}

/// Adds what the second stage did to a report of the first.
fn add_second_stage(report: &mut Report, second: Report) {
    (report.refusals, report.collapses) = (second.refusals, second.collapses);
    (report.parts_removed, report.necks_cut) = (second.parts_removed, second.necks_cut);
    (report.seams_relaxed, report.fitted) = (second.seams_relaxed, second.fitted);
    report.sharp_relaxed = second.sharp_relaxed;
    report.proposals = second.proposals;
    report.cleanup.duplicate_faces += second.cleanup.duplicate_faces;
}

/// Runs the second stage without the first.
fn without_first_stage(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<(Simplified, HeldWedges), SimplifyError> {
    let (mut done, held) = run::run_by_collapses(input, options, control)?;
    let Report { input_faces: faces, input_vertices: vertices, .. } = done.report;
    done.report.clustered = Some(Clustered { faces, vertices, ..Clustered::default() });
    Ok((done, held))
}

/// Maps the held wedges of the second stage back to the input, through the first.
fn map_held_wedges(first: &ClusteredMesh, second: &HeldWedges, faces: usize) -> HeldWedges {
    let mut source: Vec<Option<WedgeId>> = vec![None; first.mesh.wedge_count()];
    for (f, t) in first.mesh.triangles().iter().enumerate() {
        for (k, w) in t.iter().enumerate() {
            source[w.index()] = first.held.at(f, k).or(source[w.index()]);
        }
    }
    HeldWedges::new((0..faces).map(|f| [0, 1, 2].map(|k| second.at(f, k).and_then(|w| source[w.index()]))))
}
