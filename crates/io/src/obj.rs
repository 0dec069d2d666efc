//! Wavefront OBJ.
//!
//! Read: `v` (with colours behind the position), `vt`, `vn`, `f` with any number of corners and with negative indices,
//! `o`, `g`, `usemtl` and `s`, which make regions of the faces, and `mtllib`. Lines and points are dropped with a warning.
//! A large file is read in pieces and never held as a whole.
//!
//! Libraries of materials (MTL) are read along, but only to know the textures: on the way out they are written beside
//! the OBJ as they were, with paths that are right there ([`Textures`]).
//!
//! Positions are kept in double precision where any coordinate of the file needs it: it has at least 8 significant
//! digits, and the nearest `f32` printed with as many digits would be another number.

mod read;
mod stream;
mod wedges;
mod write;

pub use crate::material::{Library, Region, Regions, Textures};
pub use read::read;
pub(crate) use stream::read_file;
pub use write::write;
pub(crate) use write::write_naming;
