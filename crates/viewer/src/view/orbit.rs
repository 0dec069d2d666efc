//! Orbit camera, and bounding boxes of rotated models. Independent of the window: sessions and the stage use
//! it too.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DMat4, DQuat, DVec3};
use lodsmith_core::Bounds;
use lodsmith_render::{Camera, Lens, StandardView};

/// A camera that orbits a target and never rolls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Point it looks at.
    pub target: DVec3,
    /// Rotation about the vertical axis; 0 looks along -z.
    pub yaw_rad: f64,
    /// Elevation; a quarter turn looks straight down.
    pub pitch_rad: f64,
    /// Distance from the target.
    pub distance: f64,
    /// Vertical field of view.
    pub fov_y_rad: f64,
}

impl Orbit {
    /// Makes one that just fits a box into the picture.
    pub fn fitting(bounds: &Bounds, view: StandardView, aspect: f64) -> Self {
        Self::of(&Camera::fitting(bounds, view, aspect))
    }

    /// Makes one that looks as a camera does; its roll is lost.
    pub fn of(camera: &Camera) -> Self {
        let away = camera.eye - camera.target;
        let distance = away.length().max(1e-30);
        let to_eye = away / distance;
        let pitch_rad = to_eye.y.clamp(-1.0, 1.0).asin();
        // If it looks straight down or up, the yaw is taken from the up vector.
        let flat = if to_eye.y.abs() > 0.99999 { -camera.up_square() * to_eye.y.signum() } else { to_eye };
        let yaw_rad = flat.x.atan2(flat.z);
        let fov_y_rad = match camera.lens {
            Lens::Perspective { fov_y_rad } => fov_y_rad,
            Lens::Parallel { height } => 2.0 * (0.5 * height / distance).atan(),
        };
        Self { target: camera.target, yaw_rad, pitch_rad, distance, fov_y_rad }
    }

    /// Returns the camera.
    pub fn camera(&self) -> Camera {
        let ((sin_yaw, cos_yaw), (sin_pitch, cos_pitch)) = (self.yaw_rad.sin_cos(), self.pitch_rad.sin_cos());
        let to_eye = DVec3::new(cos_pitch * sin_yaw, sin_pitch, cos_pitch * cos_yaw);
        // Perpendicular to the view direction everywhere, at the poles too.
        let up = DVec3::new(-sin_pitch * sin_yaw, cos_pitch, -sin_pitch * cos_yaw);
        let lens = Lens::Perspective { fov_y_rad: self.fov_y_rad };
        Camera { eye: self.target + to_eye * self.distance, target: self.target, up, lens }
    }

    /// Orbits the target.
    pub fn turn(&mut self, right_rad: f64, up_rad: f64) {
        self.yaw_rad = (self.yaw_rad + right_rad).rem_euclid(TAU);
        self.pitch_rad = (self.pitch_rad + up_rad).clamp(-FRAC_PI_2, FRAC_PI_2);
    }

    /// Frames a box from the same direction.
    pub fn frame(&mut self, bounds: &Bounds, aspect: f64) {
        *self = Self::of(&self.camera().framing(bounds, aspect));
    }
}

/// Returns the bounding box of a model that is rotated about the centre of its own box.
pub fn turned_bounds(bounds: &Bounds, turn: DQuat) -> Bounds {
    moved_bounds(bounds, &turn_matrix(bounds, turn))
}

/// Returns a transformed camera.
pub fn moved_camera(camera: &Camera, matrix: &DMat4) -> Camera {
    let [eye, target] = [camera.eye, camera.target].map(|p| matrix.transform_point3(p));
    Camera { eye, target, up: matrix.transform_vector3(camera.up), ..*camera }
}

/// Returns the bounding box of a transformed box.
pub fn moved_bounds(bounds: &Bounds, matrix: &DMat4) -> Bounds {
    if *matrix == DMat4::IDENTITY {
        return *bounds;
    }
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in 0..8 {
        let pick = |k: usize| if corner >> k & 1 == 0 { bounds.min[k] } else { bounds.max[k] };
        let p = matrix.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
        (min, max) = (min.min(p), max.max(p));
    }
    Bounds { min: min.to_array(), max: max.to_array() }
}

/// Returns the matrix of a rotation about the centre of a box.
pub fn turn_matrix(bounds: &Bounds, turn: DQuat) -> DMat4 {
    if turn == DQuat::IDENTITY {
        return DMat4::IDENTITY;
    }
    let [min, max] = [bounds.min, bounds.max].map(DVec3::from);
    let middle = 0.5 * (min + max);
    DMat4::from_translation(middle) * DMat4::from_quat(turn) * DMat4::from_translation(-middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Bounds {
        Bounds { min: [-1.0; 3], max: [1.0; 3] }
    }

    #[test]
    fn an_orbit_looks_as_the_camera_that_it_was_made_of() {
        for view in StandardView::ALL {
            let camera = Camera::fitting(&cube(), view, 1.5);
            let back = Orbit::of(&camera).camera();
            assert!(back.eye.distance(camera.eye) < 1e-9, "{view:?}");
            assert!(back.up_square().distance(camera.up_square()) < 1e-9, "{view:?}");
        }
    }

    #[test]
    fn the_pitch_ends_at_the_poles() {
        let mut orbit = Orbit::fitting(&cube(), StandardView::Front, 1.0);
        orbit.turn(0.0, 10.0);
        assert_eq!(orbit.pitch_rad, FRAC_PI_2);
        assert!(orbit.camera().up_square().is_finite());
    }
}
