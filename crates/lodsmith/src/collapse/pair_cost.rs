//! Placement and cost of pair contractions, and the guards that they must meet.

use glam::Vec3;
use lodsmith_core::VertexId;

use super::bundle::{Bundle, Changed, Joint};
use super::candidate::{FOLD_COS, merged_position};
use super::kind::Kind;
use super::ring::Ring;
use super::samples::SampledCost;
use super::vertex::Vertex;
use super::wings::{FOLD_CHECK_COS_SQ, MIN_SHAPE_SQ};
use super::{LiveMesh, Scratch, Tally};
use crate::cost::metric::{Form, Metric};
use crate::cost::tensor::Tensor;
use crate::cost::{self, TIE, best_place};
use crate::options::{BorderPolicy, Placement};
use crate::report::Refusal;

impl<M: Metric> LiveMesh<M> {
    /// Returns the cost of the gap between two vertices.
    pub(super) fn gap_cost(&self, u: VertexId, v: VertexId) -> f32 {
        cost::of_gap(self.cost.area, (self.store.p(v) - self.store.p(u)).length_squared())
    }

    pub(super) fn pair_cost_factor(&self, u: VertexId, v: VertexId) -> f32 {
        self.cost_factor(self.store.v[u.index()].origin, self.store.v[v.index()].origin)
    }

    /// Returns the merged position of two vertices, and its cost by the metric.
    pub(super) fn place_pair(
        &mut self,
        u: VertexId,
        v: VertexId,
        ring: &mut Ring,
    ) -> Result<(Vec3, f32), Refusal> {
        let (x, z) = (self.store.v[u.index()], self.store.v[v.index()]);
        let d = z.p - x.p;
        if x.kind.is_locked() && z.kind.is_locked() || self.is_either_locked(u, v) && d == Vec3::ZERO {
            return Err(Refusal::Locked);
        }
        // From the planes alone: closing a border does not move it off its line.
        let form = if self.cost.metric.is_memoryless() {
            let (own, other) = (self.planes(u, ring), self.planes(v, ring));
            let mut a = own;
            a.add(&other);
            let h = other.times(d);
            Form { a, h, c: d.dot(h) }
        } else {
            self.form_of_planes(&x, &z)
        };
        let cost = |y: Vec3| self.cost_of(&form, d, y);
        let better = |a: Vec3, b: Vec3| if cost(b) < cost(a) { b } else { a };
        let holds = matches!(self.constraints.rules.border, BorderPolicy::Slide | BorderPolicy::Lock);
        let stays = |k: Kind| k.is_locked() || holds && k.is_feature();
        let y = match [x.kind, z.kind].map(|k| (stays(k), k.is_complex())) {
            [(true, _), (true, _)] => return Err(Refusal::Border),
            [(true, _), _] | [(_, true), (false, false)] => Vec3::ZERO,
            [_, (true, _)] | [(_, false), (_, true)] => d,
            [(_, true), (_, true)] => better(Vec3::ZERO, d),
            _ => match self.constraints.rules.placement {
                Placement::Endpoint => better(Vec3::ZERO, d),
                Placement::Midpoint => d * 0.5,
                Placement::Optimal => {
                    best_place(&form, d).unwrap_or_else(|| better(better(d * 0.5, Vec3::ZERO), d))
                }
            },
        };
        Ok((merged_position(x.p, z.p, y), cost(y)))
    }

    /// Returns the form of two vertices without lines, for a metric with memory.
    fn form_of_planes(&self, x: &Vertex<M::Memory>, z: &Vertex<M::Memory>) -> Form {
        let d = z.p - x.p;
        let (form, lines) =
            (self.cost.metric.form(&x.q, &z.q, d), self.form_of_lines([x.origin, z.origin], d));
        Form { a: form.a.less(&lines.a), h: form.h - lines.h, c: form.c - lines.c }
    }

    /// Returns the plane tensor of a star.
    fn planes(&mut self, u: VertexId, ring: &mut Ring) -> Tensor {
        self.store.ring(u, ring);
        let p = self.store.p(u);
        let mut sum = Tensor::default();
        for r in ring.iter() {
            let normal = (self.store.p(r.a) - p).cross(self.store.p(r.b) - p);
            sum.add(&Tensor::outer(
                normal,
                self.cost.metric.plane_weight(normal.length(), self.cost.mean_face),
            ));
        }
        sum
    }

