//! One run from a surface to a simplified one: order, collapse, fit, measure, and the report.

mod chain;
mod closest;
mod copies;
pub(crate) mod level_search;
mod relaxed;
mod start;
mod trunk;
mod within;

use lodsmith_core::mesh::defects::is_zero_area;
use lodsmith_core::mesh::weld;
use lodsmith_core::{Attribute, Positions, PositionsView, Surface, TriMesh, VertexId, WedgeId};

use crate::attributes::{Rows, with_wedges};
use crate::collapse::attributes::Attributes;
use crate::collapse::order::{self, NONE, Ordered};
use crate::collapse::store::Store;
use crate::collapse::{Goal, InputSurface, InputVisitor, StopReason};
use crate::constraints::{self, Constraints, HeldWedges, LockedWedges};
use crate::control::{Control, Stage, Verdict};
use crate::deviation::{self, Deviation, InputComparer, ROUNDING};
pub(crate) use crate::input::Input;
use crate::metric::{Memoryless, Metric, NeighbourhoodMetric, Quadric, VertexMemory};
use crate::options::{Method, SimplifyOptions, TopologyPolicy};
use crate::proposal::Proposal;
use crate::prune::Pruned;
use crate::report::{ErrorReport, Refusal, Report, StoppedBy};
use crate::{Simplified, SimplifyError, cluster, escalate, prune, rebuild, shading};
pub(crate) use chain::{is_chained, run_chain};
use copies::Copies;
pub(crate) use start::Started;
use trunk::Trace;

/// The ordered input, kept in memory or computed again.
pub(crate) struct Source<'a> {
    pub(crate) surface: &'a Surface<'a>,
    pub(crate) ordered: &'a Ordered,
    pub(crate) is_kept: bool,
}

impl InputSurface for Source<'_> {
    fn visit(&self, look: &mut InputVisitor<'_>) {
        if self.is_kept {
            look(&self.ordered.points, &self.ordered.faces);
        } else {
            look(&self.ordered.remake_points(self.surface), &self.ordered.remake_faces(self.surface));
        }
    }
}

/// Topology changes that a pass may make in order of cost.
#[derive(Clone, Copy)]
struct TopologyChanges {
    /// Removal of whole parts.
    parts: bool,
    /// Cuts of handles and thin places.
    cuts: bool,
    /// Movement of seams off their lines.
    seams: bool,
}

/// Result of one pass of the engine.
pub(crate) struct RunOutcome {
    pub(crate) mesh: TriMesh,
    pub(crate) end: StopReason,
    pub(crate) estimate: f64,
    pub(crate) fitted: bool,
    pub(crate) refusals: [u64; Refusal::ALL.len()],
    pub(crate) collapses: u64,
    pub(crate) faces_visited: u64,
    pub(crate) parts_removed: usize,
    pub(crate) necks_cut: usize,
    pub(crate) pairs_contracted: usize,
    /// True if vertices that were separated by a cut are at the same position.
    pub(crate) has_touching_vertices: bool,
    pub(crate) seams_relaxed: bool,
    /// True if collapses continued after sweeps became unproductive.
    pub(crate) is_unproductive: bool,
    /// True if seams stayed on their lines at a cost.
    pub(crate) kept_costly_seams: bool,
    /// True if parts were kept that would have been cheaper to remove than the collapses done instead.
    pub(crate) kept_blocking_parts: bool,
    /// True if necks were kept that blocked many collapses.
    pub(crate) kept_blocking_necks: bool,
    pub(crate) sharp_relaxed: bool,
    pub(crate) duplicate_faces: usize,
    pub(crate) proposals: Vec<Proposal>,
    pub(crate) held: HeldWedges,
    pub(crate) trace: Option<Trace>,
}

/// Result of a run, and the locked wedges at its corners.
pub(crate) type Done = (Simplified, HeldWedges);
/// Inner part of a run, after the preparing steps: one run, or a chain of them.
type Inner<'a> = dyn FnMut(&Input<'_>, &SimplifyOptions) -> Result<Vec<Done>, SimplifyError> + 'a;

/// Runs with the options' method, after welding and pruning; again with looser options if requested and
/// needed. Returns the locked wedges at the corners of the result too.
pub(crate) fn run(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    options.check()?;
    constraints::check(options, input.surface.positions().len())?;
    let options = &options.with_own_placement();
    escalate::run_escalating(options, |options| {
        let mut all = run_shaded(input, options, &mut |input, options| {
            Ok(vec![run_by_method(input, options, control)?])
        })?;
        Ok(all.swap_remove(0))
    })
}

