//! Saved state of wedges, for snapshots of an engine.

use lodsmith_core::WedgeId;
use wide::f32x4;

use super::{Attributes, Head, JointWeights};
use crate::cost::tensor::Tensor;

/// State of some wedges, to be restored.
#[derive(Clone, Debug)]
pub(in crate::collapse) struct SavedWedges {
    wedges: Vec<WedgeId>,
    heads: Vec<Head>,
    reductions: Vec<Tensor>,
    rows: Vec<f32x4>,
    joint_weights: Vec<JointWeights>,
    labels: Vec<u32>,
    /// Number of all wedges, and of wedges that were copied from others.
    count: [usize; 2],
}

impl Attributes {
    /// Saves the state of these wedges; each may be listed several times.
    pub(in crate::collapse) fn save_wedges(&self, wedges: impl Iterator<Item = WedgeId>) -> SavedWedges {
        let mut is_new = vec![true; self.count()];
        let wedges: Vec<WedgeId> =
            wedges.filter(|w| std::mem::replace(&mut is_new[w.index()], false)).collect();
        let of = || wedges.iter().map(|w| w.index());
        SavedWedges {
            heads: of().map(|w| self.heads[w]).collect(),
            reductions: of().map(|w| self.reductions[w]).collect(),
            rows: wedges.iter().flat_map(|&w| self.row(w)).copied().collect(),
            joint_weights: of().filter_map(|w| self.joint_weights.get(w)).cloned().collect(),
            labels: of().filter_map(|w| self.labels.get(w)).copied().collect(),
            count: [self.count(), self.copied.len()],
            wedges,
        }
    }
    /// Restores saved wedges and removes wedges copied since.
    pub(in crate::collapse) fn restore_wedges(&mut self, kept: &SavedWedges) {
        let (n, [count, copied]) = (4 * self.lanes, kept.count);
        self.heads.truncate(count);
        self.reductions.truncate(count);
        self.rows.truncate(count * n);
        self.joint_weights.truncate(count);
        self.labels.truncate(count);
        self.copied.truncate(copied);
        for (i, w) in kept.wedges.iter().map(|w| w.index()).enumerate() {
            self.heads[w] = kept.heads[i];
            self.reductions[w] = kept.reductions[i];
            self.rows[w * n..][..n].copy_from_slice(&kept.rows[i * n..][..n]);
            if let Some(joint_weights) = kept.joint_weights.get(i) {
                self.joint_weights[w].clone_from(joint_weights);
            }
            if let Some(&label) = kept.labels.get(i) {
                self.labels[w] = label;
            }
        }
    }
}
