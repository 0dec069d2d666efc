//! Sweeps: thresholds rise until the goal is reached; a run can pause between sweeps.

use std::ops::ControlFlow;

use lodsmith_core::VertexId;

use super::blocks::Blocks;
use super::bound::Histogram;
use super::bounded::Bounded;
use super::candidate::{Attempt, CollapseOutcome};
use super::star_data::PREFETCH_MIN_VERTICES;
use super::star_edges::Looseness;
use super::visit::{VisitScratch, list_visits};
use super::{Engine, Goal, LiveMesh, StopReason, record, samples};
use crate::collapse::ordered_input::OriginalInput;
use crate::control::{Control, Verdict};
use crate::cost::metric::Metric;
use crate::options::BlockSizes;
use crate::report::Refusal;

/// Share of the bounds that one sweep takes. (.4 and .7 give equal errors, .7 with fewer sweeps:
/// docs/decisions/0002.)
pub(super) const QUANTILE: f64 = 0.7;
/// Maximum share of the remaining collapses that one of the last sweeps takes.
pub(super) const LAST_SHARE: f64 = 0.85;
/// Margin over the expected size of a sweep that must not reach a goal. (Guessed.)
const GOAL_MARGIN: f64 = 1.2;
/// Number of sweeps without a collapse after which a probe searches for any possible collapse.
const MAX_IDLE_SWEEPS: usize = 4;
/// Maximum number of sweeps, far above what any run needs, as protection against bugs.
const MAX_SWEEPS: usize = 4000;
/// Maximum number of vertices sampled for the first threshold. (A few hundred determine a quantile within two
/// percent.)
const MAX_FIRST_SAMPLES: usize = 512;
/// Maximum sample count if attributes count, which makes evaluation slower. (This saves a twentieth of a
/// run's time; RMS within a percent.)
const MAX_FIRST_SAMPLES_WITH_WEDGES: usize = 128;
/// In larger meshes one vertex in this many is sampled, but at least `MIN_FIRST_SAMPLES`: it is only the
/// first of many thresholds.
const VERTICES_PER_FIRST_SAMPLE: usize = 24;
const MIN_FIRST_SAMPLES: usize = 128;
/// Live faces or vertices above the goal, as a share of it, below which a mesh is not cut any more: the last sweeps are
/// serial. (At least as many as are frozen, which are still to be reduced like the others.)
const LAST_PART: f64 = 0.05;
/// With a limit, the number of faces from which meshes are cut, and that of the vertices of a block, are divided by these.
/// (Guessed.)
const BOUNDED_DIVISORS: [usize; 2] = [8, 4];
/// Share of the collapses that a threshold aims at below which sweeps are serial from then on. (Guessed. Measured: .2 to .8
/// on a scan and its subdivisions; leaving the blocks at .24, which is what makes a run unproductive, left half of the
/// collapses of 9.4 million faces to serial sweeps.)
const MIN_SHARE_IN_BLOCKS: f64 = 0.1;
/// With a limit, late sweeps collapse little, so that the mesh is cut anew after each; below this share of what a
/// threshold aims at, one more sweep is in blocks. (Guessed.)
const BOUNDED_MIN_SHARE: f64 = 0.01;
/// Once a mesh is cut, it is cut again down to the number of faces from which meshes are cut, divided by this.
const MIN_FACES_DIVISOR: usize = 4;
/// Number of vertices between two progress reports.
pub(super) const VISITS_PER_PROGRESS_REPORT: usize = 4096;

/// Bounds of vertices, and the share of all vertices that they were computed from.
type Bounds = (Histogram, f64);

/// State of a run of sweeps.
#[derive(Clone)]
pub(crate) struct Sweeps {
    phase: Phase,
    /// Collapses needed at the start, and faces at the start, for the progress.
    pub(super) needed_at_start: usize,
    start_faces: usize,
    /// True from the end of the first sweep on.
    pub(super) has_swept: bool,
    /// Threshold of the sweep, and the highest so far.
    tau: f32,
    highest: f32,
    /// Sweeps in a row without a collapse.
    idle: usize,
    /// Factor of the threshold after a probe, because an evaluation may give a higher cost than the probe.
    lift: f32,
    /// Collapses by the last probe.
    at_probe: u64,
    pub(super) productivity: Productivity,
    /// Number of times that the mesh was cut into blocks.
    rounds: usize,
}