    /// Returns the cost of a bundle by the planes around it.
    pub(super) fn plane_cost(&mut self, bundle: &Bundle, ring: &mut Ring) -> Result<f32, Refusal> {
        let (mut cost, mut area, mut peak, mut turned) = (0f32, 0f32, 0f32, false);
        for c in &bundle.faces {
            let p = c.before.map(|w| self.store.p(w));
            let normal = (p[1] - p[0]).cross(p[2] - p[0]);
            let length = normal.length();
            let unit = normal / length.max(1e-30);
            area += length;
            for (w, p) in c.before.into_iter().zip(p) {
                let Some(at) = bundle.place_of(w) else { continue };
                let height = unit.dot(at - p);
                cost += length * height * height;
                cost += 0.5 * TIE * length * (at - p).length_squared();
                peak = peak.max(height * height);
            }
            if c.is_gone {
                continue;
            }
            let q = self.after(bundle, c);
            let after = (q[1] - q[0]).cross(q[2] - q[0]);
            let (before_sq, after_sq, dot) =
                (normal.length_squared(), after.length_squared(), normal.dot(after));
            let around = |p: [Vec3; 3]| {
                (p[1] - p[0]).length_squared()
                    + (p[2] - p[1]).length_squared()
                    + (p[0] - p[2]).length_squared()
            };
            let shape = |area_sq: f32, p: [Vec3; 3]| 12.0 * area_sq / (around(p) * around(p)).max(1e-37);
            let (old_shape, new_shape) = (shape(before_sq, p), shape(after_sq, q));
            let turns = !((dot > 0.0) & (dot * dot > self.constraints.rules.max_turn * before_sq * after_sq));
            // A face without area has no normal to turn.
            if turns && (old_shape > MIN_SHAPE_SQ || after_sq == 0.0) {
                return Err(Refusal::NormalFlip);
            }
            if new_shape < MIN_SHAPE_SQ && old_shape > new_shape {
                return Err(Refusal::Quality);
            }
            if new_shape < self.constraints.rules.min_shape && new_shape < old_shape {
                return Err(Refusal::Quality);
            }
            turned |= dot * dot < FOLD_CHECK_COS_SQ * before_sq * after_sq;
            for k in 0..3 {
                let sides = [p, q].map(|p| (p[(k + 1) % 3] - p[k]).length_squared());
                if sides[1] > self.constraints.rules.max_edge_sq && sides[1] > sides[0] {
                    return Err(Refusal::EdgeLength);
                }
            }
        }
        if self.cost.metric.is_memoryless() {
            cost += cost::of_peak(self.peak_weight(), area, peak);
        }
        self.check_valence(bundle)?;
        if self.bundle_folds(bundle, turned, ring) { Err(Refusal::NormalFlip) } else { Ok(cost) }
    }

    fn after(&self, bundle: &Bundle, c: &Changed) -> [Vec3; 3] {
        c.after.map(|w| bundle.place_of(w).unwrap_or_else(|| self.store.p(w)))
    }

    fn check_valence(&self, bundle: &Bundle) -> Result<(), Refusal> {
        if self.constraints.rules.max_valence == usize::MAX {
            return Ok(());
        }
        for joint in &bundle.joints {
            let mut around: Vec<VertexId> = Vec::new();
            let stays = bundle.faces.iter().filter(|c| !c.is_gone && c.after.contains(&joint.u));
            around.extend(stays.flat_map(|c| c.after).filter(|w| *w != joint.u));
            around.sort_unstable();
            around.dedup();
            if around.len() > self.constraints.rules.max_valence {
                return Err(Refusal::Valence);
            }
        }
        Ok(())
    }

    /// Returns the cost of contracting a pair plus the sampled cost, in the late phase.
    pub(super) fn sampled_pair_cost(
        &self,
        joint: &Joint,
        [cost, max_cost]: [f32; 2],
        ring: &mut Ring,
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) -> Option<SampledCost> {
        let late = self.sampled.as_ref()?;
        let ends = [joint.u, joint.v];
        scratch.wings.clear();
        for end in ends {
            self.store.ring(end, ring);
            scratch.wings.add_rim(ring, |r| r.has(joint.u) || r.has(joint.v));
        }
        let origins = ends.map(|w| self.store.v[w.index()].origin);
        Some(self.sampled_cost(late, origins, joint.at, [cost, max_cost], scratch, tally))
    }

    /// True if faces end up back to back at a new edge or, if a face `turned` far, at any edge.
    fn bundle_folds(&mut self, bundle: &Bundle, turned: bool, ring: &mut Ring) -> bool {
        let mut sides: Vec<([VertexId; 2], Vec3, usize)> = Vec::new();
        for c in bundle.faces.iter().filter(|c| !c.is_gone) {
            let q = self.after(bundle, c);
            let normal = (q[1] - q[0]).cross(q[2] - q[0]).normalize_or_zero();
            for k in 0..3 {
                let (a, b) = (c.after[k], c.after[(k + 1) % 3]);
                sides.push(([a.min(b), a.max(b)], normal, c.face));
            }
        }
        sides.sort_unstable_by_key(|s| (s.0, s.2));
        for same in sides.chunk_by(|a, b| a.0 == b.0) {
            if let [(edge, n, face), (_, m, other)] = same
                && n.dot(*m) < FOLD_COS
            {
                let shares = |face: usize, other: usize| {
                    let (t, o) = (self.store.t[face], self.store.t[other]);
                    t.iter().filter(|w| o.contains(w)).count() == 2
                };
                if turned || !shares(*face, *other) || bundle.place_of(edge[0]).is_none() {
                    return true;
                }
            }
            let [([a, b], n, face)] = same else { continue };
            if !turned || bundle.place_of(*a).is_some() || bundle.place_of(*b).is_some() {
                continue;
            }
            self.store.ring(*a, ring);
            for r in ring
                .iter()
                .filter(|r| r.has(*b) && r.corner.face() != *face && !bundle.is_gone(r.corner.face()))
            {
                let [p, q, r] = self.store.t[r.corner.face()].map(|w| self.store.p(w));
                if n.dot((q - p).cross(r - p).normalize_or_zero()) < FOLD_COS {
                    return true;
                }
            }
        }
        false
    }
}
