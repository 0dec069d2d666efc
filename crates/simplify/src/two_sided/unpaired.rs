//! Sheets whose two sides have different triangles, so that none lies on another.

use glam::{DVec3, Vec3};
use lodsmith_core::{DisjointSets, VertexId};

/// Largest mean distance between the sides, in the unit frame: about a millionth of the diagonal.
const MAX_GAP: f64 = 1.7e-6;
/// Largest share of the area of a part by which its two sides may differ as seen from anywhere.
const MAX_NET_AREA_SHARE: f64 = 1e-3;
/// Smallest area, in squared gaps: what is smaller is detail of the size of the gap. (Guessed.)
const MIN_AREA_GAPS: f64 = 1e6;

/// Counts the connected parts whose sides lie on each other: faces of opposite windings that enclose nothing. Cost: O(n).
pub(super) fn count(points: &[Vec3], faces: &[[VertexId; 3]]) -> usize {
    let mut parts = DisjointSets::new(points.len());
    for [a, b, c] in faces {
        parts.join(a.0, b.0);
        parts.join(b.0, c.0);
    }
    let mut sums: Vec<Sums> = vec![Sums::default(); points.len()];
    for t in faces {
        let part = parts.find(t[0].0) as usize;
        // From a point of the part, so that small ones far from the origin lose nothing.
        let origin = points[part];
        let [a, b, c] = t.map(|v| (points[v.index()] - origin).as_dvec3());
        sums[part].add(a, (b - a).cross(c - a));
    }
    sums.iter().filter(|part| part.is_flat()).count()
}

/// Sums over the faces of a part.
#[derive(Clone, Copy, Default)]
struct Sums {
    /// Normals of double area.
    normal: DVec3,
    /// Twice the area.
    area: f64,
    /// Six times the volume between the faces and the origin.
    volume: f64,
}

impl Sums {
    fn add(&mut self, point: DVec3, normal: DVec3) {
        self.normal += normal;
        self.area += normal.length();
        self.volume += normal.dot(point);
    }
    fn is_flat(&self) -> bool {
        let is_large = self.area > MIN_AREA_GAPS * MAX_GAP * MAX_GAP;
        // A volume between two sides of half of the area each.
        let gap = 2.0 / 3.0 * self.volume.abs() / self.area;
        is_large && self.normal.length() <= MAX_NET_AREA_SHARE * self.area && gap <= MAX_GAP
    }
}