/// Phase of a run of sweeps.
///
/// ```text
/// Threshold -> Sweep -> Threshold -> Sweep -> ...      as long as bounds are known and sweeps collapse anything
///                 \-> Probe -> Threshold -> ...        no collapse: find out what is possible, at any cost
///                        \-> Probe -> ...              nothing is possible: relax a constraint, or end the run
/// ```
#[derive(Clone)]
enum Phase {
    /// The threshold is to be computed from these bounds.
    Threshold(Bounds, After),
    /// All edges up to the threshold are tried.
    Sweep(After),
    /// All edges are evaluated at any cost, and none is collapsed.
    Probe,
}

/// Kind of the previous sweep.
#[derive(Clone, Copy, PartialEq, Eq)]
enum After {
    Sweep,
    Probe,
}

/// Productivity of sweeps, compared with runs without obstacles.
#[derive(Clone)]
pub(super) struct Productivity {
    /// Collapses when the threshold was computed.
    pub(super) at_threshold: u64,
    /// Number of vertices whose edges the sweep should evaluate.
    pub(super) wanted: f64,
    /// True as long as each sweep did enough collapses.
    pub(super) is_high: bool,
}

impl Sweeps {
    /// True if a threshold comes next.
    pub(super) fn awaits_threshold(&self) -> bool {
        matches!(self.phase, Phase::Threshold(..))
    }

    /// Sets the bounds that the next threshold is computed from.
    pub(super) fn set_bounds(&mut self, bounds: Bounds) {
        let after = match self.phase {
            Phase::Threshold(_, after) => after,
            Phase::Sweep(_) => After::Sweep,
            Phase::Probe => After::Probe,
        };
        self.phase = Phase::Threshold(bounds, after);
    }
}

/// Result of one sweep.
enum SweepResult {
    /// All vertices were visited. The fields are the numbers of refusals and collapses before the sweep.
    Through { refused: u64, collapses: u64 },
    /// The lists were full: the rest of the sweep follows with the same threshold.
    Compacted,
    /// The run ends.
    Ended(StopReason),
}

/// The run pauses (`None`) or ends.
type Halt = Option<StopReason>;

/// Parameters of a request for sweeps.
struct SweepRequest<'a> {
    goal: &'a Goal,
    pause: Pause,
    original: &'a OriginalInput<'a>,
    /// True if the goal has a late phase.
    is_extreme: bool,
}

/// Condition at which sweeps pause.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pause {
    Never,
    /// Before the goal influences the size of a sweep: up to that point, all runs of the same input are
    /// identical.
    BeforeGoal,
    /// When a snapshot should be taken, from which parts and necks may be removed if necessary.
    BeforeTopologyChanges,
}

