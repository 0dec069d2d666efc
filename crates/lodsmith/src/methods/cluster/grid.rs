//! The grid: its cells, and the cell of each vertex.

use glam::{DVec3, Mat4, Vec4};

use super::model::{ClusterInput, ClusterPosition, Framed, LANES, MAX_MARK_SHARES};
use crate::chunks;

/// Maximum number of cells along the longest edge of the box: a key has 21 bits for each coordinate.
pub(super) const MAX_RESOLUTION: f64 = 2_000_000.0;
/// Maximum rounding error of a single-precision position, in longest edges of the box. (Three roundings by
/// 2^-26 and 2^-25.)
const MAX_ROUNDING: f64 = 1.0 / (1u64 << 23) as f64;
/// Adding this to a float of moderate size rounds it to an integer, which is then in its low bits.
const ROUNDING_MAGIC: f32 = (3u32 << 22) as f32;
const LOW_BITS: u32 = (1 << 22) - 1;

/// Grid of cubes, centred on the box.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClusterGrid {
    /// Centre of the box, and half the grid in cells: kept apart, so that nothing is rounded to the precision
    /// of large coordinates.
    middle: DVec3,
    half: DVec3,
    pub(super) cell: f64,
    /// Cells along the longest edge of the box.
    scale: f32,
    /// Cells along each axis.
    count: [u32; 3],
    /// Maximum rounding error of a position in cells.
    pub(super) rounding: f32,
}

/// Returns the cell of a coordinate: the integer nearest to it minus a half. A coordinate on a boundary may
/// get either cell.
#[inline(always)]
fn cell_index(place: f32) -> u32 {
    (place - 0.5 + ROUNDING_MAGIC).to_bits() & LOW_BITS
}

/// Splits vertices into groups of eight, the last one padded.
#[inline(always)]
fn eights(frame: &[Framed]) -> impl Iterator<Item = [Framed; LANES]> {
    let (whole, rest) = frame.as_chunks::<LANES>();
    let last = (!rest.is_empty()).then(|| {
        let mut last = [[0.0; 4]; LANES];
        last[..rest.len()].copy_from_slice(rest);
        last
    });
    whole.iter().copied().chain(last)
}

