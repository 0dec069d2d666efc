//! The edge collapse engine.
//!
//! ```text
//! order the input along a Morton curve                     (order)
//! give each vertex its quadric and its kind                (kind, metric)
//! loop                                                     (sweeps, this file)
//!     tau = a quantile of the bounds                       (bound)
//!     contract pairs that cost at most tau, where wanted   (pairs, near, bundle)
//!     for each vertex u with bound[u] <= tau, in order
//!         evaluate the edges that u owns
//!         the cheapest: link condition, guards, exact cost (link_condition, commit)
//!         collapse it if it costs at most tau; bound[u] = least cost that remains
//!     compact when much is dead                            (store)
//!     at extreme targets add sampled costs                 (sampled_error)
//!     when no edge can be collapsed, remove whole parts    (parts)
//! where the topology may change, necks are cut instead of pinched, and parts are removed in order of cost (cut, parts)
//! ```
//!
//! There is no queue, and a collapse re-evaluates nothing: an edge belongs to its lower end, `bound[u]` is
//! the least cost last seen at u, and a stale bound only delays or hastens a collapse by a sweep. Exact
//! order gains nothing: the expected quality is that of a global queue [Wu-Kobbelt 2002], at a fraction of
//! its time.

pub(crate) mod attributes;
mod bound;
mod bundle;
mod candidate;
mod check;
mod commit;
pub(crate) mod components;
pub(crate) mod creases;
pub(crate) mod cut;
mod details;
mod edge_neighbourhood;
mod evaluate;
mod hand_over;
mod hub_budget;
mod invariants;
pub(crate) mod kind;
mod link_condition;
mod locks;
mod marks;
mod merge;
mod near;
pub(crate) mod order;
mod pair_list;
mod pairs;
mod parts;
pub(crate) mod record;
mod recording;
mod resume;
mod sampled_error;
mod samples;
mod seams;
pub(crate) mod snapshot;
mod star;
mod star_edges;
pub(crate) mod store;
mod stuck;
mod sweeps;
#[cfg(test)]
mod test_support;
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
use attributes::{Attributes, Member, Merge};
use bound::UNKNOWN;
use candidate::{Attempt, Candidate, CollapseOutcome, Found, OwnedEdges};
use components::{Details, Parts};
use hub_budget::HubBudget;
use invariants::Checks;
use kind::Kind;
use marks::Marks;
use pair_list::Pairs;
use record::Record;
use samples::{SampleScratch, SampledError};
use star_edges::{Edge, Looseness};
use store::{Ends, Normals, Ring, Store, Vertex};
pub(crate) use sweeps::{Pause, Sweeps};
pub(crate) use wedges::Wedges;
use wings::Wings;

/// Number of vertices from which prefetching pays: smaller meshes fit into the caches. (Measured.)
const PREFETCH_MIN_VERTICES: usize = 32_768;
/// Prefetch distance in loops over all faces, in groups of four faces. (Guessed.)
const PREFETCH_FOURS_AHEAD: usize = 4;

/// Stop condition of the engine: this many faces or vertices, whichever is met first; `None` is no limit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Goal {
    pub(crate) faces: Option<usize>,
    pub(crate) vertices: Option<usize>,
}

impl Goal {
    /// True if no number ends the run.
    pub(crate) fn is_none(&self) -> bool {
        self.faces.is_none() && self.vertices.is_none()
    }
}

/// Reason for which the engine stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopReason {
    /// The goal is reached.
    Goal,
    /// No collapse that is left is allowed.
    Stuck,
    /// No edge below the cost limit of the method is left.
    Exhausted,
    /// The caller wants the best result so far.
    Finish,
    /// The caller wants no result.
    Cancel,
}

/// Callback that receives positions and faces.
pub(crate) type InputVisitor<'a> = dyn FnMut(&[Vec3], &[[VertexId; 3]]) + 'a;

