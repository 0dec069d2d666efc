//! Copies of running engines, for a search that runs to several counts from one start.
//!
//! ```text
//! start o--------+-----------+- - x      a run to some count; copies are made before it influences the sweeps
//!                 \           \
//!                  o- - x      o- - x    runs to lower counts resume from the last copy that is heavy enough
//! ```
//!
//! A run that resumes from a copy ends with the same mesh as a run from the start, so a level does not depend
//! on the levels tried before.

use std::rc::Rc;

use super::trunk::{Root, Trunk};
use crate::collapse::ordered_input::INPUT_COPY_MAX_FACES;
use crate::collapse::{Engine, Goal, Sweeps};
use crate::cost::metric::Metric;

/// Maximum number of copies: at the start, and two later.
const MAX_COPIES: usize = 3;

struct EngineCopy<M: Metric> {
    engine: Engine<M>,
    sweeps: Sweeps,
    /// Number of faces of the goal that the sweeps ran to.
    faces: usize,
}

/// State that a search keeps from one run to the next; empty for a single run.
pub(super) struct Copies<M: Metric> {
    is_wanted: bool,
    /// The heaviest first.
    all: Vec<EngineCopy<M>>,
    root: Option<Rc<Root>>,
}

impl<M: Metric> Copies<M> {
    pub(super) const fn none() -> Self {
        Self { is_wanted: false, all: Vec::new(), root: None }
    }

    pub(super) const fn of_search() -> Self {
        Self { is_wanted: true, all: Vec::new(), root: None }
    }

    pub(super) const fn is_wanted(&self) -> bool {
        self.is_wanted
    }

    /// Returns the lightest copy from which a run can resume to a goal. Drops lighter ones.
    pub(super) fn before(&mut self, goal: &Goal) -> Option<(Trunk<M>, Sweeps)> {
        let faces = goal.faces.unwrap_or(0);
        self.all.retain(|kept| kept.faces >= faces);
        let (kept, root) = self.all.last().zip(self.root.as_ref())?;
        let mut engine = kept.engine.branch();
        let mut sweeps = kept.sweeps.clone();
        engine.lower_goal(&mut sweeps, goal, None);
        Some((Trunk { engine, root: Rc::clone(root), sweeps: None }, sweeps))
    }

    /// Keeps a copy of an engine in a run to a goal of `faces` faces; a copy of the start can be used for all
    /// goals.
    pub(super) fn keep(&mut self, trunk: &Trunk<M>, sweeps: &Sweeps, faces: usize) {
        // Runs to few faces need the input again below a certain count, and may only be copied above it.
        if !self.is_wanted
            || trunk.engine.mesh.store.live_faces > INPUT_COPY_MAX_FACES
            || trunk.engine.is_near_late_phase()
        {
            return;
        }
        if self.all.len() == MAX_COPIES {
            self.all.remove(1);
        }
        self.root = Some(Rc::clone(&trunk.root));
        self.all.push(EngineCopy { engine: trunk.engine.branch(), sweeps: sweeps.clone(), faces });
    }
}
