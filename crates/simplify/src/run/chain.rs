//! Several levels of one input in a single run.
//!
//! ```text
//! trunk      o-----+--------+-------+           sweeps that no goal influences
//!                   \        \       \
//! branches           o        o       o         the last sweeps to a goal, then a fit
//! ```
//!
//! A branch does exactly what a single run does from there on, so a level has the same quality as a single
//! run. If each vertex must be tracked to the next level, there is a single sequence of sweeps from level
//! to level, and only the fit is done on a copy: then each level follows from the previous one by collapses
//! alone.
//!
//! If parts or handles block a level, a second trunk begins in which they are removed in order of cost, as
//! in a single run; the lower levels continue from that.

use lodsmith_core::VertexId;

use super::trunk::Trunk;
use super::{
    Done, Input, Run, RunOutcome, TopologyChanges, build_report, goal, ordered, pass_of, run_shaded,
};
use crate::SimplifyError;
use crate::collapse::cut::may_cut;
use crate::collapse::order::NONE;
use crate::collapse::{Goal, Pause, StopReason};
use crate::constraints::{self, Constraints};
use crate::control::{Control, ProgressShare, Stage};
use crate::deviation::{self, Deviation};
use crate::metric::{Metric, with_metric};
use crate::options::{Method, SimplifyOptions, Stop, TopologyPolicy};

/// For each level, starting with the input, the vertex of the next one that each of its vertices was merged
/// into; [`NONE`](crate::collapse::order::NONE) if its part was removed.
pub(crate) type Mergers = Vec<Vec<VertexId>>;

/// Function that makes the outcomes of all levels in one run.
type Passes =
    fn(&mut Run<'_, '_>, &[Goal], &mut dyn Control) -> Result<Vec<(RunOutcome, usize)>, SimplifyError>;

fn passes_of(method: Method) -> Option<Passes> {
    with_metric!(method, METRIC => |run, goals, control| run.chain(METRIC, goals, control))
}

/// True if one run makes all levels.
pub(crate) fn is_chained(options: &SimplifyOptions, stops: &[Stop]) -> bool {
    passes_of(options.method).is_some() && !options.escalate && stops.iter().all(|s| s.error.is_none())
}

/// Runs to one stop after another, each a count below the previous one. With `is_traced`, returns the
/// mergers.
pub(crate) fn run_chain(
    input: &Input<'_>,
    options: &SimplifyOptions,
    stops: &[Stop],
    is_traced: bool,
    control: &mut dyn Control,
) -> Result<(Vec<Done>, Mergers), SimplifyError> {
    for stop in stops {
        SimplifyOptions { stop: *stop, ..options.clone() }.check()?;
    }
    constraints::check(options, input.surface.positions().len())?;
    let mut mergers = Mergers::new();
    let all = run_shaded(input, &options.with_own_placement(), &mut |input, options| {
        let (all, own) = chain_by_method(input, options, stops, is_traced, control)?;
        mergers = own;
        Ok(all)
    })?;
    Ok((all, mergers))
}

fn chain_by_method(
    input: &Input<'_>,
    options: &SimplifyOptions,
    stops: &[Stop],
    is_traced: bool,
    control: &mut dyn Control,
) -> Result<(Vec<Done>, Mergers), SimplifyError> {
    let mut in_order = ordered(input, control)?;
    let of_levels: Vec<SimplifyOptions> =
        stops.iter().map(|stop| SimplifyOptions { stop: *stop, ..options.clone() }).collect();
    let faces = input.surface.triangles().len();
    let goals: Vec<Goal> = of_levels.iter().map(|own| goal(own, faces)).collect();
    let care = Constraints::new(options, &in_order, |v| input.joined(v));
    let first = goals.first().copied().unwrap_or_default();
    let pass = pass_of(options.method);
    let mut run =
        Run { input, options, ordered: &mut in_order, goal: first, constraints: &care, pass, is_traced };
    let passes = passes_of(options.method).expect("only methods of sweeps come here");
    let outcomes = passes(&mut run, &goals, control)?;
    let mergers = if is_traced { run.mergers(&outcomes) } else { Mergers::new() };
    let judge = if deviation::needs_measurement(options) { run.input_comparer(control) } else { None };
    let look = |outcome: &RunOutcome| {
        judge.as_ref().map_or_else(Deviation::default, |judge| judge.measure(&outcome.mesh, None))
    };
    let looked: Vec<Deviation> = outcomes.iter().map(|(outcome, _)| look(outcome)).collect();
    let finished = outcomes.into_iter().zip(looked).zip(&of_levels);
    let all = finished.map(|((outcome, deviation), own)| {
        build_report(input, own, &in_order, &care, (outcome.0, deviation, false))
    });
    Ok((all.collect(), mergers))
}

