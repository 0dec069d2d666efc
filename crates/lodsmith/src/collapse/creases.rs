//! Sharp edges of the input as feature lines, stored as bits of the faces on both sides.
//!
//! A bit stays with its face, so collapses need no update: when two edges become one, each of the two
//! remaining faces has the bit of its own edge, and either bit makes the new edge a feature.

use glam::{DVec3, Vec3};
use lodsmith_core::VertexId;
use lodsmith_core::sorted::sort_pairs;

use super::ring::{Corner, Spoke};
use super::store::Store;
use crate::cost::metric::VertexMemory;

/// Twice the area over the squared longest edge below which a face has no reliable normal: rounding to single
/// precision may have turned it. (Guessed: a height of a ten-thousandth of a percent of the length.)
const MIN_NORMAL_SHAPE: f64 = 1e-6;

/// Returns for each face the bits of its edges whose two faces meet at more than an angle, in degrees; bit k
/// is the edge from corner k to the next one. `None` if there are no such edges. Edges with any other number
/// of faces have no bits: they are features anyway. Cost: O(n log n).
pub(crate) fn sharp_edges(points: &[Vec3], faces: &[[VertexId; 3]], deg: f64) -> Option<Vec<u8>> {
    // The ends of each edge, and its corner.
    let mut edges: Vec<(u64, u32)> = Vec::with_capacity(3 * faces.len());
    for (f, t) in faces.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges.push((u64::from(a.min(b).0) << 32 | u64::from(a.max(b).0), (3 * f + k) as u32));
        }
    }
    sort_pairs(&mut edges);
    let corner = |c: u32| Corner::new(c as usize / 3, c as usize % 3);
    let cos = libm::cos(deg.to_radians());
    let mut bits = vec![0u8; faces.len()];
    let mut any = false;
    for sides in edges.chunk_by(|a, b| a.0 == b.0) {
        let &[(_, one), (_, other)] = sides else { continue };
        let [one, other] = [one, other].map(corner);
        let [Some(n), Some(m)] = [one, other].map(|c| normal(points, &faces[c.face()])) else { continue };
        // Faces of opposite winding have their common edge in the same direction.
        let is_turned = faces[one.face()][one.k()] == faces[other.face()][other.k()];
        if n.dot(if is_turned { -m } else { m }) < cos {
            [one, other].iter().for_each(|c| bits[c.face()] |= 1 << c.k());
            any = true;
        }
    }
    any.then_some(bits)
}

fn normal(points: &[Vec3], t: &[VertexId; 3]) -> Option<DVec3> {
    let [a, b, c] = t.map(|v| points[v.index()].as_dvec3());
    let n = (b - a).cross(c - a);
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    (n.length() > MIN_NORMAL_SHAPE * longest).then(|| n.normalize_or_zero())
}

impl<Q: VertexMemory> Store<Q> {
    /// True if the edge from corner k of a face to the next one (`next`) or to the previous one is marked
    /// sharp in that face.
    #[inline(always)]
    pub(super) fn is_sharp(&self, corner: Corner, next: bool) -> bool {
        const EDGE: [[u8; 3]; 2] = [[4, 1, 2], [1, 2, 4]];
        let bit = |bits: &Vec<u8>| bits[corner.face()] & EDGE[usize::from(next)][corner.k()] != 0;
        self.creases.as_ref().is_some_and(bit)
    }

    /// True if any edge from the centre of a star is sharp.
    pub(super) fn meets_creases(&self, ring: &[Spoke]) -> bool {
        self.creases.is_some()
            && ring.iter().any(|r| self.is_sharp(r.corner, true) || self.is_sharp(r.corner, false))
    }
}
