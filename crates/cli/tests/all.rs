//! All tests of the crate in one program, since each test program links everything again (docs/decisions/0026).

mod bake;
mod clean;
mod cli;
mod compare_views;
mod doctor;
mod first_contact;
mod help;
mod lod;
mod materials;
mod memory;
mod method_collapses;
mod method_planar;
mod methods;
mod options;
mod progressive;
mod references;
mod render;
mod sandbox;
mod scenes;
mod sheets;
mod three_mf;
mod trust;
