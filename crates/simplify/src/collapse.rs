//! The edge collapse engine.
//!
//! ```text
//! order the input along a Morton curve                     (order)
//! give each vertex its tensor and its kind                 (kind, metric)
//! loop                                                     (sweeps, this file)
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

pub(crate) mod attributes;
mod bound;
mod bundle;
mod check;
mod commit;
pub(crate) mod creases;
pub(crate) mod cut;
mod details;
mod edge_neighbourhood;
mod evaluate;
mod hub_budget;
pub(crate) mod kind;
mod link_condition;
mod locks;
mod marks;
mod merge;
mod near;
pub(crate) mod order;
pub(crate) mod pairs;
pub(crate) mod parts;
pub(crate) mod record;
mod resume;
mod sampled_error;
mod seams;
pub(crate) mod snapshot;
mod star;
pub(crate) mod store;
mod stuck;
mod sweeps;
mod wedges;
mod wings;

use glam::Vec3;
use lodsmith_core::VertexId;
use prefetch_index::prefetch_index;
use wide::f32x4;

use crate::guard::Rules;
use crate::lanes::{self, cross, dot, sub};
use crate::metric::{CostSource, EdgeNeighbourhood, Metric};
use crate::options::Placement;
use crate::report::Refusal;
use crate::tensor::Tensor;
use attributes::{Attributes, Member};
use bound::UNKNOWN;
use check::Checks;
use commit::{Attempt, Candidate, CollapseOutcome};
use details::Details;
use evaluate::{Found, OwnedEdges};
use hub_budget::HubBudget;
use kind::Kind;
use marks::Marks;
use merge::Merge;
use pairs::Pairs;
use parts::Parts;
use record::Record;
use sampled_error::{LateScratch, SampledError};
use seams::{Edge, Looseness};
use store::{Ends, Normals, Ring, Store, Vertex};
pub(crate) use sweeps::{Pause, Sweeps};
pub(crate) use wedges::Wedges;
use wings::Wings;

/// Vertices from which it pays to ask the memory for those ahead: fewer fit into the caches. (Measured.)
const PREFETCH_MIN_VERTICES: usize = 32_768;
/// How many times four faces ahead their vertices are asked for, where all are walked. (Guessed.)
const PREFETCH_FOURS_AHEAD: usize = 4;

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
pub(crate) enum StopReason {
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
pub(crate) type InputVisitor<'a> = dyn FnMut(&[Vec3], &[[VertexId; 3]]) + 'a;

/// What the late phase and the fit look back on: the ordered input, kept or made again.
pub(crate) trait InputSurface {
    /// Calls back with the positions in the unit frame and the faces.
    fn with(&self, look: &mut InputVisitor<'_>);
}

/// The engine: a mesh, what was done to it, and buffers. Nothing is shared, so two engines can run side by side.
#[derive(Clone)]
pub(crate) struct Engine<M: Metric> {
    pub(crate) mesh: LiveMesh<M>,
    /// Log of all changes, for progressive meshes.
    pub(crate) record: Option<Box<Record>>,
    pub(crate) tally: Tally,
    scratch: Scratch,
    /// State of the checks that walk every invariant after each sweep (debug builds).
    pub(crate) checks: Option<Checks>,
}

/// The mesh that is being collapsed, with all that collapses are judged by. What only looks at it takes `&self`.
#[derive(Clone)]
pub(crate) struct LiveMesh<M: Metric> {
    pub(crate) store: Store<M::Memory>,
    pub(crate) cost: Cost<M>,
    pub(crate) constraints: CollapseRules,
    pub(crate) values: WedgeValues,
    /// Samples of the input at the vertices, in the last phase of a run to few faces.
    sampled: Option<SampledError>,
    pub(crate) topology: Topology,
}

/// The metric, and what costs are measured by.
#[derive(Clone)]
pub(crate) struct Cost<M: Metric> {
    pub(crate) metric: M,
    /// Mean of twice the area of a live face.
    area: f32,
    /// Twice the area of the input.
    total_area: f64,
    /// Mean of twice the area of a face of the input, for metrics that measure by it.
    mean_face: f32,
    /// The part of each vertex' memory that is of lines, by number in the ordered input: with pairs and a metric with
    /// memory; else empty.
    lines: Vec<M::Memory>,
}

/// What a collapse must not do, and what it counts where.
#[derive(Clone)]
pub(crate) struct CollapseRules {
    rules: Rules,
    /// Which feature lines have given way.
    looseness: Looseness,
    /// Factors of the cost at vertices, by number in the ordered input; `None` if all are 1.
    prices: Option<Vec<f32>>,
    /// Small parts that keep their area because they stand out.
    details: Option<Box<Details>>,
    /// True if a collapse that would pinch the surface may cut it there instead.
    pub(crate) cuts_necks: bool,
    /// True if whole parts stay even when nothing else can go.
    pub(crate) keeps_parts: bool,
}

/// Values that stand on the wedges.
#[derive(Clone)]
pub(crate) struct WedgeValues {
    /// Values that collapses blend.
    pub(crate) attributes: Option<Attributes>,
    /// Values that collapses onto endpoints match instead of blending.
    wedge_data: Option<Wedges>,
}

/// Parts and pairs: what changes the topology besides edge collapses.
#[derive(Clone, Default)]
pub(crate) struct Topology {
    /// The parts, where they go in the order of costs.
    parts: Option<Parts>,
    /// Pairs of vertices that share no edge and are merged too.
    pub(crate) pairs: Option<Pairs>,
}

/// Counts and sums of a run.
#[derive(Clone, Default)]
pub(crate) struct Tally {
    /// Collapses that were refused, by reason.
    pub(crate) refusals: [u64; Refusal::ALL.len()],
    pub(crate) collapses: u64,
    /// Faces of rings that were looked at, each as often as it was.
    pub(crate) faces_visited: u64,
    pub(crate) parts_removed: usize,
    pub(crate) necks_cut: usize,
    pub(crate) pairs_contracted: usize,
    /// Sum of the costs paid: twice an area times a squared distance.
    spent: f64,
    /// Sum of the costs of parts that went, in the same measure.
    lost: f64,
    /// The highest threshold of a sweep that collapsed anything.
    highest_threshold: f32,
    /// True if a sweep collapsed anything after sweeps were no longer at ease.
    is_strained: bool,
    /// Faces that the first sweep begins with.
    first_faces: usize,
    /// What is left of the budget of work at vertices of many faces.
    hub_budget: HubBudget,
}

impl Tally {
    /// Refusals of all reasons.
    fn refused(&self) -> u64 {
        self.refusals.iter().sum()
    }

