//! The ordered input: welded, cleaned, in a unit frame, vertices along a Morton curve, triangles by first
//! vertex.
//!
//! All later steps are local in memory, whatever order the file had. Equal positions have equal codes, so
//! the weld costs nothing beyond the sort.

use bytemuck::Zeroable;
use bytemuck::allocation::zeroed_vec;
use glam::Vec3;
use lodsmith_core::geometry::UnitFrame;
use lodsmith_core::{PositionsView, Surface, TriMesh, VertexId, WedgeId};
use wide::{f32x4, u32x4};

use crate::report::Cleanup;

/// Marks the absence of a vertex.
pub(crate) const NONE: VertexId = VertexId(u32::MAX);
/// Codes are sorted by three digits of this many bits.
const DIGIT_BITS: u32 = 10;
const DIGITS: usize = 1 << DIGIT_BITS;
/// Number of vertices from which the lowest digit is sorted too. With fewer vertices, hardly any agree in the
/// other two digits.
const THREE_DIGIT_MIN_VERTICES: usize = 1 << 14;
/// Number of faces up to which time is saved at the cost of memory; above it, the reverse.
pub(crate) const TIME_OVER_MEMORY_MAX_FACES: usize = 4_000_000;
/// Number of vertices in one cell above which equal positions are found by sorting instead of comparing
/// pairs.
const CELL_SORT_MIN_VERTICES: usize = 16;

/// The ordered input.
pub(crate) struct Ordered {
    /// The frame whose box has size 1.
    pub(crate) frame: UnitFrame,
    /// New number of each vertex of the input; [`NONE`] if no face uses it.
    pub(crate) rank: Vec<VertexId>,
    pub(crate) point_count: usize,
    /// Positions in the unit frame, by new number; may be taken.
    pub(crate) points: Vec<Vec3>,
    /// Faces in new numbers, sorted by their lowest one; may be taken.
    pub(crate) faces: Vec<[VertexId; 3]>,
    pub(crate) cleanup: Cleanup,
    /// Diagonal of the bounding box of the used vertices, in user units.
    pub(crate) diagonal: f64,
}

/// Converts a position to the unit frame, in single precision. Differences are computed in double precision,
/// so a part at map coordinates keeps all its detail.
#[inline]
pub(crate) fn single_unit(frame: &UnitFrame, p: [f64; 3]) -> Vec3 {
    frame.unit_from_user(p).as_vec3()
}

/// Applies [`single_unit`] to four points, as a flat list of coordinates.
#[inline(always)]
fn four_units<T: Copy>(frame: &UnitFrame, points: &[[T; 3]; 4]) -> [f32; 12]
where
    f64: From<T>,
{
    let [a, b, c, d] = points.map(|p| single_unit(frame, p.map(f64::from)));
    [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z, d.x, d.y, d.z]
}

