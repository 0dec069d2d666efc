//! Fit of a level, interpolated from the checkpoints on both sides of it.
//!
//! A correction belongs to a vertex in its state at a checkpoint. It is valid at another level if no split in
//! between changes the position of the vertex; if the corrections of both checkpoints are valid, they are
//! blended by the logarithm of the number of faces.

use glam::Vec3;
use lodsmith_core::splits::{Checkpoint, Counts};
use lodsmith_core::{Positions, Semantic, VertexId, WedgeId};

use super::Progressive;
use crate::attributes::ranges::within;

/// If the errors of two checkpoints differ by more than this factor, only the finer one counts: below some
/// level parts are no longer exactly flat, and the fit of coarser levels must not affect finer ones.
/// (Guessed; on smooth surfaces the factor is 1.2.)
const MAX_ERROR_RATIO: f64 = 4.0;

impl Progressive {
    /// Returns the last checkpoint at or below a level, and the first one above; only the former if it is
    /// exactly at the level.
    fn checkpoints(&self, level: usize) -> (Option<&Checkpoint>, Option<&Checkpoint>) {
        let all = &self.sequence.splits.checkpoints;
        let above = all.partition_point(|c| (c.level as usize) < level);
        let next = all.get(above);
        match next {
            Some(c) if c.level as usize == level => (next, None),
            _ => (above.checked_sub(1).map(|i| &all[i]), next),
        }
    }

    /// Returns the position of a level between two others, from 0 to 1, by the logarithm of the number of
    /// faces.
    fn share(&self, from: u32, level: usize, to: u32) -> f64 {
        let count = |l: usize| libm::log(f64::from(self.sequence.splits.counts[l].faces.max(1)));
        let [a, x, b] = [from as usize, level, to as usize].map(count);
        if b > a { (x - a) / (b - a) } else { 0.0 }
    }

    pub(super) fn error_at(&self, level: usize) -> f64 {
        match self.checkpoints(level) {
            (Some(a), Some(b)) => {
                let t = self.share(a.level, level, b.level);
                // Errors follow about a power of the count; the full mesh has none.
                if b.error > 0.0 {
                    libm::exp(libm::log(a.error) * (1.0 - t) + libm::log(b.error) * t).clamp(b.error, a.error)
                } else {
                    a.error * (1.0 - t)
                }
            }
            (Some(c), None) | (None, Some(c)) => c.error,
            (None, None) => 0.0,
        }
    }

    /// Returns the offsets of the positions of the current level and, with `rows`, of its rows of values;
    /// empty if no checkpoint has any.
    fn corrections(&self, rows: bool) -> [Vec<f32>; 2] {
        let (below, above) = self.checkpoints(self.level);
        let share = match (below, above) {
            (Some(a), Some(b)) => self.share(a.level, self.level, b.level) as f32,
            _ => 0.0,
        };
        let data = &self.sequence.splits;
        let is_start = |c: &Checkpoint| data.checkpoints.last().is_some_and(|last| last.level == c.level);
        let jumps = |a: &Checkpoint, b: &Checkpoint| !is_start(b) && a.error > MAX_ERROR_RATIO * b.error;
        let sides = match (below, above) {
            (Some(a), Some(b)) if jumps(a, b) => [None, above],
            sides => sides.into(),
        };
        let has_any = |of: fn(&Checkpoint) -> bool| sides.iter().flatten().any(|c| !of(c));
        let mut corrections = [Vec::new(), Vec::new()];
        if has_any(|c| c.vertices.is_empty()) {
            let count = self.counts().vertices as usize;
            let (ends, at) = (&data.places.ends, &data.places.at);
            let held = self.held(sides, count, |c| c.vertices, ends, at, |v| v.index());
            let moves = sides.map(|c| c.map(|c| (&c.vertices[..], c.moves.as_flattened())));
            corrections[0] = blended(moves, &held, share, 3, count, |v| v.index());
        }
        if rows && has_any(|c| c.wedges.is_empty()) {
            let count = self.counts().wedges as usize;
            let (ends, at) = (&data.rows.ends, &data.rows.at);
            let held = self.held(sides, count, |c| c.wedges, ends, at, |w| w.index());
            let changes = sides.map(|c| c.map(|c| (&c.wedges[..], &c.changes[..])));
            corrections[1] = blended(changes, &held, share, self.layout().width(), count, |w| w.index());
        }
        corrections
    }