impl BlockSizes {
    /// Returns the number of faces from which a mesh is cut, for the first time or again.
    fn least_faces(self, again: bool) -> usize {
        if again { self.min_faces / MIN_FACES_DIVISOR } else { self.min_faces }
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Returns the number of collapses left for the goal; `None` without a goal.
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
    /// Returns the progress of a run, from 0 to 1: relative to the collapses needed at its start, or to the
    /// faces if there is no goal.
    fn done(&self, goal: &Goal, needed_at_start: usize, start_faces: usize) -> f64 {
        let done = match self.mesh.needed(goal) {
            Some(n) => 1.0 - n as f64 / needed_at_start as f64,
            None => 1.0 - self.mesh.store.live_faces as f64 / start_faces.max(1) as f64,
        };
        done.clamp(0.0, 1.0)
    }

    /// Sweeps until the goal is reached, no collapse is possible, or the caller ends it. The store is
    /// finished afterwards. May be called again with a lower goal, after [`Engine::reopen`].
    pub(crate) fn sweep(
        &mut self,
        goal: &Goal,
        original: &OriginalInput<'_>,
        control: &mut dyn Control,
    ) -> StopReason {
        let mut sweeps = self.begin_sweeps(goal);
        let end = self
            .resume_sweeps(&mut sweeps, goal, Pause::Never, original, control)
            .unwrap_or(StopReason::Stuck);
        if end != StopReason::Cancel {
            self.mesh.store.finish();
        }
        end
    }

    /// Prepares a run of sweeps and samples bounds for the first threshold.
    pub(crate) fn begin_sweeps(&mut self, goal: &Goal) -> Sweeps {
        let mut scratch = VisitScratch::default();
        self.mesh.cost.area = (self.mesh.cost.total_area / self.mesh.store.live_faces.max(1) as f64) as f32;
        let first = self.first_bounds(&mut scratch);
        let share = first.len() as f64 / self.mesh.store.v.len().max(1) as f64;
        let needed_at_start = self.mesh.needed(goal).unwrap_or(self.mesh.store.live_faces / 2).max(1);
        Sweeps {
            phase: Phase::Threshold((Histogram::of(&first), share), After::Sweep),
            needed_at_start,
            start_faces: self.mesh.store.live_faces,
            has_swept: false,
            tau: 0.0,
            highest: 0.0,
            idle: 0,
            lift: 1.0,
            at_probe: u64::MAX,
            productivity: Productivity { at_threshold: 0, wanted: 0.0, is_high: true },
            rounds: 0,
        }
    }

    /// Returns the bounds of some vertices spread over the mesh, for the first threshold: the exact cost of
    /// the edge that looks cheapest, because an evaluation cannot separate flat from nearly flat. In a
    /// small mesh, all vertices.
    fn first_bounds(&mut self, scratch: &mut VisitScratch) -> Vec<f32> {
        let max_samples =
            if self.mesh.counts_attributes() { MAX_FIRST_SAMPLES_WITH_WEDGES } else { MAX_FIRST_SAMPLES };
        let count = self.mesh.store.v.len();
        let samples = if count <= max_samples {
            max_samples
        } else {
            (count / VERTICES_PER_FIRST_SAMPLE).clamp(MIN_FIRST_SAMPLES, max_samples)
        };
        let step = count.div_ceil(samples).max(1);
        let mut bounds = Vec::with_capacity(samples);
        for u in (0..count).step_by(step).map(|i| VertexId(i as u32)) {
            self.evaluate_at_any_cost(u, scratch);
            let VisitScratch { ru, rv, found, .. } = &mut *scratch;
            let best = found.take_cheapest();
            bounds.push(best.map_or(f32::INFINITY, |best| {
                if !self.tally.hub_budget.admit(ru.len() + self.mesh.store.listed(best.removed).len()) {
                    return best.cost;
                }
                self.mesh.store.ring(best.removed, rv);
                let (tau, rings) = (f32::MAX, [&*ru, &*rv]);
                match self.collapse(&Attempt { kept: u, candidate: &best, tau, is_probe: true, rings }) {
                    CollapseOutcome::Later(cost) => cost,
                    CollapseOutcome::Done | CollapseOutcome::Refused(_) => f32::INFINITY,
                }
            }));
        }
        bounds
    }

    /// Continues the sweeps towards a goal, and returns why they ended. Returns `None` at a pause: then the
    /// run can be continued as if it had not paused (but in other blocks), and so can a copy of it, to other goals or with
    /// other rules.
    pub(crate) fn resume_sweeps(
        &mut self,
        sweeps: &mut Sweeps,
        goal: &Goal,
        pause: Pause,
        original: &OriginalInput<'_>,
        control: &mut dyn Control,
    ) -> Option<StopReason> {
        let end = self.resume_unchecked(sweeps, goal, pause, original, control);
        self.check_if_enabled(original);
        end
    }

    /// Sweeps until the run pauses or ends; [`Self::resume_sweeps`] checks the store afterwards.
    fn resume_unchecked(
        &mut self,
        sweeps: &mut Sweeps,
        final_goal: &Goal,
        pause: Pause,
        original: &OriginalInput<'_>,
        control: &mut dyn Control,
    ) -> Option<StopReason> {
        let is_extreme = self.is_extreme(final_goal);
        self.mesh.find_details(final_goal);
        let (mut scratch, mut visits) = (VisitScratch::default(), Vec::new());
        let request = SweepRequest { goal: final_goal, pause, original, is_extreme };
        if self.may_be_cut(sweeps) {
            match self.sweep_in_blocks(sweeps, &request, control) {
                Verdict::Continue => {}
                Verdict::Finish => return Some(StopReason::Finish),
                Verdict::Cancel => return Some(StopReason::Cancel),
            }
        }
        for _ in 0..MAX_SWEEPS {
            self.check_if_enabled(original);
            let goal = &self.goal_for_estimate(final_goal);
            if self.mesh.needed(goal) == Some(0) {
                return Some(StopReason::Goal);
            }
            let request = SweepRequest { goal, pause, original, is_extreme };
            if let ControlFlow::Break(stop) = self.set_threshold(sweeps, &request) {
                return stop;
            }
            match self.sweep_once(sweeps, goal, control, &mut scratch, &mut visits) {
                SweepResult::Compacted => {}
                SweepResult::Ended(StopReason::Goal) if self.has_budget() => {
                    sweeps.has_swept = true;
                    sweeps.idle = 0;
                    sweeps.set_bounds(self.mesh.bounds());
                }
                SweepResult::Ended(end) => return Some(end),
                SweepResult::Through { refused, collapses } => {
                    sweeps.has_swept = true;
                    sweeps.idle = if self.tally.collapses == collapses { sweeps.idle + 1 } else { 0 };
                    let next = self.after_sweep(sweeps, &request, refused);
                    match next {
                        // (Only the goal of this sweep is reached.)
                        ControlFlow::Break(Some(StopReason::Goal)) if self.has_budget() => {
                            sweeps.set_bounds(self.mesh.bounds());
                        }
                        ControlFlow::Break(stop) => return stop,
                        ControlFlow::Continue(()) => {}
                    }
                }
            }
        }
        Some(StopReason::Stuck)
    }

    /// True if blocks of the mesh can be swept side by side, with the same rules.
    fn may_be_cut(&self, sweeps: &Sweeps) -> bool {
        let LiveMesh { store, constraints, values, sampled, bounded, topology, .. } = &self.mesh;
        let is_early = sampled.is_none() && constraints.details.is_none();
        // (Limits that vary are known by the number of a sample.)
        let has_one_limit = |bounded: &Bounded| bounded.varying.is_none() && bounded.max_refusals == u64::MAX;
        let keeps_topology = topology.parts.is_none() && topology.pairs.is_none() && !constraints.cuts_necks;
        let has_count = !constraints.rules.max_estimate.is_finite();
        is_early
            && keeps_topology
            && has_count
            && bounded.as_deref().is_none_or(has_one_limit)
            && self.record.is_none()
            && values.wedge_data.is_none()
            && store.live_faces >= self.block_sizes().least_faces(sweeps.rounds > 0)
    }

    /// Returns the sizes of blocks: with a limit each collapse takes so long that small blocks pay.
    fn block_sizes(&self) -> BlockSizes {
        let BlockSizes { min_faces, vertices } = self.mesh.constraints.rules.blocks;
        match self.mesh.bounded {
            None => BlockSizes { min_faces, vertices },
            Some(_) => BlockSizes {
                min_faces: min_faces / BOUNDED_DIVISORS[0],
                vertices: vertices / BOUNDED_DIVISORS[1],
            },
        }
    }

    /// Sweeps in blocks as long as sweeps are large. The run does not pause or end here, except by the caller's verdict.
    fn sweep_in_blocks(
        &mut self,
        sweeps: &mut Sweeps,
        request: &SweepRequest<'_>,
        control: &mut dyn Control,
    ) -> Verdict {
        let (goal, sizes) = (request.goal, self.block_sizes());
        let mut blocks = None::<Blocks<M>>;
        let mut verdict = Verdict::Continue;
        let (mut cuts_anew, mut is_last) = (false, false);
        while let (Verdict::Continue, Phase::Threshold(bounds, After::Sweep)) = (verdict, &sweeps.phase) {
            let live = self.mesh.store.live_faces;
            self.update_productivity(&mut sweeps.productivity, sweeps.has_swept);
            if self.pauses(sweeps, request, bounds)
                || live < sizes.least_faces(true)
                || self.is_near_end(goal, request.is_extreme, blocks.as_ref())
            {
                break;
            }
            sweeps.tau = self.threshold(bounds, goal);
            sweeps.highest = sweeps.highest.max(sweeps.tau);
            if is_last {
                // (All that is left below the limit: what is refused now needs no other test.)
                sweeps.tau = f32::MAX;
            }
            if blocks.as_ref().is_none_or(|blocks| cuts_anew || blocks.is_sparse(live)) {
                match &mut blocks {
                    Some(blocks) => self.end_round(blocks),
                    None => self.mesh.store.compact_if_needed(),
                }
                let Some(cut) = self.cut_into_blocks(blocks.as_ref(), sweeps.rounds, sizes.vertices) else {
                    break;
                };
                self.release_elements();
                blocks = Some(cut);
                sweeps.rounds += 1;
            }
            let Some(cut) = &mut blocks else { break };
            let collapses = self.tally.collapses;
            // (What is frozen blocks collapses here only.)
            let wanted = self.wanted(goal) * cut.free_share(self.mesh.store.live_vertices);
            (sweeps.productivity.at_threshold, sweeps.productivity.wanted) = (collapses, wanted);
            let area = (self.mesh.cost.total_area / live.max(1) as f64) as f32;
            cut.sweep(sweeps.tau, area, self.mesh.needed(goal));
            let left = cut.take_tally(&mut self.tally);
            [self.mesh.store.live_faces, self.mesh.store.live_vertices] = left;
            sweeps.has_swept = true;
            sweeps.set_bounds(known_bounds(cut.bounds()));
            let done = self.tally.collapses - collapses;
            if done > 0 {
                self.tally.highest_threshold = self.tally.highest_threshold.max(sweeps.tau);
                self.tally.is_unproductive |= !sweeps.productivity.is_high;
            }
            let share = done as f64 / wanted;
            cuts_anew = share <= MIN_SHARE_IN_BLOCKS;
            if is_last || cuts_anew && self.mesh.bounded.is_none() {
                break;
            }
            is_last = cuts_anew && share <= BOUNDED_MIN_SHARE;
            verdict = control.progress(self.done(goal, sweeps.needed_at_start, sweeps.start_faces));
        }
        if let Some(mut blocks) = blocks {
            self.end_round(&mut blocks);
            self.gather(&blocks);
            drop(blocks);
            self.mesh.store.link();
            sweeps.set_bounds(known_bounds(Histogram::of(&self.mesh.store.bound)));
        }
        verdict
    }

    /// True if so little is left to do that the goal, or the late phase, might be reached in one sweep.
    fn is_near_end(&self, goal: &Goal, is_extreme: bool, blocks: Option<&Blocks<M>>) -> bool {
        let live = [self.mesh.store.live_faces, self.mesh.store.live_vertices];
        let frozen = blocks.map_or(0.0, |blocks| 1.0 - blocks.free_share(live[1]));
        let last = 1.0 + LAST_PART.max(frozen);
        let near = |live: usize, goal: Option<usize>| goal.is_some_and(|n| (live as f64) < last * n as f64);
        near(live[0], goal.faces) || near(live[1], goal.vertices) || is_extreme && self.is_near_late_phase()
    }

    /// True if the run pauses before the sweep with a threshold from these bounds.
    fn pauses(&self, sweeps: &Sweeps, request: &SweepRequest<'_>, bounds: &Bounds) -> bool {
        let is_last_stretch = || self.is_limited_by_goal(bounds, request.goal, GOAL_MARGIN);
        match request.pause {
            Pause::Never => false,
            Pause::BeforeGoal => is_last_stretch(),
            Pause::BeforeTopologyChanges => self.should_snapshot(sweeps, request.goal, is_last_stretch()),
        }
    }

    /// Computes the threshold of the next sweep, if none is set, unless the run pauses here.
    fn set_threshold(&mut self, sweeps: &mut Sweeps, request: &SweepRequest<'_>) -> ControlFlow<Halt> {
        let goal = request.goal;
        // If the sweeps were resumed with another goal, that goal decides what follows a sweep.
        if sweeps.has_swept && sweeps.awaits_threshold() {
            if self.mesh.store.wants_compaction(self.mesh.needed(goal)) {
                self.mesh.store.compact();
                sweeps.set_bounds(self.mesh.bounds());
            }
            if self.is_late(request.is_extreme) {
                request.original.visit(|points, faces| self.mesh.start_sampling(points, faces));
                sweeps.set_bounds(self.mesh.bounds());
            }
        }
        let Phase::Threshold(bounds, after) = &sweeps.phase else {
            return ControlFlow::Continue(());
        };
        let after = *after;
        self.update_productivity(&mut sweeps.productivity, sweeps.has_swept);
        if self.pauses(sweeps, request, bounds) {
            return ControlFlow::Break(None);
        }
        let mut next = self.threshold(bounds, goal);
        if after == After::Probe {
            // The result of a probe is exact; an evaluation may give a higher cost, so the edge is only tried
            // at a higher threshold.
            sweeps.lift = if self.tally.collapses == sweeps.at_probe { sweeps.lift * 16.0 } else { 1.0 };
            sweeps.at_probe = self.tally.collapses;
            next = (next * sweeps.lift).min(f32::MAX);
            (sweeps.highest, sweeps.idle) = (next, 0);
        }
        // Bounds are stale, some of them very much: a sweep without collapses is no reason to lower the
        // threshold.
        sweeps.tau = match sweeps.idle {
            0 => next,
            // All that is left below the limit.
            n if n >= MAX_IDLE_SWEEPS && self.mesh.bounded.is_some() => f32::MAX,
            _ => next.max(sweeps.highest * 1.25),
        };
        sweeps.highest = sweeps.highest.max(sweeps.tau);
        (sweeps.productivity.at_threshold, sweeps.productivity.wanted) =
            (self.tally.collapses, self.wanted(goal));
        sweeps.phase = Phase::Sweep(after);
        ControlFlow::Continue(())
    }

    /// Runs one sweep or probe over all vertices, or the rest of one.
    fn sweep_once(
        &mut self,
        sweeps: &Sweeps,
        goal: &Goal,
        control: &mut dyn Control,
        scratch: &mut VisitScratch,
        visits: &mut Vec<VertexId>,
    ) -> SweepResult {
        let (tau, is_probe) = (sweeps.tau, matches!(sweeps.phase, Phase::Probe));
        self.mesh.cost.area = (self.mesh.cost.total_area / self.mesh.store.live_faces.max(1) as f64) as f32;
        let (collapses, refused) = (self.tally.collapses, self.tally.refused());
        let done = |engine: &Self| engine.done(goal, sweeps.needed_at_start, sweeps.start_faces);
        if self.mesh.topology.pairs.is_some() {
            let mut ask = |engine: &Self| control.progress(done(engine));
            match self.contract_pairs(goal, tau, is_probe, &mut ask) {
                Verdict::Continue => {}
                Verdict::Finish => return SweepResult::Ended(StopReason::Finish),
                Verdict::Cancel => return SweepResult::Ended(StopReason::Cancel),
            }
        }
        let goal_faces = goal.faces.unwrap_or(0);
        let goal_vertices = goal.vertices.unwrap_or(0);
        let max_cost = self.cost_budget() - self.cost_of_removed_parts();
        let max_refusals = self.mesh.bounded.as_ref().map_or(u64::MAX, |bounded| bounded.max_refusals);
        let count = self.mesh.store.v.len();
        let prefetches = count >= PREFETCH_MIN_VERTICES;
        self.tally.hub_budget.begin_sweep();
        'vertices: for start in (0..count).step_by(VISITS_PER_PROGRESS_REPORT) {
            match control.progress(done(self)) {
                Verdict::Continue => {}
                Verdict::Finish => return SweepResult::Ended(StopReason::Finish),
                Verdict::Cancel => return SweepResult::Ended(StopReason::Cancel),
            }
            let bounds = &self.mesh.store.bound[start..count.min(start + VISITS_PER_PROGRESS_REPORT)];
            list_visits(bounds, start, tau, is_probe, visits);
            for (at, &u) in visits.iter().enumerate() {
                if prefetches {
                    self.mesh.store.prefetch(visits, at);
                }
                let store = &self.mesh.store;
                if store.live_faces <= goal_faces || store.live_vertices <= goal_vertices {
                    break 'vertices;
                }
                if self.tally.collapse_cost > max_cost {
                    return SweepResult::Ended(StopReason::Finish);
                }
                if self.tally.refusals[Refusal::ErrorLimit as usize] > max_refusals {
                    return SweepResult::Ended(StopReason::Stuck);
                }
                if store.v[u.index()].kind.is_gone() {
                    continue;
                }
                self.visit(u, if is_probe { f32::MAX } else { tau }, is_probe, scratch);
                if self.mesh.store.is_full() {
                    self.mesh.store.compact();
                    return SweepResult::Compacted;
                }
            }
        }
        if self.mesh.needed(goal) == Some(0) {
            return SweepResult::Ended(StopReason::Goal);
        }
        SweepResult::Through { refused, collapses }
    }

