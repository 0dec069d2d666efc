//! Sweeps: how thresholds rise until the goal is met, and where that pauses.

use lodsmith_core::VertexId;
use wide::f32x8;

use super::bound::Histogram;
use super::commit::{Attempt, Outcome};
use super::{BRINGS_FROM, End, Engine, Goal, LiveMesh, Original, VisitScratch, late, record};
use crate::control::{Control, Verdict};
use crate::metric::Metric;

/// Share of the bounds that one sweep takes. (.4 and .7 give equal errors, .7 fewer sweeps: docs/decisions/0002.)
pub(super) const QUANTILE: f64 = 0.7;
/// Share of what is left that the last sweeps take, at most.
pub(super) const LAST_SHARE: f64 = 0.85;
/// How much more than was foreseen a sweep may take, where it must not meet a goal. (Guessed.)
const AHEAD: f64 = 1.2;
/// The same for copies of which no more is asked than that the goal has had no say yet.
const JUST_AHEAD: f64 = 1.01;
/// Sweeps in vain before everything that is possible at all is looked for.
const PATIENCE: usize = 4;
/// No run needs nearly as many sweeps; a guard against our own mistakes.
const MOST_SWEEPS: usize = 4000;
/// Vertices looked at for the first threshold, at most. (Some hundred hold a quantile within two percent.)
const FIRST_LOOK: usize = 512;
/// The same where attributes count, and a look takes longer. (A twentieth of the time of a run less; RMS within a percent.)
const FIRST_LOOK_AT_WEDGES: usize = 128;
/// Of a mesh of more, one in so many is enough, but no fewer than `FEWEST_LOOKS`: it is only the first of many thresholds.
const LOOK_SHARE: usize = 24;
const FEWEST_LOOKS: usize = 128;
/// Vertices between two questions to the caller.
pub(super) const ASK_EVERY: usize = 4096;

/// Where a run of sweeps stands.
#[derive(Clone)]
pub(crate) struct Sweeps {
    /// What the next threshold is found from, and how many vertices were looked at for it; none while one holds.
    pub(super) next: Option<(Histogram, usize)>,
    pub(super) begun_with: usize,
    pub(super) start_faces: usize,
    pub(super) swept: bool,
    pub(super) tau: f32,
    pub(super) highest: f32,
    /// Sweeps in vain.
    pub(super) idle: usize,
    /// Whether the next sweep looks for what is possible at all, and whether the last one did.
    pub(super) probe: bool,
    pub(super) probed: bool,
    pub(super) lift: f32,
    /// Collapses at the last probe.
    pub(super) at_probe: u64,
    /// Collapses when the threshold was found.
    pub(super) at_threshold: u64,
    /// Of how many vertices the sweeps with it were to look at the edges.
    pub(super) wanted: f64,
    /// Whether each sweep so far did as much as where nothing stands in the way.
    pub(super) is_at_ease: bool,
}

/// Where sweeps pause.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pause {
    Never,
    /// Before the goal has a say in how much a sweep takes: up to there all runs of the same input are the same.
    BeforeGoal,
    /// Where a copy is to be made, from which parts and necks may go if they have to.
    BeforeNeed,
    /// Before whichever of the two comes first.
    BeforeEither,
}

impl<M: Metric> LiveMesh<M> {
    /// Collapses still to be done for the goal; `None` if there is no end to it.
    pub(super) fn needed(&self, goal: &Goal) -> Option<usize> {
        let faces = goal.faces.map(|n| self.store.live_faces.saturating_sub(n).div_ceil(2));
        let vertices = goal.vertices.map(|n| self.store.live_vertices.saturating_sub(n));
        match (faces, vertices) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }
}

impl<M: Metric> Engine<M> {
    /// How much of a run is done, from 0 to 1: of the collapses that it began with, or without a goal of the faces.
    fn done(&self, goal: &Goal, begun_with: usize, start_faces: usize) -> f64 {
        let done = match self.mesh.needed(goal) {
            Some(n) => 1.0 - n as f64 / begun_with as f64,
            None => 1.0 - self.mesh.store.live_faces as f64 / start_faces.max(1) as f64,
        };
        done.clamp(0.0, 1.0)
    }

    /// Sweeps until the goal is met, nothing can go any more, or the caller ends it. The store is finished afterwards.
    /// May be called again with a lower goal, after [`Engine::reopen`].
    pub(crate) fn sweep(&mut self, goal: &Goal, original: &dyn Original, control: &mut dyn Control) -> End {
        let mut sweeps = self.begin_sweeps(goal);
        let end = self.go_on(&mut sweeps, goal, Pause::Never, original, control).unwrap_or(End::Stuck);
        if end != End::Cancel {
            self.mesh.store.finish();
        }
        end
    }

