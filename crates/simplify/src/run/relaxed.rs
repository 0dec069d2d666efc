//! A run in which parts and handles stay if the target can be met with them, and else go in their turn.
//!
//! The first pass leaves all in place. Where they begin to stand in its way a copy is made, and if it cannot meet the target
//! the second pass begins there, with parts and necks in the order of costs. What went before went at lower costs, so the
//! order is nearly kept.

use super::trunk::Trunk;
use super::{Leave, Outcome, Run};
use crate::SimplifyError;
use crate::collapse::cut::may_cut;
use crate::collapse::fork::Fork;
use crate::collapse::{End, Goal, Pause, Sweeps};
use crate::control::{Control, Stage};
use crate::metric::Metric;

const ALL_STAY: Leave = Leave { parts: false, cuts: false };

impl Run<'_, '_> {
    pub(super) fn relaxed<M: Metric>(
        &mut self,
        metric: M,
        goal: Goal,
        step: Option<f64>,
        control: &mut dyn Control,
    ) -> Result<Outcome, SimplifyError> {
        let mut trunk = self.begin(metric, step, ALL_STAY, (&[], 0), control)?;
        let mut sweeps = trunk.engine.begin_sweeps(&goal);
        let mut fork = None;
        let mut end = self.go_on(&mut trunk, &mut sweeps, &goal, Pause::BeforeNeed, control)?;
        if end.is_none() {
            fork = Some(trunk.engine.fork(&sweeps));
            end = self.go_on(&mut trunk, &mut sweeps, &goal, Pause::Never, control)?;
        }
        trunk.engine.store.finish();
        let end = end.unwrap_or(End::Stuck);
        let mut first = None;
        if trunk.engine.parts_removed == 0 || end == End::Finish {
            let outcome = self.finish(&mut trunk.engine, &trunk.root, end, false, control)?;
            // A search for an error has its own end.
            if end != End::Stuck || step.is_some() {
                return Ok(outcome);
            }
            first = Some(outcome);
        }
        // Parts and handles stand in the way: let them go in their turn. Without a copy the room is needed.
        let mut from = fork.map(|fork| (fork, trunk));
        let cuts = may_cut(self.options);
        let mut second = self.in_turn(metric, &goal, step, cuts, &mut from, control)?;
        if second.touches && second.end != End::Finish {
            second = self.in_turn(metric, &goal, step, false, &mut from, control)?;
        }
        let is_worse =
            |first: &Outcome| second.end == End::Stuck && second.mesh.face_count() >= first.mesh.face_count();
        match first.filter(is_worse) {
            Some(first) => Ok(Outcome { proposals: second.proposals, ..first }),
            None => Ok(second),
        }
    }

    /// A pass in which parts, and necks if it `cuts`, go in the order of costs: from the copy, or from the start.
    fn in_turn<M: Metric>(
        &mut self,
        metric: M,
        goal: &Goal,
        step: Option<f64>,
        cuts: bool,
        from: &mut Option<(Fork<M>, Trunk<M>)>,
        control: &mut dyn Control,
    ) -> Result<Outcome, SimplifyError> {
        let mut own;
        let (trunk, mut sweeps) = match from {
            Some((fork, trunk)) => {
                control.stage(Stage::Collapse);
                let (engine, mut sweeps) = fork.again(&mut trunk.engine);
                trunk.engine = engine;
                trunk.engine.let_go(&mut sweeps, cuts, &self.source(&trunk.root));
                (trunk, sweeps)
            }
            None => {
                own = self.begin(metric, step, Leave { parts: true, cuts }, (&[], 0), control)?;
                let sweeps = own.engine.begin_sweeps(goal);
                (&mut own, sweeps)
            }
        };
        let end = self.go_on(trunk, &mut sweeps, goal, Pause::Never, control)?.unwrap_or(End::Stuck);
        trunk.engine.store.finish();
        self.finish(&mut trunk.engine, &trunk.root, end, end == End::Stuck && step.is_none(), control)
    }

    fn go_on<M: Metric>(
        &self,
        trunk: &mut Trunk<M>,
        sweeps: &mut Sweeps,
        goal: &Goal,
        pause: Pause,
        control: &mut dyn Control,
    ) -> Result<Option<End>, SimplifyError> {
        let end = trunk.engine.go_on(sweeps, goal, pause, &self.source(&trunk.root), control);
        if end == Some(End::Cancel) { Err(SimplifyError::Cancelled) } else { Ok(end) }
    }
}