/// Adds normals computed from the shape, if they are to count, and runs.
fn run_shaded(
    input: &Input<'_>,
    options: &SimplifyOptions,
    inner: &mut Inner<'_>,
) -> Result<Vec<Done>, SimplifyError> {
    if options.shape_normals
        && let Some(mesh) = shading::with_shape_normals(input)?
    {
        let lent = Input { surface: mesh.surface(), mesh: Some(&mesh), joined: None };
        let has_seams = input.mesh.is_some_and(|m| m.has_attributes() || m.regions().is_some());
        let unshaded = |(mut done, held): Done| {
            done.mesh = shading::without_lent_normals(done.mesh)?;
            done.report.seams_relaxed &= has_seams;
            Ok((done, held))
        };
        let options = &SimplifyOptions { keeps_blended_normals: true, ..options.clone() };
        return run_pruned(&lent, options, inner)?.into_iter().map(unshaded).collect();
    }
    run_pruned(input, options, inner)
}

/// Removes small parts, and runs on the rest.
fn run_pruned(
    input: &Input<'_>,
    options: &SimplifyOptions,
    inner: &mut Inner<'_>,
) -> Result<Vec<Done>, SimplifyError> {
    let Some(size) = options.prune else { return run_welded(input, options, inner) };
    let diagonal = prune::diagonal(&input.surface);
    // Shares refer to the whole input, including small parts.
    let mut options = options.clone();
    options.lengths_to_units(diagonal);
    let near = options.weld.map(|d| d.in_units(diagonal));
    let small = prune::small_parts(&input.surface, size.in_units(diagonal), near, options.locked.as_deref());
    if small.pruned.parts == 0 {
        let mut all = run_welded(input, &options, inner)?;
        all.iter_mut().for_each(|done| done.0.report.pruned = small.pruned);
        return Ok(all);
    }
    let (triangles, unused) = prune::without_small(&input.surface, &small.is_small);
    let surface = Surface::with_triangles(input.surface.positions(), triangles)?;
    let mut all = run_welded(&Input { surface, mesh: input.mesh, joined: None }, &options, inner)?;
    for (done, _) in &mut all {
        let report = &mut done.report;
        report.pruned = small.pruned;
        report.error.diagonal = diagonal;
        let cleanup = &mut report.cleanup;
        cleanup.degenerate_faces = cleanup.degenerate_faces.saturating_sub(small.pruned.faces);
        cleanup.unused_vertices = cleanup.unused_vertices.saturating_sub(unused);
    }
    Ok(all)
}

/// Joins close vertices if requested, and runs.
fn run_welded(
    input: &Input<'_>,
    options: &SimplifyOptions,
    inner: &mut Inner<'_>,
) -> Result<Vec<Done>, SimplifyError> {
    let Some(distance) = options.weld else { return inner(input, options) };
    let positions = input.surface.positions();
    let diagonal = positions.bounds().map_or(0.0, |b| b.diagonal());
    let weld = weld::weld_within(positions, distance.in_units(diagonal));
    let (joined, merged) = constraints::weld_onto_locked(&weld, positions, options);
    let triangles = input.surface.triangles().iter().map(|t| t.map(|v| joined[v.index()])).collect();
    let surface = Surface::with_triangles(positions, triangles)?;
    let welded = Input { surface, mesh: input.mesh, joined: Some(joined) };
    let mut all = inner(&welded, options)?;
    for (done, _) in &mut all {
        // The joined vertices have no faces any more; they are counted as joined, not as unused.
        let cleanup = &mut done.report.cleanup;
        cleanup.welded_vertices += merged;
        cleanup.unused_vertices = cleanup.unused_vertices.saturating_sub(merged);
    }
    Ok(all)
}

/// Function that runs to a goal. The second argument is the largest distance that a step may leave, in user
/// units, if the error is searched for.
pub(crate) type Pass =
    fn(&mut Run<'_, '_>, Goal, Option<f64>, &mut dyn Control) -> Result<RunOutcome, SimplifyError>;

