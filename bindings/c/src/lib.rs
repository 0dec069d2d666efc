//! The C interface: simplification for programs in C, C++ and any language that calls C.
//!
//! ```text
//! fault         errors as codes, and as a text for each thread; no panic leaves the library
//! flags         the flags of the index calls
//! memory        the buffers of the caller as checked views: every pointer is read or written here
//! index_calls   the functions with the arguments of meshoptimizer
//! options       `lodsmith_options`, and its conversion
//! mesh_view     `lodsmith_mesh_view`, and its conversion
//! result        `lodsmith_result`, its accessors, `lodsmith_report`
//! slices        the index calls with slices of Rust, for tests and benchmarks
//! calls         `lodsmith_simplify`, `lodsmith_version`
//! files         `lodsmith_run_file_job`, `lodsmith_text`; with the feature `files`
//! ```
//!
//! The documentation for users is in `include/lodsmith.h`, which is generated from these sources, and in `docs/c.md`.
#![allow(
    unsafe_code,
    reason = "the C interface consists of pointers; each unsafe block states why it is sound"
)]

mod calls;
mod fault;
#[cfg(feature = "files")]
mod files;
mod flags;
mod index_calls;
mod memory;
mod mesh_view;
mod options;
mod result;
mod slices;

pub use calls::*;
pub use fault::*;
#[cfg(feature = "files")]
pub use files::*;
pub use flags::*;
pub use index_calls::*;
pub use mesh_view::*;
pub use options::*;
pub use result::*;
pub use slices::*;
