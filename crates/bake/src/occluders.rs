//! A bounding volume hierarchy that only answers whether a ray is blocked: eight boxes per node, eight faces per leaf,
//! in single precision.
//!
//! ```text
//! split the faces in two by the surface area heuristic, again and again, down to leaves of up to eight
//! from the root: replace the child with the largest box by its two children, until there are eight
//! ```
//!
//! Sources: [Wald 2007] for the splits, [Möller-Trumbore 1997] for the faces.

use glam::{DVec3, Vec3};
use lodsmith_core::geometry::UnitFrame;
use lodsmith_core::mesh::Bounds;
use wide::f32x8;

/// Boxes of a node, and faces of a leaf.
const WIDTH: usize = 8;
/// Number of bins along the longest axis; splits are tried between them.
const BINS: usize = 16;
/// Boxes are enlarged by this on each side, in the unit frame: twice the rounding error of their tests.
const BOX_MARGIN: f32 = 1e-6;
/// Bit of a child that is a leaf.
const LEAF: u32 = 1 << 31;
/// Levels of splits by the heuristic; below, faces are halved, so that the depth of any tree is limited.
const SPLIT_LEVELS: usize = 48;
/// Each level has up to seven waiting children; 2³² faces are halved 32 times.
const STACK_SIZE: usize = 7 * (SPLIT_LEVELS + 32) + 1;

struct Node {
    min: [f32x8; 3],
    max: [f32x8; 3],
    /// Numbers of nodes, or of leaves with the bit `LEAF`.
    children: [u32; WIDTH],
}

/// A corner and two edges of each face; missing faces are zero, so that no ray hits them.
struct Leaf {
    corner: [f32x8; 3],
    edges: [[f32x8; 3]; 2],
}

/// The faces of a surface, for rays that stop at the first of them.
pub(crate) struct Occluders {
    frame: UnitFrame,
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

/// A ray in the unit frame.
pub(crate) struct Ray {
    origin: [f32x8; 3],
    inverse: [f32x8; 3],
    direction: [f32x8; 3],
    is_negative: [bool; 3],
    length: f32x8,
}

#[derive(Clone, Copy)]
struct Face {
    corners: [Vec3; 3],
}

impl Face {
    fn bounds(&self) -> Box3 {
        let [a, b, c] = self.corners;
        Box3 { min: a.min(b).min(c), max: a.max(b).max(c) }
    }
    fn centre(&self) -> Vec3 {
        let Box3 { min, max } = self.bounds();
        (min + max) * 0.5
    }
}

#[derive(Clone, Copy)]
struct Box3 {
    min: Vec3,
    max: Vec3,
}

impl Box3 {
    const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    fn with(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }
    /// Half its surface; 0 if it is empty.
    fn half_area(&self) -> f32 {
        let Vec3 { x, y, z } = (self.max - self.min).max(Vec3::ZERO);
        x * y + y * z + z * x
    }
}

/// A tree with two children per node, while it is built.
enum Split {
    Faces(Vec<Face>),
    Two(Box<[(Box3, Split); 2]>),
}

impl Occluders {
    /// Builds the tree; faces with corners that are not finite are left out. Cost: O(n log n) for n faces.
    pub(crate) fn new(corners: &[[DVec3; 3]], bounds: &Bounds) -> Self {
        let frame = UnitFrame::of(bounds);
        let finite = corners.iter().filter(|corners| corners.iter().all(|p| p.is_finite()));
        let unit = |p: DVec3| frame.unit_from_user(p.to_array()).as_vec3();
        let faces: Vec<Face> = finite.map(|corners| Face { corners: corners.map(unit) }).collect();
        let mut tree = Self { frame, nodes: Vec::new(), leaves: Vec::new() };
        let bounds = faces.iter().fold(Box3::EMPTY, |all, face| all.with(face.bounds()));
        let root = split(faces, 0);
        tree.add(vec![(bounds, root)]);
        tree
    }

