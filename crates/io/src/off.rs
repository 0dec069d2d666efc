//! Object File Format: `OFF` with any of the prefixes `ST` (texture coordinates), `C` (colours), `N` (normals) and `4`
//! (weights).
//!
//! A vertex may stand on several lines, but one line holds no two of them: what follows a vertex or a face on its line
//! is passed over with a warning, such as the colours of faces. Positions keep double precision as in [`crate::obj`].

mod read;
mod write;

pub use read::read;
pub use write::write;