    /// Decides what follows a sweep or probe. `refused` is the number of refusals before it.
    fn after_sweep(
        &mut self,
        sweeps: &mut Sweeps,
        request: &SweepRequest<'_>,
        refused: u64,
    ) -> ControlFlow<Halt> {
        let (goal, is_probe) = (request.goal, matches!(sweeps.phase, Phase::Probe));
        if sweeps.idle == 0 {
            self.tally.highest_threshold = self.tally.highest_threshold.max(sweeps.tau);
            self.tally.is_unproductive |= !sweeps.productivity.is_high;
        }
        if self.mesh.topology.parts.is_some() && !is_probe {
            self.drop_cheap_parts(goal, sweeps.tau);
            if self.mesh.needed(goal) == Some(0) {
                return ControlFlow::Break(Some(StopReason::Goal));
            }
        }
        if self.mesh.store.wants_compaction(self.mesh.needed(goal)) {
            self.mesh.store.compact();
        }
        if self.is_late(request.is_extreme) {
            if sweeps.idle < MAX_IDLE_SWEEPS
                && matches!(request.pause, Pause::BeforeTopologyChanges)
                && self.may_snapshot_late()
            {
                let next = self.mesh.bounds();
                if next.0.known() > 0 {
                    // The late phase starts when the sweeps are continued.
                    sweeps.set_bounds(next);
                    return ControlFlow::Break(None);
                }
            }
            request.original.visit(|points, faces| self.mesh.start_sampling(points, faces));
        }
        let bounds = self.mesh.bounds();
        if self.mesh.bounded.is_some() {
            // What was refused is not tried again, so the rest needs no probe.
            if bounds.0.known() == 0 || (sweeps.idle > MAX_IDLE_SWEEPS && sweeps.tau == f32::MAX) {
                return ControlFlow::Break(Some(StopReason::Exhausted));
            }
            sweeps.set_bounds(bounds);
            return ControlFlow::Continue(());
        }
        if bounds.0.known() == 0 {
            return self.relax_or_stop(sweeps, goal, refused);
        }
        if sweeps.idle >= MAX_IDLE_SWEEPS && !is_probe {
            // No collapse was done: find out what is possible at all, and at what cost.
            sweeps.phase = Phase::Probe;
        } else {
            sweeps.set_bounds(bounds);
        }
        ControlFlow::Continue(())
    }