    fn refuse(&mut self, why: Refusal) {
        self.refusals[why as usize] += 1;
    }
}

/// Buffers of one look at an edge, used again and again.
#[derive(Clone, Default)]
struct Scratch {
    wings: Wings,
    /// Spokes of the removed end that stay.
    spokes: Ring,
    neighbourhood: EdgeNeighbourhood,
    other_ring: Ring,
    merge: Merge,
    /// Feature edges around the edge that goes: the far end, whether it hangs on the kept end, and the weight of the line.
    rim: Vec<(VertexId, bool, f32)>,
    /// Edges of the star that is looked at.
    edges: Vec<Edge>,
    late: LateScratch,
    marks: Marks,
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
        let mesh = LiveMesh {
            store,
            cost: Cost { metric, area: 0.0, total_area: 0.0, mean_face: 1.0, lines: Vec::new() },
            constraints: CollapseRules {
                rules,
                looseness: Looseness::None,
                prices: None,
                details: None,
                cuts_necks: false,
                keeps_parts: false,
            },
            values: WedgeValues { attributes, wedge_data },
            sampled: None,
            topology: Topology::default(),
        };
        let (record, tally, scratch) = (None, Tally::default(), Scratch::default());
        let mut engine = Self { mesh, record, tally, scratch, checks: None };
        if cfg!(debug_assertions) && engine.mesh.store.t.len() < check::CHECKED_BELOW {
            engine.checks = Some(Checks::default());
        }
        let ends = engine.mesh.init_quadrics();
        let (mut special, duplicates) = engine.mesh.classify(ends);
        if duplicates > 0 {
            engine.mesh.store.compact();
            engine.mesh.store.reset_quadrics();
            for x in &mut engine.mesh.store.v {
                x.kind = Kind::default().locked(x.kind.is_locked());
            }
            let ends = engine.mesh.init_quadrics();
            (special, _) = engine.mesh.classify(ends);
        }
        engine.tally.hub_budget = HubBudget::of(engine.mesh.store.live_faces);
        engine.mesh.leave_out_unused(&special);
        engine.mesh.weigh_attributes();
        engine.mesh.init_lines(special);
        engine.tally.first_faces = engine.mesh.store.live_faces;
        (engine, duplicates)
    }
}

impl<M: Metric> LiveMesh<M> {
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
            let kind = Kind::of(&ring, self.constraints.rules.border);
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
    fn init_quadrics(&mut self) -> Ends {
        if matches!(self.cost.metric.cost_source(), CostSource::FormThenStars) {
            self.cost.mean_face = self.mean_face();
        }
        let mut normals = Normals::zero(self.store.v.len());
        let Store { v, t, .. } = &mut self.store;
        let (v, sums) = (&mut v[..], normals.of_each());
        let mut total_area = 0.0;
        let brings = v.len() >= PREFETCH_MIN_VERTICES;
        let (fours, rest) = t.as_chunks::<4>();
        let last = rest.last().map(|last| ([0, 1, 2, 3].map(|i| *rest.get(i).unwrap_or(last)), rest.len()));
        for (i, (faces, count)) in fours.iter().map(|four| (*four, 4)).chain(last).enumerate() {
            if let (true, Some(ahead)) = (brings, fours.get(i + PREFETCH_FOURS_AHEAD)) {
                ahead.as_flattened().iter().for_each(|w| prefetch_index(&*v, w.index()));
            }
            let lengths = add_face_quadrics(&self.cost.metric, self.cost.mean_face, (faces, count), v, sums);
            lengths[..count].iter().for_each(|&length| total_area += f64::from(length));
        }
        self.cost.total_area = total_area;
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
    fn init_lines(&mut self, among: impl IntoIterator<Item = VertexId>) {
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
                sum.add(&self.cost.metric.line(
                    self.store.p(edge.to) - self.store.p(u),
                    weight,
                    self.cost.mean_face,
                ));
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
            Kind::of(ring, self.constraints.rules.border).moved(old.is_moved()).locked(old.is_locked()),
            u,
            ring,
            &mut Vec::new(),
        )
    }

