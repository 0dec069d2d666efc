//! Trees over space: what lies near a point.

pub mod bvh;

pub use bvh::{Bvh, Hint, Hit};
