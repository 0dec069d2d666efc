//! Search for the lightest result within an error limit, and the face counts at which it may end.
//!
//! ```text
//! faces   12,000 … 2,300 … 440 … 85 …       marks, one after another until one exceeds the distance
//!                |---.---|                  then bisection between the last within it and the first beyond
//!                    |. . .|                then a few lighter ones, because errors are not monotonic
//! ```
//!
//! Counts, marks and midpoints do not depend on the distance, only the path does: a level within a distance
//! is within any larger distance too, so at the first level where two searches differ, the one for the larger
//! distance continues on the lighter side. A larger distance therefore never ends at a heavier level, even if
//! errors are not monotonic. This also holds for the tests of lighter levels at the end: they use fixed
//! levels, at the same offset from the current one, so the search for a larger distance also tests every
//! lighter level that the search for a smaller distance reached.

use std::ops::RangeInclusive;

use crate::SimplifyError;

/// Ratio of the face counts of neighbouring levels. (Measured: errors of neighbours differ by 8 % on
/// average.)
const LEVEL_FACTOR: f64 = 1.05;
/// The first step is this share of that ratio, and each step doubles the one before: near the start, every
/// single collapse may exceed the limit. (Guessed.)
const FIRST_STEP_SHARE: f64 = 1.0 / 8.0;
/// Number of levels between marks: a sixth of the faces.
const LEVELS_PER_MARK: usize = 37;
/// Number of levels beyond the last one within the distance that may be tested too: a quarter of the faces.
const EXTRA_LEVELS: usize = 6;
/// One in this many of these levels is tested, until none is within the distance. (Measured on seven models
/// at 18 distances, compared with the lightest of 40 levels, each with .89 of the faces of the one before:
/// .959 of its faces on average and 1.28 at most in 8.6 runs; without these tests .980 and 1.63 in 6.6 runs.)
const EXTRA_LEVEL_STEP: usize = 2;

/// Maximum number of levels per step of a search from a start level. (Guessed: twelve percent of the cells
/// of a grid, along an axis.)
const SEARCH_STRIDE: i64 = 4;

/// Result of testing a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LevelTest {
    /// It is within the distance.
    Kept,
    /// It is within the distance, and no level is lighter.
    Last,
    /// It exceeds the distance.
    Beyond,
    /// The search must end.
    Over,
}

/// Decreasing counts, the first of them the input's.
pub(crate) struct LevelCounts {
    counts: Vec<usize>,
}

impl LevelCounts {
    /// Creates the levels from `all` faces down to `floor`, which is from 1 to `all`.
    pub(super) fn new(all: usize, floor: usize) -> Self {
        let mut counts = vec![all];
        let mut exact = all as f64;
        let mut step = 1.0 + (LEVEL_FACTOR - 1.0) * FIRST_STEP_SHARE;
        while let Some(&last) = counts.last()
            && last > floor
        {
            exact /= step;
            step = (1.0 + 2.0 * (step - 1.0)).min(LEVEL_FACTOR);
            let next = (exact.round() as usize).min(last - 1).max(floor);
            exact = exact.min(next as f64 + 0.5);
            counts.push(next);
        }
        Self { counts }
    }

    pub(super) fn count(&self, level: usize) -> usize {
        self.counts[level]
    }

    /// Tests levels with `test` until the best one is found; returns 0, the input, if none is within the
    /// distance. Never tests the input, and no level twice.
    pub(crate) fn search(
        &self,
        test: &mut dyn FnMut(usize) -> Result<LevelTest, SimplifyError>,
    ) -> Result<usize, SimplifyError> {
        let mut known = vec![None; self.counts.len()];
        known[0] = Some(LevelTest::Kept);
        let mut test = |level: usize| -> Result<LevelTest, SimplifyError> {
            if let Some(answer) = known[level] {
                return Ok(answer);
            }
            let answer = test(level)?;
            known[level] = Some(answer);
            Ok(answer)
        };
        let (mut kept, mut beyond) = (0, self.counts.len());
        let mut mark = LEVELS_PER_MARK;
        while beyond - kept > 1 {
            let is_marked = mark < beyond;
            let level = if is_marked { mark } else { usize::midpoint(kept, beyond) };
            match test(level)? {
                LevelTest::Over => return Ok(kept),
                LevelTest::Last => return Ok(level),
                LevelTest::Kept => kept = level,
                LevelTest::Beyond => beyond = level,
            }
            mark += LEVELS_PER_MARK;
        }
        let mut next = (kept + EXTRA_LEVELS) / EXTRA_LEVEL_STEP * EXTRA_LEVEL_STEP;
        while next > kept {
            if next < self.counts.len() {
                match test(next)? {
                    LevelTest::Over => break,
                    LevelTest::Last => return Ok(next),
                    LevelTest::Kept => {
                        kept = next;
                        next += EXTRA_LEVELS + EXTRA_LEVEL_STEP;
                    }
                    LevelTest::Beyond => {}
                }
            }
            next -= EXTRA_LEVEL_STEP;
        }
        Ok(kept)
    }
}

