//! Shared parts of the checks of the engine's invariants.

use wide::f32x4;

/// Debug builds check meshes with fewer faces than this after each sweep: nearly all meshes of the tests. (On
/// larger ones the checks would take longer than the rest of a test.)
pub(super) const CHECKED_BELOW: usize = 5000;

/// State of the checks of one run.
#[derive(Clone, Debug, Default)]
pub(crate) struct Checks {
    /// The largest trace of a tensor, and square of an edge, so far.
    pub(super) largest: f32,
    /// The largest values of wedges so far.
    pub(super) values: Vec<f32x4>,
    /// True if any face was thin.
    pub(super) has_thin: bool,
}

/// Returns `Err` with a sentence unless the condition holds.
pub(super) fn need(holds: bool, why: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(why()) }
}