/// Orders a surface. Faces with a non-finite corner, or two corners at one position, are removed and
/// counted. (Duplicate faces are found later, when the stars are walked.) Cost: O(V + F).
pub(crate) fn order(surface: &Surface<'_>) -> Ordered {
    let (positions, triangles) = (surface.positions(), surface.triangles());
    let mut cleanup = Cleanup::default();
    let mut needed = vec![false; positions.len()];
    for &t in triangles {
        for v in t {
            needed[v.index()] = true;
        }
    }
    let (min, max) = match positions {
        PositionsView::F32(p) => {
            let [min, max] = single_box(p, &mut needed);
            (min.map(f64::from), max.map(f64::from))
        }
        PositionsView::F64(p) => double_box(p, &mut needed),
    };
    cleanup.unused_vertices = needed.iter().filter(|n| !**n).count();
    let extent = [0, 1, 2].map(|k| (max[k] - min[k]).max(0.0));
    let size = extent.into_iter().fold(0f64, f64::max);
    // If the box has no extent (one point, or none), the scale of the input is kept.
    let size = if size > 0.0 && size.is_finite() { size } else { 1.0 };
    let centre = [0, 1, 2].map(|k| if min[k] <= max[k] { min[k] + 0.5 * (max[k] - min[k]) } else { 0.0 });
    let frame = UnitFrame::with_size(centre, size);
    let diagonal = size * extent.iter().map(|x| (x / size) * (x / size)).sum::<f64>().sqrt();

    let count = positions.len() - cleanup.unused_vertices;
    let keys = match positions {
        PositionsView::F32(p) => keys(p, &needed, count, &frame),
        PositionsView::F64(p) => keys(p, &needed, count, &frame),
    };
    drop(needed);
    let (keys, unsorted) = sorted(keys);
    let Numbers { rank, points, welded } = match positions {
        PositionsView::F32(p) => numbers(keys, unsorted, p, &frame),
        PositionsView::F64(p) => numbers(keys, unsorted, p, &frame),
    };
    cleanup.welded_vertices = welded;

    let left_out = |why| match why {
        Unfit::NonFinite => cleanup.non_finite_faces += 1,
        Unfit::Degenerate => cleanup.degenerate_faces += 1,
    };
    let faces =
        items_by_lowest_vertex(triangles, &rank, points.len(), |_, t| t.map(|v| rank[v.index()]), left_out);
    Ordered { frame, rank, point_count: points.len(), points, faces, cleanup, diagonal }
}

impl Ordered {
    /// True if a face of the input is used: its three positions are distinct.
    pub(crate) fn is_sound(&self, t: &[VertexId; 3]) -> bool {
        ranked(&self.rank, t).is_ok()
    }
    /// Returns a face of the input in new numbers, if it is used.
    #[inline(always)]
    pub(crate) fn face(&self, t: &[VertexId; 3]) -> Option<[VertexId; 3]> {
        ranked(&self.rank, t).ok()
    }
    /// Returns the first vertex of the surface at each position.
    pub(crate) fn first_vertices(&self) -> Vec<VertexId> {
        let mut first = vec![NONE; self.point_count];
        for (i, r) in self.rank.iter().enumerate().rev() {
            if *r != NONE {
                first[r.index()] = VertexId(i as u32);
            }
        }
        first
    }
    /// Computes the points again from the original surface.
    pub(crate) fn remake_points(&self, surface: &Surface<'_>) -> Vec<Vec3> {
        let mut points = vec![Vec3::ZERO; self.point_count];
        for (i, r) in self.rank.iter().enumerate() {
            if *r != NONE {
                points[r.index()] = single_unit(&self.frame, surface.positions().get(VertexId(i as u32)));
            }
        }
        points
    }
    /// Computes the faces again from the original surface.
    pub(crate) fn remake_faces(&self, surface: &Surface<'_>) -> Vec<[VertexId; 3]> {
        let face = |_, t: &[VertexId; 3]| t.map(|v| self.rank[v.index()]);
        items_by_lowest_vertex(surface.triangles(), &self.rank, self.point_count, face, |_| {})
    }
    /// Returns an item for each face, from its index in the original surface, in the order of the faces.
    pub(crate) fn of_faces<T: Zeroable>(&self, surface: &Surface<'_>, item: impl Fn(usize) -> T) -> Vec<T> {
        items_by_lowest_vertex(surface.triangles(), &self.rank, self.point_count, |i, _| item(i), |_| {})
    }
    /// Returns the wedges of the faces, in the order of the faces, from the original mesh.
    pub(crate) fn wedges(&self, surface: &Surface<'_>, mesh: &TriMesh) -> Vec<[WedgeId; 3]> {
        let wedges = mesh.triangles();
        self.of_faces(surface, |i| wedges[i])
    }
}

