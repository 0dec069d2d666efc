//! The samples of a band of rows, and triangle coverage.

use wide::{f32x4, i32x4, u32x4};

/// Offsets of the four samples from the centre of the pixel: each in a column and a row of its own.
pub(crate) const SAMPLES: [[f32; 2]; 4] =
    [[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]];
/// Marks a sample without a face.
pub(crate) const NO_FACE: u32 = u32::MAX;
/// Side of a tile of [`TileDepths`] in pixels.
const TILE_SIZE: usize = 8;

/// A corner on the screen: position in pixels, nearness, unused.
pub(crate) type Corner = [f32; 4];

/// The four samples of a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Cell {
    /// Nearness of the face that each sample sees.
    pub(crate) near: f32x4,
    /// The face that each sample sees.
    pub(crate) face: u32x4,
}

/// Some rows of the picture.
#[derive(Default)]
pub(crate) struct Band {
    pub(crate) first_row: usize,
    pub(crate) width: usize,
    pub(crate) rows: usize,
    pub(crate) cells: Vec<Cell>,
}

/// Smallest nearness of any sample in each tile: a coarse depth buffer for occlusion tests.
pub(crate) struct TileDepths {
    first_row: usize,
    columns: usize,
    least: Vec<f32>,
}

/// A rectangle of pixels, ends excluded.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelRect {
    pub(crate) x: [u16; 2],
    pub(crate) y: [u16; 2],
}

/// Four triangles in SIMD lanes, set up for drawing.
pub(crate) struct TriangleQuad {
    /// Edge functions opposite the corners: factors of x and y, their origin, and the smallest value inside.
    sides: [[f32x4; 5]; 3],
    /// Nearness of the first corner, its gradient in x and y, and the corner's position, in pixels.
    near: [f32x4; 5],
    range: [f32x4; 2],
    first: [i32x4; 2],
    end: [i32x4; 2],
}

/// Transposes the corners of four triangles into SIMD lanes: x, y and nearness of the first, second and third
/// corner. `of` is called with triangle and corner.
#[inline(always)]
pub(crate) fn transpose_corners(of: impl Fn(usize, usize) -> Corner) -> [[f32x4; 3]; 3] {
    // Written out: otherwise arrays this large are copied by function calls.
    let corner = |k: usize| {
        let all = [of(0, k).into(), of(1, k).into(), of(2, k).into(), of(3, k).into()];
        let [x, y, near, _] = f32x4::transpose(all);
        [x, y, near]
    };
    [corner(0), corner(1), corner(2)]
}

/// Returns twice the signed area on the screen, where y points down: positive if the corners are clockwise.
#[inline(always)]
pub(super) fn doubled_areas([a, b, c]: &[[f32x4; 3]; 3]) -> f32x4 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Returns the columns, or rows, of pixels with samples between two numbers: the first, and one past the
/// last. The outermost samples are 3/8 from the centre of a pixel.
#[inline(always)]
pub(super) fn pixels_between(low: f32x4, high: f32x4) -> [i32x4; 2] {
    let zero = f32x4::splat(0.0);
    let from = (low - 0.875).fast_max(zero);
    let below = from.fast_trunc_int();
    let is_below: i32x4 = bytemuck::cast(below.round_float().simd_lt(from));
    [below - is_below, (high + 0.875).fast_max(zero).fast_trunc_int()]
}

/// Returns the smallest and the largest of three numbers.
#[inline(always)]
pub(super) fn range([a, b, c]: [f32x4; 3]) -> [f32x4; 2] {
    [a.fast_min(b).fast_min(c), a.fast_max(b).fast_max(c)]
}

/// Returns the smallest and the largest of a coordinate of three corners.
pub(super) fn extent(corners: &[Corner; 3], k: usize) -> [f32; 2] {
    let [a, b, c] = corners.map(|c| c[k]);
    [a.min(b).min(c), a.max(b).max(c)]
}

