//! Tests of the whole crate, in one program: each program links everything again (docs/decisions/0026).

mod bake;
mod clean;
mod cli;
mod compare_views;
mod desk;
mod doctor;
mod help;
mod lod;
mod materials;
mod memory;
mod method_collapses;
mod method_planar;
mod methods;
mod options;
mod places;
mod progressive;
mod render;
mod sheets;
mod three_mf;
mod trust;
mod words;