/// Returns the bounding box of the needed points; clears `needed` for non-finite ones.
fn single_box(points: &[[f32; 3]], needed: &mut [bool]) -> [[f32; 3]; 2] {
    let (mut min, mut max) = (f32x4::splat(f32::INFINITY), f32x4::splat(f32::NEG_INFINITY));
    for (&[x, y, z], needed) in points.iter().zip(needed).filter(|x| *x.1) {
        let p = f32x4::new([x, y, z, 0.0]);
        if p.abs().simd_le(f32x4::splat(f32::MAX)).all() {
            (min, max) = (min.fast_min(p), max.fast_max(p));
        } else {
            *needed = false;
        }
    }
    [min, max].map(|corner| {
        let [x, y, z, _] = corner.to_array();
        [x, y, z]
    })
}

/// Returns the bounding box of the needed points in double precision; clears `needed` for non-finite ones.
fn double_box(points: &[[f64; 3]], needed: &mut [bool]) -> ([f64; 3], [f64; 3]) {
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (p, needed) in points.iter().zip(needed).filter(|x| *x.1) {
        *needed = p.iter().all(|x| x.is_finite());
        if *needed {
            for k in 0..3 {
                (min[k], max[k]) = (min[k].min(p[k]), max[k].max(p[k]));
            }
        }
    }
    (min, max)
}

/// Reason to leave out a face.
enum Unfit {
    NonFinite,
    Degenerate,
}

#[inline(always)]
fn ranked(rank: &[VertexId], t: &[VertexId; 3]) -> Result<[VertexId; 3], Unfit> {
    let r = t.map(|v| rank[v.index()]);
    let is_twice = r[0] == r[1] || r[1] == r[2] || r[2] == r[0];
    // (If one of them is `NONE`, so is the union of all bits, which is faster to test.)
    if !is_twice && r[0].0 | r[1].0 | r[2].0 != NONE.0 {
        return Ok(r);
    }
    match () {
        () if r.contains(&NONE) => Err(Unfit::NonFinite),
        () if is_twice => Err(Unfit::Degenerate),
        () => Ok(r),
    }
}

/// Returns an item for each sound face, from its index and its vertices, in the order of the faces' lowest
/// vertices. Calls `left_out` with the reason for each of the others.
#[inline(never)]
fn items_by_lowest_vertex<T: Zeroable>(
    triangles: &[[VertexId; 3]],
    rank: &[VertexId],
    points: usize,
    item: impl Fn(usize, &[VertexId; 3]) -> T,
    mut left_out: impl FnMut(Unfit),
) -> Vec<T> {
    let mut at = vec![0u32; points];
    let least = |t| ranked(rank, t).map(|r| r[0].min(r[1]).min(r[2]));
    // Computing the numbers again takes as long as the rest, but saves memory.
    let is_kept = triangles.len() <= TIME_OVER_MEMORY_MAX_FACES;
    let mut kept = Vec::with_capacity(if is_kept { triangles.len() } else { 0 });
    for t in triangles {
        let least = match least(t) {
            Ok(least) => {
                at[least.index()] += 1;
                least
            }
            Err(why) => {
                left_out(why);
                NONE
            }
        };
        if is_kept {
            kept.push(least);
        }
    }
    let mut out: Vec<T> = zeroed_vec(to_offsets(&mut at) as usize);
    for (i, t) in triangles.iter().enumerate() {
        let least = if is_kept { kept[i] } else { least(t).unwrap_or(NONE) };
        if least != NONE {
            let slot = &mut at[least.index()];
            out[*slot as usize] = item(i, t);
            *slot += 1;
        }
    }
    out
}

/// Replaces counts by offsets (exclusive prefix sum). Returns the sum.
fn to_offsets(counts: &mut [u32]) -> u32 {
    let mut sum = 0;
    for count in counts {
        sum += std::mem::replace(count, sum);
    }
    sum
}