/// Returns the pass of a method that works by sweeps.
pub(crate) fn collapses(method: Method) -> Option<Pass> {
    match method {
        Method::Memoryless => Some(|run, goal, step, control| run.one_pass(Memoryless, goal, step, control)),
        Method::Quadric => Some(|run, goal, step, control| run.one_pass(Quadric, goal, step, control)),
        Method::LindstromTurk => {
            Some(|run, goal, step, control| run.one_pass(NeighbourhoodMetric::Volume, goal, step, control))
        }
        Method::Melax => {
            Some(|run, goal, step, control| run.one_pass(NeighbourhoodMetric::Turn, goal, step, control))
        }
        Method::ShortestEdge => {
            Some(|run, goal, step, control| run.one_pass(NeighbourhoodMetric::Length, goal, step, control))
        }
        _ => None,
    }
}

pub(crate) fn run_by_method(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    if options.method == Method::Cluster {
        return cluster::run(input, options, control);
    }
    run_with(pass_of(options.method), input, options, control)
}

/// Function that makes one of the runs of a search to several counts.
type PassOfSearch =
    Box<dyn FnMut(&mut Run<'_, '_>, Goal, &mut dyn Control) -> Result<RunOutcome, SimplifyError>>;

/// Returns the runs of a search. Those of methods that work by sweeps resume from one another.
fn passes_of_search(method: Method) -> PassOfSearch {
    fn by<M: Metric + 'static>(metric: M) -> PassOfSearch {
        let mut copies = Copies::of_search();
        Box::new(move |run, goal, control| run.pass_with_copies(metric, goal, None, &mut copies, control))
    }
    match method {
        Method::Memoryless => by(Memoryless),
        Method::Quadric => by(Quadric),
        Method::LindstromTurk => by(NeighbourhoodMetric::Volume),
        Method::Melax => by(NeighbourhoodMetric::Turn),
        Method::ShortestEdge => by(NeighbourhoodMetric::Length),
        _ => Box::new(|run, goal, control| run.run_pass(goal, None, control)),
    }
}

pub(crate) fn pass_of(method: Method) -> Pass {
    collapses(method).unwrap_or(rebuild::pass)
}

pub(crate) fn run_with(
    pass: Pass,
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    let mut ordered = ordered(input, control)?;
    let goal = goal(options, input.surface.triangles().len());
    let limit = options.stop.error.map(|e| e.in_units(ordered.diagonal));
    let care = Constraints::new(options, &ordered, |v| input.joined(v));
    let run = Run { input, options, ordered: &mut ordered, goal, constraints: &care, pass, is_traced: false };
    let finished = match limit {
        Some(limit) if rebuild::limits_error_by_step(options.method) => {
            run.run_within_step(limit, control)?
        }
        Some(limit) => run.run_within_error(limit, control)?,
        None => run.run_to_goal(control)?,
    };
    Ok(build_report(input, options, &ordered, &care, finished))
}

/// Orders the input; an error if it has no face with an area.
pub(crate) fn ordered(input: &Input<'_>, control: &mut dyn Control) -> Result<Ordered, SimplifyError> {
    control.stage(Stage::Prepare);
    if control.progress(0.0) == Verdict::Cancel {
        return Err(SimplifyError::Cancelled);
    }
    let surface = &input.surface;
    let ordered = order::order(surface);
    let has_area =
        |t: &[VertexId; 3]| ordered.is_sound(t) && !is_zero_area(t.map(|v| surface.positions().get(v)));
    if !surface.triangles().iter().any(has_area) {
        return Err(SimplifyError::NoFaces { faces: surface.triangles().len() });
    }
    Ok(ordered)
}

