//! The edge collapse engine.
//!
//! ```text
//! order the input along a Morton curve                     (order)
//! give each vertex its tensor and its kind                 (kind, metric)
//! loop                                                     (this file)
//!     tau = a quantile of the bounds                       (bound)
//!     contract pairs that cost at most tau, where wanted   (pairs, near, bundle)
//!     for each vertex u with bound[u] <= tau, in order
//!         evaluate the edges that u owns
//!         the cheapest: link condition, guards, exact cost (link_condition, commit)
//!         done if it costs at most tau; bound[u] = what is left
//!     compact when much is dead                            (store)
//!     at extreme targets charge true distances             (late)
//!     when nothing can go any more, whole parts may        (parts)
//! where the topology may change, necks are cut instead of pinched, and parts go in the order of costs (cut, parts)
//! ```
//!
//! There is no queue, and nothing is re-evaluated for a collapse: an edge belongs to its lower end, `bound[u]` is the
//! least cost last seen at u, and a stale bound only delays or hastens a collapse by a sweep. Exact order buys nothing:
//! the expected quality is that of a global queue [Wu-Kobbelt 2002], at a fraction of its time.

mod again;
mod around;
pub(crate) mod attributes;
mod bound;
mod bundle;
mod check;
mod commit;
pub(crate) mod creases;
mod crowds;
pub(crate) mod cut;
mod evaluate;
pub(crate) mod fork;
pub(crate) mod kind;
mod late;
mod link_condition;
mod lock;
mod merge;
mod near;
pub(crate) mod order;
pub(crate) mod pairs;
mod parts;
pub(crate) mod record;
mod seams;
mod star;
pub(crate) mod store;
mod stuck;
mod wedges;
mod wings;

use glam::Vec3;
use lodsmith_core::VertexId;
use prefetch_index::prefetch_index;
use wide::{f32x4, f32x8};

use crate::control::{Control, Verdict};
use crate::guard::Rules;
use crate::lanes::{self, cross, dot, sub};
use crate::metric::{Around, Judge, Metric};
use crate::options::Placement;
use crate::report::Refusal;
use crate::tensor::Tensor;
use attributes::{Attributes, Member};
use bound::Histogram;
use check::Checks;
pub(crate) use commit::TIE;
use commit::{Candidate, Outcome};
use crowds::Crowds;
use evaluate::Found;
use kind::Kind;
use late::Late;
use merge::Merge;
use pairs::Pairs;
use parts::Parts;
use record::Record;
use seams::{Edge, Looseness};
use store::{Ends, Normals, Ring, Store, Vertex};
pub(crate) use wedges::Wedges;
use wings::Wings;

/// Share of the bounds that one sweep takes. (.4 and .7 give equal errors, .7 fewer sweeps: docs/decisions/0002.)
const QUANTILE: f64 = 0.7;
/// Share of what is left that the last sweeps take, at most.
const LAST_SHARE: f64 = 0.85;
/// How much more than was foreseen a sweep may take, where it must not meet a goal. (Guessed.)
const AHEAD: f64 = 1.2;
/// The same for copies of which no more is asked than that the goal has had no say yet.
const JUST_AHEAD: f64 = 1.01;
/// The bound of a vertex that was not looked at yet: below every threshold.
const UNKNOWN: f32 = 0.0;
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
/// Vertices from which it pays to ask the memory for those ahead: fewer fit into the caches. (Measured.)
const BRINGS_FROM: usize = 32_768;
/// How many times four faces ahead their vertices are asked for, where all are walked. (Guessed.)
const FOURS_AHEAD: usize = 4;
/// Vertices between two questions to the caller.
const ASK_EVERY: usize = 4096;

/// When the engine stops: at this many faces or vertices, whichever is met first; `None` is never.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Goal {
    pub(crate) faces: Option<usize>,
    pub(crate) vertices: Option<usize>,
}

impl Goal {
    /// Whether no number ends the run.
    pub(crate) fn is_none(&self) -> bool {
        self.faces.is_none() && self.vertices.is_none()
    }
}

/// Why the engine stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// The goal is met.
    Goal,
    /// Nothing is left that may go.
    Stuck,
    /// The method has done all that it does: of sweeps, where costs have a limit.
    Exhausted,
    /// The caller wants the best so far.
    Finish,
    /// The caller wants nothing.
    Cancel,
}

/// Who looks at positions and faces.
pub(crate) type Look<'a> = dyn FnMut(&[Vec3], &[[VertexId; 3]]) + 'a;

