//! Seams, edges whose two sides differ in wedges or regions: their line weights, and the collapses that they
//! refuse.

use lodsmith_core::VertexId;

use super::ring::{Ring, Spoke, faces_at};
use super::star_edges::{Edge, Looseness, Side};
use super::{Engine, LiveMesh};
use crate::cost::metric::Metric;
use crate::report::Refusal;

/// Weight of the line of a seam edge relative to the planes of faces: a seam that leaves its line shows
/// texture from outside the chart. (Guessed, a fifth of a border's weight.)
pub(crate) const SEAM_WEIGHT: f32 = 2.0;
/// Weight of the line of a soft seam: a crease of normals, or nearly continuous texture coordinates.
const SOFT_SEAM_WEIGHT: f32 = 0.5;
/// Weight of the line of a seam edge in a quick pass. (Of .3 to 2, 1 has the least RMS on the primitives of seven
/// models with seams: 3 % below 2.)
const QUICK_SEAM_WEIGHT: f32 = 1.0;
/// Weight of the line of a sharp edge that the options make a feature. (The same as for a border. Measured
/// only at that weight: the crest of a curved ridge is .3 to .7 times as far away; docs/methods/memoryless.md
/// has machine parts.)
const CREASE_WEIGHT: f32 = 10.0;
/// Collapses refused by seams, as a share of the collapses after sweeps became unproductive, from which a run
/// whose seams move is tried too. (Measured on 16 models at 70 to 2 %: with a smaller share it is at most a fifth
/// closer, too little to be chosen; where it is chosen, the share is .74 and more.)
const MIN_REFUSED_SHARE: f64 = 0.5;
/// Faces of a result below which one refused collapse is enough: a few collapses show no share, and take no time.
/// (spot_control_mesh at 25 %, with 92 faces, has 5 of 24, and is a quarter closer with moved seams.)
const SMALL_RESULT_FACES: usize = 100;

