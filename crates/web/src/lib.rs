//! The viewer as a web page: the window on a canvas, and the engine in workers.
//!
//! One WebAssembly module does both: [`start`] runs the window, and [`WebEngine`] runs its requests in a worker.
//! The JavaScript of the page is in `page`.
#![cfg(target_arch = "wasm32")]

mod archive;
mod engine;
mod host;
mod window;

pub use archive::{unpack, zip};
pub use engine::WebEngine;
pub use window::{Window, start};
