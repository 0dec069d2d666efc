//! Placement of a copy on the stage.

use serde::{Deserialize, Serialize};

/// Position, rotation and scale of a copy of the model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// X coordinate on the ground.
    pub x: f64,
    /// Z coordinate on the ground; positive is towards a viewer in front.
    pub z: f64,
    /// Rotation about the vertical axis in degrees, counter-clockwise seen from above.
    #[serde(default)]
    pub turn_deg: f64,
    /// Scale relative to the model.
    #[serde(default = "one")]
    pub scale: f64,
}

fn one() -> f64 {
    1.0
}

/// Range of scales of a copy.
pub const SCALE_RANGE: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// Maximum number of copies on a stage. They take up to 10 ms of a frame. (Measured while walking.)
pub const MAX_COPIES: usize = 20_000;

impl Placement {
    /// Creates a copy of scale 1.
    pub fn at(x: f64, z: f64) -> Self {
        Self { x, z, turn_deg: 0.0, scale: 1.0 }
    }

    /// Returns the placement with all numbers brought into their valid ranges; `None` if a number is not
    /// finite or the scale is not positive.
    pub fn checked(self) -> Option<Self> {
        let is_number = [self.x, self.z, self.turn_deg, self.scale].iter().all(|v| v.is_finite());
        (is_number && self.scale > 0.0).then(|| Self {
            turn_deg: self.turn_deg.rem_euclid(360.0),
            scale: self.scale.clamp(*SCALE_RANGE.start(), *SCALE_RANGE.end()),
            ..self
        })
    }
}
