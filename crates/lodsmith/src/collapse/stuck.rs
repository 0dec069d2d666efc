//! Proposals for a run that is stuck: tries every remaining edge again, with one rule after another
//! relaxed.

use lodsmith_core::VertexId;

use super::attributes::Member;
use super::candidate::{Attempt, Candidate, CollapseOutcome};
use super::cut::may_cut;
use super::kind::Kind;
use super::visit::VisitScratch;
use super::{Engine, LiveMesh};
use crate::cost::guard::Rules;
use crate::cost::metric::Metric;
use crate::options::{Length, SimplifyOptions, TopologyPolicy};
use crate::proposal::{Change, Proposal};

/// Changes that gain less than the best one by this factor are left out: another rule refuses nearly all
/// edges, and may refuse more in another run. (Measured on all test shapes with twenty sets of options: at 3,
/// a run with any of the remaining changes gets further.)
const MIN_GAIN_DIVISOR: usize = 3;

impl<M: Metric> Engine<M> {
    /// Returns changes of the options with which this run could continue, the change that frees the most
    /// edges first. Changes nothing. The store is finished. Cost: one sweep over the remaining mesh for each
    /// option that could be changed.
    pub(crate) fn proposals(
        &mut self,
        options: &SimplifyOptions,
        has_locks: bool,
        rules: impl Fn(&SimplifyOptions) -> Rules,
        reach: impl Fn(Length) -> f32,
    ) -> Vec<Proposal> {
        let part_count = self.mesh.part_count();
        let mut open = Change::relaxations(options, has_locks);
        // A single part cannot be joined to another.
        open.extend(Change::pairs_change(options).filter(|_| part_count > 1).map(|change| vec![change]));
        if open.is_empty() {
            return Vec::new();
        }
        let kinds: Vec<Kind> = self.mesh.store.v.iter().map(|x| x.kind).collect();
        let (own, cuts_necks) = (self.mesh.constraints.rules, self.mesh.constraints.cuts_necks);
        // Some edges seem possible even now, because wedges are checked only in a real collapse.
        let base = self.possible();
        best(&open, &mut |changes| {
            let changed = changes.iter().fold(options.clone(), |o, c| c.apply(&o));
            self.mesh.constraints.rules = rules(&changed);
            self.mesh.constraints.cuts_necks = may_cut(&changed);
            if !has_locks || changes.contains(&Change::Locked) {
                self.mesh.store.v.iter_mut().for_each(|x| x.kind = x.kind.locked(false));
            }
            if changed.border != options.border {
                self.mesh.classify_again();
            }
            let base = if changed.placement == options.placement { base } else { 0 };
            let parts_go =
                options.topology == TopologyPolicy::Preserve && changed.topology != TopologyPolicy::Preserve;
            let parts = if parts_go { part_count - 1 } else { 0 };
            let pairs = match (options.method.pairs(), changed.method.pairs()) {
                (None, Some(distance)) => self.possible_pairs(reach(distance)),
                _ => 0,
            };
            let gain = self.possible().saturating_sub(base) + parts + pairs;
            (self.mesh.constraints.rules, self.mesh.constraints.cuts_necks) = (own, cuts_necks);
            for (x, &kind) in self.mesh.store.v.iter_mut().zip(&kinds) {
                x.kind = kind;
            }
            gain
        })
    }

    /// Returns the number of edges that could be collapsed at some cost.
    fn possible(&mut self) -> usize {
        let (mut scratch, mut count) = (VisitScratch::default(), 0);
        for u in (0..self.mesh.store.v.len() as u32).map(VertexId) {
            self.evaluate_at_any_cost(u, &mut scratch);
            let VisitScratch { ru, rv, found, members, .. } = &mut scratch;
            for candidate in &found.within {
                count += usize::from(self.is_possible(u, candidate, ru, rv, members));
            }
        }
        count
    }

    fn is_possible(
        &mut self,
        u: VertexId,
        candidate: &Candidate,
        ru: &super::Ring,
        rv: &mut super::Ring,
        members: &mut Vec<Member>,
    ) -> bool {
        self.mesh.store.ring(candidate.removed, rv);
        let mut next = Some(*candidate);
        while let Some(candidate) = next {
            let (tau, rings) = (f32::MAX, [ru, &*rv]);
            match self.collapse(&Attempt { kept: u, candidate: &candidate, tau, is_probe: true, rings }) {
                CollapseOutcome::Done | CollapseOutcome::Later(_) => return true,
                CollapseOutcome::Refused(why) => {
                    next = self.mesh.candidate_at_end(u, &candidate, why, f32::MAX, ru, members)
                }
            }
        }
        false
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Recomputes the kinds of all vertices under other rules.
    fn classify_again(&mut self) {
        let mut ring = super::Ring::default();
        for u in (0..self.store.v.len() as u32).map(VertexId) {
            self.store.ring(u, &mut ring);
            self.store.v[u.index()].kind = self.current_kind(u, &ring);
        }
    }
}

/// Returns the best change of each option, and a combination of several if single ones gain little. `gain`
/// returns the number of edges that a set of changes frees.
fn best(open: &[Vec<Change>], gain: &mut dyn FnMut(&[Change]) -> usize) -> Vec<Proposal> {
    let mut proposals = Vec::new();
    for choices in open {
        let tried = choices.iter().map(|&c| (c, gain(&[c])));
        proposals
            .extend(tried.filter(|t| t.1 > 0).map(|(c, gain)| Proposal { changes: vec![c], gain }).next());
    }
    // If several rules refuse the same edges, relaxing only one gains little: combine all, then drop the
    // changes that do not matter.
    let largest_gain = |proposals: &[Proposal]| proposals.iter().map(|p| p.gain).max().unwrap_or(0);
    let mut all: Vec<Change> = open.iter().filter_map(|choices| choices.last().copied()).collect();
    let gain_of_all = gain(&all);
    if gain_of_all > MIN_GAIN_DIVISOR * largest_gain(&proposals) {
        for i in (0..all.len()).rev() {
            let less: Vec<Change> = all.iter().copied().filter(|c| *c != all[i]).collect();
            if gain(&less) * MIN_GAIN_DIVISOR >= gain_of_all {
                all = less;
            }
        }
        proposals.push(Proposal { gain: gain(&all), changes: all });
    }
    proposals.sort_by_key(|p| std::cmp::Reverse(p.gain));
    let largest_gain = largest_gain(&proposals);
    proposals.retain(|p| p.gain * MIN_GAIN_DIVISOR >= largest_gain);
    proposals
}
