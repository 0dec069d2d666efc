//! Affine maps, and the scale of a mesh that several of them place.

/// An affine map: three rows of four.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine(pub(super) [[f64; 4]; 3]);

impl Affine {
    pub(super) const IDENTITY: Self =
        Self([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);

    /// Returns the composition: first `inner`, then this.
    pub(super) fn after(&self, inner: &Self) -> Self {
        let (a, b) = (&self.0, &inner.0);
        Self([0, 1, 2].map(|r| {
            [0, 1, 2, 3].map(|c| {
                let moved = if c == 3 { a[r][3] } else { 0.0 };
                a[r][0] * b[0][c] + a[r][1] * b[1][c] + a[r][2] * b[2][c] + moved
            })
        }))
    }

    #[inline]
    pub(super) fn point(&self, p: [f64; 3]) -> [f64; 3] {
        self.0.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3])
    }

    pub(super) fn translation(&self) -> [f64; 3] {
        self.0.map(|r| r[3])
    }

    /// Returns the signed volume of the unit cube's image; negative for a mirror.
    pub(super) fn determinant(&self) -> f64 {
        let m = &self.0;
        let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    }

    /// Returns the largest factor by which it scales a length: its largest singular value.
    pub(super) fn largest_scale(&self) -> f64 {
        let m = &self.0;
        let column = |c: usize| [m[0][c], m[1][c], m[2][c]];
        let largest = (0..3).flat_map(column).fold(0f64, |a, x| a.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) {
            return largest;
        }
        // Scaled first, so that squares neither overflow nor underflow.
        let dot = |a: usize, b: usize| {
            (0..3).map(|k| column(a)[k] / largest * (column(b)[k] / largest)).sum::<f64>()
        };
        let (a, b, c) = (dot(0, 0), dot(1, 1), dot(2, 2));
        let (d, e, f) = (dot(0, 1), dot(1, 2), dot(0, 2));
        // Largest eigenvalue of the symmetric matrix of dot products, by the trigonometric formula.
        let mean = (a + b + c) / 3.0;
        let spread =
            ((a - mean).powi(2) + (b - mean).powi(2) + (c - mean).powi(2) + 2.0 * (d * d + e * e + f * f))
                / 6.0;
        let p = spread.sqrt();
        // Guessed: a spread this small is rounding error, and the matrix a rotation with uniform scale.
        if p <= 1e-12 * mean {
            return largest * mean.sqrt();
        }
        let [a, b, c] = [a, b, c].map(|x| (x - mean) / p);
        let [d, e, f] = [d, e, f].map(|x| x / p);
        let half_det = (a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)) / 2.0;
        let angle = half_det.clamp(-1.0, 1.0).acos() / 3.0;
        largest * (mean + 2.0 * p * angle.cos()).max(0.0).sqrt()
    }

    /// Returns the dot products of the columns of its linear part, divided by `scale` first.
    fn dot_products(&self, scale: f64) -> Symmetric {
        let column = |c: usize| self.0.map(|row| row[c] / scale);
        let dot = |a: usize, b: usize| column(a).iter().zip(column(b)).map(|(x, y)| x * y).sum();
        [dot(0, 0), dot(1, 1), dot(2, 2), dot(0, 1), dot(1, 2), dot(0, 2)]
    }

    /// Returns the matrix for normals: the inverse transpose up to a positive factor.
    pub(super) fn normal_matrix(&self) -> [[f64; 3]; 3] {
        let m = &self.0;
        let sign = if self.determinant() < 0.0 { -1.0 } else { 1.0 };
        let cofactor = |r: usize, c: usize| {
            let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
            sign * (m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1])
        };
        [0, 1, 2].map(|r| [0, 1, 2].map(|c| cofactor(r, c)))
    }

    /// Returns the map that first scales, then rotates by a quaternion, then moves.
    pub(super) fn of_parts(t: [f64; 3], q: [f64; 4], s: [f64; 3]) -> Self {
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        // Quaternions should have length one; rounded ones only nearly do.
        let [x, y, z, w] = if length > 0.0 { q.map(|c| c / length) } else { [0.0, 0.0, 0.0, 1.0] };
        let rotation = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ];
        Self([0, 1, 2].map(|r| [rotation[r][0] * s[0], rotation[r][1] * s[1], rotation[r][2] * s[2], t[r]]))
    }
}

/// The scale of a mesh over all its placements.
#[derive(Default)]
pub(super) struct Lengths {
    largest: f64,
    /// Dot products of the columns of the first map, divided by its largest scale squared.
    shape: Option<Symmetric>,
    /// False if the maps stretch the mesh in different ways.
    is_one_shape: bool,
}

/// Entries xx, yy, zz, xy, yz, xz of a symmetric matrix.
type Symmetric = [f64; 6];

/// The dot products of an isometry.
const UNSTRETCHED: Symmetric = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0];
/// Two maps stretch alike if these dot products differ by less: by a thousandth of the lengths. (Guessed: far above the
/// rounding of files, and no distance in a report is that precise.)
const SAME_SHAPE: f64 = 2e-3;
/// A map whose determinant is below this, with a largest scale of one, flattens. (Guessed: the flattened direction
/// keeps half of the digits of double precision.)
const MIN_DETERMINANT: f64 = 1e-6;

