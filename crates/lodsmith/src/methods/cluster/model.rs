//! Input of the clustering: positions in either precision, and the faces with three finite corners.

use std::borrow::Cow;

use glam::DVec3;
use lodsmith_core::mesh::defects::is_zero_area;
use lodsmith_core::{Bounds, Positions, Surface, VertexId};

use crate::SimplifyError;
use crate::chunks;
use crate::report::Cleanup;

/// A position in single or double precision.
pub(super) trait ClusterPosition: Copy + Send + Sync {
    /// Converts to double precision.
    fn wide(self) -> DVec3;
    /// Rounds to this precision.
    fn of(p: [f64; 3]) -> Self;
    /// Converts a list to mesh positions.
    fn positions(all: Vec<Self>) -> Positions;
}

impl ClusterPosition for [f32; 3] {
    #[inline(always)]
    fn wide(self) -> DVec3 {
        DVec3::new(f64::from(self[0]), f64::from(self[1]), f64::from(self[2]))
    }
    fn of(p: [f64; 3]) -> Self {
        p.map(|x| x as f32)
    }
    fn positions(all: Vec<Self>) -> Positions {
        Positions::F32(all)
    }
}

impl ClusterPosition for [f64; 3] {
    #[inline(always)]
    fn wide(self) -> DVec3 {
        self.into()
    }
    fn of(p: [f64; 3]) -> Self {
        p
    }
    fn positions(all: Vec<Self>) -> Positions {
        Positions::F64(all)
    }
}

/// Number of vertices processed side by side.
pub(super) const LANES: usize = 8;

/// Coordinates of a vertex, relative to the centre of the box and in units of its longest edge, and 0: four
/// make one load. (Single precision: the rounding is a small share of the smallest cell, and
/// [`ClusterGrid`](super::grid::Grid) allows for it.) The zero is negative if the faces of the vertex leave a gap:
/// no sum or product is affected by that. (A vertex counts as closed if the indices of its neighbours happen
/// to cancel out; within one fan they cannot.)
pub(super) type Framed = [f32; 4];

/// The input of the method.
pub(super) struct ClusterInput<'a, P> {
    pub(super) points: &'a [P],
    /// All corners of these are finite.
    pub(super) faces: Cow<'a, [[VertexId; 3]]>,
    /// Index of each face in the input, if some were dropped.
    pub(super) origin: Option<Vec<u32>>,
    /// All vertices; unspecified for those without a face.
    pub(super) frame: Vec<Framed>,
    /// For each vertex, a code: 0 without a face, 1 if its faces close, more if they leave a gap.
    marks: Vec<u32>,
    /// True if any vertex is open.
    pub(super) has_open: bool,
    min: DVec3,
    max: DVec3,
    pub(super) cleanup: Cleanup,
}

/// Adds a face to the mark of a vertex: the sum of the vertices after it in its faces, minus those before it.
/// It cancels where faces close the fan. The lowest bit is set once there is a face.
#[inline(always)]
fn mark(mark: &mut u32, next: VertexId, before: VertexId) {
    *mark = mark.wrapping_add(next.0.wrapping_sub(before.0) << 1) | 1;
}

/// Maximum number of parallel shares with marks of their own.
pub(super) const MAX_MARK_SHARES: usize = 4;

/// Bounding box of positions, and the sum of their products with 0: zero if all are finite.
type BoundsScan = (DVec3, DVec3, DVec3);
const EMPTY_SCAN: BoundsScan = (DVec3::INFINITY, DVec3::NEG_INFINITY, DVec3::ZERO);

fn scan_position((min, max, sum): BoundsScan, p: DVec3) -> BoundsScan {
    (min.min(p), max.max(p), sum + p * 0.0)
}

fn merge_scans(a: BoundsScan, b: BoundsScan) -> BoundsScan {
    (a.0.min(b.0), a.1.max(b.1), a.2 + b.2)
}

/// Marks of all vertices by a share of the faces.
struct MarkShare {
    marks: Vec<u32>,
    /// Faces that do not have three distinct vertices.
    degenerate: usize,
    looked: BoundsScan,
}

/// Marks all vertices, one share of the faces at a time, and scans a share of the positions in each.
fn shares<P: ClusterPosition>(faces: &[[VertexId; 3]], points: &[P]) -> Vec<MarkShare> {
    let count = chunks::threads(faces.len()).min(MAX_MARK_SHARES);
    chunks::each(count, |k| {
        let part = |n: usize| {
            let len = n.div_ceil(count);
            (k * len).min(n)..((k + 1) * len).min(n)
        };
        let looked =
            points[part(points.len())].iter().fold(EMPTY_SCAN, |all, p| scan_position(all, p.wide()));
        let mut marks = vec![0; points.len()];
        let mut degenerate = 0;
        for &[a, b, c] in &faces[part(faces.len())] {
            mark(&mut marks[a.index()], b, c);
            mark(&mut marks[b.index()], c, a);
            mark(&mut marks[c.index()], a, b);
            degenerate += usize::from(a == b || b == c || c == a);
        }
        MarkShare { marks, degenerate, looked }
    })
}

