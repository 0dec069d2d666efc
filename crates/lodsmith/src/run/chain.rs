//! Several levels of one input in a single run.
//!
//! ```text
//! trunk      o-----+--------+-------+           sweeps that no goal influences
//!                   \        \       \
//! branches           o        o       o         the last sweeps to a goal, then a fit
//! ```
//!
//! From there on, a branch does exactly what a single run does, so a level has the same quality as a single
//! run. If each vertex must be tracked to the next level, there is a single sequence of sweeps from level to
//! level, and only the fit is done on a copy: then each level results from the previous one by collapses
//! alone.
//!
//! If parts or handles block a level, a second trunk starts, in which they are removed in order of cost, as
//! in a single run; the lower levels continue from it.

use lodsmith_core::{TriMesh, VertexId};

use super::collapses;
use super::context::{Done, Run, RunOutcome, TopologyChanges};
use super::goal::goal;
use super::race::without_touching;
use super::report::build_report;
use super::trunk::Trunk;
use crate::SimplifyError;
use crate::collapse::order::{NONE, Ordered};
use crate::collapse::{Goal, Pause, StopReason};
use crate::constraints::Constraints;
use crate::control::{Control, ProgressShare, Stage};
use crate::cost::metric::{Metric, with_metric};
use crate::input::Input;
use crate::options::{Effort, MethodKind, SimplifyOptions, Stop, TopologyPolicy};

/// For each level, starting with the input, the vertex of the next level that each of its vertices was merged
/// into; [`NONE`](crate::collapse::order::NONE) if its part was removed.
pub(crate) type Mergers = Vec<Vec<VertexId>>;

/// Function that makes the outcomes of all levels in one run.
type Passes = fn(&mut Run<'_, '_>, &[Goal], &mut dyn Control) -> Result<Vec<RunOutcome>, SimplifyError>;

fn passes_of(method: MethodKind) -> Option<Passes> {
    with_metric!(method, METRIC => |run, goals, control| run.chain(METRIC, goals, control))
}

/// True if one run makes all levels.
pub(crate) fn is_chained(options: &SimplifyOptions, stops: &[Stop]) -> bool {
    let is_plain = !options.escalate && options.effort != Effort::Best;
    passes_of(options.method.kind()).is_some() && is_plain && stops.iter().all(|s| s.error.is_none())
}

/// Runs on an ordered input to one stop after another, each a count below the previous one. With `is_traced`, returns the mergers.
pub(crate) fn chain(
    input: &Input<'_>,
    options: &SimplifyOptions,
    stops: &[Stop],
    is_traced: bool,
    mut in_order: Ordered,
    control: &mut dyn Control,
) -> Result<(Vec<Done>, Mergers), SimplifyError> {
    let of_levels: Vec<SimplifyOptions> =
        stops.iter().map(|stop| SimplifyOptions { stop: *stop, ..options.clone() }).collect();
    let faces = input.surface.triangles().len();
    let goals: Vec<Goal> = of_levels.iter().map(|own| goal(own, faces)).collect();
    let constraints = Constraints::new(&input.data, &in_order, |v| input.joined(v));
    let first = goals.first().copied().unwrap_or_default();
    let pass = collapses(options.method.kind()).expect("only methods that collapse edges get here");
    let mut run = Run::new(input, options, &mut in_order, &constraints, pass);
    (run.goal, run.is_traced) = (first, is_traced);
    let passes = passes_of(options.method.kind()).expect("only methods with sweeps get here");
    let outcomes = passes(&mut run, &goals, control)?;
    let mergers = if is_traced { run.mergers(&outcomes) } else { Mergers::new() };
    let meshes: Vec<&TriMesh> = outcomes.iter().map(|outcome| &outcome.mesh).collect();
    let deviations = run.measured(&meshes, control)?;
    let finished = outcomes.into_iter().zip(deviations).zip(&of_levels);
    let all = finished.map(|((outcome, deviation), own)| {
        build_report(input, own, &in_order, &constraints, (outcome, deviation, false))
    });
    Ok((all.collect(), mergers))
}

