//! Progressive meshes: a simplification that can be undone and redone step by step.
//!
//! Every contraction of a run is recorded with the data that it changed (`collapse/record`). The contractions
//! are then put in an order in which each level is a good mesh (`arrange`), and can be undone to the bit. The
//! result of the engine's fit at some levels is kept in checkpoints next to the splits (`checkpoints`).
//! (docs/progressive.md, docs/decisions/0018)

mod arrange;
mod build;
mod checkpoints;
mod deviation;
mod extract;
mod fit_levels;
mod scene;
mod values;

use std::mem::replace;
use std::ops::Range;
use std::sync::Arc;

use lodsmith_core::splits::{Changes, Counts, Layout};
use lodsmith_core::{MeshError, Positions, PositionsView, RegionId, Splits, TriMesh, VertexId, WedgeId};

use crate::attributes::ranges::{UNLIMITED_RANGE, has_ranges, ranges};
pub use scene::ProgressiveScene;

/// Elements in a block of the change tracking.
const CHANGE_BLOCK_LEN: usize = 256;

/// A progressive mesh: a base mesh (level 0) and vertex splits, each of which leads to the next level, up to
/// the full mesh.
///
/// A level depends only on its number, not on the levels visited before. Buffers keep their length and
/// numbering: at any level the live elements are the first [`Counts`] of them, and a vertex that no face uses
/// may be among them. Clones share the data that never changes, so many levels of one mesh can be held at
/// once.
///
/// ```
/// use lodsmith::core::shapes;
/// use lodsmith::{NoControl, Progressive, SimplifyOptions};
///
/// let mesh = shapes::icosphere(3);
/// let mut progressive = Progressive::build(&mesh, &SimplifyOptions::default(), &mut NoControl)?;
/// progressive.to_faces(100);
/// assert!(progressive.faces().len() <= 100);
/// let light = progressive.fitted_mesh()?;
/// progressive.to_level(progressive.top());
/// assert_eq!(progressive.mesh()?, mesh);
/// # assert!(light.face_count() <= 100);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Progressive {
    sequence: Arc<SplitSequence>,
    level: usize,
    faces: Vec<[WedgeId; 3]>,
    vertex_of: Option<Vec<VertexId>>,
    values: Vec<f32>,
    positions: Positions,
}

/// The constant data: the splits, and the values of each of their changes on the coarser side.
#[derive(Debug)]
struct SplitSequence {
    splits: Splits,
    corners: Vec<WedgeId>,
    owners: Vec<VertexId>,
    rows: Vec<f32>,
    places: Positions,
    /// Range of each value of a row, over the full mesh.
    ranges: Vec<[f32; 2]>,
    /// Number of vertices in use, for each level.
    vertices: Vec<u32>,
    /// Largest number of vertices in use at this and all coarser levels.
    most_vertices: Vec<u32>,
}

/// Ranges of the buffers that a change of level modified: ascending, disjoint, each a little larger than
/// necessary. Removed elements are not included, new ones are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ChangedRanges {
    /// Ranges of [`Progressive::faces`].
    pub faces: Vec<Range<usize>>,
    /// Ranges of [`Progressive::vertex_map`] and [`Progressive::values`].
    pub wedges: Vec<Range<usize>>,
    /// Ranges of [`Progressive::positions`].
    pub vertices: Vec<Range<usize>>,
}

/// Blocks of modified elements.
struct ChangedBlocks(Vec<bool>);

