//! The unit frame: scales every mesh to the same size, near the origin, so that a tolerance means the same
//! for a bolt and for a city.

use glam::DVec3;

use crate::mesh::Bounds;

/// A translation and a uniform scaling that bring a mesh near the origin, at a size near 1.
///
/// For a position near the mesh the translation is exact, because nearby doubles have exact differences. The
/// scaling of [`UnitFrame::of`] is exact too, since its scale is a power of two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitFrame {
    centre: DVec3,
    unit_per_user: f64,
    user_per_unit: f64,
}

// Powers of two beyond this would leave the range of a double when they are inverted.
const LARGEST_EXPONENT: i32 = 1000;

impl UnitFrame {
    /// Returns the frame that brings a box into the cube from -1 to 1. A box without extent is only translated.
    pub fn of(bounds: &Bounds) -> Self {
        let (min, max) = (DVec3::from(bounds.min), DVec3::from(bounds.max));
        // Halved first: the difference of two huge coordinates may overflow.
        let centre = min * 0.5 + max * 0.5;
        let half = (max * 0.5 - min * 0.5).max_element();
        let exponent = if half > 0.0 { libm::log2(half).floor() as i32 + 1 } else { 0 };
        let exponent = exponent.clamp(-LARGEST_EXPONENT, LARGEST_EXPONENT);
        Self { centre, unit_per_user: 2f64.powi(-exponent), user_per_unit: 2f64.powi(exponent) }
    }
    /// Returns the frame in which `centre` is the origin, and `size` user units are 1. Rounds, but makes the most
    /// of single precision: boxes of all sizes end up equally large.
    pub const fn with_size(centre: [f64; 3], size: f64) -> Self {
        Self { centre: DVec3::from_array(centre), unit_per_user: 1.0 / size, user_per_unit: size }
    }
    /// Converts a position from the user's units to the frame.
    #[inline]
    pub fn unit_from_user(&self, position: [f64; 3]) -> DVec3 {
        (DVec3::from(position) - self.centre) * self.unit_per_user
    }
    /// Converts a position from the frame to the user's units.
    #[inline]
    pub fn user_from_unit(&self, position: DVec3) -> [f64; 3] {
        (position * self.user_per_unit + self.centre).to_array()
    }
    /// Converts a length from the frame to the user's units.
    #[inline]
    pub fn user_length(&self, length: f64) -> f64 {
        length * self.user_per_unit
    }
    /// Converts a length from the user's units to the frame.
    #[inline]
    pub fn unit_length(&self, length: f64) -> f64 {
        length / self.user_per_unit
    }
    /// Converts a position from this frame to another. More exact than going through the user's units, where
    /// a sample far from the origin would be rounded to the precision of its large coordinates.
    #[inline]
    pub fn to(&self, other: &UnitFrame, position: DVec3) -> DVec3 {
        (position * self.user_per_unit + (self.centre - other.centre)) * other.unit_per_user
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_fills_the_unit_cube() {
        for (at, size) in [(0.0, 1.0), (5e5, 3.0), (-1e15, 7e14), (0.0, 1e-300), (0.0, 1e300), (1.0, 0.0)] {
            let bounds = Bounds { min: [at; 3], max: [at + size, at, at] };
            let frame = UnitFrame::of(&bounds);
            let corner = frame.unit_from_user(bounds.max);
            let wanted = if size > 0.0 { 0.49..=1.0 } else { 0.0..=0.0 };
            assert!(wanted.contains(&corner.x), "{at} {size} {corner}");
            assert_eq!(frame.user_from_unit(corner), bounds.max);
        }
    }
}