    /// Relaxes a constraint after a sweep that left no edge possible, and probes again; or ends the run.
    fn relax_or_stop(&mut self, sweeps: &mut Sweeps, goal: &Goal, refused: u64) -> ControlFlow<Halt> {
        let was = std::mem::replace(&mut sweeps.phase, Phase::Probe);
        let may_blend = self.mesh.values.attributes.is_some();
        let seams_refused = self.tally.has_refused(Refusal::Seam);
        let may_relax = self.mesh.may_relax_seams() && (may_blend || seams_refused);
        let constraints = &mut self.mesh.constraints;
        let has_limit = constraints.rules.max_cost.is_finite();
        match was {
            Phase::Sweep(After::Sweep) => return ControlFlow::Continue(()),
            // Collapses since the last probe may have made edges possible that it refused.
            Phase::Sweep(After::Probe) if has_limit => return ControlFlow::Continue(()),
            // Only refused edges remain below the limit.
            Phase::Probe if has_limit => {
                let is_done = self.tally.refused() == refused;
                return ControlFlow::Break(Some(if is_done {
                    StopReason::Exhausted
                } else {
                    StopReason::Stuck
                }));
            }
            _ => {}
        }
        if constraints.details.take().is_some() {
            // The target has priority over details.
            return ControlFlow::Continue(());
        }
        let has_creases = self.mesh.store.creases.is_some();
        // (Matched wedges stay in their region.)
        let keeps_regions = |looser: &Looseness| *looser != Looseness::Regions || may_blend;
        let looser = constraints.looseness.looser(has_creases, may_relax).filter(keeps_regions);
        if let Some(looser) = looser {
            // A displaced seam is better than a removed part.
            constraints.looseness = looser;
            return ControlFlow::Continue(());
        }
        if self.mesh.constraints.rules.max_estimate.is_finite() {
            // The cost of a removed part may be far above the limit.
            return ControlFlow::Break(Some(StopReason::Stuck));
        }
        ControlFlow::Break(Some(if self.remove_parts(goal) { StopReason::Goal } else { StopReason::Stuck }))
    }