impl ChangedBlocks {
    fn new(count: usize) -> Self {
        Self(vec![false; count.div_ceil(CHANGE_BLOCK_LEN)])
    }
    #[inline(always)]
    fn add(&mut self, element: usize) {
        self.0[element / CHANGE_BLOCK_LEN] = true;
    }
    /// Returns the modified ranges below `count`, including all elements from `born` on.
    fn ranges(&self, born: usize, count: usize) -> Vec<Range<usize>> {
        let mut ranges: Vec<Range<usize>> = Vec::new();
        let blocks = self
            .0
            .iter()
            .enumerate()
            .filter(|b| *b.1)
            .map(|b| b.0 * CHANGE_BLOCK_LEN..(b.0 + 1) * CHANGE_BLOCK_LEN);
        for r in blocks.chain(std::iter::once(born..count)) {
            let (mut start, mut end) = (r.start.min(count), r.end.min(count));
            // New elements may start before the last modified blocks.
            while let Some(last) = ranges.pop_if(|last| start <= last.end) {
                (start, end) = (start.min(last.start), end.max(last.end));
            }
            if start < end {
                ranges.push(start..end);
            }
        }
        ranges
    }
}

impl Progressive {
    /// Makes a progressive mesh from splits, at the level of the full mesh. Cost: O(n).
    pub fn new(splits: Splits) -> Self {
        let (mut faces, mut vertex_of) = (splits.faces.clone(), splits.vertex_of.clone());
        let (mut values, mut positions) = (splits.values.clone(), splits.positions.clone());
        let (level, mut sequence) = (splits.len(), SplitSequence::new_unreplayed(splits));
        sequence.replay(&mut faces, &mut vertex_of, &mut values, &mut positions);
        Self { sequence: Arc::new(sequence), level, faces, vertex_of, values, positions }
    }

    /// Returns this progressive mesh with the given level as its base, at that level.
    pub fn without_below(mut self, level: usize) -> Self {
        self.to_level(level);
        let base = (!self.sequence.splits.checkpoints.is_empty()).then(|| self.checkpoint());
        let (level, faces, vertex_of) = (self.level, self.faces, self.vertex_of);
        let splits = Arc::try_unwrap(self.sequence)
            .map_or_else(|sequence| sequence.splits.clone(), |sequence| sequence.splits);
        // Elements that are not live yet are in the buffers already, with their first values.
        let mut data = splits.into_data();
        (data.faces, data.vertex_of, data.values, data.positions) =
            (faces, vertex_of, self.values, self.positions);
        data.counts.drain(..level);
        let width = data.layout.width();
        let corners = drop_first_splits(&mut data.corners, level);
        data.corners.to.drain(..corners);
        let owners = drop_first_splits(&mut data.owners, level);
        data.owners.to.drain(..owners);
        let rows = drop_first_splits(&mut data.rows, level);
        data.rows.to.drain(..rows * width);
        let places = drop_first_splits(&mut data.places, level);
        match &mut data.places.to {
            Positions::F32(p) => drop(p.drain(..places)),
            Positions::F64(p) => drop(p.drain(..places)),
        }
        data.checkpoints.retain(|c| c.level as usize > level);
        data.checkpoints.splice(0..0, base);
        data.checkpoints.iter_mut().for_each(|c| c.level -= level as u32);
        let mut coarsest = Self::new(Splits::new(data).expect("the splits after a level are valid"));
        coarsest.to_level(0);
        coarsest
    }

    /// Returns the splits, with base mesh and checkpoints.
    pub fn splits(&self) -> &Splits {
        &self.sequence.splits
    }
    /// Returns the splits, without a copy if there is no other clone.
    pub fn into_splits(self) -> Splits {
        Arc::try_unwrap(self.sequence)
            .map_or_else(|sequence| sequence.splits.clone(), |sequence| sequence.splits)
    }
    /// Returns the number of the finest level, which is the number of splits.
    pub fn top(&self) -> usize {
        self.sequence.splits.len()
    }
    /// Returns the number of levels: one more than the number of splits.
    pub fn levels(&self) -> usize {
        self.top() + 1
    }
    /// Returns the current level, which is the number of splits done.
    pub fn level(&self) -> usize {
        self.level
    }
    /// Returns the numbers of elements at the current level.
    pub fn counts(&self) -> Counts {
        self.sequence.splits.counts[self.level]
    }
    /// Returns the number of faces at the current level.
    pub fn face_count(&self) -> usize {
        self.counts().faces as usize
    }
    /// Returns the number of vertices at the current level that a face uses.
    pub fn vertex_count(&self) -> usize {
        self.sequence.vertices[self.level] as usize
    }

