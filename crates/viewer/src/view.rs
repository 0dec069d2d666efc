//! Camera and picture of one view, for all views: the comparison and the stage.

#[cfg(feature = "window")]
pub(crate) mod drawing;
pub mod orbit;
#[cfg(feature = "window")]
pub(crate) mod user_files;
#[cfg(feature = "window")]
pub mod viewport;
