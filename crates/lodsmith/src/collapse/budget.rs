//! The end of a quick pass at an estimate of the error.

use super::{Engine, Goal};
use crate::cost::metric::Metric;

/// Largest share of the faces that a sweep may remove before any cost is known (`FIRST_SHARE`), and on a
/// prediction (`MAX_SHARE`): where curvature varies, costs grow differently than predicted. (Guessed.)
const FIRST_SHARE: f64 = 0.1;
const MAX_SHARE: f64 = 0.6;
/// Share of the budget that need not be used. (Guessed: three percent of the error.)
const UNUSED: f64 = 0.06;

impl<M: Metric> Engine<M> {
    /// Returns the total cost of collapses at which the estimated error reaches the limit of the rules.
    pub(super) fn cost_budget(&self) -> f64 {
        let max_estimate = self.mesh.constraints.rules.max_estimate;
        let area = self.mesh.cost.total_area.max(f64::MIN_POSITIVE);
        max_estimate * max_estimate * 6.0 * area / self.mesh.cost.metric.squared_rms_factor()
    }

    /// Returns the total cost of collapses that would add as much to the estimate as the removed parts do.
    pub(super) fn cost_of_removed_parts(&self) -> f64 {
        1.5 * self.tally.removed_part_cost / self.mesh.cost.metric.squared_rms_factor()
    }

    fn spent(&self) -> f64 {
        self.tally.collapse_cost + self.cost_of_removed_parts()
    }

    /// True if the pass ends at an estimated error that it has not reached.
    pub(super) fn has_budget(&self) -> bool {
        let budget = self.cost_budget();
        budget.is_finite() && self.spent() < (1.0 - UNUSED) * budget
    }

    /// Returns the goal for the next sweep: if the pass ends at an estimated error, the count at which that
    /// is expected, so that the last sweeps before it are small.
    pub(super) fn goal_for_estimate(&self, final_goal: &Goal) -> Goal {
        if !self.mesh.constraints.rules.max_estimate.is_finite() {
            return *final_goal;
        }
        let now = self.mesh.store.live_faces;
        let wanted = if self.has_budget() {
            let spent = self.spent() / self.cost_budget();
            let share = expected_share(now as f64 / self.tally.first_faces.max(1) as f64, spent);
            ((now as f64 * share) as usize).min(now.saturating_sub(2))
        } else {
            now
        };
        Goal { faces: Some(wanted.max(final_goal.faces.unwrap_or(0))), ..*final_goal }
    }
}

/// Returns the share of the current faces at which the budget is expected to be spent. `left` is the share of
/// the initial faces that is left, `spent` the share of the budget spent so far. (The squared distance of a
/// smooth surface from triangles between its points grows with the square of their area: the costs with 1 /
/// n² - 1 / n₀².)
fn expected_share(left: f64, spent: f64) -> f64 {
    if left >= 1.0 {
        return 1.0 - FIRST_SHARE;
    }
    let from_start = 1.0 / (left * left) - 1.0;
    let share = 1.0 / (left * (1.0 + from_start / spent.max(f64::MIN_POSITIVE)).sqrt());
    share.clamp(1.0 - MAX_SHARE, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_expected_share_follows_the_costs_of_a_smooth_surface() {
        assert_eq!(expected_share(1.0, 0.0), 0.9);
        // If everything is spent at a quarter of the faces, a fifth is spent at half of them.
        let spent = (1.0 / 0.25 - 1.0) / (1.0 / 0.0625 - 1.0);
        assert!((expected_share(0.5, spent) - 0.5).abs() < 1e-9);
        assert_eq!(expected_share(0.5, 1.0), 1.0);
        assert_eq!(expected_share(0.5, 0.0), 0.4, "no prediction removes more than that");
    }
}
