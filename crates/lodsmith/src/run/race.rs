//! The runs that compete for a goal.
//!
//! ```text
//! run      topology changes in order of cost        competes
//! first    none; with topology `free` removal       always; with topology `relaxed` only if it removed no parts
//! removal  parts are removed, and necks are cut     topology is `relaxed`; the target is out of reach, or parts or necks
//!                                                   were kept at a cost
//! seams    those of removal, if it competes or       seams refused collapses in a run before, until they gave way or
//!          there are several parts; and seams move  at a high cost
//! ```
//!
//! With topology `relaxed`, a snapshot is taken when parts or handles start to block the first run, and the
//! others start from there. The collapses before it had lower costs, so the order is nearly preserved. The
//! result is the outcome that is closest by measurement.

use super::context::{Run, RunOutcome, TopologyChanges};
use super::trunk::Trunk;
use crate::SimplifyError;
use crate::collapse::cut::may_cut;
use crate::collapse::snapshot::Snapshot;
use crate::collapse::{Goal, Pause, StopReason};
use crate::control::{Control, Stage, has_time_for};
use crate::cost::metric::Metric;
use crate::options::TopologyPolicy;
use crate::report::Refusal;

/// Faces of an alternative result, relative to the lightest one, if the target is out of reach. (A level of
/// 1,194 parts that ends at 6,249 faces is 2.0 % off there, and .2 % off with 15 % more faces.)
const NEARLY_REACHED_FACTOR: f64 = 1.15;

/// Makes an outcome; if vertices that a cut separated touch in it, makes one without cuts instead.
pub(super) fn without_touching(
    changes: &mut TopologyChanges,
    mut make: impl FnMut(TopologyChanges) -> Result<RunOutcome, SimplifyError>,
) -> Result<RunOutcome, SimplifyError> {
    let outcome = make(*changes)?;
    if !outcome.engine.has_touching_vertices || outcome.end == StopReason::Finish {
        return Ok(outcome);
    }
    changes.cuts = false;
    make(*changes)
}

impl Run<'_, '_> {
    /// Runs the engine to a goal. Returns the best of the competing outcomes; if the goal is out of reach,
    /// perhaps a heavier one.
    pub(super) fn one_pass<M: Metric>(
        &mut self,
        metric: M,
        goal: Goal,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        let lightest = self.race(metric, &goal, control)?;
        let near = (lightest.mesh.face_count() as f64 * NEARLY_REACHED_FACTOR) as usize;
        let is_short = self.is_relaxed(&goal) && lightest.end == StopReason::Stuck && !lightest.keeps_all();
        let has_other = is_short && near > lightest.mesh.face_count() + 1;
        if !has_other || !has_time_for(Stage::Prepare, control)? {
            return self.completed(lightest);
        }
        // The target is out of reach: the last collapses may cost far too much.
        let nearly = Goal { faces: Some(near), vertices: None };
        let other = self.race(metric, &nearly, control)?;
        self.completed(self.choose_when_unreachable(lightest, other, control)?)
    }

    /// True if parts and handles are kept as long as a goal is reached with them.
    fn is_relaxed(&self, goal: &Goal) -> bool {
        let has_alternatives = !goal.is_none() && self.options.quick.is_none();
        has_alternatives && self.options.topology == TopologyPolicy::Relaxed
    }

