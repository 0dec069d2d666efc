//! Choice among several results for one target, by measured error.
//!
//! A target that is out of reach may be reached by moving seams off their lines, removing parts, cutting
//! necks or contracting pairs. None of these is always best, and their costs are not comparable, so the
//! results are measured. Only this module chooses between results of one run.

use lodsmith_core::TriMesh;
use lodsmith_core::measure::EstimatedRms;

use super::context::{Run, RunOutcome};
use crate::SimplifyError;
use crate::collapse::StopReason;
use crate::control::{Control, Stage, has_time_for};
use crate::deviation::{InputComparer, PreparedResult};
use crate::report::Refusal;

/// Numbers of samples in each direction: more are drawn while the best result is not clear.
const COMPARISON_SAMPLES: [usize; 3] = [2_000, 8_000, 20_000];
/// A result is clearly the best if the distance of each other one is larger by this many standard deviations of their
/// quotient. (Guessed: three are seldom exceeded by chance.)
const CLEAR_DEVIATIONS: f64 = 3.0;
/// If [`CLEAR_DEVIATIONS`] are less than this share of the distance, either of two near results is fine. (Guessed.)
const FINE_SHARE: f64 = 0.06;
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
    /// True if a run that removes parts and cuts necks may be closer to the input: cheap ones were kept.
    pub(super) fn topology_blocks(&self) -> bool {
        self.engine.kept.parts || self.engine.kept.necks
    }

    /// True if a run whose seams move may be closer to the input: seams refused collapses until they gave way, or
    /// stayed on their lines at a cost.
    pub(super) fn seams_block(&self) -> bool {
        self.relaxed.seams && self.tally.has_refused(Refusal::Seam) || self.engine.kept.seams
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
        let favour = |i: usize| match is_favoured(i) {
            true if outcomes[i].engine.is_unproductive || asked.is_some() => WHOLE_RESULT_FACTOR,
            true => PRODUCTIVE_RESULT_FACTOR,
            false => 1.0,
        };
        let meshes: Vec<&TriMesh> = met.iter().map(|&i| &outcomes[i].mesh).collect();
        let favours: Vec<f64> = met.iter().map(|&i| favour(i)).collect();
        let first = closest_of(&comparer, &meshes, &favours, control)?;
        Ok(first.map_or(favourite, |k| met[k]))
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
        let meshes = [&lightest.mesh, &heavier.mesh];
        if closest_of(&comparer, &meshes, &[UNREACHABLE_FACTOR, 1.0], control)? != Some(1) {
            return Ok(lightest);
        }
        heavier.end = StopReason::Stuck;
        heavier.engine.proposals = lightest.engine.proposals;
        Ok(heavier)
    }
}

/// Returns the index of the mesh whose RMS distance from the input, divided by its favour, is smallest; the first among
/// equals, `None` if the caller ends the run. Draws more samples while two are near each other.
fn closest_of(
    comparer: &InputComparer,
    meshes: &[&TriMesh],
    favours: &[f64],
    control: &mut dyn Control,
) -> Result<Option<usize>, SimplifyError> {
    let mut first = 0;
    let results: Vec<_> = meshes.iter().map(|mesh| PreparedResult::new(mesh)).collect();
    for samples in COMPARISON_SAMPLES {
        let (mut distances, mut deviations) = (Vec::new(), Vec::new());
        for (result, favour) in results.iter().zip(favours) {
            // A mesh without a face is infinitely far.
            let found = match result {
                Some(result) => comparer.rms(result, samples, control)?,
                None => Some(EstimatedRms { rms: f64::INFINITY, relative_deviation: 0.0 }),
            };
            let Some(found) = found else { return Ok(None) };
            distances.push(found.rms / favour);
            deviations.push(found.relative_deviation);
        }
        let nearest = |best: usize, i: usize| if distances[i] < distances[best] { i } else { best };
        first = (1..distances.len()).fold(0, nearest);
        let is_clear = |i: usize| {
            let margin = CLEAR_DEVIATIONS * libm::hypot(deviations[i], deviations[first]);
            // (Runs that never differ have equal results.)
            let differs = distances[i] != distances[first];
            !differs || margin < FINE_SHARE || distances[i] > distances[first] * (1.0 + margin)
        };
        if (0..distances.len()).all(is_clear) {
            break;
        }
    }
    Ok(Some(first))
}