/// What the late phase and the fit look back on: the ordered input, kept or made again.
pub(crate) trait Original {
    /// Calls back with the positions in the unit frame and the faces.
    fn with(&self, look: &mut Look<'_>);
}

#[derive(Clone)]
pub(crate) struct Engine<M: Metric> {
    pub(crate) metric: M,
    pub(crate) store: Store<M::Memory>,
    rules: Rules,
    /// Mean over the live triangles, as the tensors count it.
    area: f32,
    total_area: f64,
    /// Faces that the first sweep begins with.
    first_faces: usize,
    /// The same over the input, for metrics that measure by it.
    mean_face: f32,
    late: Option<Late>,
    /// The parts, where they go in the order of costs.
    parts: Option<Parts>,
    wedge_data: Option<Wedges>,
    pub(crate) attributes: Option<Attributes>,
    /// What costs count times, by number in the ordered input, where that differs.
    prices: Option<Vec<f32>>,
    pub(crate) refusals: [u64; Refusal::ALL.len()],
    pub(crate) collapses: u64,
    /// What may still be looked at round vertices of many faces.
    crowds: Crowds,
    /// Faces of rings that were looked at, each as often as it was.
    pub(crate) faces_visited: u64,
    pub(crate) parts_removed: usize,
    /// Whether a collapse that would pinch the surface may cut it there instead.
    pub(crate) cuts_necks: bool,
    pub(crate) necks_cut: usize,
    /// Where vertices that share no edge are contracted too.
    pub(crate) pairs: Option<Pairs>,
    pub(crate) pairs_contracted: usize,
    /// Whether whole parts stay, even when nothing else can go.
    pub(crate) keeps_parts: bool,
    /// What is done, so that it can be taken back.
    pub(crate) record: Option<Box<Record>>,
    /// With pairs and a metric with memory: the part of it that is of lines, by number in the ordered input; else empty.
    lines: Vec<M::Memory>,
    /// Sum of the costs paid: twice an area times a squared distance.
    spent: f64,
    /// Sum of the costs of parts that went, in the same measure.
    lost: f64,
    /// The highest threshold of a sweep that collapsed anything.
    paid: f32,
    /// Whether a sweep collapsed anything after sweeps were no longer at ease.
    is_strained: bool,
    wings: Wings,
    /// Of the removed end, those that stay.
    spokes: Ring,
    around: Around,
    other_ring: Ring,
    looseness: Looseness,
    merge: Merge,
    /// Ends of lines around the edge that goes: whether at the kept end, and the line's weight.
    rim: Vec<(VertexId, bool, f32)>,
    /// Edges of the star that is looked at.
    edges: Vec<Edge>,
    /// What checks remember, where every invariant is walked after each sweep.
    pub(crate) checks: Option<Checks>,
}

impl<M: Metric> Engine<M> {
    /// Takes a store and fills its tensors and kinds. Says how many faces stood twice with the same winding; they are
    /// gone afterwards.
    pub(crate) fn new(
        metric: M,
        store: Store<M::Memory>,
        rules: Rules,
        wedge_data: Option<Wedges>,
        attributes: Option<Attributes>,
    ) -> (Self, usize) {
        let mut engine = Self {
            metric,
            store,
            rules,
            area: 0.0,
            total_area: 0.0,
            first_faces: 0,
            mean_face: 1.0,
            late: None,
            parts: None,
            wedge_data,
            attributes,
            prices: None,
            refusals: [0; Refusal::ALL.len()],
            collapses: 0,
            crowds: Crowds::default(),
            faces_visited: 0,
            parts_removed: 0,
            cuts_necks: false,
            necks_cut: 0,
            pairs: None,
            pairs_contracted: 0,
            keeps_parts: false,
            record: None,
            lines: Vec::new(),
            spent: 0.0,
            lost: 0.0,
            paid: 0.0,
            is_strained: false,
            wings: Wings::default(),
            spokes: Ring::default(),
            around: Around::default(),
            other_ring: Ring::default(),
            looseness: Looseness::None,
            merge: Merge::default(),
            rim: Vec::new(),
            edges: Vec::new(),
            checks: None,
        };
        if cfg!(debug_assertions) && engine.store.t.len() < check::CHECKED_BELOW {
            engine.checks = Some(Checks::default());
        }
        let ends = engine.weigh();
        let (mut special, duplicates) = engine.classify(ends);
        if duplicates > 0 {
            engine.store.compact();
            engine.store.unweigh();
            for x in &mut engine.store.v {
                x.kind = Kind::default().locked(x.kind.is_locked());
            }
            let ends = engine.weigh();
            (special, _) = engine.classify(ends);
        }
        engine.crowds = Crowds::of(engine.store.live_faces);
        engine.leave_out_unused(&special);
        engine.weigh_attributes();
        engine.weigh_lines(special);
        engine.first_faces = engine.store.live_faces;
        (engine, duplicates)
    }

