//! One triangle: its nearest point to another point, its area and its barycentric coordinates.

use glam::DVec3;

/// The point of a triangle that lies nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The point on the triangle.
    pub point: DVec3,
    /// Squared distance between the two.
    pub distance_sq: f64,
}

/// A triangle whose height is less than this fraction of its longest edge is treated as its three edges: the
/// rounding of the cross product could rotate its normal by more than 1e-6. (Calculated: a product of doubles
/// is off by 1e-16 of the longest edge squared.)
const NEEDLE_HEIGHT: f64 = 1e-10;

/// Below this relative height the normal is off by more than 1e-13, too much for a lever as long as the
/// triangle.
const THIN_HEIGHT: f64 = 1e-3;

/// Finds the point of a triangle that lies nearest to `point`.
///
/// The corners may be in any order and may coincide: a triangle without area is the segment or the point that
/// it covers. A needle thinner than 1e-10 of its length is treated as its edges, so the distance may be too
/// large by its width. Coordinates should lie between 1e-50 and 1e50 (see
/// [`UnitFrame`](crate::geometry::UnitFrame)); beyond, products leave the range of a double. Never NaN for
/// finite corners and point within that range.
///
/// Source: the inside test is by triple products with the normal, whose error grows with the thinness of the triangle;
/// the usual products of edge lengths [Ericson 2005] lose twice as many digits.
// Forced: otherwise the compiler does not inline it into the tree's loop, which costs 4 % of a query
// (measured).
#[inline(always)]
pub fn nearest(point: DVec3, corners: [DVec3; 3]) -> Nearest {
    let [a, b, c] = corners;
    let (ab, bc, ca) = (b - a, c - b, a - c);
    let (ap, bp, cp) = (point - a, point - b, point - c);
    let normal = bc.cross(ca);
    let normal_sq = normal.length_squared();
    let longest_sq = ab.length_squared().max(bc.length_squared()).max(ca.length_squared());
    // A negative triple product means the outward side of an edge. Points on an edge go to the edge case,
    // which is exactly 0 at its ends.
    let sides = [normal.dot(ab.cross(ap)), normal.dot(bc.cross(bp)), normal.dot(ca.cross(cp))];
    let is_inside = sides[0] > 0.0 && sides[1] > 0.0 && sides[2] > 0.0;
    // False also for zero area and NaN.
    let is_solid = normal_sq > THIN_HEIGHT * THIN_HEIGHT * longest_sq * longest_sq;
    if !is_solid {
        let is_needle = normal_sq <= NEEDLE_HEIGHT * NEEDLE_HEIGHT * longest_sq * longest_sq;
        return nearest_thin(point, corners, if is_inside && !is_needle { normal } else { DVec3::ZERO });
    }
    if is_inside {
        let along = normal.dot(ap) / normal_sq;
        return Nearest { point: point - normal * along, distance_sq: along * along * normal_sq };
    }
    // If the projection lies outside, the nearest point is on an edge that has it on its outward side.
    let mut best = Nearest { point: a, distance_sq: f64::INFINITY };
    for (start, edge, from_start, side) in
        [(a, ab, ap, sides[0]), (b, bc, bp, sides[1]), (c, ca, cp, sides[2])]
    {
        if side <= 0.0 {
            try_segment(start, edge, from_start, &mut best);
        }
    }
    best
}

/// Nearest point of a very thin triangle; `normal` is zero unless the projection lies inside.
#[cold]
fn nearest_thin(point: DVec3, [a, b, c]: [DVec3; 3], normal: DVec3) -> Nearest {
    let mut best = Nearest { point: a, distance_sq: f64::INFINITY };
    for (start, end) in [(a, b), (b, c), (c, a)] {
        try_segment(start, end - start, point - start, &mut best);
    }
    if normal != DVec3::ZERO {
        // The lever starts at the nearest point of an edge: it is short, or perpendicular to the triangle.
        let normal_sq = normal.length_squared();
        let along = normal.dot(point - best.point) / normal_sq;
        let distance_sq = along * along * normal_sq;
        if distance_sq < best.distance_sq {
            best = Nearest { point: point - normal * along, distance_sq };
        }
    }
    best
}

#[inline(always)]
fn try_segment(start: DVec3, edge: DVec3, from_start: DVec3, best: &mut Nearest) {
    let length_sq = edge.length_squared();
    let t = if length_sq > 0.0 { (from_start.dot(edge) / length_sq).clamp(0.0, 1.0) } else { 0.0 };
    let distance_sq = (from_start - edge * t).length_squared();
    if distance_sq < best.distance_sq {
        *best = Nearest { point: start + edge * t, distance_sq };
    }
}

