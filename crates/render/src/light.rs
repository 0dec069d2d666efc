//! Lights.

use glam::Vec3;

/// A light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Kind and position.
    pub kind: LightKind,
    /// Linear colour times intensity.
    pub color: [f32; 3],
    /// True if it is fixed in the world; else positions and directions are in camera coordinates.
    pub in_world: bool,
}

/// Kind and position of a light. Lengths are in radii of the model, from its centre, so a preset fits every
/// model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Infinitely far away.
    Directional {
        /// Direction from the model to the light.
        to_light: Vec3,
    },
    /// In all directions from a position, with inverse-square falloff.
    Point {
        /// The position.
        at: Vec3,
    },
    /// In a cone from a position, with inverse-square falloff.
    Spot {
        /// The position.
        at: Vec3,
        /// The point that it is aimed at.
        toward: Vec3,
        /// Half the angle of the cone; the outer fifth fades out.
        half_angle_rad: f32,
    },
}

/// Hemispherical ambient light: linear, from above and from below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambient {
    /// Light on faces that face up.
    pub above: [f32; 3],
    /// Light on faces that face down.
    pub below: [f32; 3],
}

/// All lights of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Lighting {
    /// Ambient light.
    pub ambient: Ambient,
    /// Individual lights.
    pub lights: Vec<Light>,
}

impl Default for Lighting {
    /// A key light over the camera's left shoulder, a weak fill light from the right, and a sky.
    fn default() -> Self {
        let from = |x: f32, y: f32, z: f32| LightKind::Directional { to_light: Vec3::new(x, y, z) };
        let light = |kind, strength: f32| Light { kind, color: [strength; 3], in_world: false };
        Self {
            ambient: Ambient { above: [0.32, 0.34, 0.38], below: [0.14, 0.13, 0.12] },
            lights: vec![light(from(-0.45, 0.65, 0.75), 0.85), light(from(0.8, 0.1, 0.35), 0.22)],
        }
    }
}