/// Builds the result and its report.
fn build_report(
    input: &Input<'_>,
    options: &SimplifyOptions,
    ordered: &Ordered,
    care: &Constraints,
    (outcome, deviation, by_error): Finished,
) -> Done {
    let surface = &input.surface;
    let input_faces = surface.triangles().len();
    let goal = goal(options, input_faces);
    let limit = options.stop.error.map(|e| e.in_units(ordered.diagonal));
    let mut cleanup = ordered.cleanup;
    cleanup.duplicate_faces = outcome.duplicate_faces;
    let met = |n: Option<usize>, count: usize| n.is_some_and(|n| count <= n);
    let (faces, vertices) = (outcome.mesh.face_count(), outcome.mesh.vertex_count());
    let stop = &options.stop;
    let stopped_by = match outcome.end {
        StopReason::Finish => StoppedBy::Caller,
        _ if met(stop.faces, faces) => StoppedBy::Faces,
        _ if met(stop.vertices, vertices) => StoppedBy::Vertices,
        _ if met(stop.ratio.map(|r| share(r, input_faces)), faces) => StoppedBy::Ratio,
        _ if by_error => StoppedBy::Error,
        StopReason::Exhausted => StoppedBy::Exhausted,
        _ if goal.is_none() && limit.is_none() && outcome.end != StopReason::Stuck => StoppedBy::Nothing,
        _ => StoppedBy::Refusals,
    };
    // An error limit alone is reached by any result within it.
    let rounding = ROUNDING * ordered.diagonal;
    let within = |l: f64| deviation.largest().is_some_and(|d| d <= l + rounding);
    let reached = match stopped_by {
        StoppedBy::Caller => false,
        StoppedBy::Error => limit.is_some_and(within),
        StoppedBy::Exhausted => goal.is_none(),
        StoppedBy::Refusals => goal.is_none() && limit.is_some_and(within),
        _ => true,
    };
    let dropped = input.mesh.map_or_else(Vec::new, |mesh| names_of_dropped(mesh, &outcome.mesh));
    let report = Report {
        input_faces,
        input_vertices: surface.positions().len(),
        faces,
        vertices,
        reached,
        stopped_by,
        // Costs along borders are not areas: on needles they can exceed the area without limit.
        error: ErrorReport {
            estimate: outcome.estimate.min(ordered.diagonal),
            measured: deviation.measured,
            bound: deviation.bound,
            diagonal: ordered.diagonal,
        },
        refusals: Refusal::ALL.into_iter().zip(outcome.refusals).filter(|r| r.1 > 0).collect(),
        collapses: outcome.collapses,
        parts_removed: outcome.parts_removed,
        necks_cut: outcome.necks_cut,
        pairs_contracted: outcome.pairs_contracted,
        locked_vertices: care.locked_vertices(),
        locked_faces: care.locked_faces(),
        seams_relaxed: outcome.seams_relaxed,
        sharp_relaxed: outcome.sharp_relaxed,
        cleanup,
        dropped,
        fitted: outcome.fitted,
        proposals: outcome.proposals,
        escalated: Vec::new(),
        pruned: Pruned::default(),
        clustered: None,
        faces_visited: outcome.faces_visited,
    };
    (Simplified { mesh: outcome.mesh, report }, outcome.held)
}

pub(crate) struct Run<'a, 'b> {
    pub(crate) input: &'a Input<'b>,
    pub(crate) options: &'a SimplifyOptions,
    pub(crate) ordered: &'a mut Ordered,
    pub(crate) goal: Goal,
    pub(crate) constraints: &'a Constraints,
    pub(crate) pass: Pass,
    /// True if outcomes include the origin of their vertices.
    pub(crate) is_traced: bool,
}

type Finished = (RunOutcome, Deviation, bool);

impl Run<'_, '_> {
    fn run_pass(
        &mut self,
        goal: Goal,
        step: Option<f64>,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        (self.pass)(self, goal, step, control)
    }

    /// Runs one pass to the goal, and measures it if requested.
    fn run_to_goal(mut self, control: &mut dyn Control) -> Result<Finished, SimplifyError> {
        let mut outcome = self.run_pass(self.goal, None, control)?;
        if outcome.pairs_contracted > 0 && !self.goal.is_none() && outcome.end != StopReason::Finish {
            // Parts that were joined can no longer be removed one by one, so the target may be harder to
            // reach.
            let mut options = self.options.clone();
            options.method_options.pairs = None;
            let (input, goal, care) = (self.input, self.goal, self.constraints);
            let (pass, is_traced) = (self.pass, self.is_traced);
            let mut other = Run {
                input,
                options: &options,
                ordered: &mut *self.ordered,
                goal,
                constraints: care,
                pass,
                is_traced,
            };
            let without = other.run_pass(goal, None, control)?;
            outcome = self.closest(vec![outcome, without], Some(0), control);
        }
        let judge =
            if deviation::needs_measurement(self.options) { self.input_comparer(control) } else { None };
        let deviation = judge.map_or_else(Deviation::default, |judge| judge.measure(&outcome.mesh, None));
        Ok((outcome, deviation, false))
    }

