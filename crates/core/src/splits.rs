//! A base mesh and the vertex splits that lead from it to the full mesh, as plain data.
//!
//! ```text
//! level 0        level 1             ...            level n
//! base mesh  --split 0-->  ...  --split n-1-->  full mesh
//!            <-contraction 0-           <-contraction n-1-
//! ```
//!
//! Elements are numbered in the order of their creation, from the base on: at any level the elements below
//! [`Counts`] exist, and those beyond do not exist yet. All arrays hold an element *as it is right after the
//! split that creates it*. Changes of older elements by a split are in [`Changes`], each with the value
//! *after* the split; the value before it is the current one of the decoder. So nothing is stored twice, and
//! any prefix of all arrays (base, then some splits) is a coarser mesh.
//!
//! Most splits create one vertex and two faces, move some corners of the split vertex to the new one, and
//! move the split vertex. But a split may be anything that leads from one mesh to another: contractions of
//! pairs that shared no edge, surfaces cut apart, whole removed components, and, as the last one, whatever
//! was welded or left out of the input before the first contraction.
//!
//! A vertex or wedge that no live face uses, though its number is below the count, is a *hole*: an engine
//! that cuts a surface makes vertices that the full mesh does not have. A mesh extracted at a level leaves
//! holes out.

use crate::ids::{FaceId, RegionId, VertexId, WedgeId};
use crate::mesh::{Positions, Semantic};

/// Reasons why arrays do not form a valid base mesh with splits.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SplitsError {
    /// An array does not have the length that other arrays require.
    #[error("{array}: {got} entries, expected {wanted}")]
    WrongLength {
        /// The array.
        array: &'static str,
        /// Its length.
        got: usize,
        /// The required length.
        wanted: usize,
    },
    /// A number that must not decrease does, or exceeds the limit.
    #[error("{array}: out of order at entry {entry}")]
    OutOfOrder {
        /// The array.
        array: &'static str,
        /// Index of the entry.
        entry: usize,
    },
    /// An entry refers to an element that does not exist at its level.
    #[error("{array}, entry {entry}: index {index} is out of range, {count} exist at this level")]
    OutOfRange {
        /// The array.
        array: &'static str,
        /// Index of the entry.
        entry: usize,
        /// The number that it refers to.
        index: u32,
        /// Number of elements at that level.
        count: usize,
    },
    /// Single and double precision are mixed, or the map from wedges to vertices is stored twice.
    #[error("{array}: does not fit the mesh, expected {wanted}")]
    Unfit {
        /// The array.
        array: &'static str,
        /// The expected kind.
        wanted: &'static str,
    },
    /// More entries than 32-bit numbers can count.
    #[error("{array}: {count} entries, too many for 32-bit numbers")]
    TooLarge {
        /// The array.
        array: &'static str,
        /// Its length.
        count: usize,
    },
}

/// Numbers of elements at a level, holes included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Faces; none of them is a hole.
    pub faces: u32,
    /// Wedges.
    pub wedges: u32,
    /// Vertices.
    pub vertices: u32,
}

/// Attributes in the row of values of a wedge, in this order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    /// Three values: a normal.
    pub has_normals: bool,
    /// Two values: texture coordinates.
    pub has_uvs: bool,
    /// Four values: a colour.
    pub has_colors: bool,
    /// Further attributes, each with its number of values per wedge.
    pub further: Vec<(Semantic, usize)>,
}

impl Layout {
    /// Number of values in a row.
    pub fn width(&self) -> usize {
        let first = 3 * usize::from(self.has_normals)
            + 2 * usize::from(self.has_uvs)
            + 4 * usize::from(self.has_colors);
        self.further.iter().fold(first, |sum, f| sum.saturating_add(f.1))
    }
}

/// Changes that splits make to existing elements: `at[i]` becomes `to[i]`, for split s with i from `ends[s]`
/// to `ends[s + 1]`. If one split changes an element twice, the later entry counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changes<A, T> {
    /// End offsets of the splits, one more than there are splits; the first is 0.
    pub ends: Vec<u32>,
    /// Id of the changed element.
    pub at: Vec<A>,
    /// Its value after the split.
    pub to: T,
}

