//! Shared code of the fuzz targets: checks of every reader, and random meshes and options.

pub mod reading;
pub mod soup;
