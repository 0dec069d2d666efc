//! Sheets whose two sides have different triangles, so that no triangle lies on another.

use glam::{DVec3, Vec3};
use lodsmith_core::VertexId;

use crate::chunks;
use crate::collapse::components;

/// Largest mean distance between the sides, in the unit frame: about a millionth of the diagonal.
const MAX_GAP: f64 = 1.7e-6;
/// Largest difference between the areas of the two sides of a part, as seen from any direction, as a share of
/// its area.
const MAX_NET_AREA_SHARE: f64 = 1e-3;
/// Smallest area, in squared gaps: smaller parts are detail of the size of the gap. (Guessed.)
const MIN_AREA_GAPS: f64 = 1e6;
/// Number of faces that are summed together.
const FACES_TOGETHER: usize = 1 << 13;

/// Counts the connected parts whose sides lie on each other: faces of opposite windings that enclose nothing. Cost: O(n).
pub(super) fn count(points: &[Vec3], faces: &[[VertexId; 3]]) -> usize {
    let part_of = components::labels_of_ordered(points.len(), faces);
    let part = |t: &[VertexId; 3]| part_of[t[0].index()] as usize;
    // A point of each part, so that small parts far from the origin lose no digits.
    let mut origins: Vec<Vec3> = Vec::new();
    for (&part, &p) in part_of.iter().zip(points) {
        if part as usize == origins.len() {
            origins.push(p);
        }
    }
    // Sums over faces of one part that follow each other.
    let runs = chunks::each(faces.len().div_ceil(FACES_TOGETHER), |k| {
        let faces = &faces[k * FACES_TOGETHER..faces.len().min((k + 1) * FACES_TOGETHER)];
        let sums_of = |same: &[[VertexId; 3]]| {
            let part = part(&same[0]);
            let mut sums = Sums::default();
            same.iter().for_each(|t| sums.add(t.map(|v| points[v.index()] - origins[part])));
            (part, sums)
        };
        faces.chunk_by(|a, b| part(a) == part(b)).map(sums_of).collect::<Vec<_>>()
    });
    let mut sums = vec![Sums::default(); origins.len()];
    for (part, run) in runs.into_iter().flatten() {
        sums[part].area += run.area;
        sums[part].volume += run.volume;
    }
    let is_thin: Vec<bool> = sums.iter().map(Sums::is_thin).collect();
    if !is_thin.contains(&true) {
        return 0;
    }
    let mut normals = vec![(DVec3::ZERO, 0.0); sums.len()];
    for t in faces.iter().filter(|t| is_thin[part(t)]) {
        let [a, b, c] = t.map(|v| points[v.index()].as_dvec3());
        let normal = (b - a).cross(c - a);
        let own = &mut normals[part(t)];
        *own = (own.0 + normal, own.1 + normal.length());
    }
    let is_sheet = |(net, area): &(DVec3, f64)| {
        *area > MIN_AREA_GAPS * MAX_GAP * MAX_GAP && net.length() <= MAX_NET_AREA_SHARE * area
    };
    normals.iter().filter(|part| is_sheet(part)).count()
}

/// Sums over the faces of a part, with few operations for each.
#[derive(Clone, Copy, Default)]
struct Sums {
    /// Twice the area, or up to √3 times as much.
    area: f64,
    /// Six times the volume between the faces and the origin.
    volume: f64,
}

impl Sums {
    #[inline(always)]
    fn add(&mut self, [a, b, c]: [Vec3; 3]) {
        let normal = (b - a).cross(c - a);
        self.area += f64::from(normal.abs().element_sum());
        self.volume += f64::from(normal.dot(a));
    }
    /// True if the sides are almost coincident, assuming two sides with half of the area each.
    fn is_thin(&self) -> bool {
        2.0 / 3.0 * self.volume.abs() <= MAX_GAP * self.area
    }
}
