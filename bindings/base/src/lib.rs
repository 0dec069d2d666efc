//! Code that the packages for other languages share: simplification of index buffers with the arguments of
//! meshoptimizer, and names of attributes.

pub mod indices;
pub mod names;