    /// Adds a node with these children, replacing the largest by their own children while there is room;
    /// returns its number.
    fn add(&mut self, mut children: Vec<(Box3, Split)>) -> u32 {
        while children.len() < WIDTH {
            let opened = |(_, child): &(Box3, Split)| matches!(child, Split::Two(_));
            let largest = (0..children.len()).filter(|&i| opened(&children[i])).max_by(|&a, &b| {
                children[a].0.half_area().total_cmp(&children[b].0.half_area()).then(b.cmp(&a))
            });
            let Some(largest) = largest else { break };
            match children.swap_remove(largest) {
                (_, Split::Two(two)) => children.extend(*two),
                leaf => children.push(leaf),
            }
        }
        let number = self.nodes.len();
        let (mut min, mut max) = ([[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]);
        for (lane, (bounds, _)) in children.iter().enumerate() {
            for k in 0..3 {
                min[k][lane] = bounds.min[k] - BOX_MARGIN;
                max[k][lane] = bounds.max[k] + BOX_MARGIN;
            }
        }
        let (min, max) = (min.map(f32x8::new), max.map(f32x8::new));
        self.nodes.push(Node { min, max, children: [0; WIDTH] });
        for (lane, (_, child)) in children.into_iter().enumerate() {
            let child = match child {
                Split::Two(two) => self.add(Vec::from(*two)),
                Split::Faces(faces) => {
                    self.leaves.push(Leaf::new(&faces));
                    (self.leaves.len() - 1) as u32 | LEAF
                }
            };
            self.nodes[number].children[lane] = child;
        }
        number as u32
    }

    /// Makes a ray from a point in model coordinates; the direction has unit length.
    pub(crate) fn ray(&self, from: DVec3, direction: Vec3, length: f64) -> Ray {
        let origin = self.frame.unit_from_user(from.to_array()).as_vec3().to_array();
        let direction = direction.to_array();
        // Keeps the inverse of a zero component finite.
        let inverse = direction.map(|x| 1.0 / if x.abs() < 1e-18 { 1e-18f32.copysign(x) } else { x });
        Ray {
            origin: origin.map(f32x8::splat),
            inverse: inverse.map(f32x8::splat),
            direction: direction.map(f32x8::splat),
            is_negative: inverse.map(|x| x < 0.0),
            length: f32x8::splat(self.frame.unit_length(length) as f32),
        }
    }

    /// True if a face lies on a ray. `latest` is the leaf that blocked a similar ray: it is tried first, and updated.
    pub(crate) fn is_blocked(&self, ray: &Ray, latest: &mut u32) -> bool {
        if self.leaves.get(*latest as usize).is_some_and(|leaf| leaf.is_hit(ray)) {
            return true;
        }
        let mut stack = [0u32; STACK_SIZE];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let node = &self.nodes[stack[waiting] as usize];
            let (mut entered, near) = node.enter(ray);
            let near = near.to_array();
            let mut distances = [0f32; WIDTH];
            let first = waiting;
            while entered != 0 {
                let lane = entered.trailing_zeros() as usize;
                entered &= entered - 1;
                let child = node.children[lane];
                if child & LEAF != 0 {
                    let leaf = child & !LEAF;
                    if self.leaves[leaf as usize].is_hit(ray) {
                        *latest = leaf;
                        return true;
                    }
                    continue;
                }
                // The nearest is on top.
                let mut at = waiting;
                while at > first && distances[at - 1 - first] < near[lane] {
                    (stack[at], distances[at - first]) = (stack[at - 1], distances[at - 1 - first]);
                    at -= 1;
                }
                (stack[at], distances[at - first]) = (child, near[lane]);
                waiting += 1;
            }
        }
        false
    }
}

impl Node {
    /// Returns a bit for each box that a ray enters, and the places where it does.
    #[inline(always)]
    fn enter(&self, ray: &Ray) -> (u32, f32x8) {
        let (mut near, mut far) = (f32x8::ZERO, ray.length);
        for k in 0..3 {
            let (low, high) =
                if ray.is_negative[k] { (self.max[k], self.min[k]) } else { (self.min[k], self.max[k]) };
            near = near.fast_max((low - ray.origin[k]) * ray.inverse[k]);
            far = far.fast_min((high - ray.origin[k]) * ray.inverse[k]);
        }
        (near.simd_le(far).to_bitmask(), near)
    }
}

impl Leaf {
    fn new(faces: &[Face]) -> Self {
        let lanes = |of: &dyn Fn(&Face) -> Vec3| {
            [0, 1, 2].map(|k| {
                f32x8::new(std::array::from_fn(|lane| faces.get(lane).map_or(0.0, |face| of(face)[k])))
            })
        };
        let edge = |i: usize| lanes(&move |face: &Face| face.corners[i] - face.corners[0]);
        Self { corner: lanes(&|face| face.corners[0]), edges: [edge(1), edge(2)] }
    }

