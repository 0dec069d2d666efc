//! Object File Format: `OFF` with any of the prefixes `ST` (texture coordinates), `C` (colours), `N` (normals) and `4`
//! (weights).
//!
//! A vertex may span several lines, but a line cannot hold two vertices: the rest of the line of a vertex or
//! face is skipped with a warning, such as the colours of faces. Positions keep double precision as in
//! [`crate::obj`].

mod read;
mod write;

pub use read::read;
pub use write::write;