    /// Returns the best of the competing outcomes for a goal; its attributes are not complete.
    fn race<M: Metric>(
        &mut self,
        metric: M,
        goal: &Goal,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        let is_relaxed = self.is_relaxed(goal);
        let mut changes = TopologyChanges::from_start(self.options);
        let mut trunk = self.begin(metric, changes, (&[], 0), control);
        let mut ended = None;
        if is_relaxed {
            ended = self.resume(&mut trunk, goal, Pause::BeforeTopologyChanges, control)?;
        }
        let may_snapshot =
            is_relaxed && ended.is_none() && !trunk.engine.is_past_blocking(may_cut(self.options));
        let snapshot = if may_snapshot { trunk.snapshot() } else { None };
        let end = self.sweep(&mut trunk, ended, goal, control)?;
        let seams_refuse = trunk.engine.tally.has_refused(Refusal::Seam);
        let mut outcomes = Vec::new();
        // A run that was to keep parts, and removed some because nothing else was left, is no candidate.
        if !is_relaxed || trunk.engine.tally.parts_removed == 0 || end == StopReason::Finish {
            let is_single = goal.is_none() || self.options.quick.is_some();
            let proposes = end == StopReason::Stuck && !is_relaxed && self.options.quick.is_none();
            let first = self.finish_shape(&mut trunk, end, proposes, control)?;
            let has_rivals = match end {
                StopReason::Stuck => true,
                StopReason::Goal => first.seams_block() || first.topology_blocks(),
                StopReason::Exhausted => !is_relaxed,
                StopReason::Finish | StopReason::Cancel => false,
            };
            if is_single || !has_rivals {
                return Ok(first);
            }
            outcomes.push(first);
        }
        let has_several_parts = is_relaxed && trunk.engine.mesh.part_count() > 1;
        // Without a snapshot, the memory is freed because it is needed.
        let mut from = snapshot.map(|snapshot| (snapshot, trunk));
        let first = outcomes.first();
        let seams_block = first.map_or(seams_refuse, RunOutcome::seams_block);
        // Parts and necks may block collapses: remove and cut them in order of cost. If only seams block them, only
        // the run whose seams move does that.
        let is_blocked = first.is_none_or(|first| end == StopReason::Stuck || first.topology_blocks());
        let removes = is_relaxed && (is_blocked || has_several_parts);
        if removes {
            changes = TopologyChanges::removal(self.options);
        }
        if removes && is_blocked {
            let run = |changes| self.run_with_changes(metric, goal, changes, &mut from, control);
            outcomes.push(without_touching(&mut changes, run)?);
        }
        let is_over = outcomes.last().is_some_and(|last| last.end == StopReason::Finish);
        if !is_over && (seams_block || outcomes.iter().any(RunOutcome::seams_block)) {
            let changes = TopologyChanges { seams: true, ..changes };
            let outcome = self.run_with_changes(metric, goal, changes, &mut from, control)?;
            // (Another candidate is used if the two sides of a cut touch here.)
            outcomes.extend(Some(outcome).filter(|outcome| !outcome.engine.has_touching_vertices));
        }
        self.closest(outcomes, None, control)
    }

