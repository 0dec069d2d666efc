//! From where two models are looked at.

use glam::DVec3;

/// Directions from a model to so many eyes, spread evenly over the sphere: along a spiral from above to below, each a golden
/// section of a turn further. Unit length; the same for the same count.
pub fn directions(count: usize) -> Vec<DVec3> {
    // A full turn over the square of the golden section.
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
            // On a sphere in 24 equal parts, neighbours are some 45 degrees apart.
            assert!((25.0..55.0).contains(&nearest.acos().to_degrees()), "{i}: {nearest}");
        }
        assert_eq!(directions(1), [DVec3::Z]);
        assert!(directions(0).is_empty());
    }
}
