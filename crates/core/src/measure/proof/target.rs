//! Faces that a piece is compared with: those of a tree, or a few in a list.

use glam::DVec3;

use crate::geometry::triangle;
use crate::spatial::bvh::SlotHit;
use crate::spatial::{Bvh, Hint};

/// Faces by number, in one unit.
pub(super) trait Target {
    /// Number of faces.
    fn count(&self) -> usize;
    /// Corners of a face.
    fn corners(&self, face: u32) -> [DVec3; 3];
    /// Calls `visit` for the faces that may lie within a squared distance of a point; a returned value is the
    /// new squared distance.
    fn visit_near(&self, p: DVec3, bound_sq: f64, visit: impl FnMut(u32) -> Option<f64>);
    /// Returns the nearest face; `None` if there is none.
    fn closest(&self, p: DVec3, hint: &mut Hint) -> Option<SlotHit>;
}

impl Target for Bvh {
    #[inline]
    fn count(&self) -> usize {
        self.face_count()
    }
    #[inline]
    fn corners(&self, face: u32) -> [DVec3; 3] {
        self.slot_corners(face)
    }
    #[inline(always)]
    fn visit_near(&self, p: DVec3, bound_sq: f64, visit: impl FnMut(u32) -> Option<f64>) {
        self.visit(p, bound_sq, visit);
    }
    fn closest(&self, p: DVec3, hint: &mut Hint) -> Option<SlotHit> {
        self.closest_slot(p, f64::INFINITY, hint)
    }
}

/// A face and its bounding box.
#[derive(Clone, Copy, Debug)]
pub struct BoxedFace {
    corners: [DVec3; 3],
    min: DVec3,
    max: DVec3,
}

impl BoxedFace {
    /// Computes the box of a face.
    pub fn new(corners: [DVec3; 3]) -> Self {
        let [a, b, c] = corners;
        Self { corners, min: a.min(b).min(c), max: a.max(b).max(c) }
    }
}

/// A few faces in a list; each whose box is near enough is tried.
pub(super) struct Few<'a>(pub(super) &'a [BoxedFace]);

impl Target for Few<'_> {
    #[inline]
    fn count(&self) -> usize {
        self.0.len()
    }
    #[inline]
    fn corners(&self, face: u32) -> [DVec3; 3] {
        self.0[face as usize].corners
    }
    #[inline(always)]
    fn visit_near(&self, p: DVec3, mut bound_sq: f64, mut visit: impl FnMut(u32) -> Option<f64>) {
        for (i, face) in self.0.iter().enumerate() {
            let outside = (face.min - p).max(p - face.max).max(DVec3::ZERO);
            if outside.length_squared() < bound_sq {
                bound_sq = visit(i as u32).unwrap_or(bound_sq);
            }
        }
    }
    fn closest(&self, p: DVec3, _: &mut Hint) -> Option<SlotHit> {
        let to = |slot: usize| triangle::nearest(p, self.0[slot].corners).distance_sq;
        let nearest = (0..self.0.len()).map(|slot| (to(slot), slot)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(SlotHit { slot: nearest.1 as u32, distance_sq: nearest.0 })
    }
}
