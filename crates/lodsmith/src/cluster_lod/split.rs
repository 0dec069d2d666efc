//! Partition of faces into clusters by recursive bisection across the longest extent along the surface.
//!
//! Large meshes are first cut by planes into pieces of several clusters. Each piece is then bisected by
//! geodesic distance over shared edges: two seed faces as far apart as possible, and the line at equal
//! distance from both. The halves of a connected piece are nearly always connected, and their sizes are
//! chosen to fill clusters.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use lodsmith_core::{TriMesh, VertexId, WedgeId};

use crate::chunks::each;

/// Maximum number of clusters in a piece cut by planes: the geodesic search costs more, and gains little on
/// larger ones.
const PIECE_CLUSTERS: usize = 8;
/// Number of vertices of a compact patch of n triangles beyond n / 2, over the root of n: half of its border.
/// (A hexagon has 1.2; ragged ones more; guessed.)
const BORDER_FACTOR: f64 = 2.0;

/// Capacity of a cluster.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    pub(super) triangles: usize,
    pub(super) vertices: usize,
}

impl Budget {
    /// Returns the number of faces to put into a cluster, for a mesh of `faces` faces and `wedges` wedges.
    pub(super) fn faces(&self, wedges: usize, faces: usize) -> usize {
        let count = faces.max(1) as f64;
        // Without the border of the set itself.
        let each = ((wedges as f64 - BORDER_FACTOR * count.sqrt()) / count).max(0.5);
        let fits = |n: &usize| each * *n as f64 + BORDER_FACTOR * (*n as f64).sqrt() <= self.vertices as f64;
        // If every corner has its own wedge, no border is shared.
        let alone = self.vertices / 3;
        (1..=self.triangles).rev().find(fits).unwrap_or(1).max(alone.min(self.triangles)).max(1)
    }
}

/// Returns the faces of each cluster; clusters close together in the list are close in space. The faces of a
/// cluster are sorted by region.
pub(super) fn split(mesh: &TriMesh, budget: &Budget) -> Vec<Vec<u32>> {
    let centres = centres(mesh);
    let mut all: Vec<u32> = (0..mesh.face_count() as u32).collect();
    let mut pieces = Vec::new();
    split_by_planes(&mut all, &centres, PIECE_CLUSTERS * budget.triangles, budget.triangles, &mut pieces);
    let clusters = each(pieces.len(), |i| Piece::new(mesh, &centres, pieces[i]).clusters(budget));
    clusters.into_iter().flatten().collect()
}

/// Returns the centre of each face, in a box of size 1.
fn centres(mesh: &TriMesh) -> Vec<[f32; 3]> {
    let positions = mesh.positions().view();
    let Some(bounds) = positions.bounds() else { return vec![[0.0; 3]; mesh.face_count()] };
    let size = (0..3).map(|k| bounds.max[k] - bounds.min[k]).fold(f64::MIN_POSITIVE, f64::max);
    let centre = |t: &[WedgeId; 3]| {
        let p = t.map(|w| positions.get(mesh.vertex_of(w)));
        [0, 1, 2].map(|k| p.iter().map(|p| (p[k] - bounds.min[k]) / size / 3.0).sum::<f64>() as f32)
    };
    mesh.triangles().iter().map(centre).collect()
}

/// Returns the axis with the largest extent of the face centres.
fn longest_axis(faces: impl Iterator<Item = u32>, centres: &[[f32; 3]]) -> usize {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for f in faces {
        for (k, &x) in centres[f as usize].iter().enumerate() {
            (min[k], max[k]) = (min[k].min(x), max[k].max(x));
        }
    }
    let extent = [0, 1, 2].map(|k| max[k] - min[k]);
    (0..3).rev().max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0)
}

fn split_by_planes<'a>(
    faces: &'a mut [u32],
    centres: &[[f32; 3]],
    max_faces: usize,
    each: usize,
    out: &mut Vec<&'a [u32]>,
) {
    if faces.len() <= max_faces {
        out.push(faces);
        return;
    }
    let axis = longest_axis(faces.iter().copied(), centres);
    let at = first_half(faces.len(), faces.len().div_ceil(each));
    let key = |f: u32| centres[f as usize][axis];
    faces.select_nth_unstable_by(at, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
    let (left, right) = faces.split_at_mut(at);
    split_by_planes(left, centres, max_faces, each, out);
    split_by_planes(right, centres, max_faces, each, out);
}

/// Returns how many of `count` items go left, so that `parts` parts of equal size result.
fn first_half(count: usize, parts: usize) -> usize {
    (count * (parts / 2)).div_ceil(parts.max(1)).clamp(1, count - 1)
}

/// A set of faces with its edge adjacency.
struct Piece<'a> {
    mesh: &'a TriMesh,
    centres: &'a [[f32; 3]],
    /// Faces of the mesh; all other fields use indices into this list.
    faces: Vec<u32>,
    /// Neighbours of all faces, and the start of each face's range.
    neighbours: Vec<u32>,
    starts: Vec<u32>,
    /// Current set of each face.
    set_of: Vec<u32>,
    sets: u32,
    path_length: Vec<f32>,
    heap: BinaryHeap<Reverse<(u32, u32)>>,
}

