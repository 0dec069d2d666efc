//! What is clustered: positions of either precision, and the faces that have three finite corners.

use std::borrow::Cow;

use glam::DVec3;
use lodsmith_core::mesh::defects::is_zero_area;
use lodsmith_core::{Bounds, Positions, Surface, VertexId};

use super::pieces;
use crate::SimplifyError;
use crate::report::Cleanup;

/// A position of either precision.
pub(super) trait Place: Copy + Send + Sync {
    /// Widened.
    fn wide(self) -> DVec3;
    /// Rounded to this precision.
    fn of(p: [f64; 3]) -> Self;
    /// As a mesh has them.
    fn positions(all: Vec<Self>) -> Positions;
}

impl Place for [f32; 3] {
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

impl Place for [f64; 3] {
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

/// Vertices worked on side by side.
pub(super) const LANES: usize = 8;

/// Coordinates of a vertex, from the middle of the box and in its longest edge, and nothing: four make one load. (Single
/// precision: what it rounds is a small share of the smallest cell, and [`Grid`](super::grid::Grid) knows it.)
pub(super) type Framed = [f32; 4];

/// The input of the method.
pub(super) struct Model<'a, P> {
    pub(super) points: &'a [P],
    /// All corners of these are finite.
    pub(super) faces: Cow<'a, [[VertexId; 3]]>,
    /// The face of the input that each one is, where some were left out.
    pub(super) origin: Option<Vec<u32>>,
    /// All vertices; of those without a face, anything.
    pub(super) frame: Vec<Framed>,
    /// Of each vertex whether it has a face, and whether its faces leave a gap.
    marks: Vec<u32>,
    /// Whether any vertex is open.
    pub(super) has_open: bool,
    min: DVec3,
    max: DVec3,
    pub(super) cleanup: Cleanup,
}

/// Adds a face to the mark of a vertex: the sum of the vertices that follow it at its faces, less those before it. Nothing is
/// left where faces stand all round. The lowest bit says that there is a face.
#[inline(always)]
fn mark(mark: &mut u32, next: VertexId, before: VertexId) {
    *mark = mark.wrapping_add(next.0.wrapping_sub(before.0) << 1) | 1;
}

/// What is marked anywhere is marked side by side in so many shares at most, each with marks of its own.
pub(super) const MARKERS: usize = 4;

/// Marks of all vertices, and how many faces do not name three.
fn marks(faces: &[[VertexId; 3]], vertices: usize) -> (Vec<u32>, usize) {
    let shares = pieces::threads(faces.len()).min(MARKERS);
    let len = faces.len().div_ceil(shares).max(1);
    let mut parts = pieces::each(shares, |k| {
        let mut marks = vec![0; vertices];
        let mut degenerate = 0;
        for &[a, b, c] in &faces[(k * len).min(faces.len())..((k + 1) * len).min(faces.len())] {
            mark(&mut marks[a.index()], b, c);
            mark(&mut marks[b.index()], c, a);
            mark(&mut marks[c.index()], a, b);
            degenerate += usize::from(a == b || b == c || c == a);
        }
        (marks, degenerate)
    });
    let (mut marks, first) = parts.swap_remove(0);
    let degenerate = first + parts.iter().map(|p| p.1).sum::<usize>();
    if !parts.is_empty() {
        pieces::fill(&mut marks, |start, piece| {
            for (more, _) in &parts {
                for (a, b) in piece.iter_mut().zip(&more[start..]) {
                    *a = (*a & !1).wrapping_add(b & !1) | (*a | b) & 1;
                }
            }
        });
    }
    (marks, degenerate)
}

impl<'a, P: Place> Model<'a, P> {
    /// Leaves out what has no place. Cost: O(V + F).
    ///
    /// # Errors
    /// [`SimplifyError::NoFaces`] if no face has an area.
    pub(super) fn new(points: &'a [P], surface: &'a Surface<'_>) -> Result<Self, SimplifyError> {
        let all = surface.triangles();
        let mut cleanup = Cleanup::default();
        let is_finite = |v: VertexId| points[v.index()].wide().is_finite();
        // The product with 0 of what is finite is 0.
        let looked = pieces::map(points.len(), |range| {
            let none = (DVec3::INFINITY, DVec3::NEG_INFINITY, DVec3::ZERO);
            points[range].iter().fold(none, |(min, max, sum), p| {
                let p = p.wide();
                (min.min(p), max.max(p), sum + p * 0.0)
            })
        });
        let mut faces = Cow::Borrowed(all);
        let mut origin = None;
        if looked.iter().any(|x| x.2 != DVec3::ZERO) {
            let kept: Vec<u32> =
                (0..all.len() as u32).filter(|&f| all[f as usize].iter().all(|&v| is_finite(v))).collect();
            cleanup.non_finite_faces = all.len() - kept.len();
            faces = Cow::Owned(kept.iter().map(|&f| all[f as usize]).collect());
            origin = Some(kept);
        }
        let (marks, degenerate) = marks(&faces, points.len());
        cleanup.degenerate_faces = degenerate;
        let counts = pieces::map(points.len(), |range| {
            marks[range]
                .iter()
                .fold((0, 0), |(used, open), m| (used + usize::from(*m > 0), open + usize::from(*m > 1)))
        });
        let used: usize = counts.iter().map(|c| c.0).sum();
        cleanup.unused_vertices = points.len() - used;
        let boxes = match used == points.len() {
            true => looked.iter().map(|x| (x.0, x.1)).collect(),
            false => pieces::map(points.len(), |range| {
                let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
                let used = points[range.clone()].iter().zip(&marks[range]).filter(|x| *x.1 > 0);
                used.fold(none, |(min, max), (p, _)| (min.min(p.wide()), max.max(p.wide())))
            }),
        };
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (min, max) = boxes.into_iter().fold(none, |a, b| (a.0.min(b.0), a.1.max(b.1)));
        if !faces.iter().any(|t| !is_zero_area(t.map(|v| points[v.index()].wide().to_array()))) {
            return Err(SimplifyError::NoFaces { faces: all.len() });
        }
        let has_open = counts.iter().any(|c| c.1 > 0);
        let mut model = Self { points, faces, origin, frame: Vec::new(), marks, has_open, min, max, cleanup };
        model.frame = model.framed();
        Ok(model)
    }