    /// Adds the corrections of the current level to positions, and to rows of values if there are any.
    pub(super) fn correct(&self, positions: &mut Positions, values: &mut [f32]) {
        let [moves, changes] = self.corrections(!values.is_empty());
        let moves = moves.as_chunks::<3>().0.iter();
        match positions {
            Positions::F32(p) => {
                for (p, by) in p.iter_mut().zip(moves).filter(|x| *x.1 != [0.0; 3]) {
                    *p = [0, 1, 2].map(|k| p[k] + by[k]);
                }
            }
            Positions::F64(p) => {
                for (p, by) in p.iter_mut().zip(moves).filter(|x| *x.1 != [0.0; 3]) {
                    *p = [0, 1, 2].map(|k| p[k] + f64::from(by[k]));
                }
            }
        }
        let width = self.layout().width().max(1);
        for (row, by) in values.chunks_exact_mut(width).zip(changes.chunks_exact(width)) {
            if by.iter().any(|x| *x != 0.0) {
                let ranges = &self.sequence.ranges;
                row.iter_mut().zip(by).zip(ranges).for_each(|((x, by), range)| *x = within(*x + by, *range));
                self.normalize_directions(row);
            }
        }
    }

    /// Returns the current level as a checkpoint.
    pub(super) fn checkpoint(&self) -> Checkpoint {
        let [moves, changes] = self.corrections(true);
        let width = self.layout().width().max(1);
        let mut checkpoint =
            Checkpoint { level: self.level as u32, error: self.error(), ..Checkpoint::default() };
        for (v, by) in moves.as_chunks::<3>().0.iter().enumerate().filter(|m| *m.1 != [0.0; 3]) {
            checkpoint.vertices.push(VertexId::new(v));
            checkpoint.moves.push(*by);
        }
        for (w, by) in changes.chunks_exact(width).enumerate() {
            if by.iter().any(|x| *x != 0.0) {
                checkpoint.wedges.push(WedgeId::new(w));
                checkpoint.changes.extend_from_slice(by);
            }
        }
        checkpoint
    }

    /// Returns for each element of the current level, and each of two checkpoints, whether it is the same at
    /// that checkpoint.
    fn held<A: Copy>(
        &self,
        sides: [Option<&Checkpoint>; 2],
        count: usize,
        born: impl Fn(&Counts) -> u32,
        ends: &[u32],
        changed: &[A],
        index: impl Fn(A) -> usize,
    ) -> [Vec<bool>; 2] {
        sides.map(|side| {
            let Some(c) = side else { return Vec::new() };
            let (low, high) = (self.level.min(c.level as usize), self.level.max(c.level as usize));
            let mut held = vec![true; count];
            let there = (born(&self.sequence.splits.counts[low]) as usize).min(count);
            held[there..].fill(false);
            for &element in &changed[ends[low] as usize..ends[high] as usize] {
                if let Some(held) = held.get_mut(index(element)) {
                    *held = false;
                }
            }
            held
        })
    }

    /// Normalises the directions in a row.
    fn normalize_directions(&self, row: &mut [f32]) {
        let layout = self.layout();
        let mut unit = |at: usize| {
            let n = Vec3::from_slice(&row[at..at + 3]);
            if n.length() > 1e-20 {
                row[at..at + 3].copy_from_slice(&(n / n.length()).to_array());
            }
        };
        if layout.has_normals {
            unit(0);
        }
        let further: usize = layout.further.iter().map(|f| f.1).sum();
        let mut at = layout.width() - further;
        for (semantic, width) in &layout.further {
            if *semantic == Semantic::Tangent && *width >= 3 {
                unit(at);
            }
            at += width;
        }
    }
}

