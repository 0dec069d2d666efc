//! The ordered input: welded, cleaned, in a unit frame, vertices along a Morton curve, triangles by first
//! vertex.
//!
//! All later steps are local in memory, whatever order the file had. Equal positions have equal codes, so
//! the weld costs nothing beyond the sort. Each step works on pieces of its input, several at a time if there
//! are threads; the result depends on neither.

mod buckets;

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use bytemuck::Zeroable;
use bytemuck::allocation::zeroed_vec;
use glam::Vec3;
use lodsmith_core::geometry::UnitFrame;
use lodsmith_core::{PositionsView, Surface, TriMesh, VertexId, WedgeId};
use wide::{f32x4, u32x4};

use crate::chunks;
use crate::report::Cleanup;
use buckets::{Buckets, to_offsets};

/// Marks the absence of a vertex.
pub(crate) const NONE: VertexId = VertexId(u32::MAX);
/// Codes are sorted by three digits of this many bits.
const DIGIT_BITS: u32 = 10;
const DIGITS: usize = 1 << DIGIT_BITS;
/// Number of vertices from which the lowest digit is sorted too. With fewer vertices, hardly any agree in the
/// other two digits.
const THREE_DIGIT_MIN_VERTICES: usize = 1 << 14;
/// Pieces for each thread: some take longer than others.
const PIECES_PER_THREAD: usize = 4;
/// Number of vertices whose faces are sorted together. (Their counts and faces fit into the second cache.)
const VERTICES_PER_BUCKET: usize = 1 << 12;
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
    let mut needed = used(triangles, positions.len());
    let [min, max] = match positions {
        PositionsView::F32(p) => box_of(p, &mut needed, single_box).map(|corner| corner.map(f64::from)),
        PositionsView::F64(p) => box_of(p, &mut needed, double_box),
    };
    cleanup.unused_vertices = needed.iter().filter(|n| !**n).count();
    let extent = [0, 1, 2].map(|k| (max[k] - min[k]).max(0.0));
    let size = extent.into_iter().fold(0f64, f64::max);
    // If the box has no extent (one point, or none), the scale of the input is kept.
    let size = if size > 0.0 && size.is_finite() { size } else { 1.0 };
    let centre = [0, 1, 2].map(|k| if min[k] <= max[k] { min[k] + 0.5 * (max[k] - min[k]) } else { 0.0 });
    let frame = UnitFrame::with_size(centre, size);
    let diagonal = size * extent.iter().map(|x| (x / size) * (x / size)).sum::<f64>().sqrt();

    let keys = match positions {
        PositionsView::F32(p) => keys(p, &needed, &frame),
        PositionsView::F64(p) => keys(p, &needed, &frame),
    };
    drop(needed);
    let (keys, unsorted) = sorted(keys);
    let Numbers { rank, points, welded } = match positions {
        PositionsView::F32(p) => numbers(keys, unsorted, p, &frame),
        PositionsView::F64(p) => numbers(keys, unsorted, p, &frame),
    };
    cleanup.welded_vertices = welded;

    let (faces, left_out) = items_by_lowest_vertex(triangles, &rank, points.len(), |_, t| t);
    (cleanup.non_finite_faces, cleanup.degenerate_faces) = (left_out.non_finite, left_out.degenerate);
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
        items_by_lowest_vertex(surface.triangles(), &self.rank, self.point_count, |_, t| t).0
    }
    /// Returns an item for each face, from its index in the original surface, in the order of the faces.
    pub(crate) fn of_faces<T: Copy + Zeroable + Send + Sync>(
        &self,
        surface: &Surface<'_>,
        item: impl Fn(usize) -> T + Sync,
    ) -> Vec<T> {
        items_by_lowest_vertex(surface.triangles(), &self.rank, self.point_count, |i, _| item(i)).0
    }
    /// Returns the wedges of the faces, in the order of the faces, from the original mesh.
    pub(crate) fn wedges(&self, surface: &Surface<'_>, mesh: &TriMesh) -> Vec<[WedgeId; 3]> {
        let wedges = mesh.triangles();
        self.of_faces(surface, |i| wedges[i])
    }
}

/// Returns the length of pieces of a list for all threads: one piece for one thread. A multiple of four.
fn piece_length(count: usize) -> usize {
    match chunks::threads(count) {
        1 => count.max(1),
        threads => count.div_ceil(PIECES_PER_THREAD * threads).next_multiple_of(4),
    }
}

