//! The edge collapse engine.
//!
//! ```text
//! order the input along a Morton curve                     (order)
//! give each vertex its quadric and its kind                (star_data, kind)
//! loop                                                     (sweeps)
//!     tau = a quantile of the bounds                       (bound)
//!     contract pairs that cost at most tau, where wanted   (pairs, near, bundle)
//!     for each vertex u with bound[u] <= tau, in order     (visit)
//!         evaluate the edges that u owns                   (evaluate)
//!         the cheapest: link condition, guards, exact cost (link_condition, commit)
//!         collapse it if it costs at most tau; bound[u] = least cost that remains
//!     compact when much is dead                            (store)
//!     at extreme targets add sampled costs                 (sampled_error)
//!     when no edge can be collapsed, remove whole parts    (parts)
//! where the topology may change, necks are cut instead of pinched, and parts are removed in order of cost (cut, parts)
//! ```
//!
//! There is no queue, and a collapse re-evaluates nothing: an edge belongs to its lower end, `bound[u]` is
//! the lowest cost last seen at u, and a stale bound only makes a collapse happen a sweep later or earlier.
//! Exact order gains nothing: the expected quality is the same as with a global queue [Wu-Kobbelt 2002], at a
//! fraction of its time.

pub(crate) mod attributes;
mod blocks;
mod bound;
pub(crate) mod bounded;
mod budget;
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
mod limit;
mod link_condition;
mod locks;
mod marks;
mod merge;
mod near;
pub(crate) mod order;
pub(crate) mod ordered_input;
mod pair_cost;
mod pair_list;
mod pairs;
mod parts;
pub(crate) mod record;
mod recording;
mod resume;
pub(crate) mod ring;
mod sampled_error;
mod samples;
mod seams;
pub(crate) mod snapshot;
mod star;
mod star_data;
mod star_edges;
pub(crate) mod store;
mod stuck;
mod sweeps;
#[cfg(test)]
mod test_support;
pub(crate) mod triangle;
pub(crate) mod vertex;
mod visit;
mod wedges;
mod wings;

use lodsmith_core::VertexId;

use crate::cost::guard::Rules;
use crate::cost::metric::{EdgeNeighbourhood, Metric};
use crate::report::Refusal;
use attributes::{Attributes, Merge};
use bounded::{BoundScratch, Bounded};
use components::{Details, Parts};
use hub_budget::HubBudget;
use invariants::Checks;
use kind::Kind;
use marks::Marks;
use pair_list::Pairs;
use record::Record;
use ring::Ring;
use samples::{SampleScratch, SampledError};
use star_edges::{Edge, Looseness};
use store::Store;
pub(crate) use sweeps::{Pause, Sweeps};
pub(crate) use wedges::Wedges;
use wings::Wings;

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

/// Why the engine stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopReason {
    /// The goal is reached.
    Goal,
    /// None of the remaining collapses is allowed.
    Stuck,
    /// No edge below the method's cost limit is left.
    Exhausted,
    /// The caller wants the best result so far.
    Finish,
    /// The caller wants no result.
    Cancel,
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
    /// Limit of the distance to the input, in the last phase of a run to an error.
    pub(crate) bounded: Option<Box<Bounded>>,
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
    /// Line quadrics per vertex, by number in the ordered input; only kept for pair contraction with an
    /// accumulating metric, otherwise empty.
    lines: Vec<M::Memory>,
}

/// Constraints on collapses and weights of costs.
#[derive(Clone)]
pub(crate) struct CollapseRules {
    rules: Rules,
    /// The feature lines that may be given up so far.
    looseness: Looseness,
    /// Factors of the cost at vertices (importance), by number in the ordered input; `None` if all are 1.
    cost_factors: Option<Vec<f32>>,
    /// Small parts that keep their area because they differ in colour.
    details: Option<Box<Details>>,
    /// True if a collapse that would pinch the surface may cut it there instead.
    pub(crate) cuts_necks: bool,
    /// In a block, the first so many vertices may have faces elsewhere, and stay as they are.
    frozen: usize,
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
    /// Collapses and refusals as long as sweeps were productive.
    while_productive: (u64, [u64; Refusal::ALL.len()]),
    /// Number of faces before the first sweep.
    first_faces: usize,
    /// Remaining work budget at hubs.
    hub_budget: HubBudget,
}