impl<'a> Piece<'a> {
    fn new(mesh: &'a TriMesh, centres: &'a [[f32; 3]], faces: &[u32]) -> Self {
        let mut faces = faces.to_vec();
        faces.sort_unstable();
        let mut edges: Vec<([VertexId; 2], u32)> = Vec::with_capacity(3 * faces.len());
        for (i, &f) in faces.iter().enumerate() {
            let t = mesh.triangles()[f as usize].map(|w| mesh.vertex_of(w));
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                edges.push(([a.min(b), a.max(b)], i as u32));
            }
        }
        edges.sort_unstable();
        let mut links: Vec<(u32, u32)> = Vec::with_capacity(edges.len());
        for pair in edges.windows(2).filter(|w| w[0].0 == w[1].0) {
            links.extend([(pair[0].1, pair[1].1), (pair[1].1, pair[0].1)]);
        }
        links.sort_unstable();
        let mut starts = vec![0u32; faces.len() + 1];
        links.iter().for_each(|l| starts[l.0 as usize + 1] += 1);
        for i in 0..faces.len() {
            starts[i + 1] += starts[i];
        }
        let count = faces.len();
        Self {
            mesh,
            centres,
            faces,
            neighbours: links.into_iter().map(|l| l.1).collect(),
            starts,
            set_of: vec![0; count],
            sets: 0,
            path_length: vec![0.0; count],
            heap: BinaryHeap::new(),
        }
    }

    fn clusters(mut self, budget: &Budget) -> Vec<Vec<u32>> {
        let mut done = Vec::new();
        let mut wedges = Vec::new();
        let mut waiting: Vec<Vec<u32>> = vec![(0..self.faces.len() as u32).collect()];
        while let Some(set) = waiting.pop() {
            wedges.clear();
            wedges.extend(set.iter().flat_map(|&i| self.mesh.triangles()[self.faces[i as usize] as usize]));
            wedges.sort_unstable();
            wedges.dedup();
            if set.len() <= budget.triangles && wedges.len() <= budget.vertices {
                done.push(self.named(set));
                continue;
            }
            let parts = set.len().div_ceil(budget.faces(wedges.len(), set.len())).max(2);
            let at = first_half(set.len(), parts);
            let (left, right) = self.halves(set, at);
            waiting.extend([right, left]);
        }
        done
    }

    /// Returns the mesh indices of the faces of a set, sorted by region.
    fn named(&self, set: Vec<u32>) -> Vec<u32> {
        let mut faces: Vec<u32> = set.into_iter().map(|i| self.faces[i as usize]).collect();
        faces.sort_unstable();
        if let Some(regions) = self.mesh.regions() {
            faces.sort_by_key(|&f| regions[f as usize]);
        }
        faces
    }

    fn centre(&self, i: u32) -> [f32; 3] {
        self.centres[self.faces[i as usize] as usize]
    }

    /// Splits a set into `at` faces and the rest.
    fn halves(&mut self, set: Vec<u32>, at: usize) -> (Vec<u32>, Vec<u32>) {
        let (mut left, mut right) = (Vec::with_capacity(at), Vec::with_capacity(set.len() - at));
        for mut part in self.connected(&set) {
            let missing = at - left.len();
            if part.len() <= missing {
                left.append(&mut part);
            } else if missing == 0 {
                right.append(&mut part);
            } else {
                self.order_by_path_length(&mut part, missing);
                left.extend_from_slice(&part[..missing]);
                right.extend_from_slice(&part[missing..]);
            }
        }
        (left, right)
    }

    /// Returns the connected components of a set, sorted along its longest axis.
    fn connected(&mut self, set: &[u32]) -> Vec<Vec<u32>> {
        self.mark(set);
        let (own, mut parts) = (self.sets, Vec::<Vec<u32>>::new());
        for &first in set {
            if self.set_of[first as usize] != own {
                continue;
            }
            // Zero marks a visited face.
            self.set_of[first as usize] = 0;
            let mut part = vec![first];
            let mut next = 0;
            while next < part.len() {
                let i = part[next] as usize;
                next += 1;
                for &j in &self.neighbours[self.starts[i] as usize..self.starts[i + 1] as usize] {
                    if self.set_of[j as usize] == own {
                        self.set_of[j as usize] = 0;
                        part.push(j);
                    }
                }
            }
            parts.push(part);
        }
        if parts.len() > 1 {
            let axis = longest_axis(set.iter().map(|&i| self.faces[i as usize]), self.centres);
            let middle = |part: &Vec<u32>| {
                part.iter().map(|&i| f64::from(self.centre(i)[axis])).sum::<f64>() / part.len() as f64
            };
            let mut keyed: Vec<_> = parts.into_iter().map(|p| (middle(&p), p)).collect();
            keyed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1[0].cmp(&b.1[0])));
            parts = keyed.into_iter().map(|x| x.1).collect();
        }
        parts
    }

    fn mark(&mut self, set: &[u32]) {
        self.sets += 1;
        for &i in set {
            self.set_of[i as usize] = self.sets;
        }
    }

    /// Moves the `at` faces of a component to the front that are nearest to one of its ends, relative to the
    /// other.
    fn order_by_path_length(&mut self, part: &mut [u32], at: usize) {
        let farthest = |length: &[f32], part: &[u32]| {
            let far = part
                .iter()
                .copied()
                .max_by(|&a, &b| length[a as usize].total_cmp(&length[b as usize]).then(b.cmp(&a)));
            far.expect("a part has faces")
        };
        self.walk(part, part[0]);
        let one = farthest(&self.path_length, part);
        self.walk(part, one);
        let other = farthest(&self.path_length, part);
        let from_one: Vec<f32> = part.iter().map(|&i| self.path_length[i as usize]).collect();
        self.walk(part, other);
        let mut keyed: Vec<(f32, u32)> =
            part.iter().zip(from_one).map(|(&i, d)| (d - self.path_length[i as usize], i)).collect();
        keyed.select_nth_unstable_by(at, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        part.iter_mut().zip(keyed).for_each(|(slot, x)| *slot = x.1);
    }

    /// Computes the path length from a face to every other face of a component, over face centres.
    fn walk(&mut self, part: &[u32], from: u32) {
        self.mark(part);
        for &i in part {
            self.path_length[i as usize] = f32::INFINITY;
        }
        self.path_length[from as usize] = 0.0;
        self.heap.push(Reverse((0, from)));
        while let Some(Reverse((bits, i))) = self.heap.pop() {
            let length = f32::from_bits(bits);
            if length > self.path_length[i as usize] {
                continue;
            }
            let p = self.centre(i);
            let range = self.starts[i as usize] as usize..self.starts[i as usize + 1] as usize;
            for at in range {
                let j = self.neighbours[at];
                if self.set_of[j as usize] != self.sets {
                    continue;
                }
                let q = self.centre(j);
                let step = (0..3).map(|k| (p[k] - q[k]) * (p[k] - q[k])).sum::<f32>().sqrt();
                if length + step < self.path_length[j as usize] {
                    self.path_length[j as usize] = length + step;
                    // Non-negative floats sort like their bits.
                    self.heap.push(Reverse(((length + step).to_bits(), j)));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;

    const BUDGET: Budget = Budget { triangles: 128, vertices: 128 };

    #[test]
    fn every_face_is_in_one_cluster_and_clusters_are_full() {
        for mesh in [shapes::icosphere(4), shapes::torus(60, 40), shapes::grid(50), shapes::tetrahedra(300)] {
            let clusters = split(&mesh, &BUDGET);
            let mut faces: Vec<u32> = clusters.iter().flatten().copied().collect();
            faces.sort_unstable();
            assert!(faces.iter().copied().eq(0..mesh.face_count() as u32));
            assert!(clusters.iter().all(|c| c.len() <= 128 && !c.is_empty()));
            let fill = mesh.face_count() as f64 / (128 * clusters.len()) as f64;
            assert!(fill > 0.3, "{fill}");
        }
        let clusters = split(&shapes::icosphere(5), &BUDGET);
        assert!(20480.0 / (128.0 * clusters.len() as f64) > 0.95, "{}", clusters.len());
    }

    #[test]
    fn clusters_limited_by_vertices_are_still_full() {
        let mesh = shapes::torus(100, 60);
        let clusters = split(&mesh, &Budget { triangles: 124, vertices: 64 });
        for c in &clusters {
            let mut used: Vec<_> = c.iter().flat_map(|&f| mesh.triangles()[f as usize]).collect();
            used.sort_unstable();
            used.dedup();
            assert!(used.len() <= 64);
        }
        assert!(mesh.face_count() / clusters.len() > 70, "{}", clusters.len());
    }

    #[test]
    fn most_clusters_of_a_closed_surface_are_connected() {
        let mesh = shapes::torus(80, 40);
        let centres = centres(&mesh);
        let clusters = split(&mesh, &BUDGET);
        let whole = clusters.iter().filter(|c| {
            let mut piece = Piece::new(&mesh, &centres, c);
            let set: Vec<u32> = (0..c.len() as u32).collect();
            piece.connected(&set).len() == 1
        });
        assert!(whole.count() * 20 >= clusters.len() * 19);
    }

    #[test]
    fn halving_gives_parts_of_equal_size() {
        assert_eq!((first_half(1000, 8), first_half(300, 3), first_half(2, 2)), (500, 100, 1));
    }
}