    /// Kind and, where the metric is memoryless, tensor of a vertex afresh from its star.
    fn refresh(&mut self, u: VertexId, ring: &mut Ring) {
        self.store.ring(u, ring);
        self.store.v[u.index()].kind = self.kind_now(u, ring);
        if self.cost.metric.is_memoryless() {
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
            let weight = self.cost.metric.plane_weight(normal.length(), self.cost.mean_face);
            sum.add(&Tensor::outer(normal, weight));
        }
        sum.add(&self.attribute_tensor(u, ring));
        sum
    }

    /// Whether there may be seams or sharp edges.
    fn has_seams(&self) -> bool {
        self.values.attributes.is_some() || self.store.regions.is_some() || self.store.creases.is_some()
    }

    /// Whether any attribute counts in the cost.
    fn counts_attributes(&self) -> bool {
        self.values.attributes.as_ref().is_some_and(Attributes::counts)
    }
}

impl<M: Metric> Engine<M> {
    /// Evaluates all edges that `u` owns; leaves its ring.
    #[inline(never)]
    fn evaluate_at_any_cost(&mut self, u: VertexId, scratch: &mut VisitScratch) {
        let VisitScratch { ru, owned, found, members, .. } = scratch;
        self.mesh.store.ring(u, ru);
        let Self { mesh, scratch, tally, .. } = self;
        mesh.store.list_owned(u, ru, owned, &mut scratch.marks);
        found.clear();
        let are_lone = mesh.know_wedges(u, owned);
        let edges = OwnedEdges { u, owned, ring: ru, most: f32::INFINITY, are_lone };
        mesh.evaluate_owned(&edges, members, found, scratch, tally);
    }

