//! Handing wedges over in a collapse onto an end, so that attributes are kept and seams are not torn.

use glam::Vec3;
use lodsmith_core::{VertexId, WedgeId};

use super::LiveMesh;
use super::ring::{Ring, Spoke};
use super::wedges::{HandedOver, Wedges};
use crate::cost::metric::Metric;
use crate::report::Refusal;

/// Squared sine of a face's angle at a corner below which the face is a sliver: its values do not determine a
/// gradient across it. (Guessed.)
const MIN_GRAM: f32 = 1e-4;

impl<M: Metric> LiveMesh<M> {
    /// Returns the corners of the end whose position is removed, each with the wedge of the other end that
    /// replaces its own. Wedges are paired where a triangle contains both; a wedge without a partner would be
    /// separated from its side of a seam, so the collapse is refused until seams have to give way.
    #[inline(always)]
    pub(crate) fn wedges_to_hand_over(
        &self,
        u: VertexId,
        v: VertexId,
        step: Vec3,
        off: Vec3,
        ru: &Ring,
        rv: &Ring,
    ) -> Result<HandedOver, Refusal> {
        match (&self.values.wedge_data, &self.store.wedges) {
            (Some(data), Some(_)) => self.exchange_wedges(data, u, v, step, off, ru, rv),
            _ => Ok(Vec::new()),
        }
    }

    #[inline(never)]
    #[expect(clippy::too_many_arguments, reason = "those of a collapse, and the attributes")]
    fn exchange_wedges(
        &self,
        data: &Wedges,
        u: VertexId,
        v: VertexId,
        step: Vec3,
        off: Vec3,
        ru: &Ring,
        rv: &Ring,
    ) -> Result<HandedOver, Refusal> {
        // The end that keeps its position.
        let (kept, gone, kept_ring, gone_ring) =
            if step == Vec3::ZERO || off != Vec3::ZERO { (u, v, ru, rv) } else { (v, u, rv, ru) };
        let at = |r: &Spoke, w: VertexId| self.store.wedge(r.corner.face(), w);
        let pairs: Vec<(WedgeId, WedgeId)> = gone_ring
            .iter()
            .filter(|r| r.has(kept))
            .filter_map(|r| Some((at(r, gone)?, at(r, kept)?)))
            .collect();
        let choices: Vec<WedgeId> = kept_ring.iter().filter_map(|r| at(r, kept)).collect();
        let mut changes = Vec::new();
        for r in gone_ring.iter().filter(|r| !r.has(kept)) {
            let Some(old) = at(r, gone) else { continue };
            let same = pairs.iter().find(|p| p.0 == old).map(|p| p.1);
            let new = same.or_else(|| {
                let side = pairs.iter().find(|p| data.sides.same(p.0, old))?;
                data.best(&choices, Some(side.1), old)
            });
            let new = new.or_else(|| data.best(&choices, None, old).filter(|_| self.has_relaxed_seams()));
            match new {
                Some(new) => changes.push((r.corner, new)),
                None => return Err(Refusal::Seam),
            }
        }
        Ok(changes)
    }

    /// True if values of wedges count in the cost of a collapse onto an end.
    #[inline(always)]
    pub(super) fn counts_wedge_values(&self) -> bool {
        self.values.wedge_data.as_ref().is_some_and(|data| data.values.is_some())
    }

    /// Returns the cost of handing wedges over: over the faces that stay, the sum of twice the area times the
    /// squared difference between the values of the face, extended linearly to the position `at` of the kept
    /// end, and the values of the wedge there. (As planes of faces,
    /// which the merged vertex leaves by a distance.) Differences are multiplied by the square root of twice
    /// the area of these faces: a difference of 1 along an edge counts like a distance of the edge's length,
    /// as in meshoptimizer.
    #[inline(never)]
    pub(super) fn cost_of_wedges(&self, changes: &HandedOver, at: Vec3) -> f32 {
        let (Some(data), Some(wedges)) = (&self.values.wedge_data, &self.store.wedges) else {
            return 0.0;
        };
        let (mut cost, mut area) = (0.0, 0.0);
        for &(corner, new) in changes {
            let (face, k) = (corner.face(), corner.k());
            let [here, next, last] = [k, (k + 1) % 3, (k + 2) % 3];
            let [p, q, r] = [here, next, last].map(|k| self.store.p(self.store.t[face][k]));
            let (a, b, d) = (q - p, r - p, at - p);
            // Coordinates of the foot of `at` in the plane of the face.
            let (aa, ab, bb) = (a.dot(a), a.dot(b), b.dot(b));
            let det = aa * bb - ab * ab;
            let [s, t] = match det > MIN_GRAM * aa * bb {
                true => [bb * a.dot(d) - ab * b.dot(d), aa * b.dot(d) - ab * a.dot(d)].map(|x| x / det),
                false => [0.0; 2],
            };
            let [of_p, of_q, of_r] = [here, next, last].map(|k| data.values(wedges[face][k]));
            let each = of_p.iter().zip(of_q).zip(of_r).zip(data.values(new));
            let off: f32 = each
                .map(|(((p, q), r), new)| {
                    let off = p + s * (q - p) + t * (r - p) - new;
                    off * off
                })
                .sum();
            let doubled = det.max(0.0).sqrt();
            cost += doubled * off;
            area += doubled;
        }
        cost * area
    }

