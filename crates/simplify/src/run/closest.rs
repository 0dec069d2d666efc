//! The choice among several ways to one target, by measured error.
//!
//! A target that is out of reach as it is may be met by moving seams off their lines, by removing parts, by cutting necks or by
//! contracting pairs. None of these is always the best, and their costs are not of one kind, so the results are measured.
//! This is the only place that decides between results of one run.

use super::{Run, RunOutcome};
use crate::collapse::StopReason;
use crate::control::Control;

/// Samples each way. (The RMS of a result is then known to a few percent; ways differ by more, or either will do.)
const JUDGE_SAMPLES: usize = 20_000;
/// A result that keeps what it was asked to keep is taken unless another one is closer by this factor: parts are not to go for
/// a small gain. (Guessed.)
const WHOLE_RESULT_FACTOR: f64 = 1.25;
/// The same of a result whose run was at ease: the step that a walk of targets may take (`cargo xtask walk`).
const FAVOUR_AT_EASE: f64 = 1.5;
/// Where the target is out of reach, a heavier result is taken if the lightest one is farther off by this factor. (Guessed:
/// for a few faces less that is more than any run at ease pays.)
const DESTROYED_FACTOR: f64 = 3.0;

impl RunOutcome {
    /// Whether another way to the target may be closer to the input: seams gave way, or stayed at a price, or cheap parts or
    /// necks stayed.
    pub(super) fn has_rivals(&self) -> bool {
        self.seams_relaxed || self.spares_seams || self.spares_parts || self.spares_necks
    }

    /// Whether everything stayed that stays if it can.
    pub(super) fn keeps_all(&self) -> bool {
        !self.seams_relaxed && self.parts_removed == 0 && self.necks_cut == 0
    }
}

impl Run<'_, '_> {
    /// The best of at least one outcome, see [`Run::closer`]; where none meets the target, with what would help.
    pub(super) fn closest(
        &self,
        mut ways: Vec<RunOutcome>,
        asked: Option<usize>,
        control: &mut dyn Control,
    ) -> RunOutcome {
        let best = self.closer(&ways.iter().collect::<Vec<_>>(), asked, control);
        let mut chosen = ways.swap_remove(best);
        if chosen.end == StopReason::Stuck && chosen.proposals.is_empty() {
            let others = ways.into_iter().map(|way| way.proposals);
            chosen.proposals = others.max_by_key(Vec::len).unwrap_or_default();
        }
        chosen
    }

    /// The index of the best of at least one outcome. One that meets the target comes before one that does not. Of several
    /// that meet it, the one with the least RMS distance to the input, both ways; of several that do not, the lightest. The
    /// first of equals. Favoured is the one that was `asked` for by an option, else what keeps all. Cost: a tree of the
    /// input, and of each outcome that is measured.
    pub(super) fn closer(
        &self,
        ways: &[&RunOutcome],
        asked: Option<usize>,
        control: &mut dyn Control,
    ) -> usize {
        let meets = |i: &usize| ways[*i].end == StopReason::Goal;
        let met: Vec<usize> = (0..ways.len()).filter(meets).collect();
        if met.len() <= 1 {
            let lightest = || (0..ways.len()).min_by_key(|&i| ways[i].mesh.face_count());
            return met.first().copied().or_else(lightest).unwrap_or(0);
        }
        let Some(judge) = self.judge(control) else { return met[0] };
        let error = |i: usize| {
            let is_favoured = asked.map_or_else(|| ways[i].keeps_all(), |asked| i == asked);
            let favour = match is_favoured {
                true if ways[i].is_strained || asked.is_some() => WHOLE_RESULT_FACTOR,
                true => FAVOUR_AT_EASE,
                false => 1.0,
            };
            judge.rms(&ways[i].mesh, JUDGE_SAMPLES) / favour
        };
        let errors = met.iter().map(|&i| (i, error(i)));
        errors.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(met[0], |best| best.0)
    }

    /// Of the lightest result of a run whose target is out of reach, and one that is a little heavier, the one to give back.
    pub(super) fn less_destroyed(
        &self,
        lightest: RunOutcome,
        heavier: RunOutcome,
        control: &mut dyn Control,
    ) -> RunOutcome {
        let Some(judge) = self.judge(control).filter(|_| heavier.end == StopReason::Goal) else {
            return lightest;
        };
        let [far, near] = [&lightest, &heavier].map(|way| judge.rms(&way.mesh, JUDGE_SAMPLES));
        if far > DESTROYED_FACTOR * near {
            RunOutcome { end: StopReason::Stuck, proposals: lightest.proposals, ..heavier }
        } else {
            lightest
        }
    }
}
