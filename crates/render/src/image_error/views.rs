//! Cameras for comparing two models.

use glam::DVec3;
use lodsmith_core::Bounds;

use crate::camera::{Camera, StandardView};

/// Returns `count` cameras around a box, distributed evenly over the sphere, each with all of the box in a
/// picture of `aspect` (width over height). Deterministic.
pub fn cameras(bounds: &Bounds, count: usize, aspect: f64) -> Vec<Camera> {
    let usual = Camera::fitting(bounds, StandardView::Front, aspect);
    let from = |to_eye: DVec3| Camera { eye: usual.target + to_eye, ..usual }.framing(bounds, aspect);
    directions(count).into_iter().map(from).collect()
}

/// Returns `count` directions to eyes: along a spiral from above to below, each a golden angle further. Unit
/// length.
fn directions(count: usize) -> Vec<DVec3> {
    // A full turn divided by the square of the golden ratio.
    let golden_angle_rad = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let direction = |i: usize| {
        let y = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
        let (sin, cos) = (golden_angle_rad * i as f64).sin_cos();
        let r = (1.0 - y * y).max(0.0).sqrt();
        DVec3::new(r * sin, y, r * cos)
    };
    (0..count).map(direction).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eyes_are_spread_evenly() {
        let all = directions(24);
        assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-12));
        assert!(all.iter().sum::<DVec3>().length() < 0.5);
        for (i, a) in all.iter().enumerate() {
            let nearest =
                all.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, b)| a.dot(*b)).fold(-1.0, f64::max);
            // On a sphere divided into 24 equal parts, neighbours are some 45 degrees apart.
            assert!((25.0..55.0).contains(&nearest.acos().to_degrees()), "{i}: {nearest}");
        }
        assert_eq!(directions(1), [DVec3::Z]);
        assert!(directions(0).is_empty());
    }

    #[test]
    fn cameras_see_the_box_from_all_sides() {
        let bounds = Bounds { min: [1.0, 2.0, 3.0], max: [3.0, 8.0, 4.0] };
        let all = cameras(&bounds, 9, 1.5);
        assert_eq!(all.len(), 9);
        let center = DVec3::new(2.0, 5.0, 3.5);
        let distance = all[0].distance();
        for (camera, to_eye) in all.iter().zip(directions(9)) {
            assert!((camera.target - center).length() < 1e-9 && (camera.distance() - distance).abs() < 1e-9);
            assert!(((camera.eye - center) / distance - to_eye).length() < 1e-9);
        }
    }
}