    /// Looks around before the first sweep.
    pub(crate) fn begin_sweeps(&mut self, goal: &Goal) -> Sweeps {
        let mut scratch = VisitScratch::default();
        self.mesh.cost.area = (self.mesh.cost.total_area / self.mesh.store.live_faces.max(1) as f64) as f32;
        let first = self.first_bounds(&mut scratch);
        let begun_with = self.mesh.needed(goal).unwrap_or(self.mesh.store.live_faces / 2).max(1);
        Sweeps {
            next: Some((Histogram::of(&first), first.len())),
            begun_with,
            start_faces: self.mesh.store.live_faces,
            swept: false,
            tau: 0.0,
            highest: 0.0,
            idle: 0,
            probe: false,
            probed: false,
            lift: 1.0,
            at_probe: u64::MAX,
            at_threshold: 0,
            wanted: 0.0,
            is_at_ease: true,
        }
    }

    /// The bounds of some vertices spread over the mesh, for the first threshold: the exact cost of the edge that looks
    /// cheapest, because an evaluation cannot tell flat from nearly flat. Of a small mesh, all.
    fn first_bounds(&mut self, scratch: &mut VisitScratch) -> Vec<f32> {
        let most = if self.mesh.counts_attributes() { FIRST_LOOK_AT_WEDGES } else { FIRST_LOOK };
        let count = self.mesh.store.v.len();
        let looks = if count <= most { most } else { (count / LOOK_SHARE).clamp(FEWEST_LOOKS, most) };
        let step = count.div_ceil(looks).max(1);
        let mut bounds = Vec::with_capacity(looks);
        for u in (0..count).step_by(step).map(|i| VertexId(i as u32)) {
            self.evaluate_at_any_cost(u, scratch);
            let VisitScratch { ru, rv, found, .. } = &mut *scratch;
            let best = found.take_cheapest();
            bounds.push(best.map_or(f32::INFINITY, |best| {
                if !self.tally.crowds.admit(ru.len() + self.mesh.store.listed(best.removed).len()) {
                    return best.cost;
                }
                self.mesh.store.ring(best.removed, rv);
                let (tau, rings) = (f32::MAX, [&*ru, &*rv]);
                match self.collapse(&Attempt { kept: u, candidate: &best, tau, is_probe: true, rings }) {
                    Outcome::Later(cost) => cost,
                    Outcome::Done | Outcome::Refused(_) => f32::INFINITY,
                }
            }));
        }
        bounds
    }

    /// Sweeps on towards a goal, and says why it ended. Where it pauses, it says nothing: it can be gone on with as if it had
    /// not, and a copy of it to other goals or by other rules.
    pub(crate) fn go_on(
        &mut self,
        sweeps: &mut Sweeps,
        goal: &Goal,
        pause: Pause,
        original: &dyn Original,
        control: &mut dyn Control,
    ) -> Option<End> {
        let end = self.sweep_on(sweeps, goal, pause, original, control);
        self.check_if_asked(original);
        end
    }