    /// Kinds of all vertices, where none but locks is known, right after the corner lists were filled up to these ends;
    /// drops faces that stand twice. Says which vertices may be more than one inside a closed fan, and how many faces are
    /// gone.
    fn classify(&mut self, ends: Ends) -> (Vec<VertexId>, usize) {
        self.chain_wedges();
        let (mut ring, mut edges, mut duplicates) = (Ring::default(), Vec::new(), Vec::new());
        let (mut special, mut by_ends) = (Vec::new(), Vec::new());
        let has_seams = self.has_seams();
        for (is_closed, u) in self.store.closed_fans(ends).into_iter().zip((0..).map(VertexId)) {
            // (Most of the vertices of most meshes, without a ring. All that is listed lives still.)
            if is_closed
                && (!has_seams || self.is_inside_one_chart(u, self.store.others(u).map(|others| others.0)))
            {
                continue;
            }
            special.push(u);
            self.store.ring(u, &mut ring);
            let kind = Kind::of(&ring, self.rules.border);
            if !kind.is_regular() {
                by_ends.clear();
                by_ends.extend(ring.iter().enumerate().map(|(i, r)| (r.a, r.b, i)));
                by_ends.sort_unstable();
                let twice = by_ends.windows(2).filter(|w| (w[0].0, w[0].1) == (w[1].0, w[1].1));
                duplicates.extend(twice.map(|w| ring[w[1].2].corner.face()));
            }
            let is_locked = self.store.v[u.index()].kind.is_locked();
            let kind = self.with_seams(kind, u, &ring, &mut edges).locked(is_locked);
            self.store.v[u.index()].kind = kind;
            if kind.is_seam() {
                self.mark_hard_seams(u, &edges);
            }
        }
        duplicates.sort_unstable();
        duplicates.dedup();
        for &face in &duplicates {
            self.store.t[face][0] = order::NONE;
        }
        (special, duplicates.len())
    }

    /// Vertices that no face has, which are among these, do not count.
    fn leave_out_unused(&mut self, among: &[VertexId]) {
        for &u in among {
            if self.store.listed(u).is_empty() {
                let x = &mut self.store.v[u.index()];
                x.kind = x.kind.gone();
                self.store.bound[u.index()] = f32::INFINITY;
                self.store.live_vertices -= 1;
            }
        }
    }

    /// Facings of all vertices, tensors of the planes around them, and their corner lists, where none of them was weighed
    /// yet. Says where the lists end.
    fn weigh(&mut self) -> Ends {
        if matches!(self.metric.decides(), Judge::FormThenStars) {
            self.mean_face = self.mean_face();
        }
        let mut normals = Normals::zero(self.store.v.len());
        let Store { v, t, .. } = &mut self.store;
        let (v, sums) = (&mut v[..], normals.of_each());
        let mut total_area = 0.0;
        let brings = v.len() >= BRINGS_FROM;
        let (fours, rest) = t.as_chunks::<4>();
        let last = rest.last().map(|last| ([0, 1, 2, 3].map(|i| *rest.get(i).unwrap_or(last)), rest.len()));
        for (i, (faces, count)) in fours.iter().map(|four| (*four, 4)).chain(last).enumerate() {
            if let (true, Some(ahead)) = (brings, fours.get(i + FOURS_AHEAD)) {
                ahead.as_flattened().iter().for_each(|w| prefetch_index(&*v, w.index()));
            }
            let lengths = weigh_faces(&self.metric, self.mean_face, (faces, count), v, sums);
            lengths[..count].iter().for_each(|&length| total_area += f64::from(length));
        }
        self.total_area = total_area;
        self.store.link_counted(normals)
    }

    /// Twice the area of a face, on average; above 0.
    fn mean_face(&self) -> f32 {
        let doubled = |t: &[VertexId; 3]| {
            let [a, b, c] = t.map(|w| self.store.p(w));
            f64::from((b - a).cross(c - a).length())
        };
        let sum: f64 = self.store.t.iter().map(doubled).sum();
        (sum / self.store.t.len().max(1) as f64).max(1e-30) as f32
    }

