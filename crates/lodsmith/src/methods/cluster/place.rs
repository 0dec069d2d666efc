//! Vertex placement: minimises the squared distance to the planes of the faces in a cell, and to its borders.

use glam::{BVec4A, Mat4, UVec3, Vec3, Vec3A, Vec4, Vec4Swizzles};

use lodsmith_core::VertexId;
use wide::f32x4;

use super::faces::{BLOCK, Shares};
use super::grid::ClusterGrid;
use super::model::{ClusterInput, ClusterPosition};
use super::search::Clusters;
use crate::chunks;

/// Bitwise AND of four floats and a mask: one instruction, where a blend takes three.
#[inline(always)]
fn masked(four: Vec4, mask: [u32; 4]) -> Vec4 {
    let (four, mask): (f32x4, f32x4) = (bytemuck::cast(four), bytemuck::cast(mask));
    bytemuck::cast(four & mask)
}

/// Sums over the faces with a corner in a cell, in units of the cell and relative to its lowest corner: one
/// cache line, in SIMD groups of four. [Lindstrom 2000]
#[derive(Clone, Copy, Default)]
#[repr(align(64))]
struct CellSums {
    /// Squared distance to the planes, weighted by doubled areas: x'Ax - 2b'x + c. Here xx, yy, zz of A, and
    /// the weight.
    squares: Vec4,
    /// xz, xy, yz of A; and c.
    products: Vec4,
    b: Vec4,
    /// Sum of the corners in the cell, weighted by doubled areas.
    corners: Vec4,
}

/// Summed directions and moments of the edges of faces. Edges shared by two faces cancel, so only open
/// borders remain, and only open vertices have any. [Lindstrom-Silva 2001]
#[derive(Clone, Copy, Default)]
struct BorderSums {
    direction: Vec3A,
    moment: Vec3A,
}

/// Number of faces whose corners are fetched together, so that the memory accesses overlap.
const BATCH_FACES: usize = 32;
/// Weight of borders relative to planes. (Measured: on terrain and on open scans 1 to 10 give equal results.)
const BORDER_WEIGHT: f64 = 3.0;
/// Directions in which the planes contribute less than this share of their sum stay at the mean. ([Lindstrom
/// 2000] cuts singular values off at this share; a gradual cutoff is as good, as measured, and needs no
/// eigenvectors.)
const SINGULAR_CUTOFF: f32 = 1e-3;
/// Doubled areas below this are ignored: their products would leave the range of single precision.
const MIN_DOUBLED_AREA: f32 = 1e-30;
/// Minimum distance of vertices from the sides of their cells, in cells: two at one corner would coincide.
const CELL_MARGIN: f32 = 1e-3;

/// Index of clusters without a face.
pub(super) const UNUSED: u32 = u32::MAX;

/// Positions of the vertices of clusters with a face, in user units, and the mean squared distance to the
/// planes.
pub(super) struct PlacedVertices<P> {
    /// One list per share.
    pub(super) points: Vec<Vec<P>>,
    /// Index of each cluster among the clusters of its share that have a face, or [`UNUSED`].
    number: Vec<u32>,
    /// Number of points in the preceding shares.
    starts: Vec<u32>,
    pub(super) mean_square: f64,
}

impl<P> PlacedVertices<P> {
    /// Returns the index of a cluster among all that have a face, if it has one.
    #[inline(always)]
    pub(super) fn number(&self, shares: &Shares, cluster: u32) -> Option<u32> {
        let number = self.number[cluster as usize];
        (number != UNUSED).then(|| self.starts[shares.of(cluster)] + number)
    }
}

/// Places a vertex in each cluster; `borders` scales the default border weight. No vertex leaves its cell.
/// Cost: O(V + F).
pub(super) fn place<P: ClusterPosition>(
    model: &ClusterInput<'_, P>,
    clusters: &Clusters,
    borders: f64,
) -> PlacedVertices<P> {
    let all = clusters.cells.len();
    let mut number = vec![UNUSED; all];
    let ranges = (0..clusters.shares.count).map(|k| clusters.shares.range(k, all).len());
    let parts =
        chunks::over(chunks::cut(&mut number, ranges), |k, number| match model.has_open && borders > 0.0 {
            true => place_share::<P, true>(model, clusters, borders, k, number),
            false => place_share::<P, false>(model, clusters, borders, k, number),
        });
    let (mut points, mut starts, mut sum) = (Vec::new(), Vec::new(), 0);
    let (mut cost, mut weight) = (0.0, 0.0);
    for part in parts {
        starts.push(sum);
        sum += part.points.len() as u32;
        points.push(part.points);
        for (c, w) in part.costs {
            (cost, weight) = (cost + c, weight + w);
        }
    }
    let mean_square = if weight > 0.0 { cost / weight * clusters.grid.cell.powi(2) } else { 0.0 };
    PlacedVertices { points, number, starts, mean_square }
}

