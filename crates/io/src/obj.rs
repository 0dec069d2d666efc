//! Wavefront OBJ.
//!
//! Read: `v` (with colours behind the position), `vt`, `vn`, `f` with any number of corners and with negative indices,
//! counted `o`, `usemtl`. Lines and points are dropped with a warning; materials, and groups where there are several, are
//! not carried. A large file is read in pieces and never held as a whole.
//!
//! Positions are kept in double precision where any coordinate of the file needs it: it has at least 8 significant
//! digits, and the nearest `f32` printed with as many digits would be another number.

mod read;
mod stream;
mod wedges;
mod write;

pub use read::read;
pub(crate) use stream::read_file;
pub use write::write;