    /// Evaluates the edges that u owns, collapses the cheapest that costs at most tau and can, renews `bound[u]`.
    fn visit(&mut self, u: VertexId, tau: f32, probe: bool, scratch: &mut VisitScratch) {
        let VisitScratch { ru, rv, owned, found, members } = scratch;
        self.mesh.store.ring(u, ru);
        found.clear();
        self.tally.faces_visited += ru.len() as u64;
        let owned = if self.mesh.store.v[u.index()].kind.is_regular() {
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
            self.mesh.store.list_owned(u, ru, owned, &mut self.scratch.marks);
            &owned[..]
        };
        let Self { mesh, scratch, tally, .. } = self;
        let are_lone = mesh.know_wedges(u, owned);
        let edges = OwnedEdges { u, owned, ring: ru, most: tau, are_lone };
        let stuck = mesh.evaluate_owned(&edges, members, found, scratch, tally);
        let mut least = found.beyond();
        let kind = self.mesh.store.v[u.index()].kind;
        let why = match () {
            () if kind.is_locked() => Refusal::Locked,
            () if kind.is_border() => Refusal::Border,
            () => Refusal::NonManifold,
        };
        self.tally.refusals[why as usize] += stuck;
        while let Some(candidate) = found.take_cheapest() {
            // A vertex that was not looked at yet owns edges of unknown cost; they are looked at in the next sweep.
            let inherited = match self.mesh.store.bound[candidate.removed.index()] {
                UNKNOWN => tau,
                bound => bound,
            };
            if !self.tally.hub_budget.admit(ru.len() + self.mesh.store.listed(candidate.removed).len()) {
                self.tally.refuse(Refusal::Valence);
                if !probe {
                    least = least.min(4.0 * tau + 1e-20);
                }
                if HubBudget::is_hub(ru.len()) {
                    // So have all others.
                    break;
                }
                continue;
            }
            self.mesh.store.ring(candidate.removed, rv);
            match self.collapse(&Attempt {
                kept: u,
                candidate: &candidate,
                tau,
                is_probe: probe,
                rings: [&*ru, &*rv],
            }) {
                CollapseOutcome::Done => {
                    least = found.within.iter().fold(least.min(inherited), |l, f| l.min(f.cost));
                    break;
                }
                CollapseOutcome::Later(cost) => least = least.min(cost),
                CollapseOutcome::Refused(why) => {
                    self.tally.refuse(why);
                    if let Some(other) = self.mesh.candidate_at_end(u, &candidate, why, tau, ru, members) {
                        found.within.push(other);
                    } else if !probe {
                        // Asked again when the sweeps have come this far; things change around here.
                        least = least.min(4.0 * tau + 1e-20);
                    }
                }
            }
        }
        self.mesh.store.bound[u.index()] = least;
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Where faces would turn or vanish at the best place, one of the ends may do, the kept one first, if it does
    /// not cost too much.
    fn candidate_at_end(
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
        let is_open = self.constraints.rules.placement == Placement::Optimal
            && !self.cost.metric.cost_source().is_metric();
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

    /// Twice the area of the present input, in the unit frame; above 0.
    pub(crate) fn area_of_input(&self) -> f64 {
        self.cost.total_area.max(f64::MIN_POSITIVE)
    }

    /// Lets seams give way at once, at what their lines and attributes cost, instead of when nothing else is left.
    pub(crate) fn loosen_seams(&mut self) {
        if self.values.attributes.is_some() {
            self.constraints.looseness = Looseness::Seams;
        }
    }
}

impl<M: Metric> Engine<M> {
    /// Whether a sweep collapsed anything after sweeps were no longer at ease.
    pub(crate) fn is_strained(&self) -> bool {
        self.tally.is_strained
    }

    /// Whether a run that kept seams on their lines paid for it, and seams refused collapses.
    pub(crate) fn has_seams_in_the_way(&self) -> bool {
        self.tally.is_strained
            && !self.mesh.has_relaxed_seams()
            && self.tally.refusals[Refusal::Seam as usize] > 0
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Whether seams had to give way.
    pub(crate) fn has_relaxed_seams(&self) -> bool {
        matches!(self.constraints.looseness, Looseness::Seams | Looseness::Regions)
    }

    /// Whether sharp edges had to give way that the options make features of.
    pub(crate) fn has_relaxed_creases(&self) -> bool {
        self.store.creases.is_some() && self.constraints.looseness != Looseness::None
    }
}

impl<M: Metric> Engine<M> {
    /// The RMS distance of the result, in the unit frame: from that of the fit, or from the costs paid. A collapse that
    /// lifts the tip of a star by h over triangles of area A adds A h² / 6 to the integral of the squared distance, and
    /// costs 2 A h².
    pub(crate) fn estimate(&self, fitted: Option<f64>) -> f64 {
        let area = self.mesh.cost.total_area.max(f64::MIN_POSITIVE);
        let kept =
            fitted.map_or(self.mesh.cost.metric.kept_loss() * self.tally.spent / 6.0 / area, |rms| rms * rms);
        // Not all of a part is as far from the rest as it is large: a quarter, in squares. (Guessed.)
        (kept + 0.25 * self.tally.lost / area).sqrt()
    }
}

/// Adds the planes of the first `count` of four faces to the tensors and the normals of their corners, and counts these.
/// Returns twice the areas.
#[inline(always)]
fn add_face_quadrics<M: Metric>(
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

/// What a visit works with; made once.
#[derive(Default)]
struct VisitScratch {
    ru: Ring,
    rv: Ring,
    owned: Vec<VertexId>,
    found: Found,
    members: Vec<Member>,
}
