//! Viewer of Lodsmith: original and simplified mesh side by side, updated while you drag.
//!
//! Only [`command`]s change a [`document`]; long work is a [`job`] on a worker thread; [`panel`]s read the
//! document and request changes. [`app`] is the window, [`gpu`] draws.
//!
//! Without the feature `window` only the plain data is compiled: settings, commands, sessions, layouts.

#[cfg(feature = "window")]
pub mod app;
pub mod bake_settings;
#[cfg(feature = "window")]
pub mod baked;
#[cfg(feature = "window")]
pub mod benchmark;
pub mod command;
#[cfg(feature = "window")]
pub mod compare;
#[cfg(feature = "window")]
pub mod content;
#[cfg(feature = "window")]
mod dialog;
#[cfg(feature = "window")]
pub mod difference;
#[cfg(all(feature = "window", not(target_arch = "wasm32")))]
pub mod display;
#[cfg(feature = "window")]
pub mod document;
#[cfg(feature = "window")]
pub mod export;
#[cfg(feature = "window")]
mod export_size;
#[cfg(feature = "window")]
pub mod flaws;
#[cfg(feature = "window")]
pub mod gpu;
#[cfg(feature = "window")]
pub mod job;
#[cfg(feature = "window")]
pub mod keys;
#[cfg(feature = "window")]
pub mod log;
#[cfg(feature = "window")]
pub mod numbers;
pub mod option_words;
pub mod orbit;
#[cfg(feature = "window")]
pub mod page;
#[cfg(feature = "window")]
pub mod panel;
pub mod playback;
#[cfg(feature = "window")]
pub mod preview_mesh;
pub mod session;
pub mod settings;
#[cfg(feature = "window")]
pub mod shown;
#[cfg(feature = "window")]
pub mod slider_preview;
#[cfg(feature = "window")]
mod smoothing;
pub mod stage;
#[cfg(feature = "window")]
pub mod target_scale;
#[cfg(feature = "window")]
pub mod theme;
pub mod up_axis;
#[cfg(feature = "window")]
mod user_files;
#[cfg(feature = "window")]
mod view_options;
#[cfg(feature = "window")]
pub mod viewport;
#[cfg(all(feature = "window", not(target_arch = "wasm32")))]
mod window;

#[cfg(feature = "window")]
pub use view_options::ViewOptions;
#[cfg(all(feature = "window", not(target_arch = "wasm32")))]
pub use window::{ViewError, run};