    /// Computes the threshold of the next sweep from the bounds, which may cover only a sample of the
    /// vertices.
    fn threshold(&self, (histogram, share): &Bounds, goal: &Goal) -> f32 {
        let quantile = match () {
            () if self.record.is_some() => record::RECORD_QUANTILE,
            () if self.mesh.sampled.is_some() && !self.mesh.counts_attributes() => samples::LATE_QUANTILE,
            () => QUANTILE,
        };
        let mut want = histogram.known() as f64 * quantile;
        if let Some(needed) = self.mesh.needed(goal) {
            // The last sweeps do only a part of the remaining collapses, so that the cheapest are done.
            want = want.min(needed as f64 * LAST_SHARE * share);
        }
        histogram.threshold((want as usize).max(1))
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Returns the bounds of all vertices, and of pairs.
    pub(super) fn bounds(&self) -> Bounds {
        let mut histogram = Histogram::of(&self.store.bound);
        if let Some(pairs) = &self.topology.pairs {
            histogram.add(pairs.bounds());
        }
        (histogram, 1.0)
    }
}

impl<M: Metric> Engine<M> {
    /// True if the next sweep would be limited by the goal, or might reach it.
    fn is_limited_by_goal(&self, (histogram, share): &Bounds, goal: &Goal, ahead: f64) -> bool {
        self.mesh
            .needed(goal)
            .is_some_and(|n| n as f64 * LAST_SHARE * share < ahead * QUANTILE * histogram.known() as f64)
    }

    /// True if a goal has a late phase.
    pub(super) fn is_extreme(&self, goal: &Goal) -> bool {
        !self.mesh.cost.metric.cost_source().is_decided_by_metric()
            && !self.mesh.constraints.rules.is_quick
            && goal.faces.is_some_and(|n| samples::is_extreme(n, self.tally.first_faces))
    }

    /// True if the late phase should start.
    fn is_late(&self, extreme: bool) -> bool {
        let begin = match self.record {
            Some(_) => samples::start_faces_of_record(self.tally.first_faces),
            None => samples::start_faces(self.tally.first_faces, self.mesh.counts_attributes()),
        };
        extreme && self.mesh.sampled.is_none() && self.mesh.store.live_faces < begin
    }
}

/// Leaves out vertices that have not been visited: their bounds are not known yet.
fn known_bounds(mut histogram: Histogram) -> Bounds {
    let all = histogram.known();
    let unknown = histogram.leave_out_unknown();
    (histogram, (all - unknown) as f64 / all.max(1) as f64)
}
