//! The cost of merging wedges, as forms, and the best values of the merged ones.

use glam::Vec3;
use lodsmith_core::WedgeId;
use wide::f32x4;

use super::merge::{Member, of_group, representatives};
use super::sum::{Sum, add_outer};
use super::{Attributes, Head, dot};
use crate::cost::tensor::Tensor;

/// Maximum number of wedges of a vertex that an evaluation visits, so that a vertex between very many charts
/// cannot stall a run.
const MAX_WEDGES_EVALUATED: usize = 24;

impl Attributes {
    /// Returns the weighted squared errors of a triangle, in four lanes, at the point where the barycentric
    /// coordinates of its two other corners are `at` and the values are to be `best`. `lanes` is a
    /// parameter so that loops are unrolled.
    #[inline(always)]
    pub(in crate::collapse) fn error(
        &self,
        lanes: usize,
        corners: [WedgeId; 3],
        [la, lb]: [f32; 2],
        best: &[f32x4],
    ) -> f32x4 {
        let [o, a, b] = corners;
        let (o, a, b) = (self.row_of(lanes, o), self.row_of(lanes, a), self.row_of(lanes, b));
        let (weights, best) = (&self.weights[..lanes], &best[..lanes]);
        let mut sum = f32x4::ZERO;
        for i in 0..lanes {
            let error = (o[i] - best[i]) + (a[i] - o[i]) * la + (b[i] - o[i]) * lb;
            sum += error * error * weights[i];
        }
        sum
    }

    /// Updates the cached tensors of a wedge and of those after it in its chain.
    #[inline(always)]
    pub(in crate::collapse) fn cache_reductions(&mut self, mut w: WedgeId) {
        for _ in 0..MAX_WEDGES_EVALUATED {
            let Some(&Head { has_reduction: known, next, .. }) = self.heads.get(w.index()) else { return };
            if !known {
                self.reductions[w.index()] = self.reduction(w);
                self.heads[w.index()].has_reduction = true;
            }
            w = next;
        }
    }

    /// Invalidates all cached tensors of wedges: their weights have changed.
    pub(in crate::collapse) fn invalidate_reductions(&mut self) {
        self.heads.iter_mut().for_each(|h| h.has_reduction = false);
    }

    /// Returns the reduction of a vertex's tensor by the best values of its wedges, each taken alone.
    #[inline(always)]
    pub(in crate::collapse) fn reduction_of_vertex(&self, first: WedgeId) -> Tensor {
        let known = |w: WedgeId| match self.heads[w.index()].has_reduction {
            true => self.reductions[w.index()],
            false => self.reduction(w),
        };
        let (mut sum, mut next) = (known(first), self.heads[first.index()].next);
        for _ in 1..MAX_WEDGES_EVALUATED {
            let Some(head) = self.heads.get(next.index()) else { break };
            sum.add(&known(next));
            next = head.next;
        }
        sum
    }

    /// Returns the weighted squares of the mean gradients of a wedge, times its area: the reduction of the
    /// cost by its best value at another position.
    pub(super) fn reduction(&self, w: WedgeId) -> Tensor {
        let per_area = 1.0 / self.heads[w.index()].area.max(1e-30);
        let [_, x, y, z] = self.parts(w);
        let mut sum = [f32x4::ZERO; 6];
        for (i, &weight) in self.weights.iter().enumerate() {
            let slope = [x[i], y[i], z[i]];
            add_outer(&mut sum, &slope.map(|s| s * (weight * per_area)), &slope);
        }
        Tensor(sum.map(f32x4::reduce_add))
    }

    /// Adds the cost of merging each group into one wedge; `d` leads from the kept to the removed end.
    pub(in crate::collapse) fn add_to(&self, members: &[Member], d: Vec3, sum: &mut Sum) {
        for (group, first) in representatives(members) {
            let mut others = members.iter().enumerate().filter(|(i, m)| m.group == group && *i != group);
            match (others.next(), others.next()) {
                (None, _) => {}
                (Some((_, other)), None) if !first.at_v && other.at_v => {
                    self.add_pair_to(self.lanes, [first.wedge, other.wedge], d, sum);
                }
                _ => self.add_group_to(members, group, d, sum),
            }
        }
    }

    /// Adds the cost of a group with several wedges of either end: the spread of their best values about
    /// their mean.
    fn add_group_to(&self, members: &[Member], group: usize, d: Vec3, sum: &mut Sum) {
        let base = self.values(members[group].wedge);
        let area = |m: &Member| self.heads[m.wedge.index()].area.max(1e-30);
        let all: f32 = of_group(members, group).map(area).sum();
        for (i, &weight) in self.weights.iter().enumerate() {
            // The best value of one wedge: the value at the kept end, and its slope.
            let line = |m: &Member| {
                let ([values, x, y, z], per_area) = (self.parts(m.wedge), 1.0 / area(m));
                let slope = [x[i], y[i], z[i]].map(|s| s * per_area);
                let back = if m.at_v { dot(&slope, d) } else { f32x4::ZERO };
                (values[i] - base[i] - back, slope)
            };
            let (mut value, mut slope) = (f32x4::ZERO, [f32x4::ZERO; 3]);
            for m in of_group(members, group) {
                let (share, (own, slopes)) = (area(m) / all, line(m));
                value += own * share;
                (0..3).for_each(|k| slope[k] += slopes[k] * share);
            }
            for m in of_group(members, group) {
                let (own, slopes) = line(m);
                let off = [0, 1, 2].map(|k| slope[k] - slopes[k]);
                sum.add_square(&off, own - value, weight * area(m));
            }
        }
    }

