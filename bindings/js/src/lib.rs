//! The WebAssembly modules of the JavaScript package: the engine for typed arrays, and with the feature `formats` for
//! whole files. The JavaScript package around them has the functions for users, with their documentation.
//!
//! ```text
//! errors        errors as JavaScript errors
//! options       JavaScript objects as options, and the table of options
//! report        reports as objects, with the keys of the command
//! progress      progress for a JavaScript function
//! mesh          typed arrays as meshes and back
//! run           simplification of meshes and scenes
//! index_calls   the functions with the arguments of meshoptimizer
//! files         whole GLB files (feature `formats`)
//! ```

mod errors;
pub mod options;
mod progress;
mod report;

#[cfg(feature = "formats")]
pub mod files;
#[cfg(not(feature = "formats"))]
pub mod index_calls;
#[cfg(not(feature = "formats"))]
mod mesh;
#[cfg(not(feature = "formats"))]
pub mod run;