impl ClusterGrid {
    /// Builds a grid with `resolution` cells along the longest edge of the box. It exceeds the box equally on
    /// both sides.
    pub(super) fn new<P: ClusterPosition>(model: &ClusterInput<'_, P>, resolution: f64) -> Self {
        let scale = resolution as f32;
        let resolution = f64::from(scale);
        let extent = model.extent();
        let longest = extent.max_element();
        let rounding = MAX_ROUNDING * resolution;
        // Margin for rounding, so that no position lies outside.
        let count = (extent / longest * resolution + 2.0 * rounding).as_uvec3() + 1;
        let half = 0.5 * count.as_dvec3();
        let cell = longest / resolution;
        Self { middle: model.middle(), half, cell, scale, count: count.to_array(), rounding: rounding as f32 }
    }
    /// Factor and summand that convert framed coordinates to positions in cells from the origin.
    #[inline(always)]
    pub(super) fn places(&self) -> (Vec4, Vec4) {
        (Vec4::splat(self.scale), self.half.as_vec3().extend(0.0))
    }
    /// Positions in cells of some vertices, by axis.
    #[inline(always)]
    fn places_of(&self, frame: &[Framed; LANES]) -> [[f32; LANES]; 3] {
        let half = self.half.as_vec3();
        let turned = |k: usize| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| Vec4::from(frame[k + i]));
            Mat4::from_cols(a, b, c, d).transpose()
        };
        let (low, high) = (turned(0), turned(4));
        let place = |low: Vec4, high: Vec4, half: f32| -> [f32; LANES] {
            bytemuck::cast([low * self.scale + half, high * self.scale + half])
        };
        [
            place(low.x_axis, high.x_axis, half.x),
            place(low.y_axis, high.y_axis, half.y),
            place(low.z_axis, high.z_axis, half.z),
        ]
    }
    /// Returns the cells of some vertices; for vertices without a face, any cell.
    #[inline(always)]
    fn cells_at(&self, frame: &[Framed; LANES]) -> [[u32; LANES]; 3] {
        let places = self.places_of(frame);
        let last = self.count.map(|n| n as f32 - 0.5);
        // Written out so that it compiles to two instructions, and NaN gets a cell too.
        let inside = |x: f32, last: f32| {
            let x = if x > 0.5 { x } else { 0.5 };
            if x < last { x } else { last }
        };
        [0, 1, 2].map(|k| places[k].map(|x| cell_index(inside(x, last[k]))))
    }
    /// Returns the cell of a vertex that has a face.
    pub(super) fn cell_of<P: ClusterPosition>(&self, model: &ClusterInput<'_, P>, v: usize) -> [u32; 3] {
        self.cells_at(&[model.frame[v]; LANES]).map(|axis| axis[0])
    }
    /// Returns the cell of a position, as integral floats.
    #[inline(always)]
    pub(super) fn cell_in(place: Vec4) -> Vec4 {
        let whole = Vec4::splat(ROUNDING_MAGIC);
        (place - 0.5 + whole) - whole
    }
    /// Returns a position relative to its cell.
    #[inline(always)]
    pub(super) fn offset_in_cell(place: Vec4) -> Vec4 {
        place - Self::cell_in(place)
    }
    /// Converts a position in cells to user units.
    pub(super) fn to_user(self, p: DVec3) -> [f64; 3] {
        ((p - self.half) * self.cell + self.middle).to_array()
    }
    /// Computes hash keys that differ between the cells of nearby vertices.
    pub(super) fn keys<P: ClusterPosition>(&self, model: &ClusterInput<'_, P>, keys: &mut [u32]) {
        chunks::fill(keys, |start, piece| {
            for (keys, frame) in piece.chunks_mut(LANES).zip(eights(&model.frame[start..])) {
                let [x, y, z] = self.places_of(&frame).map(|axis| axis.map(cell_index));
                let mut all = [0; LANES];
                for k in 0..LANES {
                    all[k] = x[k].wrapping_add(y[k] << 11).wrapping_add(z[k] << 22);
                }
                keys.copy_from_slice(&all[..keys.len()]);
            }
        });
    }
    /// Number of blocks of 4³ cells along each axis.
    fn blocks(&self) -> [usize; 3] {
        self.count.map(|n| (n as usize).div_ceil(4))
    }

    /// Returns for each vertex the index of its cell among the occupied ones, and the coordinates of those
    /// cells.
    pub(super) fn cells<P: ClusterPosition>(&self, model: &ClusterInput<'_, P>) -> (Vec<u32>, Vec<[u32; 3]>) {
        let blocks = self.blocks();
        let all = blocks.iter().try_fold(1usize, |n, &b| n.checked_mul(b));
        match all.filter(|&n| n <= (2 * model.points.len()).clamp(1 << 12, 1 << 25)) {
            Some(words) => self.cells_by_bits(model, words),
            None => self.cells_by_keys(model),
        }
    }

    /// Numbers the cells with a bit set: one bit per cell, one word per block.
    fn cells_by_bits<P: ClusterPosition>(
        &self,
        model: &ClusterInput<'_, P>,
        words: usize,
    ) -> (Vec<u32>, Vec<[u32; 3]>) {
        let [wide, high, _] = self.blocks().map(|n| n as u32);
        let mut of = vec![0u32; model.points.len()];
        let share = of.len().div_ceil(chunks::threads(of.len()).min(MAX_MARK_SHARES)).next_multiple_of(LANES);
        let mut marked = chunks::shared(&mut of, share, |k, piece| {
            let mut bits = vec![0u64; words];
            for (slots, frame) in piece.chunks_mut(LANES).zip(eights(&model.frame[k * share..])) {
                let [x, y, z] = self.cells_at(&frame);
                let mut codes = [0; LANES];
                for k in 0..LANES {
                    let word = ((z[k] >> 2) * high + (y[k] >> 2)) * wide + (x[k] >> 2);
                    codes[k] = word << 6 | (z[k] & 3) << 4 | (y[k] & 3) << 2 | x[k] & 3;
                }
                for (slot, code) in slots.iter_mut().zip(codes) {
                    *slot = code;
                    bits[(code >> 6) as usize] |= 1 << (code & 63);
                }
            }
            bits
        });
        let mut bits = marked.swap_remove(0);
        let len = chunks::len(words);
        let counts = chunks::shared(&mut bits, len, |k, bits| {
            for more in &marked {
                bits.iter_mut().zip(&more[k * len..]).for_each(|(word, more)| *word |= more);
            }
            bits.iter().map(|w| w.count_ones()).sum::<u32>()
        });
        let all = counts.iter().sum::<u32>() as usize;
        let starts: Vec<u32> = counts
            .iter()
            .scan(0, |sum, count| {
                *sum += count;
                Some(*sum - count)
            })
            .collect();
        let mut ranked = vec![(0u64, 0u32); words];
        let mut cells = vec![[0u32; 3]; all];
        let parts = chunks::cut(&mut cells, counts.iter().map(|n| *n as usize));
        let parts = parts.into_iter().zip(ranked.chunks_mut(len)).zip(starts).collect();
        chunks::over(parts, |k, ((cells, ranked), start): ((&mut [[u32; 3]], &mut [_]), u32)| {
            let mut before = start;
            let mut cells = cells.iter_mut();
            for (i, (ranked, &word)) in (k * len..).zip(ranked.iter_mut().zip(&bits[k * len..])) {
                *ranked = (word, before);
                before += word.count_ones();
                if word != 0 {
                    let block = i as u32;
                    let [x, y, z] = [block % wide, block / wide % high, block / wide / high].map(|n| 4 * n);
                    let mut left = word;
                    for cell in cells.by_ref().take(word.count_ones() as usize) {
                        let bit = left.trailing_zeros();
                        left &= left - 1;
                        *cell = [x + (bit & 3), y + (bit >> 2 & 3), z + (bit >> 4)];
                    }
                }
            }
        });
        chunks::fill(&mut of, |_, piece| {
            for slot in piece {
                let (word, before): (u64, u32) = ranked[(*slot >> 6) as usize];
                let below = (1u64 << (*slot & 63)) - 1;
                *slot = before + (word & below).count_ones();
            }
        });
        (of, cells)
    }

    /// Numbers the cells by sorted keys: for grids much finer than the vertex density.
    fn cells_by_keys<P: ClusterPosition>(&self, model: &ClusterInput<'_, P>) -> (Vec<u32>, Vec<[u32; 3]>) {
        let mut keys = vec![(0u64, 0u32); model.points.len()];
        chunks::fill(&mut keys, |start, piece| {
            let frame = eights(&model.frame[start..]);
            for (j, (slots, frame)) in piece.chunks_mut(LANES).zip(frame).enumerate() {
                let cells = self.cells_at(&frame);
                for (k, slot) in slots.iter_mut().enumerate() {
                    let [x, y, z] = cells.map(|axis| u64::from(axis[k]));
                    *slot = (z << 42 | y << 21 | x, (start + j * LANES + k) as u32);
                }
            }
        });
        chunks::sort(&mut keys);
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
