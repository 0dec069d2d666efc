//! Bounding volume hierarchy over the faces of a surface, with eight boxes per node, for nearest-point
//! queries.
//!
//! ```text
//! level 2                      [ 8 boxes ]                      the last node of the list is the root
//! level 1      [ 8 boxes ] [ 8 boxes ] … [ 8 boxes ]            node k of a level holds nodes 8k … 8k+7 of the next
//! level 0   [8 faces] [8 faces] …                               node k holds slots 8k … 8k+7
//! ```
//!
//! The faces are assigned to *slots* by median splits, so every node but the last of its level is full and no
//! child pointers are needed. Boxes are single precision and rounded outwards, the bound they are compared
//! with is rounded upwards: a box may be opened unnecessarily, but is never skipped in error. The result is
//! decided by the distance to the triangle, in double precision and in the unit frame of the surface.

mod rays;

use glam::DVec3;

pub use rays::Crossing;

use crate::geometry::UnitFrame;
use crate::geometry::triangle::{self, Nearest};
use crate::ids::{FaceId, VertexId};
use crate::mesh::{Bounds, Surface};

/// Boxes per node. Eight fill two 128-bit registers per coordinate, which every 64-bit machine has; 4
/// measured slower.
const NODE_WIDTH: usize = 8;

/// Stack size: each level adds at most seven nodes, and 2^32 faces make eleven levels.
const STACK_SIZE: usize = 7 * 11 + 2;

/// Rounding error of single precision: at most half a step (2^-24) in each of the six operations from a box
/// to a squared distance; squaring doubles it. This is twice that.
const BOUND_SLACK: f32 = 1.0 + 2e-6;

/// Smallest radius, in the unit frame, with which a search among accepted faces begins: a millionth of the surface,
/// so that twenty doublings reach all of it.
const MIN_SEARCH_RADIUS: f64 = 1e-6;

/// End of a query, as the starting point of the next one.
///
/// Only a hint: it never changes a distance, and it may come from another tree. If several faces are equally
/// near, it decides which one is returned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hint(u32);

impl Hint {
    /// Makes a hint from a slot; any number is allowed.
    pub(crate) fn at(slot: u32) -> Self {
        Self(slot)
    }
}

/// The nearest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The face that it lies on. If several share the point, one of them.
    pub face: FaceId,
    /// The point, in the units of the positions.
    pub point: [f64; 3],
    /// Squared distance to the query point, in the units of the positions. Beyond about 1e±150 it leaves the
    /// range of a double; [`Hit::distance`] does not.
    pub distance_sq: f64,
    /// Distance to the query point, in the units of the positions.
    pub distance: f64,
}

/// A nearest point in the unit frame of the tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlotHit {
    pub(crate) slot: u32,
    pub(crate) distance_sq: f64,
}

#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct BvhNode {
    min: [[f32; NODE_WIDTH]; 3],
    max: [[f32; NODE_WIDTH]; 3],
}

impl BvhNode {
    // Inverted boxes: at an infinite distance from everything.
    const EMPTY: Self =
        Self { min: [[f32::INFINITY; NODE_WIDTH]; 3], max: [[f32::NEG_INFINITY; NODE_WIDTH]; 3] };
}

/// A bounding volume hierarchy over the faces of a surface. Owns its data, so the surface may be dropped.
///
/// Faces with a non-finite corner are left out. Faces without area count as the segment or point that they
/// cover. About 65 bytes per face.
#[derive(Clone, Debug)]
pub struct Bvh {
    frame: UnitFrame,
    bounds: Option<Bounds>,
    /// Level 0 first, the root last.
    nodes: Vec<BvhNode>,
    /// The first child of each node above level 0.
    first_child: Vec<u32>,
    /// Number of nodes of level 0.
    leaf_count: usize,
    /// The face of each slot.
    faces: Vec<FaceId>,
    /// The corners of each slot, as indices into `vertices`.
    corners: Vec<[u32; 3]>,
    /// Positions in the unit frame, in the order of their first use by the slots.
    vertices: Vec<DVec3>,
}

