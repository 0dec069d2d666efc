//! The wedges at the ends of an edge, in groups that are merged, and the change of their data.

use lodsmith_core::WedgeId;
use wide::f32x4;

use super::slopes::{FourSlopes, SlopesRow};
use super::{Attributes, Head, JointWeights, NO_WEDGE};
use crate::cost::lanes;

/// Maximum number of joints per wedge during a run. (More than any format has.)
const MAX_JOINTS: usize = 16;

/// A wedge at one of the ends of an edge. The wedges of a group are merged; one of them, the group's
/// representative, keeps its index, and its values if it is at a locked end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Member {
    pub(in crate::collapse) wedge: WedgeId,
    pub(in crate::collapse) at_v: bool,
    pub(in crate::collapse) group: usize,
}

/// The wedges of the evaluated edge, their best values, and the future sums of the merged ones.
#[derive(Clone, Default)]
pub(in crate::collapse) struct Merge {
    pub(in crate::collapse) members: Vec<Member>,
    pub(in crate::collapse) best: Vec<f32x4>,
    pub(in crate::collapse) own: Vec<f32x4>,
    pub(in crate::collapse) heads: Vec<Head>,
    /// Slopes of the current wings, if the cost of the merger was computed.
    pub(in crate::collapse) slopes: Vec<FourSlopes>,
}

/// Returns the representative of each group, with its index.
pub(in crate::collapse) fn representatives(members: &[Member]) -> impl Iterator<Item = (usize, &Member)> {
    members.iter().enumerate().filter(|(i, m)| m.group == *i)
}

pub(super) fn of_group(members: &[Member], group: usize) -> impl Iterator<Item = &Member> {
    members.iter().filter(move |m| m.group == group)
}

impl Attributes {
    /// Borrows the tables that a merger changes, as slices, which stay in registers.
    #[inline(always)]
    pub(in crate::collapse) fn tables(&mut self) -> Tables<'_> {
        Tables { weights: &self.weights, heads: &mut self.heads, rows: &mut self.rows }
    }

    /// Prepares a merger: clears the sums and heads of the merged wedges, and normalizes their values, unless
    /// a locked end determines them.
    #[inline(always)]
    pub(in crate::collapse) fn begin_merge(&self, lanes: usize, is_locked: bool, merge: &mut Merge) {
        let Merge { members, best, own, heads, .. } = merge;
        let room = members.len() * 3 * lanes;
        if own.len() < room {
            own.resize(room, f32x4::ZERO);
        }
        heads.clear();
        heads.resize(members.len(), Head::default());
        for m in members.iter() {
            for (hard, own) in heads[m.group].hard.iter_mut().zip(self.heads[m.wedge.index()].hard) {
                *hard |= own;
            }
        }
        for (group, _) in representatives(members) {
            own[group * 3 * lanes..][..3 * lanes].fill(f32x4::ZERO);
            if !is_locked {
                self.normalize(&mut best[group * lanes..][..lanes]);
            }
        }
    }

    /// Writes the data of the merged wedges that have a triangle, at `t` between the kept end (0) and the
    /// other (1), and chains them. Returns the first wedge of the chain.
    #[inline(always)]
    pub(in crate::collapse) fn end_merge(
        &mut self,
        lanes: usize,
        is_locked: bool,
        t: f32,
        Merge { members, best, own, heads, .. }: &Merge,
    ) -> WedgeId {
        let mut first = NO_WEDGE;
        for (group, m) in representatives(members).filter(|(group, _)| heads[*group].faces > 0) {
            if !self.joint_weights.is_empty() && !is_locked {
                self.joint_weights[m.wedge.index()] = self.blended_joint_weights(members, group, t);
            }
            if !self.labels.is_empty() && !is_locked {
                self.labels[m.wedge.index()] = self.nearest_label(members, group, t);
            }
            let head = Head { next: first, ..heads[group] };
            let sums = &own[group * 3 * lanes..][..3 * lanes];
            self.set(m.wedge, &best[group * lanes..][..lanes], sums, head);
            first = m.wedge;
        }
        first
    }

    /// Returns the label of the merged wedge of a group, at `t` between the kept end (0) and the other (1):
    /// the label of a wedge at the nearer end, among several there of the wedge with the largest area.
    fn nearest_label(&self, members: &[Member], group: usize, t: f32) -> u32 {
        let area = |m: &Member| self.heads[m.wedge.index()].area;
        let mut nearest: Option<&Member> = None;
        for m in of_group(members, group) {
            let is_nearer = |known: &Member| match m.at_v == known.at_v {
                true => area(m) > area(known),
                false => m.at_v == (t > 0.5),
            };
            if nearest.is_none_or(is_nearer) {
                nearest = Some(m);
            }
        }
        nearest.map_or(0, |m| self.labels[m.wedge.index()])
    }

    fn blended_joint_weights(&self, members: &[Member], group: usize, t: f32) -> JointWeights {
        let mut sum: JointWeights = Vec::new();
        let count = |at_v| of_group(members, group).filter(|m| m.at_v == at_v).count();
        let counts = [count(false), count(true)];
        for m in of_group(members, group) {
            // A group with wedges of only one end takes everything from that end.
            let share = match (counts, m.at_v) {
                ([_, 0], _) | ([0, _], _) => 1.0,
                (_, true) => t,
                (_, false) => 1.0 - t,
            } / counts[usize::from(m.at_v)] as f32;
            for &(joint, weight) in &self.joint_weights[m.wedge.index()] {
                match sum.iter_mut().find(|p| p.0 == joint) {
                    Some(p) => p.1 += weight * share,
                    None => sum.push((joint, weight * share)),
                }
            }
        }
        sum.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        sum.truncate(MAX_JOINTS);
        sum
    }
}

