//! Cells, and which of them each vertex lies in.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;

use super::model::{Model, Place};
use super::pieces;

/// Cells along the longest edge of the box, at most: 21 bits of each coordinate make a key.
pub(super) const FINEST: f64 = 2_000_000.0;

/// Cubes side by side, centred on the box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    /// Of the box, and of the grid in cells: kept apart, so that nothing is rounded to the steps of large coordinates.
    middle: DVec3,
    half: DVec3,
    pub(super) cell: f64,
    pub(super) inverse: f64,
    /// Cells along each axis.
    count: [u32; 3],
    /// The last place along each axis that is not beyond the grid.
    last: DVec3,
}

/// A double from here on has no room for fractions: its low bits are a number.
const WHOLE: f64 = (1u64 << 52) as f64;

impl Grid {
    /// With so many cells along the longest edge of the box. The last ones stand out, as far on either side.
    pub(super) fn new<P: Place>(model: &Model<'_, P>, resolution: f64) -> Self {
        let extent = model.extent();
        let longest = extent.max_element();
        let cell = longest / resolution;
        let inverse = resolution / longest;
        let count = (extent * inverse).as_uvec3() + 1;
        let last = count.as_dvec3() - 0.5;
        let half = 0.5 * count.as_dvec3();
        Self { middle: model.middle(), half, cell, inverse, count: count.to_array(), last }
    }
    /// A position in cells from the origin.
    #[inline(always)]
    pub(super) fn place(&self, p: DVec3) -> DVec3 {
        (p - self.middle) * self.inverse + self.half
    }
    /// The cell of a position; of what lies outside, the nearest one. What lies between two belongs to either.
    #[inline(always)]
    pub(super) fn cell_at(&self, p: DVec3) -> [u32; 3] {
        let p = self.place(p);
        // Written out so that it is a pair of instructions where a cast is a branch.
        let whole = |x: f64, last: f64| {
            let x = if x > 0.5 { x } else { 0.5 };
            let x = if x < last { x } else { last };
            ((x - 0.5) + WHOLE).to_bits() as u32
        };
        [whole(p.x, self.last.x), whole(p.y, self.last.y), whole(p.z, self.last.z)]
    }
    /// The position of a place in cells.
    pub(super) fn user(&self, p: DVec3) -> [f64; 3] {
        ((p - self.half) * self.cell + self.middle).to_array()
    }
    /// Blocks of 4³ cells along each axis.
    fn blocks(&self) -> [usize; 3] {
        self.count.map(|n| (n as usize).div_ceil(4))
    }

    /// The number of each vertex's cell among those with a vertex, and where those cells are: so far along each axis.
    pub(super) fn cells<P: Place>(&self, model: &Model<'_, P>) -> (Vec<u32>, Vec<[u32; 3]>) {
        let blocks = self.blocks();
        let all = blocks.iter().try_fold(1usize, |n, &b| n.checked_mul(b));
        match all.filter(|&n| n <= (2 * model.points.len()).clamp(1 << 12, 1 << 25)) {
            Some(words) => self.cells_by_bits(model, words),
            None => self.cells_by_keys(model),
        }
    }

    /// A bit for each cell, a word for each block.
    fn cells_by_bits<P: Place>(&self, model: &Model<'_, P>, words: usize) -> (Vec<u32>, Vec<[u32; 3]>) {
        let [wide, high, _] = self.blocks().map(|n| n as u32);
        let bits: Vec<AtomicU64> = (0..words).map(|_| AtomicU64::new(0)).collect();
        let mut of = vec![0u32; model.points.len()];
        pieces::fill(&mut of, |start, piece| {
            for (slot, p) in piece.iter_mut().zip(&model.points[start..]) {
                let c = self.cell_at(p.wide());
                let word = ((c[2] >> 2) * high + (c[1] >> 2)) * wide + (c[0] >> 2);
                let bit = (c[2] & 3) << 4 | (c[1] & 3) << 2 | c[0] & 3;
                *slot = word << 6 | bit;
                let (word, bit) = (&bits[word as usize], 1u64 << bit);
                // Most are set already, and a look is cheaper.
                if word.load(Ordering::Relaxed) & bit == 0 {
                    word.fetch_or(bit, Ordering::Relaxed);
                }
            }
        });
        let mut cells = Vec::new();
        let mut block = [0, 0, 0];
        let ranked: Vec<(u64, u32)> = bits
            .into_iter()
            .map(|word| {
                let word = word.into_inner();
                let before = cells.len() as u32;
                let mut left = word;
                while left != 0 {
                    let bit = left.trailing_zeros();
                    left &= left - 1;
                    cells.push([block[0] + (bit & 3), block[1] + (bit >> 2 & 3), block[2] + (bit >> 4)]);
                }
                block[0] += 4;
                if block[0] == 4 * wide {
                    block = [0, block[1] + 4, block[2]];
                }
                if block[1] == 4 * high {
                    block = [0, 0, block[2] + 4];
                }
                (word, before)
            })
            .collect();
        pieces::fill(&mut of, |_, piece| {
            for slot in piece {
                let (word, before) = ranked[(*slot >> 6) as usize];
                let below = (1u64 << (*slot & 63)) - 1;
                *slot = before + (word & below).count_ones();
            }
        });
        (of, cells)
    }

    /// Keys of all vertices in order: for grids that are far finer than the vertices are dense.
    fn cells_by_keys<P: Place>(&self, model: &Model<'_, P>) -> (Vec<u32>, Vec<[u32; 3]>) {
        let mut keys = vec![(0u64, 0u32); model.points.len()];
        pieces::fill(&mut keys, |start, piece| {
            for (i, slot) in piece.iter_mut().enumerate() {
                let c = self.cell_at(model.points[start + i].wide()).map(u64::from);
                *slot = (c[2] << 42 | c[1] << 21 | c[0], (start + i) as u32);
            }
        });
        pieces::sort(&mut keys);
        let mut of = vec![0u32; keys.len()];
        let mut cells = Vec::new();
        for (i, &(key, v)) in keys.iter().enumerate() {
            if i == 0 || keys[i - 1].0 != key {
                cells.push([key, key >> 21, key >> 42].map(|x| x as u32 & 0x1f_ffff));
            }
            of[v as usize] = cells.len() as u32 - 1;
        }
        (of, cells)
    }
}