impl Bvh {
    /// Builds the tree of a surface.
    ///
    /// The same surface gives the same tree at any number of threads. Cost: O(n log n) for n faces.
    pub fn new(surface: &Surface<'_>) -> Self {
        let (positions, triangles) = (surface.positions(), surface.triangles());
        let is_finite = |t: &[VertexId; 3]| t.iter().all(|&v| positions.get(v).iter().all(|x| x.is_finite()));
        let mut bounds: Option<Bounds> = None;
        let mut items = Vec::with_capacity(triangles.len());
        for (face, t) in triangles.iter().enumerate() {
            if is_finite(t) {
                items.push(FaceEntry { centre: [0; 3], face: face as u32 });
                let corners = t.iter().map(|&v| positions.get(v));
                bounds = Some(corners.fold(bounds.unwrap_or(Bounds::EMPTY), Bounds::with));
            }
        }
        let frame = UnitFrame::of(&bounds.unwrap_or(Bounds { min: [0.0; 3], max: [0.0; 3] }));
        let unit = |v: VertexId| frame.unit_from_user(positions.get(v));
        for item in &mut items {
            let [a, b, c] = triangles[item.face as usize].map(unit);
            // The centre of the box, in units of 2^-30: integers compare faster and have no NaN.
            let centre = (a.min(b).min(c) + a.max(b).max(c)) * (0.5 * (1u32 << 30) as f64);
            item.centre = centre.to_array().map(|x| x as i32);
        }
        sort_into_slots(&mut items);

        let mut number = vec![u32::MAX; positions.len()];
        let mut vertices = Vec::with_capacity(positions.len().min(items.len() * 3));
        let mut corners = Vec::with_capacity(items.len());
        for item in &items {
            corners.push(triangles[item.face as usize].map(|v| {
                let n = &mut number[v.index()];
                if *n == u32::MAX {
                    *n = vertices.len() as u32;
                    vertices.push(unit(v));
                }
                *n
            }));
        }
        let faces = items.into_iter().map(|item| FaceId(item.face)).collect();
        let mut tree = Self {
            frame,
            bounds,
            nodes: Vec::new(),
            first_child: Vec::new(),
            leaf_count: 0,
            faces,
            corners,
            vertices,
        };
        tree.build_nodes();
        tree
    }

    fn build_nodes(&mut self) {
        self.leaf_count = self.corners.len().div_ceil(NODE_WIDTH);
        for slots in self.corners.chunks(NODE_WIDTH) {
            let mut node = BvhNode::EMPTY;
            for (lane, &[a, b, c]) in slots.iter().enumerate() {
                let [a, b, c] = [a, b, c].map(|v| self.vertices[v as usize]);
                let (min, max) = (a.min(b).min(c).to_array(), a.max(b).max(c).to_array());
                for k in 0..3 {
                    node.min[k][lane] = round_down(min[k]);
                    node.max[k][lane] = round_up(max[k]);
                }
            }
            self.nodes.push(node);
        }
        let mut level = 0..self.nodes.len();
        while level.len() > 1 {
            for first in level.clone().step_by(NODE_WIDTH) {
                let mut node = BvhNode::EMPTY;
                for child in first..(first + NODE_WIDTH).min(level.end) {
                    let below = &self.nodes[child];
                    for k in 0..3 {
                        node.min[k][child - first] =
                            below.min[k].iter().copied().fold(f32::INFINITY, f32::min);
                        node.max[k][child - first] =
                            below.max[k].iter().copied().fold(f32::NEG_INFINITY, f32::max);
                    }
                }
                self.first_child.push(first as u32);
                self.nodes.push(node);
            }
            level = level.end..self.nodes.len();
        }
    }