    /// Returns the live faces, three wedges each.
    pub fn faces(&self) -> &[[WedgeId; 3]] {
        &self.faces[..self.face_count()]
    }
    /// Returns the regions of the live faces; `None` if there is only one region.
    pub fn regions(&self) -> Option<&[RegionId]> {
        self.sequence.splits.regions.as_ref().map(|r| &r[..self.face_count()])
    }
    /// Returns the vertex of each wedge; `None` if wedge i belongs to vertex i.
    pub fn vertex_map(&self) -> Option<&[VertexId]> {
        self.vertex_of.as_ref().map(|map| &map[..self.counts().wedges as usize])
    }
    /// Returns the positions of the vertices, as recorded, without a fit.
    pub fn positions(&self) -> PositionsView<'_> {
        let count = self.counts().vertices as usize;
        match &self.positions {
            Positions::F32(p) => PositionsView::F32(&p[..count]),
            Positions::F64(p) => PositionsView::F64(&p[..count]),
        }
    }
    /// Returns a row of values for each wedge; [`Progressive::layout`] describes the rows.
    pub fn values(&self) -> &[f32] {
        &self.values[..self.counts().wedges as usize * self.layout().width()]
    }
    /// Returns the layout of a row of values.
    pub fn layout(&self) -> &Layout {
        &self.sequence.splits.layout
    }

    /// Returns the finest level with at most `n` faces, or the base.
    pub fn level_of_faces(&self, n: usize) -> usize {
        self.sequence.splits.counts.partition_point(|c| c.faces as usize <= n).saturating_sub(1)
    }
    /// Returns the finest level with at most `n` vertices in use, at this and all coarser levels, or the
    /// base.
    pub fn level_of_vertices(&self, n: usize) -> usize {
        self.sequence.most_vertices.partition_point(|&v| v as usize <= n).saturating_sub(1)
    }
    /// Returns the coarsest level whose estimated error is at most `distance`, or the full mesh.
    pub fn level_of_error(&self, distance: f64) -> usize {
        let (mut low, mut high) = (0, self.top());
        while low < high {
            let middle = low + (high - low) / 2;
            if self.error_at(middle) <= distance { high = middle } else { low = middle + 1 }
        }
        high
    }
    /// Goes to [the level](Self::level_of_faces) of a number of faces.
    pub fn to_faces(&mut self, n: usize) -> ChangedRanges {
        self.to_level(self.level_of_faces(n))
    }
    /// Goes to [the level](Self::level_of_vertices) of a number of vertices.
    pub fn to_vertices(&mut self, n: usize) -> ChangedRanges {
        self.to_level(self.level_of_vertices(n))
    }
    /// Goes to [the level](Self::level_of_error) of an estimated error.
    pub fn to_error(&mut self, distance: f64) -> ChangedRanges {
        self.to_level(self.level_of_error(distance))
    }
    /// Goes to a level, or to the full mesh if the number is larger.
    pub fn to_level(&mut self, level: usize) -> ChangedRanges {
        let level = level.min(self.top());
        if level >= self.level { self.refine(level - self.level) } else { self.coarsen(self.level - level) }
    }

    /// Does this many splits, or as many as there are. Cost: proportional to what they change.
    pub fn refine(&mut self, splits: usize) -> ChangedRanges {
        let before = self.counts();
        let to = self.level.saturating_add(splits).min(self.top());
        let sequence = Arc::clone(&self.sequence);
        let data = &sequence.splits;
        let range = self.level..to;
        let side = ChangeValues { corners: &data.corners.to, owners: &data.owners.to, rows: &data.rows.to };
        self.level = to;
        self.apply(&sequence, range, &side, &data.places.to, false, before)
    }

    /// Undoes this many splits, or as many as were done. Cost: proportional to what they change.
    pub fn coarsen(&mut self, splits: usize) -> ChangedRanges {
        let to = self.level.saturating_sub(splits);
        let sequence = Arc::clone(&self.sequence);
        let range = to..self.level;
        let side =
            ChangeValues { corners: &sequence.corners, owners: &sequence.owners, rows: &sequence.rows };
        self.level = to;
        let now = self.counts();
        self.apply(&sequence, range, &side, &sequence.places, true, now)
    }

    /// Applies the changes of a range of splits, with the values of one side. The last split determines the
    /// final value of an element, or the first one if they are undone.
    fn apply(
        &mut self,
        sequence: &SplitSequence,
        splits: Range<usize>,
        side: &ChangeValues<'_>,
        places: &Positions,
        back: bool,
        born: Counts,
    ) -> ChangedRanges {
        let data = &sequence.splits;
        let mut faces = ChangedBlocks::new(self.faces.len());
        let mut wedges = ChangedBlocks::new(self.wedge_slots());
        let mut vertices = ChangedBlocks::new(self.positions.len());
        // The changes of one kind are contiguous, whichever split they belong to, and kinds are independent
        // of each other.
        let of = |ends: &[u32]| ends[splits.start] as usize..ends[splits.end] as usize;
        each(of(&data.corners.ends), back, |i| {
            let at = data.corners.at[i] as usize;
            self.faces[at / 3][at % 3] = side.corners[i];
            faces.add(at / 3);
        });
        if let Some(map) = &mut self.vertex_of {
            each(of(&data.owners.ends), back, |i| {
                let at = data.owners.at[i].index();
                map[at] = side.owners[i];
                wedges.add(at);
            });
        }
        let width = data.layout.width();
        if width > 0 {
            each(of(&data.rows.ends), back, |i| {
                let at = data.rows.at[i].index();
                self.values[at * width..][..width].copy_from_slice(&side.rows[i * width..][..width]);
                wedges.add(at);
            });
        }
        match (&mut self.positions, places) {
            (Positions::F32(p), Positions::F32(to)) => each(of(&data.places.ends), back, |i| {
                let at = data.places.at[i].index();
                p[at] = to[i];
                vertices.add(at);
            }),
            (Positions::F64(p), Positions::F64(to)) => each(of(&data.places.ends), back, |i| {
                let at = data.places.at[i].index();
                p[at] = to[i];
                vertices.add(at);
            }),
            _ => unreachable!("splits with mixed precision are refused"),
        }
        let now = self.counts();
        ChangedRanges {
            faces: faces.ranges(born.faces as usize, now.faces as usize),
            wedges: wedges.ranges(born.wedges as usize, now.wedges as usize),
            vertices: vertices.ranges(born.vertices as usize, now.vertices as usize),
        }
    }

    fn wedge_slots(&self) -> usize {
        self.vertex_of.as_ref().map_or(self.positions.len(), Vec::len)
    }

    /// Returns the mesh of the current level as recorded, without a fit. The full level is the mesh that was
    /// recorded, bit for bit; other levels have no unused vertices, and keep the order of the recorded mesh
    /// where it is known.
    ///
    /// # Errors
    /// [`MeshError`] if splits read from a file do not describe a valid mesh.
    pub fn mesh(&self) -> Result<TriMesh, MeshError> {
        self.extract(&self.positions, &self.values)
    }
    /// Returns the mesh of the current level, with the fit of the checkpoints.
    ///
    /// # Errors
    /// Those of [`Progressive::mesh`].
    pub fn fitted_mesh(&self) -> Result<TriMesh, MeshError> {
        let mut positions = self.positions.clone();
        let mut values = self.values.clone();
        self.correct(&mut positions, &mut values);
        self.extract(&positions, &values)
    }
    /// Returns the positions with the fit of the checkpoints, as many as [`Progressive::positions`].
    pub fn fitted_positions(&self) -> Positions {
        let mut positions = match self.positions() {
            PositionsView::F32(p) => Positions::F32(p.to_vec()),
            PositionsView::F64(p) => Positions::F64(p.to_vec()),
        };
        self.correct(&mut positions, &mut []);
        positions
    }
    /// Returns the estimated distance (RMS) of the current level, with its fit, from the full mesh, in the
    /// units of the positions; it is never smaller for a coarser level. It is interpolated between
    /// checkpoints by the number of faces. Without checkpoints it is 0.
    pub fn error(&self) -> f64 {
        self.error_at(self.level)
    }
}

