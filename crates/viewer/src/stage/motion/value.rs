//! Values of keyframes and their components.

use glam::DVec3;

/// Value of a keyframe.
pub trait KeyframeValue: Copy + PartialEq {
    /// Returns its components for interpolation.
    fn components(&self) -> KeyframeComponents;
    /// Creates a value from interpolated components.
    fn from_components(parts: &KeyframeComponents) -> Self;
    /// Returns the value with all numbers brought into their valid ranges; `None` if it is invalid.
    fn checked(self) -> Option<Self>;
}

/// Components that are interpolated: a position, two angles and a positive size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KeyframeComponents {
    /// Position on the stage.
    pub place: DVec3,
    /// Rotation about the vertical axis, and pitch.
    pub turns_deg: [f64; 2],
    /// Scale or distance.
    pub size: f64,
}