/// Result of a contiguous range of clusters.
struct PlacedShare<P> {
    points: Vec<P>,
    /// Cost and weight of each block, summed in cell order.
    costs: Vec<(f64, f64)>,
}

/// Places the vertices of a share of the clusters, and numbers those with a face. Faces are added in their
/// order, so every sum has a fixed order.
fn place_share<P: ClusterPosition, const RIMS: bool>(
    model: &ClusterInput<'_, P>,
    clusters: &Clusters,
    borders: f64,
    share: usize,
    number: &mut [u32],
) -> PlacedShare<P> {
    let Clusters { grid, cells, shares, .. } = clusters;
    let range = shares.range(share, cells.len());
    let first = range.start as u32;
    let cells = &cells[range];
    let mut sums = vec![CellSums::default(); cells.len().next_multiple_of(4)];
    let mut rims = vec![BorderSums::default(); if RIMS { sums.len() } else { 0 }];
    let mut is_used = vec![false; sums.len()];
    let mut batch = Batch::default();
    let mut add_batch = |batch: &mut Batch, count: usize| {
        batch.fetch(model, clusters);
        for i in 0..count {
            let (of, places) = (&batch.clusters[i], &batch.places[i]);
            add((&mut sums, &mut is_used), first, of, places, &batch.planes(i));
            if RIMS && batch.open[i] != 0 {
                add_rims(&mut rims, first, (of, batch.open[i]), places);
            }
        }
    };
    if shares.count == 1 {
        for some in model.faces.chunks(BATCH_FACES) {
            batch.faces[..some.len()].copy_from_slice(some);
            add_batch(&mut batch, some.len());
        }
    } else {
        shares.touching::<BATCH_FACES>(share, |some| {
            batch.faces.iter_mut().zip(some).for_each(|(slot, f)| *slot = model.faces[*f as usize]);
            add_batch(&mut batch, some.len());
        });
    }
    let used = is_used.iter().filter(|used| **used).count();
    let mut part = PlacedShare { points: Vec::with_capacity(used), costs: Vec::new() };
    for (block, cells) in cells.chunks(BLOCK).enumerate() {
        let (mut cost, mut weight) = (0.0, 0.0);
        for (four, cells) in cells.chunks(4).enumerate() {
            let i = block * BLOCK + 4 * four;
            let sums: &[CellSums; 4] = sums[i..i + 4].try_into().expect("padded to fours");
            let border = if RIMS { Forms::of(&rims[i..i + 4], borders) } else { Forms::default() };
            let (places, costs) = solve(sums, &border, grid.rounding);
            for (j, cell) in cells.iter().enumerate() {
                if is_used[i + j] {
                    let at = UVec3::from(*cell).as_dvec3() + places[j].as_dvec3();
                    number[i + j] = part.points.len() as u32;
                    part.points.push(P::of(grid.to_user(at)));
                }
                (cost, weight) = (cost + f64::from(costs[j]), weight + f64::from(sums[j].squares.w));
            }
        }
        part.costs.push((cost, weight));
    }
    part
}

/// A batch of faces, processed one step at a time: memory accesses and square roots then overlap.
struct Batch {
    faces: [[VertexId; 3]; BATCH_FACES],
    /// Clusters of the corners, and their positions in cells from the origin.
    clusters: [[u32; 3]; BATCH_FACES],
    places: [[Vec4; 3]; BATCH_FACES],
    /// One bit for each corner at an open vertex.
    open: [u32; BATCH_FACES],
    normals: [Vec4; BATCH_FACES],
    /// Doubled areas, and their inverses, which scale normals to unit length.
    doubled: [f32; BATCH_FACES],
    inverse: [f32; BATCH_FACES],
}

impl Default for Batch {
    fn default() -> Self {
        Self {
            faces: [[VertexId(0); 3]; BATCH_FACES],
            clusters: [[0; 3]; BATCH_FACES],
            places: [[Vec4::ZERO; 3]; BATCH_FACES],
            open: [0; BATCH_FACES],
            normals: [Vec4::ZERO; BATCH_FACES],
            doubled: [0.0; BATCH_FACES],
            inverse: [0.0; BATCH_FACES],
        }
    }
}

