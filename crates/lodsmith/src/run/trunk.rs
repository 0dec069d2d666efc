//! A running engine: started once, swept to one goal or to several; a result can be built at each of them.

use std::rc::Rc;

use glam::Vec3;
use lodsmith_core::mesh::weld;
use lodsmith_core::spatial::Bvh;
use lodsmith_core::{TriMesh, VertexId};

use super::context::{EngineOutcome, KeptAtCost, RelaxedRules, Run, RunOutcome, TopologyChanges, Trace};
use super::start::{Root, pairs_reach};
use crate::SimplifyError;
use crate::attributes::normals::{self, Homes};
use crate::collapse::cut::may_cut;
use crate::collapse::kind::Kind;
use crate::collapse::order::NONE;
use crate::collapse::ordered_input::{KeptInput, OriginalInput};
use crate::collapse::snapshot::Snapshot;
use crate::collapse::store::Store;
use crate::collapse::{Engine, Goal, LiveMesh, Pause, StopReason, Sweeps};
use crate::control::{Control, Stage, Verdict};
use crate::cost::guard::Rules;
use crate::cost::metric::{Metric, VertexMemory};
use crate::fit::{self, MoveGuards};
use crate::options::TopologyPolicy;

/// Maximum number of faces of removed parts whose distance to the result is measured. (Guessed: the RMS is
/// then known to a few percent.)
const MAX_REMOVED_SAMPLES: usize = 2000;

/// An engine, the state of its sweeps, and the data that each result needs.
pub(super) struct Trunk<M: Metric> {
    pub(super) engine: Engine<M>,
    /// State of sweeps that can be resumed; `None` before they begin.
    pub(super) sweeps: Option<Sweeps>,
    pub(super) root: Rc<Root>,
}

impl<M: Metric> Trunk<M> {
    /// Returns a copy that continues exactly like this one.
    pub(super) fn branch(&self) -> Self {
        Self { engine: self.engine.branch(), sweeps: self.sweeps.clone(), root: Rc::clone(&self.root) }
    }

    /// Takes a snapshot of an engine whose sweeps began.
    pub(super) fn snapshot(&mut self) -> Option<Snapshot<M>> {
        Some(self.engine.snapshot(self.sweeps.as_ref()?))
    }
}

impl Run<'_, '_> {
    /// Prepares the engine. `goals` are the goals of a chain, if it is one, and `level` is the first one to
    /// sweep to.
    pub(super) fn begin<M: Metric>(
        &mut self,
        metric: M,
        changes: TopologyChanges,
        (goals, level): (&[Goal], usize),
        control: &mut dyn Control,
    ) -> Trunk<M> {
        control.stage(Stage::Prepare);
        let (mut engine, mut root) = self.start(metric, false, (goals, level));
        control.stage(Stage::Collapse);
        if changes.parts {
            engine.mesh.constraints.cuts_necks = changes.cuts;
            engine.enable_part_removal();
        }
        if changes.seams {
            engine.mesh.loosen_seams();
        }
        root.changes = changes;
        Trunk { engine, sweeps: None, root: Rc::new(root) }
    }

    /// Begins sweeps to a goal, or resumes them, until they end or pause (`None`).
    pub(super) fn resume<M: Metric>(
        &self,
        trunk: &mut Trunk<M>,
        goal: &Goal,
        pause: Pause,
        control: &mut dyn Control,
    ) -> Result<Option<StopReason>, SimplifyError> {
        let sweeps = trunk.sweeps.get_or_insert_with(|| trunk.engine.begin_sweeps(goal));
        let end = trunk.engine.resume_sweeps(sweeps, goal, pause, &self.source(&trunk.root), control);
        if end == Some(StopReason::Cancel) { Err(SimplifyError::Cancelled) } else { Ok(end) }
    }

    /// Begins sweeps to a goal, or resumes them, until they end, unless they `ended` already. Then finishes the
    /// store; later sweeps begin again.
    pub(super) fn sweep<M: Metric>(
        &self,
        trunk: &mut Trunk<M>,
        ended: Option<StopReason>,
        goal: &Goal,
        control: &mut dyn Control,
    ) -> Result<StopReason, SimplifyError> {
        let end = match ended {
            None => self.resume(trunk, goal, Pause::Never, control)?,
            ended => ended,
        };
        trunk.sweeps = None;
        trunk.engine.mesh.store.finish();
        Ok(end.unwrap_or(StopReason::Stuck))
    }

