//! Snapshots: engine states to resume from, for a run whose target may be out of reach with all parts and
//! handles in place.
//!
//! ```text
//! o------------+- - - - - - x         all kept: the target is not met
//!               \
//!                o------------o       from the snapshot on, parts are removed and necks cut in order of cost
//! ```
//!
//! As long as a run is productive, each sweep collapses about a quarter of the live vertices. Parts and
//! handles that block collapses show early: the sweeps do fewer collapses, at higher and higher thresholds.
//! The snapshot is taken at the first such sweep.

use super::attributes::SavedWedges;
use super::bound::UNKNOWN;
use super::sweeps::{LAST_SHARE, Productivity, QUANTILE};
use super::{Engine, Goal, Sweeps, samples};
use crate::collapse::ordered_input::OriginalInput;
use crate::cost::metric::Metric;

/// Share of the collapses that a sweep's threshold aims at; a run whose sweeps do fewer is unproductive.
/// (Measured: .27 to .34 on surfaces without seams as long as nothing blocks collapses, .26 with many seams.)
const MIN_PRODUCTIVE_SHARE: f64 = 0.24;
/// Sweeps that aim at fewer collapses than the live vertices divided by this do not count.
const MIN_SWEEP_DIVISOR: f64 = 4.0;
/// Maximum share of the input, as a divisor, that a snapshot may copy in an unproductive run.
const SNAPSHOT_DIVISOR: usize = 3;
/// That maximum in a productive run, where the copy should take less than a percent of the time.
const CHEAP_SNAPSHOT_DIVISOR: usize = 8;
/// That maximum before a late phase, which takes longer anyway.
const LATE_SNAPSHOT_DIVISOR: usize = 2;

/// A copy of a running engine. Large data that changes little is shared with the engine that it was copied
/// from.
pub(crate) struct Snapshot<M: Metric> {
    engine: Engine<M>,
    sweeps: Sweeps,
    kept: Option<SavedWedges>,
}

impl<M: Metric> Snapshot<M> {
    /// Returns the engine and its sweeps as they were. Attributes are taken from `used`: the engine that was
    /// copied, or an engine that this function returned before.
    pub(crate) fn restored(&self, used: &mut Engine<M>) -> (Engine<M>, Sweeps) {
        let mut engine = self.engine.clone();
        engine.mesh.values.wedge_data = used.mesh.values.wedge_data.take();
        engine.mesh.values.attributes = used.mesh.values.attributes.take();
        if let Some((attributes, kept)) = engine.mesh.values.attributes.as_mut().zip(self.kept.as_ref()) {
            attributes.restore_wedges(kept);
        }
        (engine, self.sweeps.clone())
    }
}

impl<M: Metric> Engine<M> {
    /// Takes a snapshot.
    pub(crate) fn snapshot(&mut self, sweeps: &Sweeps) -> Snapshot<M> {
        // Releasing memory here makes room for the copy. (Corner lists need spare room, because full lists
        // cause a compaction.) The vertices come last, because releasing their memory copies them.
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
            attributes.save_wedges(living.flat_map(|(_, w)| *w))
        });
        Snapshot { engine, sweeps: sweeps.clone(), kept }
    }

    /// True if a snapshot would already contain collapses that were more expensive than removing parts or
    /// relaxing seams.
    pub(crate) fn is_past_blocking(&self, cuts: bool) -> bool {
        self.mesh.has_relaxed_seams() || self.has_blocking_parts(cuts)
    }

    /// Enables the removal of parts in order of cost, and cuts of necks if `cuts`. Refused collapses are
    /// tried again.
    pub(crate) fn allow_topology_changes(
        &mut self,
        sweeps: &mut Sweeps,
        cuts: bool,
        original: &OriginalInput<'_>,
    ) {
        self.mesh.store.compact();
        self.mesh.constraints.cuts_necks = cuts;
        original.visit(|points, faces| self.enable_part_removal_as_in(points, faces));
        sweeps.set_bounds(self.mesh.bounds());
        if cuts {
            self.mesh.store.bound.fill(UNKNOWN);
        }
    }

    /// Updates whether the last sweeps did as many collapses as they would without obstacles.
    pub(super) fn update_productivity(&mut self, productivity: &mut Productivity, has_swept: bool) {
        if has_swept && productivity.wanted * MIN_SWEEP_DIVISOR >= self.mesh.store.live_vertices as f64 {
            let done = (self.tally.collapses - productivity.at_threshold) as f64;
            productivity.is_high &= done >= MIN_PRODUCTIVE_SHARE * productivity.wanted;
        }
        if productivity.is_high {
            self.tally.while_productive = (self.tally.collapses, self.tally.refusals);
        }
    }

    /// True if parts or handles start to block collapses, or if a snapshot is cheap and this is the last
    /// chance for one: before the goal influences the sweeps, or the late phase starts. `is_last_stretch` is
    /// true if the goal limits the next sweep.
    pub(crate) fn should_snapshot(&self, sweeps: &Sweeps, goal: &Goal, is_last_stretch: bool) -> bool {
        if !sweeps.productivity.is_high && self.is_within(SNAPSHOT_DIVISOR)
            || is_last_stretch && self.is_within(CHEAP_SNAPSHOT_DIVISOR)
        {
            return true;
        }
        self.is_extreme(goal) && self.is_near_late_phase() && self.may_snapshot_late()
    }

    /// True if so few faces are live that the late phase, if there is one, is near.
    pub(crate) fn is_near_late_phase(&self) -> bool {
        self.mesh.store.live_faces
            <= 2 * samples::start_faces(self.tally.first_faces, self.mesh.counts_attributes())
    }

    /// Returns the number of vertices whose edges a sweep would evaluate without obstacles.
    pub(super) fn wanted(&self, goal: &Goal) -> f64 {
        let full_sweep = QUANTILE * self.mesh.store.live_vertices as f64;
        self.mesh.needed(goal).map_or(full_sweep, |n| full_sweep.min(LAST_SHARE * n as f64))
    }

    /// True if a snapshot may be taken just before the late phase starts.
    pub(super) fn may_snapshot_late(&self) -> bool {
        self.is_within(LATE_SNAPSHOT_DIVISOR)
    }

    /// True if the live faces are at most the input's divided by `share`.
    fn is_within(&self, share: usize) -> bool {
        self.mesh.store.live_faces * share <= self.tally.first_faces
    }
}
