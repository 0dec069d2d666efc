//! Limits of a proof: the same everywhere, or by the values of a map.
//!
//! The distance to a face is convex, and a value is linear on a piece. So if at each corner of a piece the distance is at
//! most the limit by the value there, it is on all of the piece.
//!
//! With values on the other surface, the closest point decides. Each face of it that may hold the closest point of some
//! point of the piece has to pass one of four tests, all of them for convex functions of the point y, and so at the
//! corners of the piece only (d: distance to the near face, e: to the tested one, s: the part of e along the plane of the
//! tested one; v: its values, continued beyond it, g: their gradient; D: the limit for the value 1):
//!
//! ```text
//! its least value near the piece allows the distance        d(y) ≤ D · least
//! its own distance, if the closest point lies on it         e(y) + D g s(y) ≤ D v(y)
//! the distance to the near face, which is no less           d(y) (1 + D g) ≤ D v(y)
//! the near face is closer than the tested one               d(y) ≤ distance to a plane that the tested one lies behind
//! ```

use glam::DVec3;

use super::map::LimitMap;
use super::piece::{CornerValue, Piece};
use super::target::Target;
use crate::geometry::triangle::{self, double_area_normal};

/// The limit at each place. `limit` is the limit for the value 1.
pub(super) trait Rule: Copy + Sync {
    /// A value at a corner of a piece, from which its limit follows; `()` where none is needed.
    type Value: CornerValue;
    /// True if the limit is the same everywhere.
    const IS_UNIFORM: bool;
    /// Returns the limit at a value.
    fn at(self, limit: f64, value: Self::Value) -> f64;
    /// Returns the limit at the middle of a piece, or an upper bound of it.
    fn at_middle(self, limit: f64, piece: &Piece<Self::Value>) -> f64;
    /// Returns a lower bound of the limit on all of a piece.
    fn at_all(self, limit: f64, piece: &Piece<Self::Value>) -> f64;
    /// Returns a length in proportion to the limits of a piece near a face, for cuts.
    fn near_face<T: Target>(self, to: &T, face: u32, piece: &Piece<Self::Value>, limit: f64) -> f64;
    /// True if a point is known to be beyond its limit; `face` is the one closest to it, at this height.
    fn is_beyond<T: Target>(self, _to: &T, _face: u32, _point: DVec3, _height_and_limit: (f64, f64)) -> bool {
        false
    }
    /// True if all of a piece is within its limit, given that all of its corners are within those of `at`, of one face.
    fn holds<T: Target>(self, _to: &T, _piece: &Piece<Self::Value>, _face: u32, _limit: f64) -> bool {
        true
    }
}

/// One limit everywhere.
#[derive(Clone, Copy)]
pub(super) struct Everywhere;

impl Rule for Everywhere {
    type Value = ();
    const IS_UNIFORM: bool = true;
    #[inline(always)]
    fn at(self, limit: f64, (): ()) -> f64 {
        limit
    }
    #[inline(always)]
    fn at_middle(self, limit: f64, _: &Piece) -> f64 {
        limit
    }
    #[inline(always)]
    fn at_all(self, limit: f64, _: &Piece) -> f64 {
        limit
    }
    #[inline(always)]
    fn near_face<T: Target>(self, _: &T, _: u32, _: &Piece, limit: f64) -> f64 {
        limit
    }
}

/// By the values at the corners of the tested face.
#[derive(Clone, Copy)]
pub(super) struct ByCorners;

impl Rule for ByCorners {
    type Value = f64;
    const IS_UNIFORM: bool = false;
    fn at(self, limit: f64, value: f64) -> f64 {
        limit * value
    }
    fn at_middle(self, limit: f64, piece: &Piece<f64>) -> f64 {
        let values = piece.values();
        limit * (values.iter().sum::<f64>() / values.len() as f64)
    }
    fn at_all(self, limit: f64, piece: &Piece<f64>) -> f64 {
        limit * piece.values().iter().copied().fold(f64::INFINITY, f64::min)
    }
    fn near_face<T: Target>(self, _: &T, _: u32, piece: &Piece<f64>, limit: f64) -> f64 {
        self.at_all(limit, piece)
    }
}

/// By the map of the surface that the tested one has to be near.
#[derive(Clone, Copy)]
pub(super) struct ByFace<'a>(pub(super) &'a LimitMap);

/// A face and its values, continued beyond it.
struct Valued {
    corners: [DVec3; 3],
    values: [f64; 3],
    /// Unit normal, and the gradient of the value in the plane; zero without an area, where the value does not count.
    normal: DVec3,
    gradient: DVec3,
}

impl Valued {
    fn new(corners: [DVec3; 3], values: [f64; 3]) -> Self {
        let normal = double_area_normal(corners);
        let size_sq = normal.length_squared();
        if size_sq == 0.0 {
            return Self { corners, values, normal, gradient: DVec3::ZERO };
        }
        let [a, b, c] = corners;
        let rising = (c - a) * (values[1] - values[0]) - (b - a) * (values[2] - values[0]);
        Self { corners, values, normal: normal.normalize_or_zero(), gradient: rising.cross(normal) / size_sq }
    }

    fn is_flat(&self) -> bool {
        self.normal == DVec3::ZERO
    }

    fn least(&self) -> f64 {
        let [a, b, c] = self.values;
        a.min(b).min(c)
    }

