//! Data of a vertex that follow from its star (kind and tensor), at the start and after changes.

use lodsmith_core::VertexId;
use prefetch_index::prefetch_index;
use wide::f32x4;

use super::LiveMesh;
use super::kind::Kind;
use super::order;
use super::ring::Ring;
use super::star_edges::Edge;
use super::store::{Ends, Store};
use super::vertex::{self, Normals, Vertex};
use crate::cost::lanes::{self, cross, dot, sub};
use crate::cost::metric::{CostSource, Metric};
use crate::cost::tensor::Tensor;

/// Number of vertices from which prefetching is worthwhile: smaller meshes fit into the caches. (Measured.)
pub(super) const PREFETCH_MIN_VERTICES: usize = 32_768;
/// Prefetch distance in loops over all faces, in groups of four faces. (Guessed.)
const PREFETCH_FOURS_AHEAD: usize = 4;

impl<M: Metric> LiveMesh<M> {
    /// Computes the kinds of all vertices, right after the corner lists were filled up to these ends and
    /// while only locks are known; removes duplicate faces. Returns the vertices that may not be regular, and
    /// the number of faces removed.
    pub(super) fn classify(&mut self, ends: Ends) -> (Vec<VertexId>, usize) {
        self.chain_wedges();
        let (mut ring, mut edges, mut duplicates) = (Ring::default(), Vec::new(), Vec::new());
        let (mut special, mut by_ends) = (Vec::new(), Vec::new());
        let has_seams = self.has_seams();
        for (is_closed, u) in self.store.closed_fans(ends).into_iter().zip((0..).map(VertexId)) {
            // (Most vertices of most meshes, without building a ring. All listed faces are still live.)
            if is_closed
                && (!has_seams || self.is_inside_one_chart(u, self.store.others(u).map(|others| others.0)))
            {
                continue;
            }
            special.push(u);
            self.store.ring(u, &mut ring);
            let kind = Kind::of(&ring, self.constraints.rules.border);
            if !kind.is_regular() {
                by_ends.clear();
                by_ends.extend(ring.iter().enumerate().map(|(i, r)| (r.a, r.b, i)));
                by_ends.sort_unstable();
                let twice = by_ends.windows(2).filter(|w| (w[0].0, w[0].1) == (w[1].0, w[1].1));
                duplicates.extend(twice.map(|w| ring[w[1].2].corner.face()));
            }
            let is_locked = self.store.v[u.index()].kind.is_locked();
            let kind = self.with_seams(kind, u, &ring, &mut edges).locked(is_locked);
            self.store.v[u.index()].kind = kind;
            if kind.is_seam() {
                self.mark_hard_seams(u, &edges);
            }
        }
        duplicates.sort_unstable();
        duplicates.dedup();
        for &face in &duplicates {
            self.store.t[face][0] = order::NONE;
        }
        (special, duplicates.len())
    }

    /// Excludes the vertices among these that no face uses.
    pub(super) fn exclude_unused(&mut self, among: &[VertexId]) {
        for &u in among {
            if self.store.listed(u).is_empty() {
                let x = &mut self.store.v[u.index()];
                x.kind = x.kind.gone();
                self.store.bound[u.index()] = f32::INFINITY;
                self.store.live_vertices -= 1;
            }
        }
    }

    /// Initializes the facings of all vertices, the tensors of the planes around them, and their corner
    /// lists. No vertex may have been initialized before. Returns the ends of the lists.
    pub(super) fn init_quadrics(&mut self) -> Ends {
        if matches!(self.cost.metric.cost_source(), CostSource::FormThenStars) {
            self.cost.mean_face = self.mean_face();
        }
        let mut normals = Normals::zero(self.store.v.len());
        let Store { v, t, .. } = &mut self.store;
        let (v, sums) = (&mut v[..], normals.of_each());
        let mut total_area = 0.0;
        let prefetches = v.len() >= PREFETCH_MIN_VERTICES;
        let (fours, rest) = t.as_chunks::<4>();
        let last = rest.last().map(|last| ([0, 1, 2, 3].map(|i| *rest.get(i).unwrap_or(last)), rest.len()));
        for (i, (faces, count)) in fours.iter().map(|four| (*four, 4)).chain(last).enumerate() {
            if let (true, Some(ahead)) = (prefetches, fours.get(i + PREFETCH_FOURS_AHEAD)) {
                ahead.as_flattened().iter().for_each(|w| prefetch_index(&*v, w.index()));
            }
            let lengths = add_face_quadrics(&self.cost.metric, self.cost.mean_face, (faces, count), v, sums);
            lengths[..count].iter().for_each(|&length| total_area += f64::from(length));
        }
        self.cost.total_area = total_area;
        self.store.link_counted(normals)
    }

    /// Returns the mean of twice the area of a face; above 0.
    pub(super) fn mean_face(&self) -> f32 {
        let doubled = |t: &[VertexId; 3]| {
            let [a, b, c] = t.map(|w| self.store.p(w));
            f64::from((b - a).cross(c - a).length())
        };
        let sum: f64 = self.store.t.iter().map(doubled).sum();
        (sum / self.store.t.len().max(1) as f64).max(1e-30) as f32
    }