impl<A, T> Changes<A, T> {
    /// Range of the changes of a split.
    ///
    /// # Panics
    /// If there is no such split.
    #[inline]
    pub fn of(&self, split: usize) -> std::ops::Range<usize> {
        self.ends[split] as usize..self.ends[split + 1] as usize
    }
}

/// A level with the result of a least-squares fit to the full mesh. The splits do not include it; to get the
/// closer mesh, add these offsets to the decoded level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Checkpoint {
    /// Number of splits done.
    pub level: u32,
    /// Approximate RMS distance of the fitted level to the full mesh, in the units of the positions. Never
    /// increases from checkpoint to checkpoint.
    pub error: f64,
    /// Ids of the vertices that move, ascending.
    pub vertices: Vec<VertexId>,
    /// Offsets added to their positions.
    pub moves: Vec<[f32; 3]>,
    /// Ids of the wedges whose values change, ascending.
    pub wedges: Vec<WedgeId>,
    /// Offsets added to their rows; normals and tangent directions then have to be normalized again.
    pub changes: Vec<f32>,
}

/// Numbers of the elements in the recorded mesh, so that the full level is identical to the input.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Original {
    /// The vertex of the original, or [`NO_ORIGINAL`].
    pub vertices: Vec<VertexId>,
    /// The wedge of the original, or [`NO_ORIGINAL`].
    pub wedges: Vec<WedgeId>,
    /// The face of the original.
    pub faces: Vec<FaceId>,
    /// True if the original stored the vertex of each wedge.
    pub has_vertex_map: bool,
}

/// Marks an element that the original does not have.
pub const NO_ORIGINAL: u32 = u32::MAX;

/// The arrays; see the module documentation.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitData {
    /// Numbers of elements at each level, from the base on: one more than there are splits. The last are the
    /// lengths of the arrays of faces, wedges and vertices.
    pub counts: Vec<Counts>,
    /// Three wedges for each face, as of the split that creates it.
    pub faces: Vec<[WedgeId; 3]>,
    /// The region of each face, which never changes; `None` if there is only one.
    pub regions: Option<Vec<RegionId>>,
    /// The vertex of each wedge; `None` if wedge i is vertex i at all levels.
    pub vertex_of: Option<Vec<VertexId>>,
    /// Attributes of a wedge.
    pub layout: Layout,
    /// A row of values for each wedge.
    pub values: Vec<f32>,
    /// The position of each vertex.
    pub positions: Positions,
    /// Corners (three times the face, plus 0, 1 or 2) that change to another wedge at a split.
    pub corners: Changes<u32, Vec<WedgeId>>,
    /// Wedges that change to another vertex.
    pub owners: Changes<WedgeId, Vec<VertexId>>,
    /// Wedges whose row of values changes; whole rows.
    pub rows: Changes<WedgeId, Vec<f32>>,
    /// Vertices whose position changes.
    pub places: Changes<VertexId, Positions>,
    /// Levels with a fit, from the coarsest on; may be empty.
    pub checkpoints: Vec<Checkpoint>,
    /// The numbers of the original, if known.
    pub original: Option<Original>,
}

/// Validated arrays: every number names an element that exists at its level.
#[derive(Clone, Debug, PartialEq)]
pub struct Splits(SplitData);

impl std::ops::Deref for Splits {
    type Target = SplitData;
    fn deref(&self) -> &SplitData {
        &self.0
    }
}

