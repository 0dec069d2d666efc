//! The edge collapse engine.
//!
//! ```text
//! order the input along a Morton curve                     (order)
//! give each vertex its tensor and its kind                 (kind, metric)
//! loop                                                     (this file)
//!     tau = a quantile of the bounds                       (bound)
//!     for each vertex u with bound[u] <= tau, in order
//!         evaluate the edges that u owns
//!         the cheapest: link condition, guards, exact cost (link_condition, commit)
//!         done if it costs at most tau; bound[u] = what is left
//!     compact when much is dead                            (store)
//!     at extreme targets charge true distances             (late)
//!     when nothing can go any more, whole parts may        (parts)
//! ```
//!
//! There is no queue, and nothing is re-evaluated for a collapse: an edge belongs to its lower end, `bound[u]` is the
//! least cost last seen at u, and a stale bound only delays or hastens a collapse by a sweep. Exact order buys nothing:
//! the expected quality is that of a global queue [Wu-Kobbelt 2002], at a fraction of its time.

mod bound;
mod commit;
pub(crate) mod kind;
mod late;
mod link_condition;
pub(crate) mod order;
mod parts;
pub(crate) mod store;
mod wedges;

use glam::Vec3;
use lodsmith_core::VertexId;

use crate::control::{Control, Verdict};
use crate::guard::Rules;
use crate::metric::{Form, Metric};
use crate::options::Placement;
use crate::report::Refusal;
use crate::tensor::Tensor;
use bound::Histogram;
use commit::{BORDER, Candidate, Outcome, PEAK, TIE, Wing};
use kind::{Kind, distinct, faces_at};
use late::Late;
use store::{Ring, Store};
pub(crate) use wedges::Wedges;

/// Share of the bounds that one sweep takes. (engine design §11.2: .4 and .7 give equal errors, .7 fewer sweeps.)
const QUANTILE: f64 = 0.7;
/// Pull of the best position towards the middle of the edge, a share of the trace. (§11.3)
const CENTRE: f32 = 1e-5;
/// Largest squared distance over the mean one, as assumed until it is computed. (§11.4)
const PEAK_GUESS: f32 = 4.0;
/// Share of trace³ under which the system is not solved. (§2.3)
const MIN_DET: f32 = 1e-9;
/// No run needs nearly as many sweeps; a guard against our own mistakes.
const MOST_SWEEPS: usize = 4000;
/// Vertices looked at for the first threshold. (A few thousand hold a quantile within a percent or two.)
const FIRST_LOOK: usize = 4096;
/// Vertices between two questions to the caller.
const ASK_EVERY: usize = 4096;

/// When the engine stops: at this many faces or vertices, whichever is met first; `None` is never.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Goal {
    pub(crate) faces: Option<usize>,
    pub(crate) vertices: Option<usize>,
}

/// Why the engine stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// The goal is met.
    Goal,
    /// Nothing is left that may go.
    Stuck,
    /// The caller wants the best so far.
    Finish,
    /// The caller wants nothing.
    Cancel,
}

/// What the late phase and the fit look back on: the ordered input, kept or made again.
pub(crate) trait Original {
    /// Calls back with the positions in the unit frame and the faces.
    fn with(&self, call: &mut dyn FnMut(&[Vec3], &[[VertexId; 3]]));
}

pub(crate) struct Engine<M: Metric> {
    pub(crate) store: Store<M>,
    rules: Rules,
    /// Mean over the live triangles, as the tensors count it.
    area: f32,
    total_area: f64,
    late: Option<Late>,
    wedge_data: Option<Wedges>,
    pub(crate) refusals: [u64; Refusal::ALL.len()],
    pub(crate) collapses: u64,
    pub(crate) parts_removed: usize,
    /// Sum of the costs paid: twice an area times a squared distance.
    spent: f64,
    wings: Vec<Wing>,
    rim: Vec<(VertexId, bool)>,
}

impl<M: Metric> Engine<M> {
    /// Takes a store and fills its tensors and kinds. Says how many faces stood twice with the same winding; they are
    /// gone afterwards.
    pub(crate) fn new(store: Store<M>, rules: Rules, wedge_data: Option<Wedges>) -> (Self, usize) {
        let mut engine = Self {
            store,
            rules,
            area: 0.0,
            total_area: 0.0,
            late: None,
            wedge_data,
            refusals: [0; Refusal::ALL.len()],
            collapses: 0,
            parts_removed: 0,
            spent: 0.0,
            wings: Vec::new(),
            rim: Vec::new(),
        };
        let duplicates = engine.classify();
        engine.weigh();
        (engine, duplicates)
    }

