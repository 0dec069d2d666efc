//! Construction of a progressive mesh: the run, its record, and the fit of levels.

use lodsmith_core::mesh::defects::is_zero_area;
use lodsmith_core::mesh::weld;
use lodsmith_core::{FaceId, Splits, Surface, TriMesh, VertexId, WedgeId};

use super::checkpoints::{Recorded, Weights};
use super::values::ValueFitter;
use super::{Progressive, RECORDED_METHODS, arrange};
use crate::SimplifyError;
use crate::attributes::Rows;
use crate::collapse::attributes::Attributes;
use crate::collapse::cut::may_cut;
use crate::collapse::order::{self, NONE, Ordered};
use crate::collapse::record::{InputNames, MeshCopy, Record};
use crate::collapse::store::{Facing, Store};
use crate::collapse::{Goal, StopReason};
use crate::constraints::{self, Constraints};
use crate::control::{Control, Stage, Verdict};
use crate::fit::Originals;
use crate::input::Input;
use crate::metric::{Dimension, Memoryless, Metric, NeighbourhoodMetric, Quadric, VertexMemory};
use crate::options::{Method, Placement, SimplifyOptions, TopologyPolicy};
use crate::prune;
use crate::run::{self, Run, Source, Started};
use crate::shading;

/// A recorded run of one method.
type RecordedRun = fn(&mut Run<'_, '_>, &TriMesh, &mut dyn Control) -> Result<RecordedMesh, SimplifyError>;

/// A progressive mesh, and the cost of each of its splits.
pub(super) struct RecordedMesh {
    pub(super) mesh: Progressive,
    pub(super) costs: Costs,
}

/// Costs of contractions, in an order in which they can be done.
pub(super) struct Costs {
    /// Cost of each split, from the base on: never rising.
    pub(super) of_split: Vec<f32>,
    /// Number of splits from the base on that follow all others in a scene's order of contractions, whatever
    /// they cost: they restore parts that were removed because no other collapse was left.
    pub(super) late: usize,
    /// Units of the mesh for one of the unit frame, and twice the mean area of a face there.
    unit: f64,
    mean: f64,
    dimension: Dimension,
}

impl Costs {
    /// Returns the factor that makes costs comparable with those of other meshes, for a mesh scaled by
    /// `scale`.
    pub(super) fn factor(&self, scale: f64) -> f64 {
        self.dimension.of(self.unit * scale, self.mean)
    }
}

pub(super) fn build(
    mesh: &TriMesh,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<RecordedMesh, SimplifyError> {
    options.check()?;
    constraints::check(options, mesh.vertex_count())?;
    let (walk, pass): (RecordedRun, _) = match (options.method, run::collapses(options.method)) {
        (Method::Quadric, Some(pass)) => (|run, mesh, control| record_run(Quadric, run, mesh, control), pass),
        (Method::LindstromTurk, Some(pass)) => {
            (|run, mesh, control| record_run(NeighbourhoodMetric::Volume, run, mesh, control), pass)
        }
        (Method::Melax, Some(pass)) => {
            (|run, mesh, control| record_run(NeighbourhoodMetric::Turn, run, mesh, control), pass)
        }
        (Method::ShortestEdge, Some(pass)) => {
            (|run, mesh, control| record_run(NeighbourhoodMetric::Length, run, mesh, control), pass)
        }
        (_, Some(pass)) => (|run, mesh, control| record_run(Memoryless, run, mesh, control), pass),
        (method, None) => {
            return Err(SimplifyError::NotOfMethod {
                option: "progressive",
                takers: RECORDED_METHODS,
                method,
            });
        }
    };
    if options.escalate {
        return Err(SimplifyError::NotTogether { first: "progressive", second: "escalate" });
    }
    let mut options = options.with_own_placement();
    control.stage(Stage::Prepare);
    if control.progress(0.0) == Verdict::Cancel {
        return Err(SimplifyError::Cancelled);
    }
    let lent = match options.shape_normals {
        true => {
            shading::with_shape_normals(&Input { surface: mesh.surface(), mesh: Some(mesh), joined: None })?
        }
        false => None,
    };
    let input = prepared(lent.as_ref().unwrap_or(mesh), &mut options)?;
    let surface = &input.surface;
    let mut ordered = order::order(surface);
    let has_area =
        |t: &[VertexId; 3]| ordered.is_sound(t) && !is_zero_area(t.map(|v| surface.positions().get(v)));
    if !surface.triangles().iter().any(has_area) {
        return Err(SimplifyError::NoFaces { faces: mesh.face_count() });
    }
    let stop = &options.stop;
    let counts = stop.faces.is_some() || stop.vertices.is_some() || stop.ratio.is_some();
    let goal = match counts || options.method_options.ends_without_stop(options.method) {
        true => run::goal(&options, mesh.face_count()),
        false => Goal { faces: Some(1), vertices: None },
    };
    let limit = options.stop.error.map(|e| e.in_units(ordered.diagonal));
    let care = Constraints::new(&options, &ordered, |v| input.joined(v));
    let mut run = Run {
        input: &input,
        options: &options,
        ordered: &mut ordered,
        goal,
        constraints: &care,
        pass,
        is_traced: false,
    };
    let built = walk(&mut run, mesh, control)?;
    let RecordedMesh { mesh: mut road, mut costs } = built;
    if let Some(limit) = limit {
        let level = road.level_of_error(limit);
        road = road.without_below(level);
        costs.of_split.drain(..level);
        costs.late = costs.late.saturating_sub(level);
    }
    road.to_level(road.top());
    Ok(RecordedMesh { mesh: road, costs })
}

/// Returns the input without small parts and with near vertices merged, as the options ask for.
fn prepared<'a>(mesh: &'a TriMesh, options: &mut SimplifyOptions) -> Result<Input<'a>, SimplifyError> {
    let mut input = Input { surface: mesh.surface(), mesh: Some(mesh), joined: None };
    let positions = input.surface.positions();
    let diagonal = prune::diagonal(&input.surface);
    if let Some(size) = options.prune {
        options.lengths_to_units(diagonal);
        let near = options.weld.map(|d| d.in_units(diagonal));
        let locked = options.locked.as_deref();
        let small = prune::small_parts(&input.surface, size.in_units(diagonal), near, locked);
        if small.pruned.parts > 0 {
            let (triangles, _) = prune::without_small(&input.surface, &small.is_small);
            input.surface = Surface::with_triangles(positions, triangles)?;
        }
    }
    if let Some(distance) = options.weld {
        let diagonal = positions.bounds().map_or(0.0, |b| b.diagonal());
        let near = weld::weld_within(positions, distance.in_units(diagonal));
        let (joined, _) = constraints::weld_onto_locked(&near, positions, options);
        let triangles = input.surface.triangles().iter().map(|t| t.map(|v| joined[v.index()])).collect();
        input.surface = Surface::with_triangles(positions, triangles)?;
        input.joined = Some(joined);
    }
    Ok(input)
}

