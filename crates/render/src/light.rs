//! What a model is lit by.

use glam::Vec3;

/// A light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Where it is.
    pub kind: LightKind,
    /// Linear colour times strength.
    pub color: [f32; 3],
    /// Whether it stands still while the camera moves; else places and directions are in the camera's coordinates.
    pub in_world: bool,
}

/// Where a light is. Lengths are in radii of the model, from its centre: a preset fits every model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// So far away that it comes from one direction.
    Directional {
        /// From the model to the light.
        to_light: Vec3,
    },
    /// To all sides from a place, weaker with the square of the distance.
    Point {
        /// The place.
        at: Vec3,
    },
    /// In a cone from a place, weaker with the square of the distance.
    Spot {
        /// The place.
        at: Vec3,
        /// Where it points.
        toward: Vec3,
        /// Half the angle of the cone; the outer fifth fades.
        half_angle_rad: f32,
    },
}

/// The light that comes from everywhere: linear, from above and from below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambient {
    /// On faces that look up.
    pub above: [f32; 3],
    /// On faces that look down.
    pub below: [f32; 3],
}

/// All the light there is.
#[derive(Clone, Debug, PartialEq)]
pub struct Lighting {
    /// From everywhere.
    pub ambient: Ambient,
    /// From somewhere.
    pub lights: Vec<Light>,
}

impl Default for Lighting {
    /// A key light over the camera's left shoulder, a weak one from the right, and a sky.
    fn default() -> Self {
        let from = |x: f32, y: f32, z: f32| LightKind::Directional { to_light: Vec3::new(x, y, z) };
        let light = |kind, strength: f32| Light { kind, color: [strength; 3], in_world: false };
        Self {
            ambient: Ambient { above: [0.32, 0.34, 0.38], below: [0.14, 0.13, 0.12] },
            lights: vec![light(from(-0.45, 0.65, 0.75), 0.85), light(from(0.8, 0.1, 0.35), 0.22)],
        }
    }
}