    /// Adds the cost of a group with one wedge at each end, as on all edges that touch no seam. `lanes` is
    /// a parameter so that loops are unrolled.
    #[inline(always)]
    pub(in crate::collapse) fn add_pair_to(
        &self,
        lanes: usize,
        [u, v]: [WedgeId; 2],
        d: Vec3,
        sum: &mut Sum,
    ) {
        let [area_u, area_v] = [u, v].map(|w| self.heads[w.index()].area.max(1e-30));
        let (per_u, per_v) = (1.0 / area_u, 1.0 / area_v);
        let both = area_u * (area_v / (area_u + area_v));
        let (own, other) = (self.row_of(lanes, u), self.row_of(lanes, v));
        for i in 0..lanes {
            let (j, k, l) = (lanes + i, 2 * lanes + i, 3 * lanes + i);
            let slope = [other[j] * per_v, other[k] * per_v, other[l] * per_v];
            let off = [own[j] * per_u - slope[0], own[k] * per_u - slope[1], own[l] * per_u - slope[2]];
            sum.add_square(&off, other[i] - own[i] - dot(&slope, d), self.weights[i] * both);
        }
    }

    /// Adds the attribute cost to the forms of up to four edges side by side, with one wedge at each end:
    /// `own` at the common end, `others` at the far ones. `lanes` is a parameter so that loops are
    /// unrolled.
    #[inline(always)]
    pub(in crate::collapse) fn add_four_to(
        &self,
        lanes: usize,
        own: WedgeId,
        others: [WedgeId; 4],
        d: &[f32x4; 3],
        (a, h, c): (&mut [f32x4; 6], &mut [f32x4; 3], &mut f32x4),
    ) {
        let area = f32x4::new(others.map(|w| self.heads[w.index()].area));
        let per_area = f32x4::ONE / (area + self.heads[own.index()].area).fast_max(f32x4::splat(1e-30));
        let [p, q, r, s] = others;
        let (p, q) = (self.row_of(lanes, p), self.row_of(lanes, q));
        let (r, s) = (self.row_of(lanes, r), self.row_of(lanes, s));
        let own = self.row_of(lanes, own);
        for lane in 0..lanes {
            let (i, j, k, l) = (lane, lanes + lane, 2 * lanes + lane, 3 * lanes + lane);
            let values = f32x4::transpose([p[i], q[i], r[i], s[i]]);
            let x = f32x4::transpose([p[j], q[j], r[j], s[j]]);
            let y = f32x4::transpose([p[k], q[k], r[k], s[k]]);
            let z = f32x4::transpose([p[l], q[l], r[l], s[l]]);
            let (s, ux, uy, uz) =
                (own[i].to_array(), own[j].to_array(), own[k].to_array(), own[l].to_array());
            for (i, weight) in self.weights[lane].to_array().into_iter().enumerate() {
                if weight == 0.0 {
                    continue;
                }
                let off = values[i] - f32x4::splat(s[i]);
                let slope = [x[i], y[i], z[i]];
                let along = slope[0] * d[0] + slope[1] * d[1] + slope[2] * d[2];
                let b = [slope[0] + ux[i], slope[1] + uy[i], slope[2] + uz[i]];
                let c0 = area * off - along;
                let scale = per_area * weight;
                let scaled = b.map(|b| b * scale);
                add_outer(a, &scaled.map(|x| -x), &b);
                for k in 0..3 {
                    h[k] += scaled[k] * c0 - slope[k] * off * weight;
                }
                *c += off * (area * off - along * 2.0) * weight - c0 * c0 * scale;
            }
        }
    }

    /// Computes the best values of each group, at the offset of its representative, if the vertex moves to
    /// the kept end + `y`.
    #[inline(always)]
    pub(in crate::collapse) fn best<const N: usize>(
        &self,
        members: &[Member],
        d: Vec3,
        y: Vec3,
        out: &mut [f32x4],
    ) {
        let lanes = self.lanes_of::<N>();
        for (group, first) in representatives(members) {
            let out = &mut out[group * lanes..][..lanes];
            out.fill(f32x4::ZERO);
            let base = self.row_of(lanes, first.wedge);
            let mut area = 0.0;
            for m in of_group(members, group) {
                let own = self.heads[m.wedge.index()].area;
                let at = if m.at_v { y - d } else { y };
                let row = self.row_of(lanes, m.wedge);
                area += own;
                for (i, sum) in out.iter_mut().enumerate() {
                    // Relative to the first wedge's values, so that constant values stay exact.
                    *sum += (row[i] - base[i]) * own;
                    *sum += dot(&[row[lanes + i], row[2 * lanes + i], row[3 * lanes + i]], at);
                }
            }
            let per_area = if area > 1e-30 { 1.0 / area } else { 0.0 };
            out.iter_mut().zip(base).for_each(|(best, base)| *best = *base + *best * per_area);
        }
    }
}