/// Returns the ranges of the values in a row, over these rows; values without a range have an unlimited one.
pub(super) fn value_ranges(layout: &Layout, rows: &[f32]) -> Vec<[f32; 2]> {
    let mut all = ranges(rows, layout.width());
    if layout.has_normals {
        all[..3].fill(UNLIMITED_RANGE);
    }
    let mut end = all.len();
    for (semantic, width) in layout.further.iter().rev() {
        if !has_ranges(semantic) {
            all[end - width..end].fill(UNLIMITED_RANGE);
        }
        end -= width;
    }
    all
}

/// Drops the changes of the first `splits` splits. Returns the number of dropped entries.
fn drop_first_splits<A, T>(changes: &mut Changes<A, T>, splits: usize) -> usize {
    let gone = changes.ends[splits];
    changes.ends.drain(..splits);
    changes.ends.iter_mut().for_each(|end| *end -= gone);
    changes.at.drain(..gone as usize);
    gone as usize
}

/// The values that changes lead to, in one direction.
struct ChangeValues<'a> {
    corners: &'a [WedgeId],
    owners: &'a [VertexId],
    rows: &'a [f32],
}

#[inline(always)]
fn each(range: Range<usize>, back: bool, mut what: impl FnMut(usize)) {
    if back { range.rev().for_each(&mut what) } else { range.for_each(&mut what) }
}

