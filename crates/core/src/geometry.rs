//! Geometry of single elements, in double precision.

pub mod frame;
pub mod triangle;

pub use frame::UnitFrame;
