//! Borders of regions, as chains of edges between corners that both sides share.

use glam::DVec3;
use lodsmith_core::topology::EdgeKind;
use lodsmith_core::{HalfEdgeId, Topology, VertexId};

use super::regions::Regions;

/// Splitting depth beyond which chains are split in the middle instead of at their farthest vertex: no chain
/// takes quadratic time. (Chains that are split about evenly have fewer vertices than 2 to this power.)
const MAX_SPLIT_DEPTH: u32 = 40;

/// All border chains.
pub(super) struct Chains {
    start: Vec<usize>,
    vertices: Vec<VertexId>,
    /// True for each of `vertices` that the simplified chain keeps.
    needed: Vec<bool>,
    needed_edges: Vec<usize>,
    /// True for closed chains without a corner.
    is_free: Vec<bool>,
    side_start: Vec<usize>,
    sides: Vec<ChainSide>,
}

/// A region along a chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ChainSide {
    pub(super) region: u32,
    /// True if its faces are wound in the direction of the chain.
    pub(super) is_forward: bool,
}

/// Classification of a vertex by the borders through it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum BorderRole {
    /// No border edge.
    #[default]
    Inside,
    /// Two border edges, between the same regions.
    Along([HalfEdgeId; 2]),
    /// One border edge so far.
    One(HalfEdgeId),
    /// Any other number.
    Corner,
}

/// True if the edge of a half-edge is part of a border.
pub(super) fn is_border(topology: &Topology, regions: &Regions, h: HalfEdgeId) -> bool {
    let of = |h: HalfEdgeId| regions.of_face[h.face().index()];
    topology.kind(h) != Some(EdgeKind::Inner) || topology.twin(h).is_none_or(|g| of(g) != of(h))
}

impl Chains {
    /// Finds the chains. `is_held` is true for vertices to keep; `flat` is the largest distance of dropped
    /// vertices from the edges that replace them. Cost: O(n log n).
    pub(super) fn new(
        topology: &Topology,
        regions: &Regions,
        points: &[DVec3],
        is_held: impl Fn(VertexId) -> bool,
        flat: f64,
    ) -> (Self, Vec<BorderRole>) {
        let mut places = vec![BorderRole::default(); points.len()];
        let edges = || topology.edges().filter(|&h| is_border(topology, regions, h));
        for h in edges() {
            for v in [topology.origin(h), topology.target(h)] {
                let place = &mut places[v.index()];
                *place = match *place {
                    BorderRole::Inside => BorderRole::One(h),
                    BorderRole::One(g) => BorderRole::Along([g, h]),
                    BorderRole::Along(_) | BorderRole::Corner => BorderRole::Corner,
                };
            }
        }
        let mut buffers = [Vec::new(), Vec::new()];
        for (v, place) in places.iter_mut().enumerate() {
            let v = VertexId::new(v);
            let stays = match *place {
                BorderRole::Inside => false,
                BorderRole::One(_) | BorderRole::Corner => true,
                BorderRole::Along([g, h]) => {
                    let [a, b] = &mut buffers;
                    sides(topology, regions, g, topology.target(g) == v, a);
                    sides(topology, regions, h, topology.origin(h) == v, b);
                    a != b || is_held(v)
                }
            };
            if stays {
                *place = BorderRole::Corner;
            }
        }
        let mut all = Self {
            start: vec![0],
            vertices: Vec::new(),
            needed: Vec::new(),
            needed_edges: Vec::new(),
            is_free: Vec::new(),
            side_start: vec![0],
            sides: Vec::new(),
        };
        let mut is_walked = vec![false; 3 * topology.face_count()];
        let is_corner = |v: VertexId| places[v.index()] == BorderRole::Corner;
        for from_corners in [true, false] {
            for h in edges() {
                let (a, b) = (topology.origin(h), topology.target(h));
                let from = if from_corners && !is_corner(a) { b } else { a };
                if !is_walked[h.index()] && (!from_corners || is_corner(from)) {
                    all.walk(topology, regions, &places, from, h, &mut is_walked);
                }
            }
        }
        all.find_needed(points, flat);
        (all, places)
    }

    /// Follows a border from a vertex along an edge to the next corner, or back to the start.
    fn walk(
        &mut self,
        topology: &Topology,
        regions: &Regions,
        places: &[BorderRole],
        from: VertexId,
        first: HalfEdgeId,
        is_walked: &mut [bool],
    ) {
        self.vertices.push(from);
        let (mut at, mut h) = (from, first);
        loop {
            is_walked[h.index()] = true;
            at = if topology.origin(h) == at { topology.target(h) } else { topology.origin(h) };
            self.vertices.push(at);
            match places[at.index()] {
                BorderRole::Along([a, b]) if at != from => h = if a == h { b } else { a },
                _ => break,
            }
        }
        self.start.push(self.vertices.len());
        self.is_free.push(places[from.index()] != BorderRole::Corner);
        let mut buffer = Vec::new();
        sides(topology, regions, first, topology.origin(first) == from, &mut buffer);
        self.sides.extend(buffer);
        self.side_start.push(self.sides.len());
    }

