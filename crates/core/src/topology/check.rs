//! Check of all invariants of the topology.

use crate::ids::{HalfEdgeId, VertexId};
use crate::topology::{NO_RING, Topology};

impl Topology {
    /// Checks every invariant of the tables; for tests.
    ///
    /// Cost: O(n), and O(k²) at an edge with k faces.
    ///
    /// # Panics
    /// If one does not hold, with a message that names it.
    pub fn check(&self) {
        let half_edges = || (0..self.origin.len() as u32).map(HalfEdgeId);
        assert_eq!(self.ring.len(), self.origin.len(), "each half-edge has an entry in the ring table");
        for h in half_edges() {
            let is_live = !self.is_degenerate(h.face());
            assert_eq!(self.ring[h.index()] != NO_RING, is_live, "only live half-edges have rings: {h}");
            let ends = [self.origin(h), self.target(h)];
            let mut length = 0;
            for g in self.edge(h) {
                let other = [self.origin(g), self.target(g)];
                assert!(
                    other == ends || other == [ends[1], ends[0]],
                    "{g} has the same ends as {h}, whose ring contains it"
                );
                length += 1;
                assert!(length <= self.origin.len(), "the ring of {h} closes");
            }
            assert_eq!(length == 0, !is_live, "the ring of {h} contains it");
        }
        // Two rings over the same vertices would make one edge count as two.
        let mut edges: Vec<[VertexId; 2]> = self
            .edges()
            .map(|h| {
                let (a, b) = (self.origin(h), self.target(h));
                [a.min(b), a.max(b)]
            })
            .collect();
        let count = edges.len();
        edges.sort_unstable();
        edges.dedup();
        assert_eq!(edges.len(), count, "each edge is one ring");

        let mut seen = vec![false; self.origin.len()];
        for v in (0..self.vertex_count() as u32).map(VertexId) {
            let view = self.vertex(v);
            for c in view.corners() {
                assert_eq!(self.origin(*c), v, "corner {c} is listed at its own vertex");
                assert!(!std::mem::replace(&mut seen[c.index()], true), "corner {c} is listed once");
            }
            for fan in view.fans() {
                let walked: Vec<HalfEdgeId> = self.fan_through(fan[0]).map(|step| step.corner).collect();
                assert_eq!(walked, fan, "the fans at {v} are in order");
            }
            let mut around: Vec<VertexId> =
                view.corners().iter().flat_map(|c| [self.target(*c), self.origin(c.prev())]).collect();
            around.sort_unstable();
            around.dedup();
            let mut ring: Vec<VertexId> = view.one_ring().collect();
            ring.sort_unstable();
            assert_eq!(ring, around, "the one-ring of {v} lists each neighbour once");
        }
        for h in half_edges() {
            assert_eq!(seen[h.index()], !self.is_degenerate(h.face()), "only live corners are listed: {h}");
        }
    }
}