/// Returns which vertices the faces use.
fn used(triangles: &[[VertexId; 3]], vertices: usize) -> Vec<bool> {
    let used: Vec<AtomicBool> = (0..vertices).map(|_| AtomicBool::new(false)).collect();
    chunks::map(triangles.len(), |range| {
        for v in triangles[range].as_flattened() {
            // (A write would take the cache line from other threads.)
            if !used[v.index()].load(Relaxed) {
                used[v.index()].store(true, Relaxed);
            }
        }
    });
    used.into_iter().map(AtomicBool::into_inner).collect()
}

/// Returns the bounding box of the needed points, from the boxes of pieces.
fn box_of<P: Sync, T: Copy + PartialOrd + Send>(
    points: &[P],
    needed: &mut [bool],
    of_piece: impl Fn(&[P], &mut [bool]) -> [[T; 3]; 2] + Sync,
) -> [[T; 3]; 2] {
    let length = piece_length(points.len());
    let boxes =
        chunks::shared(needed, length, |k, needed| of_piece(&points[k * length..][..needed.len()], needed));
    let both = |[min, max]: [[T; 3]; 2], [low, high]: [[T; 3]; 2]| {
        [
            [0, 1, 2].map(|k| if low[k] < min[k] { low[k] } else { min[k] }),
            [0, 1, 2].map(|k| if high[k] > max[k] { high[k] } else { max[k] }),
        ]
    };
    boxes.into_iter().reduce(both).unwrap_or_else(|| of_piece(&[], &mut []))
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
fn double_box(points: &[[f64; 3]], needed: &mut [bool]) -> [[f64; 3]; 2] {
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (p, needed) in points.iter().zip(needed).filter(|x| *x.1) {
        *needed = p.iter().all(|x| x.is_finite());
        if *needed {
            for k in 0..3 {
                (min[k], max[k]) = (min[k].min(p[k]), max[k].max(p[k]));
            }
        }
    }
    [min, max]
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

/// Numbers of faces that are left out.
#[derive(Clone, Copy, Default)]
struct LeftOut {
    non_finite: usize,
    degenerate: usize,
}

impl LeftOut {
    fn add(&mut self, why: &Unfit) {
        match why {
            Unfit::NonFinite => self.non_finite += 1,
            Unfit::Degenerate => self.degenerate += 1,
        }
    }
}

/// Returns an item for each sound face, from its index and its vertices in new numbers, in the order of the
/// faces' lowest vertices, and counts the others.
#[inline(never)]
fn items_by_lowest_vertex<T: Copy + Zeroable + Send + Sync>(
    triangles: &[[VertexId; 3]],
    rank: &[VertexId],
    points: usize,
    item: impl Fn(usize, [VertexId; 3]) -> T + Sync,
) -> (Vec<T>, LeftOut) {
    let length = piece_length(triangles.len());
    if !chunks::HAS_THREADS || length >= triangles.len() {
        return items_in_one_piece(triangles, rank, points, item);
    }
    // The lowest vertex of each sound face, and its item. (Made here: its vertices are read only once.)
    let piece = |k: usize| {
        let faces = k * length..((k + 1) * length).min(triangles.len());
        let (mut sound, mut left_out) = (Vec::with_capacity(faces.len()), LeftOut::default());
        for i in faces {
            match ranked(rank, &triangles[i]) {
                Ok(t) => sound.push((t[0].min(t[1]).min(t[2]).0, item(i, t))),
                Err(why) => left_out.add(&why),
            }
        }
        (sound, left_out)
    };
    let (pieces, left_out): (Vec<_>, Vec<_>) =
        chunks::each(triangles.len().div_ceil(length), piece).into_iter().unzip();
    let buckets = points.div_ceil(VERTICES_PER_BUCKET).max(1);
    let faces = Buckets::new(pieces, buckets, |&(lowest, _)| lowest as usize / VERTICES_PER_BUCKET);
    let items = faces.joined(|k, parts, place| {
        let first = k * VERTICES_PER_BUCKET;
        let mut at = vec![0u32; VERTICES_PER_BUCKET.min(points - first)];
        for part in parts {
            part.iter().for_each(|&(lowest, _)| at[lowest as usize - first] += 1);
        }
        to_offsets(&mut at);
        for part in parts {
            for &(lowest, item) in *part {
                let slot = &mut at[lowest as usize - first];
                place[*slot as usize] = item;
                *slot += 1;
            }
        }
    });
    let sum = |a: LeftOut, b: LeftOut| LeftOut {
        non_finite: a.non_finite + b.non_finite,
        degenerate: a.degenerate + b.degenerate,
    };
    (items, left_out.into_iter().fold(LeftOut::default(), sum))
}

/// Does the same on one thread. (In buckets a run over 5.2 million triangles takes 4 % longer: each item is copied twice.)
fn items_in_one_piece<T: Zeroable>(
    triangles: &[[VertexId; 3]],
    rank: &[VertexId],
    points: usize,
    item: impl Fn(usize, [VertexId; 3]) -> T,
) -> (Vec<T>, LeftOut) {
    let lowest = |t: [VertexId; 3]| t[0].min(t[1]).min(t[2]);
    let (mut at, mut left_out) = (vec![0u32; points], LeftOut::default());
    // Computing the numbers again takes as long as the rest, but saves memory.
    let is_kept = triangles.len() <= TIME_OVER_MEMORY_MAX_FACES;
    let mut kept = Vec::with_capacity(if is_kept { triangles.len() } else { 0 });
    for t in triangles {
        let lowest = ranked(rank, t).map(lowest);
        match &lowest {
            Ok(lowest) => at[lowest.index()] += 1,
            Err(why) => left_out.add(why),
        }
        if is_kept {
            kept.push(lowest.unwrap_or(NONE));
        }
    }
    let count = at.iter().map(|n| *n as usize).sum();
    to_offsets(&mut at);
    let mut items: Vec<T> = zeroed_vec(count);
    for (i, t) in triangles.iter().enumerate() {
        let face = t.map(|v| rank[v.index()]);
        let lowest = match kept.get(i) {
            Some(&known) => known,
            None => ranked(rank, t).map_or(NONE, lowest),
        };
        if lowest != NONE {
            let slot = &mut at[lowest.index()];
            items[*slot as usize] = item(i, face);
            *slot += 1;
        }
    }
    (items, left_out)
}

/// Returns sort keys of the needed points in pieces: the Morton code in the upper half, the number in the lower.
fn keys<T: Copy + Sync>(points: &[[T; 3]], needed: &[bool], frame: &UnitFrame) -> Vec<Vec<u64>>
where
    f64: From<T>,
{
    let length = piece_length(points.len());
    chunks::each(points.len().div_ceil(length), |k| {
        let range = k * length..((k + 1) * length).min(points.len());
        keys_of_piece(&points[range.clone()], &needed[range.clone()], range.start as u32, frame)
    })
}

/// Returns the keys of points with numbers from `first` on.
#[inline(never)]
fn keys_of_piece<T: Copy>(points: &[[T; 3]], needed: &[bool], mut first: u32, frame: &UnitFrame) -> Vec<u64>
where
    f64: From<T>,
{
    let mut keys = Vec::with_capacity(points.len());
    let (fours, rest) = points.as_chunks::<4>();
    let (fours_needed, rest_needed) = needed.as_chunks::<4>();
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

/// Returns one of the three digits of a code, the lowest first.
#[inline(always)]
fn digit(key: u64, of: usize) -> usize {
    (key >> (32 + DIGIT_BITS * of as u32)) as usize % DIGITS
}

/// Sorts keys by their codes, except for some of the codes' lowest bits; returns the number of unsorted bits.
fn sorted(mut pieces: Vec<Vec<u64>>) -> (Vec<u64>, u32) {
    let is_short = pieces.iter().map(Vec::len).sum::<usize>() < THREE_DIGIT_MIN_VERTICES;
    if !chunks::HAS_THREADS || is_short {
        let mut keys = if pieces.len() == 1 { pieces.remove(0) } else { pieces.concat() };
        if !is_short {
            sort_by_digits(&mut keys, &[0]);
        }
        sort_by_digits(&mut keys, &[1, 2]);
        return (keys, if is_short { DIGIT_BITS } else { 0 });
    }
    let buckets = Buckets::new(pieces, DIGITS, |&key| digit(key, 2));
    let keys = buckets.joined(|_, parts, place: &mut [u64]| {
        let mut rest = &mut *place;
        for part in parts {
            let (next, after) = rest.split_at_mut(part.len());
            next.copy_from_slice(part);
            rest = after;
        }
        if place.len() < DIGITS / 2 {
            // (Keys of one cell differ in the number of the point.)
            place.sort_unstable();
        } else {
            sort_by_digits(place, &[0, 1]);
        }
    });
    (keys, 0)
}

/// Sorts keys by one or two digits of their codes, of which the last counts most.
#[inline(never)]
fn sort_by_digits(keys: &mut [u64], digits: &[usize]) {
    let mut counts = [[0u32; DIGITS]; 2];
    for &key in &*keys {
        for (counts, of) in counts.iter_mut().zip(digits) {
            counts[digit(key, *of)] += 1;
        }
    }
    let mut spare = vec![0; keys.len()];
    let mut is_spare = false;
    for (at, of) in counts.iter_mut().zip(digits) {
        let (from, to) = if is_spare { (&spare[..], &mut *keys) } else { (&*keys, &mut spare[..]) };
        to_offsets(at);
        for &key in from {
            let slot = &mut at[digit(key, *of)];
            to[*slot as usize] = key;
            *slot += 1;
        }
        is_spare = !is_spare;
    }
    if is_spare {
        keys.copy_from_slice(&spare);
    }
}

/// New numbers of the vertices, and the points by new number.
struct Numbers {
    rank: Vec<VertexId>,
    points: Vec<Vec3>,
    /// Number of vertices merged with another at the same position.
    welded: usize,
}

/// The vertices of some cells.
struct Numbered {
    /// Number of the vertex of each key, counted from the first of these cells.
    numbers: Vec<u32>,
    points: Vec<Vec3>,
    welded: usize,
}

#[inline(always)]
fn vertex(key: u64) -> VertexId {
    VertexId(key as u32)
}

/// Numbers vertices in the order of their keys, whose codes have `unsorted` unsorted lowest bits; vertices
/// at one position get the same number.
fn numbers<T: Copy + PartialOrd + Sync>(
    mut keys: Vec<u64>,
    unsorted: u32,
    places: &[[T; 3]],
    frame: &UnitFrame,
) -> Numbers
where
    f64: From<T>,
{
    let lengths = lengths_of_cells(&keys, unsorted);
    let pieces = chunks::cut(&mut keys, lengths.into_iter());
    let mut pieces = chunks::over(pieces, |_, keys| {
        let numbered = number_cells(keys, unsorted, places, frame);
        (keys, numbered)
    });
    let mut count = 0;
    let mut firsts = Vec::with_capacity(pieces.len());
    for (_, piece) in &pieces {
        firsts.push(count);
        count += piece.points.len() as u32;
    }
    let rank: Vec<AtomicU32> = (0..places.len()).map(|_| AtomicU32::new(NONE.0)).collect();
    chunks::each(pieces.len(), |k| {
        let (keys, piece) = &pieces[k];
        for (key, number) in keys.iter().zip(&piece.numbers) {
            rank[vertex(*key).index()].store(firsts[k] + number, Relaxed);
        }
    });
    let rank = rank.into_iter().map(|r| VertexId(r.into_inner())).collect();
    let welded = pieces.iter().map(|(_, piece)| piece.welded).sum();
    let points = match &mut pieces[..] {
        [(_, piece)] => std::mem::take(&mut piece.points),
        pieces => pieces.iter().map(|(_, piece)| &piece.points[..]).collect::<Vec<_>>().concat(),
    };
    Numbers { rank, points, welded }
}

/// Returns the lengths of pieces of the keys that end with a cell.
fn lengths_of_cells(keys: &[u64], unsorted: u32) -> Vec<usize> {
    let cell = |key: u64| key >> (32 + unsorted);
    let length = piece_length(keys.len());
    let (mut lengths, mut start) = (Vec::new(), 0);
    while start < keys.len() {
        let mut end = (start + length).min(keys.len());
        while end < keys.len() && cell(keys[end]) == cell(keys[end - 1]) {
            end += 1;
        }
        lengths.push(end - start);
        start = end;
    }
    lengths
}

/// Numbers the vertices of whole cells.
#[inline(never)]
fn number_cells<T: Copy + PartialOrd>(
    keys: &mut [u64],
    unsorted: u32,
    places: &[[T; 3]],
    frame: &UnitFrame,
) -> Numbered
where
    f64: From<T>,
{
    let (numbers, points) = (Vec::with_capacity(keys.len()), Vec::with_capacity(keys.len()));
    let mut all = Numbered { numbers, points, welded: 0 };
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
            all.add_cell(run, places, frame);
        }
    }
    all
}

impl Numbered {
    #[inline(always)]
    fn add<T: Copy>(&mut self, key: u64, places: &[[T; 3]], frame: &UnitFrame)
    where
        f64: From<T>,
    {
        self.numbers.push(self.points.len() as u32);
        self.points.push(single_unit(frame, places[vertex(key).index()].map(f64::from)));
    }

    /// Numbers the vertices of one cell.
    fn add_cell<T: Copy + PartialOrd>(&mut self, run: &mut [u64], places: &[[T; 3]], frame: &UnitFrame)
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
        let first = self.numbers.len();
        for k in 0..run.len() {
            let here = places[vertex(run[k]).index()];
            let from = if is_many { k.saturating_sub(1) } else { 0 };
            let twin = (from..k).find(|&i| places[vertex(run[i]).index()] == here);
            if let Some(twin) = twin {
                self.numbers.push(self.numbers[first + twin]);
                self.welded += 1;
            } else {
                self.add(run[k], places, frame);
            }
        }
    }
}