impl TriangleQuad {
    #[inline(always)]
    pub(super) fn new(of: impl Fn(usize, usize) -> Corner) -> Self {
        let corners = transpose_corners(of);
        let doubled = doubled_areas(&corners);
        let [a, b, c] = corners;
        let turned = doubled.simd_lt(f32x4::splat(0.0));
        let [b, c] =
            [[0, 1, 2].map(|k| turned.select(c[k], b[k])), [0, 1, 2].map(|k| turned.select(b[k], c[k]))];
        let doubled = doubled.abs();
        let side = |p: [f32x4; 3], q: [f32x4; 3]| {
            // Both neighbours measure from the same end, so they get the same number except for its sign: no
            // sample between them is lost or taken twice.
            let is_first = p[1].simd_lt(q[1]) | (p[1].simd_eq(q[1]) & p[0].simd_lt(q[0]));
            let least = is_first.select(f32x4::splat(0.0), f32x4::splat(f32::MIN_POSITIVE));
            [p[1] - q[1], q[0] - p[0], is_first.select(p[0], q[0]), is_first.select(p[1], q[1]), least]
        };
        let sides = [side(b, c), side(c, a), side(a, b)];
        let per_area = f32x4::splat(1.0) / doubled;
        let (nb, nc) = (b[2] - a[2], c[2] - a[2]);
        let slope = |k: usize| (sides[1][k] * nb + sides[2][k] * nc) * per_area;
        // False also for NaN.
        let is_there = doubled.simd_gt(f32x4::splat(0.0)) & doubled.simd_lt(f32x4::splat(f32::INFINITY));
        let is_there: i32x4 = bytemuck::cast(is_there);
        let [x, y] = [0, 1].map(|k| {
            let [low, high] = range([a[k], b[k], c[k]]);
            let [first, end] = pixels_between(low, high);
            [first, end & is_there]
        });
        Self {
            sides,
            near: [a[2], slope(0), slope(1), a[0], a[1]],
            range: range([a[2], b[2], c[2]]),
            first: [x[0], y[0]],
            end: [x[1], y[1]],
        }
    }
}

impl Band {
    pub(super) fn clear(&mut self, first_row: usize, width: usize, rows: usize) {
        (self.first_row, self.width, self.rows) = (first_row, width, rows);
        let empty = Cell { near: f32x4::splat(f32::NEG_INFINITY), face: u32x4::splat(NO_FACE) };
        self.cells.clear();
        self.cells.resize(width * rows, empty);
    }

    /// Draws one of four triangles.
    #[inline(always)]
    pub(super) fn draw_solid(&mut self, four: &TriangleQuad, which: usize, face: u32) {
        let mut cells = std::mem::take(&mut self.cells);
        let face = u32x4::splat(face);
        self.walk(four, which, |at, _, _, mask, near| {
            let cell = &mut cells[at];
            let mask = mask & near.simd_gt(cell.near);
            cell.near = mask.select(near, cell.near);
            let mask: u32x4 = bytemuck::cast(mask);
            cell.face = mask.select(face, cell.face);
        });
        self.cells = cells;
    }

    /// Draws one of four triangles, with the covered samples filtered by `keeps`.
    #[inline(never)]
    pub(super) fn draw(
        &mut self,
        four: &TriangleQuad,
        which: usize,
        face: u32,
        keeps: impl Fn(f32, f32, u32) -> u32,
    ) {
        let mut cells = std::mem::take(&mut self.cells);
        self.walk(four, which, |at, x, y, mask, near| {
            let cell = &mut cells[at];
            let mask = (mask & near.simd_gt(cell.near)).to_bitmask();
            let kept = if mask == 0 { 0 } else { keeps(x as f32 + 0.5, y as f32 + 0.5, mask) };
            let lanes: [u32; 4] = std::array::from_fn(|k| 0u32.wrapping_sub(kept >> k & 1));
            let mask = u32x4::from(lanes);
            cell.face = mask.select(u32x4::splat(face), cell.face);
            let mask: f32x4 = bytemuck::cast(mask);
            cell.near = mask.select(near, cell.near);
        });
        self.cells = cells;
    }