/// Returns sort keys of the needed points: the Morton code in the upper half, the number in the lower.
#[inline(never)]
fn keys<T: Copy>(points: &[[T; 3]], needed: &[bool], count: usize, frame: &UnitFrame) -> Vec<u64>
where
    f64: From<T>,
{
    let mut keys = Vec::with_capacity(count);
    let (fours, rest) = points.as_chunks::<4>();
    let (fours_needed, rest_needed) = needed.as_chunks::<4>();
    let mut first = 0;
    let key = |code: u32, i: u32| u64::from(code) << 32 | u64::from(i);
    for (four, needed) in fours.iter().zip(fours_needed) {
        let codes = morton(&four_units(frame, four));
        let four = [0, 1, 2, 3].map(|i| key(codes[i as usize], first + i));
        if *needed == [true; 4] {
            keys.extend_from_slice(&four);
        } else {
            keys.extend(four.into_iter().zip(needed).filter(|x| *x.1).map(|x| x.0));
        }
        first += 4;
    }
    for ((p, needed), i) in rest.iter().zip(rest_needed).zip(first..) {
        if *needed {
            let [code, ..] = morton(&four_units(frame, &[*p; 4]));
            keys.push(key(code, i));
        }
    }
    keys
}

/// Sorts keys by their codes, except for some of the codes' lowest bits; returns the number of unsorted bits.
#[inline(never)]
fn sorted(mut keys: Vec<u64>) -> (Vec<u64>, u32) {
    // All digits are counted in one pass.
    let mut counts = [[0u32; DIGITS]; 3];
    let digit = |key: u64, pass: usize| (key >> (32 + DIGIT_BITS * pass as u32)) as usize % DIGITS;
    let first = if keys.len() < THREE_DIGIT_MIN_VERTICES { 1 } else { 0 };
    for &key in &keys {
        for pass in first..3 {
            counts[pass][digit(key, pass)] += 1;
        }
    }
    let mut spare = vec![0; keys.len()];
    for pass in first..3 {
        let at = &mut counts[pass];
        to_offsets(at);
        for &key in &keys {
            let slot = &mut at[digit(key, pass)];
            spare[*slot as usize] = key;
            *slot += 1;
        }
        std::mem::swap(&mut keys, &mut spare);
    }
    (keys, DIGIT_BITS * first as u32)
}

/// New numbers of the vertices, and the points by new number.
struct Numbers {
    rank: Vec<VertexId>,
    points: Vec<Vec3>,
    /// Number of vertices merged with another at the same position.
    welded: usize,
}

impl Numbers {
    #[inline(always)]
    fn add<T: Copy>(&mut self, key: u64, places: &[[T; 3]], frame: &UnitFrame)
    where
        f64: From<T>,
    {
        let v = vertex(key);
        self.rank[v.index()] = VertexId(self.points.len() as u32);
        self.points.push(single_unit(frame, places[v.index()].map(f64::from)));
    }
}

#[inline(always)]
fn vertex(key: u64) -> VertexId {
    VertexId(key as u32)
}

/// Numbers vertices in the order of their keys, whose codes have `unsorted` unsorted lowest bits; vertices
/// at one position get the same number.
#[inline(never)]
fn numbers<T: Copy + PartialOrd>(
    mut keys: Vec<u64>,
    unsorted: u32,
    places: &[[T; 3]],
    frame: &UnitFrame,
) -> Numbers
where
    f64: From<T>,
{
    let (rank, points) = (vec![NONE; places.len()], Vec::with_capacity(keys.len()));
    let mut all = Numbers { rank, points, welded: 0 };
    let cell = |key: u64| key >> (32 + unsorted);
    let mut start = 0;
    while let Some(&first) = keys.get(start) {
        let is_like = |x: &&u64| cell(**x) == cell(first);
        if keys.get(start + 1).filter(is_like).is_none() {
            all.add(first, places, frame);
            start += 1;
            continue;
        }
        let count = keys[start..].iter().take_while(is_like).count();
        let run = &mut keys[start..start + count];
        start += count;
        if unsorted > 0 {
            run.sort_unstable();
        }
        for run in run.chunk_by_mut(|a, b| a >> 32 == b >> 32) {
            add_cell(run, places, frame, &mut all);
        }
    }
    all
}

