//! Closest point on a triangle, in single precision, for the inner loops. (`core::measure`, which judges the
//! results, has its own in double precision.)

use glam::Vec3;

/// Returns the squared distance from `q` to the triangle a b c, and the closest point there. [Ericson 2005]
#[inline(always)]
pub(crate) fn closest(q: Vec3, a: Vec3, b: Vec3, c: Vec3) -> (f32, Vec3) {
    let at = |p: Vec3| ((q - p).length_squared(), p);
    let (ab, ac, aq) = (b - a, c - a, q - a);
    let (d1, d2) = (ab.dot(aq), ac.dot(aq));
    if d1 <= 0.0 && d2 <= 0.0 {
        return at(a);
    }
    let bq = q - b;
    let (d3, d4) = (ab.dot(bq), ac.dot(bq));
    if d3 >= 0.0 && d4 <= d3 {
        return at(b);
    }
    let cq = q - c;
    let (d5, d6) = (ab.dot(cq), ac.dot(cq));
    if d6 >= 0.0 && d5 <= d6 {
        return at(c);
    }
    if d1 >= 0.0 && d3 <= 0.0 && d1 * d4 <= d3 * d2 {
        return at(a + ab * (d1 / (d1 - d3)));
    }
    if d2 >= 0.0 && d6 <= 0.0 && d5 * d2 <= d1 * d6 {
        return at(a + ac * (d2 / (d2 - d6)));
    }
    if d4 >= d3 && d5 >= d6 && d3 * d6 <= d5 * d4 {
        return at(b + (c - b) * ((d4 - d3) / (d4 - d3 + d5 - d6)));
    }
    let n = ab.cross(ac);
    let (h, n2) = (n.dot(aq), n.length_squared().max(1e-37));
    (h * h / n2, q - n * (h / n2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_edges_and_the_inside_are_found() {
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        for (q, p) in [
            (Vec3::new(-1.0, -1.0, 0.0), a),
            (Vec3::new(2.0, -1.0, 0.0), b),
            (Vec3::new(0.5, -1.0, 0.0), Vec3::new(0.5, 0.0, 0.0)),
            (Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.5, 0.5, 0.0)),
            (Vec3::new(0.2, 0.2, 3.0), Vec3::new(0.2, 0.2, 0.0)),
        ] {
            let (d2, found) = closest(q, a, b, c);
            assert!(
                (found - p).length() < 1e-6 && (d2 - (q - p).length_squared()).abs() < 1e-5,
                "{q} {found}"
            );
        }
    }
}