/// Number of bits of the code of a point.
pub(super) const MORTON_BITS: u32 = 30;

/// Returns the code of a point between -.5 and .5, as [`morton`] does.
pub(super) fn morton_code(p: Vec3) -> u32 {
    let [x, y, z] = p.to_array();
    morton(&[x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])[0]
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

    /// A large mesh in no order: equal positions, points that are not finite or unused, and faces to leave out.
    fn shuffled() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let random = |i: u32| i.wrapping_mul(0x9e37_79b9).rotate_left(13).wrapping_mul(0x85eb_ca6b);
        let unit = |x: u32| (x >> 8) as f32 / (1 << 24) as f32;
        let count = 4 * VERTICES_PER_BUCKET as u32 + 77;
        let point = |i: u32| match i % 500 {
            0 => [f32::NAN, 0.0, 0.0],
            _ => [0, 1, 2].map(|k| unit(random(3 * (i % (count / 2 + 1)) + k))),
        };
        // (No face uses the last points.)
        let face = |i: u32| [0, 1, 2].map(|k| random(7 * i + k) % (count - 20));
        ((0..count).map(point).collect(), (0..2 * count).map(face).collect())
    }

    #[test]
    fn large_meshes_are_ordered_in_pieces_as_by_plain_sorts() {
        let (points, faces) = shuffled();
        let o = surface(&points, &faces);
        let mut used = vec![false; points.len()];
        faces.iter().flatten().for_each(|&v| used[v as usize] = true);
        let is_good = |i: &usize| used[*i] && points[*i].iter().all(|x| x.is_finite());
        assert_eq!(o.cleanup.unused_vertices, (0..points.len()).filter(|i| !is_good(i)).count());

        // Vertices by code, then by number; the first of equal ones stands for all.
        let code = |i: usize| {
            morton(&std::array::from_fn(|k| single_unit(&o.frame, points[i].map(f64::from))[k % 3]))[0]
        };
        let mut numbers: Vec<usize> = (0..points.len()).filter(is_good).collect();
        numbers.sort_by_key(|&i| (code(i), i));
        let mut seen = std::collections::HashMap::new();
        let mut rank = vec![NONE; points.len()];
        for i in numbers {
            let next = VertexId::new(seen.len());
            rank[i] = *seen.entry(points[i].map(|x| (x + 0.0).to_bits())).or_insert(next);
        }
        assert!(rank == o.rank && seen.len() == o.points.len());
        assert_eq!(o.points.len() + o.cleanup.welded_vertices, rank.iter().filter(|r| **r != NONE).count());

        // Faces by lowest vertex, then by number.
        let mut sound: Vec<[VertexId; 3]> = faces.iter().map(|t| t.map(|v| rank[v as usize])).collect();
        let bad = sound.iter().filter(|t| t.contains(&NONE)).count();
        sound.retain(|t| !t.contains(&NONE) && t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
        sound.sort_by_key(|t| t.iter().min().copied());
        assert!(sound == o.faces);
        assert_eq!(o.cleanup.non_finite_faces, bad);
        assert_eq!(o.cleanup.degenerate_faces, faces.len() - bad - sound.len());
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