    /// Applies the changes.
    #[inline(always)]
    pub(crate) fn hand_over_wedges(&mut self, changes: &HandedOver) {
        if let Some(wedges) = &mut self.store.wedges {
            for &(corner, wedge) in changes {
                wedges[corner.face()][corner.k()] = wedge;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attributes::sides::SideValues;
    use crate::collapse::Engine;
    use crate::collapse::star_edges::Looseness;
    use crate::collapse::test_support::{assert_near, cost_at, engine_of, ring_of, without_lines};
    use crate::cost::metric::Memoryless;
    use crate::test_support::sheet;

    /// Returns an engine of a sheet of 4 × 4 cells, whose middle column x = 2 has wedges 25 + i on its right,
    /// with these texture coordinates on the left and on the right, and different normals.
    fn with_seam(uvs: [[f32; 2]; 2]) -> Engine<Memoryless> {
        let small = sheet(4);
        let mut engine = engine_of(Memoryless, &small, &without_lines());
        let is_right = |t: &[u32; 3]| t.iter().any(|v| v % 5 > 2);
        let wedges = small.faces.iter().map(|t| t.map(|v| WedgeId(if is_right(t) { v + 25 } else { v })));
        engine.mesh.store.wedges = Some(wedges.collect());
        let side = |w: usize| usize::from(w >= 25);
        engine.mesh.values.wedge_data = Some(Wedges {
            sides: SideValues::of_uvs(&(0..50).map(|w| uvs[side(w)]).collect::<Vec<_>>()),
            normals: Some((0..50).map(|w| [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]][side(w)]).collect()),
            ..Wedges::default()
        });
        engine
    }

    /// Returns the old and new wedges of the corners that change when `v` is merged into `u`, which stays.
    fn handed_over(engine: &Engine<Memoryless>, u: u32, v: u32) -> Result<Vec<[u32; 2]>, Refusal> {
        let [ru, rv] = [u, v].map(|w| ring_of(engine, w));
        let off = engine.mesh.store.p(VertexId(u)) - engine.mesh.store.p(VertexId(v));
        let changes = engine.mesh.wedges_to_hand_over(VertexId(u), VertexId(v), Vec3::ZERO, off, &ru, &rv)?;
        let wedges = engine.mesh.store.wedges.as_ref().expect("there are wedges");
        let mut pairs: Vec<[u32; 2]> =
            changes.iter().map(|(corner, new)| [wedges[corner.face()][corner.k()].0, new.0]).collect();
        pairs.sort_unstable();
        pairs.dedup();
        Ok(pairs)
    }

    #[test]
    fn triangles_that_contain_both_ends_pair_wedges() {
        let engine = with_seam([[0.0, 0.0], [5.0, 0.0]]);
        // Inside a chart, from inside onto the seam, and along the seam.
        assert_eq!(handed_over(&engine, 11, 6), Ok(vec![[6, 11]]));
        assert_eq!(handed_over(&engine, 12, 11), Ok(vec![[11, 12]]));
        assert_eq!(handed_over(&engine, 12, 17), Ok(vec![[17, 12], [42, 37]]));
        // From the seam into a chart the seam would tear: no wedge on the left is in the right piece of the
        // texture.
        assert_eq!(handed_over(&engine, 11, 12), Err(Refusal::Seam));
        // When seams have to give way, the wedge with the nearest normal is taken.
        let mut engine = engine;
        engine.mesh.constraints.looseness = Looseness::Seams;
        assert_eq!(handed_over(&engine, 11, 12), Ok(vec![[12, 11], [37, 11]]));
    }

    #[test]
    fn a_probe_refuses_to_tear_a_seam() {
        // Otherwise sweeps would try it again and again, because the probe found it possible.
        let mut engine = with_seam([[0.0, 0.0], [5.0, 0.0]]);
        assert_eq!(cost_at(&mut engine, [11, 12], Vec3::ZERO), Err(Refusal::Seam));
        assert!(cost_at(&mut engine, [12, 11], Vec3::ZERO).is_ok());
    }

    #[test]
    fn seams_have_lines_if_the_run_requests_them() {
        let mut engine = with_seam([[0.0, 0.0], [5.0, 0.0]]);
        assert!(engine.mesh.split_vertices().is_none());
        let find = |engine: &mut Engine<Memoryless>, has_seam_lines| {
            let LiveMesh { values, store, .. } = &mut engine.mesh;
            let data = values.wedge_data.as_mut().expect("there is some");
            data.has_seam_lines = has_seam_lines;
            data.find_split(store);
        };
        find(&mut engine, true);
        let is_split = engine.mesh.split_vertices().expect("there is a seam").to_vec();
        let split: Vec<usize> = (0..is_split.len()).filter(|&v| is_split[v]).collect();
        assert_eq!(split, [2, 7, 12, 17, 22]);
        let ring = ring_of(&engine, 12);
        let weights = [7, 17, 11].map(|w| engine.mesh.line_weight(&ring, VertexId(w), true));
        assert!(weights[0] > 0.0 && weights[0] == weights[1] && weights[2] == 0.0, "{weights:?}");
        // Seams with equal texture coordinates on both sides have no lines.
        let mut engine = with_seam([[0.0, 0.0]; 2]);
        find(&mut engine, true);
        assert!(engine.mesh.split_vertices().is_none());
    }

    #[test]
    fn values_cost_their_deviation_over_the_star() {
        // A value that is linear over the sheet costs nothing; a value that deviates only at the kept end
        // costs the square of the deviation, times the square of the doubled area of the faces that stay.
        let mut engine = with_seam([[0.0, 0.0]; 2]);
        let cost = |engine: &mut Engine<Memoryless>, of: &dyn Fn(usize) -> f32| {
            let values: Vec<f32> = (0..50).map(|w| of(w % 25)).collect();
            let data = engine.mesh.values.wedge_data.as_mut().expect("there is some");
            (data.values, data.width) = (Some(values.into()), 1);
            let [ru, rv] = [6, 11].map(|w| ring_of(engine, w));
            let [at, gone] = [6, 11].map(|v| engine.mesh.store.p(VertexId(v)));
            let changes = engine
                .mesh
                .wedges_to_hand_over(VertexId(6), VertexId(11), Vec3::ZERO, at - gone, &ru, &rv)
                .expect("inside a chart");
            assert_eq!(changes.len(), 4);
            engine.mesh.cost_of_wedges(&changes, at)
        };
        let side = engine.mesh.store.p(VertexId(1)).x - engine.mesh.store.p(VertexId(0)).x;
        let area = 4.0 * side * side;
        assert_eq!(cost(&mut engine, &|w| (w % 5) as f32 + 3.0 * (w / 5) as f32), 0.0);
        let sum = cost(&mut engine, &|w| if w == 6 { 0.5 } else { 0.0 });
        assert_near(sum, area * area * 0.25);
    }

    #[test]
    fn the_end_that_keeps_its_position_keeps_its_wedges() {
        let engine = with_seam([[0.0, 0.0], [5.0, 0.0]]);
        // `u` moves onto `v`: its corners get the wedges of `v`.
        let [ru, rv] = [11, 12].map(|w| ring_of(&engine, w));
        let found =
            engine.mesh.wedges_to_hand_over(VertexId(11), VertexId(12), Vec3::X, Vec3::ZERO, &ru, &rv);
        let found = found.expect("onto the seam");
        // Two of the six corners are in triangles that are removed.
        assert_eq!(found.len(), 4);
        assert!(
            found
                .iter()
                .all(|(corner, new)| new.0 == 12 && engine.mesh.store.t[corner.face()][corner.k()].0 == 11)
        );
    }

    #[test]
    fn on_a_crease_the_nearest_normal_with_the_same_texture_coordinates_is_taken() {
        let engine = with_seam([[0.0, 0.0]; 2]);
        assert_eq!(handed_over(&engine, 11, 12), Ok(vec![[12, 11], [37, 11]]));
        let data = engine.mesh.values.wedge_data.as_ref().expect("there is some");
        let best = |choices: &[u32], of: u32| {
            let choices: Vec<WedgeId> = choices.iter().copied().map(WedgeId).collect();
            data.best(&choices, Some(WedgeId(0)), WedgeId(of)).map(|w| w.0)
        };
        assert_eq!(
            [best(&[3, 30], 37), best(&[30, 3], 12), best(&[4, 3], 12), best(&[], 12)],
            [Some(30), Some(3), Some(3), None]
        );
    }
}
