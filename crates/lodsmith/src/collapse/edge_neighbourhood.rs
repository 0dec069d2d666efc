//! Neighbourhood of an edge, for metrics that compute its cost from the stars of its ends.

use lodsmith_core::VertexId;

use super::candidate::{Candidate, Found, OwnedEdges};
use super::ring::{Ring, Spoke};
use super::star_edges::Edge;
use super::{LiveMesh, Scratch, Tally};
use crate::cost::guard::BORDER_WEIGHT;
use crate::cost::metric::{
    AllowedPlace, CostSource, EdgeNeighbourhood, EdgePart, FeatureLine, Metric, StarTriangle,
};
use crate::options::Placement;
use crate::report::Refusal;

impl<M: Metric> LiveMesh<M> {
    /// Returns the positions that kinds and options allow for the merged vertex of u-v; `None` if neither
    /// end may move.
    pub(super) fn allowed_place(&self, u: VertexId, v: VertexId) -> Option<AllowedPlace> {
        let [x, z] = [u, v].map(|w| self.store.v[w.index()].kind);
        Some(match (x, z) {
            (k, l) if k.is_free() && l.is_free() => match self.constraints.rules.placement {
                Placement::Optimal => AllowedPlace::Anywhere,
                Placement::Endpoint => AllowedPlace::Ends,
                Placement::Midpoint => AllowedPlace::Middle,
            },
            (k, l) if k.is_fixed() && l.is_fixed() => return None,
            (k, _) if k.is_fixed() => AllowedPlace::Kept,
            (_, l) if l.is_fixed() => AllowedPlace::Removed,
            // Both ends are on the curve; a point between them would be on its chord.
            (k, l) if k.is_rail() && l.is_rail() => AllowedPlace::Ends,
            (k, _) if k.is_rail() => AllowedPlace::Kept,
            _ => AllowedPlace::Removed,
        })
    }

    /// Evaluates the edges from `u` to `owned` one by one with the metric. Returns the number of edges that
    /// must not be collapsed.
    #[inline(never)]
    pub(super) fn evaluate_owned_by_metric(
        &self,
        &OwnedEdges { u, owned, ring: ru, max_cost, .. }: &OwnedEdges<'_>,
        found: &mut Found,
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> u64 {
        let mut rv = std::mem::take(&mut scratch.other_ring);
        let mut stuck = 0;
        for &v in owned {
            if !matches!(self.cost.metric.cost_source(), CostSource::Ends)
                && !tally.hub_budget.admit(ru.len() + self.store.listed(v).len())
            {
                tally.refuse(Refusal::Valence);
                continue;
            }
            match self.cost.metric.cost_source() {
                CostSource::Ends => rv.clear(),
                _ => self.store.ring(v, &mut rv),
            }
            match self.candidate_by_metric(u, v, ru, &rv, scratch, tally) {
                Some(c) if c.cost <= self.constraints.rules.max_cost => found.add(c, max_cost),
                Some(_) => {}
                // An edge beyond the cost limit does not count as refused.
                None => stuck += u64::from(self.is_within_limit(u, v)),
            }
        }
        scratch.other_ring = rv;
        stuck
    }

    /// True if the squared length of an edge is within the cost limit.
    fn is_within_limit(&self, u: VertexId, v: VertexId) -> bool {
        (self.store.p(v) - self.store.p(u)).length_squared() <= self.constraints.rules.max_cost
    }

    /// Returns the candidate of the edge u-v by the metric; `None` if it must not be collapsed.
    #[inline(never)]
    pub(super) fn candidate_by_metric(
        &self,
        u: VertexId,
        v: VertexId,
        ru: &Ring,
        rv: &Ring,
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> Option<Candidate> {
        let place = self.allowed_place(u, v)?;
        tally.faces_visited += (ru.len() + rv.len()) as u64;
        let Scratch { neighbourhood: around, edges, .. } = scratch;
        self.collect_neighbourhood([u, v], place, [ru, rv], around, edges);
        let evaluated = self.cost.metric.evaluate(around, self.cost.mean_face);
        // (An infinite cost, on inputs of extreme sizes, would look like an unknown one.)
        evaluated.map(|(cost, step)| Candidate {
            cost: cost.clamp(0.0, f32::MAX),
            removed: v,
            step,
            form_cost: 0.0,
        })
    }

    fn collect_neighbourhood(
        &self,
        [u, v]: [VertexId; 2],
        place: AllowedPlace,
        [ru, rv]: [&Ring; 2],
        around: &mut EdgeNeighbourhood,
        edges: &mut Vec<Edge>,
    ) {
        let origin = self.store.p(u).as_dvec3();
        let at = |w: VertexId| self.store.p(w).as_dvec3() - origin;
        around.d = at(v);
        around.place = place;
        around.triangles.clear();
        around.lines.clear();
        let stars = !matches!(self.cost.metric.cost_source(), CostSource::Ends);
        if stars {
            let wall = |r: &Spoke, side: EdgePart| StarTriangle { at: side, a: at(r.a), b: at(r.b) };
            let of_u = |r: &Spoke| wall(r, if r.has(v) { EdgePart::Both } else { EdgePart::Kept });
            around.triangles.extend(ru.iter().map(of_u));
            around.triangles.extend(rv.iter().filter(|r| !r.has(u)).map(|r| wall(r, EdgePart::Removed)));
        }
        let [x, z] = [u, v].map(|w| self.store.v[w.index()].kind);
        around.on_lines = [x.has_lines(), z.has_lines()].map(|on| on && self.has_lines());
        if around.on_lines == [false; 2] {
            return;
        }
        let mut line = |edge: &Edge, seams: bool, side: EdgePart| {
            let weight = f64::from(self.weight_of(edge, seams) / BORDER_WEIGHT);
            if weight > 0.0 {
                around.lines.push(FeatureLine { at: side, to: at(edge.to), weight, sense: edge.sense() });
            }
        };
        if !stars {
            if let Some(edge) = self.store.edge(ru, v) {
                line(&edge, x.is_seam() && z.is_seam(), EdgePart::Both);
            }
            return;
        }
        // (All edges at once: one at a time would take quadratic time.)
        if around.on_lines[0] {
            self.store.edges(ru, x, edges);
            for edge in edges.iter() {
                line(edge, x.is_seam(), if edge.to == v { EdgePart::Both } else { EdgePart::Kept });
            }
        }
        if around.on_lines[1] {
            self.store.edges(rv, z, edges);
            for edge in edges.iter().filter(|e| e.to != u) {
                line(edge, z.is_seam(), EdgePart::Removed);
            }
        }
    }
}
