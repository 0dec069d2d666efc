//! What a metric sees that judges an edge from the stars of its ends.

use lodsmith_core::VertexId;

use super::commit::Candidate;
use super::evaluate::{Found, OwnedEdges};
use super::seams::Edge;
use super::store::{Ring, Spoke};
use super::{LiveMesh, Scratch, Tally};
use crate::guard::BORDER_WEIGHT;
use crate::metric::{Around, At, Judge, Line, Metric, Place, Wall};
use crate::options::Placement;
use crate::report::Refusal;

impl<M: Metric> LiveMesh<M> {
    /// Where kinds and options let the merged vertex of u-v go; `None` if neither end may move.
    pub(super) fn place(&self, u: VertexId, v: VertexId) -> Option<Place> {
        let [x, z] = [u, v].map(|w| self.store.v[w.index()].kind);
        Some(match (x, z) {
            (k, l) if k.is_free() && l.is_free() => match self.constraints.rules.placement {
                Placement::Optimal => Place::Anywhere,
                Placement::Endpoint => Place::Ends,
                Placement::Midpoint => Place::Middle,
            },
            (k, l) if k.is_fixed() && l.is_fixed() => return None,
            (k, _) if k.is_fixed() => Place::Kept,
            (_, l) if l.is_fixed() => Place::Removed,
            // Both ends are points of the curve; what lies between is a chord of it.
            (k, l) if k.is_rail() && l.is_rail() => Place::Ends,
            (k, _) if k.is_rail() => Place::Kept,
            _ => Place::Removed,
        })
    }

    /// Adds what the metric says of the edges from `u` to `owned`, each by itself. Says how many may not go.
    #[inline(never)]
    pub(super) fn judge_owned(
        &self,
        &OwnedEdges { u, owned, ring: ru, most, .. }: &OwnedEdges<'_>,
        found: &mut Found,
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> u64 {
        let mut rv = std::mem::take(&mut scratch.other_ring);
        let mut stuck = 0;
        for &v in owned {
            if !matches!(self.cost.metric.decides(), Judge::Ends)
                && !tally.crowds.admit(ru.len() + self.store.listed(v).len())
            {
                tally.refuse(Refusal::Valence);
                continue;
            }
            match self.cost.metric.decides() {
                Judge::Ends => rv.clear(),
                _ => self.store.ring(v, &mut rv),
            }
            match self.judged(u, v, ru, &rv, scratch, tally) {
                Some(c) if c.cost <= self.constraints.rules.max_cost => found.add(c, most),
                Some(_) => {}
                // What is beyond the limit anyway is not refused.
                None => stuck += u64::from(self.is_within_limit(u, v)),
            }
        }
        scratch.other_ring = rv;
        stuck
    }

    /// Whether the squared length of an edge is no more than costs may be, where they have a limit.
    fn is_within_limit(&self, u: VertexId, v: VertexId) -> bool {
        (self.store.p(v) - self.store.p(u)).length_squared() <= self.constraints.rules.max_cost
    }

    /// What the metric says of the edge u-v; `None` if it may not go.
    #[inline(never)]
    pub(super) fn judged(
        &self,
        u: VertexId,
        v: VertexId,
        ru: &Ring,
        rv: &Ring,
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> Option<Candidate> {
        let place = self.place(u, v)?;
        tally.faces_visited += (ru.len() + rv.len()) as u64;
        let Scratch { around, edges, .. } = scratch;
        self.look_around([u, v], place, [ru, rv], around, edges);
        let judged = self.cost.metric.judge(around, self.cost.mean_face);
        // (A cost without bound, on input of extreme sizes, would look like one that is not known.)
        judged.map(|(cost, step)| Candidate { cost: cost.clamp(0.0, f32::MAX), removed: v, step, sure: 0.0 })
    }

    fn look_around(
        &self,
        [u, v]: [VertexId; 2],
        place: Place,
        [ru, rv]: [&Ring; 2],
        around: &mut Around,
        edges: &mut Vec<Edge>,
    ) {
        let origin = self.store.p(u).as_dvec3();
        let at = |w: VertexId| self.store.p(w).as_dvec3() - origin;
        around.d = at(v);
        around.place = place;
        around.walls.clear();
        around.lines.clear();
        let stars = !matches!(self.cost.metric.decides(), Judge::Ends);
        if stars {
            let wall = |r: &Spoke, side: At| Wall { at: side, a: at(r.a), b: at(r.b) };
            let of_u = |r: &Spoke| wall(r, if r.has(v) { At::Both } else { At::Kept });
            around.walls.extend(ru.iter().map(of_u));
            around.walls.extend(rv.iter().filter(|r| !r.has(u)).map(|r| wall(r, At::Removed)));
        }
        let [x, z] = [u, v].map(|w| self.store.v[w.index()].kind);
        around.on_lines = [x.has_lines(), z.has_lines()].map(|on| on && self.has_lines());
        if around.on_lines == [false; 2] {
            return;
        }
        let mut line = |edge: &Edge, seams: bool, side: At| {
            let weight = f64::from(self.weight_of(edge, seams) / BORDER_WEIGHT);
            if weight > 0.0 {
                around.lines.push(Line { at: side, to: at(edge.to), weight, sense: edge.sense() });
            }
        };
        if !stars {
            if let Some(edge) = self.store.edge(ru, v) {
                line(&edge, x.is_seam() && z.is_seam(), At::Both);
            }
            return;
        }
        // (All edges at once: one by one they would take quadratic time.)
        if around.on_lines[0] {
            self.store.edges(ru, x, edges);
            for edge in edges.iter() {
                line(edge, x.is_seam(), if edge.to == v { At::Both } else { At::Kept });
            }
        }
        if around.on_lines[1] {
            self.store.edges(rv, z, edges);
            for edge in edges.iter().filter(|e| e.to != u) {
                line(edge, z.is_seam(), At::Removed);
            }
        }
    }
}