    /// Number of faces in the tree: all faces of the surface except those with a non-finite corner.
    pub fn face_count(&self) -> usize {
        self.faces.len()
    }
    /// True if no face is in the tree.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }
    /// Returns the bounding box of the faces in the tree, in the units of the positions; `None` if there are
    /// none.
    pub fn bounds(&self) -> Option<Bounds> {
        self.bounds
    }

    /// Finds the point of the surface that lies nearest to `point`.
    ///
    /// Exact up to rounding in double precision. `None` if the tree has no face, or if the point is not
    /// finite or more than 1e100 times the size of the surface away. Cost: O(log n) for a point near the
    /// surface.
    pub fn closest(&self, point: [f64; 3]) -> Option<Hit> {
        self.closest_from(point, &mut Hint::default())
    }

    /// Like [`Bvh::closest`], but faster if the last query with this hint was near: its face is tried first.
    pub fn closest_from(&self, point: [f64; 3], hint: &mut Hint) -> Option<Hit> {
        let p = self.frame.unit_from_user(point);
        let hit = self.closest_slot(p, f64::INFINITY, hint)?;
        Some(self.hit_of(p, hit))
    }

    /// Like [`Bvh::closest_from`], but `None` if nothing is nearer than `distance` (units of the positions).
    pub fn closest_within(&self, point: [f64; 3], distance: f64, hint: &mut Hint) -> Option<Hit> {
        let p = self.frame.unit_from_user(point);
        let distance = self.frame.unit_length(distance);
        let hit = self.closest_slot(p, distance * distance, hint)?;
        Some(self.hit_of(p, hit))
    }

    /// Returns the normal of the face that is nearest to `point`, with twice its area in a frame of size one as its
    /// length; `None` if nothing is nearer than `distance` (units of the positions). The query starts at a slot, as
    /// the tests of [`crate::measure::proof::local`] return it. Cost: as [`Bvh::closest_from`].
    pub fn normal_near(&self, point: [f64; 3], distance: f64, slot: u32) -> Option<DVec3> {
        let p = self.frame.unit_from_user(point);
        let distance = self.frame.unit_length(distance);
        let hit = self.closest_slot(p, distance * distance, &mut Hint::at(slot))?;
        Some(triangle::double_area_normal(self.slot_corners(hit.slot)))
    }

    /// Like [`Bvh::closest`], among the faces for which `accept` is true.
    ///
    /// Cost: as [`Bvh::closest`], plus about four tests for each face that is nearer than the answer, accepted or not;
    /// all faces if none is accepted.
    pub fn closest_of(&self, point: [f64; 3], accept: impl Fn(FaceId) -> bool) -> Option<Hit> {
        self.closest_of_within(point, f64::INFINITY, accept)
    }

    /// Like [`Bvh::closest_of`], but `None` if nothing accepted is nearer than `distance` (units of the
    /// positions).
    pub fn closest_of_within(
        &self,
        point: [f64; 3],
        distance: f64,
        accept: impl Fn(FaceId) -> bool,
    ) -> Option<Hit> {
        let p = self.frame.unit_from_user(point);
        if p.abs().max_element() >= 1e100 || p.is_nan() {
            return None;
        }
        let distance = self.frame.unit_length(distance);
        let limit_sq = distance * distance;
        let nearest = self.closest_accepted(p, limit_sq, |_| true)?;
        if accept(self.slot_face(nearest.slot)) {
            return Some(self.hit_of(p, nearest));
        }
        // Without a bound the search would test most of the rejected faces, wherever they are, before it finds an
        // accepted one: so it searches in growing spheres.
        let [a, b, c] = self.slot_corners(nearest.slot);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let mut radius = (nearest.distance_sq.sqrt() + longest).max(MIN_SEARCH_RADIUS);
        // The corner of the unit cube that is farthest from the centre is less than 2 away.
        let all = p.length() + 2.0;
        loop {
            let bound_sq = if radius < all { limit_sq.min(radius * radius) } else { limit_sq };
            let hit = self.closest_accepted(p, bound_sq, &accept);
            if hit.is_some() || bound_sq >= limit_sq {
                return hit.map(|hit| self.hit_of(p, hit));
            }
            radius *= 2.0;
        }
    }