/// Runs to the end and builds the progressive mesh from the record. `mesh` is the input without lent normals.
fn record_run<M: Metric>(
    metric: M,
    run: &mut Run<'_, '_>,
    mesh: &TriMesh,
    control: &mut dyn Control,
) -> Result<RecordedMesh, SimplifyError> {
    // Attribute weights are needed for the levels that are fitted; during the run those of its end are used.
    let mut goals = fitted_goals(run.input.surface.triangles().len());
    goals.push(run.goal);
    let Started { mut engine, rows, originals, is_kept, weights: weights_of_attributes, .. } =
        run.start(metric, None, true, (&goals, goals.len() - 1))?;
    let record = record(run, mesh, &engine.mesh.store, engine.mesh.values.attributes.as_ref(), rows);
    let by_place = record.names.faces.clone();
    engine.log_start(Box::new(record));
    let facings: Vec<Facing> = engine.mesh.store.v.iter().map(|x| x.facing).collect();

    control.stage(Stage::Collapse);
    let topology = run.options.topology;
    engine.mesh.constraints.keeps_parts = topology != TopologyPolicy::Free;
    if topology == TopologyPolicy::Free {
        engine.mesh.constraints.cuts_necks = true;
        engine.enable_part_removal();
    }
    let source = Source { surface: &run.input.surface, ordered: run.ordered, is_kept };
    let mut end = engine.sweep(&run.goal, &source, control);
    let in_order = engine.record.as_ref().map_or(0, |record| record.log.steps.len());
    if end == StopReason::Stuck && topology == TopologyPolicy::Relaxed {
        // As far as possible without changing the topology; from here on parts are removed and handles cut.
        control.stage(Stage::Collapse);
        engine.resume(may_cut(run.options));
        end = engine.sweep(&run.goal, &source, control);
    }
    let Some(record) = engine.record.take().filter(|_| end != StopReason::Cancel) else {
        return Err(SimplifyError::Cancelled);
    };
    let area = engine.mesh.area_of_input();
    let weights = Weights { kept: metric.squared_rms_factor() / 6.0 / area, lost: 0.25 / area };
    let counted = goals.iter().filter_map(|g| g.faces).zip(weights_of_attributes).collect();
    let values = originals.zip(engine.mesh.values.attributes.take());
    drop(engine);
    let fits = run.wants_fit(metric.cost_source());
    let dimension = metric.dimension();
    let taken = EngineData { by_place, facings, in_order, area, weights, fits, values, counted, dimension };
    build_progressive(run, mesh, *record, taken, control)
}

/// Data taken from the engine before it is dropped.
struct EngineData {
    by_place: Vec<FaceId>,
    facings: Vec<Facing>,
    /// Number of changes before the run got stuck for the first time.
    in_order: usize,
    /// Area of the input, in the unit frame.
    area: f64,
    weights: Weights,
    fits: bool,
    /// Input of the fit of values, and the attribute weights for several counts of faces.
    values: Option<(Originals, Attributes)>,
    counted: Vec<(usize, Vec<f32>)>,
    dimension: Dimension,
}

