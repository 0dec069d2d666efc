//! The viewer as a page of a browser: the window on a canvas, and the engine in workers.
//!
//! One module does both: [`start`] runs the window, [`WebEngine`] answers its requests in a worker. The
//! JavaScript around it is in `page`.
#![cfg(target_arch = "wasm32")]

mod archive;
mod engine;
mod host;
mod window;

pub use archive::{unpack, zip};
pub use engine::WebEngine;
pub use window::{Window, start};