    /// Returns the nearest accepted slot below a squared distance of a point of the unit frame; of equally near slots,
    /// the first visited, whatever the bound.
    fn closest_accepted(&self, p: DVec3, bound_sq: f64, accept: impl Fn(FaceId) -> bool) -> Option<SlotHit> {
        let mut best = SlotHit { slot: u32::MAX, distance_sq: bound_sq };
        self.visit(p, bound_sq, |slot| {
            let is_nearer = accept(self.slot_face(slot)) && self.try_slot(p, slot, &mut best);
            is_nearer.then_some(best.distance_sq)
        });
        (best.slot != u32::MAX).then_some(best)
    }

    fn hit_of(&self, p: DVec3, hit: SlotHit) -> Hit {
        let Nearest { point, .. } = triangle::nearest(p, self.slot_corners(hit.slot));
        let distance = self.frame.user_length(hit.distance_sq.sqrt());
        Hit {
            face: self.faces[hit.slot as usize],
            point: self.frame.user_from_unit(point),
            distance_sq: self.frame.user_length(self.frame.user_length(hit.distance_sq)),
            distance,
        }
    }

    /// Returns the slot nearest to a point of the unit frame, if its squared distance is below `bound_sq`.
    pub(crate) fn closest_slot(&self, p: DVec3, bound_sq: f64, hint: &mut Hint) -> Option<SlotHit> {
        // Beyond, squares leave the range of a double. Also excludes NaN.
        let within_reach = p.abs().max_element() < 1e100;
        if self.is_empty() || !within_reach || p.is_nan() {
            return None;
        }
        let mut best = SlotHit { slot: u32::MAX, distance_sq: bound_sq };
        let slot = if (hint.0 as usize) < self.corners.len() { hint.0 } else { 0 };
        self.try_slot(p, slot, &mut best);
        let bound_sq = best.distance_sq;
        self.visit(p, bound_sq, |slot| self.try_slot(p, slot, &mut best).then_some(best.distance_sq));
        if best.slot == u32::MAX {
            return None;
        }
        *hint = Hint(best.slot);
        Some(best)
    }

    /// Returns the number of faces that a search from a point of the unit frame tests, if it knows the distance: how
    /// many boxes are nearer. Few, but where many faces meet nearly all.
    pub(crate) fn count_near(&self, p: DVec3) -> usize {
        let Some(hit) = self.closest_slot(p, f64::INFINITY, &mut Hint::default()) else { return 0 };
        let mut count = 0;
        self.visit(p, hit.distance_sq, |_| {
            count += 1;
            None
        });
        count
    }