    /// Returns a comparer with the input, to measure results: degenerate and non-finite faces do not count.
    fn input_comparer(&self, control: &mut dyn Control) -> Option<InputComparer> {
        control.stage(Stage::Measure);
        let surface = &self.input.surface;
        let cleanup = &self.ordered.cleanup;
        if cleanup.degenerate_faces + cleanup.non_finite_faces == 0 {
            return InputComparer::new(surface, self.options);
        }
        let sound = |t: &&[VertexId; 3]| self.ordered.is_sound(t);
        let triangles = surface.triangles().iter().filter(sound).copied().collect();
        let clean = Surface::with_triangles(surface.positions(), triangles).ok()?;
        InputComparer::new(&clean, self.options)
    }

    /// Runs one pass of the engine; `step` is the largest distance from a plane that one collapse may
    /// leave, in user units.
    fn one_pass<M: Metric>(
        &mut self,
        metric: M,
        goal: Goal,
        step: Option<f64>,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        self.pass_with_copies(metric, goal, step, &mut Copies::none(), control)
    }

    /// Runs one pass of several that share snapshots.
    fn pass_with_copies<M: Metric>(
        &mut self,
        metric: M,
        goal: Goal,
        step: Option<f64>,
        copies: &mut Copies<M>,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        if self.options.topology == TopologyPolicy::Relaxed && !goal.is_none() {
            return self.relaxed(metric, goal, step, copies, control);
        }
        // With free topology, parts and necks are removed in order of cost from the start.
        let is_free = self.options.topology == TopologyPolicy::Free;
        let leave = TopologyChanges { parts: is_free, cuts: is_free, seams: false };
        let outcome = self.run_from_start(metric, goal, step, leave, control)?;
        let competes = outcome.seams_relaxed || outcome.kept_costly_seams;
        if !competes || goal.is_none() || step.is_some() || outcome.end == StopReason::Finish {
            return Ok(outcome);
        }
        let other =
            self.run_from_start(metric, goal, step, TopologyChanges { seams: true, ..leave }, control)?;
        Ok(self.closest(vec![outcome, other], None, control))
    }

    /// Sweeps from the start to a goal, without snapshots.
    fn run_from_start<M: Metric>(
        &mut self,
        metric: M,
        goal: Goal,
        step: Option<f64>,
        leave: TopologyChanges,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        let mut trunk = self.begin(metric, step, leave, (&[], 0), control)?;
        let end = self.sweep(&mut trunk, &goal, control)?;
        let proposes = end == StopReason::Stuck && step.is_none();
        self.finish(&mut trunk.engine, &trunk.root, end, proposes, control)
    }

    /// Returns the number of a wedge's vertex in the ordered input.
    pub(crate) fn place(&self, mesh: &TriMesh, w: WedgeId) -> VertexId {
        self.ordered.rank[self.input.joined(mesh.vertex_of(w)).index()]
    }

    /// Returns the input wedges of locked vertices at the corners of the result.
    fn held<Q: VertexMemory>(&self, store: &Store<Q>, rows: Option<&Rows>) -> HeldWedges {
        let (Some(locked), Some(mesh)) = (self.constraints.locked(), self.input.mesh) else {
            return HeldWedges::default();
        };
        let carried = store.wedges.as_deref();
        let rank_of = |w: WedgeId| self.place(mesh, w);
        // Name of a wedge in the engine, at a corner of the input: a row of values, or the wedge or vertex
        // itself.
        let name = |w: WedgeId| match (rows, carried) {
            (Some(rows), Some(_)) => rows.wedge_rows[w.index()].0,
            (None, Some(_)) => w.0,
            (_, None) => rank_of(w).0,
        };
        let mut known = LockedWedges::default();
        for (f, t) in mesh.triangles().iter().enumerate() {
            let region = mesh.regions().map(|r| r[f]);
            for &w in t {
                let rank = rank_of(w);
                if rank != NONE && locked[rank.index()] {
                    known.add(name(w), region, w);
                }
            }
        }
        HeldWedges::new(store.t.iter().enumerate().map(|(f, t)| {
            let region = store.regions.as_ref().map(|r| r[f]);
            [0, 1, 2].map(|k| {
                let x = &store.v[t[k].index()];
                let name = carried.map_or(x.origin.0, |wedges| wedges[f][k].0);
                x.kind.is_locked().then(|| known.get(name, region)).flatten()
            })
        }))
    }

