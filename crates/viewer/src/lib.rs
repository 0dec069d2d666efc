//! Viewer of Lodsmith: original and simplified mesh side by side, updated while you drag.
//!
//! Only [`command`]s change a [`document`]; long work is a [`job`] on a worker thread; [`panel`]s read the
//! document and request changes. [`app`] is the window, [`gpu`] draws.
//!
//! Without the feature `window` only the plain data is compiled: settings, commands, sessions, layouts.

#[cfg(feature = "window")]
pub mod app;
pub mod command;
#[cfg(feature = "window")]
pub mod compare;
#[cfg(feature = "window")]
pub mod content;
#[cfg(feature = "window")]
pub mod document;
#[cfg(feature = "window")]
pub mod gpu;
#[cfg(feature = "window")]
pub mod job;
#[cfg(feature = "window")]
pub mod numbers;
#[cfg(feature = "window")]
pub mod page;
#[cfg(feature = "window")]
pub mod panel;
pub mod settings;
pub mod stage;
#[cfg(feature = "window")]
pub mod theme;
pub mod view;

#[cfg(feature = "window")]
pub use app::options::ViewOptions;
#[cfg(all(feature = "window", not(target_arch = "wasm32")))]
pub use app::window::{ViewError, run};
