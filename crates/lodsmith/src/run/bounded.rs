//! Runs within an error limit that test every collapse against it.
//!
//! ```text
//! input ── sweeps without a limit, while samples are well within it ── bounded sweeps ── fit ── proof of the whole
//!                                                                         ▲                     │ fails
//!                                                                         └── denser samples ◄──┘ there
//! ```

use std::sync::Arc;

use lodsmith_core::measure::Prepared;
use lodsmith_core::{PositionsView, Surface};

use super::context::{Finished, Run, RunOutcome, TopologyChanges};
use super::trunk::Trunk;
use crate::SimplifyError;
use crate::collapse::bounded::{Bounded, Sampling};
use crate::collapse::{Engine, Goal, Pause, StopReason};
use crate::control::{Control, Stage};
use crate::cost::metric::Metric;
use crate::deviation::{Deviation, InputComparer, Judgement, PreparedResult};
use crate::options::TopologyPolicy;
use crate::report::Refusal;

/// The bounded sweeps start at the last of the levels, each this share of the one before, ...
const START_STEP: f64 = 0.6;
/// ... at which samples are within this share of the limit. (Measured on bunny, horse and nefertiti: .3 to .7 give
/// equal counts within 3 %, .7 in 3/4 of the time.)
const START_SHARE: f64 = 0.7;
/// Number of samples on the input, if the limit asks for so many.
const SAMPLES: f64 = 180_000.0;
/// Number of faces below which they do not start later.
const MIN_START_FACES: usize = 20;
/// Shares of the limit that the bounded sweeps use, until the whole is proven.
const LIMIT_SHARES: [f64; 6] = [0.999, 0.999, 0.999, 0.999, 0.995, 0.99];

impl Run<'_, '_> {
    /// Returns the result of collapses that are each tested against the limit; `None` if no result is proven to be
    /// within it. If the caller ends the run before a result is proven, it has no bound.
    pub(super) fn run_bounded<M: Metric>(
        &mut self,
        metric: M,
        limit: f64,
        comparer: &InputComparer,
        control: &mut dyn Control,
    ) -> Result<Option<Finished>, SimplifyError> {
        let (mut trunk, mut is_over) = self.start_within(metric, limit, comparer, control)?;
        let mut dense = Vec::new();
        for share in LIMIT_SHARES {
            if is_over {
                break;
            }
            let mut branch = trunk.branch();
            control.stage(Stage::Collapse);
            let end = self.sweep_bounded(
                &mut branch,
                (share * limit, Sampling { dense: &dense, samples: SAMPLES }, u64::MAX),
                comparer,
                control,
            )?;
            let outcome = self.finish(&mut branch, end, false, control)?;
            control.stage(Stage::Measure);
            let Some(made) = PreparedResult::new(&outcome.mesh) else { return Ok(None) };
            let found = proven(outcome, &made, limit, comparer, control)?;
            if found.is_some() {
                return Ok(found);
            }
            is_over = end == StopReason::Finish;
            if let (Some(bounded), false) = (&branch.engine.mesh.bounded, is_over) {
                // (A face that fails again is listed once more.)
                dense.extend(bounded.faces_beyond(made.prepared(), share * limit));
                dense.sort_unstable();
            }
        }
        if !is_over {
            return Ok(None);
        }
        // The caller ends the run: the start is the last state that is known to be within the limit.
        let mut outcome = self.finish(&mut trunk, StopReason::Finish, false, control)?;
        outcome.end = StopReason::Finish;
        control.stage(Stage::Measure);
        let Some(made) = PreparedResult::new(&outcome.mesh) else { return Ok(None) };
        proven(outcome, &made, limit, comparer, control)
    }