/// Numbers the vertices of one cell.
fn add_cell<T: Copy + PartialOrd>(run: &mut [u64], places: &[[T; 3]], frame: &UnitFrame, all: &mut Numbers)
where
    f64: From<T>,
{
    let is_many = run.len() > CELL_SORT_MIN_VERTICES;
    if is_many {
        run.sort_unstable_by(|a, b| {
            let (p, q) = (places[vertex(*a).index()], places[vertex(*b).index()]);
            let by = |k: usize| p[k].partial_cmp(&q[k]).unwrap_or(std::cmp::Ordering::Equal);
            by(0).then(by(1)).then(by(2)).then(a.cmp(b))
        });
    }
    for k in 0..run.len() {
        let v = vertex(run[k]).index();
        let earlier = if is_many { &run[k.saturating_sub(1)..k] } else { &run[..k] };
        if let Some(&twin) = earlier.iter().find(|x| places[vertex(**x).index()] == places[v]) {
            all.rank[v] = all.rank[vertex(twin).index()];
            all.welded += 1;
        } else {
            all.add(run[k], places, frame);
        }
    }
}

/// Returns the codes of four points in the unit frame on a Morton curve of 1024³ cells: ten bits of each
/// coordinate, interleaved. (It processes the coordinates in the order in which they are stored.)
#[inline(always)]
fn morton(points: &[f32; 12]) -> [u32; 4] {
    let spread = |k: usize| {
        let four: [f32; 4] = std::array::from_fn(|i| points[4 * k + i]);
        let cell = (f32x4::new(four) + 0.5) * 1023.0;
        let cell = cell.fast_max(f32x4::ZERO).fast_min(f32x4::splat(1023.0)).fast_trunc_int();
        let x: u32x4 = bytemuck::cast(cell);
        let x = (x | x << 16u32) & u32x4::splat(0x0300_00ff);
        let x = (x | x << 8u32) & u32x4::splat(0x0300_f00f);
        let x = (x | x << 4u32) & u32x4::splat(0x030c_30c3);
        (x | x << 2u32) & u32x4::splat(0x0924_9249)
    };
    let x: [[u32; 3]; 4] = bytemuck::cast([0, 1, 2].map(spread));
    x.map(|[x, y, z]| x | y << 1 | z << 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(points: &[[f32; 3]], faces: &[[u32; 3]]) -> Ordered {
        let s = Surface::new(PositionsView::F32(points), bytemuck::cast_slice(faces)).unwrap();
        order(&s)
    }

    #[test]
    fn cells_have_the_expected_codes() {
        let at = |x: f32, y: f32, z: f32| morton(&[0.0, 0.0, 0.0, x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])[1];
        assert_eq!([at(-0.5, -0.5, -0.5), at(0.5, 0.5, 0.5)], [0, (1 << 30) - 1], "the corners of the box");
        let step = |k: f32| k / 1023.0 - 0.4995;
        assert_eq!(
            [at(step(1.0), -0.5, -0.5), at(-0.5, step(2.0), -0.5)],
            [0b1, 0b10_000],
            "x first, then y"
        );
        assert_eq!(
            [at(-9.0, -0.5, step(1.0)), at(9.0, -0.5, -0.5)],
            [0b100, 0x0924_9249],
            "points outside the box"
        );
    }

    #[test]
    fn points_are_ordered_along_the_curve() {
        // Sorted by two digits and by three; both points of a pair share a cell, and points near a corner
        // share the first two digits.
        for count in [600, THREE_DIGIT_MIN_VERTICES as u32 + 10] {
            let random = |i: u32, k: u32| (i / 2 * 3 + k).wrapping_mul(0x9e37_79b9).rotate_left(13);
            let unit = |x: u32| (x >> 8) as f32 / (1 << 24) as f32 * if x & 1 == 0 { 1.0 } else { 0.004 };
            let p: Vec<[f32; 3]> =
                (0..count).map(|i| [0, 1, 2].map(|k| unit(random(i, k)) + (i % 2) as f32 * 1e-5)).collect();
            let faces: Vec<[u32; 3]> = (0..count - 2).map(|i| [i, i + 1, i + 2]).collect();
            let o = surface(&p, &faces);
            let code = |p: &Vec3| morton(&std::array::from_fn(|i| p[i % 3]))[0];
            let codes: Vec<u32> = o.points.iter().map(code).collect();
            assert!(codes.is_sorted());
            let ties = codes.windows(2).filter(|w| w[0] == w[1]).count();
            assert!(ties > count as usize / 10, "{ties} of {count}");
            for (a, b) in (0..count as usize).step_by(2).map(|i| (i, i + 1)) {
                let (a, b) = (o.rank[a], o.rank[b]);
                assert!(
                    codes[a.index()] != codes[b.index()] || a < b,
                    "within a cell, points are in the order of their numbers"
                );
            }
        }
    }

    #[test]
    fn equal_positions_become_one_vertex() {
        // Two triangles side by side, as a soup: 6 corners, 4 positions. Minus zero equals zero.
        let p = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, -0.0, 0.0],
            [1.0, 1.0, 0.0],
            [-0.0, 1.0, 0.0],
        ];
        let o = surface(&p, &[[0, 1, 2], [3, 4, 5]]);
        assert_eq!((o.points.len(), o.faces.len(), o.cleanup.welded_vertices), (4, 2, 2));
        assert_eq!((o.rank[1], o.rank[2]), (o.rank[3], o.rank[5]));
    }

    #[test]
    fn many_vertices_in_one_cell_are_welded_too() {
        // A far outlier puts all others into one cell.
        let mut p: Vec<[f32; 3]> =
            (0..300).map(|i| [(i % 100) as f32 * 1e-6, 0.0, (i % 3) as f32 * 1e-6]).collect();
        p.push([1e6, 1e6, 1e6]);
        let faces: Vec<[u32; 3]> = (0..299).map(|i| [i, i + 1, 300]).collect();
        let places: std::collections::BTreeSet<_> = p.iter().map(|q| q.map(f32::to_bits)).collect();
        assert_eq!(surface(&p, &faces).points.len(), places.len());
    }

    #[test]
    fn broken_faces_and_unused_vertices_are_counted() {
        let p = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN, 0.0, 0.0], [9.0, 9.0, 9.0]];
        let o = surface(&p, &[[0, 1, 2], [0, 1, 3], [0, 1, 1]]);
        assert_eq!((o.faces.len(), o.cleanup.non_finite_faces, o.cleanup.degenerate_faces), (1, 1, 1));
        assert_eq!(o.cleanup.unused_vertices, 2, "the stray vertex and the NaN vertex");
        assert!((o.diagonal - 2f64.sqrt()).abs() < 1e-12, "a vertex without faces does not count");
    }

    #[test]
    fn map_coordinates_keep_their_detail() {
        let p = [
            [500_000.0, 4_000_000.0, 100.0],
            [500_001.0, 4_000_000.0, 100.0],
            [500_000.0, 4_000_001.0, 100.001],
        ];
        let s = Surface::new(PositionsView::F64(&p), bytemuck::cast_slice(&[[0u32, 1, 2]])).unwrap();
        let o = order(&s);
        for (i, q) in p.iter().enumerate() {
            let back = o.frame.user_from_unit(o.points[o.rank[i].index()].as_dvec3());
            assert!((0..3).all(|k| (back[k] - q[k]).abs() < 1e-6));
        }
    }
}