/// Returns the counts of faces for which attribute weights are computed.
fn fitted_goals(faces: usize) -> Vec<Goal> {
    let counts = std::iter::successors(Some(faces), |n| Some(n * 7 / 10)).take_while(|n| *n > 1);
    counts.map(|n| Goal { faces: Some(n), vertices: None }).collect()
}

/// Builds the progressive mesh of a record, with its checkpoints.
fn build_progressive(
    run: &mut Run<'_, '_>,
    mesh: &TriMesh,
    record: Record,
    taken: EngineData,
    control: &mut dyn Control,
) -> Result<RecordedMesh, SimplifyError> {
    let EngineData { by_place, facings, in_order, area, weights, fits, values, counted, dimension } = taken;
    let Record { copy, log, names, rows, .. } = record;
    let named = copy.vertex_of.len();
    let arranged = arrange::build_splits(mesh, copy, &log, &by_place);
    let costs = Costs {
        of_split: arranged.order.iter().rev().map(|&change| log.steps[change].key).collect(),
        late: arranged.order.iter().filter(|&&change| change >= in_order).count(),
        unit: run.ordered.frame.user_length(1.0),
        mean: 2.0 * area / by_place.len().max(1) as f64,
        dimension,
    };

    control.stage(Stage::Fit);
    let mut dresser = values.zip(rows).map(|((originals, attributes), (rows, places))| {
        let mut of_name = vec![WedgeId(u32::MAX); named];
        for (number, name) in names.wedges.iter().enumerate().filter(|n| n.1.0 != u32::MAX) {
            of_name[name.index()] = WedgeId::new(number);
        }
        let numbers = arranged.wedges.iter().map(|name| of_name[name.index()]).collect();
        ValueFitter { rows, places, originals, attributes, weights: counted, numbers }
    });
    let recorded = Recorded {
        order: &arranged.order,
        faces: &arranged.faces,
        vertices: &arranged.vertices,
        log: &log,
        origins: &names.vertices,
        morton_faces: &by_place,
        facings: &facings,
        weights,
        fits,
    };
    let mut road = Progressive::new(Splits::new(arranged.data).expect("a record names what is there"));
    let checkpoints = recorded.checkpoints(run, &mut road, dresser.as_mut(), control)?;
    let mut data = road.into_splits().into_data();
    data.checkpoints = checkpoints;
    let road = Progressive::new(Splits::new(data).expect("checkpoints of levels that are there"));
    Ok(RecordedMesh { mesh: road, costs })
}

/// Starts a record with the input as the engine has it.
fn record<Q: VertexMemory>(
    run: &Run<'_, '_>,
    mesh: &TriMesh,
    store: &Store<Q>,
    attributes: Option<&Attributes>,
    rows: Option<Rows>,
) -> Record {
    let (names, home) = names(run, store, attributes, rows.as_ref());
    let layout = arrange::layout(mesh);
    let copy = MeshCopy {
        faces: mesh.triangles().to_vec(),
        vertex_of: (0..mesh.wedge_count()).map(|w| mesh.vertex_of(WedgeId::new(w))).collect(),
        width: layout.width(),
        rows: arrange::rows(mesh),
        positions: mesh.positions().clone(),
    };
    let rows = rows.map(|rows| {
        let places = rows.offsets(&layout);
        (rows, places)
    });
    Record::new(names, copy, run.ordered.frame, rows, home)
}

/// Returns the names in the input of the engine's elements and, if wedges keep their own numbers, the vertex
/// of each wedge.
fn names<Q: VertexMemory>(
    run: &Run<'_, '_>,
    store: &Store<Q>,
    attributes: Option<&Attributes>,
    rows: Option<&Rows>,
) -> (InputNames, Vec<VertexId>) {
    let ordered: &Ordered = run.ordered;
    let vertices = ordered.first_vertices();
    let faces = ordered.of_faces(&run.input.surface, FaceId::new);
    let has_wedges = store.wedges.is_some();
    let keeps_wedges = has_wedges && run.options.placement == Placement::Endpoint;
    let (mut wedges, mut home) = (Vec::new(), Vec::new());
    let Some(mesh) = run.input.mesh else {
        return (InputNames { vertices, wedges, faces, has_wedges, keeps_wedges }, home);
    };
    let place = |w: WedgeId| run.place(mesh, w);
    if keeps_wedges {
        let at = |p: VertexId| if p == NONE { NONE } else { vertices[p.index()] };
        home.extend((0..mesh.wedge_count()).map(|w| at(place(WedgeId::new(w)))));
    } else {
        let count = attributes.filter(|_| has_wedges).map_or(vertices.len(), Attributes::count);
        wedges = vec![WedgeId(u32::MAX); count];
        for &w in mesh.triangles().iter().flatten().filter(|w| place(**w) != NONE) {
            let own = match rows.filter(|_| has_wedges) {
                Some(rows) => rows.wedge_rows[w.index()].index(),
                None => place(w).index(),
            };
            if wedges[own].0 == u32::MAX {
                wedges[own] = w;
            }
        }
    }
    (InputNames { vertices, wedges, faces, has_wedges, keeps_wedges }, home)
}
