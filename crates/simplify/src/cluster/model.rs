//! What is clustered: positions of either precision, and the faces that have three finite corners.

use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, Ordering};

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

/// The input of the method.
pub(super) struct Model<'a, P> {
    pub(super) points: &'a [P],
    /// All corners of these are finite.
    pub(super) faces: Cow<'a, [[VertexId; 3]]>,
    /// The face of the input that each one is, where some were left out.
    pub(super) origin: Option<Vec<u32>>,
    /// Whether each vertex has a face.
    is_used: Vec<AtomicBool>,
    min: DVec3,
    max: DVec3,
    pub(super) cleanup: Cleanup,
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
        let sums = pieces::map(points.len(), |range| {
            points[range].iter().map(|p| (p.wide() * 0.0).element_sum()).sum::<f64>()
        });
        let mut faces = Cow::Borrowed(all);
        let mut origin = None;
        if sums.iter().sum::<f64>() != 0.0 {
            let kept: Vec<u32> =
                (0..all.len() as u32).filter(|&f| all[f as usize].iter().all(|&v| is_finite(v))).collect();
            cleanup.non_finite_faces = all.len() - kept.len();
            faces = Cow::Owned(kept.iter().map(|&f| all[f as usize]).collect());
            origin = Some(kept);
        }
        let is_used: Vec<AtomicBool> = (0..points.len()).map(|_| AtomicBool::new(false)).collect();
        let degenerate = pieces::map(faces.len(), |range| {
            let mut degenerate = 0;
            for t in &faces[range] {
                t.iter().for_each(|v| is_used[v.index()].store(true, Ordering::Relaxed));
                degenerate += usize::from(t[0] == t[1] || t[1] == t[2] || t[2] == t[0]);
            }
            degenerate
        });
        cleanup.degenerate_faces = degenerate.iter().sum();
        let boxes = pieces::map(points.len(), |range| {
            let (mut min, mut max, mut used) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0usize);
            for (p, is_used) in points[range.clone()].iter().zip(&is_used[range]) {
                if is_used.load(Ordering::Relaxed) {
                    used += 1;
                    (min, max) = (min.min(p.wide()), max.max(p.wide()));
                }
            }
            (min, max, used)
        });
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        cleanup.unused_vertices = points.len();
        for (low, high, used) in boxes {
            cleanup.unused_vertices -= used;
            (min, max) = (min.min(low), max.max(high));
        }
        if !faces.iter().any(|t| !is_zero_area(t.map(|v| points[v.index()].wide().to_array()))) {
            return Err(SimplifyError::NoFaces { faces: all.len() });
        }
        Ok(Self { points, faces, origin, is_used, min, max, cleanup })
    }

    #[inline(always)]
    pub(super) fn place(&self, v: VertexId) -> DVec3 {
        self.points[v.index()].wide()
    }
    pub(super) fn is_used(&self, v: usize) -> bool {
        self.is_used[v].load(Ordering::Relaxed)
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