/// Mutable view of the data of all wedges.
pub(in crate::collapse) struct Tables<'a> {
    weights: &'a [f32x4],
    pub(in crate::collapse) heads: &'a mut [Head],
    rows: &'a mut [f32x4],
}

impl Tables<'_> {
    /// Removes a wedge from the chain that starts with `first`.
    pub(in crate::collapse) fn unlink(&mut self, first: &mut WedgeId, wedge: WedgeId) {
        let next = self.heads[wedge.index()].next;
        if *first == wedge {
            *first = next;
            return;
        }
        let mut before = *first;
        while let Some(head) = self.heads.get_mut(before.index()) {
            if head.next == wedge {
                head.next = next;
                return;
            }
            before = head.next;
        }
    }

    /// Subtracts the contribution of a triangle, with wedge `o` at its first corner and slopes `old`, from
    /// the sums of its two other wedges. If the triangle stays, adds it again with the `new` slopes and
    /// values of the moved corner. Its contribution to the merged wedge's own sums is added to `own`, its
    /// contribution to the tensor of its vertex to `added`. Returns the change of the tensors of the two
    /// other vertices, in four lanes. `lanes` is a parameter so that loops are unrolled.
    #[inline(always)]
    pub(in crate::collapse) fn replace(
        &mut self,
        lanes: usize,
        (old, o): (&SlopesRow, WedgeId),
        new: Option<(&SlopesRow, &[f32x4])>,
        [a, b]: [WedgeId; 2],
        own: &mut [f32x4],
        added: &mut [f32x4; 6],
    ) -> [f32x4; 6] {
        let (at_a, at_b) = (a.index() * 4 * lanes, b.index() * 4 * lanes);
        let own = &mut own[..3 * lanes];
        let mut sums = [f32x4::ZERO; 6];
        for i in 0..lanes {
            let weight = self.weights[i];
            let o = self.rows[o.index() * 4 * lanes + i];
            let (a, b) = (self.rows[at_a + i], self.rows[at_b + i]);
            let mut gain = [f32x4::ZERO; 3];
            if let Some((s, values)) = new {
                gain = s.gain((a - values[i]) * s.area(), (b - values[i]) * s.area());
                let square = lanes::outer(&gain, weight * s.per_area());
                for k in 0..6 {
                    sums[k] += square[k];
                    added[k] += square[k];
                }
                for k in 0..3 {
                    own[k * lanes + i] += gain[k];
                }
            }
            let loss = old.gain((a - o) * old.area(), (b - o) * old.area());
            let square = lanes::outer(&loss, weight * old.per_area());
            for k in 0..6 {
                sums[k] -= square[k];
            }
            for at in [at_a, at_b] {
                let row = &mut self.rows[at..][..4 * lanes];
                for k in 0..3 {
                    row[(k + 1) * lanes + i] += gain[k] - loss[k];
                }
            }
        }
        let area = new.map_or(0.0, |x| x.0.area()) - old.area();
        for w in [a, b] {
            let head = &mut self.heads[w.index()];
            (head.area, head.has_reduction) = (head.area + area, false);
            head.faces -= u32::from(new.is_none());
        }
        sums
    }
}