/// Returns the normal of a triangle, with twice the area as its length; zero if the rounding of the corners
/// determines it.
#[inline]
pub fn double_area_normal(corners: [DVec3; 3]) -> DVec3 {
    let [a, b, c] = corners;
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let longest_sq = ab.length_squared().max(ac.length_squared()).max((c - b).length_squared());
    // As for a needle, but at the limit of double precision.
    if normal.length() > 1e-14 * longest_sq { normal } else { DVec3::ZERO }
}

/// Returns the barycentric coordinates of a point on a triangle; the coordinates of the nearest corner if it
/// has no area.
pub fn weights_at(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let n = (b - a).cross(c - a);
    let area = n.length_squared();
    if area > 0.0 {
        let (u, v) = ((c - b).cross(p - b).dot(n) / area, (a - c).cross(p - c).dot(n) / area);
        return [u, v, 1.0 - u - v].map(|x| x.clamp(0.0, 1.0));
    }
    let d = [a, b, c].map(|q| (p - q).length_squared());
    if d[0] <= d[1] && d[0] <= d[2] {
        [1.0, 0.0, 0.0]
    } else if d[1] <= d[2] {
        [0.0, 1.0, 0.0]
    } else {
        [0.0, 0.0, 1.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }

    fn random_point(state: &mut u64) -> DVec3 {
        DVec3::new(random(state), random(state), random(state))
    }

    /// Smallest distance, by a search over the segments parallel to bc: the distance is convex in their
    /// offset.
    fn by_search(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
        let to_segment = |u: f64| {
            let (start, edge) = (a + (b - a) * u, (c - b) * u);
            let length_sq = edge.length_squared();
            let t = if length_sq > 0.0 { ((p - start).dot(edge) / length_sq).clamp(0.0, 1.0) } else { 0.0 };
            (p - start - edge * t).length()
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..120 {
            let (u, v) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if to_segment(u) < to_segment(v) { high = v } else { low = u }
        }
        to_segment(low).min(to_segment(high)).min(to_segment(1.0)).min(to_segment(0.0))
    }

    fn check(p: DVec3, t: [DVec3; 3], tolerance: f64) {
        let got = nearest(p, t);
        let wanted = by_search(p, t);
        assert!(
            (got.distance_sq.sqrt() - wanted).abs() < tolerance,
            "{p} {t:?}: {got:?}, search says {wanted}"
        );
        assert!(((p - got.point).length() - got.distance_sq.sqrt()).abs() < 1e-12, "{p} {t:?} {got:?}");
    }

    #[test]
    fn random_triangles_agree_with_a_search() {
        let s = &mut 1;
        for _ in 0..400 {
            let t = [random_point(s), random_point(s), random_point(s)];
            check(random_point(s) * 2.0, t, 1e-6);
        }
    }

    #[test]
    fn triangles_without_area_are_segments_and_points() {
        let s = &mut 2;
        for _ in 0..200 {
            let (a, b, p) = (random_point(s), random_point(s), random_point(s) * 2.0);
            for t in
                [[a, a, a], [a, a, b], [a, b, a], [b, a, a], [a, b, a.lerp(b, 0.3)], [a.lerp(b, 0.3), a, b]]
            {
                check(p, t, 1e-6);
            }
            assert_eq!(nearest(p, [a; 3]).distance_sq, (p - a).length_squared());
        }
    }

    #[test]
    fn slivers_of_any_thinness_agree_with_a_search() {
        let s = &mut 3;
        for power in 1..17 {
            let width = 10f64.powi(-power);
            for _ in 0..60 {
                let (a, b) = (random_point(s), random_point(s));
                let c = a.lerp(b, random(s) * 0.5 + 0.5) + random_point(s) * width;
                check(random_point(s), [a, b, c], 1e-6);
                // Near the middle of the sliver, where choosing the side is hardest.
                check(a.lerp(b, 0.5) + random_point(s) * width, [a, b, c], 1e-8f64.max(width * 1e-3));
            }
        }
    }

    #[test]
    fn corners_and_inner_points_are_at_no_distance() {
        let t = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for p in [t[0], t[1], t[2], DVec3::new(0.25, 0.25, 0.0), DVec3::new(0.5, 0.5, 0.0)] {
            assert_eq!(nearest(p, t), Nearest { point: p, distance_sq: 0.0 });
        }
        assert_eq!(nearest(DVec3::new(0.25, 0.25, 2.0), t).distance_sq, 4.0);
        assert_eq!(nearest(DVec3::new(-3.0, -4.0, 0.0), t), Nearest { point: t[0], distance_sq: 25.0 });
    }

    #[test]
    fn a_needle_has_no_area() {
        let t = [DVec3::ZERO, DVec3::X, DVec3::Y * 2.0];
        assert_eq!(double_area_normal(t), DVec3::Z * 2.0);
        let third = DVec3::ONE / 3.0;
        assert_eq!(double_area_normal([DVec3::ZERO, DVec3::ONE, third]), DVec3::ZERO);
    }
}