    /// Kinds of all vertices; drops faces that stand twice.
    fn classify(&mut self) -> usize {
        let (mut ring, mut duplicates) = (Vec::new(), Vec::new());
        for u in (0..self.store.v.len() as u32).map(VertexId) {
            self.store.ring(u, &mut ring);
            let kind = Kind::of(&ring, self.rules.border);
            if !kind.is_regular() {
                let twice = |i: usize| ring[..i].iter().any(|r| (r.a, r.b) == (ring[i].a, ring[i].b));
                duplicates.extend((0..ring.len()).filter(|&i| twice(i)).map(|i| ring[i].corner.face()));
            }
            self.store.v[u.index()].kind = kind;
        }
        if duplicates.is_empty() {
            return 0;
        }
        duplicates.sort_unstable();
        duplicates.dedup();
        for &face in &duplicates {
            self.store.t[face][0] = order::NONE;
        }
        self.store.compact();
        self.classify();
        duplicates.len()
    }

    /// Tensors of all vertices.
    fn weigh(&mut self) {
        for i in 0..self.store.t.len() {
            let t = self.store.t[i];
            let [a, b, c] = t.map(|w| self.store.p(w));
            let normal = (b - a).cross(c - a);
            self.total_area += f64::from(normal.length());
            let plane = Tensor::plane(normal);
            for w in t {
                M::tensor(&mut self.store.v[w.index()].q).add(&plane);
            }
        }
        let mut ring = Vec::new();
        for u in (0..self.store.v.len() as u32).map(VertexId) {
            if self.store.v[u.index()].kind.is_feature() && self.has_lines() {
                self.store.ring(u, &mut ring);
                self.add_lines(u, &ring);
            }
        }
    }

    fn add_lines(&mut self, u: VertexId, ring: &Ring) {
        for w in distinct(ring).filter(|&w| faces_at(ring, w) != 2) {
            let line = Tensor::line(self.store.p(w) - self.store.p(u), BORDER);
            M::tensor(&mut self.store.v[u.index()].q).add(&line);
        }
    }

    /// Kind and, where the metric is memoryless, tensor of a vertex afresh from its star.
    fn refresh(&mut self, u: VertexId, ring: &mut Ring) {
        self.store.ring(u, ring);
        let old = self.store.v[u.index()].kind;
        self.store.v[u.index()].kind = Kind::of(ring, self.rules.border).moved(old.is_moved());
        if !M::MEMORYLESS {
            return;
        }
        let p = self.store.p(u);
        let mut q = M::Memory::default();
        for r in ring.iter() {
            M::tensor(&mut q).add(&Tensor::plane((self.store.p(r.a) - p).cross(self.store.p(r.b) - p)));
        }
        self.store.v[u.index()].q = q;
        if self.has_lines() {
            self.add_lines(u, ring);
        }
    }

    /// Cost of the collapse of u and v, and the best place of the merged vertex relative to u; `None` if neither end
    /// may move.
    #[inline(never)]
    fn evaluate(&self, u: VertexId, v: VertexId) -> Option<Candidate> {
        let (x, z) = (&self.store.v[u.index()], &self.store.v[v.index()]);
        let d = z.p - x.p;
        let form = M::form(&x.q, &z.q, d);
        let Form { a, h, c } = form;
        let trace = a.trace();
        let peak = if M::MEMORYLESS { 1.0 + PEAK_GUESS * PEAK * self.area / trace.max(1e-37) } else { 1.0 };
        let cost = |y: Vec3| {
            let off = y - d;
            let q = c - 2.0 * h.dot(y) + a.times(y).dot(y);
            q.max(0.0) * peak + 0.5 * TIE * trace * (y.length_squared() + off.length_squared())
        };
        let at = |y: Vec3| Some(Candidate { cost: cost(y), removed: v, step: y });
        let ends = || if cost(Vec3::ZERO) <= cost(d) { at(Vec3::ZERO) } else { at(d) };
        if !(x.kind.is_free() && z.kind.is_free()) {
            return match (x.kind, z.kind) {
                (k, l) if k.is_fixed() && l.is_fixed() => None,
                (k, _) if k.is_fixed() => at(Vec3::ZERO),
                (_, l) if l.is_fixed() => at(d),
                (k, l) if k.is_rail() && l.is_rail() => match self.rules.placement {
                    Placement::Endpoint => ends(),
                    Placement::Midpoint => at(d * 0.5),
                    Placement::Optimal => {
                        let t = (d.dot(h) / d.dot(a.times(d)).max(1e-37)).clamp(0.0, 1.0);
                        at(if t == 1.0 { d } else { d * t })
                    }
                },
                (k, _) if k.is_rail() => at(Vec3::ZERO),
                _ => at(d),
            };
        }
        match self.rules.placement {
            Placement::Optimal => {}
            Placement::Endpoint => return ends(),
            Placement::Midpoint => return at(d * 0.5),
        }
        let mid = d * 0.5;
        let r = CENTRE * trace;
        let (adjugate, det) = a.damped(r).adjugate();
        if det > MIN_DET * trace * trace * trace {
            let y = adjugate.times(h + mid * r) * (1.0 / det);
            if (y - mid).length_squared() < 4.0 * d.length_squared() {
                return at(y);
            }
        }
        let ends = ends()?;
        if cost(mid) <= ends.cost { at(mid) } else { Some(ends) }
    }

