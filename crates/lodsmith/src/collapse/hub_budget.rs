//! Budget for work at vertices with very many faces.
//!
//! A collapse visits all faces around both ends and removes two of them. Around a hub of n faces the work is
//! quadratic in n, so it has a budget proportional to the faces of the input: when it is spent, edges at the
//! hub wait, while edges around it continue. No other vertex is affected.

/// Number of faces around the two ends of an edge above which it uses the budget. (Guessed: far more than any
/// edge has that is not at a hub.)
const HUB_FACES: usize = 1024;
/// Faces that may be visited in a whole run, for each face of the input; at least `MIN_WORK`. (Guessed: a
/// second or two for a million faces.)
const WORK_PER_FACE: u64 = 128;
const MIN_WORK: u64 = 1 << 22;
/// A sweep may spend the remaining budget divided by this.
const SWEEP_DIVISOR: u64 = 8;

/// Remaining number of faces that may be visited at hubs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HubBudget {
    left: u64,
    left_in_sweep: u64,
}

impl HubBudget {
    /// Returns the budget of an input of `faces` faces.
    pub(super) fn of(faces: usize) -> Self {
        let left = (faces as u64 * WORK_PER_FACE).max(MIN_WORK);
        Self { left, left_in_sweep: left / SWEEP_DIVISOR }
    }

    /// True if a vertex or edge with this number of faces is a hub.
    pub(super) fn is_hub(faces: usize) -> bool {
        faces > HUB_FACES
    }

    /// True if an edge of a vertex with this number of faces may be a hub, with a vertex of no more of them.
    pub(super) fn may_be_hub(faces: usize) -> bool {
        Self::is_hub(2 * faces)
    }

    pub(super) fn begin_sweep(&mut self) {
        self.left_in_sweep = self.left / SWEEP_DIVISOR;
    }

    /// True if an edge with `faces` faces around its ends may be visited; subtracts them from the budget.
    #[inline(always)]
    pub(super) fn admit(&mut self, faces: usize) -> bool {
        if !Self::is_hub(faces) {
            return true;
        }
        let (faces, is_admitted) = (faces as u64, faces as u64 <= self.left_in_sweep);
        if is_admitted {
            self.left -= faces;
            self.left_in_sweep -= faces;
        }
        is_admitted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_at_hubs_is_proportional_to_the_input() {
        let n = 1 << 20;
        let mut budget = HubBudget::of(n);
        let mut admitted = 0;
        for _ in 0..4000 {
            budget.begin_sweep();
            admitted += (0..2000).filter(|_| budget.admit(n)).count() as u64;
        }
        assert!((16..=WORK_PER_FACE).contains(&admitted), "all faces were visited {admitted} times");
        assert!(budget.admit(HUB_FACES), "edges that are not at hubs are free");
    }
}
