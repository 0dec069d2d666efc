//! Convex pieces of a face.

use glam::DVec3;

/// A value at a corner of a piece, linear on the piece; nothing where the limit is the same everywhere.
pub(super) trait CornerValue: Copy + Default + Send + Sync {
    /// The value on the way to another corner.
    fn towards(self, other: Self, share: f64) -> Self;
}

impl CornerValue for () {
    #[inline(always)]
    fn towards(self, (): (), _: f64) {}
}

impl CornerValue for f64 {
    #[inline]
    fn towards(self, other: f64, share: f64) -> f64 {
        self + (other - self) * share
    }
}

/// Maximum number of corners of a piece. A cut adds one, and a face has three cuts.
pub(super) const MAX_CORNERS: usize = 10;
/// Pieces with more corners than this are split without adding any.
const MAX_CORNERS_BEFORE_CUT: usize = MAX_CORNERS - 3;

/// A flat convex polygon.
#[derive(Clone, Copy)]
pub(super) struct Piece<V = ()> {
    corners: [DVec3; MAX_CORNERS],
    values: [V; MAX_CORNERS],
    count: usize,
    /// A near face, as the first guess.
    pub(super) near: u32,
    /// True if that face alone is known not to suffice.
    pub(super) is_tried: bool,
    /// The face along whose prism it was cut last, and inside of which it lies.
    pub(super) cut_by: u32,
}

impl<V: CornerValue> Piece<V> {
    pub(super) fn of_face(face: [DVec3; 3], values: [V; 3], near: u32) -> Self {
        Self::of(&face, &values, near)
    }

    fn of(corners: &[DVec3], values: &[V], near: u32) -> Self {
        let (mut own, mut own_values) = ([DVec3::ZERO; MAX_CORNERS], [V::default(); MAX_CORNERS]);
        own[..corners.len()].copy_from_slice(corners);
        own_values[..values.len()].copy_from_slice(values);
        let count = corners.len();
        Self { corners: own, values: own_values, count, near, is_tried: false, cut_by: u32::MAX }
    }

    pub(super) fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// The values at the corners.
    pub(super) fn values(&self) -> &[V] {
        &self.values[..self.count]
    }

    pub(super) fn middle(&self) -> DVec3 {
        self.corners().iter().sum::<DVec3>() / self.count as f64
    }

    /// Returns the largest distance of a corner from a point.
    pub(super) fn radius(&self, point: DVec3) -> f64 {
        self.corners().iter().map(|p| p.distance_squared(point)).fold(0.0, f64::max).sqrt()
    }

    /// True if there is room for the corners that three cuts add.
    pub(super) fn has_room(&self) -> bool {
        self.count <= MAX_CORNERS_BEFORE_CUT
    }

    /// True if it has the same corners as another piece.
    pub(super) fn has_same_corners(&self, other: &Self) -> bool {
        self.corners() == other.corners()
    }

    /// Splits the piece at a plane, returning the part against `out` first; `None` if one of them extends
    /// less than `sliver` from the plane.
    pub(super) fn cut(&self, at: DVec3, out: DVec3, sliver: f64) -> Option<(Self, Self)> {
        let mut side = [0.0; MAX_CORNERS];
        let (mut lowest, mut highest) = (0.0f64, 0.0f64);
        for (side, p) in side.iter_mut().zip(self.corners()) {
            *side = (*p - at).dot(out);
            (lowest, highest) = (lowest.min(*side), highest.max(*side));
        }
        if highest <= sliver || lowest >= -sliver || self.count == MAX_CORNERS {
            return None;
        }
        let mut parts = [Self::of(&[], &[], self.near), Self::of(&[], &[], self.near)];
        let [within, beyond] = &mut parts;
        for k in 0..self.count {
            let next = (k + 1) % self.count;
            let (p, q) = (self.corners[k], self.corners[next]);
            let (value, next_value) = (self.values[k], self.values[next]);
            let (a, b) = (side[k], side[next]);
            if a <= 0.0 {
                within.push(p, value);
            }
            if a >= 0.0 {
                beyond.push(p, value);
            }
            if a < 0.0 && b > 0.0 || a > 0.0 && b < 0.0 {
                let between = p + (q - p) * (a / (a - b));
                let value = value.towards(next_value, a / (a - b));
                within.push(between, value);
                beyond.push(between, value);
            }
        }
        let [within, beyond] = parts;
        Some((within, beyond))
    }

