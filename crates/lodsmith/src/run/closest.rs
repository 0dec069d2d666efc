//! Choice among several results for one target, by measured error.
//!
//! A target that is out of reach may be reached by moving seams off their lines, removing parts, cutting
//! necks or contracting pairs. None of these is always best, and their costs are not comparable, so the
//! results are measured. Only this module chooses between results of one run.

use super::context::{Run, RunOutcome};
use crate::collapse::StopReason;
use crate::control::Control;

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
        self.seams_relaxed || self.kept_costly_seams || self.kept_blocking_parts || self.kept_blocking_necks
    }

    /// True if no seams gave way, and no parts or necks were removed.
    pub(super) fn keeps_all(&self) -> bool {
        !self.seams_relaxed && self.tally.parts_removed == 0 && self.tally.necks_cut == 0
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
    ) -> RunOutcome {
        let best = self.closest_index(&outcomes.iter().collect::<Vec<_>>(), asked, control);
        let mut chosen = outcomes.swap_remove(best);
        if chosen.end == StopReason::Stuck && chosen.proposals.is_empty() {
            let others = outcomes.into_iter().map(|outcome| outcome.proposals);
            chosen.proposals = others.max_by_key(Vec::len).unwrap_or_default();
        }
        chosen
    }

    /// Returns the index of the best of the outcomes (at least one). Outcomes that reach the target are
    /// preferred: among these, the one with the smallest two-way RMS distance to the input; if none reaches
    /// it, the lightest; the first among equals. The outcome `asked` for by an option is favoured, otherwise
    /// outcomes that keep everything. Cost: a tree of the input, and of each measured outcome.
    pub(super) fn closest_index(
        &self,
        outcomes: &[&RunOutcome],
        asked: Option<usize>,
        control: &mut dyn Control,
    ) -> usize {
        let meets = |i: &usize| outcomes[*i].end == StopReason::Goal;
        let met: Vec<usize> = (0..outcomes.len()).filter(meets).collect();
        if met.len() <= 1 {
            let lightest = || (0..outcomes.len()).min_by_key(|&i| outcomes[i].mesh.face_count());
            return met.first().copied().or_else(lightest).unwrap_or(0);
        }
        let Some(comparer) = self.input_comparer(control) else { return met[0] };
        let error = |i: usize| {
            let is_favoured = asked.map_or_else(|| outcomes[i].keeps_all(), |asked| i == asked);
            let favour = match is_favoured {
                true if outcomes[i].is_unproductive || asked.is_some() => WHOLE_RESULT_FACTOR,
                true => PRODUCTIVE_RESULT_FACTOR,
                false => 1.0,
            };
            comparer.rms(&outcomes[i].mesh, COMPARISON_SAMPLES) / favour
        };
        let errors = met.iter().map(|&i| (i, error(i)));
        errors.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(met[0], |best| best.0)
    }

    /// Chooses between the lightest result of a run whose target is out of reach, and a slightly heavier
    /// one.
    pub(super) fn choose_when_unreachable(
        &self,
        lightest: RunOutcome,
        heavier: RunOutcome,
        control: &mut dyn Control,
    ) -> RunOutcome {
        let Some(comparer) = self.input_comparer(control).filter(|_| heavier.end == StopReason::Goal) else {
            return lightest;
        };
        let [far, near] = [&lightest, &heavier].map(|way| comparer.rms(&way.mesh, COMPARISON_SAMPLES));
        if far > UNREACHABLE_FACTOR * near {
            RunOutcome { end: StopReason::Stuck, proposals: lightest.proposals, ..heavier }
        } else {
            lightest
        }
    }
}