    /// Calls `visit_face` for the slots whose box lies within a squared distance of a point of the unit
    /// frame; a returned value is the new squared distance. Near boxes are visited first.
    #[inline(always)]
    pub(crate) fn visit(&self, p: DVec3, bound_sq: f64, mut visit_face: impl FnMut(u32) -> Option<f64>) {
        if self.is_empty() {
            return;
        }
        let query = Query::new(p);
        let mut bound = bound_of(bound_sq);

        // Non-negative floats sort like their bits, so one integer holds distance and node and compares
        // directly.
        let mut stack = [0u64; STACK_SIZE];
        stack[0] = (self.nodes.len() - 1) as u64;
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let entry = stack[waiting];
            if f32::from_bits((entry >> 32) as u32) >= bound {
                continue;
            }
            let node = entry as u32 as usize;
            let mut near = [0u64; NODE_WIDTH];
            let is_leaf = node < self.leaf_count;
            let first =
                if is_leaf { (node * NODE_WIDTH) as u32 } else { self.first_child[node - self.leaf_count] };
            let count = query.open(&self.nodes[node], first, bound, &mut near);
            sort_few(&mut near[..count]);
            if is_leaf {
                for &entry in &near[..count] {
                    if f32::from_bits((entry >> 32) as u32) >= bound {
                        break;
                    }
                    if let Some(bound_sq) = visit_face(entry as u32) {
                        bound = bound_of(bound_sq);
                    }
                }
            } else {
                for &entry in near[..count].iter().rev() {
                    stack[waiting] = entry;
                    waiting += 1;
                }
            }
        }
    }

    #[inline]
    fn try_slot(&self, p: DVec3, slot: u32, best: &mut SlotHit) -> bool {
        let Nearest { distance_sq, .. } = triangle::nearest(p, self.slot_corners(slot));
        let nearer = distance_sq < best.distance_sq;
        if nearer {
            *best = SlotHit { slot, distance_sq };
        }
        nearer
    }

    /// The face in a slot.
    #[inline]
    pub(crate) fn slot_face(&self, slot: u32) -> FaceId {
        self.faces[slot as usize]
    }
    /// The corners of the face in a slot, in the unit frame.
    #[inline]
    pub(crate) fn slot_corners(&self, slot: u32) -> [DVec3; 3] {
        self.corners[slot as usize].map(|v| self.vertices[v as usize])
    }
    /// Returns a slot that uses each vertex.
    pub(crate) fn slots_of_vertices(&self) -> Vec<u32> {
        let mut slots = vec![0; self.vertices.len()];
        for (slot, corners) in (0..).zip(&self.corners) {
            corners.iter().for_each(|&v| slots[v as usize] = slot);
        }
        slots
    }
    /// The unit frame of the tree.
    pub(crate) fn frame(&self) -> &UnitFrame {
        &self.frame
    }
    /// The distinct vertices of the faces in the tree, mostly with neighbours close together; in the unit
    /// frame.
    pub(crate) fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }
}

/// A point as a box in single precision that certainly contains it.
struct Query {
    min: [f32; 3],
    max: [f32; 3],
}

impl Query {
    fn new(p: DVec3) -> Self {
        // Clamped: boxes then seem nearer, never farther, and the squares below stay in the range of single
        // precision.
        let p = p.clamp(DVec3::splat(-1e18), DVec3::splat(1e18)).to_array();
        Self { min: p.map(round_down), max: p.map(round_up) }
    }

    /// Lists the boxes nearer than the bound, with distance and node packed in one integer. Returns their
    /// number.
    #[inline]
    fn open(&self, node: &BvhNode, first: u32, bound: f32, near: &mut [u64; NODE_WIDTH]) -> usize {
        let mut distance_sq = [0f32; NODE_WIDTH];
        for k in 0..3 {
            for (lane, sum) in distance_sq.iter_mut().enumerate() {
                // The larger of the two, or zero between them; written so that each compiles to one
                // instruction.
                let below = node.min[k][lane] - self.max[k];
                let above = self.min[k] - node.max[k][lane];
                let gap = if below > above { below } else { above };
                let gap = if gap > 0.0 { gap } else { 0.0 };
                *sum += gap * gap;
            }
        }
        let mut count = 0;
        for (lane, d) in distance_sq.iter().enumerate() {
            // Written always, counted only if near: avoids an unpredictable branch. `count` never exceeds
            // `lane`.
            near[count % NODE_WIDTH] = u64::from(d.to_bits()) << 32 | u64::from(first + lane as u32);
            count += usize::from(*d < bound);
        }
        count
    }
}

/// Returns a single that is certainly above every computed distance of a box that contains something nearer
/// than this.
#[inline]
fn bound_of(distance_sq: f64) -> f32 {
    // A distance of zero cannot be improved, and a bound of 0 rejects everything.
    let d = distance_sq as f32;
    // Below the normal range products have a larger relative rounding error: `f32::MIN_POSITIVE` covers it.
    if distance_sq > 0.0 { (d * BOUND_SLACK + f32::MIN_POSITIVE).min(f32::MAX) } else { 0.0 }
}

