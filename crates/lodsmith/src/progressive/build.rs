//! Construction of a progressive mesh: the run, its record, and the fit of levels.

use lodsmith_core::{FaceId, Splits, TriMesh, VertexId, WedgeId};

use super::checkpoints::{Recorded, Weights};
use super::values::ValueFitter;
use super::{Progressive, arrange};
use crate::SimplifyError;
use crate::attributes::Rows;
use crate::collapse::Goal;
use crate::collapse::attributes::Attributes;
use crate::collapse::order::{NONE, Ordered};
use crate::collapse::record::{InputNames, MeshCopy, Record};
use crate::collapse::store::Store;
use crate::collapse::vertex::Facing;
use crate::constraints::{self, Constraints};
use crate::control::{Control, Stage};
use crate::cost::metric::{Dimension, Metric, VertexMemory, with_metric};
use crate::fit::Originals;
use crate::input::Input;
use crate::options::shared::COLLAPSE_METHODS;
use crate::options::{Effort, Placement, SimplifyOptions, Stop};
use crate::pipeline::prepare::{Prepared, temporary_normals};
use crate::run::{self, Root, Run};
use crate::two_sided::TwoSidedInput;

/// A recorded run of one method.
type RecordedRun = fn(&mut Run<'_, '_>, &TriMesh, &mut dyn Control) -> Result<RecordedMesh, SimplifyError>;

/// A progressive mesh, and the cost of each of its splits.
pub(super) struct RecordedMesh {
    pub(super) mesh: Progressive,
    pub(super) costs: Costs,
}

/// Costs of contractions, in an order in which they can be done.
pub(super) struct Costs {
    /// Cost of each split, starting at the base; never rising.
    pub(super) of_split: Vec<f32>,
    /// Number of splits from the base on that follow all others in a scene's order of contractions, whatever
    /// they cost: they restore parts that were removed because no other collapse was left.
    pub(super) late: usize,
    /// Length in the mesh of one unit of the unit frame, and twice the mean area of a face in the unit frame.
    unit: f64,
    mean: f64,
    dimension: Dimension,
}

impl Costs {
    /// Returns the factor that makes costs comparable with the costs of other meshes, for a mesh scaled by
    /// `scale`.
    pub(super) fn factor(&self, scale: f64) -> f64 {
        self.dimension.of(self.unit * scale, self.mean)
    }
}

impl Progressive {
    /// Records the simplification of a mesh down to its stops or, without any, as far as possible. The result
    /// is at the level of the full mesh.
    ///
    /// A stop at an error refers to the [estimate](Self::error). Methods that build a new mesh in one step
    /// cannot be recorded. Cost: three to eight times the time of a full run of
    /// [`simplify`](crate::simplify()) (docs/progressive.md).
    ///
    /// # Errors
    /// Those of [`simplify`](crate::simplify()); [`SimplifyError::NotOfMethod`] for a method without
    /// contractions, [`SimplifyError::NotTogether`] with [`SimplifyOptions::escalate`] or [`Effort::Best`].
    pub fn build<'a>(
        input: impl Into<Input<'a>>,
        options: &SimplifyOptions,
        control: &mut dyn Control,
    ) -> Result<Self, SimplifyError> {
        build(&input.into(), options, control).map(|built| built.mesh)
    }
}