/// Blends the offsets of two checkpoints, for the elements that they are valid for; if only one is valid, it
/// counts in full.
fn blended<A: Copy>(
    sides: [Option<(&[A], &[f32])>; 2],
    held: &[Vec<bool>; 2],
    share: f32,
    width: usize,
    count: usize,
    index: impl Fn(A) -> usize,
) -> Vec<f32> {
    let mut sum = vec![0f32; width * count];
    for (i, side) in sides.into_iter().enumerate() {
        let Some((elements, moves)) = side else { continue };
        let holds = |side: usize, at: usize| held[side].get(at) == Some(&true);
        for (&element, by) in elements.iter().zip(moves.chunks_exact(width)) {
            let at = index(element);
            if !holds(i, at) {
                continue;
            }
            let weight = match (holds(1 - i, at), i) {
                (false, _) => 1.0,
                (true, 0) => 1.0 - share,
                (true, _) => share,
            };
            let sum = sum[at * width..][..width].iter_mut();
            sum.zip(by).for_each(|(sum, by)| *sum += weight * by);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use lodsmith_core::Splits;

    use super::*;
    use crate::test_support::three_levels;

    fn at_level(level: usize) -> Progressive {
        let mut progressive = Progressive::new(Splits::new(three_levels()).expect("sound splits"));
        progressive.to_level(level);
        progressive
    }

    /// Returns the moves of vertices 0 and 1 by the fit.
    fn moves(progressive: &Progressive) -> [[f64; 3]; 2] {
        let fitted = progressive.fitted_positions();
        [0, 1].map(VertexId).map(|v| {
            let [to, from] = [fitted.view().get(v), progressive.positions().get(v)];
            [0, 1, 2].map(|k| to[k] - from[k])
        })
    }

    #[test]
    fn errors_between_checkpoints_follow_a_power_of_the_count() {
        // From .4 at one face to .1 at four: in logarithms, two faces are halfway.
        for (level, error) in [(0, 0.4), (1, 0.2), (2, 0.1)] {
            assert!((at_level(level).error() - error).abs() < 1e-9, "{}", at_level(level).error());
        }
        // Towards the full mesh, whose error is 0, they fall linearly with the logarithm.
        let mut data = three_levels();
        data.checkpoints[1].error = 0.0;
        let mut progressive = Progressive::new(Splits::new(data).expect("sound splits"));
        progressive.to_level(1);
        assert!((progressive.error() - 0.2).abs() < 1e-9);
        assert_eq!([0.4, 0.39, 0.201, 0.199, 0.0].map(|e| progressive.level_of_error(e)), [0, 1, 1, 2, 2]);
    }

    #[test]
    fn moves_of_vertices_that_stay_the_same_are_blended() {
        assert_eq!(moves(&at_level(0)), [[0.0, 0.0, 1.0], [0.0; 3]]);
        assert_eq!(moves(&at_level(2)), [[0.0, 0.0, 3.0], [1.0, 0.0, 0.0]]);
        // Halfway between 1 and 3; the first split moves vertex 1, so only the checkpoint above counts.
        let between = moves(&at_level(1));
        assert!((between[0][2] - 2.0).abs() < 1e-6, "{between:?}");
        assert_eq!(between[1], [1.0, 0.0, 0.0]);
        // As a checkpoint, the level is the same.
        let own = at_level(1).checkpoint();
        assert_eq!((own.level, own.vertices), (1, vec![VertexId(0), VertexId(1)]));
    }

    #[test]
    fn the_nearer_of_two_fits_counts_more() {
        // At a quarter of the distance from the first checkpoint to the second; element 1 is valid only at
        // the first.
        let held = [vec![true, true], vec![true, false]];
        let sides = [Some((&[0, 1][..], &[4.0, 8.0][..])), Some((&[0][..], &[8.0][..]))];
        assert_eq!(blended(sides, &held, 0.25, 1, 2, |v: usize| v), [0.75 * 4.0 + 0.25 * 8.0, 8.0]);
    }

    #[test]
    fn a_much_worse_coarser_fit_does_not_count() {
        let mut data = three_levels();
        data.checkpoints[0].error = 1.0;
        // (The last checkpoint is the start of the run; another one after it makes it an ordinary
        // checkpoint.)
        data.counts.push(data.counts[2]);
        for ends in
            [&mut data.corners.ends, &mut data.owners.ends, &mut data.rows.ends, &mut data.places.ends]
        {
            ends.push(ends[2]);
        }
        data.checkpoints.push(Checkpoint { level: 3, error: 0.05, ..Checkpoint::default() });
        for (coarse, wanted) in [(0.4, 2.0), (0.41, 3.0)] {
            data.checkpoints[0].error = coarse;
            let mut progressive = Progressive::new(Splits::new(data.clone()).expect("sound splits"));
            progressive.to_level(1);
            let [first, _] = moves(&progressive);
            assert!((first[2] - wanted).abs() < 1e-6, "{first:?} after an error of {coarse}");
        }
    }
}