impl<'a, P: ClusterPosition> ClusterInput<'a, P> {
    /// Builds the model, without faces that have non-finite corners. Cost: O(V + F).
    ///
    /// # Errors
    /// [`SimplifyError::NoFaces`] if no face has an area.
    pub(super) fn new(points: &'a [P], surface: &'a Surface<'_>) -> Result<Self, SimplifyError> {
        let all = surface.triangles();
        let mut cleanup = Cleanup::default();
        let is_finite = |v: VertexId| points[v.index()].wide().is_finite();
        let mut marked = shares(all, points);
        let looked = marked.iter().fold(EMPTY_SCAN, |all, s| merge_scans(all, s.looked));
        let mut faces = Cow::Borrowed(all);
        let mut origin = None;
        if looked.2 != DVec3::ZERO {
            let kept: Vec<u32> =
                (0..all.len() as u32).filter(|&f| all[f as usize].iter().all(|&v| is_finite(v))).collect();
            cleanup.non_finite_faces = all.len() - kept.len();
            faces = Cow::Owned(kept.iter().map(|&f| all[f as usize]).collect());
            origin = Some(kept);
            marked = shares(&faces, points);
        }
        cleanup.degenerate_faces = marked.iter().map(|s| s.degenerate).sum();
        if !faces.iter().any(|t| !is_zero_area(t.map(|v| points[v.index()].wide().to_array()))) {
            return Err(SimplifyError::NoFaces { faces: all.len() });
        }
        let mut marks = marked.swap_remove(0).marks;
        let len = chunks::len(marks.len());
        let counts = chunks::shared(&mut marks, len, |k, marks| {
            for share in &marked {
                for (a, b) in marks.iter_mut().zip(&share.marks[k * len..]) {
                    *a = (*a & !1).wrapping_add(b & !1) | (*a | b) & 1;
                }
            }
            let counted = |(used, open), m: &u32| (used + usize::from(*m > 0), open + usize::from(*m > 1));
            marks.iter().fold((0, 0), counted)
        });
        let used: usize = counts.iter().map(|c| c.0).sum();
        cleanup.unused_vertices = points.len() - used;
        let (min, max, _) = match used == points.len() {
            true => looked,
            // The box covers only vertices with faces.
            false => chunks::map(points.len(), |range| {
                let used = points[range.clone()].iter().zip(&marks[range]).filter(|x| *x.1 > 0);
                used.fold(EMPTY_SCAN, |all, (p, _)| scan_position(all, p.wide()))
            })
            .into_iter()
            .fold(EMPTY_SCAN, merge_scans),
        };
        let has_open = counts.iter().any(|c| c.1 > 0);
        let mut model = Self { points, faces, origin, frame: Vec::new(), marks, has_open, min, max, cleanup };
        model.frame = model.framed();
        Ok(model)
    }

    fn framed(&self) -> Vec<Framed> {
        let (middle, longest) = (self.middle(), self.extent().max_element());
        // (Lengths below the smallest normal number have no finite inverse.)
        let scale = longest.max(f64::MIN_POSITIVE).recip();
        let (points, marks) = (self.points, &self.marks[..self.points.len()]);
        chunks::list(points.len(), |v| {
            let p = ((points[v].wide() - middle) * scale).as_vec3();
            [p.x, p.y, p.z, f32::from_bits(u32::from(marks[v] > 1) << 31)]
        })
    }

    #[inline(always)]
    pub(super) fn place(&self, v: VertexId) -> DVec3 {
        self.points[v.index()].wide()
    }
    pub(super) fn is_used(&self, v: usize) -> bool {
        self.marks[v] > 0
    }
    /// Returns the index of a face in the input.
    pub(super) fn origin(&self, face: u32) -> usize {
        self.origin.as_ref().map_or(face, |o| o[face as usize]) as usize
    }
    /// Number of faces with three distinct vertices.
    pub(super) fn sound_faces(&self) -> usize {
        self.faces.len() - self.cleanup.degenerate_faces
    }
    /// Edge lengths of the bounding box of the faces.
    pub(super) fn extent(&self) -> DVec3 {
        self.max - self.min
    }
    /// Centre of the box. (Halved first: the sum of two huge coordinates may overflow.)
    pub(super) fn middle(&self) -> DVec3 {
        self.min * 0.5 + self.max * 0.5
    }
    pub(super) fn diagonal(&self) -> f64 {
        Bounds { min: self.min.to_array(), max: self.max.to_array() }.diagonal()
    }
}