/// The ordered input, kept in memory or computed again, as the sampled error and the fit need it.
pub(crate) trait InputSurface {
    /// Calls `look` with the positions in the unit frame and the faces.
    fn visit(&self, look: &mut InputVisitor<'_>);
}

/// The engine: a mesh, the record of its changes, and buffers. Engines share nothing, so two can run side
/// by side.
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

/// The mesh that is being collapsed, with all data that collapses are evaluated with. Read-only steps take
/// `&self`.
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

/// The metric, and the reference sizes of costs.
#[derive(Clone)]
pub(crate) struct Cost<M: Metric> {
    pub(crate) metric: M,
    /// Mean of twice the area of a live face.
    area: f32,
    /// Twice the area of the input.
    total_area: f64,
    /// Mean of twice the area of a face of the input, for metrics that are relative to it.
    mean_face: f32,
    /// The part of each vertex' memory that comes from lines, by number in the ordered input: with pairs
    /// and a metric with memory; else empty.
    lines: Vec<M::Memory>,
}

/// Constraints on collapses and weights of costs.
#[derive(Clone)]
pub(crate) struct CollapseRules {
    rules: Rules,
    /// The feature lines that may be given up by now.
    looseness: Looseness,
    /// Factors of the cost at vertices (importance), by number in the ordered input; `None` if all are 1.
    cost_factors: Option<Vec<f32>>,
    /// Small parts that keep their area because they stand out.
    details: Option<Box<Details>>,
    /// True if a collapse that would pinch the surface may cut it there instead.
    pub(crate) cuts_necks: bool,
    /// True if whole parts stay even when no other collapse is possible.
    pub(crate) keeps_parts: bool,
}

/// Values of the wedges.
#[derive(Clone)]
pub(crate) struct WedgeValues {
    /// Values that are interpolated when vertices are merged.
    pub(crate) attributes: Option<Attributes>,
    /// Values that are matched instead of interpolated, for collapses onto endpoints.
    wedge_data: Option<Wedges>,
}

/// Parts and pairs: topology changes other than edge collapses.
#[derive(Clone, Default)]
pub(crate) struct Topology {
    /// The parts, if they are removed in order of cost.
    parts: Option<Parts>,
    /// Pairs of vertices without a common edge that may be merged too.
    pub(crate) pairs: Option<Pairs>,
}

/// Counts and sums of a run.
#[derive(Clone, Default)]
pub(crate) struct Tally {
    /// Collapses that were refused, by reason.
    pub(crate) refusals: [u64; Refusal::ALL.len()],
    pub(crate) collapses: u64,
    /// Faces of all rings that were visited, counted at each visit.
    pub(crate) faces_visited: u64,
    pub(crate) parts_removed: usize,
    pub(crate) necks_cut: usize,
    pub(crate) pairs_contracted: usize,
    /// Sum of the costs of all collapses: twice an area times a squared distance.
    collapse_cost: f64,
    /// Sum of the costs of removed parts, in the same unit.
    removed_part_cost: f64,
    /// The highest threshold of a sweep that collapsed anything.
    highest_threshold: f32,
    /// True if a sweep collapsed anything after sweeps became unproductive.
    is_unproductive: bool,
    /// Number of faces before the first sweep.
    first_faces: usize,
    /// Remaining work budget at hubs.
    hub_budget: HubBudget,
}

impl Tally {
    /// Number of refusals of all reasons.
    fn refused(&self) -> u64 {
        self.refusals.iter().sum()
    }