impl Splits {
    /// Validates the arrays. Cost: O(n).
    ///
    /// # Errors
    /// [`SplitsError`] with the array and its first wrong entry.
    pub fn new(data: SplitData) -> Result<Self, SplitsError> {
        check(&data)?;
        Ok(Self(data))
    }
    /// Returns the arrays, for example to change and validate them again.
    pub fn into_data(self) -> SplitData {
        self.0
    }
    /// Number of splits; also the level of the full mesh.
    pub fn len(&self) -> usize {
        self.counts.len() - 1
    }
    /// True if there are no splits.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

fn check(data: &SplitData) -> Result<(), SplitsError> {
    let Some(last) = data.counts.last() else {
        return Err(SplitsError::WrongLength { array: "counts", got: 0, wanted: 1 });
    };
    let rises =
        |a: &Counts, b: &Counts| a.faces <= b.faces && a.wedges <= b.wedges && a.vertices <= b.vertices;
    if let Some(i) = data.counts.windows(2).position(|c| !rises(&c[0], &c[1])) {
        return Err(SplitsError::OutOfOrder { array: "counts", entry: i + 1 });
    }
    let splits = data.counts.len() - 1;
    let width = data.layout.width();
    let wedges = last.wedges as usize;
    let length = |array: &'static str, got: usize, wanted: usize| match got == wanted {
        true => Ok(()),
        false => Err(SplitsError::WrongLength { array, got, wanted }),
    };
    for (array, count) in [("faces", data.faces.len().saturating_mul(3)), ("splits", splits)] {
        if count >= u32::MAX as usize {
            return Err(SplitsError::TooLarge { array, count });
        }
    }
    if data.layout.further.iter().any(|f| f.1 == 0) {
        return Err(SplitsError::Unfit { array: "layout", wanted: "attributes with values" });
    }
    length("faces", data.faces.len(), last.faces as usize)?;
    length("positions", data.positions.len(), last.vertices as usize)?;
    length("values", data.values.len(), wedges.saturating_mul(width))?;
    if let Some(regions) = &data.regions {
        length("regions", regions.len(), data.faces.len())?;
    }
    check_changes("changes of corners", &data.corners, splits, data.corners.to.len())?;
    check_changes("changes of owners", &data.owners, splits, data.owners.to.len())?;
    let rows = data.rows.to.len();
    length("changed rows", rows, data.rows.at.len().saturating_mul(width))?;
    check_changes("changes of rows", &data.rows, splits, data.rows.at.len())?;
    check_changes("changes of places", &data.places, splits, data.places.to.len())?;
    if matches!(data.positions, Positions::F32(_)) != matches!(data.places.to, Positions::F32(_)) {
        return Err(SplitsError::Unfit {
            array: "changes of places",
            wanted: "the precision of the positions",
        });
    }
    match &data.vertex_of {
        Some(vertex_of) => length("vertices of wedges", vertex_of.len(), wedges)?,
        None => {
            if let Some(entry) = data.counts.iter().position(|c| c.wedges != c.vertices) {
                return Err(SplitsError::OutOfOrder { array: "counts", entry });
            }
            if !data.owners.at.is_empty() {
                let wanted = "none where wedges are vertices";
                return Err(SplitsError::Unfit { array: "changes of owners", wanted });
            }
        }
    }
    check_numbers(data)?;
    check_checkpoints(data, width)?;
    data.original.as_ref().map_or(Ok(()), |original| check_original(original, last))
}

fn check_changes<A, T>(
    array: &'static str,
    changes: &Changes<A, T>,
    splits: usize,
    values: usize,
) -> Result<(), SplitsError> {
    let (ends, at) = (&changes.ends, changes.at.len());
    if ends.len() != splits + 1 {
        return Err(SplitsError::WrongLength { array, got: ends.len(), wanted: splits + 1 });
    }
    if at != values {
        return Err(SplitsError::WrongLength { array, got: values, wanted: at });
    }
    if ends[0] != 0 {
        return Err(SplitsError::OutOfOrder { array, entry: 0 });
    }
    if let Some(i) = ends.windows(2).position(|e| e[0] > e[1]) {
        return Err(SplitsError::OutOfOrder { array, entry: i + 1 });
    }
    match ends[splits] as usize == at {
        true => Ok(()),
        false => Err(SplitsError::OutOfOrder { array, entry: splits }),
    }
}

