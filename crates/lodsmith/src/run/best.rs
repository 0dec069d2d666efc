//! The effort `best`: runs to the same count under limits below the largest distance of a plain run.
//!
//! ```text
//! plain run, largest distance D ── bounded sweeps to the same count within .7 D ── .6 D ── .5 D
//!                                        │ count out of reach, or larger mean or RMS distance
//!                                        └── within .85 D ── plain sweeps, fitted repeatedly
//! ```

use lodsmith_core::measure::Comparison;

use super::context::{Run, RunOutcome};
use crate::SimplifyError;
use crate::collapse::StopReason;
use crate::collapse::bounded::Sampling;
use crate::control::{Control, Stage, has_time_for};
use crate::cost::metric::Metric;
use crate::deviation::InputComparer;
use crate::options::shared::COLLAPSE_METHODS;

/// Limits that are tried one after the other, as shares of the largest distance of a plain run, until one fails.
const SHARES: [f64; 3] = [0.7, 0.6, 0.5];
/// The limit that is tried if the first one fails.
const SECOND_SHARE: f64 = 0.85;
/// Largest factor by which the mean and the RMS distance may exceed those of the plain run. (Measured on 33 cases: 1.01,
/// 1.03, 1.08, 1.15 give .95, .92, .80, .77 of its largest distance and .99, 1.00, 1.01, 1.02 of its mean in the geometric
/// mean.)
const MAX_MEAN_FACTOR: f64 = 1.08;
/// Samples in each direction for the comparison of results; all vertices are measured too.
const SAMPLES: usize = 20_000;
/// Number of samples of the input that a run keeps within the limit, if its faces are large. (The result is measured, so
/// there is no need of as many as for a proof.)
const RUN_SAMPLES: f64 = 20_000.0;
/// Number of collapses that the limit may refuse in a run, for each face of the input. (Runs that reach their count have
/// at most one for eight faces; wild-cycloidal to 50 % had no end in nine minutes.)
const MAX_REFUSALS_PER_FACE: u64 = 1;
/// Number of fits of each result. (Measured: two bring 2 % of the RMS, three another .5 %.)
const FITS: usize = 3;

/// The input and the plain run, to compare results with.
struct Plain<'a> {
    comparer: &'a InputComparer,
    distances: Comparison,
}

impl Plain<'_> {
    /// True if a result has a smaller largest distance than the plain run, and about the same others. False if the
    /// caller ends the run before that is known.
    fn is_beaten_by(&self, outcome: &RunOutcome, control: &mut dyn Control) -> Result<bool, SimplifyError> {
        let Some(made) = self.comparer.sampled(&outcome.mesh, SAMPLES, control)? else { return Ok(false) };
        let is_near = |of: fn(&Comparison) -> f64| of(&made) <= MAX_MEAN_FACTOR * of(&self.distances);
        Ok(made.hausdorff.symmetric < self.distances.hausdorff.symmetric
            && is_near(|c| c.mean.symmetric)
            && is_near(|c| c.rms.symmetric))
    }
}

impl Run<'_, '_> {
    /// True if the run is to bring the largest distance down at a given count. (Presets ask for it with every method.)
    pub(super) fn is_best(&self) -> bool {
        COLLAPSE_METHODS.contains(&self.options.method.kind())
            && self.options.quick.is_none()
            && !self.goal.is_none()
            && self.options.effort.is_best_for(self.ordered.faces.len())
    }

    /// Returns a result with the same number of faces or vertices as that of a plain run and a smaller largest distance,
    /// if there is one whose mean and RMS distances are about the same; otherwise the plain one. If the caller ends the
    /// run, the best so far.
    ///
    /// Cost: up to four runs of which each collapse is tested.
    pub(super) fn best<M: Metric>(
        &mut self,
        metric: M,
        plain: RunOutcome,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        if !has_time_for(Stage::Measure, control)? {
            return Ok(plain);
        }
        let Some(comparer) = self.input_comparer(control) else { return Ok(plain) };
        let Some(distances) = comparer.sampled(&plain.mesh, SAMPLES, control)? else { return Ok(plain) };
        let before = Plain { comparer: &comparer, distances };
        self.fits = FITS;
        let mut found = None;
        for share in SHARES {
            let Some(next) = self.within_share(metric, share, &before, control)? else { break };
            found = Some(next);
        }
        if found.is_none() {
            found = self.within_share(metric, SECOND_SHARE, &before, control)?;
        }
        if found.is_none() && self.wants_fit(metric.cost_source()) && has_time_for(Stage::Prepare, control)? {
            let fitted = self.run_pass(self.goal, control)?;
            control.stage(Stage::Measure);
            if fitted.end == StopReason::Goal && before.is_beaten_by(&fitted, control)? {
                found = Some(fitted);
            }
        }
        Ok(found.unwrap_or(plain))
    }

    /// Returns the result of a run to the goal within a share of the largest distance of the plain run, if it beats
    /// that. `None` also if the caller ends the run.
    fn within_share<M: Metric>(
        &mut self,
        metric: M,
        share: f64,
        plain: &Plain<'_>,
        control: &mut dyn Control,
    ) -> Result<Option<RunOutcome>, SimplifyError> {
        if !has_time_for(Stage::Prepare, control)? {
            return Ok(None);
        }
        let limit = share * plain.distances.hausdorff.symmetric;
        let (mut trunk, is_over) = self.start_within(metric, limit, plain.comparer, control)?;
        if is_over {
            return Ok(None);
        }
        control.stage(Stage::Collapse);
        let max_refusals = MAX_REFUSALS_PER_FACE * self.ordered.faces.len() as u64;
        let end = self.sweep_bounded(
            &mut trunk,
            (limit, Sampling { dense: &[], samples: RUN_SAMPLES }, max_refusals),
            plain.comparer,
            control,
        )?;
        if end != StopReason::Goal {
            return Ok(None);
        }
        let outcome = self.finish(&mut trunk, end, false, control)?;
        control.stage(Stage::Measure);
        Ok(if plain.is_beaten_by(&outcome, control)? { Some(outcome) } else { None })
    }
}
