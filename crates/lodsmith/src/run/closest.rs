//! Choice among several results for one target, by measured error.
//!
//! A target that is out of reach may be reached by moving seams off their lines, removing parts, cutting
//! necks or contracting pairs. None of these is always best, and their costs are not comparable, so the
//! results are measured. Only this module chooses between results of one run.

use super::context::{Run, RunOutcome};
use crate::SimplifyError;
use crate::collapse::StopReason;
use crate::control::{Control, Stage, has_time_for};

/// Samples in each direction. (The RMS of a result is then known to a few percent; if candidates differ by
/// less, either is fine.)
const COMPARISON_SAMPLES: usize = 20_000;
/// A result without topology changes and moved seams is preferred unless another is closer by this factor:
/// parts should not be removed for a small gain. (Guessed.)
const WHOLE_RESULT_FACTOR: f64 = 1.25;
/// That factor for a result whose run was productive: the largest step allowed in a walk over targets
/// (`cargo xtask walk`).
const PRODUCTIVE_RESULT_FACTOR: f64 = 1.5;
/// If the target is out of reach, a heavier result is returned if the lightest one is farther off by this
/// factor. (Guessed: more than any productive run loses by removing a few more faces.)
const UNREACHABLE_FACTOR: f64 = 3.0;

impl RunOutcome {
    /// True if another run to the target may be closer to the input: seams gave way, or stayed at a cost, or
    /// cheap parts or necks were kept.
    pub(super) fn has_rivals(&self) -> bool {
        self.seams_block() || self.engine.kept.parts || self.engine.kept.necks
    }

    /// True if seams gave way, or stayed on their lines at a cost.
    pub(super) fn seams_block(&self) -> bool {
        self.relaxed.seams || self.engine.kept.seams
    }

    /// True if no seams gave way, and no parts or necks were removed.
    pub(super) fn keeps_all(&self) -> bool {
        !self.relaxed.seams && self.tally.parts_removed == 0 && self.tally.necks_cut == 0
    }
}

impl Run<'_, '_> {
    /// Returns the best of the outcomes (at least one), see [`Run::closest_index`]; with proposals if none
    /// reaches the target.
    pub(super) fn closest(
        &self,
        mut outcomes: Vec<RunOutcome>,
        asked: Option<usize>,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        let best = self.closest_index(&outcomes.iter().collect::<Vec<_>>(), asked, control)?;
        let mut chosen = outcomes.swap_remove(best);
        if chosen.end == StopReason::Stuck && chosen.engine.proposals.is_empty() {
            let others = outcomes.into_iter().map(|outcome| outcome.engine.proposals);
            chosen.engine.proposals = others.max_by_key(Vec::len).unwrap_or_default();
        }
        Ok(chosen)
    }

    /// Returns the index of the best of the outcomes (at least one). Outcomes that reach the target are
    /// preferred: among these, the one with the smallest two-way RMS distance to the input; if none reaches
    /// it, the lightest; the first among equals. The outcome `asked` for by an option is favoured, otherwise
    /// outcomes that keep everything; one of these is the best if the caller ends the run. Cost: a tree of the input, and of each measured outcome.
    pub(super) fn closest_index(
        &self,
        outcomes: &[&RunOutcome],
        asked: Option<usize>,
        control: &mut dyn Control,
    ) -> Result<usize, SimplifyError> {
        let meets = |i: &usize| outcomes[*i].end == StopReason::Goal;
        let met: Vec<usize> = (0..outcomes.len()).filter(meets).collect();
        if met.len() <= 1 {
            let lightest = || (0..outcomes.len()).min_by_key(|&i| outcomes[i].mesh.face_count());
            return Ok(met.first().copied().or_else(lightest).unwrap_or(0));
        }
        let is_favoured = |i: usize| asked.map_or_else(|| outcomes[i].keeps_all(), |asked| i == asked);
        let favourite = met.iter().copied().find(|&i| is_favoured(i)).unwrap_or(met[0]);
        if !has_time_for(Stage::Measure, control)? {
            return Ok(favourite);
        }
        let Some(comparer) = self.input_comparer(control) else { return Ok(met[0]) };
        let mut best = (f64::INFINITY, met[0]);
        for &i in &met {
            let favour = match is_favoured(i) {
                true if outcomes[i].engine.is_unproductive || asked.is_some() => WHOLE_RESULT_FACTOR,
                true => PRODUCTIVE_RESULT_FACTOR,
                false => 1.0,
            };
            let Some(rms) = comparer.rms(&outcomes[i].mesh, COMPARISON_SAMPLES, control)? else {
                return Ok(favourite);
            };
            if rms / favour < best.0 {
                best = (rms / favour, i);
            }
        }
        Ok(best.1)
    }

    /// Chooses between the lightest result of a run whose target is out of reach, and a slightly heavier
    /// one.
    pub(super) fn choose_when_unreachable(
        &self,
        lightest: RunOutcome,
        mut heavier: RunOutcome,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        if heavier.end != StopReason::Goal || !has_time_for(Stage::Measure, control)? {
            return Ok(lightest);
        }
        let Some(comparer) = self.input_comparer(control) else { return Ok(lightest) };
        let mut rms = |outcome: &RunOutcome| comparer.rms(&outcome.mesh, COMPARISON_SAMPLES, control);
        let (far, near) = (rms(&lightest)?, rms(&heavier)?);
        let is_far = far.zip(near).is_some_and(|(far, near)| far > UNREACHABLE_FACTOR * near);
        if !is_far {
            return Ok(lightest);
        }
        heavier.end = StopReason::Stuck;
        heavier.engine.proposals = lightest.engine.proposals;
        Ok(heavier)
    }
}
