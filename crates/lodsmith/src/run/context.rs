//! A run: its input in order, options and goal, and the results of its passes.

use lodsmith_core::{FaceId, Surface, TriMesh, VertexId, WedgeId};

use super::goal::goal;
use crate::collapse::cut::may_cut;
use crate::collapse::order::Ordered;
use crate::collapse::{Goal, StopReason, Tally};
use crate::constraints::{Constraints, HeldWedges};
use crate::control::{Control, Stage};
use crate::deviation::{self, Deviation, InputComparer};
use crate::input::Input;
use crate::options::{SimplifyOptions, TopologyPolicy};
use crate::proposal::Proposal;
use crate::{Simplified, SimplifyError};

/// Smallest limit of a point of an error map, as a share of the largest extent: positions of a run are in single
/// precision.
const MAP_ROUNDING: f64 = 2e-6;

/// Topology changes that a pass may make in order of cost.
#[derive(Clone, Copy, Default, PartialEq)]
pub(super) struct TopologyChanges {
    /// Removal of whole parts.
    pub(super) parts: bool,
    /// Cuts of handles and thin places.
    pub(super) cuts: bool,
    /// Movement of seams off their lines.
    pub(super) seams: bool,
}

impl TopologyChanges {
    /// Returns the changes from the start of a run.
    pub(super) fn from_start(options: &SimplifyOptions) -> Self {
        if options.topology == TopologyPolicy::Free { Self::removal(options) } else { Self::default() }
    }

    /// Returns removal of parts, and cuts if the options allow them.
    pub(super) fn removal(options: &SimplifyOptions) -> Self {
        Self { parts: true, cuts: may_cut(options), seams: false }
    }
}

/// Result of one pass.
#[derive(Clone)]
pub(crate) struct RunOutcome {
    pub(crate) mesh: TriMesh,
    pub(crate) held: HeldWedges,
    pub(crate) end: StopReason,
    pub(crate) estimate: f64,
    pub(crate) tally: Tally,
    pub(crate) duplicate_faces: usize,
    pub(crate) relaxed: RelaxedRules,
    pub(crate) engine: EngineOutcome,
}

/// Rules that gave way to the target.
#[derive(Clone, Default)]
pub(crate) struct RelaxedRules {
    pub(crate) seams: bool,
    pub(crate) sharp_edges: bool,
}

/// The part of an outcome that only a pass of the engine has: a method that builds a new surface leaves the defaults.
#[derive(Clone, Default)]
pub(crate) struct EngineOutcome {
    pub(super) fitted: bool,
    pub(super) kept: KeptAtCost,
    /// True if collapses continued after sweeps became unproductive.
    pub(super) is_unproductive: bool,
    /// True if vertices that were separated by a cut are at the same position, which only free topology allows.
    pub(super) has_touching_vertices: bool,
    pub(super) proposals: Vec<Proposal>,
    /// Attributes that [`Run::completed`] still has to add; `None` if there are none.
    pub(super) missing: Option<MissingAttributes>,
    pub(super) trace: Option<Trace>,
}

/// Seams, parts and necks that a pass kept at a cost: a run without them may be closer to the input.
#[derive(Clone, Default)]
pub(super) struct KeptAtCost {
    /// Seams stayed on their lines, and refused collapses.
    pub(super) seams: bool,
    /// Parts were cheaper to remove than the collapses done instead.
    pub(super) parts: bool,
    /// Necks blocked many collapses.
    pub(super) necks: bool,
}

/// Data of a finished engine for the attributes that depend on a look at the input.
#[derive(Clone)]
pub(super) struct MissingAttributes {
    /// For each vertex of the result, the vertex of the ordered input whose position it had at the start.
    pub(super) places: Vec<VertexId>,
    /// True if seams moved: faces across them need values of the input.
    pub(super) has_moved_seams: bool,
    /// Rows of values at the corners, which keep their shading then, if the run blended values.
    pub(super) blended: Option<Vec<f32>>,
    /// True if the ordered input still has its points and faces.
    pub(super) is_input_kept: bool,
}