    fn framed(&self) -> Vec<Framed> {
        let (middle, longest) = (self.middle(), self.extent().max_element());
        // (A length below the least normal number has no inverse.)
        let scale = longest.max(f64::MIN_POSITIVE).recip();
        let mut frame = vec![[0.0; 4]; self.points.len()];
        pieces::fill(&mut frame, |start, piece| {
            for (framed, p) in piece.iter_mut().zip(&self.points[start..]) {
                let p = ((p.wide() - middle) * scale).as_vec3();
                *framed = [p.x, p.y, p.z, 0.0];
            }
        });
        frame
    }

    #[inline(always)]
    pub(super) fn place(&self, v: VertexId) -> DVec3 {
        self.points[v.index()].wide()
    }
    pub(super) fn is_used(&self, v: usize) -> bool {
        self.marks[v] > 0
    }
    /// Whether the faces of a vertex leave a gap. (It is taken for closed where the numbers of the vertices around happen to
    /// cancel out; those of one fan cannot.)
    #[inline(always)]
    pub(super) fn is_open(&self, v: usize) -> bool {
        self.marks[v] > 1
    }
    /// The face of the input that a face is.
    pub(super) fn origin(&self, face: u32) -> usize {
        self.origin.as_ref().map_or(face, |o| o[face as usize]) as usize
    }
    /// Faces that name three vertices.
    pub(super) fn sound_faces(&self) -> usize {
        self.faces.len() - self.cleanup.degenerate_faces
    }
    /// Edges of the box round the faces.
    pub(super) fn extent(&self) -> DVec3 {
        self.max - self.min
    }
    /// Middle of the box. (Halved first: the sum of two huge coordinates may be no number.)
    pub(super) fn middle(&self) -> DVec3 {
        self.min * 0.5 + self.max * 0.5
    }
    pub(super) fn diagonal(&self) -> f64 {
        Bounds { min: self.min.to_array(), max: self.max.to_array() }.diagonal()
    }
}