    fn refuse(&mut self, why: Refusal) {
        self.refusals[why as usize] += 1;
    }
}

/// Scratch buffers for one edge.
#[derive(Clone, Default)]
struct Scratch {
    wings: Wings,
    /// Spokes of the removed end that remain.
    spokes: Ring,
    neighbourhood: EdgeNeighbourhood,
    other_ring: Ring,
    merge: Merge,
    /// Feature edges around the collapsed edge: far end, true if at the kept end, and weight of the line.
    rim: Vec<(VertexId, bool, f32)>,
    /// Edges of the star that is evaluated.
    edges: Vec<Edge>,
    samples: SampleScratch,
    marks: Marks,
}

impl<M: Metric> Engine<M> {
    /// Takes a store and fills its quadrics and kinds. Returns the number of duplicate faces with the same
    /// winding; they are removed.
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
                cost_factors: None,
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
        if cfg!(debug_assertions) && engine.mesh.store.t.len() < invariants::CHECKED_BELOW {
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
        engine.mesh.exclude_unused(&special);
        engine.mesh.init_attribute_sums();
        engine.mesh.init_lines(special);
        engine.tally.first_faces = engine.mesh.store.live_faces;
        (engine, duplicates)
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Computes the kinds of all vertices, right after the corner lists were filled up to these ends and
    /// while nothing but locks is known; removes duplicate faces. Returns the vertices that may not be
    /// regular, and the number of faces removed.
    fn classify(&mut self, ends: Ends) -> (Vec<VertexId>, usize) {
        self.chain_wedges();
        let (mut ring, mut edges, mut duplicates) = (Ring::default(), Vec::new(), Vec::new());
        let (mut special, mut by_ends) = (Vec::new(), Vec::new());
        let has_seams = self.has_seams();
        for (is_closed, u) in self.store.closed_fans(ends).into_iter().zip((0..).map(VertexId)) {
            // (Most vertices of most meshes, without building a ring. All listed faces are still live.)
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

    /// Excludes those of these vertices that no face uses.
    fn exclude_unused(&mut self, among: &[VertexId]) {
        for &u in among {
            if self.store.listed(u).is_empty() {
                let x = &mut self.store.v[u.index()];
                x.kind = x.kind.gone();
                self.store.bound[u.index()] = f32::INFINITY;
                self.store.live_vertices -= 1;
            }
        }
    }

    /// Initializes the facings of all vertices, the tensors of the planes around them, and their corner
    /// lists. No vertex may have been initialized before. Returns the ends of the lists.
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

    /// Returns the mean of twice the area of a face; above 0.
    fn mean_face(&self) -> f32 {
        let doubled = |t: &[VertexId; 3]| {
            let [a, b, c] = t.map(|w| self.store.p(w));
            f64::from((b - a).cross(c - a).length())
        };
        let sum: f64 = self.store.t.iter().map(doubled).sum();
        (sum / self.store.t.len().max(1) as f64).max(1e-30) as f32
    }

    /// Adds the line tensors of all feature edges, whose ends are among these.
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

    /// Adds the line tensors of a star to a tensor.
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

    /// Returns a kind with the seams that wedges and regions of the star add to it.
    fn with_seams(&self, kind: Kind, u: VertexId, ring: &Ring, edges: &mut Vec<Edge>) -> Kind {
        if !self.has_seams() || self.is_far_from_seams(ring, u) {
            return kind;
        }
        self.store.edges(ring, kind, edges);
        kind.on_seam(edges.iter().any(Edge::is_seam))
    }

    /// Recomputes the kind of a vertex from its star.
    fn current_kind(&self, u: VertexId, ring: &Ring) -> Kind {
        let old = self.store.v[u.index()].kind;
        self.with_seams(
            Kind::of(ring, self.constraints.rules.border).moved(old.is_moved()).locked(old.is_locked()),
            u,
            ring,
            &mut Vec::new(),
        )
    }

    /// Recomputes the kind and, if the metric is memoryless, the tensor of a vertex from its star.
    fn refresh(&mut self, u: VertexId, ring: &mut Ring) {
        self.store.ring(u, ring);
        self.store.v[u.index()].kind = self.current_kind(u, ring);
        if self.cost.metric.is_memoryless() {
            let mut q = M::Memory::default();
            *M::tensor(&mut q) = self.current_tensor(u, ring);
            self.store.v[u.index()].q = q;
        }
    }

    /// Computes the tensor of a star for a memoryless metric: planes, attributes and lines.
    fn current_tensor(&self, u: VertexId, ring: &Ring) -> Tensor {
        let mut sum = self.current_planes(u, ring);
        if self.has_lines() {
            self.add_lines_to(&mut sum, u, ring, &mut Vec::new());
        }
        sum
    }

    /// Computes the tensor of a star for a memoryless metric, without lines.
    fn current_planes(&self, u: VertexId, ring: &Ring) -> Tensor {
        let (p, mut sum) = (self.store.p(u), Tensor::default());
        for r in ring.iter() {
            let normal = (self.store.p(r.a) - p).cross(self.store.p(r.b) - p);
            let weight = self.cost.metric.plane_weight(normal.length(), self.cost.mean_face);
            sum.add(&Tensor::outer(normal, weight));
        }
        sum.add(&self.attribute_tensor(u, ring));
        sum
    }

    /// True if there may be seams or sharp edges.
    fn has_seams(&self) -> bool {
        self.values.attributes.is_some() || self.store.regions.is_some() || self.store.creases.is_some()
    }

    /// True if any attribute counts in the cost.
    fn counts_attributes(&self) -> bool {
        self.values.attributes.as_ref().is_some_and(Attributes::counts)
    }
}

impl<M: Metric> Engine<M> {
    /// Evaluates all edges that `u` owns, whatever they cost; leaves its ring in the scratch.
    #[inline(never)]
    fn evaluate_at_any_cost(&mut self, u: VertexId, scratch: &mut VisitScratch) {
        let VisitScratch { ru, owned, found, members, .. } = scratch;
        self.mesh.store.ring(u, ru);
        let Self { mesh, scratch, tally, .. } = self;
        mesh.store.list_owned(u, ru, owned, &mut scratch.marks);
        found.clear();
        let are_lone = mesh.cache_wedge_reductions(u, owned);
        let edges = OwnedEdges { u, owned, ring: ru, most: f32::INFINITY, have_single_wedges: are_lone };
        mesh.evaluate_owned(&edges, members, found, scratch, tally);
    }

    /// Evaluates the edges that u owns, collapses the cheapest possible one that costs at most tau, and
    /// updates `bound[u]`.
    fn visit(&mut self, u: VertexId, tau: f32, probe: bool, scratch: &mut VisitScratch) {
        let VisitScratch { ru, rv, owned, found, members } = scratch;
        self.mesh.store.ring(u, ru);
        found.clear();
        self.tally.faces_visited += ru.len() as u64;
        let owned = if self.mesh.store.v[u.index()].kind.is_regular() {
            // Inside closed fans every neighbour comes first in one of the triangles, so the second need
            // not be visited. (Branchless: each is written, some are kept; a branch on the order would be
            // unpredictable.)
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
        let are_lone = mesh.cache_wedge_reductions(u, owned);
        let edges = OwnedEdges { u, owned, ring: ru, most: tau, have_single_wedges: are_lone };
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
            // A vertex that was not visited yet owns edges of unknown cost; they are evaluated in the next
            // sweep.
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
                    // All other edges of a hub exceed the budget too.
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
                        // Retried at a higher threshold: the neighbourhood may change until then.
                        least = least.min(4.0 * tau + 1e-20);
                    }
                }
            }
        }
        self.mesh.store.bound[u.index()] = least;
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Returns a collapse onto one of the ends, the kept one first, if faces would turn or vanish at the
    /// best position and the end costs at most tau.
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
            && !self.cost.metric.cost_source().is_decided_by_metric();
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
        let other = Candidate { step, cost, removed: v, form_cost: 0.0 };
        (other.cost <= tau).then_some(other)
    }