    /// True if a ray meets one of the faces, from either side.
    #[inline(always)]
    fn is_hit(&self, ray: &Ray) -> bool {
        let [ab, ac] = self.edges;
        let q = cross(ray.direction, ac);
        let inverse = f32x8::ONE / dot(ab, q);
        let s: [f32x8; 3] = std::array::from_fn(|k| ray.origin[k] - self.corner[k]);
        let u = dot(s, q) * inverse;
        let r = cross(s, ab);
        let v = dot(ray.direction, r) * inverse;
        let t = dot(ac, r) * inverse;
        // Faces without area give NaN, for which all of these are false.
        let edge = f32x8::splat(-1e-6);
        let is_inside = u.simd_gt(edge) & v.simd_gt(edge) & (u + v).simd_lt(f32x8::ONE - edge);
        (is_inside & t.simd_gt(f32x8::ZERO) & t.simd_le(ray.length)).to_bitmask() != 0
    }
}

fn dot(a: [f32x8; 3], b: [f32x8; 3]) -> f32x8 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32x8; 3], b: [f32x8; 3]) -> [f32x8; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Splits faces in two by the surface area heuristic, down to leaves.
fn split(mut faces: Vec<Face>, level: usize) -> Split {
    if faces.len() <= WIDTH {
        return Split::Faces(faces);
    }
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for face in &faces {
        (low, high) = (low.min(face.centre()), high.max(face.centre()));
    }
    let side = high - low;
    let axis = (0..3).fold(0, |best, k| if side[k] > side[best] { k } else { best });
    let bin = best_bin(&faces, axis, low[axis], side[axis]).filter(|_| level < SPLIT_LEVELS);
    let right = match bin {
        Some(bin) => {
            let (left, right): (Vec<_>, Vec<_>) =
                faces.into_iter().partition(|face| bin_of(face, axis, low[axis], side[axis]) < bin);
            faces = left;
            right
        }
        None => faces.split_off(faces.len() / 2),
    };
    let bounds_of = |faces: &[Face]| faces.iter().fold(Box3::EMPTY, |all, face| all.with(face.bounds()));
    let whole = |faces: Vec<Face>| (bounds_of(&faces), split(faces, level + 1));
    // Below this, a task costs more than the work. (Guessed.)
    let (left, right) = if faces.len() + right.len() > 8192 {
        rayon::join(|| whole(faces), || whole(right))
    } else {
        (whole(faces), whole(right))
    };
    Split::Two(Box::new([left, right]))
}

fn bin_of(face: &Face, axis: usize, low: f32, side: f32) -> usize {
    (((face.centre()[axis] - low) / side * BINS as f32) as usize).min(BINS - 1)
}

/// Returns the first bin of the right side of the cheapest split; `None` if all centres are equal.
fn best_bin(faces: &[Face], axis: usize, low: f32, side: f32) -> Option<usize> {
    if side <= 0.0 {
        return None;
    }
    let mut bins = [(Box3::EMPTY, 0usize); BINS];
    for face in faces {
        let bin = &mut bins[bin_of(face, axis, low, side)];
        *bin = (bin.0.with(face.bounds()), bin.1 + 1);
    }
    // Leaves hold eight faces at the cost of one.
    let cost = |(bounds, count): (Box3, usize)| bounds.half_area() * count.div_ceil(WIDTH) as f32;
    let join = |a: (Box3, usize), b: (Box3, usize)| (a.0.with(b.0), a.1 + b.1);
    let mut right = [(Box3::EMPTY, 0); BINS];
    for bin in (1..BINS).rev() {
        let beyond = right.get(bin + 1).copied().unwrap_or((Box3::EMPTY, 0));
        right[bin] = join(bins[bin], beyond);
    }
    let mut left = (Box3::EMPTY, 0);
    let mut best: Option<(f32, usize)> = None;
    for bin in 1..BINS {
        left = join(left, bins[bin - 1]);
        if left.1 == 0 || right[bin].1 == 0 {
            continue;
        }
        let cost = cost(left) + cost(right[bin]);
        if best.is_none_or(|(least, _)| cost < least) {
            best = Some((cost, bin));
        }
    }
    best.map(|(_, bin)| bin)
}

#[cfg(test)]
mod tests {
    use lodsmith_core::spatial::Bvh;
    use lodsmith_core::{TriMesh, VertexId, shapes};

    use super::*;

    /// Compares both trees along lines between points in the box around a mesh.
    fn compare(mesh: &TriMesh) -> [usize; 2] {
        let exact = Bvh::new(&mesh.surface());
        let bounds = exact.bounds().unwrap();
        let at = |v: VertexId| DVec3::from(mesh.positions().view().get(v));
        let corners: Vec<[DVec3; 3]> = mesh.surface().triangles().iter().map(|t| t.map(at)).collect();
        let tree = Occluders::new(&corners, &bounds);
        let (low, side) = (DVec3::from(bounds.min), DVec3::from(bounds.max) - DVec3::from(bounds.min));
        let (mut latest, mut counts) = (u32::MAX, [0; 2]);
        for k in 0..2000 {
            // Steps of irrational length fill the box evenly.
            let part = |step: f64| (f64::from(k) * step).fract() * 1.2 - 0.1;
            let from = low + side * DVec3::new(part(0.618), part(0.4142), part(0.7321));
            let to = low + side * DVec3::new(part(0.2361), part(0.8284), part(0.6458));
            let (direction, length) = ((to - from).normalize_or_zero().as_vec3(), (to - from).length());
            let to = from + direction.as_dvec3() * length;
            let is_blocked = tree.is_blocked(&tree.ray(from, direction, length), &mut latest);
            assert_eq!(is_blocked, exact.is_blocked(from.to_array(), to.to_array()), "{from} {to}");
            counts[usize::from(is_blocked)] += 1;
        }
        counts
    }

    #[test]
    fn rays_are_blocked_where_the_exact_tree_says_so() {
        for mesh in [shapes::icosphere(4), shapes::wavy_sheet(30), shapes::soup(200, 1)] {
            let [open, blocked] = compare(&mesh);
            assert!(open > 100 && blocked > 100, "{open} {blocked}");
        }
    }

    #[test]
    fn coincident_and_distant_faces_do_not_make_a_deep_tree() {
        // Distances that double let the heuristic split off one face at a time.
        let far = |k: i32| 2f64.powf(f64::from(k) / 40.0);
        let corners: Vec<[DVec3; 3]> = (0..400)
            .map(|k| [DVec3::X, DVec3::Y, DVec3::Z].map(|p| p + DVec3::X * far(k)))
            .chain(std::iter::repeat_n([DVec3::X, DVec3::Y, DVec3::Z], 5000))
            .collect();
        let bounds = Bounds { min: [0.0; 3], max: [far(400) + 1.0, 1.0, 1.0] };
        let tree = Occluders::new(&corners, &bounds);
        assert!(tree.is_blocked(&tree.ray(DVec3::ZERO, Vec3::ONE.normalize_or_zero(), 10.0), &mut 0));
        assert!(!tree.is_blocked(&tree.ray(DVec3::ZERO, -Vec3::ONE.normalize_or_zero(), 10.0), &mut 0));
    }
}