impl SplitSequence {
    fn new_unreplayed(splits: Splits) -> Self {
        let places = match &splits.positions {
            Positions::F32(_) => Positions::F32(Vec::new()),
            Positions::F64(_) => Positions::F64(Vec::new()),
        };
        let (corners, owners, rows) = (Vec::new(), Vec::new(), Vec::new());
        let (ranges, vertices, most_vertices) = (Vec::new(), Vec::new(), Vec::new());
        Self { splits, corners, owners, rows, places, ranges, vertices, most_vertices }
    }

    /// Goes from the base to the top, with buffers that are at the base, and records the value that each
    /// change replaces.
    fn replay(
        &mut self,
        faces: &mut [[WedgeId; 3]],
        map: &mut Option<Vec<VertexId>>,
        values: &mut [f32],
        positions: &mut Positions,
    ) {
        let data = &self.splits;
        let width = data.layout.width();
        for (i, w) in data.rows.at.iter().enumerate() {
            let row = &mut values[w.index() * width..][..width];
            self.rows.extend_from_slice(row);
            row.copy_from_slice(&data.rows.to[i * width..][..width]);
        }
        self.ranges = value_ranges(&data.layout, values);
        let places = &data.places;
        match (&mut *positions, &mut self.places, &places.to) {
            (Positions::F32(p), Positions::F32(from), Positions::F32(to)) => {
                from.extend(places.at.iter().zip(to).map(|(v, to)| replace(&mut p[v.index()], *to)));
            }
            (Positions::F64(p), Positions::F64(from), Positions::F64(to)) => {
                from.extend(places.at.iter().zip(to).map(|(v, to)| replace(&mut p[v.index()], *to)));
            }
            _ => unreachable!("splits with mixed precision are refused"),
        }
        let wedges = map.as_ref().map_or(positions.len(), Vec::len);
        let mut uses = UseCounts { of_wedge: vec![0; wedges], of_vertex: vec![0; positions.len()], live: 0 };
        let (mut born, mut largest) = (0, 0);
        for (level, c) in data.counts.iter().enumerate() {
            if let Some(split) = level.checked_sub(1) {
                if let Some(map) = map {
                    for i in data.owners.of(split) {
                        let (w, to) = (data.owners.at[i], data.owners.to[i]);
                        let from = replace(&mut map[w.index()], to);
                        uses.moved(w, from, to);
                        self.owners.push(from);
                    }
                }
                for i in data.corners.of(split) {
                    let at = data.corners.at[i] as usize;
                    let from = replace(&mut faces[at / 3][at % 3], data.corners.to[i]);
                    self.corners.push(from);
                    uses.add(data.corners.to[i], map);
                    uses.take(from, map);
                }
            }
            for t in &faces[born..c.faces as usize] {
                t.iter().for_each(|&w| uses.add(w, map));
            }
            born = c.faces as usize;
            largest = uses.live.max(largest);
            self.vertices.push(uses.live);
            self.most_vertices.push(largest);
        }
    }
}

