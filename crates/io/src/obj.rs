//! Wavefront OBJ.
//!
//! Reads `v` (with colours after the position), `vt`, `vn`, `f` with any number of corners and with negative
//! indices, `o`, `g`, `usemtl` and `s`, which make regions of the faces, and `mtllib`. Lines and points are
//! dropped with a warning. A large file is read in pieces and never held in memory as a whole.
//!
//! Material libraries (MTL) are read too, but only for the textures that they name: the libraries are written
//! beside the output OBJ unchanged except for the paths of textures ([`Textures`]).
//!
//! Positions are kept in double precision if any coordinate of the file needs it: it has at least 8
//! significant digits, and the nearest `f32` printed with as many digits would be another number.

mod read;
mod stream;
mod wedges;
mod write;

pub use crate::material::{Library, Region, Regions, Textures};
pub use read::read;
pub(crate) use stream::read_file;
pub use write::write;
pub(crate) use write::write_with_libraries;
