//! Common part of the methods that construct a new surface instead of collapsing edges: input, and conversion
//! of the result.

pub(crate) mod cluster;
mod distinct;
pub(crate) mod planar;
pub mod remesh;
pub(crate) mod task;
pub(crate) mod transfer;
mod unsubdivide;
mod vertex_removal;

use lodsmith_core::spatial::Bvh;
use lodsmith_core::{Positions, PositionsView, Surface, VertexId};

use crate::SimplifyError;
use crate::attributes::recolor;
use crate::collapse::order::NONE;
use crate::collapse::{Goal, StopReason, Tally};
use crate::control::{Control, Stage, Verdict};
use crate::options::Method;
use crate::run::{EngineOutcome, RelaxedRules, Run, RunOutcome};
use task::{Ending, PreparedInput, RebuiltSurface, Task};
use transfer::with_transferred_attributes;

/// Runs the options' method once, to a goal.
pub(crate) fn rebuild(
    run: &mut Run<'_, '_>,
    goal: Goal,
    control: &mut dyn Control,
) -> Result<RunOutcome, SimplifyError> {
    control.stage(Stage::Prepare);
    let prepared = prepared_input(run);
    control.stage(Stage::Collapse);
    match control.progress(0.0) {
        Verdict::Continue => {}
        Verdict::Finish => return outcome(run, &prepared, untouched(&prepared)),
        Verdict::Cancel => return Err(SimplifyError::Cancelled),
    }
    let step = run.step.map(|s| prepared.frame.unit_length(s));
    let task = Task { input: &prepared, mesh: run.input.mesh, options: run.options, goal, step };
    let made = match run.options.method {
        Method::VertexRemoval { .. } => vertex_removal::make(&task, control)?,
        Method::Planar { .. } => planar::make(&task, control)?,
        Method::Unsubdivide { .. } => unsubdivide::make(&task, control)?,
        Method::Remesh(_) => remesh::make(&task, control)?,
        other => unreachable!("{other:?} collapses"),
    };
    outcome(run, &prepared, made)
}

fn prepared_input(run: &Run<'_, '_>) -> PreparedInput {
    let locked = run.constraints.locked().map(<[bool]>::to_vec);
    PreparedInput {
        locked,
        cost_factors: run.constraints.cost_factors(),
        ..PreparedInput::of(run.input, run.ordered)
    }
}

/// Returns the input unchanged, as the best result before the first step.
fn untouched(prepared: &PreparedInput) -> RebuiltSurface {
    let mut number = vec![NONE; prepared.points.len()];
    let mut made = RebuiltSurface { end: Ending::Finish, estimate: Some(0.0), ..RebuiltSurface::default() };
    for &v in prepared.faces.as_flattened() {
        if number[v.index()] == NONE {
            number[v.index()] = VertexId::new(made.points.len());
            made.points.push(prepared.points[v.index()]);
            made.kept.push(v);
        }
    }
    made.faces = prepared.faces.iter().map(|t| t.map(|v| number[v.index()])).collect();
    made
}

fn outcome(
    run: &Run<'_, '_>,
    prepared: &PreparedInput,
    made: RebuiltSurface,
) -> Result<RunOutcome, SimplifyError> {
    let positions = run.input.surface.positions();
    let place = |i: usize| match made.kept[i] {
        NONE => prepared.frame.user_from_unit(made.points[i]),
        kept => positions.get(prepared.first[kept.index()]),
    };
    let places = (0..made.points.len()).map(place);
    let positions = match positions {
        PositionsView::F32(_) => Positions::F32(places.map(|p| p.map(|x| x as f32)).collect()),
        PositionsView::F64(_) => Positions::F64(places.collect()),
    };
    let estimate = made.estimate.unwrap_or_else(|| estimate(prepared, &made));
    let end = match made.end {
        Ending::Goal => StopReason::Goal,
        Ending::Exhausted => StopReason::Exhausted,
        Ending::Stuck => StopReason::Stuck,
        Ending::Finish => StopReason::Finish,
    };
    let (mesh, held) = with_transferred_attributes(run.input, run.ordered, prepared, &made, positions, None)?;
    let mesh = recolor::recolored(mesh, run.input, &held, None)?;
    let mut tally = Tally::default();
    (tally.refusals, tally.collapses) = (made.refusals, made.steps);
    (tally.parts_removed, tally.necks_cut) = (made.parts_removed, made.necks_cut);
    Ok(RunOutcome {
        mesh,
        held,
        end,
        estimate: prepared.frame.user_length(estimate),
        tally,
        duplicate_faces: prepared.duplicate_faces,
        relaxed: RelaxedRules { seams: made.seams_relaxed, ..RelaxedRules::default() },
        engine: EngineOutcome::default(),
    })
}

/// Maximum number of input vertices sampled for an estimate.
const MAX_ESTIMATE_SAMPLES: usize = 2000;

