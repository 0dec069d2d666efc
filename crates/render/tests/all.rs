//! Tests of the whole crate, in one program: each program links everything again (docs/decisions/0026).

mod known;
mod pictures;