    /// Lines of all feature edges, whose ends are among these.
    fn weigh_lines(&mut self, among: impl IntoIterator<Item = VertexId>) {
        if !self.has_lines() {
            return;
        }
        let (mut ring, mut edges) = (Ring::default(), Vec::new());
        for u in among {
            if self.store.v[u.index()].kind.has_lines() {
                self.store.ring(u, &mut ring);
                self.add_lines(u, &ring, &mut edges);
            }
        }
    }

    fn add_lines(&mut self, u: VertexId, ring: &Ring, edges: &mut Vec<Edge>) {
        let mut sum = *M::tensor_of(&self.store.v[u.index()].q);
        self.add_lines_to(&mut sum, u, ring, edges);
        *M::tensor(&mut self.store.v[u.index()].q) = sum;
    }

    /// Adds the lines of a star to a tensor.
    fn add_lines_to(&self, sum: &mut Tensor, u: VertexId, ring: &Ring, edges: &mut Vec<Edge>) {
        let kind = self.store.v[u.index()].kind;
        let seams = kind.is_seam();
        self.store.edges(ring, kind, edges);
        for edge in edges {
            let weight = self.weight_of(edge, seams);
            if weight > 0.0 {
                sum.add(&self.metric.line(self.store.p(edge.to) - self.store.p(u), weight, self.mean_face));
            }
        }
    }

    /// A kind with what the wedges and regions of the star add to it.
    fn with_seams(&self, kind: Kind, u: VertexId, ring: &Ring, edges: &mut Vec<Edge>) -> Kind {
        if !self.has_seams() || self.is_far_from_seams(ring, u) {
            return kind;
        }
        self.store.edges(ring, kind, edges);
        kind.on_seam(edges.iter().any(Edge::is_seam))
    }

    /// The kind of a vertex afresh from its star.
    fn kind_now(&self, u: VertexId, ring: &Ring) -> Kind {
        let old = self.store.v[u.index()].kind;
        self.with_seams(
            Kind::of(ring, self.rules.border).moved(old.is_moved()).locked(old.is_locked()),
            u,
            ring,
            &mut Vec::new(),
        )
    }

    /// Kind and, where the metric is memoryless, tensor of a vertex afresh from its star.
    fn refresh(&mut self, u: VertexId, ring: &mut Ring) {
        self.store.ring(u, ring);
        self.store.v[u.index()].kind = self.kind_now(u, ring);
        if self.metric.is_memoryless() {
            let mut q = M::Memory::default();
            *M::tensor(&mut q) = self.tensor_now(u, ring);
            self.store.v[u.index()].q = q;
        }
    }

    /// What the star of a vertex says where the metric is memoryless: planes, attributes and lines.
    fn tensor_now(&self, u: VertexId, ring: &Ring) -> Tensor {
        let mut sum = self.planes_now(u, ring);
        if self.has_lines() {
            self.add_lines_to(&mut sum, u, ring, &mut Vec::new());
        }
        sum
    }

    /// The same without lines.
    fn planes_now(&self, u: VertexId, ring: &Ring) -> Tensor {
        let (p, mut sum) = (self.store.p(u), Tensor::default());
        for r in ring.iter() {
            let normal = (self.store.p(r.a) - p).cross(self.store.p(r.b) - p);
            let weight = self.metric.plane_weight(normal.length(), self.mean_face);
            sum.add(&Tensor::outer(normal, weight));
        }
        sum.add(&self.attribute_tensor(u, ring));
        sum
    }

    /// Whether there may be seams or sharp edges.
    fn has_seams(&self) -> bool {
        self.attributes.is_some() || self.store.regions.is_some() || self.store.creases.is_some()
    }

    /// Whether any attribute counts in the cost.
    fn counts_attributes(&self) -> bool {
        self.attributes.as_ref().is_some_and(Attributes::counts)
    }

    fn refused(&self) -> u64 {
        self.refusals.iter().sum()
    }

    fn refuse(&mut self, why: Refusal) {
        self.refusals[why as usize] += 1;
    }