/// Searches numbered levels, higher ones lighter, from an approximate start level: in steps of at most
/// `SEARCH_STRIDE` levels, to the lighter side as long as levels are within the distance, otherwise to the
/// heavier side until one is; then by bisection.
///
/// The start level must not be heavier for a larger distance: then the result is not heavier either, because
/// any level that passes for a distance passes for a larger one. Returns `None` if no level is within the
/// distance.
pub(crate) fn search_around(
    levels: RangeInclusive<i64>,
    begin: i64,
    test: &mut dyn FnMut(i64) -> Result<LevelTest, SimplifyError>,
) -> Result<Option<i64>, SimplifyError> {
    let (first, last) = levels.into_inner();
    if first > last {
        return Ok(None);
    }
    // At multiples of the stride, and at the ends.
    let whole = |level: i64| (level.div_euclid(SEARCH_STRIDE) * SEARCH_STRIDE).clamp(first, last);
    let mut level = whole(begin);
    let mut kept = None;
    let mut beyond = None;
    loop {
        match test(level)? {
            LevelTest::Over => return Ok(kept),
            LevelTest::Last => return Ok(Some(level)),
            LevelTest::Kept => kept = Some(level),
            LevelTest::Beyond => beyond = Some(level),
        }
        level = match (kept, beyond) {
            (Some(kept), None) if kept == last => return Ok(Some(kept)),
            (None, Some(beyond)) if beyond == first => return Ok(None),
            (Some(kept), None) => whole(kept + SEARCH_STRIDE).max(kept + 1),
            (None, Some(beyond)) => whole(beyond - 1),
            (Some(kept), Some(beyond)) if beyond - kept <= 1 => return Ok(Some(kept)),
            (Some(kept), Some(beyond)) => i64::midpoint(kept, beyond),
            (None, None) => return Ok(None),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_descend_to_the_floor() {
        for (all, floor) in [(1, 1), (12, 1), (12, 12), (9000, 4), (1_000_000, 777), (100, 99)] {
            let counts = LevelCounts::new(all, floor).counts;
            assert!(counts[0] == all && counts.last() == Some(&floor), "{counts:?}");
            let is_step = |c: &[usize]| {
                c[1] < c[0] && (c[0] - c[1] == 1 || c[0] as f64 <= c[1] as f64 * LEVEL_FACTOR + 1.5)
            };
            assert!(counts.windows(2).all(is_step), "{counts:?}");
            // The floor does not influence the counts above it.
            let whole = LevelCounts::new(all, 1).counts;
            assert_eq!(counts[..counts.len() - 1], whole[..counts.len() - 1]);
        }
    }

    #[test]
    fn a_larger_distance_never_ends_at_a_heavier_level() {
        let levels = LevelCounts::new(20_000, 3);
        let mut state = 5u64;
        for round in 0..50 {
            // Errors that rise, and jump by up to a factor of 16.
            let error = |level: usize, state: u64| {
                let bits =
                    (level as u64 + 1).wrapping_mul(state | 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
                1.05f64.powi(level as i32) * 4f64.powf(bits as f64 / (1u64 << 24) as f64 * 2.0 - 1.0)
            };
            state = state.wrapping_mul(6364136223846793005).wrapping_add(round);
            let mut before = 0;
            for k in 0..120 {
                let limit = 0.5 * 1.1f64.powi(k);
                let mut asked = Vec::new();
                let got = levels
                    .search(&mut |level| {
                        asked.push(level);
                        Ok(if error(level, state) <= limit { LevelTest::Kept } else { LevelTest::Beyond })
                    })
                    .unwrap();
                assert!(got >= before, "{got} {before}");
                assert!(got == 0 || error(got, state) <= limit);
                assert!(!asked.contains(&0) && asked.len() < 40);
                before = got;
            }
        }
    }

    #[test]
    fn in_a_search_around_a_start_a_larger_distance_never_ends_at_a_heavier_level() {
        let mut state = 11u64;
        for round in 0..60 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(round);
            let (first, last) = (-(round as i64 * 3 % 50), 30 + round as i64);
            let error = |level: i64| {
                let bits = (level as u64).wrapping_mul(state | 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
                1.1f64.powi(level as i32) * 3f64.powf(bits as f64 / (1u64 << 24) as f64 * 2.0 - 1.0)
            };
            let mut before = None;
            for k in -90..90 {
                let limit = 1.1f64.powi(k);
                let got = search_around(first..=last, i64::from(k) + 5, &mut |level| {
                    assert!((first..=last).contains(&level));
                    Ok(if error(level) <= limit { LevelTest::Kept } else { LevelTest::Beyond })
                });
                let got = got.unwrap();
                assert!(got >= before, "{got:?} {before:?}");
                assert!(got.is_none_or(|level| error(level) <= limit));
                before = got;
            }
        }
        let nothing = RangeInclusive::new(1, 0);
        assert_eq!(search_around(nothing, 0, &mut |_| Ok(LevelTest::Kept)), Ok(None));
        assert_eq!(search_around(0..=9, 99, &mut |_| Ok(LevelTest::Kept)), Ok(Some(9)));
        assert_eq!(search_around(0..=9, 99, &mut |_| Ok(LevelTest::Beyond)), Ok(None));
    }
}