    /// The body of [`Self::go_on`], without the check of the store at the end.
    fn sweep_on(
        &mut self,
        sweeps: &mut Sweeps,
        goal: &Goal,
        pause: Pause,
        original: &dyn Original,
        control: &mut dyn Control,
    ) -> Option<End> {
        let extreme = self.is_extreme(goal);
        self.mesh.find_details(goal);
        let (mut scratch, mut visits) = (VisitScratch::default(), Vec::new());
        'sweeps: for _ in 0..MOST_SWEEPS {
            self.check_if_asked(original);
            // Where sweeps go on to another goal, it is this one that says what comes after a sweep.
            if sweeps.swept && sweeps.next.is_some() {
                if self.mesh.store.wants_compaction(self.mesh.needed(goal)) {
                    self.mesh.store.compact();
                    sweeps.next = Some(self.mesh.bounds());
                }
                if self.is_late(extreme) {
                    original.with(&mut |points, faces| self.mesh.begin_late(points, faces));
                    sweeps.next = Some(self.mesh.bounds());
                }
            }
            if let Some((histogram, looked_at)) = sweeps.next.take() {
                self.watch_ease(sweeps);
                let is_last_stretch = |ahead| self.is_last_stretch(&histogram, looked_at, goal, ahead);
                let pauses = match pause {
                    Pause::Never => false,
                    Pause::BeforeGoal => is_last_stretch(AHEAD),
                    Pause::BeforeNeed => self.is_time_to_fork(sweeps, goal, is_last_stretch(AHEAD)),
                    Pause::BeforeEither => {
                        is_last_stretch(JUST_AHEAD) || self.is_time_to_fork(sweeps, goal, false)
                    }
                };
                if pauses {
                    sweeps.next = Some((histogram, looked_at));
                    return None;
                }
                let mut next = self.threshold(&histogram, looked_at, goal);
                if sweeps.probe {
                    // What a probe finds is exact; an evaluation may see more, and needs a higher threshold to be tried.
                    sweeps.lift =
                        if self.tally.collapses == sweeps.at_probe { sweeps.lift * 16.0 } else { 1.0 };
                    sweeps.at_probe = self.tally.collapses;
                    next = (next * sweeps.lift).min(f32::MAX);
                    (sweeps.highest, sweeps.idle) = (next, 0);
                }
                // Bounds are stale, some by far: a sweep in vain is no reason to go back to lower ones.
                sweeps.tau = if sweeps.idle > 0 { next.max(sweeps.highest * 1.25) } else { next };
                sweeps.highest = sweeps.highest.max(sweeps.tau);
                (sweeps.probe, sweeps.probed) = (false, sweeps.probe);
                (sweeps.at_threshold, sweeps.wanted) = (self.tally.collapses, self.wanted(goal));
            }
            let (tau, probe) = (sweeps.tau, sweeps.probe);
            self.mesh.cost.area =
                (self.mesh.cost.total_area / self.mesh.store.live_faces.max(1) as f64) as f32;
            let before = self.tally.collapses;
            let refused = self.tally.refused();
            let done = |engine: &Self| engine.done(goal, sweeps.begun_with, sweeps.start_faces);
            if self.mesh.topology.pairs.is_some() {
                let mut ask = |engine: &Self| control.progress(done(engine));
                match self.contract_pairs(goal, tau, probe, &mut ask) {
                    Verdict::Continue => {}
                    Verdict::Finish => return Some(End::Finish),
                    Verdict::Cancel => return Some(End::Cancel),
                }
            }
            let goal_faces = goal.faces.unwrap_or(0);
            let goal_vertices = goal.vertices.unwrap_or(0);
            let count = self.mesh.store.v.len();
            let brings = count >= BRINGS_FROM;
            self.tally.crowds.begin_sweep();
            'vertices: for start in (0..count).step_by(ASK_EVERY) {
                match control.progress(done(self)) {
                    Verdict::Continue => {}
                    Verdict::Finish => return Some(End::Finish),
                    Verdict::Cancel => return Some(End::Cancel),
                }
                let bounds = &self.mesh.store.bound[start..count.min(start + ASK_EVERY)];
                list_visits(bounds, start, tau, probe, &mut visits);
                for (at, &u) in visits.iter().enumerate() {
                    if brings {
                        self.mesh.store.bring(&visits, at);
                    }
                    if self.mesh.store.live_faces <= goal_faces
                        || self.mesh.store.live_vertices <= goal_vertices
                    {
                        break 'vertices;
                    }
                    if self.mesh.store.v[u.index()].kind.is_gone() {
                        continue;
                    }
                    self.visit(u, if probe { f32::MAX } else { tau }, probe, &mut scratch);
                    if self.mesh.store.is_full() {
                        // The rest of the sweep follows after a compaction, with the same threshold.
                        self.mesh.store.compact();
                        continue 'sweeps;
                    }
                }
            }
            if self.mesh.needed(goal) == Some(0) {
                return Some(End::Goal);
            }
            sweeps.swept = true;
            sweeps.idle = if self.tally.collapses == before { sweeps.idle + 1 } else { 0 };
            if sweeps.idle == 0 {
                self.tally.paid = self.tally.paid.max(tau);
                self.tally.is_strained |= !sweeps.is_at_ease;
            }
            if self.mesh.topology.parts.is_some() && !probe {
                self.drop_cheap_parts(goal, tau);
                if self.mesh.needed(goal) == Some(0) {
                    return Some(End::Goal);
                }
            }
            if self.mesh.store.wants_compaction(self.mesh.needed(goal)) {
                self.mesh.store.compact();
            }
            if self.is_late(extreme) {
                if sweeps.idle < PATIENCE
                    && matches!(pause, Pause::BeforeNeed | Pause::BeforeEither)
                    && self.may_fork_late()
                {
                    let next = self.mesh.bounds();
                    if next.0.known() > 0 {
                        // It begins when they go on.
                        sweeps.next = Some(next);
                        return None;
                    }
                }
                original.with(&mut |points, faces| self.mesh.begin_late(points, faces));
            }
            let (histogram, looked_at) = self.mesh.bounds();
            if histogram.known() == 0 {
                if sweeps.probed && !probe && self.mesh.constraints.rules.max_cost.is_finite() {
                    // Collapses since the last probe may have made room for edges that it saw refused: probe again.
                    sweeps.probe = true;
                    continue;
                }
                if sweeps.probed && self.mesh.constraints.rules.max_cost.is_finite() {
                    // Nothing but what is refused stays below the limit.
                    return Some(if self.tally.refused() == refused { End::Exhausted } else { End::Stuck });
                }
                if sweeps.probed && self.mesh.constraints.details.take().is_some() {
                    // The target comes first.
                    (sweeps.probe, sweeps.probed) = (true, true);
                    continue;
                }
                let looser = self
                    .mesh
                    .constraints
                    .looseness
                    .looser(self.mesh.store.creases.is_some(), self.mesh.values.attributes.is_some());
                if let (true, Some(looser)) = (sweeps.probed, looser) {
                    // Better a seam out of place than a whole part gone.
                    self.mesh.constraints.looseness = looser;
                    (sweeps.probe, sweeps.probed) = (true, true);
                    continue;
                }
                if sweeps.probed {
                    return Some(if self.remove_parts(goal) { End::Goal } else { End::Stuck });
                }
                (sweeps.probe, sweeps.probed) = (true, true);
                continue;
            }
            if sweeps.idle >= PATIENCE && !probe {
                // Nothing could go: find out what is possible at all, and at what cost.
                (sweeps.probe, sweeps.probed) = (true, true);
                continue;
            }
            sweeps.next = Some((histogram, looked_at));
        }
        Some(End::Stuck)
    }

    /// The threshold of the next sweep from the bounds, which may be those of some vertices only.
    fn threshold(&self, histogram: &Histogram, looked_at: usize, goal: &Goal) -> f32 {
        let quantile = match () {
            () if self.record.is_some() => record::QUANTILE,
            () if self.mesh.late.is_some() && !self.mesh.counts_attributes() => late::QUANTILE,
            () => QUANTILE,
        };
        let mut want = histogram.known() as f64 * quantile;
        if let Some(needed) = self.mesh.needed(goal) {
            // The last sweeps take only most of what is left, so that the cheapest go.
            let share = looked_at as f64 / self.mesh.store.v.len().max(1) as f64;
            want = want.min(needed as f64 * LAST_SHARE * share);
        }
        histogram.threshold((want as usize).max(1))
    }
}