    fn push(&mut self, p: DVec3, value: V) {
        self.corners[self.count] = p;
        self.values[self.count] = value;
        self.count += 1;
    }

    /// Splits the piece in two: through the middle between the two corners that are farthest apart, or along
    /// a diagonal if there are many corners.
    pub(super) fn halves(&self) -> [Self; 2] {
        if !self.has_room() {
            return self.by_diagonal();
        }
        let mut longest = (0.0, DVec3::ZERO, DVec3::ZERO);
        for (k, p) in self.corners().iter().enumerate() {
            for q in &self.corners()[..k] {
                let d = p.distance_squared(*q);
                if d > longest.0 {
                    longest = (d, *p, *q);
                }
            }
        }
        let (_, p, q) = longest;
        match self.cut((p + q) * 0.5, (q - p).normalize_or_zero(), 0.0) {
            Some((one, other)) => [one, other],
            None => self.by_diagonal(),
        }
    }

    fn by_diagonal(&self) -> [Self; 2] {
        let half = self.count / 2;
        let mut other = Self::of(&self.corners[half..self.count], &self.values[half..self.count], self.near);
        other.push(self.corners[0], self.values[0]);
        [Self::of(&self.corners[..=half], &self.values[..=half], self.near), other]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area<V: CornerValue>(piece: &Piece<V>) -> f64 {
        let c = piece.corners();
        (2..c.len()).map(|k| (c[k - 1] - c[0]).cross(c[k] - c[0]).length() / 2.0).sum()
    }

    #[test]
    fn parts_make_up_the_whole() {
        let corners = [DVec3::ZERO, DVec3::X * 3.0, DVec3::new(1.0, 2.0, 0.5)];
        let linear = |p: DVec3| 0.5 + p.dot(DVec3::new(0.1, 0.2, 0.4));
        let mut pieces = vec![Piece::of_face(corners, corners.map(linear), 0)];
        let whole = area(&pieces[0]);
        for k in 0..40 {
            let at = DVec3::new(0.1 + 0.05 * f64::from(k), 0.3, 0.0);
            let out = DVec3::new(f64::from(k).cos(), f64::from(k).sin(), 0.2).normalize_or_zero();
            let cut = |p: Piece<f64>| match p.cut(at, out, 1e-6) {
                Some((a, b)) if p.has_room() => vec![a, b],
                _ => p.halves().to_vec(),
            };
            pieces = pieces.into_iter().flat_map(cut).take(3000).collect();
            let sum: f64 = pieces.iter().map(area).sum();
            assert!(pieces.len() == 3000 || (sum - whole).abs() < 1e-12, "{k}: {sum} of {whole}");
        }
        assert!(pieces.iter().all(|p| p.count >= 3 && p.count <= MAX_CORNERS));
        let is_linear = |(p, x): (&DVec3, &f64)| (linear(*p) - x).abs() < 1e-12;
        assert!(pieces.iter().all(|p| p.corners().iter().zip(p.values()).all(is_linear)));
    }

    #[test]
    fn halves_are_smaller() {
        let mut piece = Piece::of_face([DVec3::ZERO, DVec3::X, DVec3::X * 0.5], [(); 3], 0);
        for _ in 0..20 {
            piece = piece.halves()[0];
        }
        assert!(piece.radius(piece.middle()) < 1e-4);
    }
}