    /// Returns the value at the foot of a point on the plane.
    fn at(&self, p: DVec3) -> f64 {
        self.values[0] + self.gradient.dot(p - self.corners[0])
    }

    fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p - self.corners[0])
    }
}

impl ByFace<'_> {
    fn valued<T: Target>(self, to: &T, face: u32) -> Valued {
        Valued::new(to.corners(face), self.0.of_slot(face))
    }
}

impl Rule for ByFace<'_> {
    type Value = ();
    const IS_UNIFORM: bool = false;
    fn at(self, limit: f64, (): ()) -> f64 {
        limit
    }
    fn at_middle(self, limit: f64, _: &Piece) -> f64 {
        limit
    }
    fn at_all(self, _: f64, _: &Piece) -> f64 {
        // (Not known before the faces around are looked at.)
        f64::NEG_INFINITY
    }
    fn near_face<T: Target>(self, to: &T, face: u32, piece: &Piece, limit: f64) -> f64 {
        let face = self.valued(to, face);
        limit * piece.corners().iter().map(|p| face.at(*p)).fold(1.0, f64::min).max(0.0)
    }

    fn is_beyond<T: Target>(self, to: &T, face: u32, point: DVec3, (height, limit): (f64, f64)) -> bool {
        height > limit * self.0.at(face, to.corners(face), point)
    }

    fn holds<T: Target>(self, to: &T, piece: &Piece, face: u32, limit: f64) -> bool {
        let near = to.corners(face);
        let corners = piece.corners();
        let mut own = [0.0; super::piece::MAX_CORNERS];
        let distances = &mut own[..corners.len()];
        distances
            .iter_mut()
            .zip(corners)
            .for_each(|(d, p)| *d = triangle::nearest(*p, near).distance_sq.sqrt());
        let distances = &*distances;
        let farthest = distances.iter().copied().fold(0.0, f64::max);
        let middle = piece.middle();
        let radius = piece.radius(middle);
        let from_middle = triangle::nearest(middle, near).distance_sq.sqrt();
        // The closest point of any point of the piece is no farther from the middle.
        let reach = farthest.min(from_middle + radius) + radius;
        let piece = TestedPiece { corners, distances, farthest, middle, reach, near, limit };
        if !piece.is_allowed(&self.valued(to, face)) {
            return false;
        }
        let mut all_pass = true;
        to.visit_near(middle, (reach * reach).next_up(), |other| {
            let passes = || {
                let other = self.valued(to, other);
                piece.is_allowed(&other) || piece.is_closer_to_near(&other)
            };
            all_pass = all_pass && (other == face || passes());
            (!all_pass).then_some(0.0)
        });
        all_pass
    }
}

/// A piece, and its distances to the near face.
struct TestedPiece<'a> {
    corners: &'a [DVec3],
    distances: &'a [f64],
    farthest: f64,
    middle: DVec3,
    reach: f64,
    near: [DVec3; 3],
    limit: f64,
}

impl TestedPiece<'_> {
    fn all(&self, test: impl Fn(DVec3, f64) -> bool) -> bool {
        self.corners.iter().zip(self.distances).all(|(p, d)| test(*p, *d))
    }

    /// True if each point of the piece whose closest point lies on the face is within the limit there.
    fn is_allowed(&self, face: &Valued) -> bool {
        let limit = self.limit;
        if self.farthest <= limit * face.least() {
            return true;
        }
        if !face.is_flat() {
            let slope = face.gradient.length();
            let height = face.height(self.middle);
            let aside = (self.reach * self.reach - height * height).max(0.0).sqrt();
            if self.farthest <= limit * (face.at(self.middle) - slope * aside) {
                return true;
            }
            let is_allowed_here = |p: DVec3, _: f64| {
                let height = face.height(p);
                let distance_sq = triangle::nearest(p, face.corners).distance_sq;
                let aside = (distance_sq - height * height).max(0.0).sqrt();
                distance_sq.sqrt() + limit * slope * aside <= limit * face.at(p)
            };
            let is_allowed_near = |p: DVec3, d: f64| d * (1.0 + limit * slope) <= limit * face.at(p);
            return self.all(is_allowed_near) || self.all(is_allowed_here);
        }
        false
    }

    /// True if no point of the piece is closer to the face than to the near one; not for the near one itself, of which
    /// that is trivially true.
    fn is_closer_to_near(&self, face: &Valued) -> bool {
        let hit = triangle::nearest(self.middle, face.corners);
        if hit.distance_sq > self.reach * self.reach {
            return true;
        }
        // Planes that the face lies behind: the one at its closest point, and those along the sides of the near one.
        let away = (self.middle - hit.point).normalize_or_zero();
        if away != DVec3::ZERO && self.all(|p, d| d <= away.dot(p - hit.point)) {
            return true;
        }
        let normal = double_area_normal(self.near).normalize_or_zero();
        (0..3).any(|k| {
            let inwards = normal.cross(self.near[(k + 1) % 3] - self.near[k]).normalize_or_zero();
            let front = face.corners.iter().map(|p| inwards.dot(*p)).fold(f64::NEG_INFINITY, f64::max);
            inwards != DVec3::ZERO && self.all(|p, d| d <= inwards.dot(p) - front)
        })
    }
}