/// Checks every number against the counts at its level.
fn check_numbers(data: &SplitData) -> Result<(), SplitsError> {
    let within = |array: &'static str, entry: usize, index: u32, count: u32| match index < count {
        true => Ok(()),
        false => Err(SplitsError::OutOfRange { array, entry, index, count: count as usize }),
    };
    let born = |before: &Counts, after: &Counts| -> Result<(), SplitsError> {
        let faces = &data.faces[before.faces as usize..after.faces as usize];
        for (f, t) in (before.faces as usize..).zip(faces) {
            t.iter().try_for_each(|w| within("faces", f, w.0, after.wedges))?;
        }
        let Some(vertex_of) = &data.vertex_of else { return Ok(()) };
        let wedges = &vertex_of[before.wedges as usize..after.wedges as usize];
        let mut owners = (before.wedges as usize..).zip(wedges);
        owners.try_for_each(|(w, v)| within("vertices of wedges", w, v.0, after.vertices))
    };
    born(&Counts::default(), &data.counts[0])?;
    for (s, c) in data.counts.windows(2).enumerate() {
        let (before, after) = (&c[0], &c[1]);
        born(before, after)?;
        for i in data.corners.of(s) {
            let array = "changes of corners";
            within(array, i, data.corners.at[i], before.faces * 3)?;
            within(array, i, data.corners.to[i].0, after.wedges)?;
        }
        for i in data.owners.of(s) {
            let array = "changes of owners";
            within(array, i, data.owners.at[i].0, before.wedges)?;
            within(array, i, data.owners.to[i].0, after.vertices)?;
        }
        for i in data.rows.of(s) {
            within("changes of rows", i, data.rows.at[i].0, before.wedges)?;
        }
        for i in data.places.of(s) {
            within("changes of places", i, data.places.at[i].0, before.vertices)?;
        }
    }
    Ok(())
}

fn check_checkpoints(data: &SplitData, width: usize) -> Result<(), SplitsError> {
    let array = "checkpoints";
    for (entry, c) in data.checkpoints.iter().enumerate() {
        let Some(counts) = data.counts.get(c.level as usize) else {
            let count = data.counts.len();
            return Err(SplitsError::OutOfRange { array, entry, index: c.level, count });
        };
        let before = entry.checked_sub(1).map(|i| &data.checkpoints[i]);
        let falls = before.is_none_or(|b| b.level < c.level && b.error >= c.error);
        if !falls || !c.error.is_finite() || c.error < 0.0 {
            return Err(SplitsError::OutOfOrder { array, entry });
        }
        if c.moves.len() != c.vertices.len() {
            return Err(SplitsError::WrongLength { array, got: c.moves.len(), wanted: c.vertices.len() });
        }
        let wanted = c.wedges.len().saturating_mul(width);
        if c.changes.len() != wanted {
            return Err(SplitsError::WrongLength { array, got: c.changes.len(), wanted });
        }
        let vertices = c.vertices.windows(2).all(|v| v[0] < v[1]);
        if !vertices || !c.wedges.windows(2).all(|w| w[0] < w[1]) {
            return Err(SplitsError::OutOfOrder { array, entry });
        }
        for (last, count) in
            [(c.vertices.last().map(|v| v.0), counts.vertices), (c.wedges.last().map(|w| w.0), counts.wedges)]
        {
            if let Some(index) = last.filter(|&i| i >= count) {
                return Err(SplitsError::OutOfRange { array, entry, index, count: count as usize });
            }
        }
    }
    Ok(())
}