pub(super) fn build(
    whole: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<RecordedMesh, SimplifyError> {
    if whole.data.error_map.is_some() {
        return Err(SimplifyError::NotTogether { first: "progressive", second: "error-map" });
    }
    options.check(&whole.data)?;
    constraints::check(&whole.data, whole.surface.positions().len())?;
    let method = options.method.kind();
    let walk: Option<RecordedRun> =
        with_metric!(method, METRIC => |run, mesh, control| record_run(METRIC, run, mesh, control));
    let (Some(walk), Some(pass)) = (walk, run::collapses(method)) else {
        return Err(SimplifyError::NotOfMethod { option: "progressive", takers: COLLAPSE_METHODS, method });
    };
    if options.escalate {
        return Err(SimplifyError::NotTogether { first: "progressive", second: "escalate" });
    }
    if options.effort == Effort::Best {
        return Err(SimplifyError::NotTogether { first: "progressive", second: "effort best" });
    }
    let options = options.with_own_placement();
    let with_normals = temporary_normals(whole, &options)?;
    let Prepared { input, options, .. } = &Prepared::new(whole, with_normals.as_ref(), None, &options)?;
    let mut ordered = run::ordered(input, control)?;
    let sheets = TwoSidedInput::find(whole, input, &ordered, options)?;
    // (Welded vertices can be restored only from a record of the whole input.)
    if let Some(sheets) = sheets.filter(|sheets| sheets.is_exact() && options.weld.is_none()) {
        drop(ordered);
        return build_both_sides(&sheets, options, control);
    }
    let stop = &options.stop;
    let counts = stop.faces.is_some() || stop.vertices.is_some() || stop.ratio.is_some();
    let has_end = counts || options.method.ends_without_stop();
    let limit = options.stop.error.map(|e| e.in_units(ordered.diagonal));
    let constraints = Constraints::new(&input.data, &ordered, |v| input.joined(v));
    let mut run = Run::new(input, options, &mut ordered, &constraints, pass);
    if !has_end {
        run.goal = Goal { faces: Some(1), vertices: None };
    }
    let mesh = whole.to_mesh()?;
    let RecordedMesh { mesh: mut recorded, mut costs } = walk(&mut run, &mesh, control)?;
    if let Some(limit) = limit {
        let level = recorded.level_of_error(limit);
        recorded = recorded.without_below(level);
        costs.of_split.drain(..level);
        costs.late = costs.late.saturating_sub(level);
    }
    recorded.to_level(recorded.top());
    Ok(RecordedMesh { mesh: recorded, costs })
}

/// Records the fronts of an input with two-sided sheets, and adds their backs to each level.
fn build_both_sides(
    sheets: &TwoSidedInput<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<RecordedMesh, SimplifyError> {
    let own = SimplifyOptions { stop: sheets.lowest_stop(&options.stop), ..options.clone() };
    let RecordedMesh { mesh, mut costs } = build(&sheets.input(), &own, control)?;
    let data = sheets.both_splits(mesh.into_splits().into_data());
    let mut mesh = Progressive::new(Splits::new(data).expect("the elements of both sides exist"));
    // The counts of both sides are known only now.
    let Stop { faces, vertices, ratio, .. } = options.stop;
    if faces.is_some() || vertices.is_some() || ratio.is_some() {
        let goal = run::goal(options, sheets.whole().face_count());
        let of_faces = goal.faces.map(|n| mesh.level_of_faces(n));
        let level = of_faces.max(goal.vertices.map(|n| mesh.level_of_vertices(n))).unwrap_or(0);
        mesh = mesh.without_below(level);
        costs.of_split.drain(..level);
        costs.late = costs.late.saturating_sub(level);
    }
    mesh.to_level(mesh.top());
    Ok(RecordedMesh { mesh, costs })
}

/// Runs to the end and builds the progressive mesh from the record. `mesh` is the input without temporary
/// normals.
fn record_run<M: Metric>(
    metric: M,
    run: &mut Run<'_, '_>,
    mesh: &TriMesh,
    control: &mut dyn Control,
) -> Result<RecordedMesh, SimplifyError> {
    // Attribute weights are needed for each fitted level; the run itself uses the weights of its end.
    let mut goals = fitted_goals(run.input.surface.triangles().len());
    goals.push(run.goal);
    let (mut engine, root) = run.start(metric, true, (&goals, goals.len() - 1));
    let Root { rows, originals, is_kept, weights: weights_of_attributes, .. } = root;
    let record = record(run, mesh, &engine.mesh.store, engine.mesh.values.attributes.as_ref(), rows);
    let by_place = record.names.faces.clone();
    let facings: Vec<Facing> = engine.mesh.store.v.iter().map(|x| x.facing).collect();
    let (record, in_order) = run.sweep_recorded(&mut engine, record, is_kept, control)?;
    let area = engine.mesh.area_of_input();
    let weights = Weights { kept: metric.squared_rms_factor() / 6.0 / area, lost: 0.25 / area };
    let counted = goals.iter().filter_map(|g| g.faces).zip(weights_of_attributes).collect();
    let values = originals.zip(engine.mesh.values.attributes.take());
    drop(engine);
    let fits = run.wants_fit(metric.cost_source());
    let dimension = metric.dimension();
    let taken = EngineData { by_place, facings, in_order, area, weights, fits, values, counted, dimension };
    build_progressive(run, mesh, record, taken, control)
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
    let (named, has_values) = (copy.vertex_of.len(), copy.width > 0);
    let arranged = arrange::build_splits(mesh, copy, &log, &by_place);
    let costs = Costs {
        of_split: arranged.order.iter().rev().map(|&change| log.steps[change].key).collect(),
        late: arranged.order.iter().filter(|&&change| change >= in_order).count(),
        unit: run.ordered.frame.user_length(1.0),
        mean: 2.0 * area / by_place.len().max(1) as f64,
        dimension,
    };

    control.stage(Stage::Fit);
    let values = values.filter(|_| has_values);
    let mut value_fitter = values.zip(rows).map(|((originals, attributes), (rows, places))| {
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
    let mut progressive =
        Progressive::new(Splits::new(arranged.data).expect("the elements of a record exist"));
    let checkpoints = recorded.checkpoints(run, &mut progressive, value_fitter.as_mut(), control)?;
    let mut data = progressive.into_splits().into_data();
    data.checkpoints = checkpoints;
    let progressive = Progressive::new(Splits::new(data).expect("the levels of the checkpoints exist"));
    Ok(RecordedMesh { mesh: progressive, costs })
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

/// Returns the input numbers of the engine's elements and, if wedges keep their own numbers, the vertex of
/// each wedge.
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

#[cfg(test)]
mod tests {
    use lodsmith_core::{Positions, shapes};

    use super::*;
    use crate::control::NoControl;
    use crate::options::{Length, MethodKind, Stop};
    use crate::test_support::{octahedron, tetrahedron};

    #[test]
    fn weights_are_computed_at_counts_that_fall_by_a_third() {
        let counts = |n: usize| fitted_goals(n).iter().filter_map(|g| g.faces).collect::<Vec<_>>();
        assert_eq!(counts(10), [10, 7, 4, 2]);
        assert!(counts(1).is_empty());
    }

    #[test]
    fn costs_never_rise_from_the_base_and_part_removals_come_last() {
        let two = octahedron().and(&tetrahedron(), glam::Vec3::X * 3.0);
        let options = SimplifyOptions::default();
        let RecordedMesh { mesh, costs } =
            build(&Input::new(&two.mesh()), &options, &mut NoControl).expect("two parts");
        assert_eq!(costs.of_split.len(), mesh.top());
        assert!(costs.of_split.is_sorted_by(|a, b| a >= b), "{:?}", costs.of_split);
        // At the end, when no collapse is left, one of the two parts is removed.
        assert!(costs.late > 0 && costs.late < mesh.top(), "{} of {}", costs.late, mesh.top());
        // A cost is an area times a squared distance.
        assert!((costs.factor(2.0) / costs.factor(1.0) - 16.0).abs() < 1e-9);
    }

    #[test]
    fn a_stop_at_an_error_makes_its_level_the_base() {
        let mesh = shapes::icosphere(2);
        let whole = build(&Input::new(&mesh), &SimplifyOptions::default(), &mut NoControl).expect("a sphere");
        let limit = 0.5 * whole.mesh.splits().checkpoints[0].error;
        let options = SimplifyOptions::new(Stop::error(Length::Units(limit)));
        let part = build(&Input::new(&mesh), &options, &mut NoControl).expect("a sphere");
        let gone = whole.mesh.top() - part.mesh.top();
        assert_eq!(gone, whole.mesh.level_of_error(limit));
        assert!(gone > 0);
        assert_eq!(part.costs.of_split, whole.costs.of_split[gone..]);
        assert_eq!(part.mesh.mesh().expect("a mesh"), mesh);
    }

    #[test]
    fn options_that_cannot_be_recorded_are_rejected() {
        let run = |set: &dyn Fn(&mut SimplifyOptions), mesh: &TriMesh| {
            let mut options = SimplifyOptions::default();
            set(&mut options);
            build(&Input::new(mesh), &options, &mut NoControl).err()
        };
        let sphere = shapes::icosphere(1);
        let method = run(&|o| o.method = MethodKind::Remesh.into(), &sphere);
        assert!(
            matches!(method, Some(SimplifyError::NotOfMethod { option: "progressive", .. })),
            "{method:?}"
        );
        let twice = run(&|o| o.escalate = true, &sphere);
        assert!(matches!(twice, Some(SimplifyError::NotTogether { second: "escalate", .. })), "{twice:?}");
        let best = run(&|o| o.effort = Effort::Best, &sphere);
        assert!(matches!(best, Some(SimplifyError::NotTogether { second: "effort best", .. })), "{best:?}");
        let (shares, within) =
            (vec![0.5; sphere.vertex_count()], SimplifyOptions::new(Stop::error(Length::OfDiagonal(0.1))));
        let mapped = build(&Input::new(&sphere).error_map(&shares), &within, &mut NoControl).err();
        assert!(matches!(mapped, Some(SimplifyError::NotTogether { second: "error-map", .. })), "{mapped:?}");
        let flat =
            TriMesh::new(Positions::F32(vec![[0.0; 3]; 3]), vec![[0, 1, 2].map(VertexId)]).expect("a mesh");
        assert!(matches!(run(&|_| (), &flat), Some(SimplifyError::NoFaces { faces: 1 })));
    }
}