impl Batch {
    #[inline(always)]
    fn fetch<P: ClusterPosition>(&mut self, model: &ClusterInput<'_, P>, clusters: &Clusters) {
        for (i, t) in self.faces.iter().enumerate() {
            self.clusters[i] = t.map(|v| clusters.of[v.index()]);
            self.places[i] = t.map(|v| model.frame[v.index()].into());
        }
        let (scale, half) = clusters.grid.places();
        for i in 0..BATCH_FACES {
            let [a, b, c] = self.places[i].map(|p| p.is_negative_bitmask() >> 3);
            self.open[i] = a | b << 1 | c << 2;
            let [a, b, c] = self.places[i].map(|p| p * scale + half);
            self.places[i] = [a, b, c];
            let (u, v) = (b - a, c - a);
            let normal = (u * v.yzxw() - u.yzxw() * v).yzxw();
            self.normals[i] = normal;
            self.doubled[i] = normal.length_squared();
        }
        for (doubled, inverse) in self.doubled.iter_mut().zip(&mut self.inverse) {
            *doubled = doubled.sqrt();
            *inverse = 1.0 / if *doubled > f32::MIN_POSITIVE { *doubled } else { f32::MIN_POSITIVE };
        }
    }
    #[inline(always)]
    fn planes(&self, i: usize) -> Planes {
        let (normal, doubled) = (self.normals[i], Vec4::splat(self.doubled[i]));
        let unit = normal * self.inverse[i];
        let last = masked(doubled, [0, 0, 0, u32::MAX]);
        Planes {
            squares: normal * unit + last,
            // The order of the components: zx, xy, yz.
            products: normal * unit.zxyw() + last,
            normal,
            unit,
            doubled,
        }
    }
}

/// Adds a face to the sums of its cells, as far as `sums` has them (from cell `first` on); if the face is
/// kept, marks them as used.
#[inline(always)]
fn add(
    (sums, is_used): (&mut [CellSums], &mut [bool]),
    first: u32,
    clusters: &[u32; 3],
    &[a, b, c]: &[Vec4; 3],
    planes: &Planes,
) {
    let slot = |k: usize| clusters[k].wrapping_sub(first) as usize;
    if clusters[0] == clusters[1] && clusters[1] == clusters[2] {
        if let Some(sum) = sums.get_mut(slot(0)) {
            let at = ClusterGrid::offset_in_cell(a);
            sum.add(planes, 3.0, at, 3.0 * at + ((b - a) + (c - a)));
        }
        return;
    }
    let is_left = clusters[0] != clusters[1] && clusters[1] != clusters[2] && clusters[2] != clusters[0];
    // One corner at a time even if two share a cell: that would be an unpredictable branch.
    for (k, place) in [a, b, c].into_iter().enumerate() {
        if let (Some(sum), Some(is_used)) = (sums.get_mut(slot(k)), is_used.get_mut(slot(k))) {
            let at = ClusterGrid::offset_in_cell(place);
            sum.add(planes, 1.0, at, at);
            *is_used |= is_left;
        }
    }
}

/// Adds the border edges of a face to the rims of its cells: at each open corner the edge to the next corner
/// and the edge from the one before.
fn add_rims(rims: &mut [BorderSums], first: u32, (clusters, open): (&[u32; 3], u32), places: &[Vec4; 3]) {
    let [a, b, c] = places.map(Vec3A::from_vec4);
    let edges = [(b - a, c - a), (c - b, a - b), (a - c, b - c)];
    for (k, (next, after)) in edges.into_iter().enumerate().filter(|x| open >> x.0 & 1 != 0) {
        if let Some(rim) = rims.get_mut(clusters[k].wrapping_sub(first) as usize) {
            let at = Vec3A::from_vec4(ClusterGrid::offset_in_cell(places[k]));
            rim.direction += next - after;
            rim.moment += at.cross(next - after);
        }
    }
}

/// Contribution of a face to the sums of its cells, apart from its position in them.
struct Planes {
    squares: Vec4,
    products: Vec4,
    normal: Vec4,
    unit: Vec4,
    doubled: Vec4,
}

impl CellSums {
    /// Adds a plane through a position, `corners` times. (Never writes a single lane: a load of four after
    /// that would stall.)
    #[inline(always)]
    fn add(&mut self, planes: &Planes, corners: f32, at: Vec4, all: Vec4) {
        let corners = Vec4::splat(corners);
        let distance = planes.unit.dot_into_vec(at);
        self.squares += planes.squares * corners;
        let times =
            Vec4::select(BVec4A::new(true, true, true, false), corners, corners * distance * distance);
        self.products += planes.products * times;
        self.b += planes.normal * (distance * corners);
        self.corners += all * planes.doubled;
    }
}