#[inline]
fn sort_few(entries: &mut [u64]) {
    for i in 1..entries.len() {
        let entry = entries[i];
        let mut k = i;
        while k > 0 && entries[k - 1] > entry {
            entries[k] = entries[k - 1];
            k -= 1;
        }
        entries[k] = entry;
    }
}

#[inline]
fn round_down(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) > x { y.next_down() } else { y }
}

#[inline]
fn round_up(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) < x { y.next_up() } else { y }
}

/// A face that is being assigned to a slot.
#[derive(Clone, Copy)]
struct FaceEntry {
    centre: [i32; 3],
    face: u32,
}

/// Orders items so that each aligned run of 8, 64, 512 … is spatially compact.
fn sort_into_slots(items: &mut [FaceEntry]) {
    if items.len() <= NODE_WIDTH {
        return;
    }
    let mut run = NODE_WIDTH;
    while run * NODE_WIDTH < items.len() {
        run *= NODE_WIDTH;
    }
    let left = items.len().div_ceil(run) / 2 * run;
    let (mut min, mut max) = ([i32::MAX; 3], [i32::MIN; 3]);
    for item in items.iter() {
        for k in 0..3 {
            min[k] = min[k].min(item.centre[k]);
            max[k] = max[k].max(item.centre[k]);
        }
    }
    let axis = (0..3).max_by_key(|&k| i64::from(max[k]) - i64::from(min[k])).unwrap_or(0);
    // Ties are broken by the face, so the result does not depend on the selection algorithm.
    items.select_nth_unstable_by_key(left, |i| (i.centre[axis], i.face));
    let (left, right) = items.split_at_mut(left);
    both(left, right);
}

#[cfg(all(feature = "rayon", not(target_family = "wasm")))]
fn both(left: &mut [FaceEntry], right: &mut [FaceEntry]) {
    // Below this, starting a task costs more than the sorting (guessed).
    if left.len() > 8192 {
        rayon::join(|| sort_into_slots(left), || sort_into_slots(right));
    } else {
        sort_into_slots(left);
        sort_into_slots(right);
    }
}

