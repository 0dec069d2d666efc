//! Area and volume.

use crate::mesh::Surface;

/// Area and volume of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Size {
    /// Sum of the areas of the faces, in squared units of the positions.
    pub area: f64,
    /// Signed enclosed volume, in cubed units: positive if faces face outward. For an open surface it is the
    /// volume of the cone over it from the middle of its box, and of little use.
    pub volume: f64,
}

/// Computes area and volume; non-finite faces are left out.
///
/// Sums are taken about the middle of the box, so that meshes far from the origin lose no digits.
/// Cost: O(n).
pub fn size_of(surface: &Surface<'_>) -> Size {
    let positions = surface.positions();
    let mut size = Size::default();
    let Some(bounds) = positions.bounds() else { return size };
    let middle = [0, 1, 2].map(|k| bounds.min[k] / 2.0 + bounds.max[k] / 2.0);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    for t in surface.triangles() {
        let p = t.map(|v| positions.get(v));
        if p.iter().flatten().any(|x| !x.is_finite()) {
            continue;
        }
        let [a, b, c] = p.map(|p| [0, 1, 2].map(|k| p[k] - middle[k]));
        let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        size.area += dot(n, n).sqrt() / 2.0;
        size.volume += dot(a, n) / 6.0;
    }
    size
}