    /// Runs with topology changes in order of cost: from the snapshot, or from the start.
    fn run_with_changes<M: Metric>(
        &mut self,
        metric: M,
        goal: &Goal,
        changes: TopologyChanges,
        from: &mut Option<(Snapshot<M>, Trunk<M>)>,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        let mut own;
        let trunk = match from {
            Some((snapshot, trunk)) => {
                control.stage(Stage::Collapse);
                let (engine, mut sweeps) = snapshot.restored(&mut trunk.engine);
                trunk.engine = engine;
                if changes.parts {
                    trunk.engine.allow_topology_changes(&mut sweeps, changes.cuts, &self.source(&trunk.root));
                }
                if changes.seams {
                    trunk.engine.mesh.loosen_seams();
                }
                trunk.sweeps = Some(sweeps);
                trunk
            }
            None => {
                own = self.begin(metric, changes, (&[], 0), control);
                &mut own
            }
        };
        let end = self.sweep(trunk, None, goal, control)?;
        self.finish_shape(trunk, end, end == StopReason::Stuck, control)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use lodsmith_core::{Positions, TriMesh, VertexId, WedgeId, shapes};

    use super::*;
    use crate::constraints::Constraints;
    use crate::control::NoControl;
    use crate::cost::metric::Memoryless;
    use crate::input::Input;
    use crate::options::{SimplifyOptions, Stop};
    use crate::run::{collapses, ordered};

    /// Calls `act` with a run on a mesh to a number of faces.
    fn with_run(mesh: &TriMesh, faces: usize, act: &mut dyn FnMut(&mut Run<'_, '_>)) {
        let input = Input::new(mesh);
        let options = SimplifyOptions::new(Stop::faces(faces));
        let mut in_order = ordered(&input, &mut NoControl).unwrap();
        let constraints = Constraints::new(&input.data, &in_order, |v| v);
        let pass = collapses(options.method.kind()).unwrap();
        act(&mut Run::new(&input, &options, &mut in_order, &constraints, pass));
    }

    /// Four separate tori with colours.
    fn tori() -> TriMesh {
        let torus = shapes::torus(40, 16);
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for i in 0..4u32 {
            let (x, first) = (f64::from(i) * 4.0, positions.len() as u32);
            positions.extend(torus.positions().view().iter().map(|p| [p[0] + x, p[1], p[2] * (1.0 + x)]));
            triangles.extend(torus.surface().triangles().iter().map(|t| t.map(|v| VertexId(v.0 + first))));
        }
        let colors = positions.iter().map(|p| [0.5, 0.5 + 0.01 * p[0] as f32, 0.5, 1.0]).collect();
        let mut mesh = TriMesh::new(Positions::F64(positions), triangles).unwrap();
        mesh.set_colors(Some(colors)).unwrap();
        mesh
    }

    /// Two blobs whose texture has a chart for each cell of a grid of this size.
    fn blobs_with_charts(cells: f64) -> TriMesh {
        let blob = shapes::blob(4, 1);
        let points: Vec<[f64; 3]> = blob.positions().view().iter().collect();
        let (mut positions, mut vertex_of, mut triangles, mut uvs) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for x in [0.0, 4.0] {
            let first = positions.len() as u32;
            positions.extend(points.iter().map(|p| [p[0] + x, p[1], p[2]]));
            let mut wedges = HashMap::new();
            for t in blob.surface().triangles() {
                let chart = (points[t[0].index()][2] * cells).floor() as i32;
                triangles.push(t.map(|v| {
                    *wedges.entry((v, chart)).or_insert_with(|| {
                        vertex_of.push(VertexId(v.0 + first));
                        let [u, v, _] = points[v.index()].map(|x| x as f32);
                        uvs.push([u + 10.0 * chart as f32, v]);
                        WedgeId::new(uvs.len() - 1)
                    })
                }));
            }
        }
        let mut mesh = TriMesh::with_wedges(Positions::F64(positions), vertex_of, triangles).unwrap();
        mesh.set_uvs(Some(uvs)).unwrap();
        mesh
    }

    /// Counts the starts of sweeps and of comparisons.
    #[derive(Default)]
    struct StageCount {
        sweeps: usize,
        comparisons: usize,
    }

    impl Control for StageCount {
        fn stage(&mut self, stage: Stage) {
            self.sweeps += usize::from(stage == Stage::Collapse);
            self.comparisons += usize::from(stage == Stage::Measure);
        }
    }

    /// Returns a trunk paused before parts and handles must be removed, if it pauses.
    fn paused(run: &mut Run<'_, '_>, goal: &Goal) -> (Trunk<Memoryless>, Option<StopReason>) {
        let mut trunk = run.begin(Memoryless, TopologyChanges::default(), (&[], 0), &mut NoControl);
        let end = run.resume(&mut trunk, goal, Pause::BeforeTopologyChanges, &mut NoControl).unwrap();
        (trunk, end)
    }

    #[test]
    fn a_copy_always_continues_in_the_same_way() {
        let mesh = tori();
        with_run(&mesh, 60, &mut |run| {
            let goal = run.goal;
            let (mut trunk, end) = paused(run, &goal);
            assert_eq!(end, None);
            let snapshot = trunk.snapshot().unwrap();
            let mut results = Vec::new();
            for others in 0..3 {
                for _ in 0..others {
                    // Another run in between, which copies wedges.
                    let (mut other, mut its) = snapshot.restored(&mut trunk.engine);
                    other.allow_topology_changes(&mut its, true, &run.source(&trunk.root));
                    (trunk.engine, trunk.sweeps) = (other, Some(its));
                    run.resume(&mut trunk, &goal, Pause::Never, &mut NoControl).unwrap();
                    assert!(trunk.engine.tally.necks_cut > 0);
                }
                let (engine, sweeps) = snapshot.restored(&mut trunk.engine);
                (trunk.engine, trunk.sweeps) = (engine, Some(sweeps));
                let end = run.sweep(&mut trunk, None, &goal, &mut NoControl).unwrap();
                let done = run.finish(&mut trunk, end, false, &mut NoControl).unwrap();
                results.push((done.end, done.tally.collapses, done.mesh));
            }
            let first = &results[0];
            assert!(results.iter().all(|r| (r.0, r.1) == (first.0, first.1)));
            assert!(results.iter().all(|r| r.2 == first.2));
        });
    }

    #[test]
    fn a_pause_changes_nothing_if_everything_is_kept() {
        for (mesh, faces) in [(shapes::blob(4, 1), 500), (shapes::blob(5, 2), 100), (tori(), 400)] {
            with_run(&mesh, faces, &mut |run| {
                let goal = run.goal;
                let done = run.one_pass(Memoryless, goal, &mut NoControl).unwrap();
                let mut trunk = run.begin(Memoryless, TopologyChanges::default(), (&[], 0), &mut NoControl);
                let end = run.sweep(&mut trunk, None, &goal, &mut NoControl).unwrap();
                let plain = run.finish(&mut trunk, end, false, &mut NoControl).unwrap();
                assert_eq!((end, plain.tally.parts_removed), (StopReason::Goal, 0));
                assert!(done.mesh == plain.mesh);
            });
        }
    }

    #[test]
    fn only_runs_that_may_be_closer_compete() {
        // Wide charts refuse 36 collapses of 2,400. Narrow ones refuse 299 of 2,300, so that moved seams may be closer;
        // parts are as large as the model, so their removal is not tried.
        for (cells, faces, sweeps) in [(2.0, 300, 1), (6.0, 500, 2)] {
            with_run(&blobs_with_charts(cells), faces, &mut |run| {
                let (goal, mut stages) = (run.goal, StageCount::default());
                let done = run.one_pass(Memoryless, goal, &mut stages).unwrap();
                assert!(done.engine.is_unproductive && done.tally.has_refused(Refusal::Seam));
                assert_eq!((done.end, stages.sweeps), (StopReason::Goal, sweeps));
                assert_eq!(stages.comparisons > 0, sweeps > 1);
            });
        }
    }

    #[test]
    fn attributes_are_completed_for_the_chosen_outcome() {
        with_run(&blobs_with_charts(8.0), 200, &mut |run| {
            let (goal, changes) = (run.goal, TopologyChanges { seams: true, ..TopologyChanges::default() });
            let mut trunk = run.begin(Memoryless, changes, (&[], 0), &mut NoControl);
            let end = run.sweep(&mut trunk, None, &goal, &mut NoControl).unwrap();
            let shape = run.finish_shape(&mut trunk, end, false, &mut NoControl).unwrap();
            assert!(shape.engine.missing.is_some());
            let whole = run.completed(shape.clone()).unwrap();
            assert!(whole.engine.missing.is_none());
            // The texture coordinates are now those of the input under each face.
            assert!(whole.mesh.uvs() != shape.mesh.uvs());
            assert_eq!(whole.mesh.surface().triangles(), shape.mesh.surface().triangles());
            assert!(whole.mesh.positions() == shape.mesh.positions());
            // A pass returns a complete outcome.
            assert!(run.one_pass(Memoryless, goal, &mut NoControl).unwrap().engine.missing.is_none());
        });
    }

    #[test]
    fn runs_pause_before_sweeps_get_stuck_if_a_copy_is_small() {
        // A copy of nearly half would take more than a percent of the time.
        for (faces, share) in [(60, Some(2)), (2500, None)] {
            with_run(&tori(), faces, &mut |run| {
                let goal = run.goal;
                let (trunk, end) = paused(run, &goal);
                let live = trunk.engine.mesh.store.live_faces;
                match share {
                    Some(share) => {
                        assert!(end.is_none() && live * share <= 5120 && live > 3 * faces, "{live}")
                    }
                    None => assert_eq!(end, Some(StopReason::Goal)),
                }
            });
        }
    }

    #[test]
    fn only_touching_vertices_are_separated() {
        with_run(&shapes::torus(12, 8), 4, &mut |run| {
            let mut trunk = run.begin(Memoryless, TopologyChanges::default(), (&[], 0), &mut NoControl);
            let store = &mut trunk.engine.mesh.store;
            let last = store.v.len() - 1;
            store.v[0].p = store.v[last].p;
            let before: Vec<_> = store.v.iter().map(|x| x.p).collect();
            trunk.engine.mesh.separate_touching();
            let after: Vec<_> = trunk.engine.mesh.store.v.iter().map(|x| x.p).collect();
            assert!(after[0].distance(after[last]) > 1e-5, "{} {}", after[0], after[last]);
            assert!(after[0].distance(before[0]) < 0.01 && after[last].distance(before[last]) < 0.01);
            assert_eq!(after[1..last], before[1..last]);
        });
    }
}
