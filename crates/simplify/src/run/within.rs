//! Runs that end by an error.

use super::ladder::{Answer, Ladder};
use super::{Finished, Run, RunOutcome};
use crate::SimplifyError;
use crate::collapse::{Goal, StopReason};
use crate::control::{Control, Stage};
use crate::deviation::{Deviation, InputComparer, PreparedResult, ROUNDING};

/// Each step of a method that goes by steps is so much of the one before...
const TOLERANCE_FACTOR: f64 = 0.8;
/// ... and the first so many steps long that is no longer than the limit; then comes none at all. (Guessed: a thirtieth of
/// it.)
const MAX_TOLERANCES: usize = 16;

/// Of so many levels that seem to keep the limit the results are held until one is proven to.
const MAX_HELD_RESULTS: usize = 3;

impl Run<'_, '_> {
    /// The lightest level of the ladder that keeps to `limit`.
    ///
    /// A level is what a run to its count makes, whatever the limit.
    pub(super) fn run_within_error(
        mut self,
        limit: f64,
        control: &mut dyn Control,
    ) -> Result<Finished, SimplifyError> {
        let Some(judge) = self.judge(control) else { return self.untouched(None, control) };
        // What rounding of double precision alone amounts to.
        let limit = limit + ROUNDING * self.ordered.diagonal;
        let all = self.ordered.faces.len();
        let ladder = Ladder::new(all, self.goal.faces.unwrap_or(1).clamp(1, all));
        let mut pass = super::passes_of_search(self.options.method);
        let mut run_to = |run: &mut Self, level: usize, control: &mut dyn Control| {
            let goal = Goal { faces: Some(ladder.count(level)), vertices: run.goal.vertices };
            pass(run, goal, control)
        };
        // The lightest that seems to keep the limit: most levels are told by some places of theirs.
        let mut seemingly: Vec<(usize, RunOutcome)> = Vec::new();
        let mut is_over = false;
        let mut level = ladder.search(&mut |level| {
            let outcome = run_to(&mut self, level, control)?;
            let (faces, vertices) = (outcome.mesh.face_count(), outcome.mesh.vertex_count());
            is_over = outcome.end == StopReason::Finish;
            control.stage(Stage::Measure);
            if !PreparedResult::new(&outcome.mesh).is_some_and(|made| judge.passes_spot_check(&made, limit)) {
                return Ok(if is_over { Answer::Over } else { Answer::Beyond });
            }
            if seemingly.len() == MAX_HELD_RESULTS {
                seemingly.remove(0);
            }
            seemingly.push((level, outcome));
            // Where a run ends above its count, or by another one, fewer faces are not to be had by asking for fewer.
            let is_last = faces > ladder.count(level) || self.goal.vertices.is_some_and(|v| vertices <= v);
            Ok(match () {
                () if is_over => Answer::Over,
                () if is_last => Answer::Last,
                () => Answer::Kept,
            })
        })?;
        level = seemingly.last().map_or(level, |last| last.0);
        // From there up, the first that is proven to.
        while level > 0 {
            let mut outcome = match seemingly.pop_if(|last| last.0 == level) {
                Some((_, outcome)) => outcome,
                None => run_to(&mut self, level, control)?,
            };
            is_over |= outcome.end == StopReason::Finish;
            control.stage(Stage::Measure);
            if let Some(made) = PreparedResult::new(&outcome.mesh)
                && let Some(bound) = judge.proven_within(&made, limit)
            {
                if is_over {
                    outcome.end = StopReason::Finish;
                }
                return Ok((outcome, judge.measure_prepared(&made, Some(bound)), true));
            }
            if is_over {
                break;
            }
            level -= 1;
        }
        self.untouched(Some(&judge), control)
    }

    /// The input as it is: not even one collapse keeps the limit.
    fn untouched(
        &mut self,
        judge: Option<&InputComparer>,
        control: &mut dyn Control,
    ) -> Result<Finished, SimplifyError> {
        let nothing = Goal { faces: Some(usize::MAX), vertices: None };
        let outcome = self.go(nothing, None, control)?;
        let deviation = judge.map_or_else(Deviation::default, |judge| judge.measure(&outcome.mesh, None));
        Ok((outcome, deviation, true))
    }

    /// The result of the largest step that keeps to `limit`: for methods that a step ends, and no count.
    ///
    /// Steps are shares of the diagonal that do not depend on the limit: from the largest that is no longer than it down, the
    /// first that keeps it.
    pub(super) fn run_within_step(
        mut self,
        limit: f64,
        control: &mut dyn Control,
    ) -> Result<Finished, SimplifyError> {
        let judge = self.judge(control);
        let diagonal = self.ordered.diagonal;
        let allowed = limit + ROUNDING * diagonal;
        let first = (limit / diagonal).ln() / TOLERANCE_FACTOR.ln();
        let mut power = if first.is_finite() { (first - 1e-9).ceil() } else { f64::INFINITY };
        for run in 1.. {
            let is_last = run == MAX_TOLERANCES;
            let step = if is_last { 0.0 } else { diagonal * TOLERANCE_FACTOR.powf(power) };
            let outcome = self.go(self.goal, Some(step), control)?;
            control.stage(Stage::Measure);
            let kept = judge.as_ref().and_then(|judge| judge.proven_within_mesh(&outcome.mesh, allowed));
            if kept.is_some() || is_last || outcome.end == StopReason::Finish {
                let look = |judge: &InputComparer| judge.measure(&outcome.mesh, kept);
                let deviation = judge.as_ref().map_or_else(Deviation::default, look);
                return Ok((outcome, deviation, kept.is_some()));
            }
            power += 1.0;
        }
        unreachable!("the last run returns")
    }
}