/// Checks that each number of the original is used once, from 0 on.
fn check_original(original: &Original, last: &Counts) -> Result<(), SplitsError> {
    let number = |array: &'static str, numbers: &[u32], wanted: u32| -> Result<(), SplitsError> {
        if numbers.len() != wanted as usize {
            return Err(SplitsError::WrongLength { array, got: numbers.len(), wanted: wanted as usize });
        }
        let count = numbers.iter().filter(|&&n| n != NO_ORIGINAL).count();
        let mut seen = vec![false; count];
        for (entry, &index) in numbers.iter().enumerate().filter(|x| *x.1 != NO_ORIGINAL) {
            match seen.get_mut(index as usize) {
                None => return Err(SplitsError::OutOfRange { array, entry, index, count }),
                Some(true) => return Err(SplitsError::OutOfOrder { array, entry }),
                Some(seen) => *seen = true,
            }
        }
        Ok(())
    };
    number("original vertices", bytemuck::cast_slice(&original.vertices), last.vertices)?;
    number("original wedges", bytemuck::cast_slice(&original.wedges), last.wedges)?;
    number("original faces", bytemuck::cast_slice(&original.faces), last.faces)?;
    match original.faces.iter().position(|f| f.0 == NO_ORIGINAL) {
        None => Ok(()),
        Some(entry) => Err(SplitsError::OutOfOrder { array: "original faces", entry }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ```text
    ///   2         2-3
    ///  / \   ->  / \|      vertex 3 is created with face 1; vertex 1 moves
    /// 0---1     0---1
    /// ```
    fn one_split() -> SplitData {
        let counts = |faces, n| Counts { faces, wedges: n, vertices: n };
        let changes = || Changes { ends: vec![0, 0], at: Vec::new(), to: Vec::new() };
        SplitData {
            counts: vec![counts(1, 3), counts(2, 4)],
            faces: vec![[0, 1, 2].map(WedgeId), [1, 3, 2].map(WedgeId)],
            regions: None,
            vertex_of: None,
            layout: Layout::default(),
            values: Vec::new(),
            positions: Positions::F32(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]),
            corners: changes(),
            owners: Changes { ends: vec![0, 0], at: Vec::new(), to: Vec::new() },
            rows: Changes { ends: vec![0, 0], at: Vec::new(), to: Vec::new() },
            places: Changes {
                ends: vec![0, 1],
                at: vec![VertexId(1)],
                to: Positions::F32(vec![[1.5, 0.0, 0.0]]),
            },
            checkpoints: vec![Checkpoint { level: 0, error: 0.5, ..Checkpoint::default() }],
            original: None,
        }
    }

    #[test]
    fn sound_arrays_pass() {
        let splits = Splits::new(one_split()).unwrap();
        assert_eq!((splits.len(), splits.places.of(0)), (1, 0..1));
        assert_eq!(Splits::new(splits.clone().into_data()), Ok(splits));
    }

    #[test]
    fn references_to_later_elements_are_errors() {
        let refused = |corrupt: fn(&mut SplitData)| {
            let mut data = one_split();
            corrupt(&mut data);
            Splits::new(data).unwrap_err()
        };
        let early = refused(|d| d.faces[0][2] = WedgeId(3));
        assert_eq!(early, SplitsError::OutOfRange { array: "faces", entry: 0, index: 3, count: 3 });
        let too_new = refused(|d| d.places.at[0] = VertexId(3));
        assert_eq!(
            too_new,
            SplitsError::OutOfRange { array: "changes of places", entry: 0, index: 3, count: 3 }
        );
        assert!(matches!(refused(|d| d.counts.clear()), SplitsError::WrongLength { .. }));
        assert!(matches!(refused(|d| d.counts[0].faces = 3), SplitsError::OutOfOrder { .. }));
        assert!(matches!(refused(|d| d.places.ends = vec![1, 1]), SplitsError::OutOfOrder { .. }));
        assert!(matches!(refused(|d| d.places.ends = vec![0, 2]), SplitsError::OutOfOrder { .. }));
        assert!(matches!(
            refused(|d| d.places.to = Positions::F64(vec![[0.0; 3]])),
            SplitsError::Unfit { .. }
        ));
        assert!(matches!(refused(|d| d.checkpoints[0].level = 2), SplitsError::OutOfRange { .. }));
        assert!(matches!(refused(|d| d.checkpoints[0].error = f64::NAN), SplitsError::OutOfOrder { .. }));
        assert!(matches!(refused(|d| d.layout.has_uvs = true), SplitsError::WrongLength { .. }));
        assert!(matches!(
            refused(|d| d.layout.further = vec![(Semantic::Tangent, usize::MAX)]),
            SplitsError::WrongLength { .. }
        ));
    }

    #[test]
    fn an_original_has_each_number_once() {
        let with = |vertices: [u32; 4]| {
            let mut data = one_split();
            let ids = vertices.to_vec();
            data.original = Some(Original {
                vertices: ids.iter().copied().map(VertexId).collect(),
                wedges: ids.into_iter().map(WedgeId).collect(),
                faces: vec![FaceId(1), FaceId(0)],
                has_vertex_map: false,
            });
            Splits::new(data)
        };
        assert!(with([3, 0, 2, 1]).is_ok());
        assert!(with([1, 0, NO_ORIGINAL, 2]).is_ok());
        assert!(with([3, 0, 2, 2]).is_err());
        assert!(with([4, 0, 2, 1]).is_err());
    }
}