    /// The bounds of some vertices spread over the mesh, for the first threshold: the exact cost of the edge that looks
    /// cheapest, because an evaluation cannot tell flat from nearly flat. Of a small mesh, all.
    fn first_bounds(&mut self, scratch: &mut Scratch) -> Vec<f32> {
        let most = if self.counts_attributes() { FIRST_LOOK_AT_WEDGES } else { FIRST_LOOK };
        let count = self.store.v.len();
        let looks = if count <= most { most } else { (count / LOOK_SHARE).clamp(FEWEST_LOOKS, most) };
        let step = count.div_ceil(looks).max(1);
        let mut bounds = Vec::with_capacity(looks);
        for u in (0..count).step_by(step).map(|i| VertexId(i as u32)) {
            self.evaluate_at_any_cost(u, scratch);
            let Scratch { ru, rv, found, .. } = &mut *scratch;
            let best = found.take_cheapest();
            bounds.push(best.map_or(f32::INFINITY, |best| {
                if !self.crowds.admit(ru.len() + self.store.listed(best.removed).len()) {
                    return best.cost;
                }
                self.store.ring(best.removed, rv);
                match self.collapse(u, &best, f32::MAX, true, ru, rv) {
                    Outcome::Later(cost) => cost,
                    Outcome::Done | Outcome::Refused(_) => f32::INFINITY,
                }
            }));
        }
        bounds
    }

    /// Evaluates all edges that `u` owns; leaves its ring.
    #[inline(never)]
    fn evaluate_at_any_cost(&mut self, u: VertexId, scratch: &mut Scratch) {
        let Scratch { ru, owned, found, members, .. } = scratch;
        self.store.ring(u, ru);
        self.store.list_owned(u, ru, owned);
        found.clear();
        self.evaluate_owned(u, owned, ru, members, f32::INFINITY, found);
    }

    /// The threshold of the next sweep from the bounds, which may be those of some vertices only.
    fn threshold(&self, histogram: &Histogram, looked_at: usize, goal: &Goal) -> f32 {
        let quantile = match () {
            () if self.record.is_some() => record::QUANTILE,
            () if self.late.is_some() && !self.counts_attributes() => late::QUANTILE,
            () => QUANTILE,
        };
        let mut want = histogram.known() as f64 * quantile;
        if let Some(needed) = self.needed(goal) {
            // The last sweeps take only most of what is left, so that the cheapest go.
            let share = looked_at as f64 / self.store.v.len().max(1) as f64;
            want = want.min(needed as f64 * LAST_SHARE * share);
        }
        histogram.threshold((want as usize).max(1))
    }

    /// Evaluates the edges that u owns, collapses the cheapest that costs at most tau and can, renews `bound[u]`.
    fn visit(&mut self, u: VertexId, tau: f32, probe: bool, scratch: &mut Scratch) {
        let Scratch { ru, rv, owned, found, members } = scratch;
        self.store.ring(u, ru);
        found.clear();
        self.faces_visited += ru.len() as u64;
        let owned = if self.store.v[u.index()].kind.is_regular() {
            // Inside closed fans every neighbour comes first in one of the triangles: no need to look at the second.
            // (Written all, kept some: a branch on the order could not be foretold.)
            if owned.len() < ru.len() {
                owned.resize(ru.len(), u);
            }
            let (slots, mut n) = (&mut owned[..ru.len()], 0);
            for r in ru.iter() {
                slots[n] = r.a;
                n += usize::from(r.a > u);
            }
            &owned[..n]
        } else {
            self.store.list_owned(u, ru, owned);
            &owned[..]
        };
        let stuck = self.evaluate_owned(u, owned, ru, members, tau, found);
        let mut least = found.beyond();
        let kind = self.store.v[u.index()].kind;
        let why = match () {
            () if kind.is_locked() => Refusal::Locked,
            () if kind.is_border() => Refusal::Border,
            () => Refusal::NonManifold,
        };
        self.refusals[why as usize] += stuck;
        while let Some(candidate) = found.take_cheapest() {
            // A vertex that was not looked at yet owns edges of unknown cost; they are looked at in the next sweep.
            let inherited = match self.store.bound[candidate.removed.index()] {
                UNKNOWN => tau,
                bound => bound,
            };
            if !self.crowds.admit(ru.len() + self.store.listed(candidate.removed).len()) {
                self.refuse(Refusal::Valence);
                if !probe {
                    least = least.min(4.0 * tau + 1e-20);
                }
                if Crowds::is_crowd(ru.len()) {
                    // So have all others.
                    break;
                }
                continue;
            }
            self.store.ring(candidate.removed, rv);
            match self.collapse(u, &candidate, tau, probe, ru, rv) {
                Outcome::Done => {
                    least = found.within.iter().fold(least.min(inherited), |l, f| l.min(f.cost));
                    break;
                }
                Outcome::Later(cost) => least = least.min(cost),
                Outcome::Refused(why) => {
                    self.refuse(why);
                    if let Some(other) = self.at_an_end(u, &candidate, why, tau, ru, members) {
                        found.within.push(other);
                    } else if !probe {
                        // Asked again when the sweeps have come this far; things change around here.
                        least = least.min(4.0 * tau + 1e-20);
                    }
                }
            }
        }
        self.store.bound[u.index()] = least;
    }