/// Number of corners of each wedge, and number of wedges in use of each vertex.
struct UseCounts {
    of_wedge: Vec<u32>,
    of_vertex: Vec<u32>,
    live: u32,
}

impl UseCounts {
    #[inline(always)]
    fn add(&mut self, w: WedgeId, map: &Option<Vec<VertexId>>) {
        self.of_wedge[w.index()] += 1;
        if self.of_wedge[w.index()] == 1 {
            self.gain(owner(w, map));
        }
    }
    #[inline(always)]
    fn take(&mut self, w: WedgeId, map: &Option<Vec<VertexId>>) {
        self.of_wedge[w.index()] -= 1;
        if self.of_wedge[w.index()] == 0 {
            self.lose(owner(w, map));
        }
    }
    fn moved(&mut self, w: WedgeId, from: VertexId, to: VertexId) {
        if self.of_wedge[w.index()] > 0 {
            self.lose(from);
            self.gain(to);
        }
    }
    #[inline(always)]
    fn gain(&mut self, v: VertexId) {
        self.of_vertex[v.index()] += 1;
        self.live += u32::from(self.of_vertex[v.index()] == 1);
    }
    #[inline(always)]
    fn lose(&mut self, v: VertexId) {
        self.of_vertex[v.index()] -= 1;
        self.live -= u32::from(self.of_vertex[v.index()] == 0);
    }
}