impl Run<'_, '_> {
    /// Returns the outcome of each goal.
    fn chain<M: Metric>(
        &mut self,
        metric: M,
        goals: &[Goal],
        control: &mut dyn Control,
    ) -> Result<Vec<RunOutcome>, SimplifyError> {
        let is_relaxed = self.options.topology == TopologyPolicy::Relaxed;
        let mut changes = TopologyChanges::from_start(self.options);
        let mut trunk: Option<Trunk<M>> = None;
        let mut outcomes: Vec<RunOutcome> = Vec::with_capacity(goals.len());
        for i in 0..goals.len() {
            let control = &mut ProgressShare::of(control, i, goals.len());
            let mut level = |run: &mut Self, trunk: &mut _, changes: &mut _| {
                without_touching(changes, |changes| run.level(metric, trunk, (i, goals), changes, control))
            };
            let mut outcome = level(self, &mut trunk, &mut changes)?;
            let is_short = outcome.tally.parts_removed > 0
                || outcome.end == StopReason::Stuck
                || outcome.relaxed.seams
                || outcome.topology_blocks();
            if is_relaxed && !changes.parts && is_short && outcome.end != StopReason::Finish {
                // Parts and handles block collapses: start a trunk in which they are removed in order of
                // cost.
                let (mut second, mut own) = (None, TopologyChanges::removal(self.options));
                let other = level(self, &mut second, &mut own)?;
                // (A run that the caller ended may have stopped far above the goal.)
                if other.end != StopReason::Finish
                    && (outcome.tally.parts_removed > 0
                        || self.closest_index(&[&outcome, &other], None, control)? == 1)
                {
                    (trunk, changes, outcome) = (second, own, other);
                } else if outcome.end == StopReason::Stuck {
                    outcome.engine.proposals = other.engine.proposals;
                }
            }
            let is_last = outcome.end == StopReason::Finish;
            if let Some(before) = outcomes.last().filter(|_| is_last)
                && before.mesh.face_count() < outcome.mesh.face_count()
            {
                // A run that began anew was ended far above the goal.
                outcome = RunOutcome { end: StopReason::Finish, ..before.clone() };
            }
            outcomes.push(self.completed(outcome)?);
            if is_last {
                break;
            }
        }
        Ok(outcomes)
    }

    /// Sweeps a trunk to a level, from its start if there is none yet with these changes, and builds the
    /// result; its attributes are not complete.
    fn level<M: Metric>(
        &mut self,
        metric: M,
        trunk: &mut Option<Trunk<M>>,
        (i, goals): (usize, &[Goal]),
        changes: TopologyChanges,
        control: &mut dyn Control,
    ) -> Result<RunOutcome, SimplifyError> {
        let goal = &goals[i];
        let mut grown = match trunk.take().filter(|trunk| trunk.root.changes == changes) {
            Some(mut trunk) => {
                control.stage(Stage::Collapse);
                let weights = trunk.root.weights.get(i).map(Vec::as_slice);
                match &mut trunk.sweeps {
                    Some(sweeps) => trunk.engine.lower_goal(sweeps, goal, weights),
                    None => trunk.engine.reopen(weights),
                }
                trunk
            }
            None => self.begin(metric, changes, (goals, i), control),
        };
        let (mut branch, end) = if self.is_traced {
            let end = self.sweep(&mut grown, None, goal, control)?;
            (grown.branch(), end)
        } else {
            let ended = self.resume(&mut grown, goal, Pause::BeforeGoal, control)?;
            let mut branch = grown.branch();
            let end = self.sweep(&mut branch, ended, goal, control)?;
            (branch, end)
        };
        let is_last = changes.parts || goal.is_none() || self.options.topology == TopologyPolicy::Preserve;
        let outcome = self.finish_shape(&mut branch, end, end == StopReason::Stuck && is_last, control)?;
        *trunk = Some(grown);
        Ok(outcome)
    }

    /// Returns the vertices of the next level that the vertices of each level were merged into.
    fn mergers(&self, outcomes: &[RunOutcome]) -> Mergers {
        let home = |homes: &[VertexId], number: VertexId| homes.get(number.index()).copied().unwrap_or(NONE);
        let count = self.input.surface.positions().len();
        let mut mergers = Mergers::new();
        for (k, outcome) in outcomes.iter().enumerate() {
            let Some(trace) = &outcome.engine.trace else { return Mergers::new() };
            mergers.push(match k.checked_sub(1).map(|k| &outcomes[k].engine.trace) {
                None => (0..count)
                    .map(|v| self.ordered.rank[self.input.joined(VertexId::new(v)).index()])
                    .map(|number| home(&trace.homes, number))
                    .collect(),
                Some(Some(before)) => {
                    // Vertices created by cuts have numbers of their own, which do not exist in another
                    // trunk.
                    let is_same = before.changes == trace.changes;
                    let numbers = if is_same { &before.origins } else { &before.places };
                    numbers.iter().map(|&number| home(&trace.homes, number)).collect()
                }
                Some(None) => return Mergers::new(),
            });
        }
        mergers
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;
    use crate::control::NoControl;
    use crate::options::{BorderPolicy, Length, Placement};

    fn input(mesh: &TriMesh) -> Input<'_> {
        Input::new(mesh)
    }

