//! First-person mode of the stage camera: it rotates about the eye instead of the orbit centre.

use glam::DVec3;

use crate::view::orbit::Orbit;

/// Turns the view right and up, keeping the eye in place.
pub fn look(orbit: &mut Orbit, right_rad: f64, up_rad: f64) {
    let eye = orbit.camera().eye;
    orbit.turn(-right_rad, -up_rad);
    put_eye(orbit, eye);
}

/// Moves the camera right, up and forward, parallel to the ground regardless of pitch.
pub fn step(orbit: &mut Orbit, by: DVec3) {
    let (sin, cos) = orbit.yaw_rad.sin_cos();
    let (forward, right) = (DVec3::new(-sin, 0.0, -cos), DVec3::new(cos, 0.0, -sin));
    orbit.target += right * by.x + DVec3::Y * by.y + forward * by.z;
}

/// Puts the eye at a height over the ground, at its present position or, if farther than `within` from the
/// centre, moved in to that distance; `reach` is the distance to the orbit centre.
pub fn start_walking(orbit: &mut Orbit, height: f64, within: f64, reach: f64) {
    let mut eye = orbit.camera().eye;
    let away = eye.x.hypot(eye.z);
    if away > within {
        (eye.x, eye.z) = (eye.x * within / away, eye.z * within / away);
    }
    eye.y = height;
    orbit.pitch_rad = 0.0;
    orbit.distance = reach;
    put_eye(orbit, eye);
}

/// Sets the height of the eye.
pub fn set_height(orbit: &mut Orbit, height: f64) {
    let eye = orbit.camera().eye;
    orbit.target.y += height - eye.y;
}

fn put_eye(orbit: &mut Orbit, eye: DVec3) {
    let camera = orbit.camera();
    orbit.target += eye - camera.eye;
}

#[cfg(test)]
mod tests {
    use lodsmith_core::Bounds;
    use lodsmith_render::StandardView;

    use super::*;

    fn walker() -> Orbit {
        let bounds = Bounds { min: [-10.0, 0.0, -10.0], max: [10.0, 2.0, 10.0] };
        let mut orbit = Orbit::fitting(&bounds, StandardView::Front, 1.5);
        start_walking(&mut orbit, 1.7, 12.0, 2.0);
        orbit
    }

    fn forward(orbit: &Orbit) -> DVec3 {
        let camera = orbit.camera();
        (camera.target - camera.eye).normalize_or_zero()
    }

    #[test]
    fn walking_starts_at_the_border_facing_the_copies() {
        let eye = walker().camera().eye;
        assert!((eye - DVec3::new(0.0, 1.7, 12.0)).length() < 1e-9, "{eye}");
        assert!(forward(&walker()).distance(DVec3::NEG_Z) < 1e-9);
    }

    #[test]
    fn the_eye_stays_while_the_view_turns() {
        let mut orbit = walker();
        let eye = orbit.camera().eye;
        look(&mut orbit, 0.4, 0.2);
        assert!(orbit.camera().eye.distance(eye) < 1e-9);
        let ahead = forward(&orbit);
        assert!(ahead.x > 0.3 && ahead.y > 0.1, "to the right and up: {ahead}");
    }

    #[test]
    fn steps_go_along_the_ground() {
        let mut orbit = walker();
        look(&mut orbit, std::f64::consts::FRAC_PI_2, 0.5);
        let eye = orbit.camera().eye;
        step(&mut orbit, DVec3::new(0.0, 0.0, 3.0));
        let ahead = orbit.camera().eye - eye;
        assert!(ahead.distance(DVec3::X * 3.0) < 1e-9, "{ahead}");
        step(&mut orbit, DVec3::new(1.0, 0.5, 0.0));
        let aside = orbit.camera().eye - eye - ahead;
        assert!(aside.distance(DVec3::new(0.0, 0.5, 1.0)) < 1e-9, "{aside}");
        set_height(&mut orbit, 4.0);
        assert!((orbit.camera().eye.y - 4.0).abs() < 1e-9);
    }
}