    /// Builds the mesh of a compact store. Vertices that kept their position have the bits of the input.
    fn result<Q: VertexMemory>(
        &self,
        store: &Store<Q>,
        attributes: Option<&Attributes>,
        rows: Option<&Rows>,
    ) -> Result<TriMesh, SimplifyError> {
        let input_positions = self.input.surface.positions();
        let first = self.ordered.first_vertices();
        let frame = self.ordered.frame;
        let place = |i: usize| {
            let x = &store.v[i];
            if x.kind.is_moved() {
                frame.user(x.p)
            } else {
                input_positions.get(first[store.place_of(x.origin).index()])
            }
        };
        let places = (0..store.v.len()).map(place);
        let positions = match input_positions {
            PositionsView::F32(_) => Positions::F32(places.map(|p| p.map(|x| x as f32)).collect()),
            PositionsView::F64(_) => Positions::F64(places.collect()),
        };
        let mut result = match (&store.wedges, self.input.mesh, rows, attributes) {
            (Some(wedges), _, Some(rows), attributes @ Some(_)) => {
                rows.mesh(attributes, positions, &store.t, wedges)?
            }
            (None, _, Some(rows), None) => {
                rows.mesh(None, positions, &store.t, bytemuck::cast_slice(&store.t))?
            }
            (Some(wedges), Some(mesh), None, _) => with_attributes(mesh, positions, &store.t, wedges)?,
            _ => TriMesh::new(positions, store.t.clone())?,
        };
        match (&store.regions, self.input.mesh.and_then(TriMesh::regions)) {
            (Some(regions), _) => result.set_regions(Some(regions.clone()))?,
            (None, Some(all)) => result.set_regions(all.first().map(|&r| vec![r; store.t.len()]))?,
            (None, None) => {}
        }
        Ok(result)
    }
}

/// Builds the result with its wedges numbered in the order of the faces, and attributes from the input.
pub(crate) fn with_attributes(
    mesh: &TriMesh,
    positions: Positions,
    faces: &[[VertexId; 3]],
    wedges: &[[WedgeId; 3]],
) -> Result<TriMesh, SimplifyError> {
    let (mut result, pairs) = with_wedges(positions, faces, wedges)?;
    result.set_normals(mesh.normals().map(|n| pairs.iter().map(|p| n[p.1.index()]).collect()))?;
    result.set_uvs(mesh.uvs().map(|n| pairs.iter().map(|p| n[p.1.index()]).collect()))?;
    result.set_colors(mesh.colors().map(|n| pairs.iter().map(|p| n[p.1.index()]).collect()))?;
    for a in mesh.further_attributes() {
        let values = pairs.iter().flat_map(|p| a.of(p.1)).copied().collect();
        result.add_attribute(Attribute { semantic: a.semantic.clone(), width: a.width, values })?;
    }
    Ok(result)
}

/// Returns the names of attributes missing in the result: joints without weights of the same set, or
/// weights without joints.
pub(crate) fn names_of_dropped(input: &TriMesh, result: &TriMesh) -> Vec<&'static str> {
    let is_there = |a: &&Attribute| {
        result.further_attributes().iter().any(|b| (&b.semantic, b.width) == (&a.semantic, a.width))
    };
    let gone = input.further_attributes().iter().filter(|a| !is_there(a));
    let mut names: Vec<_> = gone.map(|a| a.semantic.title()).collect();
    names.dedup();
    names
}

/// Returns the number of faces for a ratio: at least one.
pub(crate) fn share(ratio: f64, faces: usize) -> usize {
    ((faces as f64 * ratio).round() as usize).max(1)
}

pub(crate) fn goal(options: &SimplifyOptions, faces: usize) -> Goal {
    let stop = &options.stop;
    let by_ratio = stop.ratio.map(|r| share(r, faces));
    // The first stop reached ends the run, so the larger count is the goal.
    let by_faces = match (stop.faces, by_ratio) {
        (Some(a), Some(b)) => Some(a.max(b)),
        (a, b) => a.or(b),
    };
    let ends = options.method_options.ends_without_stop(options.method);
    let nothing = by_faces.is_none() && stop.vertices.is_none() && stop.error.is_none() && !ends;
    Goal { faces: if nothing { Some(usize::MAX) } else { by_faces }, vertices: stop.vertices }
}
