//! Limits that vary over a surface: a distance times a value at each point, linear on each face.

use std::sync::Arc;

use glam::DVec3;

use super::Prepared;
use crate::geometry::triangle;
use crate::ids::FaceId;

/// Values from 0 to 1 on the faces of a prepared surface: the limit at a point is a distance times its value.
#[derive(Clone, Debug)]
pub struct LimitMap {
    /// By slot of the tree of the surface.
    corners: Arc<[[f32; 3]]>,
    floor: f64,
}

/// The surface that a map belongs to: the one whose points are tested, or the one that they have to be near.
#[derive(Clone, Copy, Debug)]
pub enum MapSide<'a> {
    /// The value at a tested point counts.
    From(&'a LimitMap),
    /// The value at the point closest to a tested point counts.
    To(&'a LimitMap),
}

impl LimitMap {
    /// Takes the values at the corners of the faces of a surface, by face; each is from 0 to 1.
    ///
    /// Cost: O(n).
    pub fn new(of: &Prepared, corners: impl Fn(FaceId) -> [f32; 3]) -> Self {
        let tree = of.tree();
        let slots = 0..tree.face_count() as u32;
        Self { corners: slots.map(|slot| corners(tree.slot_face(slot))).collect(), floor: 0.0 }
    }

    /// Returns the map with its values raised from 0..=1 to `floor`..=1, in proportion.
    pub fn with_floor(&self, floor: f64) -> Self {
        Self { corners: Arc::clone(&self.corners), floor: floor.clamp(0.0, 1.0) }
    }

    /// Returns the least value on the faces that may lie within a distance of a point; 1 if there are none. Both are in
    /// the units of the surface.
    pub fn least_near(&self, to: &Prepared, point: [f64; 3], distance: f64) -> f64 {
        let tree = to.tree();
        let distance = tree.frame().unit_length(distance);
        let mut least = 1f64;
        tree.visit(tree.frame().unit_from_user(point), (distance * distance).next_up(), |slot| {
            least = self.of_slot(slot).into_iter().fold(least, f64::min);
            None
        });
        least
    }

    /// The values at the corners of a slot.
    pub(super) fn of_slot(&self, slot: u32) -> [f64; 3] {
        self.corners[slot as usize].map(|x| self.floor + (1.0 - self.floor) * f64::from(x))
    }

    /// Returns the value on a slot, with these corners, at its point that is closest to `p`, all in one unit.
    pub(super) fn at(&self, slot: u32, corners: [DVec3; 3], p: DVec3) -> f64 {
        let shares = triangle::weights_at(triangle::nearest(p, corners).point, corners);
        self.of_slot(slot).iter().zip(shares).map(|(x, share)| x * share).sum()
    }
}