/// Mapping between the vertices of the ordered input and of a result.
#[derive(Clone)]
pub(crate) struct Trace {
    /// Topology changes of the pass. Passes to two levels of a chain with equal changes continue each other.
    pub(super) changes: TopologyChanges,
    /// Number in the engine of each vertex of the result.
    pub(super) origins: Vec<VertexId>,
    /// For each of these, the vertex of the ordered input whose position it had at the start.
    pub(super) places: Vec<VertexId>,
    /// Vertex of the result for each number of the engine, or [`NONE`](crate::collapse::order::NONE).
    pub(super) homes: Vec<VertexId>,
}

/// Result of a run, and the locked wedges at its corners.
pub(crate) type Done = (Simplified, HeldWedges);
/// Outcome of a run, its distance from the input, and true if an error limit ended it.
pub(super) type Finished = (RunOutcome, Deviation, bool);

/// Function that runs to a goal.
pub(crate) type Pass = fn(&mut Run<'_, '_>, Goal, &mut dyn Control) -> Result<RunOutcome, SimplifyError>;

/// An input with its order, options, goal and constraints, and the pass of the method.
pub(crate) struct Run<'a, 'b> {
    pub(crate) input: &'a Input<'b>,
    pub(crate) options: &'a SimplifyOptions,
    pub(crate) ordered: &'a mut Ordered,
    pub(crate) goal: Goal,
    pub(crate) constraints: &'a Constraints,
    pub(crate) pass: Pass,
    /// The largest distance that one step may cause, in user units, for methods whose error is limited by it.
    pub(crate) step: Option<f64>,
    /// True if outcomes include the origin of their vertices.
    pub(crate) is_traced: bool,
    /// Number of final fits.
    pub(super) fits: usize,
}

impl<'a, 'b> Run<'a, 'b> {
    /// Creates a run to the goal of its options.
    pub(crate) fn new(
        input: &'a Input<'b>,
        options: &'a SimplifyOptions,
        ordered: &'a mut Ordered,
        constraints: &'a Constraints,
        pass: Pass,
    ) -> Self {
        let goal = goal(options, input.surface.triangles().len());
        Self { input, options, ordered, goal, constraints, pass, step: None, is_traced: false, fits: 1 }
    }
}

impl Run<'_, '_> {
    /// Runs the pass of the method to a goal.
    pub(super) fn run_pass(
        &mut self,
        goal: Goal,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        (self.pass)(self, goal, control)
    }

    /// Measures results, if more than their estimates is asked for.
    pub(super) fn measured(
        &self,
        results: &[&TriMesh],
        control: &mut dyn Control,
    ) -> Result<Vec<Deviation>, SimplifyError> {
        deviation::measured(self.options, results, |control| self.input_comparer(control), control)
    }

    /// Returns a comparer with the input, to measure results: degenerate and non-finite faces do not count.
    pub(super) fn input_comparer(&self, control: &mut dyn Control) -> Option<InputComparer> {
        control.stage(Stage::Measure);
        let surface = &self.input.surface;
        let cleanup = &self.ordered.cleanup;
        let share = |shares: &[f32], v: VertexId| {
            let place = self.ordered.rank[v.index()];
            shares.get(place.index()).copied().unwrap_or(1.0)
        };
        let rounding = MAP_ROUNDING * self.ordered.frame.user_length(1.0);
        let with_map = |surface: &Surface<'_>| {
            let comparer = InputComparer::new(surface, self.options)?;
            let Some(shares) = self.constraints.error_map() else { return Some(comparer) };
            let of_face = |f: FaceId| surface.triangles()[f.index()].map(|v| share(shares, v));
            Some(comparer.with_map(of_face, rounding))
        };
        if cleanup.degenerate_faces + cleanup.non_finite_faces == 0 {
            return with_map(surface);
        }
        let sound = |t: &&[VertexId; 3]| self.ordered.is_sound(t);
        let triangles = surface.triangles().iter().filter(sound).copied().collect();
        let clean = Surface::with_triangles(surface.positions(), triangles).ok()?;
        with_map(&clean)
    }

    /// Returns the number of a wedge's vertex in the ordered input.
    pub(crate) fn place(&self, mesh: &TriMesh, w: WedgeId) -> VertexId {
        self.ordered.rank[self.input.joined(mesh.vertex_of(w)).index()]
    }
}