    /// Visits the pixels in which a triangle covers samples: cell, column, row, sample mask, nearness.
    #[inline(always)]
    pub(super) fn walk(
        &self,
        four: &TriangleQuad,
        which: usize,
        mut seen: impl FnMut(usize, usize, usize, f32x4, f32x4),
    ) {
        let [x0, y0] = four.first.each_ref().map(|all| all.as_array()[which] as usize);
        let [x1, y1] = four.end.each_ref().map(|all| all.as_array()[which] as usize);
        let (x1, y0, y1) = (x1.min(self.width), y0.max(self.first_row), y1.min(self.first_row + self.rows));
        if x0 >= x1 || y0 >= y1 {
            return;
        }
        let splat = |all: &f32x4| f32x4::splat(all.as_array()[which]);
        let sides = four.sides.each_ref().map(|side| side.each_ref().map(splat));
        let [first, slope_x, slope_y, ax, ay] = four.near.each_ref().map(splat);
        let [least, most] = four.range.each_ref().map(splat);
        let dx = f32x4::from(SAMPLES.map(|s| s[0] + 0.5));
        let dy = f32x4::from(SAMPLES.map(|s| s[1] + 0.5));
        let always = x1 - x0 <= 3;
        for y in y0..y1 {
            let py = dy + y as u32 as f32;
            let row = sides.map(|[_, b, _, y, _]| (py - y) * b);
            let near_row = (py - ay) * slope_y + first;
            let start = (y - self.first_row) * self.width;
            for x in x0..x1 {
                let px = dx + x as u32 as f32;
                let inside = |k: usize| {
                    let [a, _, x, _, least] = sides[k];
                    ((px - x) * a + row[k]).simd_ge(least)
                };
                let mask = inside(0) & inside(1) & inside(2);
                if !always && mask.to_bitmask() == 0 {
                    continue;
                }
                let near = ((px - ax) * slope_x + near_row).fast_max(least).fast_min(most);
                seen(start + x, x, y, mask, near);
            }
        }
    }
}

impl TileDepths {
    pub(super) fn of(band: &Band) -> Self {
        let mut depths =
            Self { first_row: band.first_row, columns: band.width.div_ceil(TILE_SIZE), least: Vec::new() };
        let mut columns = vec![f32x4::splat(f32::INFINITY); depths.columns];
        for rows in band.cells.chunks(TILE_SIZE * band.width) {
            columns.fill(f32x4::splat(f32::INFINITY));
            for row in rows.chunks(band.width) {
                for (least, tile) in columns.iter_mut().zip(row.chunks(TILE_SIZE)) {
                    *least = tile.iter().fold(*least, |least, cell| least.fast_min(cell.near));
                }
            }
            let least = |all: &f32x4| all.to_array().into_iter().fold(f32::INFINITY, f32::min);
            depths.least.extend(columns.iter().map(least));
        }
        depths
    }

    /// True if nothing of this nearness or farther away can be seen in a rectangle of pixels.
    #[inline(always)]
    pub(super) fn hide(&self, near: f32, pixels: &PixelRect) -> bool {
        let [x0, x1] = pixels.x.map(usize::from);
        let [y0, y1] = pixels.y.map(|y| usize::from(y).saturating_sub(self.first_row));
        let columns = x0 / TILE_SIZE..x1.div_ceil(TILE_SIZE);
        let rows = y0 / TILE_SIZE..y1.div_ceil(TILE_SIZE).min(self.least.len() / self.columns);
        rows.into_iter().all(|row| {
            let row = &self.least[row * self.columns..][..self.columns];
            row[columns.clone()].iter().all(|&least| near <= least)
        })
    }

    /// As [`Self::hide`], for the tiles that a triangle touches.
    pub(super) fn hide_triangle(&self, near: f32, corners: &[Corner; 3]) -> bool {
        let tiles = |k: usize, first: usize, count: usize| {
            let at = |x: f32| (x - first as f32).clamp(0.0, (count * TILE_SIZE) as f32) as usize;
            let [low, high] = extent(corners, k).map(at);
            low / TILE_SIZE..(high / TILE_SIZE + 1).min(count)
        };
        let [a, b, c] = corners;
        let doubled = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let [b, c] = if doubled < 0.0 { [c, b] } else { [b, c] };
        // The largest value of an edge function in a tile is at one of its corners.
        let is_beside = |p: &Corner, q: &Corner, x: f32, y: f32| {
            let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
            let size = TILE_SIZE as f32;
            let (x, y) = (if dy < 0.0 { x + size } else { x }, if dx > 0.0 { y + size } else { y });
            dx * (y - p[1]) - dy * (x - p[0]) < 0.0
        };
        let (rows, columns) =
            (tiles(1, self.first_row, self.least.len() / self.columns), tiles(0, 0, self.columns));
        rows.into_iter().all(|row| {
            let y = (self.first_row + row * TILE_SIZE) as f32;
            columns.clone().all(|column| {
                let x = (column * TILE_SIZE) as f32;
                near <= self.least[row * self.columns + column]
                    || is_beside(a, b, x, y)
                    || is_beside(b, c, x, y)
                    || is_beside(c, a, x, y)
            })
        })
    }
}
