//! Traversal of the neighbourhood of a vertex.

use crate::ids::{HalfEdgeId, VertexId};
use crate::topology::Topology;

/// A vertex and its neighbourhood; borrows the topology.
#[derive(Clone, Copy, Debug)]
pub struct VertexView<'a> {
    topology: &'a Topology,
    vertex: VertexId,
    corners: &'a [HalfEdgeId],
}

impl<'a> VertexView<'a> {
    pub(crate) fn new(topology: &'a Topology, vertex: VertexId) -> Self {
        let v = vertex.index();
        let (first, last) = (topology.corner_start[v] as usize, topology.corner_start[v + 1] as usize);
        Self { topology, vertex, corners: &topology.corners[first..last] }
    }
    /// The vertex.
    pub fn id(&self) -> VertexId {
        self.vertex
    }
    /// The half-edges that leave the vertex: one for each face, fan after fan, counter-clockwise if the faces
    /// are consistently oriented.
    ///
    /// Empty for a vertex that no face uses, or that was welded to another.
    pub fn corners(&self) -> &'a [HalfEdgeId] {
        self.corners
    }
    /// The number of fans: faces connected across edges with two faces. One at a manifold vertex.
    pub fn fan_count(&self) -> usize {
        self.fans().count()
    }
    /// The corners of each fan.
    pub fn fans(&self) -> impl Iterator<Item = &'a [HalfEdgeId]> + use<'a> {
        let topology = self.topology;
        let mut rest = self.corners;
        std::iter::from_fn(move || {
            let size = topology.fan_through(*rest.first()?).count();
            let (fan, after) = rest.split_at(size);
            rest = after;
            Some(fan)
        })
    }
    /// True if an edge at the vertex has only one face.
    pub fn is_on_border(&self) -> bool {
        let is_border = |h: HalfEdgeId| self.topology.ring[h.index()] == h;
        self.corners.iter().any(|&c| is_border(c) || is_border(c.prev()))
    }
    /// The vertices that share an edge with this one, each once; in order around it within a fan.
    pub fn one_ring(&self) -> OneRing<'a> {
        OneRing { topology: self.topology, rest: self.corners, fan: None, last: None }
    }
}

/// The vertices around a vertex, each once.
#[derive(Clone, Debug)]
pub struct OneRing<'a> {
    topology: &'a Topology,
    rest: &'a [HalfEdgeId],
    fan: Option<Fan<'a>>,
    /// The edge that ends an open fan.
    last: Option<(HalfEdgeId, VertexId)>,
}

impl Iterator for OneRing<'_> {
    type Item = VertexId;

    fn next(&mut self) -> Option<VertexId> {
        let topology = self.topology;
        // Edges with at least three faces end several fans: only the lowest half-edge reports the neighbour.
        let is_listed = |h: HalfEdgeId| topology.twin(h).is_some() || topology.is_first_of_edge(h);
        loop {
            if let Some(fan) = &mut self.fan {
                if let Some(step) = fan.next() {
                    self.rest = &self.rest[1..];
                    let leaving = step.leaving();
                    let ends = fan.at.is_none() && topology.twin(leaving).is_none();
                    self.last = ends.then(|| (leaving, step.vertex_across(topology, leaving)));
                    let entering = step.entering();
                    if is_listed(entering) {
                        return Some(step.vertex_across(topology, entering));
                    }
                    continue;
                }
                self.fan = None;
                if let Some((h, vertex)) = self.last.take()
                    && is_listed(h)
                {
                    return Some(vertex);
                }
            }
            self.fan = Some(topology.fan_through(*self.rest.first()?));
        }
    }
}

/// A corner in a traversal around its vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FanStep {
    /// The half-edge that leaves the vertex.
    pub(crate) corner: HalfEdgeId,
    /// True if the traversal follows the winding: enters by the leaving half-edge, exits by the arriving one.
    forward: bool,
}

impl FanStep {
    fn entering(self) -> HalfEdgeId {
        if self.forward { self.corner } else { self.corner.prev() }
    }
    fn leaving(self) -> HalfEdgeId {
        if self.forward { self.corner.prev() } else { self.corner }
    }
    fn turned(self) -> Self {
        Self { forward: !self.forward, ..self }
    }
    /// The other end of one of the two edges of the corner.
    fn vertex_across(self, topology: &Topology, h: HalfEdgeId) -> VertexId {
        if h == self.corner { topology.target(h) } else { topology.origin(h) }
    }
    /// Returns the corner across the leaving edge, if exactly one other face is there.
    fn across(self, topology: &Topology) -> Option<Self> {
        let h = self.leaving();
        let g = topology.twin(h)?;
        let vertex = topology.origin(self.corner);
        Some(if topology.origin(g) == vertex {
            Self { corner: g, forward: true }
        } else {
            Self { corner: g.next(), forward: false }
        })
    }
}

/// The corners of a fan, from its open end or, if it is closed, from the given corner.
#[derive(Clone, Debug)]
pub(crate) struct Fan<'a> {
    topology: &'a Topology,
    first: HalfEdgeId,
    at: Option<FanStep>,
}

impl Iterator for Fan<'_> {
    type Item = FanStep;

    fn next(&mut self) -> Option<FanStep> {
        let step = self.at?;
        self.at = step.across(self.topology).filter(|next| next.corner != self.first);
        Some(step)
    }
}

impl Topology {
    /// Returns the view of a vertex.
    ///
    /// # Panics
    /// If there is no such vertex.
    #[inline]
    pub fn vertex(&self, vertex: VertexId) -> VertexView<'_> {
        VertexView::new(self, vertex)
    }

    /// Returns the fan that a corner belongs to.
    ///
    /// Starting from the first corner of the result gives the same result.
    pub(crate) fn fan_through(&self, corner: HalfEdgeId) -> Fan<'_> {
        let own = FanStep { corner, forward: true };
        let first = match self.end_of_fan(own.turned()) {
            None => own,
            Some(end) => {
                // If a face is flipped, either end may be the start: prefer the one that follows the winding
                // of its face, then the lower. An open fan has two ends, so the other exists.
                let other = self.end_of_fan(end.turned()).unwrap_or(end);
                let (a, b) = (end.turned(), other.turned());
                if (!a.forward, a.corner) <= (!b.forward, b.corner) { a } else { b }
            }
        };
        Fan { topology: self, first: first.corner, at: Some(first) }
    }

    /// Returns the last step of a traversal of a fan; `None` if the fan is closed.
    fn end_of_fan(&self, from: FanStep) -> Option<FanStep> {
        let mut at = from;
        loop {
            match at.across(self) {
                None => return Some(at),
                Some(next) if next.corner == from.corner => return None,
                Some(next) => at = next,
            }
        }
    }
}