#[cfg(not(all(feature = "rayon", not(target_family = "wasm"))))]
fn both(left: &mut [FaceEntry], right: &mut [FaceEntry]) {
    sort_into_slots(left);
    sort_into_slots(right);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::PositionsView;

    fn tree(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Bvh {
        Bvh::new(&Surface::new(PositionsView::F64(positions), bytemuck::cast_slice(triangles)).unwrap())
    }

    #[test]
    fn nothing_is_near_to_no_face() {
        let empty = tree(&[], &[]);
        assert!(empty.is_empty() && empty.closest([0.0; 3]).is_none() && empty.bounds().is_none());
        let broken = tree(&[[0.0; 3], [f64::NAN, 0.0, 0.0], [1.0; 3]], &[[0, 1, 2]]);
        assert!(broken.is_empty() && broken.closest([0.0; 3]).is_none());
    }

    #[test]
    fn a_face_that_is_not_finite_is_skipped() {
        let positions =
            [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, f64::INFINITY], [5.0, 5.0, 5.0]];
        let t = tree(&positions, &[[0, 1, 3], [0, 1, 2], [4, 4, 4]]);
        assert_eq!(t.face_count(), 2);
        let hit = t.closest([0.2, 0.2, 3.0]).unwrap();
        assert_eq!((hit.face, hit.distance), (FaceId(1), 3.0));
        assert!(DVec3::from(hit.point).distance(DVec3::new(0.2, 0.2, 0.0)) < 1e-15);
        assert_eq!(t.closest([5.0, 5.0, 6.0]).unwrap().face, FaceId(2));
    }

    #[test]
    fn a_bound_hides_what_is_farther() {
        let t = tree(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]);
        let hint = &mut Hint(77);
        assert!(t.closest_within([0.2, 0.2, 3.0], 2.9, hint).is_none());
        assert_eq!(t.closest_within([0.2, 0.2, 3.0], 3.1, hint).unwrap().distance_sq, 9.0);
    }

    #[test]
    fn a_search_among_few_faces_tests_only_those_nearby() {
        // Two sheets of 2 · 100 · 100 faces, one cell apart: the lower half and the upper half of the faces.
        let side = 100u32;
        let at = |z: u32, x: u32, y: u32| (z * (side + 1) + y) * (side + 1) + x;
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for z in 0..2 {
            let places = (0..=side).flat_map(|y| (0..=side).map(move |x| (x, y)));
            positions.extend(places.map(|(x, y)| [f64::from(x), f64::from(y), f64::from(z)]));
            for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
                let [a, b, c, d] = [at(z, x, y), at(z, x + 1, y), at(z, x + 1, y + 1), at(z, x, y + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        let t = tree(&positions, &triangles);
        let (tested, each) = (std::cell::Cell::new(0), triangles.len() / 2);
        // Under one sheet, and the other is wanted; some points lie at the middle of the first division of the tree.
        for (x, y) in [(50.2, 50.1), (49.9, 50.0), (0.3, 99.8), (12.34, 56.78)] {
            tested.set(0);
            let upper = |f: FaceId| {
                tested.set(tested.get() + 1);
                f.index() >= each
            };
            let hit = t.closest_of([x, y, -0.25], upper).unwrap();
            assert!(hit.face.index() >= each && (hit.distance - 1.25).abs() < 1e-12, "{hit:?}");
            assert!(tested.get() < 400, "{} of {} faces tested at {x}, {y}", tested.get(), 2 * each);
        }
        // With a distance limit, or if no face is accepted, the result is the same as without the spheres.
        assert!(t.closest_of_within([50.0, 50.0, -0.25], 1.25, |f| f.index() >= each).is_none());
        assert!(t.closest_of_within([50.0, 50.0, -0.25], 1.26, |f| f.index() >= each).is_some());
        assert!(t.closest_of([50.0, 50.0, -0.25], |_| false).is_none());
        let far = t.closest_of([50.0, 50.0, -0.25], |f| f == FaceId(0)).unwrap();
        assert_eq!(far.face, FaceId(0));
    }

    #[test]
    fn a_search_among_faces_without_size_ends() {
        let t = tree(&[[0.0; 3], [1.0; 3]], &[[0, 0, 0], [1, 1, 1]]);
        assert_eq!(t.closest_of([0.0; 3], |f| f == FaceId(1)).unwrap().face, FaceId(1));
        assert!(t.closest_of([0.0; 3], |_| false).is_none());
    }

    #[test]
    fn far_points_find_a_face_and_non_finite_points_none() {
        let t = tree(
            &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 1.0], [9.0, 9.0, 9.0]],
            &[[0, 1, 2], [2, 1, 3], [3, 4, 1]],
        );
        assert_eq!(t.closest([1e10; 3]).unwrap().face, FaceId(2));
        // So far away all faces are equally distant to the last digit; only the distance matters.
        for far in [1e25, 1e90] {
            assert!((t.closest([far, 0.0, 0.0]).unwrap().distance / far - 1.0).abs() < 1e-12, "{far}");
        }
        assert!(t.closest([f64::NAN, 0.0, 0.0]).is_none() && t.closest([f64::INFINITY, 0.0, 0.0]).is_none());
        assert!(t.closest([1e200; 3]).is_none());
    }

    #[test]
    fn rounding_encloses() {
        for x in [0.1, -0.1, 1e-40, -1e-40, 0.3333333333, 1e18] {
            assert!(f64::from(round_down(x)) <= x && x <= f64::from(round_up(x)));
        }
    }
}
