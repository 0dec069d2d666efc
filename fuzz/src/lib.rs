//! What fuzz targets share: what is held of every reader, and meshes and options made of bytes.

pub mod reading;
pub mod soup;
