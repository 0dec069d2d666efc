//! Crossings of line segments with the faces of the tree.
//!
//! Boxes are tested in single precision with a margin for its rounding, so none is skipped in error; triangles
//! are tested in double precision.

use glam::DVec3;

use super::{Bvh, BvhNode, NODE_WIDTH, STACK_SIZE};
use crate::ids::FaceId;

/// A crossing of a segment with a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The face.
    pub face: FaceId,
    /// Position along the segment, from 0 at its start to 1 at its end.
    pub along: f64,
    /// Barycentric weights of the corners of the face; none negative, sum 1.
    pub weights: [f64; 3],
    /// True if the segment arrives at the front of the face, from which its corners are counter-clockwise.
    pub is_front: bool,
}

/// Margin for a point in single precision, in the unit frame, where coordinates are at most 1: a few times its
/// rounding error.
const BOX_MARGIN: f32 = 4e-7;
/// Barycentric weights down to this are inside: a segment through an edge must not slip between two faces.
const EDGE_TOLERANCE: f64 = 1e-10;
/// Components of a direction are at least this long, so that their inverse is finite.
const MIN_COMPONENT: f32 = 1e-18;

/// A segment for box tests.
struct Slabs {
    origin: [f32; 3],
    inverse: [f32; 3],
    margin: [f32; 3],
}

impl Slabs {
    fn new(origin: DVec3, along: DVec3) -> Self {
        let component = |x: f64| {
            let x = x as f32;
            if x.abs() < MIN_COMPONENT { MIN_COMPONENT.copysign(x) } else { x }
        };
        let inverse = along.to_array().map(|x| 1.0 / component(x));
        // The origin may lie outside of the unit frame: its rounding error grows with it.
        let scale = origin.abs().max_element().max(1.0) as f32;
        Self {
            origin: origin.as_vec3().to_array(),
            inverse,
            margin: inverse.map(|x| (x * BOX_MARGIN * scale).abs()),
        }
    }

    /// Marks the boxes of a node that the segment enters.
    #[inline(always)]
    fn enter(&self, node: &BvhNode) -> [bool; NODE_WIDTH] {
        let (mut near, mut far) = ([0f32; NODE_WIDTH], [1f32; NODE_WIDTH]);
        for k in 0..3 {
            for lane in 0..NODE_WIDTH {
                let a = (node.min[k][lane] - self.origin[k]) * self.inverse[k];
                let b = (node.max[k][lane] - self.origin[k]) * self.inverse[k];
                let (low, high) = if a < b { (a, b) } else { (b, a) };
                let (low, high) = (low - self.margin[k], high + self.margin[k]);
                near[lane] = if low > near[lane] { low } else { near[lane] };
                far[lane] = if high < far[lane] { high } else { far[lane] };
            }
        }
        // Empty boxes are infinite the wrong way round, so their ends are swapped above: the order of their
        // bounds tells them apart.
        std::array::from_fn(|lane| near[lane] <= far[lane] && node.min[0][lane] <= node.max[0][lane])
    }
}

impl Bvh {
    /// Calls `visit` with each crossing of the segment between two points, in no particular order, until it
    /// returns false. A face that contains the segment is not crossed. A crossing on an edge may be found on
    /// both of its faces. Nothing is found for points that are not finite. Cost: O(log n) for short segments.
    pub fn crossings(&self, from: [f64; 3], to: [f64; 3], mut visit: impl FnMut(Crossing) -> bool) {
        let (origin, end) = (self.frame.unit_from_user(from), self.frame.unit_from_user(to));
        let along = end - origin;
        self.visit_boxes(origin, along, |slot| {
            let Some(crossing) = self.crossing(slot, origin, along) else { return true };
            visit(crossing)
        });
    }

    /// True if the segment between two points crosses a face. Cost: O(log n), mostly.
    pub fn is_blocked(&self, from: [f64; 3], to: [f64; 3]) -> bool {
        let mut is_blocked = false;
        self.crossings(from, to, |_| {
            is_blocked = true;
            false
        });
        is_blocked
    }

