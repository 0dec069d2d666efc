//! Spatial search trees for nearest points and for crossings of segments.

pub mod bvh;

pub use bvh::{Bvh, Crossing, Hint, Hit};