    /// Returns twice the area of the current input, in the unit frame; above 0.
    pub(crate) fn area_of_input(&self) -> f64 {
        self.cost.total_area.max(f64::MIN_POSITIVE)
    }

    /// Lets seams move at once, at the cost of their lines and attributes, instead of when nothing else is
    /// left.
    pub(crate) fn loosen_seams(&mut self) {
        if self.values.attributes.is_some() {
            self.constraints.looseness = Looseness::Seams;
        }
    }
}

impl<M: Metric> Engine<M> {
    /// True if a sweep collapsed anything after sweeps became unproductive.
    pub(crate) fn is_unproductive(&self) -> bool {
        self.tally.is_unproductive
    }

    /// True if a run that kept seams on their lines became expensive, and seams refused collapses.
    pub(crate) fn has_blocking_seams(&self) -> bool {
        self.tally.is_unproductive
            && !self.mesh.has_relaxed_seams()
            && self.tally.refusals[Refusal::Seam as usize] > 0
    }
}

impl<M: Metric> LiveMesh<M> {
    /// True if seams had to give way.
    pub(crate) fn has_relaxed_seams(&self) -> bool {
        matches!(self.constraints.looseness, Looseness::Seams | Looseness::Regions)
    }

    /// True if sharp edges that the options make features had to give way.
    pub(crate) fn has_relaxed_creases(&self) -> bool {
        self.store.creases.is_some() && self.constraints.looseness != Looseness::None
    }
}

impl<M: Metric> Engine<M> {
    /// Estimates the RMS distance of the result, in the unit frame: from that of the fit, or from the costs
    /// of all collapses. A collapse that lifts the tip of a star by h over triangles of area A adds A h² /
    /// 6 to the integral of the squared distance, and costs 2 A h².
    pub(crate) fn estimate(&self, fitted: Option<f64>) -> f64 {
        let area = self.mesh.cost.total_area.max(f64::MIN_POSITIVE);
        let kept = fitted.map_or(
            self.mesh.cost.metric.squared_rms_factor() * self.tally.collapse_cost / 6.0 / area,
            |rms| rms * rms,
        );
        // A part is not everywhere as far from the rest as it is large: a quarter, in squares. (Guessed.)
        (kept + 0.25 * self.tally.removed_part_cost / area).sqrt()
    }
}

/// Adds the planes of the first `count` of four faces to the tensors and the normals of their corners, and
/// counts the corners. Returns twice the areas.
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

/// Scratch buffers of a visit, allocated once.
#[derive(Default)]
struct VisitScratch {
    ru: Ring,
    rv: Ring,
    owned: Vec<VertexId>,
    found: Found,
    members: Vec<Member>,
}