    /// Sweeps without a limit as far as samples stay well within it. Also returns true if the caller ends the run.
    pub(super) fn start_within<M: Metric>(
        &mut self,
        metric: M,
        limit: f64,
        comparer: &InputComparer,
        control: &mut dyn Control,
    ) -> Result<(Trunk<M>, bool), SimplifyError> {
        let changes = TopologyChanges::from_start(self.options);
        let mut most_levels = usize::MAX;
        loop {
            let mut trunk = self.begin(metric, changes, (&[], 0), control);
            let mut faces = trunk.engine.mesh.store.live_faces;
            let mut levels = 0;
            while levels < most_levels {
                faces = (faces as f64 * START_STEP) as usize;
                if faces < self.goal.faces.unwrap_or(0).max(MIN_START_FACES) {
                    break;
                }
                control.stage(Stage::Collapse);
                let goal = Goal { faces: Some(faces), vertices: self.goal.vertices };
                let before = trunk.branch();
                let end = self.resume(&mut trunk, &goal, Pause::Never, control)?;
                trunk.sweeps = None;
                if end != Some(StopReason::Goal) {
                    trunk = before;
                    trunk.engine.mesh.store.compact();
                    if end == Some(StopReason::Finish) {
                        return Ok((trunk, true));
                    }
                    break;
                }
                trunk.engine.mesh.store.compact();
                control.stage(Stage::Measure);
                let is_near = match self.prepared(&trunk.engine) {
                    Some(made) => comparer.passes_spot_check(&made, START_SHARE * limit, control)?,
                    None => false,
                };
                if !is_near {
                    trunk = before;
                    break;
                }
                levels += 1;
            }
            trunk.engine.mesh.store.compact();
            // (A place that is beyond the limit already stays so.)
            if levels == 0 {
                return Ok((trunk, false));
            }
            if let Some(made) = self.prepared(&trunk.engine) {
                match comparer.proven_within(&made, LIMIT_SHARES[0] * limit, control)? {
                    Judgement::Within(_) => return Ok((trunk, false)),
                    Judgement::Unknown => return Ok((trunk, true)),
                    Judgement::Unproven => {}
                }
            }
            most_levels = levels - 1;
        }
    }

    /// Sweeps under a limit.
    pub(super) fn sweep_bounded<M: Metric>(
        &self,
        trunk: &mut Trunk<M>,
        (limit, sampling, max_refusals): (f64, Sampling<'_>, u64),
        comparer: &InputComparer,
        control: &mut dyn Control,
    ) -> Result<StopReason, SimplifyError> {
        let source = self.source(&trunk.root);
        let mut bounded = source.visit(|points, faces| {
            let input = Arc::clone(comparer.reference());
            let kept = if comparer.is_two_sided() { Some(sampling) } else { None };
            let map = self.constraints.error_map().zip(comparer.map());
            let frame = self.ordered.frame;
            let bounded = Bounded::new(input, frame, limit, (points, faces), kept, &trunk.engine.mesh.store);
            bounded.with_map(map)
        });
        bounded.max_refusals = max_refusals;
        trunk.engine.set_limit(bounded);
        let end = self.sweep(trunk, None, &self.goal, control)?;
        if end == StopReason::Exhausted
            && self.options.topology != TopologyPolicy::Preserve
            && sampling.dense.is_empty()
        {
            trunk.engine.remove_parts_within();
        }
        Ok(end)
    }

    /// Returns the mesh of a compact engine, to measure it.
    fn prepared<M: Metric>(&self, engine: &Engine<M>) -> Option<PreparedResult> {
        let place = |x: &crate::collapse::vertex::Vertex<M::Memory>| {
            self.ordered.frame.user_from_unit(x.p.as_dvec3())
        };
        let positions: Vec<[f64; 3]> = engine.mesh.store.v.iter().map(place).collect();
        let surface = Surface::new(PositionsView::F64(&positions), &engine.mesh.store.t).ok()?;
        Prepared::new(&surface).ok().map(PreparedResult::of)
    }
}

/// Returns a finished run if its result is proven to be within the limit, or if the caller ends the run before that is
/// known; then it has no bound.
fn proven(
    mut outcome: RunOutcome,
    made: &PreparedResult,
    limit: f64,
    comparer: &InputComparer,
    control: &mut dyn Control,
) -> Result<Option<Finished>, SimplifyError> {
    let bound = match comparer.proven_within(made, limit, control)? {
        Judgement::Within(bound) => bound,
        Judgement::Unproven => return Ok(None),
        Judgement::Unknown => {
            outcome.end = StopReason::Finish;
            return Ok(Some((outcome, Deviation::unknown(), false)));
        }
    };
    let deviation = comparer.measure_prepared(made, Some(bound), control)?;
    // Without a refusal by the limit, it was not what ended the run.
    let by_error = outcome.tally.has_refused(Refusal::ErrorLimit);
    if !by_error && outcome.end == StopReason::Exhausted && outcome.tally.refused() > 0 {
        outcome.end = StopReason::Stuck;
    }
    Ok(Some((outcome, deviation, by_error)))
}