    #[inline(always)]
    fn visit_boxes(&self, origin: DVec3, along: DVec3, mut visit_slot: impl FnMut(u32) -> bool) {
        if self.is_empty() || !origin.is_finite() || !along.is_finite() {
            return;
        }
        let slabs = Slabs::new(origin, along);
        let mut stack = [0u32; STACK_SIZE];
        stack[0] = (self.nodes.len() - 1) as u32;
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let node = stack[waiting] as usize;
            let entered = slabs.enter(&self.nodes[node]);
            let is_leaf = node < self.leaf_count;
            let first =
                if is_leaf { (node * NODE_WIDTH) as u32 } else { self.first_child[node - self.leaf_count] };
            for (lane, _) in entered.iter().enumerate().filter(|(_, is_entered)| **is_entered) {
                let child = first + lane as u32;
                if !is_leaf {
                    stack[waiting] = child;
                    waiting += 1;
                } else if !visit_slot(child) {
                    return;
                }
            }
        }
    }

    /// Source: [Möller-Trumbore 1997].
    #[inline]
    fn crossing(&self, slot: u32, origin: DVec3, along: DVec3) -> Option<Crossing> {
        let [a, b, c] = self.slot_corners(slot);
        let (ab, ac) = (b - a, c - a);
        let q = along.cross(ac);
        let det = ab.dot(q);
        if det == 0.0 {
            return None;
        }
        let inverse = 1.0 / det;
        let s = origin - a;
        let u = s.dot(q) * inverse;
        if !(-EDGE_TOLERANCE..=1.0 + EDGE_TOLERANCE).contains(&u) {
            return None;
        }
        let r = s.cross(ab);
        let v = along.dot(r) * inverse;
        if v < -EDGE_TOLERANCE || u + v > 1.0 + EDGE_TOLERANCE {
            return None;
        }
        let at = ac.dot(r) * inverse;
        if !(0.0..=1.0).contains(&at) {
            return None;
        }
        let weights = [1.0 - u - v, u, v].map(|x| x.max(0.0));
        let sum: f64 = weights.iter().sum();
        Some(Crossing {
            face: self.slot_face(slot),
            along: at,
            weights: weights.map(|x| x / sum),
            is_front: det > 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::shapes;
    use crate::spatial::Bvh;

    #[test]
    fn a_line_through_a_ball_enters_and_leaves() {
        let tree = Bvh::new(&shapes::icosphere(5).surface());
        for k in 0..200 {
            // Lines in all directions through points inside, some along the axes.
            let angle = f64::from(k) * 0.7;
            let (s, c) = if k < 4 {
                [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][k as usize]
            } else {
                (libm::sin(angle), libm::cos(angle))
            };
            let d = [c, s, if k % 3 == 0 { 0.0 } else { 0.3 }];
            let shift = [0.01 * f64::from(k % 7), 0.003 * f64::from(k % 5), 0.02];
            let [from, to] = [-3.0, 3.0].map(|t| [0, 1, 2].map(|i| shift[i] + t * d[i]));
            let mut found = Vec::new();
            tree.crossings(from, to, |c| {
                found.push(c);
                true
            });
            found.sort_by(|a, b| a.along.total_cmp(&b.along));
            found.dedup_by(|b, a| b.along - a.along < 1e-9);
            assert_eq!(found.len(), 2, "{k}");
            assert!(found[0].is_front && !found[1].is_front, "{k}");
            for crossing in found {
                let p = [0, 1, 2].map(|i| from[i] + crossing.along * (to[i] - from[i]));
                let radius = p.iter().map(|x| x * x).sum::<f64>().sqrt();
                assert!((0.98..=1.0 + 1e-9).contains(&radius), "{radius}");
            }
            assert!(tree.is_blocked(from, to) && !tree.is_blocked(shift, shift.map(|x| x + 0.1)));
        }
        assert!(!tree.is_blocked([f64::NAN; 3], [1.0; 3]));
    }

    #[test]
    fn no_face_of_a_flat_sheet_is_missed() {
        let sheet = shapes::grid(8);
        let tree = Bvh::new(&sheet.surface());
        let bounds = tree.bounds().unwrap();
        for k in 0..400 {
            let at =
                |axis: usize, share: f64| bounds.min[axis] + share * (bounds.max[axis] - bounds.min[axis]);
            // Also exactly on edges and corners.
            let (x, y) = (at(0, f64::from(k % 17) / 16.0), at(1, f64::from(k / 17 % 17) / 16.0));
            let z = at(2, 0.5);
            assert!(tree.is_blocked([x, y, z + 1.0], [x, y, z - 1.0]), "{x} {y}");
        }
    }
}
