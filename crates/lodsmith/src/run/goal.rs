//! The counts at which the options stop a run.

use crate::collapse::Goal;
use crate::options::SimplifyOptions;

/// Returns the number of faces for a ratio: at least one.
pub(crate) fn share(ratio: f64, faces: usize) -> usize {
    ((faces as f64 * ratio).round() as usize).max(1)
}

/// Returns the counts that a run with these options ends at.
pub(crate) fn goal(options: &SimplifyOptions, faces: usize) -> Goal {
    let stop = &options.stop;
    let by_ratio = stop.ratio.map(|r| share(r, faces));
    // The first stop reached ends the run, so the larger count is the goal.
    let by_faces = match (stop.faces, by_ratio) {
        (Some(a), Some(b)) => Some(a.max(b)),
        (a, b) => a.or(b),
    };
    let ends = options.method.ends_without_stop();
    let nothing = by_faces.is_none() && stop.vertices.is_none() && stop.error.is_none() && !ends;
    Goal { faces: if nothing { Some(usize::MAX) } else { by_faces }, vertices: stop.vertices }
}