impl<M: Metric> Engine<M> {
    /// True if a run that kept seams on their lines became expensive, and seams refused many collapses then.
    pub(crate) fn has_blocking_seams(&self) -> bool {
        let is_often = || self.tally.refused_since(Refusal::Seam) >= MIN_REFUSED_SHARE;
        self.tally.is_unproductive
            && !self.mesh.has_relaxed_seams()
            && self.tally.has_refused(Refusal::Seam)
            && (self.mesh.store.live_faces < SMALL_RESULT_FACES || is_often())
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Returns the weight of the line along the edge from the centre of a star to `w`; 0 for an inner edge.
    pub(crate) fn line_weight(&self, ring: &[Spoke], w: VertexId, seams: bool) -> f32 {
        self.store.edge(ring, w).map_or(0.0, |edge| self.weight_of(&edge, seams))
    }

    /// Returns the weight of the line along an edge of a star.
    #[inline(always)]
    pub(super) fn weight_of(&self, edge: &Edge, seams: bool) -> f32 {
        if edge.faces != 2 {
            return self.constraints.rules.border_weight;
        }
        if seams && edge.is_sharp() {
            return CREASE_WEIGHT;
        }
        match edge.other.filter(|_| seams) {
            Some(other) if self.is_hard(&edge.side, &other) => self.hard_seam_weight(),
            Some(_) => SOFT_SEAM_WEIGHT,
            None => 0.0,
        }
    }

    fn hard_seam_weight(&self) -> f32 {
        if self.constraints.rules.is_quick { QUICK_SEAM_WEIGHT } else { SEAM_WEIGHT }
    }

    /// True if an edge still refuses collapses when sharp edges no longer do.
    fn is_hard_edge(&self, edge: &Edge) -> bool {
        let is_hard = |other: &Side| edge.side.is_other(other) && self.is_hard(&edge.side, other);
        edge.faces != 2 || edge.other.as_ref().is_some_and(is_hard)
    }

    /// True if a seam separates regions, or was hard in the input.
    fn is_hard(&self, s: &Side, t: &Side) -> bool {
        if s.region != t.region && self.store.class(s.region) != self.store.class(t.region) {
            return true;
        }
        if let (Some(data), Some(_)) = (&self.values.wedge_data, self.split_vertices()) {
            return !(data.sides.same(s.here, t.here) && data.sides.same(s.there, t.there));
        }
        if self.constraints.rules.is_quick {
            return true;
        }
        let Some(attributes) = &self.values.attributes else { return s.region == t.region };
        let here = |s: &Side| attributes.heads[s.here.index()].hard[usize::from(s.ends)];
        let there = |s: &Side| attributes.heads[s.there.index()].hard[usize::from(!s.ends)];
        (here(s) || here(t)) && (there(s) || there(t))
    }

    /// Marks the wedges of hard seams around a vertex: if texture coordinates jump farther than the extent of
    /// the faces on both sides, the other side is another piece of the texture. Smaller jumps occur between
    /// faces that use the same piece, as in palettes.
    pub(super) fn mark_hard_seams(&mut self, u: VertexId, edges: &[Edge]) {
        let (Some(attributes), Some(wedges)) = (&mut self.values.attributes, &self.store.wedges) else {
            return;
        };
        if attributes.textures.is_empty() {
            return;
        }
        // An edge of two faces gives the same result from both ends.
        for edge in edges.iter().filter(|e| e.faces != 2 || e.to > u) {
            let (s, Some(t)) = (edge.side, edge.other) else { continue };
            let jump =
                attributes.uv_distance_sq(s.here, t.here).max(attributes.uv_distance_sq(s.there, t.there));
            let reaches = |s: Side| attributes.uv_extent_sq(wedges[s.face as usize]) >= jump;
            if jump > 0.0 && !reaches(s) && !reaches(t) {
                for s in [s, t] {
                    attributes.heads[s.here.index()].hard[usize::from(s.ends)] = true;
                    if edge.faces == 2 {
                        attributes.heads[s.there.index()].hard[usize::from(!s.ends)] = true;
                    }
                }
            }
        }
    }

    /// Checks that seams and regions allow the collapse: two vertices on borders of regions merge only along
    /// such a border, and no face is removed that has lines on all sides. (Two vertices on other seams may
    /// merge across: the line tensors set the cost. When that was refused too, CesiumMan lost its limbs at 10
    /// %, because nothing else was left. For the same reason a quick pass removes the last face of a chart: its
    /// RMS was 3 times as large otherwise.)
    pub(crate) fn check_seams(&self, u: VertexId, v: VertexId, ru: &Ring, rv: &Ring) -> Result<(), Refusal> {
        let (ku, kv) = (self.store.v[u.index()].kind, self.store.v[v.index()].kind);
        if self.constraints.looseness == Looseness::Regions
            || !(ku.is_seam() || kv.is_seam())
            || !(ku.has_lines() && kv.has_lines())
        {
            return Ok(());
        }
        let is_line = |ring: &Ring, w| match self.constraints.looseness {
            Looseness::None => self.line_weight(ring, w, true) > SOFT_SEAM_WEIGHT,
            Looseness::Creases => self.store.edge(ring, w).is_some_and(|edge| self.is_hard_edge(&edge)),
            _ => faces_at(ring, w) != 2 || self.store.is_region_edge(ring, w),
        };
        if !is_line(ru, v) {
            let both = self.store.meets_classes(ru) && self.store.meets_classes(rv);
            let creases = || self.store.meets_creases(ru) && self.store.meets_creases(rv);
            let refuses = both || self.constraints.looseness == Looseness::None && creases();
            return if refuses { Err(Refusal::Seam) } else { Ok(()) };
        }
        if self.constraints.rules.is_quick {
            return Ok(());
        }
        for r in ru.iter().filter(|r| r.has(v)) {
            let apex = if r.a == v { r.b } else { r.a };
            if is_line(ru, apex) && is_line(rv, apex) {
                return Err(Refusal::Seam);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapse::test_support::{engine_of, without_lines};
    use crate::cost::metric::Memoryless;
    use crate::test_support::sheet;

    #[test]
    fn seams_block_if_they_refuse_many_collapses_of_an_unproductive_run() {
        let mut engine = engine_of(Memoryless, &sheet(8), &without_lines());
        // 10 of 100 collapses were done, and 50 refused, before the run became unproductive.
        engine.tally.collapses = 100;
        engine.tally.while_productive.0 = 90;
        engine.tally.while_productive.1[Refusal::Seam as usize] = 50;
        let mut is_blocked = |refused, is_unproductive, live_faces| {
            engine.tally.refusals[Refusal::Seam as usize] = refused;
            (engine.tally.is_unproductive, engine.mesh.store.live_faces) = (is_unproductive, live_faces);
            engine.has_blocking_seams()
        };
        assert!(is_blocked(55, true, 100));
        assert!(!is_blocked(54, true, 100), "less than half of the collapses since then");
        assert!(!is_blocked(55, false, 100), "collapses stayed cheap");
        assert!(is_blocked(51, true, 99), "a small result is compared anyway");
        assert!(!is_blocked(0, true, 99), "no seam refused a collapse");
    }
}