    fn refuse(&mut self, why: Refusal) {
        self.refusals[why as usize] += 1;
    }

    /// The bounds of some vertices spread over the mesh, for the first threshold. Of a small mesh, all.
    fn first_bounds(&mut self) -> Vec<f32> {
        let step = self.store.v.len().div_ceil(FIRST_LOOK).max(1);
        let mut ring = Ring::new();
        let mut bounds = Vec::with_capacity(FIRST_LOOK);
        for u in (0..self.store.v.len()).step_by(step).map(|i| VertexId(i as u32)) {
            self.store.ring(u, &mut ring);
            let owned = ring.iter().flat_map(|r| [r.a, r.b]).filter(|&w| w > u);
            let costs = owned.filter_map(|w| self.evaluate(u, w)).map(|c| c.cost);
            bounds.push(costs.fold(f32::INFINITY, f32::min));
        }
        bounds
    }

    /// The threshold of the next sweep from the bounds, which may be those of some vertices only.
    fn threshold(&self, histogram: &Histogram, looked_at: usize, goal: &Goal) -> f32 {
        let quantile = if self.late.is_some() { late::QUANTILE } else { QUANTILE };
        let mut want = histogram.known() as f64 * quantile;
        if let Some(needed) = self.needed(goal) {
            // The last sweeps take only most of what is left, so that the cheapest go.
            let share = looked_at as f64 / self.store.v.len().max(1) as f64;
            want = want.min(needed as f64 * 0.85 * share);
        }
        histogram.threshold((want as usize).max(1))
    }

    /// Evaluates the edges that u owns, collapses the cheapest that costs at most tau and can, renews `bound[u]`.
    fn visit(&mut self, u: VertexId, tau: f32, probe: bool, scratch: &mut Scratch) {
        let Scratch { ru, rv, found } = scratch;
        self.store.ring(u, ru);
        found.clear();
        let mut least = f32::INFINITY;
        let regular = self.store.v[u.index()].kind.is_regular();
        let stamp = if regular { 0 } else { self.store.next_stamp() };
        for r in ru.iter() {
            // Inside closed fans every neighbour comes first in one of the triangles: no need to look at the second.
            for w in [r.a, r.b].into_iter().take(if regular { 1 } else { 2 }) {
                if w <= u {
                    continue;
                }
                if !regular {
                    let mark = &mut self.store.v[w.index()].mark;
                    if *mark == stamp {
                        continue;
                    }
                    *mark = stamp;
                }
                match self.evaluate(u, w) {
                    None => self.refuse(Refusal::NonManifold),
                    Some(c) if c.cost <= tau => found.push(c),
                    Some(c) => least = least.min(c.cost),
                }
            }
        }
        while let Some(i) = (0..found.len()).min_by(|&i, &j| found[i].cost.total_cmp(&found[j].cost)) {
            let candidate = found.swap_remove(i);
            let inherited = self.store.bound[candidate.removed.index()];
            self.store.ring(candidate.removed, rv);
            match self.collapse(u, &candidate, tau, probe, ru, rv) {
                Outcome::Done => {
                    least = found.iter().fold(least.min(inherited), |l, f| l.min(f.cost));
                    break;
                }
                Outcome::Later(cost) => least = least.min(cost),
                Outcome::Refused(why) => {
                    self.refuse(why);
                    if !probe {
                        // Asked again when the sweeps have come this far; things change around here.
                        least = least.min(4.0 * tau + 1e-20);
                    }
                }
            }
        }
        self.store.bound[u.index()] = least;
    }