    /// Where faces would turn or vanish at the best place, one of the ends may do, the kept one first, if it does
    /// not cost too much.
    fn at_an_end(
        &self,
        u: VertexId,
        refused: &Candidate,
        why: Refusal,
        tau: f32,
        ru: &Ring,
        members: &mut Vec<Member>,
    ) -> Option<Candidate> {
        let v = refused.removed;
        let (x, z) = (&self.store.v[u.index()], &self.store.v[v.index()]);
        let turned = matches!(why, Refusal::NormalFlip | Refusal::Quality);
        let is_open = self.rules.placement == Placement::Optimal && !self.metric.decides().is_metric();
        if !(turned && is_open && x.kind.is_free() && z.kind.is_free()) {
            return None;
        }
        let d = z.p - x.p;
        let step = match refused.step {
            step if step == d => return None,
            Vec3::ZERO => d,
            _ => Vec3::ZERO,
        };
        let cost = self.cost_at(u, v, step, ru, members);
        let other = Candidate { step, cost, removed: v, sure: 0.0 };
        (other.cost <= tau).then_some(other)
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

    /// How much of a run is done, from 0 to 1: of the collapses that it began with, or without a goal of the faces.
    fn done(&self, goal: &Goal, begun_with: usize, start_faces: usize) -> f64 {
        let done = match self.needed(goal) {
            Some(n) => 1.0 - n as f64 / begun_with as f64,
            None => 1.0 - self.store.live_faces as f64 / start_faces.max(1) as f64,
        };
        done.clamp(0.0, 1.0)
    }

    /// Sweeps until the goal is met, nothing can go any more, or the caller ends it. The store is finished afterwards.
    /// May be called again with a lower goal, after [`Engine::reopen`].
    pub(crate) fn sweep(&mut self, goal: &Goal, original: &dyn Original, control: &mut dyn Control) -> End {
        let mut sweeps = self.begin_sweeps(goal);
        let end = self.go_on(&mut sweeps, goal, Pause::Never, original, control).unwrap_or(End::Stuck);
        if end != End::Cancel {
            self.store.finish();
        }
        end
    }

    /// Looks around before the first sweep.
    pub(crate) fn begin_sweeps(&mut self, goal: &Goal) -> Sweeps {
        let mut scratch = Scratch::default();
        self.area = (self.total_area / self.store.live_faces.max(1) as f64) as f32;
        let first = self.first_bounds(&mut scratch);
        let begun_with = self.needed(goal).unwrap_or(self.store.live_faces / 2).max(1);
        Sweeps {
            next: Some((Histogram::of(&first), first.len())),
            begun_with,
            start_faces: self.store.live_faces,
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
        let (mut scratch, mut visits) = (Scratch::default(), Vec::new());
        'sweeps: for _ in 0..MOST_SWEEPS {
            self.check_if_asked(original);
            // Where sweeps go on to another goal, it is this one that says what comes after a sweep.
            if sweeps.swept && sweeps.next.is_some() {
                if self.store.wants_compaction(self.needed(goal)) {
                    self.store.compact();
                    sweeps.next = Some(self.bounds());
                }
                if self.is_late(extreme) {
                    original.with(&mut |points, faces| self.begin_late(points, faces));
                    sweeps.next = Some(self.bounds());
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
                    sweeps.lift = if self.collapses == sweeps.at_probe { sweeps.lift * 16.0 } else { 1.0 };
                    sweeps.at_probe = self.collapses;
                    next = (next * sweeps.lift).min(f32::MAX);
                    (sweeps.highest, sweeps.idle) = (next, 0);
                }
                // Bounds are stale, some by far: a sweep in vain is no reason to go back to lower ones.
                sweeps.tau = if sweeps.idle > 0 { next.max(sweeps.highest * 1.25) } else { next };
                sweeps.highest = sweeps.highest.max(sweeps.tau);
                (sweeps.probe, sweeps.probed) = (false, sweeps.probe);
                (sweeps.at_threshold, sweeps.wanted) = (self.collapses, self.wanted(goal));
            }
            let (tau, probe) = (sweeps.tau, sweeps.probe);
            self.area = (self.total_area / self.store.live_faces.max(1) as f64) as f32;
            let before = self.collapses;
            let refused = self.refused();
            let done = |engine: &Self| engine.done(goal, sweeps.begun_with, sweeps.start_faces);
            if self.pairs.is_some() {
                let mut ask = |engine: &Self| control.progress(done(engine));
                match self.contract_pairs(goal, tau, probe, &mut ask) {
                    Verdict::Continue => {}
                    Verdict::Finish => return Some(End::Finish),
                    Verdict::Cancel => return Some(End::Cancel),
                }
            }
            let goal_faces = goal.faces.unwrap_or(0);
            let goal_vertices = goal.vertices.unwrap_or(0);
            let count = self.store.v.len();
            let brings = count >= BRINGS_FROM;
            self.crowds.begin_sweep();
            'vertices: for start in (0..count).step_by(ASK_EVERY) {
                match control.progress(done(self)) {
                    Verdict::Continue => {}
                    Verdict::Finish => return Some(End::Finish),
                    Verdict::Cancel => return Some(End::Cancel),
                }
                let bounds = &self.store.bound[start..count.min(start + ASK_EVERY)];
                list_visits(bounds, start, tau, probe, &mut visits);
                for (at, &u) in visits.iter().enumerate() {
                    if brings {
                        self.store.bring(&visits, at);
                    }
                    if self.store.live_faces <= goal_faces || self.store.live_vertices <= goal_vertices {
                        break 'vertices;
                    }
                    if self.store.v[u.index()].kind.is_gone() {
                        continue;
                    }
                    self.visit(u, if probe { f32::MAX } else { tau }, probe, &mut scratch);
                    if self.store.is_full() {
                        // The rest of the sweep follows after a compaction, with the same threshold.
                        self.store.compact();
                        continue 'sweeps;
                    }
                }
            }
            if self.needed(goal) == Some(0) {
                return Some(End::Goal);
            }
            sweeps.swept = true;
            sweeps.idle = if self.collapses == before { sweeps.idle + 1 } else { 0 };
            if sweeps.idle == 0 {
                self.paid = self.paid.max(tau);
                self.is_strained |= !sweeps.is_at_ease;
            }
            if self.parts.is_some() && !probe {
                self.drop_cheap_parts(goal, tau);
                if self.needed(goal) == Some(0) {
                    return Some(End::Goal);
                }
            }
            if self.store.wants_compaction(self.needed(goal)) {
                self.store.compact();
            }
            if self.is_late(extreme) {
                if sweeps.idle < PATIENCE
                    && matches!(pause, Pause::BeforeNeed | Pause::BeforeEither)
                    && self.may_fork_late()
                {
                    let next = self.bounds();
                    if next.0.known() > 0 {
                        // It begins when they go on.
                        sweeps.next = Some(next);
                        return None;
                    }
                }
                original.with(&mut |points, faces| self.begin_late(points, faces));
            }
            let (histogram, looked_at) = self.bounds();
            if histogram.known() == 0 {
                if sweeps.probed && !probe && self.rules.max_cost.is_finite() {
                    // Collapses since the last probe may have made room for edges that it saw refused: probe again.
                    sweeps.probe = true;
                    continue;
                }
                if sweeps.probed && self.rules.max_cost.is_finite() {
                    // Nothing but what is refused stays below the limit.
                    return Some(if self.refused() == refused { End::Exhausted } else { End::Stuck });
                }
                let looser = self.looseness.looser(self.store.creases.is_some(), self.attributes.is_some());
                if let (true, Some(looser)) = (sweeps.probed, looser) {
                    // Better a seam out of place than a whole part gone.
                    self.looseness = looser;
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

    /// Whether a goal has a late phase.
    fn is_extreme(&self, goal: &Goal) -> bool {
        !self.metric.decides().is_metric()
            && goal.faces.is_some_and(|n| late::is_extreme(n, self.first_faces))
    }

    /// Whether the late phase is to begin.
    fn is_late(&self, extreme: bool) -> bool {
        let begin = match self.record {
            Some(_) => late::begin_of_record(self.first_faces),
            None => late::begin(self.first_faces, self.counts_attributes()),
        };
        extreme && self.late.is_none() && self.store.live_faces < begin
    }

    /// The bounds of all vertices, and of pairs.
    fn bounds(&self) -> (Histogram, usize) {
        let mut histogram = Histogram::of(&self.store.bound);
        if let Some(pairs) = &self.pairs {
            histogram.add(pairs.bounds());
        }
        (histogram, self.store.v.len())
    }

    /// Whether the next sweep would be cut short for the goal, or might meet it.
    fn is_last_stretch(&self, histogram: &Histogram, looked_at: usize, goal: &Goal, ahead: f64) -> bool {
        let share = looked_at as f64 / self.store.v.len().max(1) as f64;
        self.needed(goal)
            .is_some_and(|n| n as f64 * LAST_SHARE * share < ahead * QUANTILE * histogram.known() as f64)
    }

    /// Twice the area of the present input, in the unit frame; above 0.
    pub(crate) fn area_of_input(&self) -> f64 {
        self.total_area.max(f64::MIN_POSITIVE)
    }

    /// Lets seams give way at once, at what their lines and attributes cost, instead of when nothing else is left.
    pub(crate) fn loosen_seams(&mut self) {
        if self.attributes.is_some() {
            self.looseness = Looseness::Seams;
        }
    }

    /// Whether a run that kept seams on their lines paid for it, and seams refused collapses.
    pub(crate) fn has_seams_in_the_way(&self) -> bool {
        self.is_strained && !self.has_relaxed_seams() && self.refusals[Refusal::Seam as usize] > 0
    }

    /// Whether seams had to give way.
    pub(crate) fn has_relaxed_seams(&self) -> bool {
        matches!(self.looseness, Looseness::Seams | Looseness::Regions)
    }

    /// Whether sharp edges had to give way that the options make features of.
    pub(crate) fn has_relaxed_creases(&self) -> bool {
        self.store.creases.is_some() && self.looseness != Looseness::None
    }

    /// The RMS distance of the result, in the unit frame: from that of the fit, or from the costs paid. A collapse that
    /// lifts the tip of a star by h over triangles of area A adds A h² / 6 to the integral of the squared distance, and
    /// costs 2 A h².
    pub(crate) fn estimate(&self, fitted: Option<f64>) -> f64 {
        let area = self.total_area.max(f64::MIN_POSITIVE);
        let kept = fitted.map_or(self.metric.kept_loss() * self.spent / 6.0 / area, |rms| rms * rms);
        // Not all of a part is as far from the rest as it is large: a quarter, in squares. (Guessed.)
        (kept + 0.25 * self.lost / area).sqrt()
    }
}

/// Adds the planes of the first `count` of four faces to the tensors and the normals of their corners, and counts these.
/// Returns twice the areas.
#[inline(always)]
fn weigh_faces<M: Metric>(
    metric: &M,
    mean_face: f32,
    (faces, count): ([[VertexId; 3]; 4], usize),
    v: &mut [Vertex<M::Memory>],
    normals: &mut [f32x4],
) -> [f32; 4] {
    let normals = &mut normals[..v.len()];
    let [a, b, c] = [0, 1, 2].map(|k| store::four(v, faces.map(|t| t[k])));
    let normal = cross(&sub(&b, &a), &sub(&c, &a));
    let lengths = dot(&normal, &normal).sqrt();
    let weights = metric.plane_weights(lengths, mean_face);
    let planes = lanes::tensors(lanes::outer(&normal, weights));
    let rows = lanes::rows(&normal);
    for i in 0..4 {
        if i == count {
            break;
        }
        for w in faces[i] {
            let x = &mut v[w.index()];
            M::tensor(&mut x.q).add(&planes[i]);
            x.count_corner();
            normals[w.index()] += rows[i];
        }
    }
    lengths.to_array()
}

/// Where a run of sweeps stands.
#[derive(Clone)]
pub(crate) struct Sweeps {
    /// What the next threshold is found from, and how many vertices were looked at for it; none while one holds.
    next: Option<(Histogram, usize)>,
    begun_with: usize,
    start_faces: usize,
    swept: bool,
    tau: f32,
    highest: f32,
    /// Sweeps in vain.
    idle: usize,
    /// Whether the next sweep looks for what is possible at all, and whether the last one did.
    probe: bool,
    probed: bool,
    lift: f32,
    /// Collapses at the last probe.
    at_probe: u64,
    /// Collapses when the threshold was found.
    at_threshold: u64,
    /// Of how many vertices the sweeps with it were to look at the edges.
    wanted: f64,
    /// Whether each sweep so far did as much as where nothing stands in the way.
    is_at_ease: bool,
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

/// What a visit works with; made once.
#[derive(Default)]
struct Scratch {
    ru: Ring,
    rv: Ring,
    owned: Vec<VertexId>,
    found: Found,
    members: Vec<Member>,
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
