//! Runs that end by an error limit.

use super::context::{Finished, Run, RunOutcome};
use super::level_search::{LevelCounts, LevelTest};
use crate::SimplifyError;
use crate::collapse::{Goal, StopReason};
use crate::control::{Control, Stage, has_time_for};
use crate::cost::metric::with_metric;
use crate::deviation::{Deviation, InputComparer, Judgement, PreparedResult, ROUNDING};
use crate::options::TopologyPolicy;

/// Ratio of successive step limits of a method that is controlled by them.
const TOLERANCE_FACTOR: f64 = 0.8;
/// Number of step limits to try, starting with the largest within the error limit; the last one is zero.
/// (Guessed: a thirtieth of the limit.)
const MAX_TOLERANCES: usize = 16;

/// Share of the faces of a bounded run that a plain run has to stay within the limit with, to be preferred.
const CHALLENGE_SHARE: f64 = 0.9;
/// Maximum number of results that are kept because they seem to be within the limit, until one is proven to
/// be.
const MAX_HELD_RESULTS: usize = 3;

impl Run<'_, '_> {
    /// Returns a result within `limit`: by bounded collapses, or the lightest level of a search for methods that do not
    /// collapse edges. A level is the result of a run to its count, independent of the limit.
    pub(super) fn run_within_error(
        mut self,
        limit: f64,
        control: &mut dyn Control,
    ) -> Result<Finished, SimplifyError> {
        let Some(comparer) = self.input_comparer(control) else {
            return self.unchanged_input(None, false, control);
        };
        // Rounding of double precision alone can amount to this.
        let limit = limit + ROUNDING * self.ordered.diagonal;
        let bounded = with_metric!(self.options.method.kind(), METRIC => self.run_bounded(METRIC, limit, &comparer, control));
        if let Some(found) = bounded {
            let found = found?;
            if let Some(finished) = found {
                let is_over = finished.0.end == StopReason::Finish;
                if is_over || !self.is_beaten(finished.0.mesh.face_count(), limit, &comparer, control)? {
                    return Ok(finished);
                }
            }
        }
        let all = self.ordered.faces.len();
        let counts = LevelCounts::new(all, self.goal.faces.unwrap_or(1).clamp(1, all));
        let run_to = |run: &mut Self, level: usize, control: &mut dyn Control| {
            let goal = Goal { faces: Some(counts.count(level)), vertices: run.goal.vertices };
            run.run_pass(goal, control)
        };
        // The lightest level that seems to be within the limit: a spot check rules out most levels.
        let mut seemingly: Vec<(usize, RunOutcome)> = Vec::new();
        let mut is_over = false;
        let mut level = counts.search(&mut |level| {
            let outcome = run_to(&mut self, level, control)?;
            let (faces, vertices) = (outcome.mesh.face_count(), outcome.mesh.vertex_count());
            is_over = outcome.end == StopReason::Finish;
            control.stage(Stage::Measure);
            let is_near = match PreparedResult::new(&outcome.mesh) {
                Some(made) => comparer.passes_spot_check(&made, limit, control)?,
                None => false,
            };
            if !is_near {
                return Ok(if is_over { LevelTest::Over } else { LevelTest::Beyond });
            }
            if seemingly.len() == MAX_HELD_RESULTS {
                seemingly.remove(0);
            }
            seemingly.push((level, outcome));
            // If a run ends above its count, or by another stop, a lower count does not give fewer faces.
            let is_last = faces > counts.count(level) || self.goal.vertices.is_some_and(|v| vertices <= v);
            Ok(match () {
                () if is_over => LevelTest::Over,
                () if is_last => LevelTest::Last,
                () => LevelTest::Kept,
            })
        })?;
        level = seemingly.last().map_or(level, |last| last.0);
        // From there towards heavier levels, the first that is proven to be within the limit; or, if the caller ends the
        // run before that is known, the first that seems to be.
        while level > 0 {
            let mut outcome = match seemingly.pop_if(|last| last.0 == level) {
                Some((_, outcome)) => outcome,
                None => run_to(&mut self, level, control)?,
            };
            is_over |= outcome.end == StopReason::Finish;
            control.stage(Stage::Measure);
            if let Some(made) = PreparedResult::new(&outcome.mesh) {
                match comparer.proven_within(&made, limit, control)? {
                    Judgement::Within(bound) => {
                        if is_over {
                            outcome.end = StopReason::Finish;
                        }
                        let deviation = comparer.measure_prepared(&made, Some(bound), control)?;
                        return Ok((outcome, deviation, true));
                    }
                    Judgement::Unknown => {
                        outcome.end = StopReason::Finish;
                        return Ok((outcome, Deviation::unknown(), false));
                    }
                    Judgement::Unproven => {}
                }
            }
            if is_over {
                break;
            }
            level -= 1;
        }
        self.unchanged_input(Some(&comparer), is_over, control)
    }

