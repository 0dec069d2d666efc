//! Tests of the whole crate, in one program: each program links everything again (docs/decisions/0026).

mod bvh_properties;
mod measure_known;
mod measure_proof;
mod properties;
mod regressions;