impl Tally {
    /// Number of refusals of all reasons.
    pub(crate) fn refused(&self) -> u64 {
        self.refusals.iter().sum()
    }

    /// True if a collapse was refused for this reason.
    pub(crate) fn has_refused(&self, why: Refusal) -> bool {
        self.refusals[why as usize] > 0
    }

    /// Collapses refused for a reason, relative to the collapses done, both since sweeps became unproductive.
    fn refused_since(&self, why: Refusal) -> f64 {
        let (collapses, refusals) = &self.while_productive;
        let refused = self.refusals[why as usize] - refusals[why as usize];
        refused as f64 / (self.collapses - collapses).max(1) as f64
    }

    /// Adds the collapses of a block.
    fn add(&mut self, block: &Self) {
        for (n, more) in self.refusals.iter_mut().zip(block.refusals) {
            *n += more;
        }
        self.collapses += block.collapses;
        self.faces_visited += block.faces_visited;
        self.collapse_cost += block.collapse_cost;
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
    bounded: BoundScratch,
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
                frozen: 0,
                keeps_parts: false,
            },
            values: WedgeValues { attributes, wedge_data },
            sampled: None,
            bounded: None,
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
    /// True if there may be seams or sharp edges.
    fn has_seams(&self) -> bool {
        self.values.attributes.is_some()
            || self.store.regions.is_some()
            || self.store.creases.is_some()
            || self.split_vertices().is_some()
    }

    /// Returns for each vertex of the ordered input whether it is on a seam of texture coordinates, in a run
    /// onto endpoints where such seams have lines.
    #[inline(always)]
    fn split_vertices(&self) -> Option<&[bool]> {
        self.values.wedge_data.as_ref()?.is_split.as_deref()
    }

    /// True if any attribute counts in the cost.
    fn counts_attributes(&self) -> bool {
        self.values.attributes.as_ref().is_some_and(Attributes::counts)
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Returns twice the area of the current input, in the unit frame; above 0.
    pub(crate) fn area_of_input(&self) -> f64 {
        self.cost.total_area.max(f64::MIN_POSITIVE)
    }

    /// Lets seams move at once, at the cost of their lines and attributes, instead of only when nothing else
    /// is left.
    pub(crate) fn loosen_seams(&mut self) {
        if self.may_relax_seams() {
            self.constraints.looseness = Looseness::Seams;
        }
    }
}

impl<M: Metric> Engine<M> {
    /// True if a sweep collapsed anything after sweeps became unproductive.
    pub(crate) fn is_unproductive(&self) -> bool {
        self.tally.is_unproductive
    }
}

impl<M: Metric> LiveMesh<M> {
    /// True if there are seams of attributes, and they may give way.
    fn may_relax_seams(&self) -> bool {
        let is_matched = |data: &Wedges| !data.has_seam_lines && !data.sides.is_empty();
        self.values.attributes.is_some() || self.values.wedge_data.as_ref().is_some_and(is_matched)
    }

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
    /// Estimates the RMS distance of the result, in the unit frame: from the RMS distance of the fit, or from
    /// the costs of all collapses. A collapse that lifts the tip of a star by h over triangles of area A adds
    /// A h² / 6 to the integral of the squared distance, and costs 2 A h². `removed` is twice that integral
    /// over the removed parts, if it was measured.
    pub(crate) fn estimate(&self, fitted: Option<f64>, removed: Option<f64>) -> f64 {
        let area = self.mesh.cost.total_area.max(f64::MIN_POSITIVE);
        let kept = fitted.map_or(
            self.mesh.cost.metric.squared_rms_factor() * self.tally.collapse_cost / 6.0 / area,
            |rms| rms * rms,
        );
        // Most of a part is closer to the rest than the part is large: on average a quarter, in squares.
        // (Guessed.)
        let removed = removed.unwrap_or(0.25 * self.tally.removed_part_cost);
        (kept + removed / area).sqrt()
    }
}