/// RMS distance of sampled input vertices from the result, in the unit frame.
fn estimate(prepared: &PreparedInput, made: &RebuiltSurface) -> f64 {
    let points: Vec<[f64; 3]> = made.points.iter().map(|p| p.to_array()).collect();
    let Ok(surface) = Surface::new(PositionsView::F64(&points), bytemuck::cast_slice(&made.faces)) else {
        return 0.0;
    };
    let tree = Bvh::new(&surface);
    let stride = prepared.points.len().div_ceil(MAX_ESTIMATE_SAMPLES).max(1);
    let hits: Vec<f64> = prepared
        .points
        .iter()
        .step_by(stride)
        .filter_map(|p| tree.closest(p.to_array()))
        .map(|h| h.distance)
        .collect();
    (hits.iter().map(|d| d * d).sum::<f64>() / hits.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{TriMesh, WedgeId};

    use super::*;
    use crate::control::NoControl;
    use crate::input::Input;
    use crate::options::SimplifyOptions;
    use crate::run;

    const SIDE: u32 = 8;

    /// A flat square of 2 · 8 · 8 faces; its left and right halves are separate in the texture.
    fn square() -> TriMesh {
        let at = |x: u32, y: u32| VertexId(y * (SIDE + 1) + x);
        let places = (0..=SIDE).flat_map(|y| (0..=SIDE).map(move |x| [x as f32, y as f32, 0.0]));
        let positions: Vec<[f32; 3]> = places.collect();
        let (mut vertex_of, mut uvs, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        for (x, y) in (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))) {
            let quad = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            let first = vertex_of.len() as u32;
            for v in quad {
                let [u, t, _] = positions[v.index()];
                vertex_of.push(v);
                uvs.push([u + if x < SIDE / 2 { 0.0 } else { 100.0 }, t]);
            }
            triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|k| WedgeId(first + k))));
        }
        let mut mesh = TriMesh::with_wedges(Positions::F32(positions), vertex_of, triangles).unwrap();
        mesh.set_uvs(Some(uvs)).unwrap();
        mesh
    }

    fn rebuilt(mesh: &TriMesh, pass: run::Pass) -> TriMesh {
        let input = Input::new(mesh);
        let options = SimplifyOptions { measure: crate::Measure::Auto, ..SimplifyOptions::default() };
        run::run_with(pass, &input, &options, &mut NoControl).unwrap().0.mesh
    }

    /// Position and texture coordinates of each corner, by face, sorted.
    fn corner_texts(mesh: &TriMesh) -> Vec<Vec<[String; 2]>> {
        let view = mesh.positions().view();
        let uvs = mesh.uvs().unwrap();
        let corner =
            |w: &WedgeId| [format!("{:?}", view.get(mesh.vertex_of(*w))), format!("{:?}", uvs[w.index()])];
        let mut all: Vec<Vec<_>> = mesh.triangles().iter().map(|t| t.iter().map(corner).collect()).collect();
        all.iter_mut().for_each(|t: &mut Vec<[String; 2]>| t.sort());
        all.sort();
        all
    }

    #[test]
    fn an_unchanged_surface_keeps_its_attributes() {
        let mesh = square();
        let same = rebuilt(&mesh, |run, _, _| {
            let prepared = prepared_input(run);
            let kept = (0..prepared.points.len()).map(VertexId::new).collect();
            let made = RebuiltSurface {
                points: prepared.points.clone(),
                kept,
                faces: prepared.faces.clone(),
                ..RebuiltSurface::default()
            };
            outcome(run, &prepared, made)
        });
        assert_eq!(corner_texts(&same), corner_texts(&mesh));
        let middle = SIDE as usize + 1;
        assert_eq!(
            same.wedge_count(),
            same.vertex_count() + middle,
            "a vertex has two wedges on the seam, else one"
        );
    }

    #[test]
    fn new_faces_take_their_values_from_one_side() {
        // Four strips over the full height.
        let mesh = square();
        let strips = rebuilt(&mesh, |run, _, _| {
            let prepared = prepared_input(run);
            let cuts = [0.0, 2.0, 4.0, 6.0, 8.0];
            let mut made = RebuiltSurface::default();
            for x in cuts {
                for y in [0.0, 8.0] {
                    made.points.push(prepared.frame.unit_from_user([x, y, 0.0]));
                    made.kept.push(NONE);
                }
            }
            for i in (0..8).step_by(2) {
                made.faces.extend([[i, i + 2, i + 3], [i, i + 3, i + 1]].map(|t| t.map(VertexId)));
            }
            outcome(run, &prepared, made)
        });
        let (view, uvs) = (strips.positions().view(), strips.uvs().unwrap());
        for t in strips.triangles() {
            let right = t.iter().all(|w| view.get(strips.vertex_of(*w))[0] >= 4.0);
            for w in t {
                let p = view.get(strips.vertex_of(*w));
                let wanted = [p[0] as f32 + if right { 100.0 } else { 0.0 }, p[1] as f32];
                assert!(
                    (0..2).all(|k| (uvs[w.index()][k] - wanted[k]).abs() < 1e-4),
                    "{p:?}: {:?}",
                    uvs[w.index()]
                );
            }
        }
        assert_eq!(strips.wedge_count(), 12, "vertices on the seam have two wedges");

        let whole = rebuilt(&mesh, |run, _, _| {
            let prepared = prepared_input(run);
            let places = [[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0]];
            let points = places.map(|p| prepared.frame.unit_from_user(p)).to_vec();
            let faces = vec![[0, 1, 2].map(VertexId)];
            outcome(
                run,
                &prepared,
                RebuiltSurface { points, kept: vec![NONE; 3], faces, ..RebuiltSurface::default() },
            )
        });
        let uvs = whole.uvs().unwrap();
        assert!(uvs.iter().all(|uv| uv[0] < 50.0), "a face over a seam is on one side of it: {uvs:?}");
    }
}