#[inline(always)]
fn owner(w: WedgeId, map: &Option<Vec<VertexId>>) -> VertexId {
    map.as_ref().map_or(VertexId(w.0), |map| map[w.index()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::three_levels;

    fn three() -> Progressive {
        Progressive::new(Splits::new(three_levels()).expect("sound splits"))
    }

    #[test]
    fn changed_ranges_contain_new_elements_before_and_between_modified_blocks() {
        let mut blocks = ChangedBlocks::new(2000);
        let ends = |ranges: Vec<Range<usize>>| ranges.iter().map(|r| [r.start, r.end]).collect::<Vec<_>>();
        blocks.add(1 + 3 * CHANGE_BLOCK_LEN);
        assert_eq!(ends(blocks.ranges(600, 1000)), [[600, 1000]]);
        assert_eq!(ends(blocks.ranges(1000, 1000)), [[768, 1000]]);
        blocks.add(CHANGE_BLOCK_LEN);
        assert_eq!(ends(blocks.ranges(1300, 1500)), [[256, 512], [768, 1024], [1300, 1500]]);
        assert_eq!(ends(blocks.ranges(400, 1500)), [[256, 1500]]);
    }

    /// Returns the faces and the position of vertex 1 along x.
    fn state(progressive: &Progressive) -> (Vec<[u32; 3]>, f64) {
        (
            progressive.faces().iter().map(|t| t.map(|w| w.0)).collect(),
            progressive.positions().get(VertexId(1))[0],
        )
    }

    #[test]
    fn levels_have_their_own_state_in_any_order() {
        let wanted = [
            (vec![[0, 1, 2]], 2.0),
            (vec![[0, 1, 2], [1, 3, 2]], 1.0),
            (vec![[0, 1, 2], [1, 4, 2], [4, 3, 2], [1, 5, 4]], 1.0),
        ];
        let mut progressive = three();
        assert_eq!((progressive.level(), progressive.top(), progressive.levels()), (2, 2, 3));
        for level in [2, 0, 1, 2, 1, 0, 2] {
            progressive.to_level(level);
            assert_eq!(state(&progressive), wanted[level], "level {level}");
            assert_eq!(progressive.positions().len(), [3, 4, 6][level]);
        }
        // There are no levels beyond the ends.
        progressive.to_level(9);
        assert_eq!(progressive.level(), 2);
        progressive.coarsen(9);
        assert_eq!(progressive.level(), 0);
        progressive.refine(1);
        assert_eq!(state(&progressive), wanted[1]);
    }

    #[test]
    fn levels_are_found_by_counts() {
        let progressive = three();
        assert_eq!([0, 1, 2, 3, 4, 9].map(|n| progressive.level_of_faces(n)), [0, 0, 1, 1, 2, 2]);
        assert_eq!([2, 3, 4, 5, 6].map(|n| progressive.level_of_vertices(n)), [0, 0, 1, 1, 2]);
    }

    #[test]
    fn vertex_counts_leave_out_holes() {
        // The second split takes both corners away from vertex 3, which becomes a hole.
        let mut data = three_levels();
        data.checkpoints.clear();
        data.faces[2] = [4, 5, 2].map(WedgeId);
        let mut progressive = Progressive::new(Splits::new(data).expect("sound splits"));
        for (level, used) in [(2, 5), (1, 4), (0, 3)] {
            progressive.to_level(level);
            assert_eq!(progressive.vertex_count(), used, "level {level}");
        }
        assert_eq!([3, 4, 5].map(|n| progressive.level_of_vertices(n)), [0, 1, 2]);
    }

    #[test]
    fn changed_ranges_contain_blocks_and_all_new_elements() {
        let one = |range: Range<usize>| std::iter::once(range).collect::<Vec<_>>();
        let mut blocks = ChangedBlocks::new(1000);
        assert!(blocks.ranges(700, 700).is_empty());
        [0, 255, 256, 700].into_iter().for_each(|i| blocks.add(i));
        // The last block is cut at the count, or joined with the new elements.
        assert_eq!(blocks.ranges(650, 650), one(0..650));
        let mut blocks = ChangedBlocks::new(1000);
        [0, 600].into_iter().for_each(|i| blocks.add(i));
        assert_eq!(blocks.ranges(700, 700), [0..256, 512..700]);
        assert_eq!(blocks.ranges(700, 1000), [0..256, 512..1000]);
        assert_eq!(blocks.ranges(900, 1000), [0..256, 512..768, 900..1000]);
        let mut progressive = three();
        let back = progressive.to_level(0);
        assert_eq!((back.faces, back.vertices), (one(0..1), one(0..3)));
        let there = progressive.to_level(1);
        // Face 1 and vertex 3 are new; vertex 1 moved.
        assert_eq!((there.faces, there.vertices), (one(1..2), one(0..4)));
    }

    #[test]
    fn the_first_splits_can_be_dropped() {
        let mut changes = Changes { ends: vec![0, 2, 3, 5], at: vec![7, 8, 9, 10, 11], to: () };
        assert_eq!(drop_first_splits(&mut changes, 2), 3);
        assert_eq!((changes.ends, changes.at), (vec![0, 2], vec![10, 11]));
        let progressive = three();
        let error = {
            let mut at_one = progressive.clone();
            at_one.to_level(1);
            at_one.error()
        };
        let mut above = progressive.without_below(1);
        assert_eq!((above.top(), above.level(), above.face_count()), (1, 0, 2));
        assert!((above.error() - error).abs() < 1e-9);
        assert_eq!(state(&above), (vec![[0, 1, 2], [1, 3, 2]], 1.0));
        above.to_level(1);
        assert_eq!(state(&above), state(&three()));
        let levels: Vec<u32> = above.splits().checkpoints.iter().map(|c| c.level).collect();
        assert_eq!(levels, [0, 1]);
    }
}