    /// Collapses still to be done for the goal; `None` if there is no end to it.
    fn needed(&self, goal: &Goal) -> Option<usize> {
        let faces = goal.faces.map(|n| self.store.live_faces.saturating_sub(n).div_ceil(2));
        let vertices = goal.vertices.map(|n| self.store.live_vertices.saturating_sub(n));
        match (faces, vertices) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    /// Sweeps until the goal is met, nothing can go any more, or the caller ends it. The store is compact afterwards.
    pub(crate) fn sweep(&mut self, goal: &Goal, original: &dyn Original, control: &mut dyn Control) -> End {
        let extreme = goal.faces.is_some_and(|n| late::is_extreme(n, self.store.live_faces));
        let begun_with = self.needed(goal).unwrap_or(self.store.live_faces / 2).max(1);
        let start_faces = self.store.live_faces;
        let mut scratch = Scratch::default();
        self.area = (self.total_area / self.store.live_faces.max(1) as f64) as f32;
        let first = self.first_bounds();
        let mut tau = self.threshold(&Histogram::of(&first), first.len(), goal);
        let mut end = End::Stuck;
        let (mut probe, mut probed) = (false, false);
        'sweeps: for number in 0..MOST_SWEEPS {
            self.area = (self.total_area / self.store.live_faces.max(1) as f64) as f32;
            let before = self.collapses;
            let goal_faces = goal.faces.unwrap_or(0);
            let goal_vertices = goal.vertices.unwrap_or(0);
            for i in 0..self.store.v.len() {
                if i % ASK_EVERY == 0 {
                    let done = match self.needed(goal) {
                        Some(n) => 1.0 - n as f64 / begun_with as f64,
                        None => 1.0 - self.store.live_faces as f64 / start_faces.max(1) as f64,
                    };
                    match control.progress(done.clamp(0.0, 1.0)) {
                        Verdict::Continue => {}
                        Verdict::Finish => {
                            end = End::Finish;
                            break 'sweeps;
                        }
                        Verdict::Cancel => return End::Cancel,
                    }
                }
                if self.store.bound[i] <= tau || probe {
                    if self.store.live_faces <= goal_faces || self.store.live_vertices <= goal_vertices {
                        break;
                    }
                    if !self.store.v[i].kind.is_gone() {
                        self.visit(
                            VertexId(i as u32),
                            if probe { f32::MAX } else { tau },
                            probe,
                            &mut scratch,
                        );
                        if self.store.is_full() {
                            break;
                        }
                    }
                }
            }
            if self.needed(goal) == Some(0) {
                end = End::Goal;
                break;
            }
            let idle = self.collapses == before;
            if self.store.wants_compaction() || self.store.is_full() {
                self.store.compact();
            }
            if extreme && self.late.is_none() && self.store.live_faces < late::BEGIN {
                original.with(&mut |points, faces| self.begin_late(points, faces));
            }
            let histogram = Histogram::of(&self.store.bound);
            if histogram.known() == 0 {
                if probed {
                    if self.remove_parts(goal) {
                        end = End::Goal;
                    }
                    break;
                }
                (probe, probed) = (true, true);
                continue;
            }
            if idle && !probe {
                // Nothing could go: find out what is possible at all, and at what cost.
                (probe, probed) = (true, true);
                continue;
            }
            (probe, probed) = (false, probe);
            let next = self.threshold(&histogram, self.store.v.len(), goal);
            tau = if next <= tau && number % 8 == 7 { tau * 1.02 } else { next };
        }
        self.store.compact();
        end
    }

    /// The RMS distance that the costs paid amount to, in the unit frame: a collapse that lifts the tip of a star by h
    /// over triangles of area A adds A h² / 6 to the integral of the squared distance, and costs 2 A h².
    pub(crate) fn estimate(&self) -> f64 {
        (self.spent / 6.0 / self.total_area.max(f64::MIN_POSITIVE)).sqrt()
    }
}

/// What a visit works with; made once.
#[derive(Default)]
struct Scratch {
    ru: Ring,
    rv: Ring,
    found: Vec<Candidate>,
}