/// Quadratic forms x'Ax - 2b'x + c of four cells, one SIMD lane per cell.
#[derive(Default)]
struct Forms {
    xx: Vec4,
    yy: Vec4,
    zz: Vec4,
    xz: Vec4,
    xy: Vec4,
    yz: Vec4,
    b: [Vec4; 3],
}

impl Forms {
    /// Returns the quadratic forms of the borders.
    fn of(rims: &[BorderSums], borders: f64) -> Self {
        let mut forms = Self::default();
        for (k, rim) in rims.iter().enumerate() {
            let length = rim.direction.length();
            if length > MIN_DOUBLED_AREA {
                let share = (BORDER_WEIGHT * borders) as f32 / length;
                let d = Vec3::from(rim.direction);
                let square = length * length;
                let rest = d.cross(rim.moment.into()) * share;
                forms.xx[k] = (square - d.x * d.x) * share;
                forms.yy[k] = (square - d.y * d.y) * share;
                forms.zz[k] = (square - d.z * d.z) * share;
                forms.xz[k] = -d.x * d.z * share;
                forms.xy[k] = -d.x * d.y * share;
                forms.yz[k] = -d.y * d.z * share;
                (0..3).for_each(|axis| forms.b[axis][k] = rest[axis]);
            }
        }
        forms
    }
}

/// Transposes rows of four cells to one lane per cell.
#[inline(always)]
fn lanes(sums: &[CellSums; 4], row: impl Fn(&CellSums) -> Vec4) -> [Vec4; 4] {
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| row(&sums[k]));
    let turned = Mat4::from_cols(a, b, c, d).transpose();
    [turned.x_axis, turned.y_axis, turned.z_axis, turned.w_axis]
}

/// Returns the optimal positions in four cells, and the cost of each.
fn solve(sums: &[CellSums; 4], border: &Forms, rounding: f32) -> ([Vec3; 4], [f32; 4]) {
    let [xx, yy, zz, weight] = lanes(sums, |s| s.squares);
    let [xz, xy, yz, c] = lanes(sums, |s| s.products);
    let b = lanes(sums, |s| s.b);
    let corners = lanes(sums, |s| s.corners);
    let has_area = weight.cmpgt(Vec4::splat(MIN_DOUBLED_AREA));
    let one = Vec4::ONE;
    let each = one / Vec4::select(has_area, weight, one);
    let mean = [0, 1, 2].map(|k| (corners[k] * each).clamp(Vec4::ZERO, one));
    let times = |[xx, yy, zz, xz, xy, yz]: [Vec4; 6], [x, y, z]: [Vec4; 3]| {
        [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z]
    };
    let all =
        [xx + border.xx, yy + border.yy, zz + border.zz, xz + border.xz, xy + border.xy, yz + border.yz];
    let at_mean = times(all, mean);
    let r = [0, 1, 2].map(|k| b[k] + border.b[k] - at_mean[k]);
    // LDLᵀ factorisation: the damping keeps the pivots away from zero.
    let [xx_, yy_, zz_, xz_, xy_, yz_] = all;
    let damping = (xx_ + yy_ + zz_) * SINGULAR_CUTOFF;
    let first = one / (xx_ + damping);
    let (l, m) = (xy_ * first, xz_ * first);
    let second = one / (yy_ + damping - l * xy_);
    let below = yz_ - m * xy_;
    let n = below * second;
    let third = one / (zz_ + damping - m * xz_ - n * below);
    let (y1, y2) = (r[1] - l * r[0], r[2] - m * r[0] - n * (r[1] - l * r[0]));
    let z = y2 * third;
    let y = y1 * second - n * z;
    let x = r[0] * first - l * y - m * z;
    let low = Vec4::splat(rounding.clamp(CELL_MARGIN, 0.5));
    let step = [x, y, z];
    let places = [0, 1, 2].map(|k| {
        // Rejects steps that are NaN or too large.
        let step = Vec4::select(step[k].abs().cmplt(Vec4::splat(4.0)), step[k], Vec4::ZERO);
        Vec4::select(has_area, mean[k] + step, Vec4::splat(0.5)).clamp(low, one - low)
    });
    let [ax, ay, az] = times([xx, yy, zz, xz, xy, yz], places);
    let [x, y, z] = places;
    let cost = x * (ax - 2.0 * b[0]) + y * (ay - 2.0 * b[1]) + z * (az - 2.0 * b[2]) + c;
    let cost = Vec4::select(has_area, cost.max(Vec4::ZERO), Vec4::ZERO).to_array();
    let [x, y, z] = places.map(|p| p.to_array());
    ([0, 1, 2, 3].map(|k| Vec3::new(x[k], y[k], z[k])), cost)
}