    /// Adds the line tensors of all feature edges; their ends are among these vertices.
    pub(super) fn init_lines(&mut self, among: impl IntoIterator<Item = VertexId>) {
        if !self.has_lines() {
            return;
        }
        let (mut ring, mut edges) = (Ring::default(), Vec::new());
        for u in among {
            if self.store.v[u.index()].kind.has_lines() {
                self.store.ring(u, &mut ring);
                self.add_lines(u, &ring, &mut edges);
            }
        }
    }

    pub(super) fn add_lines(&mut self, u: VertexId, ring: &Ring, edges: &mut Vec<Edge>) {
        let mut sum = *M::tensor_of(&self.store.v[u.index()].q);
        self.add_lines_to(&mut sum, u, ring, edges);
        *M::tensor(&mut self.store.v[u.index()].q) = sum;
    }

    /// Adds the line tensors of a star to a tensor.
    pub(super) fn add_lines_to(&self, sum: &mut Tensor, u: VertexId, ring: &Ring, edges: &mut Vec<Edge>) {
        let kind = self.store.v[u.index()].kind;
        let seams = kind.is_seam();
        self.store.edges(ring, kind, edges);
        for edge in edges {
            let weight = self.weight_of(edge, seams);
            if weight > 0.0 {
                sum.add(&self.cost.metric.line(
                    self.store.p(edge.to) - self.store.p(u),
                    weight,
                    self.cost.mean_face,
                ));
            }
        }
    }

    /// Returns a kind with the seams that wedges and regions of the star add to it.
    pub(super) fn with_seams(&self, kind: Kind, u: VertexId, ring: &Ring, edges: &mut Vec<Edge>) -> Kind {
        if !self.has_seams() || self.is_far_from_seams(ring, u) {
            return kind;
        }
        self.store.edges(ring, kind, edges);
        kind.on_seam(edges.iter().any(Edge::is_seam))
    }

    /// Recomputes the kind of a vertex from its star.
    pub(super) fn current_kind(&self, u: VertexId, ring: &Ring) -> Kind {
        let old = self.store.v[u.index()].kind;
        self.with_seams(
            Kind::of(ring, self.constraints.rules.border).moved(old.is_moved()).locked(old.is_locked()),
            u,
            ring,
            &mut Vec::new(),
        )
    }

    /// Recomputes the kind and, if the metric is memoryless, the tensor of a vertex from its star.
    pub(super) fn refresh(&mut self, u: VertexId, ring: &mut Ring) {
        self.store.ring(u, ring);
        self.store.v[u.index()].kind = self.current_kind(u, ring);
        if self.cost.metric.is_memoryless() {
            let mut q = M::Memory::default();
            *M::tensor(&mut q) = self.current_tensor(u, ring);
            self.store.v[u.index()].q = q;
        }
    }

    /// Computes the tensor of a star for a memoryless metric: planes, attributes and lines.
    pub(super) fn current_tensor(&self, u: VertexId, ring: &Ring) -> Tensor {
        let mut sum = self.current_planes(u, ring);
        if self.has_lines() {
            self.add_lines_to(&mut sum, u, ring, &mut Vec::new());
        }
        sum
    }

    /// Computes the tensor of a star for a memoryless metric, without lines.
    pub(super) fn current_planes(&self, u: VertexId, ring: &Ring) -> Tensor {
        let (p, mut sum) = (self.store.p(u), Tensor::default());
        for r in ring.iter() {
            let normal = (self.store.p(r.a) - p).cross(self.store.p(r.b) - p);
            let weight = self.cost.metric.plane_weight(normal.length(), self.cost.mean_face);
            sum.add(&Tensor::outer(normal, weight));
        }
        sum.add(&self.attribute_tensor(u, ring));
        sum
    }
}

/// Adds the planes of the first `count` of four faces to the tensors and the normals of their corners, and
/// counts the corners. Returns twice the areas.
#[inline(always)]
fn add_face_quadrics<M: Metric>(
    metric: &M,
    mean_face: f32,
    (faces, count): ([[VertexId; 3]; 4], usize),
    v: &mut [Vertex<M::Memory>],
    normals: &mut [f32x4],
) -> [f32; 4] {
    let normals = &mut normals[..v.len()];
    let [a, b, c] = [0, 1, 2].map(|k| vertex::four(v, faces.map(|t| t[k])));
    let normal = cross(&sub(&b, &a), &sub(&c, &a));
    let lengths = dot(&normal, &normal).sqrt();
    let weights = metric.plane_weights(lengths, mean_face);
    let planes = lanes::tensors(lanes::outer(&normal, weights));
    let rows = lanes::rows(&normal);
    for i in 0..4 {
        if i == count {
            break;
        }
        for w in faces[i] {
            let x = &mut v[w.index()];
            M::tensor(&mut x.q).add(&planes[i]);
            x.count_corner();
            normals[w.index()] += rows[i];
        }
    }
    lengths.to_array()
}