    pub(super) fn source(&self, root: &Root) -> OriginalInput<'_> {
        self.input_in_order(root.is_kept)
    }

    /// Builds the result of a trunk that was swept to its end, which cannot be swept further afterwards: computes proposals
    /// if requested, and fits.
    pub(super) fn finish<M: Metric>(
        &self,
        trunk: &mut Trunk<M>,
        end: StopReason,
        proposes: bool,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        self.completed(self.finish_shape(trunk, end, proposes, control)?)
    }

    /// [`Self::finish`], but attributes that depend on a look at the input are left to [`Run::completed`]: a
    /// comparison of results does not need them.
    pub(super) fn finish_shape<M: Metric>(
        &self,
        trunk: &mut Trunk<M>,
        end: StopReason,
        proposes: bool,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        let (engine, root) = (&mut trunk.engine, &*trunk.root);
        let frame = self.ordered.frame;
        let proposals = match proposes {
            true => engine.proposals(
                self.options,
                self.constraints.locked().is_some(),
                |o| Rules::new(o, frame, self.ordered.diagonal),
                |d| pairs_reach(d, frame, self.ordered.diagonal),
            ),
            false => Vec::new(),
        };
        let may_relax = self.options.topology == TopologyPolicy::Relaxed;
        let may_cut = may_cut(self.options);
        let kept = KeptAtCost {
            seams: engine.has_blocking_seams(),
            parts: may_relax && engine.has_blocking_parts(may_cut),
            necks: may_relax && may_cut && engine.has_blocking_necks(),
        };
        let mut fitted = None;
        let wants_fit = self.wants_fit(engine.mesh.cost.metric.cost_source()) && engine.tally.collapses > 0;
        let normals = root.rows.as_ref().filter(|_| !self.input.keeps_blended_normals);
        let repairs_normals = normals.is_some_and(|rows| rows.normals_at().is_some());
        let home = (wants_fit || repairs_normals).then(|| {
            // Later steps need the final vertices only for the trace, or to separate touching vertices.
            let is_last = !self.is_traced && engine.tally.necks_cut == 0;
            if is_last { engine.mesh.store.take_homes() } else { engine.mesh.store.homes() }
        });
        if let Some(home) = home.as_deref().filter(|_| wants_fit) {
            control.stage(Stage::Fit);
            if control.progress(0.0) == Verdict::Cancel {
                return Err(SimplifyError::Cancelled);
            }
            let away = engine.estimate(None, None);
            fitted = Some(self.fit(&mut engine.mesh, root, home, away));
        }
        let mesh = self.finished_mesh(engine, root, home.as_deref())?;
        let held = self.held(&engine.mesh.store, root.rows.as_ref());
        let missing = self.missing_attributes(engine, root, &held);
        let removed = (engine.tally.parts_removed > 0).then(|| {
            let homes = home.unwrap_or_else(|| engine.mesh.store.homes());
            self.removed_distance_sq(&mesh, root, &homes)
        });
        let trace = self.is_traced.then(|| Trace {
            changes: root.changes,
            origins: engine.mesh.store.v.iter().map(|x| x.origin).collect(),
            places: engine.mesh.store.v.iter().map(|x| engine.mesh.store.place_of(x.origin)).collect(),
            homes: engine.mesh.store.homes(),
        });
        let has_touching_vertices =
            may_relax && engine.tally.necks_cut > 0 && weld::weld(mesh.positions().view()).merged_count() > 0;
        Ok(RunOutcome {
            mesh,
            held,
            end,
            estimate: frame.user_length(engine.estimate(fitted, removed)),
            tally: engine.tally.clone(),
            duplicate_faces: root.duplicate_faces,
            relaxed: RelaxedRules {
                seams: engine.mesh.has_relaxed_seams(),
                sharp_edges: engine.mesh.has_relaxed_creases(),
            },
            engine: EngineOutcome {
                fitted: wants_fit,
                kept,
                is_unproductive: engine.is_unproductive(),
                has_touching_vertices,
                proposals,
                missing,
                trace: trace.filter(|t| t.origins.len() == engine.mesh.store.v.len()),
            },
        })
    }

    /// Returns twice the integral of the squared distance between the result and the parts of the input that
    /// were removed, in the unit frame, from samples. `homes` has for each vertex of the ordered input the
    /// vertex of the result that it was merged into. Cost: a tree of the result.
    fn removed_distance_sq(&self, mesh: &TriMesh, root: &Root, homes: &[VertexId]) -> f64 {
        let frame = self.ordered.frame;
        let tree = Bvh::new(&mesh.surface());
        self.source(root).visit(|points, faces| {
            let is_removed = |t: &&[VertexId; 3]| t.iter().all(|v| homes[v.index()] == NONE);
            let count = faces.iter().filter(is_removed).count();
            let stride = count.div_ceil(MAX_REMOVED_SAMPLES).max(1);
            let sample = |t: &[VertexId; 3]| {
                let [a, b, c] = t.map(|v| points[v.index()].as_dvec3());
                let hit = tree.closest(frame.user_from_unit((a + b + c) / 3.0));
                let distance = hit.map_or(0.0, |hit| frame.unit_length(hit.distance));
                stride as f64 * (b - a).cross(c - a).length() * distance * distance
            };
            faces.iter().filter(is_removed).step_by(stride).map(sample).sum()
        })
    }

    /// Builds the mesh of a fitted engine. `home` has the vertex that each vertex of the ordered input became,
    /// if normals are to be repaired.
    fn finished_mesh<M: Metric>(
        &self,
        engine: &mut Engine<M>,
        root: &Root,
        home: Option<&[VertexId]>,
    ) -> Result<TriMesh, SimplifyError> {
        if engine.tally.necks_cut > 0 && self.options.topology == TopologyPolicy::Relaxed {
            engine.mesh.separate_touching();
        }
        let rows = root.rows.as_ref();
        if !self.input.keeps_blended_normals
            && let (Some(attributes), Some(rows), Some(input), Some(home)) =
                (&mut engine.mesh.values.attributes, rows, self.input.mesh, home)
        {
            let homes = Homes { place: |w| self.place(input, w), home };
            normals::repair(&mut engine.mesh.store, attributes, rows, input, &homes);
        }
        self.result(&engine.mesh.store, engine.mesh.values.attributes.as_ref(), rows)
    }

    /// Runs the fit, including values if the run has any. Returns the remaining RMS distance, in the unit
    /// frame. `away` is its estimate from the costs: too large by about 1.8, as measured on eight models at
    /// 50 to 1 %.
    fn fit<M: Metric>(&self, mesh: &mut LiveMesh<M>, root: &Root, home: &[VertexId], away: f64) -> f64 {
        for _ in 1..self.fits {
            self.fit_positions(mesh, root, home, away, None);
        }
        let mut attributes = mesh.values.attributes.take();
        let store = &mesh.store;
        let mut values = match (&root.originals, &mut attributes, &store.wedges) {
            (Some(originals), Some(attributes), Some(wedges)) => {
                Some(fit::Values::new(originals, attributes, wedges.clone(), away))
            }
            _ => None,
        };
        let before = values.is_some().then(|| places(store));
        let fitted = self.fit_positions(mesh, root, home, away, values.as_mut());
        if let (Some(values), Some(before)) = (values, before) {
            let store = &mesh.store;
            values.solve(|face, k| {
                let v = store.t[face][k];
                let x = &store.v[v.index()];
                (!x.kind.is_locked()).then(|| x.p - before[v.index()].0)
            });
        }
        mesh.values.attributes = attributes;
        fitted.rms
    }

    /// Moves the vertices once, as far as a limit allows, and passes the samples to `values`, if given.
    fn fit_positions<M: Metric>(
        &self,
        mesh: &mut LiveMesh<M>,
        root: &Root,
        home: &[VertexId],
        away: f64,
        values: Option<&mut fit::Values<'_>>,
    ) -> fit::Fitted {
        let store = &mut mesh.store;
        let before = mesh.bounded.is_some().then(|| places(store));
        let guards =
            MoveGuards::new(&Rules::new(self.options, self.ordered.frame, self.ordered.diagonal), store);
        let guards = guards.as_ref();
        let original = self.source(root);
        let fitted = match original.looked_up(store.t.len()) {
            Some(mut given) => fit::fit(store, &mut given, home, away, values, guards, M::tensor),
            None => original.visit(|points, faces| {
                let mut kept = KeptInput { points, faces };
                fit::fit(store, &mut kept, home, away, values, guards, M::tensor)
            }),
        };
        if let Some(before) = before {
            mesh.hold_back(&before);
        }
        fitted
    }
}

/// Returns the positions and kinds of all vertices.
fn places<Q: VertexMemory>(store: &Store<Q>) -> Vec<(Vec3, Kind)> {
    store.v.iter().map(|x| (x.p, x.kind)).collect()
}