    fn chain(
        mesh: &TriMesh,
        options: &SimplifyOptions,
        faces: &[usize],
        is_traced: bool,
    ) -> (Vec<TriMesh>, Mergers) {
        let stops: Vec<Stop> = faces.iter().map(|n| Stop::faces(*n)).collect();
        let (all, mergers) =
            crate::pipeline::simplify_chain(&input(mesh), options, &stops, is_traced, &mut NoControl)
                .expect("a shape can be simplified")
                .expect("a shape has no sheets");
        (all.into_iter().map(|done| done.0.mesh).collect(), mergers)
    }

    #[test]
    fn methods_with_sweeps_are_chained_unless_an_error_or_escalation_is_set() {
        let mut options = SimplifyOptions::default();
        let counts = [Stop::faces(10), Stop::ratio(0.1), Stop::vertices(3)];
        assert!(is_chained(&options, &counts));
        assert!(!is_chained(&options, &[Stop::faces(10), Stop::error(Length::OfDiagonal(0.1))]));
        options.method = MethodKind::Cluster.into();
        assert!(!is_chained(&options, &counts));
        options.method = MethodKind::Melax.into();
        assert!(is_chained(&options, &counts));
        options.escalate = true;
        assert!(!is_chained(&options, &counts));
    }

    #[test]
    fn each_level_equals_the_result_of_a_separate_run() {
        let mesh = shapes::noisy_sphere(3, 0.05, 3);
        for method in [MethodKind::Memoryless, MethodKind::Quadric] {
            let options = SimplifyOptions { method: method.into(), ..SimplifyOptions::default() };
            let goals = [700, 300, 150];
            let (levels, mergers) = chain(&mesh, &options, &goals, false);
            assert!(mergers.is_empty());
            for (level, faces) in levels.iter().zip(goals) {
                let alone = SimplifyOptions { stop: Stop::faces(faces), ..options.clone() };
                let (alone, _) =
                    crate::pipeline::simplify(&input(&mesh), &alone, &mut NoControl).expect("a sphere");
                assert!(level.face_count() <= faces && level.face_count() > faces - 2);
                assert!(*level == alone.mesh, "{method:?} at {faces} faces");
            }
        }
    }

    #[test]
    fn mergers_map_each_level_to_the_next() {
        // With placement at endpoints, so that each vertex of a level is a vertex of the level before.
        let mesh = shapes::noisy_sphere(3, 0.05, 3);
        let options = SimplifyOptions { placement: Placement::Endpoint, ..SimplifyOptions::default() };
        let (levels, mergers) = chain(&mesh, &options, &[600, 200, 80], true);
        assert_eq!(mergers.len(), 3);
        let all = [&mesh, &levels[0], &levels[1], &levels[2]];
        for (k, into) in mergers.iter().enumerate() {
            let [from, to] = [all[k], all[k + 1]].map(|m| m.positions().view());
            assert_eq!(into.len(), from.len());
            let mut homes = vec![0; to.len()];
            for (v, home) in into.iter().enumerate() {
                assert!(*home != NONE && home.index() < to.len());
                homes[home.index()] += usize::from(from.get(VertexId::new(v)) == to.get(*home));
            }
            // Exactly one of the vertices merged into a vertex has its position.
            assert!(homes.iter().all(|n| *n == 1), "level {k}: {homes:?}");
        }
    }

    #[test]
    fn vertices_of_removed_parts_are_merged_into_none() {
        let mesh = shapes::tetrahedra(2);
        let options = SimplifyOptions { border: BorderPolicy::Keep, ..SimplifyOptions::default() };
        let (levels, mergers) = chain(&mesh, &options, &[4], true);
        assert_eq!(levels[0].face_count(), 4);
        assert_eq!(mergers[0].iter().filter(|home| **home == NONE).count(), mesh.vertex_count() / 2);
    }
}