impl Run<'_, '_> {
    /// Returns the outcome of each goal, and the number of its trunk.
    fn chain<M: Metric>(
        &mut self,
        metric: M,
        goals: &[Goal],
        control: &mut dyn Control,
    ) -> Result<Vec<(RunOutcome, usize)>, SimplifyError> {
        let is_free = self.options.topology == TopologyPolicy::Free;
        let mut leave = TopologyChanges { parts: is_free, cuts: is_free, seams: false };
        let mut trunk: Option<Trunk<M>> = None;
        let mut number = 0;
        let mut outcomes: Vec<(RunOutcome, usize)> = Vec::with_capacity(goals.len());
        for i in 0..goals.len() {
            let control = &mut ProgressShare::of(control, i, goals.len());
            let mut outcome = self.level(metric, &mut trunk, (i, goals), leave, control)?;
            let may_change = self.options.topology == TopologyPolicy::Relaxed;
            let is_short =
                outcome.parts_removed > 0 || outcome.end == StopReason::Stuck || outcome.has_rivals();
            if may_change && !leave.parts && is_short && outcome.end != StopReason::Finish {
                // Parts and handles block collapses: start a trunk in which they are removed in order of
                // cost.
                let (mut second, mut own) =
                    (None, TopologyChanges { parts: true, cuts: may_cut(self.options), ..leave });
                let mut other = self.level(metric, &mut second, (i, goals), own, control)?;
                if other.has_touching_vertices && other.end != StopReason::Finish {
                    (second, own.cuts) = (None, false);
                    other = self.level(metric, &mut second, (i, goals), own, control)?;
                }
                if outcome.parts_removed > 0 || self.closest_index(&[&outcome, &other], None, control) == 1 {
                    (trunk, leave, outcome) = (second, own, other);
                    number += 1;
                } else {
                    outcome.proposals = other.proposals;
                }
            } else if may_change
                && leave.cuts
                && outcome.has_touching_vertices
                && outcome.end != StopReason::Finish
            {
                (trunk, leave.cuts) = (None, false);
                outcome = self.level(metric, &mut trunk, (i, goals), leave, control)?;
                number += 1;
            }
            let is_last = outcome.end == StopReason::Finish;
            outcomes.push((outcome, number));
            if is_last {
                break;
            }
        }
        Ok(outcomes)
    }

    /// Sweeps a trunk to a level, from its start if there is none yet, and builds the result.
    fn level<M: Metric>(
        &mut self,
        metric: M,
        trunk: &mut Option<Trunk<M>>,
        (i, goals): (usize, &[Goal]),
        leave: TopologyChanges,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        let goal = &goals[i];
        let mut grown = match trunk.take() {
            Some(mut trunk) => {
                control.stage(Stage::Collapse);
                let weights = trunk.root.weights.get(i).map(Vec::as_slice);
                match &mut trunk.sweeps {
                    Some(sweeps) => trunk.engine.lower_goal(sweeps, goal, weights),
                    None => trunk.engine.reopen(weights),
                }
                trunk
            }
            None => {
                let mut trunk = self.begin(metric, None, leave, (goals, i), control)?;
                if !self.is_traced {
                    trunk.sweeps = Some(trunk.engine.begin_sweeps(goal));
                }
                trunk
            }
        };
        let (mut engine, end) = match &mut grown.sweeps {
            None => {
                let end = self.sweep(&mut grown, goal, control)?;
                (grown.engine.clone(), end)
            }
            Some(sweeps) => {
                let source = self.source(&grown.root);
                let ended = grown.engine.resume_sweeps(sweeps, goal, Pause::BeforeGoal, &source, control);
                let mut branch = grown.engine.branch();
                let end = match ended {
                    Some(end) => end,
                    None => {
                        let own = &mut sweeps.clone();
                        branch
                            .resume_sweeps(own, goal, Pause::Never, &source, control)
                            .unwrap_or(StopReason::Stuck)
                    }
                };
                if end == StopReason::Cancel {
                    return Err(SimplifyError::Cancelled);
                }
                branch.mesh.store.finish();
                (branch, end)
            }
        };
        let is_last = leave.parts || goal.is_none() || self.options.topology == TopologyPolicy::Preserve;
        let outcome =
            self.finish(&mut engine, &grown.root, end, end == StopReason::Stuck && is_last, control)?;
        *trunk = Some(grown);
        Ok(outcome)
    }

    /// Returns the vertices of the next level that the vertices of each level were merged into.
    fn mergers(&self, outcomes: &[(RunOutcome, usize)]) -> Mergers {
        let home = |homes: &[VertexId], number: VertexId| homes.get(number.index()).copied().unwrap_or(NONE);
        let count = self.input.surface.positions().len();
        let mut mergers = Mergers::new();
        for (k, (outcome, trunk)) in outcomes.iter().enumerate() {
            let Some(trace) = &outcome.trace else { return Mergers::new() };
            mergers.push(match k.checked_sub(1).map(|k| &outcomes[k]) {
                None => (0..count)
                    .map(|v| self.ordered.rank[self.input.joined(VertexId::new(v)).index()])
                    .map(|number| home(&trace.homes, number))
                    .collect(),
                Some((RunOutcome { trace: Some(before), .. }, own)) => {
                    // Vertices created by cuts have numbers of their own, which another trunk does not
                    // know.
                    let numbers = if own == trunk { &before.origins } else { &before.places };
                    numbers.iter().map(|&number| home(&trace.homes, number)).collect()
                }
                Some(_) => return Mergers::new(),
            });
        }
        mergers
    }
}