    /// True if a run that does not know the limit, and may remove parts and cut necks, is within it with clearly fewer
    /// faces.
    fn is_beaten(
        &mut self,
        faces: usize,
        limit: f64,
        comparer: &InputComparer,
        control: &mut dyn Control,
    ) -> Result<bool, SimplifyError> {
        let fewer = (faces as f64 * CHALLENGE_SHARE) as usize;
        if self.options.topology == TopologyPolicy::Preserve || fewer < self.goal.faces.unwrap_or(1).max(4) {
            return Ok(false);
        }
        let goal = Goal { faces: Some(fewer), vertices: self.goal.vertices };
        if !has_time_for(Stage::Prepare, control)? {
            return Ok(false);
        }
        let outcome = self.run_pass(goal, control)?;
        control.stage(Stage::Measure);
        match PreparedResult::new(&outcome.mesh).filter(|_| outcome.end == StopReason::Goal) {
            Some(made) => comparer.passes_spot_check(&made, limit, control),
            None => Ok(false),
        }
    }

    /// Returns the unchanged input: not even one collapse stays within the limit, or the run `is_over` before one is known
    /// to.
    fn unchanged_input(
        &mut self,
        comparer: Option<&InputComparer>,
        is_over: bool,
        control: &mut dyn Control,
    ) -> Result<Finished, SimplifyError> {
        let nothing = Goal { faces: Some(usize::MAX), vertices: None };
        let mut outcome = self.run_pass(nothing, control)?;
        if is_over {
            outcome.end = StopReason::Finish;
        }
        control.stage(Stage::Measure);
        let deviation = match comparer {
            Some(comparer) => comparer.measure(&outcome.mesh, None, control)?,
            None => Deviation::default(),
        };
        Ok((outcome, deviation, true))
    }

    /// Returns the result of the largest step within `limit`: for methods that are controlled by a step
    /// limit, not a count.
    ///
    /// Step limits are shares of the diagonal that do not depend on the error limit: they are tried from the
    /// largest that does not exceed it downwards, until a result is within it.
    pub(super) fn run_within_step(
        mut self,
        limit: f64,
        control: &mut dyn Control,
    ) -> Result<Finished, SimplifyError> {
        let comparer = self.input_comparer(control);
        let diagonal = self.ordered.diagonal;
        let allowed = limit + ROUNDING * diagonal;
        let first = libm::log(limit / diagonal) / libm::log(TOLERANCE_FACTOR);
        let mut power = if first.is_finite() { (first - 1e-9).ceil() } else { f64::INFINITY };
        for run in 1.. {
            let is_last = run == MAX_TOLERANCES;
            let step = if is_last { 0.0 } else { diagonal * libm::pow(TOLERANCE_FACTOR, power) };
            self.step = Some(step);
            let mut outcome = self.run_pass(self.goal, control)?;
            control.stage(Stage::Measure);
            let Some(comparer) = &comparer else { return Ok((outcome, Deviation::default(), false)) };
            let judgement = comparer.proven_within_mesh(&outcome.mesh, allowed, control)?;
            if judgement == Judgement::Unknown {
                outcome.end = StopReason::Finish;
                return Ok((outcome, Deviation::unknown(), false));
            }
            let kept = judgement.bound();
            if kept.is_some() || is_last || outcome.end == StopReason::Finish {
                let deviation = comparer.measure(&outcome.mesh, kept, control)?;
                return Ok((outcome, deviation, kept.is_some()));
            }
            power += 1.0;
        }
        unreachable!("the last run returns")
    }
}
