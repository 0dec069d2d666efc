//! Spatial search trees for nearest-point queries.

pub mod bvh;

pub use bvh::{Bvh, Hint, Hit};