impl Lengths {
    /// Adds a place.
    pub(super) fn add(&mut self, place: &Affine) {
        let scale = place.largest_scale();
        self.largest = self.largest.max(scale);
        let shape = place.dot_products(scale);
        match &self.shape {
            None => (self.shape, self.is_one_shape) = (Some(shape), true),
            // (NaN is not near to anything.)
            Some(first) => self.is_one_shape &= is_near(first, &shape),
        }
    }

    /// Returns the largest factor by which a place scales a length; `None` without any place.
    pub(super) fn scale(&self) -> Option<f64> {
        self.shape.map(|_| self.largest)
    }

    /// Returns a map under which the mesh has the same lengths as at its largest placement, as the rows of an upper
    /// triangular matrix. `None` if one factor describes all lengths, if the places stretch the mesh in different ways,
    /// and if they flatten it.
    pub(super) fn stretch(&self) -> Option<[[f64; 3]; 3]> {
        let shape = self.shape.filter(|shape| self.is_one_shape && !is_near(shape, &UNSTRETCHED))?;
        // The Cholesky factor of the matrix of dot products.
        let [xx, yy, zz, xy, yz, xz] = shape;
        let a = xx.sqrt();
        let (b, c) = (xy / a, xz / a);
        let d = (yy - b * b).sqrt();
        let e = (yz - b * c) / d;
        let f = (zz - c * c - e * e).sqrt();
        let is_sound = a * d * f >= MIN_DETERMINANT && self.largest.is_finite();
        is_sound.then(|| [[a, b, c], [0.0, d, e], [0.0, 0.0, f]].map(|row| row.map(|x| x * self.largest)))
    }
}

fn is_near(a: &Symmetric, b: &Symmetric) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME_SHAPE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_scale() {
        let near = |m: [[f64; 4]; 3], wanted: f64| {
            let got = Affine(m).largest_scale();
            assert!((got - wanted).abs() <= 1e-9 * wanted.max(1e-300), "{got} for {wanted}");
        };
        near(Affine::IDENTITY.0, 1.0);
        near([[0.0, -2.0, 0.0, 9.0], [3.0, 0.0, 0.0, 9.0], [0.0, 0.0, -5.0, 9.0]], 5.0);
        near([[1e-200, 0.0, 0.0, 0.0], [0.0, 2e-200, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]], 2e-200);
        near([[0.0; 4]; 3], 0.0);
        // A shear by one: the golden ratio.
        near([[1.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]], (1.0 + 5f64.sqrt()) / 2.0);
    }

    #[test]
    fn lengths_cover_all_placements() {
        let lengths = |places: &[Affine]| {
            let mut lengths = Lengths::default();
            places.iter().for_each(|place| lengths.add(place));
            lengths
        };
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let at = |scale: [f64; 3]| Affine::of_parts([7.0, 0.0, 0.0], [0.0, half, 0.0, half], scale);
        assert_eq!((lengths(&[]).scale(), lengths(&[]).stretch()), (None, None));
        let even = lengths(&[at([2.0; 3]), at([3.0; 3]), at([-1.0; 3])]);
        assert!((even.scale().unwrap() - 3.0).abs() < 1e-12 && even.stretch().is_none());
        // One shape in two sizes, and mirrored: the largest counts.
        let two = lengths(&[at([1.0, 4.0, 2.0]), at([-2.0, 8.0, 4.0])]);
        let got = two.stretch().unwrap();
        let wanted = [[2.0, 0.0, 0.0], [0.0, 8.0, 0.0], [0.0, 0.0, 4.0]];
        assert!((two.scale().unwrap() - 8.0).abs() < 1e-12);
        assert!(
            got.iter().flatten().zip(wanted.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-9),
            "{got:?}"
        );
        // Two shapes, and a flat one: only the largest factor is known.
        let other = lengths(&[at([1.0, 4.0, 2.0]), at([4.0, 1.0, 2.0])]);
        assert!((other.scale().unwrap() - 4.0).abs() < 1e-12 && other.stretch().is_none());
        assert!(lengths(&[at([1.0, 1.0, 0.0])]).stretch().is_none());
        // Lengths under a shear are preserved.
        let shear = Affine([[1.0, 2.0, 0.0, 0.0], [0.0, 1.0, 0.5, 0.0], [0.0, 0.0, 3.0, 0.0]]);
        let upper = lengths(&[shear]).stretch().unwrap();
        for p in [[1.0, 2.0, 3.0], [-3.0, 0.5, 1.0]] {
            let length = |rows: [[f64; 3]; 3]| {
                rows.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2])
                    .iter()
                    .map(|x| x * x)
                    .sum::<f64>()
                    .sqrt()
            };
            let (got, wanted) = (length(upper), length(shear.0.map(|r| [r[0], r[1], r[2]])));
            assert!((got - wanted).abs() < 1e-9, "{got} for {wanted}");
        }
    }
}
