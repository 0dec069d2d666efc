//! Runs of all methods but clustering, from a prepared input to a result with its report.
//!
//! ```text
//! order the input                                                                  (this file, collapse/order)
//! make passes until the stop of the options is met
//!     a count    one pass; if it contracted pairs, one without them too            (this file)
//!                effort `best`: then passes under limits below its largest error   (best)
//!     an error   one run whose every collapse is tested                            (bounded)
//!                for other methods passes to several counts, or step limits        (within, level_search)
//!     a chain    a pass to each level, with a common start                         (chain)
//! measure the result, and report                                                   (report)
//!
//! a pass is a run of the engine, or `methods::rebuild` for methods that build a new surface
//!     several runs compete where parts, handles or seams block a run               (race, closest)
//! a run of the engine: start, sweep, fit, build the mesh                           (trunk, start, result)
//! ```

mod best;
mod bounded;
mod chain;
mod closest;
mod context;
mod counted;
mod goal;
pub(crate) mod level_search;
mod race;
mod recorded;
mod report;
mod result;
mod start;
mod trunk;
mod within;

use lodsmith_core::VertexId;
use lodsmith_core::mesh::defects::is_zero_area;

use crate::SimplifyError;
use crate::collapse::StopReason;
use crate::collapse::order::{self, Ordered};
use crate::constraints::{self, Constraints};
use crate::control::{Control, Stage, Verdict};
use crate::cost::metric::with_metric;
use crate::input::Input;
use crate::options::{MethodKind, SimplifyOptions};
pub(crate) use chain::{Mergers, chain, is_chained};
use context::Finished;
pub(crate) use context::{Done, EngineOutcome, Pass, RelaxedRules, Run, RunOutcome};
pub(crate) use counted::CountedGoal;
pub(crate) use goal::{goal, share};
use report::build_report;
pub(crate) use report::names_of_dropped;
pub(crate) use start::Root;

/// Returns the pass of a method that works by sweeps.
pub(crate) fn collapses(method: MethodKind) -> Option<Pass> {
    with_metric!(method, METRIC => |run, goal, control| run.one_pass(METRIC, goal, control))
}

/// Runs a method that collapses edges on an input that needs no preparation.
///
/// # Panics
///
/// If the options have another method.
pub(crate) fn run_collapses(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    options.check(&input.data)?;
    constraints::check(&input.data, input.surface.positions().len())?;
    run_by_collapses(input, &options.with_own_placement(), control)
}

/// Runs a method that collapses edges, with options that were checked.
///
/// # Panics
///
/// If the options have another method.
pub(crate) fn run_by_collapses(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    let pass = collapses(options.method.kind()).expect("only methods that collapse edges get here");
    run_with(pass, input, options, control)
}

/// Runs by a pass to the goal of the options, or within their error limit.
pub(crate) fn run_with(
    pass: Pass,
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    let ordered = ordered(input, control)?;
    run_ordered(pass, input, options, ordered, control)
}

/// [`run_with`] on an input that is ordered already.
pub(crate) fn run_ordered(
    pass: Pass,
    input: &Input<'_>,
    options: &SimplifyOptions,
    mut ordered: Ordered,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    let limit = options.stop.error.map(|e| e.in_units(ordered.diagonal));
    let constraints = Constraints::new(&input.data, &ordered, |v| input.joined(v));
    let run = Run::new(input, options, &mut ordered, &constraints, pass);
    let finished = match limit {
        Some(limit) if options.method.limits_error_by_step() => run.run_within_step(limit, control)?,
        Some(limit) => run.run_within_error(limit, control)?,
        None => run.run_to_goal(control)?,
    };
    Ok(build_report(input, options, &ordered, &constraints, finished))
}

/// Orders the input; returns an error if no face has an area.
pub(crate) fn ordered(input: &Input<'_>, control: &mut dyn Control) -> Result<Ordered, SimplifyError> {
    control.stage(Stage::Prepare);
    if control.progress(0.0) == Verdict::Cancel {
        return Err(SimplifyError::Cancelled);
    }
    let surface = &input.surface;
    let ordered = order::order(surface);
    let has_area =
        |t: &[VertexId; 3]| ordered.is_sound(t) && !is_zero_area(t.map(|v| surface.positions().get(v)));
    if !surface.triangles().iter().any(has_area) {
        return Err(SimplifyError::NoFaces { faces: surface.triangles().len() });
    }
    Ok(ordered)
}

impl Run<'_, '_> {
    /// Runs one pass to the goal, and measures it if requested.
    fn run_to_goal(mut self, control: &mut dyn Control) -> Result<Finished, SimplifyError> {
        let mut outcome = self.run_pass(self.goal, control)?;
        if outcome.tally.pairs_contracted > 0 && !self.goal.is_none() && outcome.end != StopReason::Finish {
            // Parts that were joined can no longer be removed one by one, so the target may be harder to
            // reach.
            let method = self.options.method.with_pairs(None);
            let options = SimplifyOptions { method, ..self.options.clone() };
            let mut other = Run { options: &options, ordered: &mut *self.ordered, ..self };
            let without = other.run_pass(self.goal, control)?;
            outcome = self.closest(vec![outcome, without], Some(0), control)?;
        }
        if self.is_best() && outcome.end == StopReason::Goal {
            outcome = with_metric!(self.options.method.kind(), METRIC => self.best(METRIC, outcome, control))
                .expect("only methods that collapse edges have an effort")?;
        }
        let deviation = self.measured(&[&outcome.mesh], control)?.pop().unwrap_or_default();
        Ok((outcome, deviation, false))
    }
}