impl<M: Metric> LiveMesh<M> {
    /// The bounds of all vertices, and of pairs.
    pub(super) fn bounds(&self) -> (Histogram, usize) {
        let mut histogram = Histogram::of(&self.store.bound);
        if let Some(pairs) = &self.topology.pairs {
            histogram.add(pairs.bounds());
        }
        (histogram, self.store.v.len())
    }
}

impl<M: Metric> Engine<M> {
    /// Whether the next sweep would be cut short for the goal, or might meet it.
    fn is_last_stretch(&self, histogram: &Histogram, looked_at: usize, goal: &Goal, ahead: f64) -> bool {
        let share = looked_at as f64 / self.mesh.store.v.len().max(1) as f64;
        self.mesh
            .needed(goal)
            .is_some_and(|n| n as f64 * LAST_SHARE * share < ahead * QUANTILE * histogram.known() as f64)
    }

    /// Whether a goal has a late phase.
    pub(super) fn is_extreme(&self, goal: &Goal) -> bool {
        !self.mesh.cost.metric.decides().is_metric()
            && goal.faces.is_some_and(|n| late::is_extreme(n, self.tally.first_faces))
    }

    /// Whether the late phase is to begin.
    fn is_late(&self, extreme: bool) -> bool {
        let begin = match self.record {
            Some(_) => late::begin_of_record(self.tally.first_faces),
            None => late::begin(self.tally.first_faces, self.mesh.counts_attributes()),
        };
        extreme && self.mesh.late.is_none() && self.mesh.store.live_faces < begin
    }
}

/// Lists the vertices from `start` on that a sweep looks at, of those whose bounds these are.
fn list_visits(bounds: &[f32], start: usize, tau: f32, all: bool, visits: &mut Vec<VertexId>) {
    visits.clear();
    let id = |i: usize| VertexId((start + i) as u32);
    if all {
        visits.extend((0..bounds.len()).map(id));
        return;
    }
    let (eights, rest) = bounds.as_chunks::<8>();
    for (k, &eight) in eights.iter().enumerate() {
        let mut low = f32x8::from(eight).simd_le(f32x8::splat(tau)).to_bitmask();
        while low != 0 {
            visits.push(id(8 * k + low.trailing_zeros() as usize));
            low &= low - 1;
        }
    }
    let first = 8 * eights.len();
    visits.extend(rest.iter().enumerate().filter(|x| *x.1 <= tau).map(|x| id(first + x.0)));
}