    /// Runs Douglas-Peucker on each chain. Closed chains keep at least three vertices.
    fn find_needed(&mut self, points: &[DVec3], flat: f64) {
        self.needed = vec![false; self.vertices.len()];
        let mut chain = Vec::new();
        for c in 0..self.count() {
            let (first, last) = (self.start[c], self.start[c + 1]);
            chain.clear();
            chain.extend(self.vertices[first..last].iter().map(|v| points[v.index()]));
            let needed = &mut self.needed[first..last];
            let end = chain.len() - 1;
            if self.vertices[first] != self.vertices[last - 1] {
                (needed[0], needed[end]) = (true, true);
                split(&chain, 0, end, flat, needed);
            } else {
                let closed = &mut self.vertices[first..last];
                if self.is_free[c] {
                    // A closed chain without a corner may start anywhere: starting at its farthest vertex
                    // avoids keeping a superfluous one.
                    let centre = chain[..end].iter().sum::<DVec3>() / end as f64;
                    let tip = farthest(&chain[..end], |p| p.distance_squared(centre));
                    closed[..end].rotate_left(tip);
                    closed[end] = closed[0];
                    chain[..end].rotate_left(tip);
                    chain[end] = chain[0];
                }
                let across = farthest(&chain[..end], |p| p.distance_squared(chain[0]));
                (needed[0], needed[across], needed[end]) = (true, true, true);
                split(&chain, 0, across, flat, needed);
                split(&chain, across, end, flat, needed);
                if needed[..end].iter().filter(|n| **n).count() < 3 {
                    let aside = |p: DVec3| to_segment_sq(p, chain[0], chain[across]);
                    needed[farthest(&chain[..end], aside)] = true;
                }
            }
            self.needed_edges.push(needed.iter().filter(|n| **n).count() - 1);
        }
    }

    pub(super) fn count(&self) -> usize {
        self.start.len() - 1
    }
    /// Returns the regions along a chain, sorted; a region on both sides occurs twice.
    pub(super) fn sides(&self, chain: usize) -> &[ChainSide] {
        &self.sides[self.side_start[chain]..self.side_start[chain + 1]]
    }
    /// Number of vertices that can be dropped.
    pub(super) fn needless(&self, chain: usize) -> usize {
        self.edge_count(chain) - self.needed_edges[chain]
    }
    pub(super) fn edge_count(&self, chain: usize) -> usize {
        self.start[chain + 1] - self.start[chain] - 1
    }
    /// Returns the vertices of a chain: all, or the needed ones.
    pub(super) fn vertices(&self, chain: usize, all: bool) -> impl Iterator<Item = VertexId> + '_ {
        let range = self.start[chain]..self.start[chain + 1];
        range.filter(move |&i| all || self.needed[i]).map(|i| self.vertices[i])
    }
}

/// Collects the regions along an edge, sorted, seen in its direction or against it.
fn sides(topology: &Topology, regions: &Regions, h: HalfEdgeId, along: bool, out: &mut Vec<ChainSide>) {
    out.clear();
    out.extend(topology.edge(h).map(|g| ChainSide {
        region: regions.of_face[g.face().index()],
        is_forward: (topology.origin(g) == topology.origin(h)) == along,
    }));
    out.sort_unstable();
}

/// Marks the vertices between two vertices of a chain that are farther than `flat` from the edges that
/// replace them.
fn split(chain: &[DVec3], first: usize, last: usize, flat: f64, needed: &mut [bool]) {
    let mut open = vec![(first, last, 0)];
    while let Some((a, b, depth)) = open.pop() {
        let (mut worst, mut at) = (flat * flat, None);
        for i in a + 1..b {
            let d = to_segment_sq(chain[i], chain[a], chain[b]);
            if d > worst {
                (worst, at) = (d, Some(i));
            }
        }
        if let Some(i) = at {
            let i = if depth < MAX_SPLIT_DEPTH { i } else { a + (b - a) / 2 };
            needed[i] = true;
            open.extend([(a, i, depth + 1), (i, b, depth + 1)]);
        }
    }
}

/// Returns the first point with the largest `size`.
fn farthest(points: &[DVec3], size: impl Fn(DVec3) -> f64) -> usize {
    let better = |best: (usize, f64), (i, &p): (usize, &DVec3)| {
        let s = size(p);
        if s > best.1 { (i, s) } else { best }
    };
    points.iter().enumerate().fold((0, f64::NEG_INFINITY), better).0
}

fn to_segment_sq(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let (ab, ap) = (b - a, p - a);
    let length_sq = ab.length_squared();
    let t = if length_sq > 0.0 { (ap.dot(ab) / length_sq).clamp(0.0, 1.0) } else { 0.0 };
    (ap - ab * t).length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(points: &[[f64; 2]], flat: f64) -> Vec<usize> {
        let chain: Vec<DVec3> = points.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect();
        let mut needed = vec![false; chain.len()];
        split(&chain, 0, chain.len() - 1, flat, &mut needed);
        (0..chain.len()).filter(|&i| needed[i]).collect()
    }

    #[test]
    fn vertices_on_a_line_are_not_needed() {
        //            4
        // 0--1--2--3/
        let points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [4.0, 1.0]];
        assert_eq!(kept(&points, 1e-9), [3]);
        assert_eq!(kept(&points, 1.0), []);
        // Out and back: the tip is needed, although it lies on the line.
        assert_eq!(kept(&[[0.0, 0.0], [1.0, 0.0], [4.0, 0.0], [2.0, 0.0]], 1e-9), [2]);
    }

    #[test]
    fn chains_with_uneven_splits_are_quick() {
        // Here the farthest vertex is always the next one.
        let points: Vec<[f64; 2]> =
            (0..200_000).map(|i| [f64::from(i), (-f64::from(i) / 300.0).exp() * f64::from(i % 2)]).collect();
        let kept = kept(&points, 1e-9);
        assert!(kept.len() < points.len() && kept.len() > 1000, "{}", kept.len());
    }
}
