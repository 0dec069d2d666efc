//! A state to go back to, for a run whose target may be out of reach with all parts and handles in place.
//!
//! ```text
//! o------------+- - - - - - x         all in place: the target is not met
//!               \
//!                o------------o       from the copy on, parts go and necks are cut in the order of costs
//! ```
//!
//! As long as a run is at ease each sweep collapses about a quarter of what lives. Parts and handles that stand in the way
//! are seen early: the sweeps get less done, at higher and higher thresholds. The copy is made when the first of them does.

use super::attributes::SavedWedges;
use super::bound::UNKNOWN;
use super::sweeps::{LAST_SHARE, Productivity, QUANTILE};
use super::{Engine, Goal, InputSurface, Sweeps, sampled_error};
use crate::metric::Metric;

/// Collapses of a sweep, a share of those that it was to bring nearer, under which a run is not at ease. (Measured: .27 to .34
/// on surfaces without seams as long as nothing stands in the way, .26 with many seams.)
const MIN_PRODUCTIVE_SHARE: f64 = 0.24;
/// Sweeps that were to bring fewer nearer than one in so many living vertices say nothing of it.
const MIN_SWEEP_DIVISOR: f64 = 4.0;
/// A copy is made then of this share of the input at most, ...
const SNAPSHOT_DIVISOR: usize = 3;
/// ... or of this one in a run at ease, of which it is to take less than a percent of the time, ...
const CHEAP_SNAPSHOT_DIVISOR: usize = 8;
/// ... or of this one where a late phase comes, in which a run takes its time.
const LATE_SNAPSHOT_DIVISOR: usize = 2;

/// A copy of an engine under way. What is large and changes little is lent from the engine that it was copied from.
pub(crate) struct Snapshot<M: Metric> {
    engine: Engine<M>,
    sweeps: Sweeps,
    kept: Option<SavedWedges>,
}

impl<M: Metric> Snapshot<M> {
    /// The engine as it was, and where its sweeps stood. Attributes are taken out of `spent`: the engine that was copied, or
    /// one that this gave before.
    pub(crate) fn restored(&self, spent: &mut Engine<M>) -> (Engine<M>, Sweeps) {
        let mut engine = self.engine.clone();
        engine.mesh.values.wedge_data = spent.mesh.values.wedge_data.take();
        engine.mesh.values.attributes = spent.mesh.values.attributes.take();
        if let Some((attributes, kept)) = engine.mesh.values.attributes.as_mut().zip(self.kept.as_ref()) {
            attributes.put_back(kept);
        }
        (engine, self.sweeps.clone())
    }
}

impl<M: Metric> Engine<M> {
    /// A copy to go back to.
    pub(crate) fn snapshot(&mut self, sweeps: &Sweeps) -> Snapshot<M> {
        // What was given back makes room for the copy. (Room for lists of corners is needed, and full lists compact.) The
        // vertices come last, because they are copied for it.
        self.mesh.store.bound.shrink_to_fit();
        self.mesh.store.t.shrink_to_fit();
        self.mesh.store.v.shrink_to_fit();
        let (attributes, wedge_data) =
            (self.mesh.values.attributes.take(), self.mesh.values.wedge_data.take());
        let engine = self.clone();
        (self.mesh.values.attributes, self.mesh.values.wedge_data) = (attributes, wedge_data);
        let kept = self.mesh.values.attributes.as_ref().map(|attributes| {
            let (faces, wedges) = (self.mesh.store.t.iter(), self.mesh.store.wedges.iter().flatten());
            let living = faces.zip(wedges).filter(|(t, _)| t[0] != super::order::NONE);
            attributes.kept(living.flat_map(|(_, w)| *w))
        });
        Snapshot { engine, sweeps: sweeps.clone(), kept }
    }

    /// Whether a copy would begin with damage that parts or seams would have been cheaper than.
    pub(crate) fn is_past_parts(&self, cuts: bool) -> bool {
        self.mesh.has_relaxed_seams() || self.has_parts_in_the_way(cuts)
    }

    /// From here on parts go in the order of costs, and necks are cut in it if `cuts`. What was refused is looked at again.
    pub(crate) fn allow_topology_changes(
        &mut self,
        sweeps: &mut Sweeps,
        cuts: bool,
        original: &dyn InputSurface,
    ) {
        self.mesh.store.compact();
        self.mesh.constraints.cuts_necks = cuts;
        original.with(&mut |points, faces| self.watch_parts_of(points, faces));
        sweeps.set_bounds(self.mesh.bounds());
        if cuts {
            self.mesh.store.bound.fill(UNKNOWN);
        }
    }

    /// Notes whether the last sweeps got as much done as where nothing stands in the way.
    pub(super) fn update_ease(&self, ease: &mut Productivity, has_swept: bool) {
        if has_swept && ease.wanted * MIN_SWEEP_DIVISOR >= self.mesh.store.live_vertices as f64 {
            let done = (self.tally.collapses - ease.at_threshold) as f64;
            ease.is_high &= done >= MIN_PRODUCTIVE_SHARE * ease.wanted;
        }
    }

    /// Whether parts or handles begin to stand in the way, or a copy costs next to nothing and this is the last moment for
    /// one: before the goal has a say in the sweeps, or the late phase begins. `is_last_stretch` is whether the goal has.
    pub(crate) fn should_snapshot(&self, sweeps: &Sweeps, goal: &Goal, is_last_stretch: bool) -> bool {
        if !sweeps.productivity.is_high && self.is_within(SNAPSHOT_DIVISOR)
            || is_last_stretch && self.is_within(CHEAP_SNAPSHOT_DIVISOR)
        {
            return true;
        }
        self.is_extreme(goal) && self.is_near_late_phase() && self.may_snapshot_late()
    }

    /// Whether so few faces live that a late phase, if one comes, is near.
    pub(crate) fn is_near_late_phase(&self) -> bool {
        self.mesh.store.live_faces
            <= 2 * sampled_error::begin(self.tally.first_faces, self.mesh.counts_attributes())
    }

    /// Of how many vertices a sweep is to look at the edges, if nothing stands in the way.
    pub(super) fn wanted(&self, goal: &Goal) -> f64 {
        let most = QUANTILE * self.mesh.store.live_vertices as f64;
        self.mesh.needed(goal).map_or(most, |n| most.min(LAST_SHARE * n as f64))
    }

    /// Whether a copy may be made before the late phase begins.
    pub(super) fn may_snapshot_late(&self) -> bool {
        self.is_within(LATE_SNAPSHOT_DIVISOR)
    }

    /// Whether no more than a share of the input lives.
    fn is_within(&self, share: usize) -> bool {
        self.mesh.store.live_faces * share <= self.tally.first_faces
    }
}
